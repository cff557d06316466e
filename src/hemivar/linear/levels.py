"""Multigrid levels: stiffness matrices from coarse to fine, and the V-cycle that leaves some contact unknowns alone.

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

from hemivar.basics.arrays import NULL
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.kernels import kernels as compiled_kernels
from hemivar.linear.compiled import CompiledLevels, CompiledTruncation, NodeSlots
from hemivar.linear.fixed_patterns import FixedChange
from hemivar.linear.products import product
from hemivar.linear.truncated_level import CoarseChange, Level, Points, Transfer, TruncatedLevel, sweeps

__all__ = ["COARSEST", "LevelMatrix", "Levels", "Preconditioner", "Transfer", "Truncated"]

#: Unknowns that the coarsest level, which is solved densely, should have at most. Half as many cost
#: the same cycles on small bodies, and twice as many a tenth less, for bodies of so many need no other level.
COARSEST = 400

#: How many times stiffer than the body a law makes a contact unknown before its points are smoothed beforehand.
_STIFF = 2.0
#: Part of the weights of what a coarse unknown reaches that may be held before it is left out: more than one neighbour
#: of a node on a line, two on a plane.
_MOSTLY = 0.3
#: Cycles after a change from which on algebraic levels follow it; and where at most this part of what is held is new.
#: Half and twice of each cost the same cycles to 4 % on small bodies; to follow costs 3 (pairs) to 16 (bolted plates).
_LATE, _LATER, _NEW = 4, 12, 0.1


class Levels:
    """Matrices from coarse to fine with the transfers between them: a preconditioner of each of them.

    Nothing in it changes: many solves may work on it at the same time, each with a :class:`Truncated` that it
    borrows.

    ``matrices``: symmetric, from coarse to fine; ``transfers``: ``transfers[k]`` leads from level k to level k + 1;
    ``contacts``: for each level, unknowns on which contact laws act there; empty where no problem is posed; ``points``:
    the contact point that each of these unknowns belongs to; a law couples those of one point; ``algebraic``: how many
    of the levels, from the coarsest, are algebraic: no mesh belongs to them, and no contact unknowns; ``sweeps``:
    Gauss-Seidel sweeps before and after each coarse correction; ``slots``: for each level, the nodes of its unknowns;
    by default each is one of its own.
    """

    def __init__(
        self,
        matrices: list[sp.csr_array],
        transfers: list[Transfer],
        contacts: list[IntArray],
        points: list[IntArray],
        algebraic: int = 0,
        sweeps: int = 1,
        slots: list[NodeSlots] | None = None,
    ) -> None:
        self.transfers = transfers
        self.algebraic = algebraic
        self.sweeps = sweeps
        self.between: list[sp.csr_array] = []
        self.own: list[IntArray] = []
        self.points: list[IntArray] = []
        levels: list[Level] = []
        reached, chained = np.zeros(0, dtype=np.int64), sp.csr_array((0, 0))
        for k in range(len(matrices) - 1, -1, -1):
            contact = np.union1d(reached, contacts[k]).astype(np.int64)
            position, own = np.searchsorted(contact, reached), np.searchsorted(contact, contacts[k])
            group = np.full(contact.size, -1)
            group[own] = points[k]
            group[group < 0] = group.max(initial=-1) + 1 + np.arange(np.count_nonzero(group < 0))
            shape = (group.size, int(group.max(initial=-1)) + 1)
            member = sp.csr_array((np.ones(group.size), (np.arange(group.size), group)), shape=shape)
            coupling = sp.csr_array(_placed(chained, position, contact.size) + member @ member.T)
            levels.insert(0, Level(matrices[k], contact, coupling))
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
        self.levels = levels
        self.whole = [self._reached(k) for k in range(len(levels))]
        self._slots = [NodeSlots.single(level.matrix.shape[0]) for level in levels] if slots is None else slots
        self._blocks: dict[int, Points] = {}
        self._idle: list[Truncated] = []

    def _reached(self, k: int) -> Array:
        """The weights of what each coarse contact unknown reaches: contact unknowns, or all where no law acts on it.

        A master hardly moves the jumps of its slave: it is needed though all of these are held.
        """
        whole = np.asarray(self.reach[k].sum(axis=1))
        other = np.ones(whole.size, dtype=bool)
        other[self.own[k - 1] if whole.size else []] = False
        if other.any():
            columns = self.transfers[k - 1].prolongation[:, self.levels[k - 1].contact[other]]
            whole[other] = abs(columns).sum(axis=0)
        return whole

    def __getstate__(self) -> dict[str, object]:
        """Copies make their compiled levels anew."""
        return {
            name: value for name, value in vars(self).items() if name not in ("compiled", "fixed_change", "_whole")
        } | {"_idle": []}

    def borrow(self, top: int) -> Truncated:
        """Levels for one solve to change.

        The copies of the matrices are those of the last solve that has given them back: the memory of new ones costs
        a tenth of a solve.
        """
        try:
            borrowed = self._idle.pop()  # which no two threads do at once
        except IndexError:
            return Truncated(self, top)
        borrowed.lend(self, top)
        return borrowed

    def give_back(self, borrowed: Truncated) -> None:
        """Take back what nobody changes any more."""
        borrowed.let_go()
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

    def fast_cycle(self, k: int, right: Array) -> Array:
        """The same by the compiled kernels, in single precision inside; for iterations that bear that."""
        return self._whole.fast_cycle(k, right)

    def preconditioner(self, k: int) -> Preconditioner:
        """The cycle on a level, for one solve."""
        return Preconditioner(self._whole, k)

    def multiply(self, k: int, x: Array) -> Array:
        """The matrix of a level times a vector (n,)."""
        if self.compiled is None or k < self.algebraic:
            return np.asarray(self.matrix(k) @ x)
        return self.compiled.multiply(k, x)

    def blocks(self, k: int) -> Points:
        """The contact unknowns of a level in blocks of one contact point each; found when they are first needed."""
        blocks = self._blocks.get(k)
        if blocks is None:  # two threads may both find them
            blocks = self._blocks[k] = Points(self.levels[k], self.points[k])
        return blocks

    @cached_property
    def _whole(self) -> Truncated:
        whole = Truncated(self, len(self.levels) - 1)
        whole.prepare()  # many threads use it
        return whole

    @cached_property
    def eliminated(self) -> Eliminated | None:
        """The coarsest matrix as far as no solve changes it."""
        return Eliminated.of(self.levels[0])

    @cached_property
    def coarse_change(self) -> CoarseChange:
        """How holding unknowns of the coarsest level that is not algebraic changes the one below."""
        return CoarseChange(self.levels[self.algebraic], self.transfers[self.algebraic - 1].prolongation)

    @cached_property
    def compiled(self) -> CompiledLevels | None:
        """The levels in the compiled kernels; None where these are not there, or do not know such nodes."""
        available = compiled_kernels()
        if available is None or self.sweeps != 1 or len(self.levels) == 1:
            return None
        for level, own, points, slots in zip(self.levels, self.own, self.points, self._slots, strict=True):
            if not slots.serves(level.matrix.shape[0]) or not level.matrix.has_canonical_format:
                return None
            nodes = slots.places[level.contact[own]] // slots.size
            # Stiff friction couples the unknowns of a point: they must stand in one block.
            if np.unique(np.stack([points[own], nodes]), axis=1).shape[1] != np.unique(points[own]).size:
                return None
        return CompiledLevels(
            available,
            [level.matrix for level in self.levels],
            self.transfers,
            # all rows of an algebraic level may change
            [
                np.arange(n) if k < self.algebraic else level.contact
                for k, (n, level) in enumerate(zip(self.sizes, self.levels, strict=True))
            ],
            self._slots,
        )

    @cached_property
    def fixed_change(self) -> FixedChange | None:
        """:attr:`coarse_change` and what it changes further down, in the compiled kernels; None where these are not
        there, or do not know such patterns."""
        if self.compiled is None:
            return None
        transfers = [transfer.prolongation for transfer in self.transfers[: self.algebraic]]
        try:
            return FixedChange(self.compiled.kernels, self.levels[: self.algebraic + 1], transfers)
        except ValueError:
            return None


@dataclass(frozen=True, eq=False)
class Eliminated:
    """The coarsest matrix with the unknowns that no contact law acts on eliminated: a solve changes the rest only."""

    inner: IntArray  # (i,): these unknowns
    follows: Array  # (i, c): how they follow the contact unknowns, with the other sign
    schur: Array  # (c, c): what is left between contact unknowns
    root: Array  # (n, n): its first i columns times their transpose are the inverse between inner unknowns; zero else

    @staticmethod
    def of(level: Level) -> Eliminated | None:
        """None where the inner part is not positive definite."""
        matrix, n = level.matrix.toarray(), level.matrix.shape[0]
        inner = np.setdiff1d(np.arange(n), level.contact)
        upper = _upper_root(matrix[np.ix_(inner, inner)])
        if upper is None:
            return None
        between = matrix[np.ix_(inner, level.contact)]
        follows = upper @ (upper.T @ between)
        schur = matrix[np.ix_(level.contact, level.contact)] - between.T @ follows
        root = np.zeros((n, n))
        root[inner, : inner.size] = upper
        return Eliminated(inner, follows, 0.5 * (schur + schur.T), root)


class Truncated:
    """Levels on which some contact unknowns are held, and more stiffness acts between others; belongs to one solve.

    ``top``: the finest level that it is used on; ``vanishing``: leave out every coarse unknown that reaches a held one
    at all: then what a level knows is a field on the finest mesh that vanishes where it is held, and its matrix that of
    these fields.
    """

    def __init__(self, levels: Levels, top: int, vanishing: bool = False) -> None:
        self._levels, self.top = levels, top
        self._least = 0.0 if vanishing else _MOSTLY
        self._changed = [TruncatedLevel(level) for level in levels.levels]
        self._coarse: Array | None = None
        #: Memory of its root from the eliminated matrix: new memory takes longer than the numbers.
        self._room: Array | None = None
        #: What algebraic levels have not followed yet.
        self._late: tuple[BoolArray, Array] | None = None
        self.begin()
        # Without patterns that are known the compiled levels could not follow.
        follows = levels.compiled is not None and (not levels.algebraic or levels.fixed_change is not None)
        self._compiled = CompiledTruncation(levels.compiled) if levels.compiled is not None and follows else None

    def lend(self, levels: Levels, top: int) -> None:
        """To another solve on these levels, from whose matrices the copies were made."""
        self._levels, self.top = levels, top
        self.begin()

    def let_go(self) -> None:
        """Know no levels: in a circle of references their memory would wait for Python's collector."""
        del self._levels

    def begin(self) -> None:
        """Forget, for another solve, how far algebraic levels have followed: its bits depend on nothing before it."""
        self._cycles, self._followed = 0, np.zeros(0, dtype=bool)

    def matrix(self, k: int) -> sp.csr_array:
        """The matrix of a level, rows of held unknowns replaced by those of the identity."""
        self._follow()
        return self._changed[k].matrix

    def diagonal(self, k: int) -> Array:
        """Its diagonal before anything was held or added, (n,)."""
        return self._levels.diagonal(k)

    def multiply(self, k: int, x: Array) -> Array:
        """The matrix of a level times a vector (n,), zero where unknowns are held; entries there mean nothing."""
        changed, compiled = self._changed[k], self._levels.compiled
        if compiled is None or k < self._levels.algebraic:
            return np.asarray(self.matrix(k) @ x)
        out = compiled.multiply(k, x)
        if changed.values is not changed.level.values:
            out[changed.level.contact] = product(changed.rows, x)
        return out

    def change(self, held: BoolArray, added: sp.csr_array) -> None:
        """Hold contact unknowns of the top level, and add a matrix that acts between them; coarser levels follow.

        ``held``: which contact unknowns of that level keep their value; numbered as ``contacts[top]``; ``added``:
        symmetric; rows and columns of held unknowns are zero.
        """
        own = self._levels.own[self.top]
        self.change_values(held, self._levels.levels[self.top].coupling.values(added, own))

    def change_values(self, held: BoolArray, values: Array) -> None:
        """:meth:`change` by the entries (p,) of what is added, at the places of the :class:`Coupling` of the level."""
        levels, top = self._levels, self.top
        out = np.zeros(levels.levels[top].contact.size, dtype=bool)
        out[levels.own[top]] = held
        new = True
        for k in range(top, levels.algebraic - 1, -1):
            level, changed = levels.levels[k], self._changed[k]
            new = changed.change(out, values)
            stiff = values[level.coupling.diagonal] > _STIFF * level.diagonal[level.contact]
            changed.stiff = k == top and bool(stiff.any())
            if self._compiled is not None and new:
                self._compiled.change(k, out, changed.values)
            if k > levels.algebraic:
                reach, below = levels.reach[k], levels.levels[k - 1].coupling
                out = np.asarray(reach @ (out | stiff).astype(float) > self._least * levels.whole[k])
                values = levels.galerkin[k] @ values
                values[out[below.rows] | out[below.columns]] = 0.0
        if not new:
            return  # what is coarser is as it was
        if levels.algebraic:
            self._late, self._cycles = (out, values), 0
        else:
            self._coarse = None

    def _follow(self) -> None:
        """Change algebraic levels by what was held and added on the finer ones."""
        if self._late is None:
            return
        levels, (held, values), self._late, self._coarse = self._levels, self._late, None, None
        self._followed = held
        if self._compiled is not None and levels.fixed_change is not None:
            for k, numbers in zip(
                range(levels.algebraic - 1, -1, -1), levels.fixed_change.of(held, values), strict=True
            ):
                self._changed[k].become(numbers)
                if k:
                    self._compiled.change(k, np.zeros(levels.sizes[k], dtype=bool), numbers)
            return
        change = levels.coarse_change.of(held, levels.levels[levels.algebraic].coupling.matrix(values))
        for k in range(levels.algebraic - 1, -1, -1):
            self._changed[k].shift(change)
            if k:
                prolongation = levels.transfers[k - 1].prolongation
                change = sp.csr_array(prolongation.T @ change @ prolongation)

    def cycle(self, k: int, right: Array) -> Array:
        """One symmetric V-cycle from zero: an approximate solution for the right-hand side (n,) of a level.

        Entries of held unknowns must be zero in ``right``, and are zero in the answer.
        """
        self._follow()
        return self._cycle(k, np.ascontiguousarray(right, dtype=float))

    def fast_cycle(self, k: int, right: Array) -> Array:
        """The same by the compiled kernels, in single precision inside; for iterations that bear that.

        For the first few cycles algebraic levels are those of the change before, if there was one: to change them costs
        as much as many cycles, and equations that are soon solved well enough do not need it.  Where hardly anything
        else is held they wait longer.
        """
        if self._compiled is None or k == 0:
            return self.cycle(k, right)
        self._cycles += 1
        if self._late is None and not self._followed.size:  # as fresh levels that have followed what is held
            self._followed = self._changed[self._levels.algebraic].held
        if self._late is not None and self._cycles > self._patience(self._late[0]):
            self._follow()
        self._coarse_root()
        return self._compiled.cycle(k, right)

    def _patience(self, held: BoolArray) -> int:
        """Cycles for which algebraic levels need not follow."""
        if held.size != self._followed.size:
            return 0
        few = np.count_nonzero(held != self._followed) <= _NEW * np.count_nonzero(held)
        return _LATER if few else _LATE

    @property
    def single(self) -> bool:
        """Whether fast cycles work in single precision."""
        return self._compiled is not None

    def prepare(self) -> None:
        """Make what a cycle needs."""
        self._follow()
        self._coarse_root()

    def _cycle(self, k: int, right: Array) -> Array:
        if k == 0:
            return self._solve_coarsest(right)
        levels, changed = self._levels, self._changed[k]
        A, patch, transfer = changed.matrix, changed.patch(levels.blocks, k), levels.transfers[k - 1]
        x = np.zeros_like(right)
        if patch is not None:
            patch.smooth(x, right, forward=True)
        for _ in range(levels.sweeps):
            sweeps().gauss_seidel(A.indptr, A.indices, A.data, x, right, 0, x.size, 1)
        rest = self.multiply(k, x)
        np.subtract(right, rest, out=rest)
        coarse = transfer.restriction @ rest
        below = self._changed[k - 1]
        coarse[below.level.contact[below.held]] = 0.0
        x += transfer.prolongation @ self._cycle(k - 1, coarse)
        x[changed.level.contact[changed.held]] = 0.0
        for _ in range(levels.sweeps):
            sweeps().gauss_seidel(A.indptr, A.indices, A.data, x, right, x.size - 1, -1, -1)
        if patch is not None:
            patch.smooth(x, right, forward=False)
        return x

    def _solve_coarsest(self, right: Array) -> Array:
        root = self._coarse_root()
        return np.asarray(root @ (root.T @ right))

    def _coarse_root(self) -> Array:
        if self._coarse is None:
            root = self._eliminated_root()
            self._coarse = self._dense_root() if root is None else root
            if self._compiled is not None:
                self._compiled.set_root(self._coarse)
        return self._coarse

    def _eliminated_root(self) -> Array | None:
        """The root from what only the rows of the contact unknowns change; None where they are not all that changes."""
        levels, changed = self._levels, self._changed[0]
        known = None if levels.algebraic or changed.level.contact.size == 0 else levels.eliminated
        if known is None:
            return None
        kept = np.flatnonzero(~changed.held)
        schur, coupling = known.schur.copy(), changed.level.coupling
        schur[coupling.rows, coupling.columns] += changed.added
        upper = _upper_root(schur[np.ix_(kept, kept)])
        if upper is None:
            return None
        if self._room is None:
            self._room = known.root.copy(order="C")
        root, unknowns, inner = self._room, changed.level.contact[kept], known.inner.size
        root[:, inner:] = 0.0
        root[known.inner, inner : inner + kept.size] = -known.follows[:, kept] @ upper
        root[unknowns, inner : inner + kept.size] = upper
        out = changed.level.contact[changed.held]
        root[out, np.arange(inner + kept.size, len(root))] = 1.0
        return root

    def _dense_root(self) -> Array:
        changed = self._changed[0]
        free = np.ones(changed.matrix.shape[0])
        free[changed.level.contact[changed.held]] = 0.0  # their columns are still there, but meet zeros only
        dense = changed.matrix.toarray()
        dense *= free
        dense[np.diag_indices_from(dense)] += 1.0 - free
        return _inverse_root(dense)


