"""Linear elasticity by code of our own: stiffness and load of simplices of order 1 and 2, written out plainly."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

__all__ = ["Body", "gauss_rule", "isotropic", "load_of_body", "load_of_facets", "mass", "stiffness"]

_PAIRS = {2: [(0, 0), (1, 1), (0, 1)], 3: [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]}


@dataclass
class Body:
    """Nodes and cells of a mesh; for order 2 the cells hold the middles of their edges as VTK has them."""

    nodes: np.ndarray
    cells: np.ndarray

    @property
    def dim(self) -> int:
        return self.nodes.shape[1]

    @property
    def order(self) -> int:
        return 1 if self.cells.shape[1] == self.dim + 1 else 2

    @property
    def corners(self) -> np.ndarray:
        return self.nodes[self.cells[:, : self.dim + 1]]

    @property
    def volumes(self) -> np.ndarray:
        edges = self.corners[:, 1:] - self.corners[:, :1]
        return np.abs(np.linalg.det(edges)) / math.factorial(self.dim)


#: Edges of a simplex in the order in which VTK numbers the nodes on them.
_EDGES = {1: [(0, 1)], 2: [(0, 1), (1, 2), (0, 2)], 3: [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]}


def _shapes(order: int, place: np.ndarray) -> np.ndarray:
    """Shape functions at a barycentric place."""
    if order == 1:
        return place
    edges = [4.0 * place[a] * place[b] for a, b in _EDGES[len(place) - 1]]
    return np.concatenate([place * (2.0 * place - 1.0), edges])


def _slopes(order: int, place: np.ndarray) -> np.ndarray:
    """Derivatives of the shape functions by the barycentric coordinates."""
    if order == 1:
        return np.eye(len(place))
    rows = [np.diag(4.0 * place - 1.0)]
    for a, b in _EDGES[len(place) - 1]:
        row = np.zeros((1, len(place)))
        row[0, a], row[0, b] = 4.0 * place[b], 4.0 * place[a]
        rows.append(row)
    return np.concatenate(rows)


def gauss_rule(dim: int, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Barycentric places and weights (of sum 1) of a Gauss rule on a cube that is collapsed to a simplex."""
    x, w = np.polynomial.legendre.leggauss(points)
    x, w = 0.5 * (x + 1.0), 0.5 * w
    places, weights = [], []
    for index in itertools.product(range(points), repeat=dim):
        rest, weight, place = 1.0, math.factorial(dim), []
        for level, i in enumerate(index):
            place.append(rest * x[i])
            weight *= w[i] * (1.0 - x[i]) ** (dim - 1 - level)
            rest *= 1.0 - x[i]
        places.append([*place, rest])
        weights.append(weight)
    return np.array(places), np.array(weights)


def isotropic(lam: float, mu: float, dim: int, plane: str) -> np.ndarray:
    """Elasticity matrix in the order xx, yy, (zz, yz, xz,) xy with engineering shear strains."""
    if dim == 2 and plane == "stress":
        lam = 2.0 * lam * mu / (lam + 2.0 * mu)
    size = len(_PAIRS[dim])
    matrix = np.zeros((size, size))
    matrix[:dim, :dim] = lam
    matrix[:dim, :dim] += 2.0 * mu * np.eye(dim)
    matrix[dim:, dim:] = mu * np.eye(size - dim)
    return matrix


def stiffness(body: Body, material: Callable[[np.ndarray], np.ndarray], points: int) -> sp.csr_array:
    """Stiffness matrix for unknowns ``node d + i``.

    ``material`` gets one place in each cell, (cells, d), and returns elasticity matrices, (cells, s, s). It is asked at
    the Gauss points of a rule of so many ``points`` an axis, or, with 0, at the centroids only.
    """
    d, order = body.dim, body.order
    edges = body.corners[:, 1:] - body.corners[:, :1]
    inverse = np.linalg.inv(edges)  # columns: gradients of the barycentric coordinates 1..d
    gradients = np.concatenate([-inverse.sum(axis=2, keepdims=True), inverse], axis=2).transpose(0, 2, 1)
    places, weights = gauss_rule(d, max(points, 2))
    fixed = material(body.corners.mean(axis=1)) if points == 0 else None
    count = body.cells.shape[1]
    total = np.zeros((len(body.cells), count * d, count * d))
    for place, weight in zip(places, weights, strict=True):
        slope = np.einsum("nb,mbi->mni", _slopes(order, place), gradients)
        strain = np.zeros((len(body.cells), len(_PAIRS[d]), count * d))
        for row, (i, j) in enumerate(_PAIRS[d]):
            if i == j:
                strain[:, row, i::d] = slope[:, :, i]
            else:
                strain[:, row, i::d] = slope[:, :, j]
                strain[:, row, j::d] = slope[:, :, i]
        matrices = material(np.einsum("k,mkd->md", place, body.corners)) if fixed is None else fixed
        total += weight * body.volumes[:, None, None] * (strain.transpose(0, 2, 1) @ matrices @ strain)
    unknowns = (body.cells[:, :, None] * d + np.arange(d)).reshape(len(body.cells), -1)
    rows = np.repeat(unknowns, count * d, axis=1).ravel()
    columns = np.tile(unknowns, (1, count * d)).ravel()
    size = len(body.nodes) * d
    return sp.csr_array(sp.coo_array((total.ravel(), (rows, columns)), shape=(size, size)))


def mass(body: Body) -> sp.csr_array:
    """Mass matrix of a density of one, for unknowns ``node d + i``."""
    d, count = body.dim, body.cells.shape[1]
    places, weights = gauss_rule(d, 2 * body.order)
    shapes = np.array([_shapes(body.order, place) for place in places])
    local = np.einsum("q,qa,qb->ab", weights, shapes, shapes)
    blocks = np.kron(local, np.eye(d)) * body.volumes[:, None, None]
    unknowns = (body.cells[:, :, None] * d + np.arange(d)).reshape(len(body.cells), -1)
    rows = np.repeat(unknowns, count * d, axis=1).ravel()
    columns = np.tile(unknowns, (1, count * d)).ravel()
    size = len(body.nodes) * d
    return sp.csr_array(sp.coo_array((blocks.ravel(), (rows, columns)), shape=(size, size)))


def load_of_body(body: Body, force: Callable[[np.ndarray], np.ndarray], points: int = 4) -> np.ndarray:
    """Load of a force per volume; ``force`` gets one place."""
    return _load(body.nodes, body.cells, body.corners, body.volumes, body.order, lambda x, _: force(x), points)


def load_of_facets(
    body: Body,
    facets: np.ndarray,
    measures: np.ndarray,
    force: Callable[[np.ndarray, int], np.ndarray],
    points: int = 4,
) -> np.ndarray:
    """Load of a force per area of facets; ``force`` gets a place and the number of the facet."""
    return _load(body.nodes, facets, body.nodes[facets[:, : body.dim]], measures, body.order, force, points)


def _load(
    nodes: np.ndarray,
    members: np.ndarray,
    corners: np.ndarray,
    measures: np.ndarray,
    order: int,
    force: Callable[[np.ndarray, int], np.ndarray],
    points: int,
) -> np.ndarray:
    load = np.zeros(nodes.shape)
    places, weights = gauss_rule(corners.shape[1] - 1, points)
    for place, weight in zip(places, weights, strict=True):
        shape = _shapes(order, place)
        where = np.einsum("k,mkd->md", place, corners)
        values = np.array([force(x, i) for i, x in enumerate(where)]).reshape(len(where), -1)
        for column, part in enumerate(shape):
            np.add.at(load, members[:, column], weight * part * measures[:, None] * values)
    return load.ravel()
