"""Shape functions of Lagrange triangles and tetrahedra, in barycentric coordinates."""

from __future__ import annotations

import math

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.mesh.keys import EDGES
from hemivar.mesh.mesh import Mesh

__all__ = ["barycentric_gradients", "scaled_gradients", "shape_derivatives", "shape_values"]


def barycentric_gradients(mesh: Mesh, cells: slice | IntArray = slice(None)) -> Array:
    """Gradients of the barycentric coordinates, shape (M, d + 1, d)."""
    return np.ascontiguousarray(scaled_gradients(mesh, cells, mesh.volumes[cells]).transpose(2, 0, 1))


def scaled_gradients(mesh: Mesh, cells: slice | IntArray, size: Array) -> Array:
    """Gradients of the barycentric coordinates times the volume of each cell over its ``size`` (k,), (d + 1, d, k)."""
    dim = mesh.dim
    first, *others = mesh.cells[cells].T
    side = [[x[other] - x[first] for x in mesh.points.T] for other in others]
    gradients = np.empty((dim + 1, dim, len(first)))
    scale = 1.0 / (math.factorial(dim) * size)
    if dim == 2:
        gradients[1] = side[1][1] * scale, -side[1][0] * scale
        gradients[2] = -side[0][1] * scale, side[0][0] * scale
    else:
        for k in range(3):
            left, right = side[(k + 1) % 3], side[(k + 2) % 3]
            for i in range(3):
                p, q = (i + 1) % 3, (i + 2) % 3
                gradients[k + 1, i] = (left[p] * right[q] - left[q] * right[p]) * scale
    np.negative(gradients[1:].sum(axis=0), out=gradients[0])
    return gradients


def _edge_pairs(corners: int) -> tuple[tuple[int, int], ...]:
    return ((0, 1),) if corners == 2 else EDGES[corners - 1]


def shape_values(order: int, barycentric: Array) -> Array:
    """Shape functions, vertices then edges.

    Shapes: ``barycentric`` (..., d + 1).
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