@dataclass(frozen=True, eq=False)
class LevelMatrix:
    """The matrix of a level, to be multiplied with vectors."""

    levels: Levels | Truncated
    k: int

    def __matmul__(self, x: Array, /) -> Array:
        return self.levels.multiply(self.k, x)


class Preconditioner:
    """The cycle for one iteration of conjugate gradients.

    In single precision it is blind to what is softer than the body by seven digits: a body that hardly anything holds.
    Where residuals fall too slowly twice in turn, the rest of the cycles is computed in double precision.
    """

    #: Part of a residual that a cycle in single precision may leave, and how often more before it is given up. Bodies
    #: from Gmsh leave 0.3 to 0.55 without contact; half and twice cost the same cycles to 4 % on small bodies.
    slow, patience = 0.8, 2

    def __init__(self, truncated: Truncated, k: int) -> None:
        self._truncated, self._k = truncated, k
        self._before, self._slow = np.inf, 0
        #: Whether it may change from one call to the next.
        self.flexible = truncated.single

    def __call__(self, right: Array) -> Array:
        if not self.flexible:
            return self._truncated.cycle(self._k, right)
        if self._slow < self.patience:
            size = float(np.linalg.norm(right))
            self._slow = self._slow + 1 if size > self.slow * self._before else 0
            self._before = size
        if self._slow < self.patience:
            correction = self._truncated.fast_cycle(self._k, right)
            if 0.0 < float(right @ correction) < np.inf or not right.any():  # which nan is not
                return correction
            self._slow = self.patience
        return self._truncated.cycle(self._k, right)


