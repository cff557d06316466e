"""Symmetric stress elements on the Alfeld split with continuous tractions: linear, and in the plane quadratic.

A simplex is cut into d + 1 pieces that join its centroid to its facets. A stress of the element is symmetric and a
polynomial of degree 1 or 2 on every piece, and its tractions are continuous between the pieces.

Of degree 1 (Johnson, Krizek and Mercier) the moments of the tractions on the facets of the simplex, and the integral of
the stress, determine it: 15 numbers in the plane, 42 in space. Of degree 2 in the plane there are 36: the tractions
(18 moments against the quadratic functions of the edges), the divergence on the pieces (18, but for the balance of
forces and of the moment, 3), and 3 stresses without either, those of Airy functions that are C1, of degree 4 on the
pieces and vanish with their slope on the edges. The divergence is taken linear on the whole triangle here.

Everything is computed once on the reference simplex (origin and unit vectors) and mapped: with ``x = B x^ + b`` and
``J = |det B|`` the stress ``s = B s^ B' / J`` has divergence ``B div^ s^ / J``, moments ``m = B m^`` and the integral
``int s = B (int s^) B'``.

References: C. Johnson and B. Mercier, Numer. Math. 30 (1978); M. Krizek, Numer. Math. 41 (1983);
J. Gopalakrishnan, J. Guzman and J. J. Lee, arXiv 2403.13189 (any dimension); arXiv 2501.02691 (any degree).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.elements import shape_derivatives, shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.kernels import kernels
from hemivar.kernels.read_arrays import given, numbers
from hemivar.mesh.keys import EDGES

__all__ = [
    "MomentSpace",
    "SplitElement",
    "facet_mass",
    "pairs_of",
    "pulled_back",
    "split_element",
    "upper_pulled_back",
    "voigt",
    "voigt_map",
]

#: Cells whose stresses are held at a time: they fit a cache.
_CELLS = 1 << 12


def pairs_of(dim: int) -> tuple[tuple[int, int], ...]:
    """Indices of the components of a stress as they stand in a vector: 11, 22, 12 or 11, 22, 33, 23, 13, 12."""
    return ((0, 0), (1, 1), (0, 1)) if dim == 2 else ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))


def voigt(tensor: Array) -> Array:
    """The symmetric parts of tensors (..., d, d) as vectors (..., v); shear stresses stand there once."""
    rows, columns = np.array(pairs_of(tensor.shape[-1])).T
    return np.asarray(0.5 * (tensor[..., rows, columns] + tensor[..., columns, rows]))


def voigt_map(matrix: Array) -> Array:
    """The matrices (..., v, v) of ``s -> B s B'`` on stresses as vectors, for B of shape (..., d, d)."""
    pairs = pairs_of(matrix.shape[-1])
    out = np.empty((*matrix.shape[:-2], len(pairs), len(pairs)))
    for row, (i, j) in enumerate(pairs):
        for column, (k, m) in enumerate(pairs):
            out[..., row, column] = matrix[..., i, k] * matrix[..., j, m]
            if k != m:
                out[..., row, column] += matrix[..., i, m] * matrix[..., j, k]
    return out


def pulled_back(compliance: Array, jacobian: Array, size: Array) -> Array:
    """Compliance on the reference simplex: ``int_T s : D s = int_T^ s^ : D^ s^`` with ``D^ = P'D P / J``.

    ``compliance`` is (M or 1, v, v); ``jacobian`` is (M, d, d); ``size`` is (M,); returns (M, v, v).
    """
    matrix = np.broadcast_to(compliance, (len(jacobian), *compliance.shape[1:]))
    out = np.empty(matrix.shape)
    for start in range(0, len(out), _CELLS):
        part = slice(start, start + _CELLS)
        change = voigt_map(jacobian[part])
        change /= np.sqrt(size[part])[:, None, None]
        np.matmul(change.transpose(0, 2, 1) @ matrix[part], change, out=out[part])
    return out


