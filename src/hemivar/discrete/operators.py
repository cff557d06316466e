"""Matrices of a body over its unknowns and over the displacements of its moved supports."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import IMPORTS, cached_property
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.bulk import FEW_ZEROS, without_zeros
from hemivar.linear.products import product
from hemivar.mesh.keys import PORTION

__all__ = ["Multiple", "Operator", "combined", "of_arrays"]

#: Rounding of entries that are sums over cells, in units of the diagonal.
_ROUNDED = 16.0 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class Operator(PickleMixin):
    """A symmetric matrix over ``x = (u, z)``: the unknowns u (n,) and the prescribed displacements z (k,)."""

    inner: sp.csr_array  # (n, n)
    coupling: sp.csr_array  # (n, k)
    held: sp.csr_array  # (k, k)
    places: IntArray | None = None  # where the entries of ``inner`` stand among those of the matrix that it is added to

    @staticmethod
    def like(pattern: sp.csr_array, data: Array, coupling: sp.csr_array, held: sp.csr_array) -> Operator:
        """With entries (nnz,) on the sparsity of another matrix, whose arrays it shares unless many of them are zero.

        The mass of a body couples no component with another one, so that half of its entries or more are.
        """
        there = data != 0.0
        if np.count_nonzero(there) > FEW_ZEROS * data.size:
            return Operator(of_arrays(data, pattern.indices, pattern.indptr), coupling, held)
        places = np.flatnonzero(there)
        before = np.zeros(data.size + 1, dtype=pattern.indptr.dtype)
        np.cumsum(there, out=before[1:])
        inner = of_arrays(data[places], pattern.indices[places], before[pattern.indptr])
        return Operator(inner, coupling, held, places.astype(pattern.indices.dtype))

    def add_to(self, data: Array, factor: float) -> None:
        """Add a multiple to the entries (nnz,) of the matrix whose sparsity it stands on, in place."""
        if self.places is None:
            data += factor * self.inner.data
        else:
            data[self.places] += factor * self.inner.data

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return int(self.inner.shape[0])

    @cached_property
    def _entries(self) -> sp.csr_array:
        """``inner`` without the zeros at places where others, with which it is added up, have entries."""
        return without_zeros(self.inner)

    @cached_property
    def row_sums(self) -> Array:
        """Sums of the absolute entries of the rows of ``inner``, (n,)."""
        return np.asarray(abs(self._entries).sum(axis=1)).ravel()

    def times(self, x: Array) -> Array:
        """The product with ``x`` (n + k,)."""
        if not self.held.shape[0]:
            return product(self._entries, x)
        n = self.unknowns
        u, z = x[:n], x[n:]
        return np.concatenate([self._entries @ u + self.coupling @ z, self.coupling.T @ u + self.held @ z])

    def multiple_of(self, other: Operator) -> float | None:
        """The number t with ``A = t B``, B the other one, up to the rounding of entries; None if there is none."""
        own, base = self.inner, other.inner
        first, diagonal = own.diagonal(), base.diagonal()
        if own.nnz != base.nnz or not diagonal.size or diagonal.min() <= 0.0:
            return None
        ratio = float(np.median(first / diagonal))
        least, root = _ROUNDED * abs(ratio), np.sqrt(diagonal)
        if (np.abs(first - ratio * diagonal) > least * diagonal).any() or not np.array_equal(own.indptr, base.indptr):
            return None
        for start in range(0, diagonal.size, PORTION):
            rows = base.indptr[start : start + PORTION + 1]
            part = slice(int(rows[0]), int(rows[-1]))
            columns = base.indices[part]
            if not np.array_equal(own.indices[part], columns):
                return None
            size = np.repeat(root[start : start + PORTION], np.diff(rows)) * root[columns]
            if (np.abs(own.data[part] - ratio * base.data[part]) > least * size).any():
                return None
        moved = np.sqrt(other.held.diagonal())
        for one, two, rows in ((self.coupling, other.coupling, root), (self.held, other.held, moved)):
            rest = sp.coo_array(one - ratio * two)
            if (np.abs(rest.data) > least * rows[rest.row] * moved[rest.col]).any():
                return None
        return ratio

    def energy(self, x: Array) -> float:
        """``x'Ax / 2``, the part of this process."""
        return 0.5 * float(x @ self.times(x))

    def solved(self, right: Array) -> Array | None:
        """Unknowns u (n,) with ``inner u = right`` (n,), zero where the diagonal is; None if they are not found."""
        with IMPORTS:
            from scipy.sparse.linalg import LinearOperator, cg  # only here: most bodies start without it

        diagonal = self.inner.diagonal()
        there = diagonal > 0.0
        scaled = LinearOperator(self.inner.shape, matvec=lambda x: x / np.where(there, diagonal, 1.0))
        solution, failed = cg(self.inner, np.where(there, right, 0.0), rtol=1e-12, M=scaled, maxiter=500)
        return None if failed else np.where(there, solution, 0.0)

    @property
    def numbers(self) -> tuple[Array, ...]:
        """All entries, for comparisons."""
        return self.inner.data, self.coupling.data, self.held.data


class Multiple(Operator):
    """A multiple of another operator, which is all that is stored of it."""

    def __init__(self, base: Operator, factor: float) -> None:
        object.__setattr__(self, "base", base)
        object.__setattr__(self, "factor", float(factor))

    base: Operator
    factor: float

    @cached_property
    def inner(self) -> sp.csr_array:
        return self.factor * self.base.inner

    @property
    def coupling(self) -> sp.csr_array:
        return self.factor * self.base.coupling

    @property
    def held(self) -> sp.csr_array:
        return self.factor * self.base.held

    @property
    def unknowns(self) -> int:
        return self.base.unknowns

    @cached_property
    def row_sums(self) -> Array:
        return abs(self.factor) * self.base.row_sums

    def times(self, x: Array) -> Array:
        return self.factor * self.base.times(x)

    def multiple_of(self, other: Operator) -> float | None:
        return self.factor if other is self.base else super().multiple_of(other)

    @property
    def numbers(self) -> tuple[Array, ...]:
        return np.array([self.factor]), *self.base.numbers


def of_arrays(data: Array, indices: IntArray, indptr: IntArray) -> sp.csr_array:
    """A square matrix of arrays that are in order."""
    made = sp.csr_array((indptr.size - 1,) * 2)
    made.data, made.indices, made.indptr = data, indices, indptr
    made.has_sorted_indices = made.has_canonical_format = True
    return made


def combined(parts: Sequence[tuple[float, sp.csr_array]]) -> sp.csr_array:
    """A sum of multiples of matrices with the same places of entries, which it shares with the first."""
    factor, first = parts[0]
    data = factor * first.data
    for factor, matrix in parts[1:]:
        data += factor * matrix.data
    return sp.csr_array((data, first.indices, first.indptr), shape=first.shape)
