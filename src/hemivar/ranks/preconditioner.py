"""The preconditioner: PETSc's geometric multigrid on the refined meshes, algebraic below the coarsest of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.ranks.stiffness import applied
from hemivar.systems.contact_moves import moving_curvature
from hemivar.systems.newton_equation import smooth_components

if TYPE_CHECKING:
    from petsc4py import PETSc

    from hemivar.ranks.body_on_ranks import BodyOnRanks

__all__ = ["Multigrid", "MultigridForMany", "ReusedCycle"]

_SHIFT = 1e-6  # what is added to the diagonal of a body that supports do not hold
_DIRECT = 6000  # unknowns of a coarsest level that every rank may factorise
_OTHER = 0.3  # change of a second derivative, in terms of the stiffness there, after which the cycle is set up anew

#: PETSc options set unless the user sets them: one sweep of Gauss-Seidel before and one back after the coarser levels,
#: so that the cycle is symmetric. GAMG keeps its own smoothers: its coarse matrices may have zero rows.
_DEFAULTS = {
    f"hemivar_mg_{when}_{name}": value
    for when, direction in (("levels", "forward"), ("up", "backward"))
    for name, value in (
        ("ksp_type", "richardson"),
        ("ksp_max_it", "1"),
        ("pc_type", "sor"),
        (f"pc_sor_local_{direction}", "1"),
    )
}


class Multigrid:
    """Newton's matrix, and one cycle for it, with the unknowns at kinks taken out on every level.

    Prolongations are those of linear elements, coarse matrices are ``P'AP``.  Where there is one mesh only, it is
    PETSc's algebraic multigrid GAMG. Options of PETSc (in the environment variable PETSC_OPTIONS) with the prefixes
    ``hemivar_`` and, for one mesh, ``hemivar_amg_`` change them, such as ``-hemivar_amg_pc_type hypre``; those of the
    smoothers before and after the coarser levels begin with ``-hemivar_mg_levels_`` and ``-hemivar_mg_up_``.

    The cycle is set up again only where other unknowns are held, or the laws have become much stiffer or softer; with
    second derivatives that are negative left out.
    """

    def __init__(self, body: BodyOnRanks, built_at: Array | None = None) -> None:
        from petsc4py import PETSc

        options = PETSc.Options()
        for name, value in _DEFAULTS.items():
            if not options.hasName(name):
                options.setValue(name, value)
        self.body = body
        self.built_at: Array | None = None
        self.diagonal = body.elastic.matrix_diagonal
        self._at_kink, self._curvature = np.zeros(0, dtype=bool), np.zeros(0)
        self._out = self._at_kink
        self._built: tuple[BoolArray, Array] = self._at_kink, self._curvature
        self._exact: tuple[BoolArray, Array] = self._at_kink, self._curvature
        self.builds = 0
        self._given, self._made = body.K.createVecs()
        self.levels = [body.nodes]
        while self.levels[0].coarser is not None:
            self.levels.insert(0, self.levels[0].coarser)
        self.matrices: list[PETSc.Mat] = []
        self.prolongations = [level.prolongation for level in self.levels[1:]]
        self.pc = PETSc.PC().create(body.ranks.comm)
        self.pc.setOptionsPrefix("hemivar_")
        if len(self.levels) == 1:
            self.pc.setOptionsPrefix("hemivar_amg_")
            self.pc.setType("gamg")
            self.pc.setFromOptions()
        else:
            self._set_levels()
        if built_at is not None:
            line = body.law.linearise(body.local(built_at))
            moving = smooth_components(line, body.active)
            self.change(built_at, ~moving[body.active], moving_curvature(body, line.hessian, moving))

    def _set_levels(self) -> None:
        self.masked = self.prolongations[-1].copy()
        self.pc.setType("mg")
        self.pc.setMGLevels(len(self.levels))
        for number, matrix in enumerate([*self.prolongations[:-1], self.masked], start=1):
            self.pc.setMGInterpolation(number, matrix)
            self.pc.getMGSmootherUp(number).setOptionsPrefix("hemivar_mg_up_")
        coarse = self.pc.getMGCoarseSolve()
        coarse.setType("preonly")
        coarse.getPC().setType("redundant" if self.levels[0].total <= _DIRECT else "gamg")

    # ---- Newton's matrix -----------------------------------------------------------------------------------

    def change(self, x: Array, at_kink: BoolArray, curvature: Array) -> None:
        """See :class:`hemivar.systems.body.Truncation`."""
        body = self.body
        self._at_kink, self._curvature = at_kink, curvature
        self._out = np.concatenate([body.unknown[at_kink], np.flatnonzero(body.nodes.fixed)])
        stiff = _positive(curvature)
        if self.built_at is None or self._stale(at_kink, stiff):
            self.build(at_kink, stiff)
            self.built_at = x

    def again(self, x: Array, at_kink: BoolArray, curvature: Array) -> bool:
        """Begin another solve as :meth:`change` would with a new cycle; False if that takes a new one."""
        at_kink_then, exactly = self._exact
        stiff = _positive(curvature)
        other = at_kink.shape != at_kink_then.shape or (at_kink != at_kink_then).any() or (stiff != exactly).any()
        differs = bool(self.body.ranks.largest(float(other))[0])
        if self._remembers and (differs or self.builds > 1):
            return False
        if differs:
            self.build(at_kink, stiff)
        self._at_kink, self._curvature, self.built_at = at_kink, curvature, x
        self._out = np.concatenate([self.body.unknown[at_kink], np.flatnonzero(self.body.nodes.fixed)])
        return True

    @property
    def _remembers(self) -> bool:
        """Whether algebraic multigrid takes part, which keeps its aggregates where it is set up again."""
        return len(self.levels) == 1 or self.levels[0].total > _DIRECT

    def __matmul__(self, vector: Array) -> Array:
        body = self.body
        out = body.multiply(vector)
        local = body.spread(vector[body.unknown])
        out[body.unknown] += body.gather(np.einsum("mij,mj->mi", self._curvature, local))
        out[self._out] = 0.0
        return out

    def cycle(self, right: Array) -> Array:
        out = applied(self.pc.apply, self._made, self._given, right)
        out[self._out] = 0.0
        return out

    # ---- the cycle -----------------------------------------------------------------------------------------

    def build(self, at_kink: BoolArray, curvature: Array) -> None:
        """Set up for unknowns ``at_kink (k,)`` and second derivatives ``curvature (m, d, d)`` of the laws."""
        first = not self.matrices
        top = self._top(at_kink, curvature)
        if len(self.levels) == 1:
            for matrix in self.matrices:
                matrix.destroy()
            self.matrices = [top]
            top.setNearNullSpace(self.body.near)
            self.pc.setOperators(top)
        else:
            self._coarsen(top, at_kink, first)
            self.pc.setOperators(top)
            for number, matrix in enumerate(self.matrices):
                for smoother in self._smoothers(number):
                    smoother.setOperators(matrix)
            if first:
                self.pc.setFromOptions()
        self.pc.setUp()
        self._built = at_kink.copy(), _diagonal(self.body, curvature)
        self._exact = at_kink.copy(), curvature.copy()
        self.builds += 1

    def _smoothers(self, number: int) -> list[PETSc.KSP]:
        """What works on a level before and after the coarser ones."""
        if not number:
            return [self.pc.getMGCoarseSolve()]
        return [self.pc.getMGSmootherDown(number), self.pc.getMGSmootherUp(number)]

    def _top(self, at_kink: BoolArray, curvature: Array) -> PETSc.Mat:
        """Newton's matrix on the finest level, with unit rows (times the mean diagonal) for what is taken out."""
        from petsc4py import PETSc

        body = self.body
        if self.matrices and len(self.levels) > 1:
            matrix = self.matrices[-1]
            body.K.copy(matrix, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        else:
            matrix = body.K.duplicate(copy=True)
            matrix.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
        start = matrix.getOwnershipRange()[0]
        ends, columns, entries = _contact_entries(body, curvature)
        rows = (start + body.unknown).astype(PETSc.IntType)
        matrix.setValuesIJV(
            ends.astype(PETSc.IntType), (start + columns).astype(PETSc.IntType), entries,
            addv=PETSc.InsertMode.ADD_VALUES, rowmap=rows,
        )  # fmt: skip
        matrix.assemble()
        matrix.zeroRowsColumns(rows[at_kink], diag=body.typical)
        if not body.supported:
            matrix.shift(_SHIFT * body.typical)
        return matrix

    def _coarsen(self, top: PETSc.Mat, at_kink: BoolArray, first: bool) -> None:
        """Coarse matrices ``P'AP``; the finest prolongation reaches no unknown that is taken out."""
        from petsc4py import PETSc

        body = self.body
        ones = np.ones(body.load.size)
        ones[body.unknown[at_kink]] = 0.0
        mask = body.vector(ones)
        whole = self.prolongations[-1]
        whole.copy(self.masked, structure=PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self.masked.diagonalScale(mask, None)
        chain = [*self.prolongations[:-1], self.masked]
        if first:
            self.matrices = [None] * len(chain) + [top]
        for number in range(len(chain) - 1, -1, -1):
            finer = self.matrices[number + 1]
            if first:
                self.matrices[number] = finer.ptap(chain[number], fill=1.0)
            else:
                finer.ptap(chain[number], result=self.matrices[number])
            _fill_diagonal(self.matrices[number])

    def _stale(self, at_kink: BoolArray, curvature: Array) -> bool:
        """Whether the cycle was set up for something else."""
        body, (at_kink_then, before) = self.body, self._built
        own, stiffness = _diagonal(body, curvature), body.stiffness[body.active]
        other = np.abs(own - before) > _OTHER * (stiffness + np.minimum(own, before))
        return bool(body.ranks.largest(float(((at_kink != at_kink_then) | (other & ~at_kink)).any()))[0])

    def preconditioner(self) -> tuple[bool, Callable[[Array], Array]]:
        return False, self.cycle

    def release(self) -> None:
        """Give its memory back."""
        self.pc.destroy()
        for matrix in self.matrices:
            matrix.destroy()
        if len(self.levels) > 1:
            self.masked.destroy()


class MultigridForMany:
    """The cycle of multigrid that the solves of a body leave to one another.

    What it is set up for is always what the current solve sets up at first, so that no solve depends on those before.
    """

    def __init__(self) -> None:
        self.kept: Multigrid | None = None

    def __call__(self, body: BodyOnRanks) -> ReusedCycle:
        """That for one solve."""
        return ReusedCycle(body, self)

    def at(self, body: BodyOnRanks, x: Array, at_kink: BoolArray, curvature: Array) -> Multigrid:
        """Newton's matrix at the first place of a solve, with a cycle set up for it."""
        if self.kept is not None and not self.kept.again(x, at_kink, curvature):
            self.kept.release()
            self.kept = None
        if self.kept is None:
            self.kept = Multigrid(body)
            self.kept.change(x, at_kink, curvature)
        return self.kept


class ReusedCycle:
    """Newton's matrix of one solve, by a cycle that outlives it."""

    def __init__(self, body: BodyOnRanks, cycles: MultigridForMany) -> None:
        self._body, self._cycles = body, cycles
        self._matrix: Multigrid | None = None

    @property
    def diagonal(self) -> Array:
        return self._body.elastic.matrix_diagonal

    def change(self, x: Array, at_kink: BoolArray, curvature: Array) -> None:
        if self._matrix is None:
            self._matrix = self._cycles.at(self._body, x, at_kink, curvature)
        else:
            self._matrix.change(x, at_kink, curvature)

    def __matmul__(self, vector: Array) -> Array:
        assert self._matrix is not None
        return self._matrix @ vector

    def cycle(self, right: Array) -> Array:
        assert self._matrix is not None
        return self._matrix.cycle(right)

    def preconditioner(self) -> tuple[bool, Callable[[Array], Array]]:
        return False, self.cycle

    def release(self) -> None:
        """The cycle stays."""


def _positive(curvature: Array) -> Array:
    """Second derivatives (m, d, d) without what is negative."""
    values, vectors = np.linalg.eigh(curvature)
    return np.asarray(np.einsum("mic,mc,mjc->mij", vectors, np.maximum(values, 0.0), vectors))


def _fill_diagonal(matrix: PETSc.Mat) -> None:
    """Give rows that nothing reaches (held by supports, or taken out) a diagonal, that of the stiffest."""
    diagonal = matrix.getDiagonal()
    largest = diagonal.max()[1]
    diagonal.array_w[:] = np.where(diagonal.array_r > 1e-10 * largest, diagonal.array_r, largest)
    matrix.setDiagonal(diagonal)


def _contact_entries(body: BodyOnRanks, curvature: Array) -> tuple[IntArray, IntArray, Array]:
    """Second derivatives ``(m, d, d)`` of the laws, weights included, between contact unknowns, row by row."""
    m, d = body.active.shape
    number = np.full((m, d), -1, dtype=np.int64)
    number[body.active] = body.unknown
    sign = np.zeros((m, d))
    sign[body.active] = body.sign
    there = body.active[:, :, None] & body.active[:, None, :]
    columns = np.broadcast_to(number[:, None, :], there.shape)[there]
    entries = (curvature * sign[:, :, None] * sign[:, None, :])[there]
    counts = there.sum(axis=2)[body.active]
    return np.concatenate([[0], np.cumsum(counts)]), columns, entries


def _diagonal(body: BodyOnRanks, curvature: Array) -> Array:
    return np.asarray(np.einsum("mii->mi", curvature)[body.active])
