"""Truncation of one multigrid level: the rows of its contact unknowns, which a solve holds and changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import IMPORTS, cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.linear.products import diagonal

__all__ = ["CoarseChange", "Coupling", "Level", "Points", "Transfer", "TruncatedLevel", "narrow", "sweeps"]


class Coupling:
    """The places of a symmetric matrix between contact unknowns, and what it is for the next coarser ones.

    ``keys (p,)``: ``row * k + column`` of each place, in order; ``rows, columns (p,)``; ``diagonal (k,)``: which of
    them are on the diagonal.
    """

    def __init__(self, pattern: sp.csr_array) -> None:
        self.size = pattern.shape[0]
        entries = pattern.tocoo()
        self.keys = np.unique(entries.row.astype(np.int64) * self.size + entries.col)
        self.rows, self.columns = np.divmod(self.keys, max(self.size, 1))
        self.diagonal = np.searchsorted(self.keys, np.arange(self.size) * (self.size + 1))

    def places(self, rows: IntArray, columns: IntArray) -> IntArray:
        """Which of the places (p,) are in these rows and columns, (q,) each."""
        return np.asarray(np.searchsorted(self.keys, rows * self.size + columns))

    def values(self, matrix: sp.csr_array, position: IntArray) -> Array:
        """The entries (p,) of a matrix whose rows and columns are the contact unknowns ``position``."""
        entries = matrix.tocoo()
        values = np.zeros(self.keys.size)
        np.add.at(values, self.places(position[entries.row], position[entries.col]), entries.data)
        return values

    def matrix(self, values: Array) -> sp.csr_array:
        """The matrix (k, k) with these entries."""
        there = values != 0.0
        return sp.csr_array((values[there], (self.rows[there], self.columns[there])), shape=(self.size,) * 2)

    def galerkin(self, between: sp.csr_array, coarse: Coupling) -> sp.csr_array:
        """The entries (q,) of ``between' A between`` by those (p,) of A, as a matrix (q, p)."""
        between = sp.csr_array(between)
        count = np.diff(between.indptr).astype(np.int64)
        first, second = count[self.rows], count[self.columns]
        entry = np.repeat(np.arange(self.keys.size), first * second)
        start = np.cumsum(first * second) - first * second
        left, right = np.divmod(np.arange(entry.size) - start[entry], second[entry])
        left += between.indptr[self.rows[entry]]
        right += between.indptr[self.columns[entry]]
        keys = between.indices[left].astype(np.int64) * coarse.size + between.indices[right]
        weights = between.data[left] * between.data[right]
        shape = (coarse.keys.size, self.keys.size)
        return sp.csr_array((weights, (np.searchsorted(coarse.keys, keys), entry)), shape=shape)


class Level:
    """One matrix, and where in it the rows of contact unknowns are; never changed."""

    def __init__(self, matrix: sp.csr_array, contact: IntArray, coupling: sp.csr_array) -> None:
        self.contact = contact
        self.matrix = narrow(_completed(matrix, contact, coupling))
        starts, ends = self.matrix.indptr[contact], self.matrix.indptr[contact + 1]
        lengths = (ends - starts).astype(np.int64)
        first = np.concatenate([[0], np.cumsum(lengths)])
        #: Where the entries of the contact rows are, the first of each row, and the row of each.
        self.entries = np.arange(first[-1]) + np.repeat(starts - first[:-1], lengths)
        self.first = first
        self.rows = np.repeat(np.arange(contact.size), lengths)
        self.columns = self.matrix.indices[self.entries].astype(np.int64)
        self.values = self.matrix.data[self.entries]
        keys = self.rows * matrix.shape[0] + self.columns
        #: Which of these entries are on the diagonal.
        self.own = np.searchsorted(keys, np.arange(contact.size) * matrix.shape[0] + contact)
        self.coupling = Coupling(coupling)
        #: Which of them are those of what is added between contact unknowns.
        self.added = np.searchsorted(keys, self.coupling.rows * matrix.shape[0] + contact[self.coupling.columns])
        self.diagonal = np.abs(diagonal(self.matrix))


