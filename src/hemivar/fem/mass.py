"""Mass matrices, and Winkler bedding: stiffness plus a mass matrix of the bedding."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.assembly import portions, stiffness_blocks
from hemivar.fem.constitutive import elastic
from hemivar.fem.edge_blocks import EdgeBlocks, NodeGraph, node_graph
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import at_quadrature_points, quadrature_rule
from hemivar.fem.springs import add_springs
from hemivar.mechanics.gradient_material import GradientMaterial
from hemivar.mechanics.kinematics import BodyKinematics
from hemivar.mechanics.material import Material
from hemivar.mechanics.per_volume import Regional, at_place, constant_of
from hemivar.mechanics.single_material import SingleMaterial
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.stored_energy import refuse_nonlinear
from hemivar.mesh.mesh import Mesh

__all__ = [
    "MassDensity",
    "bedding_share",
    "body_blocks",
    "cell_masses",
    "inertia",
    "mass_blocks",
    "mass_matrix",
    "per_volume",
    "stated_bedding",
    "with_ground",
]


@dataclass(frozen=True, eq=False)
class MassDensity:
    """The factor c of a mass matrix ``int c u . v``: a mass, a capacity or the stiffness of a bedding, per volume."""

    at: Callable[[Array, Mapping[str, BoolArray] | None], Array]
    constant: float | None  # the number where it is the same everywhere

    @property
    def none(self) -> bool:
        """Whether there is nothing at all."""
        return self.constant == 0.0

    def over(self, body: BodyKinematics) -> MassDensity:
        """The same times the measure of a body."""
        return self if self.none or not body.ring else MassDensity(body.over(self.at), None)


def per_volume(value: Regional, name: str) -> MassDensity:
    """A number, a function of the place, or either by region."""
    return MassDensity(partial(at_place, value, name), constant_of(value))


def stated_bedding(problem: ContactProblem) -> MassDensity:
    """The bedding of a body."""
    return per_volume(problem.bedding, "bedding").over(problem.kinematics)


def inertia(material: Material) -> MassDensity:
    """The density of a material."""
    if not material.inert:
        raise ProblemError("a body without density has no inertia; give the material a density")

    def at(points: Array, regions: Mapping[str, BoolArray] | None) -> Array:
        density = material.density_at(points, regions)
        assert density is not None
        return density

    stated = material.density if isinstance(material, SingleMaterial | GradientMaterial) else None
    return MassDensity(at, None if stated is None else constant_of(stated)).over(
        BodyKinematics.of(material, 2)
    )  # rings are of the plane


def cell_masses(mesh: Mesh, order: int, density: MassDensity, cells: slice | IntArray = slice(None)) -> Array:
    """Matrices ``int_T c phi_k phi_l`` of some cells, shape (k, L, L), in the order of :meth:`Mesh.cell_nodes`.

    Exact for a constant; a density that varies is integrated by a rule of degree 2 more than the shape functions ask
    for.
    """
    constant = density.constant
    barycentric, weights = quadrature_rule(mesh.dim, 2 * order + (0 if constant is not None else 2))
    shapes = shape_values(order, barycentric)
    table = np.einsum("q,qk,ql->qkl", weights, shapes, shapes)
    volumes = mesh.volumes[cells]
    if constant is not None:
        return np.asarray(constant * volumes[:, None, None] * table.sum(axis=0))
    values, _ = at_quadrature_points(mesh, 2 * order + 2, density.at, cells)
    size = shapes.shape[1]
    return np.asarray(volumes[:, None] * (values @ table.reshape(len(weights), -1))).reshape(-1, size, size)


def mass_blocks(
    mesh: Mesh, density: MassDensity, graph: NodeGraph | None = None, into: EdgeBlocks | None = None
) -> EdgeBlocks:
    """Consistent mass matrix ``int c u . v`` by nodes and edges."""
    graph = node_graph(mesh, 1) if graph is None else graph
    into = graph.zeros(mesh.dim) if into is None else into
    on_nodes, on_edges = np.zeros(graph.count), np.zeros(len(graph.edges))
    corners, (one, other) = np.arange(graph.cells.shape[1]), graph.local
    for part in portions(mesh, graph.order):
        local = cell_masses(mesh, graph.order, density, part)
        on_nodes += np.bincount(graph.cells[part].ravel(), local[:, corners, corners].ravel(), minlength=graph.count)
        edge = graph.cell_edges[part]
        first, last = int(edge.min()), int(edge.max()) + 1
        on_edges[first:last] += np.bincount(
            (edge - first).ravel(), local[:, one, other].ravel(), minlength=last - first
        )
    for c in range(into.diagonal.shape[1]):
        into.diagonal[:, c, c] += on_nodes
        into.upper[:, c, c] += on_edges
    return into


def mass_matrix(mesh: Mesh, density: MassDensity, order: int = 1) -> sp.csr_array:
    """Consistent mass matrix ``v'M u = int c u . v``, shape (nodes * d, nodes * d)."""
    return mass_blocks(mesh, density, node_graph(mesh, order)).matrix()


def body_blocks(problem: ContactProblem, graph: NodeGraph) -> EdgeBlocks:
    """Stiffness with that of a bedding and of springs, by nodes and edges."""
    refuse_nonlinear(problem.material)
    return with_ground(
        problem, stiffness_blocks(problem.mesh, elastic(problem.material, problem.mesh.dim), graph), graph
    )


def with_ground(problem: ContactProblem, blocks: EdgeBlocks, graph: NodeGraph) -> EdgeBlocks:
    """Blocks with those of a bedding and of springs, in place."""
    add_springs(problem, blocks)
    bedding = stated_bedding(problem)
    return blocks if bedding.none else mass_blocks(problem.mesh, bedding, graph, blocks)


def bedding_share(mesh: Mesh, order: int, density: MassDensity, diagonal: Array) -> float:
    """How stiff a bedding is beside the elements, in the part of the body that feels least of it; 0 without any there.

    Shapes: ``diagonal`` (nodes, d).
    """
    if density.none:
        return 0.0
    nodes, count = mesh.cell_nodes(order), len(diagonal)
    own = np.zeros(count)
    for part in portions(mesh, order):
        local = cell_masses(mesh, order, density, part)
        entries = range(local.shape[1])
        own += np.bincount(nodes[part].ravel(), local[:, entries, entries].ravel(), minlength=count)
    ratio = own / diagonal.max(axis=1)
    felt = np.zeros(mesh.parts.count)
    np.maximum.at(felt, np.repeat(mesh.parts.cell, nodes.shape[1]), ratio[nodes].ravel())
    return float(felt.min())
