"""Mass matrices, and the body with an elastic bedding: stiffness plus a mass matrix of the bedding."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.fem.assembly import EdgeBlocks, linear_stiffness, quadrature_rule, region_masks, stiffness_matrix
from hemivar.fem.elements import shape_values
from hemivar.mechanics.bedding import Bedding
from hemivar.mechanics.material import Material
from hemivar.mechanics.per_volume import PerVolume
from hemivar.mesh.keys import EDGES
from hemivar.mesh.mesh import Mesh

__all__ = ["body_blocks", "body_matrix", "cell_masses", "mass_blocks", "mass_matrix", "resists"]

#: In how many portions cells are summed, and the least number of them.
_PORTIONS = 16
_PORTION = 1 << 14
#: Ratio of bedding and stiffness at a node below which the bedding is lost in the rounding of the stiffness.
_FELT = 1e-12


def cell_masses(mesh: Mesh, order: int, bedding: Bedding | PerVolume, cells: slice | IntArray = slice(None)) -> Array:
    """Matrices ``int_T bedding phi_k phi_l`` of some cells, shape (k, L, L), in the order of :meth:`Mesh.cell_nodes`.

    Exact for a constant; a bedding that varies is integrated by a rule of degree 2 more than the shape functions ask
    for.
    """
    constant = bedding.constant
    barycentric, weights = quadrature_rule(mesh.dim, 2 * order + (0 if constant is not None else 2))
    shapes = shape_values(order, barycentric)
    table = np.einsum("q,qk,ql->qkl", weights, shapes, shapes)
    volumes = mesh.volumes[cells]
    if constant is not None:
        return np.asarray(constant * volumes[:, None, None] * table.sum(axis=0))
    points = np.einsum("qk,mkd->mqd", barycentric, mesh.points[mesh.cells[cells]])
    masks = {name: np.repeat(mask[cells], len(weights)) for name, mask in region_masks(mesh).items()}
    values = bedding.at(points.reshape(-1, mesh.dim), masks).reshape(len(points), len(weights))
    size = shapes.shape[1]
    return np.asarray(volumes[:, None] * (values @ table.reshape(len(weights), -1))).reshape(-1, size, size)


def _portions(mesh: Mesh) -> list[slice]:
    count = mesh.number_of_cells
    step = max(count // _PORTIONS + 1, _PORTION)
    return [slice(start, start + step) for start in range(0, count, step)]


def mass_blocks(mesh: Mesh, bedding: Bedding, into: EdgeBlocks | None = None) -> EdgeBlocks:
    """Consistent mass matrix ``int bedding u . v`` of linear elements by nodes and edges.

    Parameters
    ----------
    mesh : Mesh
    bedding : Bedding
        The density, or the stiffness of a bedding; ``Bedding(material=material, factor=1.0)`` is the density.
    into : EdgeBlocks, optional
        Of the same mesh; they are added to in place, and returned.
    """
    dim, count, edges = mesh.dim, mesh.number_of_nodes, mesh.edges
    on_nodes, on_edges = np.zeros(count), np.zeros(len(edges))
    for part in _portions(mesh):
        local = cell_masses(mesh, 1, bedding, part)
        corners = range(dim + 1)
        on_nodes += np.bincount(mesh.cells[part].ravel(), local[:, corners, corners].ravel(), minlength=count)
        edge = mesh.cell_edges[part]
        first, last = int(edge.min()), int(edge.max()) + 1
        pairs = np.stack([local[:, a, b] for a, b in EDGES[dim]], axis=1)
        on_edges[first:last] += np.bincount((edge - first).ravel(), pairs.ravel(), minlength=last - first)
    if into is None:
        into = EdgeBlocks(np.zeros((count, dim, dim)), np.zeros((len(edges), dim, dim)), edges)
    for c in range(dim):
        into.diagonal[:, c, c] += on_nodes
        into.upper[:, c, c] += on_edges
    return into


def mass_matrix(mesh: Mesh, bedding: Bedding, order: int = 1) -> sp.csr_array:
    """Consistent mass matrix ``v'M u = int bedding u . v``, shape (nodes * d, nodes * d)."""
    if order == 1:
        return mass_blocks(mesh, bedding).matrix()
    nodes = mesh.cell_nodes(order)
    size, local = nodes.shape[1], cell_masses(mesh, order, bedding)
    rows, columns = np.repeat(nodes, size, axis=1), np.tile(nodes, (1, size))
    count = len(mesh.nodes(order))
    scalar = sp.csr_array((local.ravel(), (rows.ravel(), columns.ravel())), shape=(count, count))
    return sp.csr_array(sp.kron(scalar, sp.eye_array(mesh.dim), format="csr"))


def body_blocks(mesh: Mesh, material: Material, bedding: Bedding) -> EdgeBlocks:
    """Stiffness of linear elements with that of a bedding, by nodes and edges."""
    blocks = linear_stiffness(mesh, material)
    return blocks if bedding.none else mass_blocks(mesh, bedding, blocks)


def body_matrix(mesh: Mesh, material: Material, bedding: Bedding, order: int) -> sp.csr_array:
    """Stiffness with that of a bedding, shape (nodes * d, nodes * d)."""
    stiffness = stiffness_matrix(mesh, material, order)
    return stiffness if bedding.none else sp.csr_array(stiffness + mass_matrix(mesh, bedding, order))


def resists(mesh: Mesh, order: int, bedding: Bedding | PerVolume, diagonal: Array) -> bool:
    """Whether a bedding resists every motion of every part of a body, by more than rounding.

    Parameters
    ----------
    mesh : Mesh
    order : int
    bedding : Bedding or PerVolume
    diagonal : array, shape (nodes, d)
        Of the stiffness with the bedding.
    """
    if bedding.none:
        return False
    nodes, count = mesh.cell_nodes(order), len(diagonal)
    own = np.zeros(count)
    for part in _portions(mesh):
        local = cell_masses(mesh, order, bedding, part)
        entries = range(local.shape[1])
        own += np.bincount(nodes[part].ravel(), local[:, entries, entries].ravel(), minlength=count)
    ratio = own / diagonal.max(axis=1)
    felt = np.zeros(mesh.parts.count)
    np.maximum.at(felt, np.repeat(mesh.parts.cell, nodes.shape[1]), ratio[nodes].ravel())
    return bool((felt > _FELT).all())
