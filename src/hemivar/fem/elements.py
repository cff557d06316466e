"""Shape functions of Lagrange triangles and tetrahedra in barycentric coordinates."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.mesh.keys import EDGES
from hemivar.mesh.mesh import Mesh

__all__ = ["barycentric_gradients", "shape_derivatives", "shape_values", "voigt_index"]


def voigt_index(dim: int) -> Array:
    """Row of the elasticity matrix that belongs to a pair of indices, shape (d, d)."""
    table = [[0, 2], [2, 1]] if dim == 2 else [[0, 5, 4], [5, 1, 3], [4, 3, 2]]
    return np.array(table)


def barycentric_gradients(mesh: Mesh, cells: slice | IntArray = slice(None)) -> Array:
    """Gradients of the barycentric coordinates, shape (M, d + 1, d)."""
    corner = mesh.points[mesh.cells[cells]]
    gradients = np.empty(corner.shape)
    if mesh.dim == 2:
        double_area = 2.0 * mesh.volumes[cells]
        for k in range(3):
            edge = corner[:, (k + 2) % 3] - corner[:, (k + 1) % 3]
            gradients[:, k, 0] = -edge[:, 1] / double_area
            gradients[:, k, 1] = edge[:, 0] / double_area
        return gradients
    side = corner[:, 1:] - corner[:, :1]
    six_volume = 6.0 * mesh.volumes[cells][:, None]
    for k in range(3):
        gradients[:, k + 1] = np.cross(side[:, (k + 1) % 3], side[:, (k + 2) % 3]) / six_volume
    gradients[:, 0] = -gradients[:, 1:].sum(axis=1)
    return gradients


def _edge_pairs(corners: int) -> tuple[tuple[int, int], ...]:
    return ((0, 1),) if corners == 2 else EDGES[corners - 1]


def shape_values(order: int, barycentric: Array) -> Array:
    """Shape functions, vertices then edges.

    Parameters
    ----------
    order : int
    barycentric : array, shape (..., d + 1)

    Returns
    -------
    array, shape (..., number of local nodes)
    """
    if order == 1:
        return barycentric
    vertex = barycentric * (2.0 * barycentric - 1.0)
    pairs = _edge_pairs(barycentric.shape[-1])
    edge = np.stack([4.0 * barycentric[..., a] * barycentric[..., b] for a, b in pairs], axis=-1)
    return np.concatenate([vertex, edge], axis=-1)


def shape_derivatives(order: int, barycentric: Array) -> Array:
    """Derivatives of the shape functions by the barycentric coordinates, shape (local nodes, d + 1).

    ``barycentric`` has shape (d + 1,).
    """
    corners = len(barycentric)
    if order == 1:
        return np.eye(corners)
    pairs = _edge_pairs(corners)
    result = np.zeros((corners + len(pairs), corners))
    result[:corners] = np.diag(4.0 * barycentric - 1.0)
    for k, (a, b) in enumerate(pairs):
        result[corners + k, a] = 4.0 * barycentric[b]
        result[corners + k, b] = 4.0 * barycentric[a]
    return result
