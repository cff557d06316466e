"""The stress element of Johnson, Krizek and Mercier: symmetric, linear on the Alfeld split, with continuous tractions.

A simplex is cut into d + 1 pieces that join its centroid to its facets. A stress of the element is symmetric and linear
on every piece, and its tractions are continuous between the pieces. The moments of the tractions on the facets of the
simplex, and the integral of the stress, determine it: 15 numbers in the plane, 42 in space.

Everything is computed once on the reference simplex (origin and unit vectors) and mapped: with ``x = B x^ + b`` and
``J = |det B|`` the stress ``s = B s^ B' / J`` has divergence ``B div^ s^ / J``, moments ``m = B m^`` and the integral
``int s = B (int s^) B'``.

References: C. Johnson and B. Mercier, Numer. Math. 30 (1978); M. Krizek, Numer. Math. 41 (1983);
J. Gopalakrishnan, J. Guzman and J. J. Lee, arXiv 2403.13189 (any dimension).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from hemivar.basics.types import Array, IntArray

__all__ = ["SplitElement", "pairs_of", "pulled_back", "split_element", "voigt", "voigt_map"]


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

    Parameters
    ----------
    compliance : array, shape (M or 1, v, v)
        Of stresses as vectors: the inverse of an elasticity matrix.
    jacobian : array, shape (M, d, d)
        B.
    size : array, shape (M,)
        J.

    Returns
    -------
    array, shape (M, v, v)
    """
    change = voigt_map(jacobian)
    return np.asarray(change.transpose(0, 2, 1) @ compliance @ change / size[:, None, None])


@dataclass(frozen=True, eq=False)
class SplitElement:
    """The element on the reference simplex.

    Facet i of the simplex is opposite to vertex i, its vertices are the others in their order. Piece i joins facet i to
    the centroid: its vertices are those of the simplex with the centroid in the place of vertex i.

    Attributes
    ----------
    dim : int
    values : array, shape (d + 1, d + 1, v, n)
        Stress at the vertices of the pieces (piece, vertex, component) for each of the n degrees of freedom: the
        moments ``int s nu phi_a`` (facet i, vertex, component c), then ``int s``. n is 15 or 42.
    mass : array, shape (d + 1, d + 1)
        That of linear functions on a piece of the reference simplex.
    summing : array, shape (n, k)
        Takes the k = d d (d + 1) moments to the degrees of freedom of a stress that has no divergence:
        ``int s = sum of m (x) x``, symmetric part, x from the centroid.
    energies : array, shape (v (v + 1) / 2, k, k)
        ``int s : D s`` of these stresses in the moments, for each entry ``D_pq`` of the upper triangle of a symmetric
        D; that off the diagonal counts D_pq and D_qp.
    """

    dim: int
    values: Array
    mass: Array
    summing: Array
    energies: Array

    @property
    def moments(self) -> int:
        """Number k of moments."""
        return self.dim**2 * (self.dim + 1)

    @property
    def upper(self) -> tuple[IntArray, IntArray]:
        """Rows and columns of the entries of D that ``energies`` belong to."""
        return np.triu_indices(self.values.shape[2])

    def at_vertices(self, degrees: Array) -> Array:
        """Stresses (M, pieces, vertices, v) of degrees of freedom (M, n)."""
        flat = degrees @ self.values.reshape(-1, self.values.shape[-1]).T
        return np.asarray(flat.reshape(len(degrees), *self.values.shape[:3]))

    def energy(self, stress: Array, compliance: Array) -> Array:
        """``int s : D s`` on each cell, shape (M,).

        Parameters
        ----------
        stress : array, shape (M, pieces, vertices, v)
        compliance : array, shape (M, v, v)
            D, pulled back to the reference simplex.
        """
        strain = np.einsum("mpq,mbaq->mbap", compliance, stress, optimize=True)
        return np.asarray(np.einsum("mbap,ac,mbcp->m", strain, self.mass, stress, optimize=True))

    def slope(self, stress: Array, compliance: Array) -> Array:
        """Half the derivative of the energy by the moments of stresses without divergence, shape (M, k)."""
        strain = np.einsum("mpq,mbaq->mbap", compliance, stress, optimize=True)
        force = np.einsum("ac,mbcp->mbap", self.mass, strain, optimize=True).reshape(len(stress), -1)
        return np.asarray(force @ (self.values.reshape(force.shape[1], -1) @ self.summing))

    def matrix(self, compliance: Array) -> Array:
        """Energy matrices in the moments of stresses without divergence, shape (M, k, k)."""
        rows, columns = self.upper
        flat = compliance[:, rows, columns] @ self.energies.reshape(len(rows), -1)
        return np.asarray(flat.reshape(len(compliance), self.moments, self.moments))

    def matrix_of(self, facets: tuple[int, ...], compliance: Array) -> Array:
        """The same in the moments of some facets of the cells alone, in that order."""
        rows, columns = self.upper
        energies = _energies_of(self, facets)
        size = len(facets) * self.dim**2
        return np.asarray((compliance[:, rows, columns] @ energies).reshape(len(compliance), size, size))


