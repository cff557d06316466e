"""What holding and adding on a mesh changes in the matrices of the algebraic levels below, on the patterns they have.

With R the prolongation at the contact unknowns, I what their rows are times the prolongation, D ones where they are
held, K the matrix between them and S what is added there, the coarse matrix changes by ``-(R'X + X'R)``, where
``X = D I - (D K D + S) R / 2``; and the next coarser one, P being the prolongation to it, by ``-P'(R'X + X'R) P``.
These products have patterns that no solve changes, so that the compiled kernels fill them in.
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
        found = narrow(matrix)
        return _Pattern(found.shape[1], found.indptr, found.indices)

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

    def matrix(self, values: Array) -> sp.csr_array:
        """The matrix with these numbers."""
        return sp.csr_array((values, self.columns, self.starts), shape=(self.starts.size - 1, self.count))


@dataclass(frozen=True, eq=False)
class _CoarseLevel:
    """An algebraic level, and how a change comes to it from what is finer.

    ``matrix (n, n)``; ``diagonal (n,)``: where its entries are; ``back (a, q)``: the part of the transfer, turned, by
    which anything of the change reaches rows of this level; ``own``: the places of these rows; ``entries``: where they
    are among those of the matrix; ``turned``: where each entry of the transpose is; ``transfer``: to the next coarser
    level, none below the last; ``across``: places of these rows times it.
    """

    matrix: sp.csr_array
    diagonal: IntArray
    back: sp.csr_array
    own: _Pattern
    entries: IntArray
    turned: IntArray
    transfer: sp.csr_array | None
    across: _Pattern | None

    @staticmethod
    def of(
        matrix: sp.csr_array, arriving: sp.csr_array, transfer: sp.csr_array | None
    ) -> tuple[_CoarseLevel, IntArray]:
        """The level, and the rows that a change reaches; ``arriving (q, n)`` leads from it to what is changed."""
        back = narrow(sp.csr_array(arriving.T))
        rows = np.flatnonzero(np.diff(back.indptr)).astype(np.int64)
        starts, ends = matrix.indptr[rows], matrix.indptr[rows + 1]
        lengths = (ends - starts).astype(np.int64)
        first = np.concatenate([[0], np.cumsum(lengths)])
        entries = np.arange(first[-1]) + np.repeat(starts - first[:-1], lengths)
        own = _Pattern(matrix.shape[1], first.astype(np.int32), np.ascontiguousarray(matrix.indices[entries]))
        numbers = sp.csr_array((np.arange(1.0, matrix.nnz + 1.0), matrix.indices, matrix.indptr), shape=matrix.shape)
        turned = narrow(sp.csr_array(numbers.T))
        if not (np.array_equal(turned.indices, matrix.indices) and np.array_equal(turned.indptr, matrix.indptr)):
            raise ValueError("the pattern of a level must be symmetric")
        of_row = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
        diagonal = np.flatnonzero(of_row == matrix.indices)
        across = None if transfer is None else _Pattern.of_product(own.matrix(np.ones(entries.size)), transfer)
        place = (turned.data - 1.0).astype(np.int64)
        return _CoarseLevel(matrix, diagonal, narrow(back[rows]), own, entries, place, transfer, across), rows

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
        rows = sp.csr_array((top.values, top.columns, top.first), shape=shape)
        self.reach = narrow(sp.csr_array(P[top.contact]))
        self.places = _Pattern.of_product(rows, P)  # SciPy leaves out sums that cancel
        self.images = self.places.matrix(self.places.filled(kernels, narrow(rows), narrow(P)))
        inside = np.full(shape[1], -1)
        inside[top.contact] = np.arange(top.contact.size)
        column = inside[top.columns]
        #: Entries of the contact rows that are between contact unknowns.
        self.inner = np.flatnonzero(column >= 0)
        starts = np.searchsorted(self.inner, top.first).astype(np.int32)
        self.between = _Pattern(top.contact.size, starts, column[self.inner].astype(np.int32))
        self.row, self.column, self.top = top.rows[self.inner], column[self.inner], top
        self.held_row = np.repeat(np.arange(shape[0]), np.diff(self.places.starts))
        self.levels: list[tuple[_CoarseLevel, Array]] = []
        arriving = self.reach
        for k in range(len(levels) - 2, -1, -1):
            transfer = transfers[k - 1] if k else None
            found, reached = _CoarseLevel.of(levels[k].matrix, arriving, transfer)
            self.levels.append((found, levels[k].diagonal))
            if transfer is not None:
                arriving = sp.csr_array(transfer[reached])

    def of(self, held: BoolArray, added: Array) -> list[Array]:
        """The numbers of the matrices, from the finest of the levels down; ``added`` at the places of the coupling."""
        kernels, top = self.kernels, self.top
        extra = np.zeros(top.values.size)
        extra[top.added] = added
        both = np.where(held[self.row] & held[self.column], top.values[self.inner], 0.0) + extra[self.inner]
        begin = np.where(held[self.held_row], self.images.data, 0.0)
        between = self.between.matrix(-0.5 * both)
        right = self.places.matrix(self.places.filled(kernels, between, self.reach, begin))
        found = []
        for level, before in self.levels:
            half = level.own.filled(kernels, level.back, right)
            found.append(level.changed(half, before))
            if level.transfer is not None and level.across is not None:
                right = level.across.matrix(level.across.filled(kernels, level.own.matrix(half), level.transfer))
        return found
