"""Point location and interpolation of finite element fields at arbitrary points, on other meshes for instance."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike

from hemivar.basics.arrays import ROUNDED, SAME, real_array
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.space import Field
from hemivar.errors import ProblemError
from hemivar.fem.elements import barycentric_gradients, shape_values
from hemivar.mesh.keys import PORTION
from hemivar.mesh.mesh import Mesh

if TYPE_CHECKING:
    from scipy.spatial import KDTree

__all__ = ["beside_nodes", "interpolate", "interpolation_matrix", "locate"]

#: Part of the way to the middle of a cell: beyond it no rounding of a place leads into another cell.
_BESIDE = 1e-6


def interpolate(source: Field | Mesh, values: Array, target: Field | Mesh | Array) -> Array:
    """Values at other points of a field given by its nodal values.

    Parameters
    ----------
    source : Field or Mesh
        Where the field lives; for a mesh the order follows from the number of rows of ``values``.
    values : array, shape (nodes, ...)
    target : Field, Mesh or array, shape (k, d)
        The nodes of the field map, the vertices of the mesh, or the points.

    Returns
    -------
    array, shape (k, ...)

    Raises
    ------
    ProblemError
        If shapes disagree or a point lies outside the mesh by more than half a cell. Points just outside, as
        on curved boundaries, get the continuation of the nearest cell.
    """
    mesh = source if isinstance(source, Mesh) else source.mesh
    nodal = real_array(values, "values", finite=False)
    rows = nodal.shape[0] if nodal.ndim else 0
    fits = 1 if rows == mesh.number_of_nodes else 2
    order = fits if isinstance(source, Mesh) else source.order
    expected = mesh.number_of_nodes if order == 1 else mesh.number_of_nodes + len(mesh.edges)
    if rows != expected:
        raise ProblemError(f"values has {rows} rows; a field of order {order} on this mesh has {expected} nodes")
    inside = None
    if isinstance(target, Field | Mesh):
        points, inside = target.nodes if isinstance(target, Field) else target.points, beside_nodes(mesh, target)
    else:
        points = real_array(target, "points", finite=False)
    matrix = interpolation_matrix(mesh, order, points, inside)
    return np.asarray(matrix @ nodal.reshape(rows, -1)).reshape(len(points), *nodal.shape[1:])


def beside_nodes(mesh: Mesh, target: Field | Mesh) -> Array | None:
    """Places (k, d) beside the nodes of a target, each inside of a cell of the node: on its own side of a contact.

    None where no two nodes of the ``mesh`` are at one place, so that nodes have one side only.
    """
    places = np.round((mesh.points - mesh.points.min(axis=0)) / (SAME * np.ptp(mesh.points, axis=0).max()))
    if len(np.unique(places, axis=0)) == len(places):
        return None
    to, order = (target.mesh, target.order) if isinstance(target, Field) else (target, 1)
    nodes, cells = to.nodes(order), to.cell_nodes(order)
    owner = np.zeros(len(nodes), dtype=np.int64)
    owner[cells] = np.arange(len(cells))[:, None]
    return np.asarray(nodes + _BESIDE * (to.points[to.cells].mean(axis=1)[owner] - nodes))


def interpolation_matrix(mesh: Mesh, order: int, points: Array, inside: Array | None = None) -> sp.csr_array:
    """Shape functions at points (k, d), sought at places ``inside`` (k, d) near them; (k, nodes), rows sum to one."""
    cells, barycentric = locate(mesh, points if inside is None else inside)
    if inside is not None:
        barycentric += np.einsum("kbd,kd->kb", barycentric_gradients(mesh)[cells], points - inside)
    barycentric[np.abs(barycentric) < ROUNDED] = 0.0
    barycentric /= barycentric.sum(axis=1, keepdims=True)
    shapes = shape_values(order, barycentric)
    nodes = mesh.cell_nodes(order)[cells]
    count = len(cells)
    pointer = np.arange(count + 1) * shapes.shape[1]
    total = mesh.number_of_nodes if order == 1 else mesh.number_of_nodes + len(mesh.edges)
    matrix = sp.csr_array((shapes.ravel(), nodes.ravel(), pointer), shape=(count, total))
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return matrix


def locate(mesh: Mesh, points: ArrayLike) -> tuple[IntArray, Array]:
    """The cell that holds each point, or the nearest one, and the barycentric coordinates in it.

    A cell can hold a point only if its centroid is as near as its radius. Cells are therefore searched in
    classes of like radius, nearest centroids first.

    Shapes: ``points`` (k, d); returns ``cells`` (k,), ``barycentric`` (k, d + 1).
    """
    points = real_array(points, "points", finite=False)
    if points.ndim != 2 or points.shape[1] != mesh.dim or not np.all(np.isfinite(points)):
        raise ProblemError(f"points must be finite, of shape (k, {mesh.dim}); they have shape {points.shape}")
    with IMPORTS:
        from scipy.spatial import KDTree  # only here: SciPy takes long to load it

    search = _Search(mesh, points)
    corner = mesh.points[mesh.cells]
    radius = np.sqrt(np.max(np.sum((corner - search.centroids[:, None]) ** 2, axis=2), axis=1))
    size_class = np.floor(np.log2(radius / radius.max()) + 1e-9).astype(int)
    first = 6 if mesh.dim == 2 else 16
    for number in np.unique(size_class):
        members = np.flatnonzero(size_class == number)
        tree = KDTree(search.centroids[members])
        bound = float(radius[members].max()) * (1 + 1e-9)
        for neighbours in (first, 6 * first, 36 * first):
            search.visit(tree, members, min(neighbours, len(members)), bound)
            if neighbours >= len(members):
                break
    search.visit(KDTree(search.centroids), np.arange(mesh.number_of_cells), min(4, mesh.number_of_cells), np.inf)
    outside = search.lowest < -0.5
    if outside.any():
        bad = int(np.flatnonzero(outside)[0])
        raise ProblemError(
            f"{np.count_nonzero(outside)} points lie outside the mesh, the first at x = "
            f"{points[bad].tolist()}; interpolate between meshes of the same body only"
        )
    return search.cell, search.barycentric


class _Search:
    """Best cell found so far for each point."""

    def __init__(self, mesh: Mesh, points: Array) -> None:
        self.points = points
        self.centroids = mesh.points[mesh.cells].mean(axis=1)
        self.gradients = barycentric_gradients(mesh)
        self.heights = 1.0 / np.linalg.norm(self.gradients, axis=2)
        self.cell = np.zeros(len(points), dtype=np.int64)
        self.barycentric = np.zeros((len(points), mesh.dim + 1))
        self.lowest = np.full(len(points), -np.inf)
        self.distance = np.full(len(points), -np.inf)

    def visit(self, tree: KDTree, members: IntArray, neighbours: int, bound: float) -> None:
        """Try the nearest members for the points that are in no cell yet."""
        todo = np.flatnonzero(self.lowest < -SAME)
        for start in range(0, len(todo), PORTION):
            self._visit(tree, members, neighbours, bound, todo[start : start + PORTION])

    def _visit(self, tree: KDTree, members: IntArray, neighbours: int, bound: float, ids: IntArray) -> None:
        _, nearest = tree.query(self.points[ids], k=neighbours, distance_upper_bound=bound)
        nearest = np.asarray(nearest).reshape(len(ids), -1)
        missing = nearest == len(members)
        cells = members[np.where(missing, 0, nearest)]
        offset = self.points[ids, None] - self.centroids[cells]
        corners = self.barycentric.shape[1]
        barycentric = 1.0 / corners + np.einsum("kcbd,kcd->kcb", self.gradients[cells], offset)
        distance = np.min(np.minimum(barycentric, 0.0) * self.heights[cells], axis=2)
        distance[missing] = -np.inf
        inside = np.min(barycentric, axis=2)
        score = np.where(distance < 0.0, distance, np.maximum(inside, 0.0))
        best = np.argmax(score, axis=1)
        every = np.arange(len(ids))
        better = score[every, best] > self.distance[ids]
        ids, rows, best = ids[better], every[better], best[better]
        self.cell[ids] = cells[rows, best]
        self.barycentric[ids] = barycentric[rows, best]
        self.lowest[ids] = inside[rows, best]
        self.distance[ids] = score[rows, best]
