"""Galerkin products on fixed sparsity patterns: how algebraic levels follow what is held and added on a mesh.

With R the prolongation at the contact unknowns, I what their rows are times the prolongation, D ones where they are
held, K the matrix between them and S what is added there, the coarse matrix changes by ``-(R'X + X'R)``, where
``X = D I - (D K D + S) R / 2``. So does any coarser one, with the prolongations down to it in the place of that to the
first: R and I of each level are found once, and only rows of X that are not zero cost anything. These products have
patterns that no solve changes, so that the compiled kernels fill them in. Where nearly every contact unknown reaches
nearly all of a small level, R and I are dense.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import AnyArray, Array, BoolArray, IntArray
from hemivar.kernels.library import Kernels
from hemivar.linear.truncated_level import Level, narrow

__all__ = ["FixedChange"]

#: Times the sums of a product on a pattern that a dense one may take: on an AMD EPYC, one thread, both cost the same at
#: 11 (brackets, pairs and assemblies from Gmsh).
_DENSE = 8.0


@dataclass(frozen=True, eq=False)
class _Pattern:
    """The places of a product ``A B``, to which one of two factors is fixed.

    ``count``: columns; ``starts, columns``: its rows.
    """

    count: int
    starts: AnyArray
    columns: AnyArray

    @staticmethod
    def of(matrix: sp.csr_array) -> _Pattern:
        matrix = narrow(matrix)
        return _Pattern(matrix.shape[1], matrix.indptr, matrix.indices)

    @staticmethod
    def of_product(left: sp.csr_array, right: sp.csr_array) -> _Pattern:
        """All places that a product may reach."""
        ones = [sp.csr_array((np.ones(one.nnz), one.indices, one.indptr), shape=one.shape) for one in (left, right)]
        return _Pattern.of(sp.csr_array(ones[0] @ ones[1]))

    def filled(self, kernels: Kernels, left: sp.csr_array, right: sp.csr_array, begin: Array | None = None) -> Array:
        """``begin`` and the product of two matrices there; raises ValueError where it reaches beyond these places."""
        out = np.zeros(self.columns.size) if begin is None else begin
        kernels.add_product(left, right, (self.starts, self.columns, out), self.count)
        return out

    def product(self, kernels: Kernels, left: sp.csr_array, right: sp.csr_array) -> sp.csr_array:
        """The product of two matrices as a matrix that has all these places."""
        return self.matrix(self.filled(kernels, narrow(left), narrow(right)))

    def matrix(self, values: Array) -> sp.csr_array:
        """The matrix with these numbers."""
        return sp.csr_array((values, self.columns, self.starts), shape=(self.starts.size - 1, self.count))


@dataclass(frozen=True, eq=False)
class _Reach:
    """How contact unknowns reach a level: R (q, n), I (q, n) on all places of X, and the row of each of these.

    ``back (a, q)``: the rows of ``R'`` that have entries; ``own``: the places of these rows of the matrix.
    """

    reach: sp.csr_array
    images: sp.csr_array
    rows: IntArray
    back: sp.csr_array
    own: _Pattern

    def half(self, kernels: Kernels, held: BoolArray, between: sp.csr_array, some: BoolArray) -> Array:
        """``R'X`` at the places of its rows, where unknowns are held, and ``between (q, q)`` is ``-(D K D + S) / 2``;
        ``some (q,)``: rows of X that are not zero."""
        places, back = _Pattern.of(self.images), self.back
        begin = np.where(held[self.rows], self.images.data, 0.0)
        right = places.matrix(places.filled(kernels, between, self.reach, begin))
        left = back.data * some[back.indices]  # the kernel leaves out factors that are zero
        left = sp.csr_array((left, back.indices, back.indptr), shape=back.shape)
        return self.own.filled(kernels, left, right)


@dataclass(frozen=True, eq=False)
class _DenseReach:
    """R (q, n) and I (q, n) where contact unknowns reach most of a level; ``places``: those of ``R'X`` in (n, n)."""

    reach: Array
    images: Array
    places: IntArray

    def half(self, kernels: Kernels, held: BoolArray, between: sp.csr_array, some: BoolArray) -> Array:
        """:meth:`_Reach.half` by dense products."""
        rows = np.flatnonzero(some)
        right = np.asarray(between[rows] @ self.reach)
        right += np.where(held[rows, None], self.images[rows], 0.0)
        return np.asarray(self.reach[rows].T @ right).ravel()[self.places]


