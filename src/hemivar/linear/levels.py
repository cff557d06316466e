"""Stiffness matrices from coarse to fine, and the multigrid cycle on them that leaves some contact unknowns alone.

On a hierarchy of nested meshes a coarse unknown is left out of the cycle where most of the contact unknowns that it
reaches are held at a kink.  The coarse functions that are kept are cut off at the held ones: this changes few of them,
and those little, so that the coarse matrices need no correction: they are the ones assembled on the coarse meshes, and
holding a point costs nothing but a look at its row.  Where the held unknowns end a function on every level is kept
that would be lost if it had to vanish at all of them, and each costs conjugate gradients about half an iteration.

Algebraic coarse functions reach too far for that.  They are cut off as well, and what this changes in the coarse
matrices is added to them, which takes products with the rows of the contact unknowns only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.linear.kernels import kernels

__all__ = ["COARSEST", "Levels", "Transfer", "Truncated"]

#: Unknowns that the coarsest level, which is solved densely, should have at most.
COARSEST = 400

_PIVOT = 1e-10
_STIFF = 2.0
#: Part of the weights of what a coarse unknown reaches that may be held before it is left out: more than one neighbour
#: of a node on a line, two on a plane.
_MOSTLY = 0.3


@dataclass(frozen=True, eq=False)
class Transfer:
    """Prolongation from one level to the next finer one, and its transpose.

    Attributes
    ----------
    prolongation : sparse array, shape (n_fine, n_coarse)
    restriction : sparse array, shape (n_coarse, n_fine)
    """

    prolongation: sp.csr_array
    restriction: sp.csr_array

    @staticmethod
    def of(prolongation: sp.csr_array) -> Transfer:
        """From the prolongation alone."""
        return Transfer(_narrow(prolongation), _narrow(sp.csr_array(prolongation.T)))


class _Coupling:
    """The places of a symmetric matrix between contact unknowns, and what it is for the next coarser ones.

    Attributes
    ----------
    keys : int array (p,)
        ``row * k + column`` of each place, in order.
    rows, columns : int arrays (p,)
    diagonal : int array (k,)
        Which of them are on the diagonal.
    """

    def __init__(self, pattern: sp.csr_array) -> None:
        self.size = pattern.shape[0]
        entries = pattern.tocoo()
        self.keys = np.unique(entries.row.astype(np.int64) * self.size + entries.col)
        self.rows, self.columns = np.divmod(self.keys, max(self.size, 1))
        self.diagonal = np.searchsorted(self.keys, np.arange(self.size) * (self.size + 1))

    def values(self, matrix: sp.csr_array, place: IntArray) -> Array:
        """The entries (p,) of a matrix whose rows and columns are the contact unknowns ``place``."""
        entries = matrix.tocoo()
        found = np.zeros(self.keys.size)
        keys = place[entries.row] * self.size + place[entries.col]
        np.add.at(found, np.searchsorted(self.keys, keys), entries.data)
        return found

    def matrix(self, values: Array) -> sp.csr_array:
        """The matrix (k, k) with these entries."""
        there = values != 0.0
        return sp.csr_array((values[there], (self.rows[there], self.columns[there])), shape=(self.size,) * 2)

    def galerkin(self, between: sp.csr_array, coarse: _Coupling) -> sp.csr_array:
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


class _Level:
    """One matrix, and where in it the rows of contact unknowns are; never changed."""

    def __init__(self, matrix: sp.csr_array, contact: IntArray, coupling: sp.csr_array) -> None:
        self.contact = contact
        self.matrix = _narrow(_completed(matrix, contact, coupling))
        starts, ends = self.matrix.indptr[contact], self.matrix.indptr[contact + 1]
        lengths = (ends - starts).astype(np.int64)
        first = np.concatenate([[0], np.cumsum(lengths)])
        #: Where the entries of the contact rows are, and the row of each.
        self.entries = np.arange(first[-1]) + np.repeat(starts - first[:-1], lengths)
        self.rows = np.repeat(np.arange(contact.size), lengths)
        self.columns = self.matrix.indices[self.entries].astype(np.int64)
        self.values = self.matrix.data[self.entries]
        keys = self.rows * matrix.shape[0] + self.columns
        #: Which of these entries are on the diagonal.
        self.own = np.searchsorted(keys, np.arange(contact.size) * matrix.shape[0] + contact)
        self.coupling = _Coupling(coupling)
        #: Which of them are those of what is added between contact unknowns.
        self.added = np.searchsorted(keys, self.coupling.rows * matrix.shape[0] + contact[self.coupling.columns])
        self.diagonal = np.abs(self.matrix.diagonal())

    def contact_rows(self, matrix: sp.csr_array) -> sp.csr_array:
        """The rows of the contact unknowns of a matrix with the entries of this one."""
        first = np.searchsorted(self.rows, np.arange(self.contact.size + 1))
        shape = (self.contact.size, matrix.shape[0])
        return sp.csr_array((matrix.data[self.entries], self.columns, first), shape=shape)

    def galerkin_change(self, held: BoolArray, added: sp.csr_array, prolongation: sp.csr_array) -> sp.csr_array:
        """What holding and adding change in the Galerkin product with a prolongation that is cut off where held."""
        rows = self.contact_rows(self.matrix)[held]
        reach, cut = prolongation[self.contact], prolongation[self.contact[held]]
        lost = cut.T @ (rows @ prolongation)
        both = cut.T @ (rows[:, self.contact[held]] @ cut)
        return sp.csr_array(both - lost - lost.T + reach.T @ (added @ reach))


class _TruncatedLevel:
    """A level with some of its contact unknowns held, and a matrix added between the others."""

    def __init__(self, level: _Level) -> None:
        self.level = level
        self.matrix = level.matrix
        self.held = np.zeros(level.contact.size, dtype=bool)
        self.added = np.zeros(level.coupling.keys.size)
        self.patch: _PointSmoother | None = None

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
        if self.matrix is level.matrix:
            parts = (level.matrix.data.copy(), level.matrix.indices, level.matrix.indptr)
            self.matrix = sp.csr_array(parts, shape=level.matrix.shape)
        self.matrix.data[level.entries] = values
        self.held, self.added = held, added
        return True

    def shift(self, change: sp.csr_array) -> None:
        """Add to the matrix of the level; unknowns that nothing is left of keep their diagonal entry."""
        matrix = sp.csr_array(self.level.matrix + change)
        before = self.level.diagonal
        gone = matrix.diagonal() <= 1e-12 * before
        if gone.any():
            matrix = sp.csr_array(matrix + sp.diags_array(np.where(gone, before, 0.0)))
        self.matrix = _narrow(matrix)


class _Points:
    """Where the contact unknowns of a level stand in blocks of one contact point each; never changed."""

    def __init__(self, level: _Level, points: IntArray) -> None:
        _, number = np.unique(points, return_inverse=True)
        order = np.argsort(number, kind="stable")
        start = np.searchsorted(number[order], np.arange(number.max() + 1))
        place = np.empty_like(number)
        place[order] = np.arange(number.size) - start[number[order]]
        self.size, self.count = int(place.max()) + 1, int(number.max()) + 1
        #: The row of each contact unknown in the blocks.
        self.slots = slots = number * self.size + place
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
        self.first = np.searchsorted(level.rows, np.arange(level.contact.size + 1))


class _PointSmoother:
    """The contact unknowns of a level by themselves, smoothed point by point.

    Friction that has hardly begun to slip is very stiff across the direction of slip, which lies anywhere between the
    unknowns of the point: one at a time they would hardly move.
    """

    def __init__(self, changed: _TruncatedLevel, points: _Points) -> None:
        level, values = changed.level, changed.matrix.data[changed.level.entries]
        shape = (level.contact.size, level.matrix.shape[0])
        self.rows = sp.csr_array((values, level.columns, points.first), shape=shape)
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
        kernels().block_gauss_seidel(
            points.indptr, points.indices, self.data, step, rest, self.inverse, *span, points.size
        )
        x[self.contact] += step[points.slots]


class Levels:
    """Matrices from coarse to fine with the transfers between them: a preconditioner of each of them.

    Nothing in it changes: many solves may work on it at the same time, each with a :class:`Truncated` that it
    borrows.

    Parameters
    ----------
    matrices : list of sparse arrays
        Symmetric, from coarse to fine.
    transfers : list of Transfer
        ``transfers[k]`` leads from level k to level k + 1.
    contacts : list of int arrays
        For each level, unknowns on which contact laws act there; empty where no problem is posed.
    points : list of int arrays
        The contact point that each of these unknowns belongs to; a law couples those of one point.
    algebraic : int
        How many of the levels, from the coarsest, are algebraic: no mesh belongs to them, and no contact unknowns.
    sweeps : int
        Gauss-Seidel sweeps before and after each coarse correction.
    """

    def __init__(
        self,
        matrices: list[sp.csr_array],
        transfers: list[Transfer],
        contacts: list[IntArray],
        points: list[IntArray],
        algebraic: int = 0,
        sweeps: int = 1,
    ) -> None:
        self.transfers = transfers
        self.algebraic = algebraic
        self.sweeps = sweeps
        self.between: list[sp.csr_array] = []
        self.own: list[IntArray] = []
        self.points: list[IntArray] = []
        levels: list[_Level] = []
        reached, chained = np.zeros(0, dtype=np.int64), sp.csr_array((0, 0))
        for k in range(len(matrices) - 1, -1, -1):
            contact = np.union1d(reached, contacts[k]).astype(np.int64)
            place, own = np.searchsorted(contact, reached), np.searchsorted(contact, contacts[k])
            group = np.full(contact.size, -1)
            group[own] = points[k]
            group[group < 0] = group.max(initial=-1) + 1 + np.arange(np.count_nonzero(group < 0))
            shape = (group.size, int(group.max(initial=-1)) + 1)
            member = sp.csr_array((np.ones(group.size), (np.arange(group.size), group)), shape=shape)
            coupling = sp.csr_array(_placed(chained, place, contact.size) + member @ member.T)
            levels.insert(0, _Level(matrices[k], contact, coupling))
            self.own.insert(0, own)
            self.points.insert(0, group)
            if k <= algebraic:
                reached, chained = np.zeros(0, dtype=np.int64), sp.csr_array((0, 0))
                self.between.insert(0, sp.csr_array((contact.size, 0)))
            else:
                rows = transfers[k - 1].prolongation[contact]
                reached = np.unique(rows.indices).astype(np.int64)
                between = sp.csr_array(rows[:, reached])
                self.between.insert(0, between)
                chained = sp.csr_array(abs(between).T @ coupling @ abs(between))
        # Columns of each transfer between contact unknowns, numbered as those of the coarser level.
        for k, between in enumerate(self.between[1:]):
            if k < algebraic:
                continue
            entries = between.tocoo()
            reach = np.unique(transfers[k].prolongation[levels[k + 1].contact].indices)
            columns = np.searchsorted(levels[k].contact, reach[entries.col])
            shape = (between.shape[0], levels[k].contact.size)
            self.between[k + 1] = sp.csr_array((entries.data, (entries.row, columns)), shape=shape)
        #: What is added on a level by what is added on the next finer one; and what a coarse unknown reaches there.
        self.galerkin: list[sp.csr_array] = [sp.csr_array((0, 0))] * len(levels)
        self.reach: list[sp.csr_array] = [sp.csr_array((0, 0))] * len(levels)
        for k in range(algebraic + 1, len(levels)):
            self.galerkin[k] = levels[k].coupling.galerkin(self.between[k], levels[k - 1].coupling)
            self.reach[k] = sp.csr_array(abs(self.between[k]).T)
        self.whole = [np.asarray(reach.sum(axis=1)) for reach in self.reach]
        self.levels = levels
        self._blocks: dict[int, _Points] = {}
        self._idle: list[Truncated] = []

    def borrow(self, top: int) -> Truncated:
        """Levels for one solve to change.

        The copies of the matrices are those of the last solve that has given them back: the memory of new ones costs
        a tenth of a solve.
        """
        try:
            borrowed = self._idle.pop()  # which no two threads do at once
        except IndexError:
            return Truncated(self, top)
        borrowed.top = top
        return borrowed

    def give_back(self, borrowed: Truncated) -> None:
        """Take back what nobody changes any more."""
        self._idle.append(borrowed)

    @property
    def sizes(self) -> list[int]:
        """Number of unknowns of every level, from coarse to fine."""
        return [level.matrix.shape[0] for level in self.levels]

    def matrix(self, k: int) -> sp.csr_array:
        """The matrix of a level."""
        return self.levels[k].matrix

    def diagonal(self, k: int) -> Array:
        """Its diagonal, (n,)."""
        diagonal: Array = self.levels[k].diagonal
        return diagonal

    def cycle(self, k: int, right: Array) -> Array:
        """One symmetric V-cycle from zero: an approximate solution for the right-hand side (n,) of a level."""
        return self._whole.cycle(k, right)

    def blocks(self, k: int) -> _Points:
        """The contact unknowns of a level in blocks of one contact point each; found when they are first needed."""
        found = self._blocks.get(k)
        if found is None:  # two threads may both find them
            found = self._blocks[k] = _Points(self.levels[k], self.points[k])
        return found

    @cached_property
    def _whole(self) -> Truncated:
        return Truncated(self, len(self.levels) - 1)


class Truncated:
    """Levels on which some contact unknowns are held, and more stiffness acts between others; belongs to one solve.

    Parameters
    ----------
    levels : Levels
    top : int
        The finest level that it is used on.
    vanishing : bool
        Leave out every coarse unknown that reaches a held one at all: then what a level knows is a field on the finest
        mesh that vanishes where it is held, and its matrix that of these fields.
    """

    def __init__(self, levels: Levels, top: int, vanishing: bool = False) -> None:
        self._levels, self.top = levels, top
        self._least = 0.0 if vanishing else _MOSTLY
        self._changed = [_TruncatedLevel(level) for level in levels.levels]
        self._coarse: Array | None = None

    def matrix(self, k: int) -> sp.csr_array:
        """The matrix of a level, rows of held unknowns replaced by those of the identity."""
        return self._changed[k].matrix

    def diagonal(self, k: int) -> Array:
        """Its diagonal before anything was held or added, (n,)."""
        return self._levels.diagonal(k)

    def change(self, held: BoolArray, added: sp.csr_array) -> None:
        """Hold contact unknowns of the top level, and add a matrix that acts between them; coarser levels follow.

        Parameters
        ----------
        held : bool array
            Which contact unknowns of that level keep their value; numbered as ``contacts[top]``.
        added : sparse array
            Symmetric; rows and columns of held unknowns are zero.
        """
        levels, top = self._levels, self.top
        own, count = levels.own[top], levels.levels[top].contact.size
        out = np.zeros(count, dtype=bool)
        out[own] = held
        values = levels.levels[top].coupling.values(added, own)
        new = True
        for k in range(top, levels.algebraic - 1, -1):
            level, changed = levels.levels[k], self._changed[k]
            new = changed.change(out, values)
            stiff = values[level.coupling.diagonal] > _STIFF * level.diagonal[level.contact]
            changed.patch = _PointSmoother(changed, levels.blocks(k)) if k == top and stiff.any() else None
            if k > levels.algebraic:
                reach, below = levels.reach[k], levels.levels[k - 1].coupling
                out = np.asarray(reach @ (out | stiff).astype(float) > self._least * levels.whole[k])
                values = levels.galerkin[k] @ values
                values[out[below.rows] | out[below.columns]] = 0.0
        if not new:
            return  # what is coarser is as it was
        if levels.algebraic:
            coarsest = levels.levels[levels.algebraic]
            prolongation = levels.transfers[levels.algebraic - 1].prolongation
            change = coarsest.galerkin_change(out, coarsest.coupling.matrix(values), prolongation)
            for k in range(levels.algebraic - 1, -1, -1):
                self._changed[k].shift(change)
                if k:
                    prolongation = levels.transfers[k - 1].prolongation
                    change = sp.csr_array(prolongation.T @ change @ prolongation)
        self._coarse = None

    def cycle(self, k: int, right: Array) -> Array:
        """One symmetric V-cycle from zero: an approximate solution for the right-hand side (n,) of a level.

        Entries of held unknowns must be zero in ``right``, and are zero in the answer.
        """
        return self._cycle(k, np.ascontiguousarray(right, dtype=float))

    def _cycle(self, k: int, right: Array) -> Array:
        if k == 0:
            return self._solve_coarsest(right)
        levels, changed = self._levels, self._changed[k]
        A, patch, transfer = changed.matrix, changed.patch, levels.transfers[k - 1]
        x = np.zeros_like(right)
        if patch is not None:
            patch.smooth(x, right, forward=True)
        for _ in range(levels.sweeps):
            kernels().gauss_seidel(A.indptr, A.indices, A.data, x, right, 0, x.size, 1)
        rest = A @ x
        np.subtract(right, rest, out=rest)
        coarse = transfer.restriction @ rest
        below = self._changed[k - 1]
        coarse[below.level.contact[below.held]] = 0.0
        x += transfer.prolongation @ self._cycle(k - 1, coarse)
        x[changed.level.contact[changed.held]] = 0.0
        for _ in range(levels.sweeps):
            kernels().gauss_seidel(A.indptr, A.indices, A.data, x, right, x.size - 1, -1, -1)
        if patch is not None:
            patch.smooth(x, right, forward=False)
        return x

    def _solve_coarsest(self, right: Array) -> Array:
        if self._coarse is None:
            changed = self._changed[0]
            free = np.ones(changed.matrix.shape[0])
            free[changed.level.contact[changed.held]] = 0.0  # their columns are still there, but meet zeros only
            dense = changed.matrix.toarray()
            dense *= free
            dense[np.diag_indices_from(dense)] += 1.0 - free
            self._coarse = _inverse_root(dense)
        root = self._coarse
        return np.asarray(root @ (root.T @ right))


def _placed(matrix: sp.csr_array, place: IntArray, count: int) -> sp.csr_array:
    """A small matrix with its rows and columns moved to other numbers."""
    entries = matrix.tocoo()
    return sp.csr_array((entries.data, (place[entries.row], place[entries.col])), shape=(count, count))


def _inverse_root(matrix: Array) -> Array:
    """Some ``R`` with ``R R'`` its inverse, or that of its absolute value where it is not positive definite."""
    diagonal = np.abs(np.diagonal(matrix))
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = matrix * scale  # in one piece of memory: new memory takes as long as the numbers
    scaled *= scale[:, None]
    upper, failed = la.lapack.dpotrf(scaled.T, lower=0, overwrite_a=1)
    if not failed and np.diagonal(upper).min(initial=1.0) > np.sqrt(_PIVOT):
        inverse, _ = la.lapack.dtrtri(upper, lower=0, overwrite_c=1)
        inverse *= scale[:, None]
        return np.asarray(inverse)
    scaled = scale[:, None] * (0.5 * (matrix + matrix.T)) * scale
    values, vectors = la.eigh(scaled, check_finite=False)
    size = np.maximum(np.abs(values), _PIVOT * np.abs(values).max(initial=1.0))
    return np.asarray((scale[:, None] * vectors) / np.sqrt(size))


def _narrow(matrix: sp.csr_array) -> sp.csr_array:
    """The matrix with 32-bit indices, which the compiled kernels ask for, in order; its numbers may be shared."""
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