def _placed(matrix: sp.csr_array, position: IntArray, count: int) -> sp.csr_array:
    """A small matrix with its rows and columns moved to other numbers."""
    entries = matrix.tocoo()
    return sp.csr_array((entries.data, (position[entries.row], position[entries.col])), shape=(count, count))


def _upper_root(matrix: Array) -> Array | None:
    """Upper triangular ``R`` with ``R R'`` the inverse; None where the matrix is not safely positive definite."""
    diagonal = np.abs(np.diagonal(matrix))
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = matrix * scale  # in one piece of memory: new memory takes as long as the numbers
    scaled *= scale[:, None]
    if not diagonal.size:
        return scaled
    upper, failed = la.lapack.dpotrf(scaled.T, lower=0, overwrite_a=1)
    if failed or not np.diagonal(upper).min() > np.sqrt(NULL):
        return None
    inverse, _ = la.lapack.dtrtri(upper, lower=0, overwrite_c=1)
    inverse *= scale[:, None]
    return np.asarray(inverse)


def _inverse_root(matrix: Array) -> Array:
    """Some ``R`` with ``R R'`` its inverse, or that of its absolute value where it is not positive definite."""
    upper = _upper_root(matrix)
    if upper is not None:
        return upper
    diagonal = np.abs(np.diagonal(matrix))
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = scale[:, None] * (0.5 * (matrix + matrix.T)) * scale
    values, vectors = la.eigh(scaled, check_finite=False)
    size = np.maximum(np.abs(values), NULL * np.abs(values).max(initial=1.0))
    return np.asarray((scale[:, None] * vectors) / np.sqrt(size))