@dataclass(frozen=True, eq=False)
class _CoarseLevel:
    """An algebraic level, and how a change comes to it from what is finer.

    ``matrix (n, n)``; ``diagonal (n,)``: where its entries are; ``reach``: how contact unknowns reach it; ``entries``:
    where the places of ``R'X`` are among those of the matrix; ``turned``: where each entry of the transpose is.
    """

    matrix: sp.csr_array
    diagonal: IntArray
    reach: _Reach | _DenseReach
    entries: IntArray
    turned: IntArray

    @staticmethod
    def of(matrix: sp.csr_array, reach: sp.csr_array, images: sp.csr_array) -> _CoarseLevel:
        back = narrow(sp.csr_array(reach.T))
        rows = np.flatnonzero(np.diff(back.indptr)).astype(np.int64)
        starts, ends = matrix.indptr[rows], matrix.indptr[rows + 1]
        lengths = (ends - starts).astype(np.int64)
        first = np.concatenate([[0], np.cumsum(lengths)])
        entries = np.arange(first[-1]) + np.repeat(starts - first[:-1], lengths)
        columns = np.ascontiguousarray(matrix.indices[entries])
        numbers = sp.csr_array((np.arange(1.0, matrix.nnz + 1.0), matrix.indices, matrix.indptr), shape=matrix.shape)
        turned = narrow(sp.csr_array(numbers.T))
        if not (np.array_equal(turned.indices, matrix.indices) and np.array_equal(turned.indptr, matrix.indptr)):
            raise ValueError("the pattern of a level must be symmetric")
        of_row = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
        diagonal = np.flatnonzero(of_row == matrix.indices)
        (q, n), sums = reach.shape, float(np.diff(images.indptr) @ np.diff(reach.indptr))
        contact_reach: _Reach | _DenseReach
        if float(rows.size) * q * n <= _DENSE * sums:
            contact_reach = _DenseReach(reach.toarray(), images.toarray(), np.repeat(rows, lengths) * n + columns)
        else:
            image_rows = np.repeat(np.arange(q), np.diff(images.indptr))
            own = _Pattern(n, first.astype(np.int32), columns)
            contact_reach = _Reach(reach, images, image_rows, narrow(back[rows]), own)
        return _CoarseLevel(matrix, diagonal, contact_reach, entries, (turned.data - 1.0).astype(np.int64))

    def changed(self, half: Array, before: Array) -> Array:
        """The numbers of the matrix with a half of a change, and its transpose; unknowns that nothing is left of keep
        their diagonal entry."""
        out = np.zeros(self.matrix.nnz)
        out[self.entries] = half
        out += out[self.turned]
        np.subtract(self.matrix.data, out, out=out)
        own = out[self.diagonal]
        out[self.diagonal] = np.where(own <= 1e-12 * before, before, own)
        return out


class FixedChange:
    """The matrices of algebraic levels where contact unknowns of the coarsest mesh are held, and some more stiffness
    acts between others.

    ``levels``: from the coarsest mesh, which is ``levels[-1]``, down to the coarsest one, which is the first;
    ``transfers``: between them. Raises ValueError: a pattern is not symmetric.
    """

    def __init__(self, kernels: Kernels, levels: Sequence[Level], transfers: Sequence[sp.csr_array]) -> None:
        self.kernels, top, P = kernels, levels[-1], transfers[-1]
        shape = (top.contact.size, top.matrix.shape[0])
        images = sp.csr_array((top.values, top.columns, top.first), shape=shape)
        inside = np.full(shape[1], -1)
        inside[top.contact] = np.arange(top.contact.size)
        column = inside[top.columns]
        #: Entries of the contact rows that are between contact unknowns.
        self.inner = np.flatnonzero(column >= 0)
        starts = np.searchsorted(self.inner, top.first).astype(np.int32)
        self.between = _Pattern(top.contact.size, starts, column[self.inner].astype(np.int32))
        self.row, self.column, self.top = top.rows[self.inner], column[self.inner], top
        self.levels: list[tuple[_CoarseLevel, Array]] = []
        reach = narrow(sp.csr_array(P[top.contact]))
        for k in range(len(levels) - 2, -1, -1):
            P = transfers[k]
            if self.levels:
                reach = _Pattern.of_product(reach, P).product(kernels, reach, P)
            images = _Pattern.of_product(images, P).product(kernels, images, P)  # SciPy leaves out sums that cancel
            self.levels.append((_CoarseLevel.of(levels[k].matrix, reach, images), levels[k].diagonal))

    def of(self, held: BoolArray, added: Array) -> list[Array]:
        """The numbers of the matrices, from the finest of the levels down; ``added`` at the places of the coupling."""
        top = self.top
        extra = np.zeros(top.values.size)
        extra[top.added] = added
        both = np.where(held[self.row] & held[self.column], top.values[self.inner], 0.0) + extra[self.inner]
        between, some = self.between.matrix(-0.5 * both), held.copy()
        some[self.row[both != 0.0]] = True
        return [
            level.changed(level.reach.half(self.kernels, held, between, some), before) for level, before in self.levels
        ]