def upper_pulled_back(compliance: Array, points: Array, cells: IntArray, size: Array) -> Array | None:
    """Upper triangles (M, v (v + 1) / 2) of :func:`pulled_back`, row after row; None without kernels.

    ``compliance`` is (M or 1, v, v); ``points`` is (N, d); ``cells`` is (M, d + 1).
    """
    library, (count, corners), number = kernels(), cells.shape, compliance.shape[-1]
    if library is None:
        return None
    arrays = (
        given("compliance", compliance, (1 if len(compliance) == 1 else count, number, number)),
        given("points", points, (len(points), corners - 1)),
        numbers("cells", cells, (count, corners), len(points)),
        given("sizes", size, (count,)),
        np.empty((count, number * (number + 1) // 2)),
    )
    library.check(library.call.hv_pull_back(corners - 1, count, len(compliance), *map(library.address, arrays)))
    return arrays[-1]


@dataclass(frozen=True, eq=False)
class SplitElement:
    """The element on the reference simplex.

    Facet i of the simplex is opposite to vertex i, its vertices are the others in their order, and its midpoint, for
    degree 2, stands behind them. Piece i joins facet i to the centroid: its vertices are those of the simplex with the
    centroid in the place of vertex i, its midpoints those of the edges in the order of ``hemivar.mesh.keys.EDGES``.
    """

    dim: int
    #: Degree of the stress on the pieces.
    order: int
    #: Stress at the nodes of the pieces (piece, node, component) for each of the n degrees of freedom. Those are the
    #: moments ``int s nu phi_a`` (facet i, node, component c), then for degree 1 ``int s``, for degree 2 the load ``int
    #: f phi_a`` (vertex, component) with ``div s = -f``, f linear, and what has neither.
    values: Array  # (d + 1, l, v, n)
    #: That of the functions of the nodes on a piece of the reference simplex.
    mass: Array  # (l, l)
    #: Takes the k moments, and those of a load f against the functions of the vertices, to the degrees of freedom of a
    #: stress whose work against linear fields is theirs.
    loading: Array
    #: Takes moments to the degrees of freedom of a stress that has no divergence, and i numbers to those of a stress
    #: without tractions as well.
    ways: Array  # (n, k + i)
    #: ``int s : D s`` of these stresses, for each entry ``D_pq`` of the upper triangle of a symmetric D; that off the
    #: diagonal counts D_pq and D_qp.
    energies: Array

    @property
    def moments(self) -> int:
        """Number k of moments."""
        return int(self.loading.shape[1]) - self.dim * (self.dim + 1)

    @property
    def block(self) -> int:
        """Number of moments on a facet."""
        return self.moments // (self.dim + 1)

    @property
    def summing(self) -> Array:
        """Takes moments to the degrees of freedom of a stress without divergence, shape (n, k)."""
        return self.ways[:, : self.moments]

    @cached_property
    def upper(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of the entries of D that ``energies`` belong to."""
        return np.triu_indices(self.values.shape[2])

    def at_nodes(self, degrees: Array) -> Array:
        """Stresses (M, pieces, nodes, v) of degrees of freedom (M, n)."""
        flat = degrees @ self.values.reshape(-1, self.values.shape[-1]).T
        return np.asarray(flat.reshape(len(degrees), *self.values.shape[:3]))

    def energy(self, stress: Array, compliance: Array) -> Array:
        """``int s : D s`` on each cell, shape (M,).

        ``stress`` is (M, pieces, nodes, v); ``compliance`` is (M, v, v).
        """
        strain = np.einsum("mpq,mbaq->mbap", compliance, stress, optimize=True)
        return np.asarray(np.einsum("mbap,ac,mbcp->m", strain, self.mass, stress, optimize=True))

    def energy_of(self, degrees: Array, compliance: Array) -> Array:
        """The same of degrees of freedom (M, n).

        ``compliance`` is (M, v (v + 1) / 2), the upper triangles.
        """
        rows, columns = self.upper
        parts = self._orthogonal
        out = np.empty(len(degrees))
        for start in range(0, len(degrees), _CELLS):
            cells = slice(start, start + _CELLS)
            stress = (parts.reshape(-1, parts.shape[2]) @ degrees[cells].T).reshape(*parts.shape[:2], -1)
            counted = compliance[cells].T * np.where(rows == columns, 1.0, 2.0)[:, None]
            out[cells] = 0.0
            for weight, p, q in zip(counted, rows, columns, strict=True):
                out[cells] += weight * np.einsum("am,am->m", stress[p], stress[q])
        return out

    @cached_property
    def _orthogonal(self) -> Array:
        """``values`` of functions that are orthonormal on the simplex, shape (v, (d + 1) l, n)."""
        root = np.linalg.cholesky(self.mass).T
        values = np.einsum("ac,bcpn->pban", root, self.values)
        return np.ascontiguousarray(values.reshape(len(values), -1, values.shape[-1]))

    def settled(self, degrees: Array, compliance: Array) -> Array:
        """The degrees of freedom (M, n) that have the least energy with the same tractions and divergence."""
        if self.ways.shape[1] == self.moments:
            return degrees
        inner = MomentSpace(self, np.zeros((self.moments, 0))).inner(degrees, compliance)
        return degrees - inner @ self.ways[:, self.moments :].T

    def slope(self, degrees: Array, compliance: Array) -> Array:
        """:meth:`MomentSpace.slope` by all moments, shape (M, k)."""
        return self._whole.slope(degrees, compliance)

    def matrix(self, compliance: Array) -> Array:
        """:meth:`MomentSpace.matrix` of all moments, shape (M, k, k)."""
        return self._whole.matrix(compliance)

    @cached_property
    def _whole(self) -> MomentSpace:
        return MomentSpace(self, np.eye(self.moments))

    @cached_property
    def integrated(self) -> Array:
        """Takes degrees of freedom to stresses integrated with the functions of the nodes, shape (n, (d + 1) l v)."""
        integrated = np.einsum("ac,bcpn->bapn", self.mass, self.values)
        return np.ascontiguousarray(integrated.reshape(-1, self.values.shape[-1]).T)


@dataclass(frozen=True, eq=False)
class MomentSpace:
    """Stresses of an element that have no divergence, and some moments alone.

    What has no tractions and no divergence is always among them, and minimised over.
    """

    element: SplitElement
    #: Moments of each of q stresses, those of the facets in turn.
    fields: Array  # (k, q)

    @cached_property
    def summing(self) -> Array:
        """Takes numbers of the q to degrees of freedom, shape (n, q)."""
        return np.ascontiguousarray(self._ways[:, : self.fields.shape[1]])

    def matrix(self, compliance: Array) -> Array:
        """Least energy matrices, shape (M, q, q).

        ``compliance`` is (M, v, v).
        """
        rows, columns = self.element.upper
        size, q = self._ways.shape[1], self.fields.shape[1]
        whole = (compliance[:, rows, columns] @ self._energies).reshape(len(compliance), size, size)
        if size == q:
            return np.asarray(whole)
        return np.asarray(whole[:, :q, :q] - whole[:, :q, q:] @ np.linalg.solve(whole[:, q:, q:], whole[:, q:, :q]))

    def slope(self, degrees: Array, compliance: Array) -> Array:
        """Half the derivative of the least energy at degrees of freedom (M, n), shape (M, q).

        The least one is that over what has no tractions; where this stands in the stress does not matter.
        """
        slopes, q = self._slopes(degrees, compliance), self.fields.shape[1]
        if slopes.shape[1] == q:
            return slopes
        inner = self._inner(compliance)
        answer = np.linalg.solve(inner[:, :, q:], slopes[:, q:, None])
        return np.asarray(slopes[:, :q] - (inner[:, :, :q].transpose(0, 2, 1) @ answer)[:, :, 0])

    def inner(self, degrees: Array, compliance: Array) -> Array:
        """What is taken off what has no tractions where the energy is least, shape (M, i)."""
        q = self.fields.shape[1]
        slope = self._slopes(degrees, compliance)[:, q:]
        return np.asarray(np.linalg.solve(self._inner(compliance)[:, :, q:], slope[:, :, None])[:, :, 0])

    @cached_property
    def _with_inner(self) -> Array:
        """The fields, and behind them what has no tractions."""
        inner = self.element.ways.shape[1] - self.element.moments
        return np.block([
            [self.fields, np.zeros((len(self.fields), inner))],
            [np.zeros((inner, self.fields.shape[1])), np.eye(inner)],
        ])  # fmt: skip

    @cached_property
    def _ways(self) -> Array:
        return np.asarray(self.element.ways @ self._with_inner)

    @cached_property
    def _energies(self) -> Array:
        """Energy matrices of these for each entry of D, flat."""
        energies = self._with_inner.T @ self.element.energies @ self._with_inner
        return np.ascontiguousarray(energies.reshape(len(energies), -1))

    @cached_property
    def _tested(self) -> Array:
        """Takes strains at the nodes to slopes."""
        return np.asarray(self.element.values.reshape(-1, self.element.values.shape[-1]) @ self._ways)

    def _slopes(self, degrees: Array, compliance: Array) -> Array:
        weighed = (degrees @ self.element.integrated).reshape(len(degrees), -1, compliance.shape[1])
        return np.asarray((weighed @ compliance).reshape(len(degrees), -1) @ self._tested)

    def _inner(self, compliance: Array) -> Array:
        """The rows (M, i, q + i) of the energy matrices that belong to stresses without tractions."""
        rows, columns = self.element.upper
        size = self._ways.shape[1]
        flat = compliance[:, rows, columns] @ self._energies[:, self.fields.shape[1] * size :]
        return np.asarray(flat.reshape(len(compliance), -1, size))


def facet_mass(dim: int, order: int) -> Array:
    """Mass matrix of the functions of the nodes of a facet of measure 1: d vertices, and the midpoint for order 2."""
    if order == 1:
        return np.asarray((np.ones((dim, dim)) + np.eye(dim)) / (dim * (dim + 1)))
    return np.array([[4.0, -1.0, 2.0], [-1.0, 4.0, 2.0], [2.0, 2.0, 16.0]]) / 30.0


@cache
def split_element(dim: int, order: int = 1) -> SplitElement:
    """The element of degree 1 in the plane (``dim = 2``) or in space (3), or of degree 2 in the plane."""
    if order == 2 and dim != 2:
        raise ProblemError("stress elements of degree 2 are there in the plane only; take order = 1")
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    centroid = corners.mean(axis=0)
    pairs = pairs_of(dim)
    pieces, number = dim + 1, len(pairs)
    edges = EDGES[dim] if order == 2 else ()
    middle = {frozenset(pair): pieces + e for e, pair in enumerate(edges)}
    nodes = pieces + len(edges)
    unknowns = pieces * nodes * number

    def column(piece: int, node: int, component: int) -> int:
        return (piece * nodes + node) * number + component

    def traction(piece: int, node: int, normal: Array) -> Array:
        """Rows (d, unknowns) of the traction there."""
        row = np.zeros((dim, unknowns))
        for component, (i, j) in enumerate(pairs):
            row[i, column(piece, node, component)] += normal[j]
            if i != j:
                row[j, column(piece, node, component)] += normal[i]
        return row

    def on_facet(members: list[int]) -> list[int]:
        """Its nodes: vertices, then midpoints."""
        return members + [middle[frozenset(pair)] for pair in itertools.combinations(members, 2) if order == 2]

    conditions: list[Array] = []
    for i, j in itertools.combinations(range(pieces), 2):  # pieces i and j share the centroid and the other vertices
        others = [a for a in range(pieces) if a not in (i, j)]
        normal = np.linalg.svd(corners[others] - centroid)[2][-1]  # orthogonal to the facet between them
        for one, two in zip(on_facet([*others, i]), on_facet([*others, j]), strict=True):
            conditions.append(traction(i, one, normal) - traction(j, two, normal))
    continuous = sum(len(rows) for rows in conditions)
    mass = facet_mass(dim, order)
    gradients = np.vstack([-np.ones(dim), np.eye(dim)])
    for i in range(pieces):
        outward = -gradients[i] / math.factorial(dim - 1)  # normal times measure, |F| nu = -d |T| grad
        tractions = [traction(i, a, outward) for a in on_facet([a for a in range(pieces) if a != i])]
        conditions += [sum(mass[a, b] * row for b, row in enumerate(tractions)) for a in range(len(mass))]  # type: ignore[misc]
    moments = dim * pieces * len(mass)
    if order == 1:
        values, loading = _by_integral(conditions, moments, number, corners)
        ways = loading[:, :moments]
    else:
        values, loading, ways = _by_divergence(conditions, continuous, moments, column, corners)
    values = np.asarray(values.reshape(pieces, nodes, number, -1), dtype=float)
    point, weight = quadrature_rule(dim, 2 * order)
    shapes = shape_values(order, point)
    volume = 1.0 / math.factorial(dim) / pieces
    mass = volume * np.einsum("q,qa,qb->ab", weight, shapes, shapes)
    at = values @ ways  # piece, node, component, way
    products = np.einsum("bapk,ac,bcql->pqkl", at, mass, at)
    p, q = np.triu_indices(number)
    energies = np.where((p == q)[:, None, None], 1.0, 2.0) * 0.5 * (products[p, q] + products[p, q].transpose(0, 2, 1))
    return SplitElement(dim, order, values, mass, loading, ways, energies)


def _clean(values: Array) -> Array:
    values[np.abs(values) < 1e-13 * np.abs(values).max()] = 0.0
    return values


def _by_integral(conditions: list[Array], moments: int, number: int, corners: Array) -> tuple[Array, Array]:
    """Degree 1: values by moments and the integral, and these degrees of freedom by moments and loads."""
    dim, pieces = corners.shape[1], len(corners)
    volume = 1.0 / math.factorial(dim) / pieces
    integral = np.zeros((number, pieces * pieces * number))
    for component in range(number):
        integral[component, component::number] = volume / pieces
    matrix = np.vstack([*conditions, integral])
    wanted = np.zeros((len(matrix), moments + number))
    wanted[len(matrix) - moments - number :] = np.eye(moments + number)
    values = _clean(np.asarray(np.linalg.solve(matrix, wanted), dtype=float))
    loading = np.zeros((moments + number, moments + pieces * dim))
    loading[:moments, :moments] = np.eye(moments)
    x = corners - corners.mean(axis=0)
    facets = [(i, b) for i in range(pieces) for b in range(pieces) if b != i]
    for column, ((_, b), c) in enumerate(itertools.product(facets, range(dim))):
        loading[moments:, column] = voigt(np.outer(np.eye(dim)[c], x[b]))
    for column, (b, c) in enumerate(itertools.product(range(pieces), range(dim))):
        loading[moments:, moments + column] = voigt(np.outer(np.eye(dim)[c], x[b]))
    return values, loading


def _by_divergence(
    conditions: list[Array], continuous: int, moments: int, column: Callable[[int, int, int], int], corners: Array
) -> tuple[Array, Array, Array]:
    """Degree 2: values by moments, loads and what has neither. Loads out of balance are first put into it, least."""
    dim, pieces = corners.shape[1], len(corners)
    centroid = corners.mean(axis=0)
    unknowns = conditions[0].shape[1]
    nodes = unknowns // (pieces * len(pairs_of(dim)))
    divergence, load = np.zeros((pieces * pieces * dim, unknowns)), np.zeros((pieces * pieces * dim, pieces * dim))
    linear = np.linalg.inv((np.ones((pieces, pieces)) + np.eye(pieces)) / (math.factorial(dim) * pieces * (pieces + 1)))
    row = 0
    for i in range(pieces):
        own = corners.copy()
        own[i] = centroid
        inverse = np.linalg.inv((own[1:] - own[0]).T)
        slopes = np.vstack([-inverse.sum(axis=0), inverse])
        for a in range(pieces):
            derivative = shape_derivatives(2, np.eye(pieces)[a]) @ slopes
            coordinates = np.concatenate([[1.0 - own[a].sum()], own[a]])
            for node in range(nodes):
                for component, (j, k) in enumerate(pairs_of(dim)):
                    divergence[row + j, column(i, node, component)] += derivative[node, k]
                    if j != k:
                        divergence[row + k, column(i, node, component)] += derivative[node, j]
            for c in range(dim):
                load[row + c, c::dim] = -coordinates @ linear  # div s = -f, f of these moments
            row += dim
    matrix = np.vstack([*conditions, divergence])
    inverse = np.linalg.pinv(matrix, rcond=1e-10)
    kernel = np.linalg.svd(matrix)[2][np.linalg.matrix_rank(matrix, tol=1e-10) :]

    # rigid motions (3, ...) at the nodes of the facets, and at the vertices
    def rigid(x: Array) -> Array:
        turn = np.stack([-x[..., 1], x[..., 0]], axis=-1)
        return np.stack([np.broadcast_to(np.eye(2)[0], x.shape), np.broadcast_to(np.eye(2)[1], x.shape), turn])

    members = np.array([[b for b in range(pieces) if b != i] for i in range(pieces)])
    ends = (corners - centroid)[members]
    on_facets = rigid(np.concatenate([ends, ends.mean(axis=1, keepdims=True)], axis=1)).reshape(3, -1)
    at_corners = rigid(corners - centroid).reshape(3, -1)
    back = np.linalg.pinv(at_corners)
    balanced = np.hstack([-back @ on_facets, np.eye(pieces * dim) - back @ at_corners])
    given = inverse[:, continuous : continuous + moments]
    pushed = inverse[:, continuous + moments :] @ load
    by_moments = np.hstack([given, np.zeros((unknowns, pieces * dim))]) + pushed @ balanced
    values = _clean(np.hstack([by_moments, kernel.T]))
    count = values.shape[1]
    loading = np.eye(count)[:, : moments + pieces * dim]
    ways = np.hstack([loading[:, :moments], np.eye(count)[:, moments + pieces * dim :]])
    return values, loading, ways