class CoarseChange:
    """What is changed in a Galerkin product by holding and adding on the finer level.

    ``prolongation (n, n_coarse)``: it is cut off where unknowns are held.
    """

    def __init__(self, level: Level, prolongation: sp.csr_array) -> None:
        shape = (level.contact.size, level.matrix.shape[0])
        rows = sp.csr_array((level.values, level.columns, level.first), shape=shape)
        self.reach, self.images = sp.csr_array(prolongation[level.contact]), sp.csr_array(rows @ prolongation)
        self.between = sp.csr_array(rows[:, level.contact])

    def of(self, held: BoolArray, added: sp.csr_array) -> sp.csr_array:
        """The change, where contact unknowns are held and a matrix is added between the others."""
        cut, between = self.reach[held], self.between[held][:, held]
        part = sp.csr_array(cut.T @ (0.5 * (between @ cut) - self.images[held]))
        change = part + part.T
        return sp.csr_array(change + self.reach.T @ (added @ self.reach) if added.nnz else change)


@lru_cache
def sweeps() -> Any:
    """Compiled Gauss-Seidel sweeps of pyamg for matrices by rows, loaded when they are first needed."""
    with IMPORTS:
        from pyamg import amg_core

    return amg_core


class Points:
    """Where the contact unknowns of a level stand in blocks of one contact point each; never changed."""

    def __init__(self, level: Level, points: IntArray) -> None:
        _, number = np.unique(points, return_inverse=True)
        order = np.argsort(number, kind="stable")
        start = np.searchsorted(number[order], np.arange(number.max() + 1))
        position = np.empty_like(number)
        position[order] = np.arange(number.size) - start[number[order]]
        self.size, self.count = int(position.max()) + 1, int(number.max()) + 1
        #: The row of each contact unknown in the blocks.
        self.slots = slots = number * self.size + position
        inside = np.full(level.matrix.shape[0], -1)
        inside[level.contact] = np.arange(level.contact.size)
        column = inside[level.columns]
        #: Which of the entries of the contact rows are between contact unknowns, and between which.
        self.entries = np.flatnonzero(column >= 0)
        self.rows, self.columns = level.rows[self.entries], column[self.entries]
        empty = np.setdiff1d(np.arange(self.count * self.size), slots)
        row, col = np.append(slots[self.rows], empty), np.append(slots[self.columns], empty)
        keys, block = np.unique(row // self.size * self.count + col // self.size, return_inverse=True)
        #: The place of each of them among the numbers of the blocks; behind them those of rows that stand for nothing.
        self.flat = (block * self.size + row % self.size) * self.size + col % self.size
        self.indices = (keys % self.count).astype(np.int32)
        self.indptr = np.searchsorted(keys, np.arange(self.count + 1) * self.count).astype(np.int32)
        self.diagonal = np.searchsorted(keys, np.arange(self.count) * (self.count + 1))


class PointSmoother:
    """The contact unknowns of a level by themselves, smoothed point by point.

    Friction that has hardly begun to slip is very stiff across the direction of slip, which lies anywhere between the
    unknowns of the point: one at a time they would hardly move.
    """

    def __init__(self, changed: TruncatedLevel, points: Points) -> None:
        level, values = changed.level, changed.values
        self.rows = changed.rows
        self.contact, self.points = level.contact, points
        size = points.size
        entries = np.append(values[points.entries], np.ones(points.flat.size - points.entries.size))
        # Columns of held unknowns meet zeros only; left in, they would put the rounding of the inverse there.
        entries[: points.entries.size][changed.held[points.columns] & (points.rows != points.columns)] = 0.0
        self.data = np.zeros(points.indices.size * size**2)
        self.data[points.flat] = entries
        self.inverse = np.linalg.inv(self.data.reshape(-1, size, size)[points.diagonal]).ravel()

    def smooth(self, x: Array, right: Array, forward: bool) -> None:
        """One sweep over the points, in place."""
        points = self.points
        rest, step = np.zeros(points.count * points.size), np.zeros(points.count * points.size)
        rest[points.slots] = right[self.contact] - self.rows @ x
        span = (0, points.count, 1) if forward else (points.count - 1, -1, -1)
        sweeps().block_gauss_seidel(
            points.indptr, points.indices, self.data, step, rest, self.inverse, *span, points.size
        )
        x[self.contact] += step[points.slots]


class TruncatedLevel:
    """A level with some of its contact unknowns held, and a matrix added between the others."""

    def __init__(self, level: Level) -> None:
        self.level = level
        self.held = np.zeros(level.contact.size, dtype=bool)
        self.added = np.zeros(level.coupling.keys.size)
        #: Entries of the contact rows.
        self.values = level.values
        #: Whether what is added is much stiffer than the body.
        self.stiff = False
        self._patch: PointSmoother | None = None
        self._rows: sp.csr_array | None = None
        self._matrix = level.matrix
        self._current = True

    @property
    def matrix(self) -> sp.csr_array:
        """The matrix, made when it is asked for."""
        if not self._current:
            level = self.level
            if self._matrix is level.matrix:
                parts = (level.matrix.data.copy(), level.matrix.indices, level.matrix.indptr)
                self._matrix = sp.csr_array(parts, shape=level.matrix.shape)
            self._matrix.data[level.entries] = self.values
            self._current = True
        return self._matrix

    @property
    def rows(self) -> sp.csr_array:
        """Those of the contact unknowns, (k, n)."""
        if self._rows is None:
            level = self.level
            shape = (level.contact.size, level.matrix.shape[0])
            self._rows = sp.csr_array((self.values, level.columns, level.first), shape=shape)
        return self._rows

    def change(self, held: BoolArray, added: Array) -> bool:
        """Make the rows of the held contact unknowns those of the identity, and add to the others; whether that is
        anything new."""
        level = self.level
        if np.array_equal(held, self.held) and np.array_equal(added, self.added):
            return False
        values = level.values.copy()
        values[level.added] += added
        values[held[level.rows]] = 0.0
        values[level.own[held]] = 1.0
        self.held, self.added, self.values, self._current = held, added, values, False
        self._patch = self._rows = None
        return True

    def patch(self, blocks: Callable[[int], Points], k: int) -> PointSmoother | None:
        """What smooths the contact points beforehand, where they are stiff."""
        if self.stiff and self._patch is None:
            self._patch = PointSmoother(self, blocks(k))
        return self._patch if self.stiff else None

    def become(self, numbers: Array) -> None:
        """Be the matrix with these numbers at the places of that of the level."""
        matrix = self.level.matrix
        self._matrix = sp.csr_array((numbers, matrix.indices, matrix.indptr), shape=matrix.shape)

    def shift(self, change: sp.csr_array) -> None:
        """Add to the matrix of the level; unknowns that nothing is left of keep their diagonal entry."""
        matrix = sp.csr_array(self.level.matrix + change)
        before = self.level.diagonal
        gone = matrix.diagonal() <= 1e-12 * before
        if gone.any():
            matrix = sp.csr_array(matrix + sp.diags_array(np.where(gone, before, 0.0)))
        self._matrix = narrow(matrix)


@dataclass(frozen=True, eq=False)
class Transfer:
    """Prolongation from one level to the next finer one, and its transpose."""

    prolongation: sp.csr_array  # (n_fine, n_coarse)

    @cached_property
    def restriction(self) -> sp.csr_array:
        """Its transpose, shape (n_coarse, n_fine); the compiled cycle has one of its own."""
        return narrow(sp.csr_array(self.prolongation.T))

    @staticmethod
    def of(prolongation: sp.csr_array) -> Transfer:
        """With indices as the compiled kernels ask for."""
        return Transfer(narrow(prolongation))


def narrow(matrix: sp.csr_array) -> sp.csr_array:
    """The matrix with 32-bit indices, which the compiled kernels ask for, in order; its numbers may be shared."""
    short = matrix.indices.dtype == matrix.indptr.dtype == np.int32
    if isinstance(matrix, sp.csr_array) and short and matrix.has_sorted_indices:
        return matrix  # with what it knows of itself
    matrix = sp.csr_array(matrix)
    indices, indptr = matrix.indices.astype(np.int32, copy=False), matrix.indptr.astype(np.int32, copy=False)
    if matrix.has_sorted_indices:
        return sp.csr_array((matrix.data, indices, indptr), shape=matrix.shape)
    out = sp.csr_array((matrix.data.copy(), indices.copy(), indptr), shape=matrix.shape)
    out.sort_indices()
    return out


def _completed(matrix: sp.csr_array, contact: IntArray, coupling: sp.csr_array) -> sp.csr_array:
    """The matrix with an explicit zero wherever contact unknowns are coupled and it has no entry."""
    wanted = coupling.tocoo()
    rows, columns = contact[wanted.row], contact[wanted.col]
    if not rows.size:
        return matrix
    part = sp.csr_array(matrix[contact])
    part.sort_indices()
    there = np.repeat(contact, np.diff(part.indptr)) * matrix.shape[0] + part.indices
    keys = rows * matrix.shape[0] + columns
    missing = there[np.minimum(np.searchsorted(there, keys), len(there) - 1)] != keys
    if not missing.any():
        return matrix
    entries = matrix.tocoo()
    data = np.concatenate([entries.data, np.zeros(int(missing.sum()))])
    index = (np.concatenate([entries.row, rows[missing]]), np.concatenate([entries.col, columns[missing]]))
    return sp.csr_array((data, index), shape=matrix.shape)
