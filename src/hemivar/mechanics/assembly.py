"""Stiffness matrices and load vectors.

The degree of freedom of component c at node k is ``k d + c``. Nodes of order 2 are the vertices and then the
edge midpoints of the mesh.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import scipy.sparse as sp
import skfem

from hemivar._typing import Array, BoolArray, IntArray
from hemivar.mechanics._elements import barycentric_gradients, shape_values, voigt_index
from hemivar.mechanics.conditions import Pressure, evaluate_scalar, evaluate_vector
from hemivar.mechanics.material import Material
from hemivar.mechanics.mesh import _EDGES, Mesh

__all__ = ["load_vector", "quadrature_rule", "region_masks", "stiffness_matrix"]

_CHUNK = 1 << 17
_REFERENCE = {1: skfem.refdom.RefLine, 2: skfem.refdom.RefTri, 3: skfem.refdom.RefTet}


def quadrature_rule(dim: int, degree: int) -> tuple[Array, Array]:
    """A quadrature rule on the simplex that is exact for polynomials of the given degree.

    Returns
    -------
    barycentric : array, shape (q, d + 1)
    weights : array, shape (q,)
        They sum to one.
    """
    points, weights = skfem.quadrature.get_quadrature(_REFERENCE[dim], degree)
    return np.column_stack([1.0 - points.sum(axis=0), points.T]), np.asarray(weights) * math.factorial(dim)


def region_masks(mesh: Mesh) -> dict[str, BoolArray]:
    """Which cells belong to which region, each of shape (M,)."""
    masks = {}
    for name, ids in mesh.regions.items():
        mask = np.zeros(mesh.number_of_cells, dtype=bool)
        mask[ids] = True
        masks[name] = mask
    return masks


def stiffness_matrix(mesh: Mesh, material: Material, order: int = 1) -> sp.csr_array:
    """Stiffness matrix of linear elasticity, ``v'K u = int eps(v) : C eps(u)``.

    Parameters
    ----------
    mesh : Mesh
    material : Material
        Varying coefficients are integrated by a rule of degree 2 (order 1) or 4 (order 2).
    order : int
        1 or 2.

    Returns
    -------
    sparse array, shape (nodes * d, nodes * d)

    Raises
    ------
    ProblemError
        If the material is not positive definite somewhere.
    """
    return _linear_stiffness(mesh, material) if order == 1 else _form_stiffness(mesh, material, order)


def _tensors(mesh: Mesh, material: Material, degree: int) -> tuple[Array, Array]:
    """Elasticity matrices at quadrature points, shape (M, q, v, v), and the weights of the rule, shape (q,).

    A homogeneous material gives a single matrix, shape (1, 1, v, v).
    """
    if material.homogeneous:
        return material.stiffness_tensor(mesh.points[:1])[None], np.ones(1)
    barycentric, weights = quadrature_rule(mesh.dim, degree)
    count, rule = mesh.number_of_cells, len(weights)
    points = np.einsum("qk,mkd->mqd", barycentric, mesh.points[mesh.cells]).reshape(-1, mesh.dim)
    masks = {name: np.repeat(mask, rule) for name, mask in region_masks(mesh).items()}
    tensor = material.stiffness_tensor(points, masks)
    return tensor.reshape(count, rule, *tensor.shape[1:]), weights


def _linear_stiffness(mesh: Mesh, material: Material) -> sp.csr_array:
    """Linear elements: blocks summed node by node and edge by edge, no matrix per element is stored."""
    dim, count = mesh.dim, mesh.number_of_nodes
    tensor, weights = _tensors(mesh, material, 2)
    mean = np.einsum("q,mqvw->mvw", weights, tensor)
    index = voigt_index(dim)
    edges, cell_edges = mesh.edges, mesh.cell_edges
    diagonal = np.zeros((count, dim, dim))
    upper = np.zeros((len(edges), dim, dim))
    for start in range(0, mesh.number_of_cells, _CHUNK):
        part = slice(start, start + _CHUNK)
        cells, volume = mesh.cells[part], mesh.volumes[part]
        gradient = barycentric_gradients(mesh, part)
        four = mean[0 if len(mean) == 1 else part][..., index[:, :, None, None], index]
        if four.ndim == 4:
            flux = np.tensordot(gradient * volume[:, None, None], four, axes=(2, 3))
        else:
            flux = np.einsum("mbl,mikjl->mbikj", gradient * volume[:, None, None], four)
        for a in range(dim + 1):
            block = np.einsum("mk,mikj->mij", gradient[:, a], flux[:, a])
            _accumulate(diagonal, cells[:, a], 0.5 * (block + block.transpose(0, 2, 1)))
        for k, (a, b) in enumerate(_EDGES[dim]):
            block = np.einsum("mk,mikj->mij", gradient[:, a], flux[:, b])
            swapped = cells[:, a] > cells[:, b]
            block[swapped] = block[swapped].transpose(0, 2, 1)
            _accumulate(upper, cell_edges[part, k], block)
    nodes = np.arange(count)
    rows = np.concatenate([nodes, edges[:, 0], edges[:, 1]])
    columns = np.concatenate([nodes, edges[:, 1], edges[:, 0]])
    pattern = sp.csr_array((np.arange(len(rows)), (rows, columns)), shape=(count, count))
    pattern.sort_indices()
    blocks = np.concatenate([diagonal, upper, upper.transpose(0, 2, 1)])[pattern.data]
    matrix = sp.bsr_array((blocks, pattern.indices, pattern.indptr), shape=(count * dim, count * dim))
    return sp.csr_array(matrix.tocsr())


def _accumulate(target: Array, index: IntArray, blocks: Array) -> None:
    """``target[index] += blocks``, repeated indices summed."""
    for i in range(target.shape[1]):
        for j in range(target.shape[2]):
            target[:, i, j] += np.bincount(index, weights=blocks[:, i, j], minlength=len(target))


def _form_stiffness(mesh: Mesh, material: Material, order: int) -> sp.csr_array:
    """Any order, by scikit-fem."""
    dim = mesh.dim
    tensor, _ = _tensors(mesh, material, 2 * order)
    constant = tensor.shape[0] == 1
    kinds: dict[tuple[int, int], Any] = {
        (2, 1): skfem.ElementTriP1,
        (2, 2): skfem.ElementTriP2,
        (3, 1): skfem.ElementTetP1,
        (3, 2): skfem.ElementTetP2,
    }
    element = skfem.ElementVector(kinds[dim, order]())
    library_mesh = _library_mesh(mesh)
    degree = 2 * (order - 1) if constant else 2 * order
    basis = skfem.Basis(library_mesh, element, intorder=max(degree, 1))
    coefficient = tensor[0, 0][..., None, None] if constant else np.moveaxis(tensor, (0, 1), (2, 3))
    terms = [(int(i), int(j)) for i, j in np.argwhere(np.any(coefficient != 0.0, axis=(2, 3)))]

    @skfem.BilinearForm  # type: ignore[untyped-decorator]
    def energy(u: Any, v: Any, w: Any) -> Any:
        strain, virtual = _voigt_strain(u.grad), _voigt_strain(v.grad)
        return sum(coefficient[i, j] * virtual[i] * strain[j] for i, j in terms)

    matrix = energy.assemble(basis).tocoo()
    number = _library_numbering(mesh, library_mesh, basis, order)
    size = len(mesh.nodes(order)) * dim
    return sp.csr_array((matrix.data, (number[matrix.row], number[matrix.col])), shape=(size, size))


def _voigt_strain(gradient: Any) -> list[Any]:
    dim = len(gradient)
    shear = [(0, 1)] if dim == 2 else [(1, 2), (0, 2), (0, 1)]
    return [gradient[i, i] for i in range(dim)] + [gradient[i, j] + gradient[j, i] for i, j in shear]


def _library_mesh(mesh: Mesh) -> Any:
    kind = skfem.MeshTri if mesh.dim == 2 else skfem.MeshTet
    return kind(np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.cells.T))


def _library_numbering(mesh: Mesh, library_mesh: Any, basis: Any, order: int) -> IntArray:
    """Our number of each of scikit-fem's degrees of freedom."""
    dim, count = mesh.dim, mesh.number_of_nodes
    number = np.empty(basis.N, dtype=np.int64)
    component = np.arange(dim)[:, None]
    number[basis.nodal_dofs] = np.arange(count) * dim + component
    if order == 2:
        pairs, dofs = (library_mesh.facets, basis.facet_dofs) if dim == 2 else (library_mesh.edges, basis.edge_dofs)
        low, high = np.sort(pairs.astype(np.int64), axis=0)
        edge = np.searchsorted(mesh.edges[:, 0] * count + mesh.edges[:, 1], low * count + high)
        number[dofs] = (count + edge) * dim + component
    return number