@cache
def _energies_of(element: SplitElement, facets: tuple[int, ...]) -> Array:
    """Rows and columns of ``energies`` that belong to some facets, flat."""
    block = element.dim**2
    chosen = np.concatenate([i * block + np.arange(block) for i in facets])
    return np.ascontiguousarray(element.energies[:, chosen][:, :, chosen]).reshape(len(element.energies), -1)


@cache
def split_element(dim: int) -> SplitElement:
    """The element in the plane (``dim = 2``) or in space (3)."""
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    centroid = corners.mean(axis=0)
    pairs = pairs_of(dim)
    pieces, number = dim + 1, len(pairs)
    unknowns = pieces * pieces * number

    def place(piece: int, vertex: int, component: int) -> int:
        return (piece * pieces + vertex) * number + component

    def traction(piece: int, vertex: int, normal: Array) -> Array:
        """Rows (d, unknowns) of the traction there."""
        row = np.zeros((dim, unknowns))
        for component, (i, j) in enumerate(pairs):
            row[i, place(piece, vertex, component)] += normal[j]
            if i != j:
                row[j, place(piece, vertex, component)] += normal[i]
        return row

    conditions: list[Array] = []
    for i, j in itertools.combinations(range(pieces), 2):  # pieces i and j share the centroid and the other vertices
        others = [a for a in range(pieces) if a not in (i, j)]
        normal = np.linalg.svd(corners[others] - centroid)[2][-1]  # orthogonal to the facet between them
        conditions += [traction(i, a, normal) - traction(j, a, normal) for a in others]
        conditions.append(traction(i, i, normal) - traction(j, j, normal))
    facet_mass = (np.ones((dim, dim)) + np.eye(dim)) / (dim * (dim + 1))
    gradients = np.vstack([-np.ones(dim), np.eye(dim)])
    for i in range(pieces):
        outward = -gradients[i] / math.factorial(dim - 1)  # normal times measure, |F| nu = -d |T| grad
        members = [a for a in range(pieces) if a != i]
        tractions = [traction(i, a, outward) for a in members]
        conditions += [sum(facet_mass[a, b] * tractions[b] for b in range(dim)) for a in range(dim)]  # type: ignore[misc]
    volume = 1.0 / math.factorial(dim) / pieces
    for component in range(number):
        row = np.zeros((1, unknowns))
        for piece, vertex in itertools.product(range(pieces), repeat=2):
            row[0, place(piece, vertex, component)] = volume / pieces
        conditions.append(row)
    matrix = np.vstack(conditions)
    moments = dim * dim * pieces
    wanted = np.zeros((unknowns, moments + number))
    wanted[unknowns - moments - number :] = np.eye(moments + number)
    solved = np.linalg.solve(matrix, wanted)
    solved[np.abs(solved) < 1e-13 * np.abs(solved).max()] = 0.0
    values: Array = np.asarray(solved.reshape(pieces, pieces, number, -1), dtype=float)
    mass = volume * (np.ones((pieces, pieces)) + np.eye(pieces)) / ((dim + 1) * (dim + 2))

    summing = np.zeros((moments + number, moments))
    summing[:moments] = np.eye(moments)
    for column, (i, a, c) in enumerate(itertools.product(range(pieces), range(dim), range(dim))):
        x = corners[[b for b in range(pieces) if b != i][a]] - centroid
        summing[moments:, column] = voigt(np.outer(np.eye(dim)[c], x))
    at = values @ summing  # piece, vertex, component, moment
    products = np.einsum("bapk,ac,bcql->pqkl", at, mass, at)
    p, q = np.triu_indices(number)
    energies = np.where((p == q)[:, None, None], 1.0, 2.0) * 0.5 * (products[p, q] + products[p, q].transpose(0, 2, 1))
    return SplitElement(dim, values, mass, summing, energies)