def load_vector(
    mesh: Mesh,
    order: int = 1,
    body_force: Any = 0.0,
    tractions: Mapping[str, Any] | None = None,
) -> Array:
    """Load vector ``F'v = int b . v + int_boundary t . v``.

    Parameters
    ----------
    mesh : Mesh
    order : int
        1 or 2.
    body_force : vector, shape (d,), or callable
        Integrated exactly if constant, else by a rule of degree 4.
    tractions : mapping of boundary name to vector, callable or Pressure
        Integrated by a rule of degree 5.

    Returns
    -------
    array, shape (nodes * d,)
    """
    nodes = len(mesh.nodes(order))
    load = np.zeros((nodes, mesh.dim))
    if callable(body_force) or np.any(np.asarray(body_force) != 0):
        degree = 4 if callable(body_force) else order
        _add_load(
            load, mesh.points[mesh.cells], mesh.cell_nodes(order), mesh.volumes, order, degree,
            lambda points, _: evaluate_vector(body_force, points, "body_force"),
        )  # fmt: skip
    for name, traction in (tractions or {}).items():
        facets = mesh.boundaries[name]
        normals, measures = mesh.facet_normals(facets)
        what = f"tractions['{name}']"

        def values(points: Array, facet: IntArray, traction: Any = traction, what: str = what,
                   normals: Array = normals) -> Array:  # fmt: skip
            if isinstance(traction, Pressure):
                return -evaluate_scalar(traction.value, points, what)[:, None] * normals[facet]
            return evaluate_vector(traction, points, what)

        _add_load(load, mesh.points[facets], mesh.facet_nodes(facets, order), measures, order, 5, values)
    return load.ravel()


def _add_load(
    load: Array,
    corners: Array,
    nodes: IntArray,
    measures: Array,
    order: int,
    degree: int,
    values: Callable[[Array, IntArray], Array],
) -> None:
    """Add the integrals of ``values`` times the shape functions over simplices with these corners."""
    barycentric, weights = quadrature_rule(corners.shape[1] - 1, degree)
    shapes = shape_values(order, barycentric)
    dim = load.shape[1]
    for start in range(0, len(corners), _CHUNK):
        part = slice(start, start + _CHUNK)
        points = np.einsum("qk,mkd->mqd", barycentric, corners[part])
        owner = np.repeat(np.arange(len(corners))[part], len(weights))
        force = values(points.reshape(-1, dim), owner).reshape(points.shape)
        local = np.einsum("q,qk,mqd,m->mkd", weights, shapes, force, measures[part], optimize=True)
        for c in range(dim):
            load[:, c] += np.bincount(nodes[part].ravel(), weights=local[:, :, c].ravel(), minlength=len(load))
