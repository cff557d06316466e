"""The preconditioner: PETSc's multigrid on the refined meshes, algebraic below the coarsest of them."""

from __future__ import annotations

from typing import Any

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.engines.petsc.assembly import BodyOnRanks

__all__ = ["Multigrid"]

_SHIFT = 1e-6  # what is added to the diagonal of a body that supports do not hold
_DIRECT = 6000  # unknowns of a coarsest level that every rank may factorise

#: PETSc options set unless the user sets them. GAMG keeps its own smoothers: its coarse matrices may have zero rows.
_DEFAULTS = {
    "hemivar_mg_levels_ksp_type": "richardson",
    "hemivar_mg_levels_ksp_max_it": "1",
    "hemivar_mg_levels_pc_type": "sor",
}


class Multigrid:
    """One cycle for Newton's equation, with the unknowns at kinks taken out on every level.

    Prolongations are those of linear elements, coarse matrices are ``P'AP``.  Where there is one mesh only, it is
    PETSc's algebraic multigrid GAMG. Options of PETSc (in the environment variable PETSC_OPTIONS) with the prefixes
    ``hemivar_`` and, for one mesh, ``hemivar_amg_`` change them, such as ``-hemivar_mg_levels_pc_type jacobi`` or
    ``-hemivar_amg_pc_type hypre``.

    Attributes
    ----------
    body : BodyOnRanks
    setups, applications : int
        How often it was set up and used.
    """

    def __init__(self, body: BodyOnRanks) -> None:
        from petsc4py import PETSc

        options = PETSc.Options()
        for name, value in _DEFAULTS.items():
            if not options.hasName(name):
                options.setValue(name, value)
        self.body = body
        self.setups = 0
        self.applications = 0
        self.held = np.zeros(0, dtype=bool)
        self.curvature = np.zeros(0)
        self.levels = [body]
        while self.levels[0].coarser is not None:
            self.levels.insert(0, self.levels[0].coarser)
        self.matrices: list[Any] = []
        self.prolongations = [level.prolongation for level in self.levels[1:]]
        self.pc = PETSc.PC().create(body.ranks.comm)
        self.pc.setOptionsPrefix("hemivar_")
        if len(self.levels) == 1:
            self.pc.setOptionsPrefix("hemivar_amg_")
            self.pc.setType("gamg")
            self.pc.setFromOptions()
            return
        self.masked = self.prolongations[-1].copy()
        self.pc.setType("mg")
        self.pc.setMGLevels(len(self.levels))
        for number, matrix in enumerate([*self.prolongations[:-1], self.masked], start=1):
            self.pc.setMGInterpolation(number, matrix)
        coarse = self.pc.getMGCoarseSolve()
        coarse.setType("preonly")
        coarse.getPC().setType("redundant" if self.levels[0].f.getSize() <= _DIRECT else "gamg")

    def build(self, held: BoolArray, curvature: Array) -> None:
        """Set up for unknowns ``held (k,)`` at kinks and second derivatives ``curvature (m, d, d)`` of the laws."""
        first = not self.matrices
        top = self._top(held, curvature)
        if len(self.levels) == 1:
            for matrix in self.matrices:
                matrix.destroy()
            self.matrices = [top]
            top.setNearNullSpace(self.body.near)
            self.pc.setOperators(top)
        else:
            self._coarsen(top, held, first)
            self.pc.setOperators(top)
            for number, matrix in enumerate(self.matrices):
                smoother = self.pc.getMGSmoother(number) if number else self.pc.getMGCoarseSolve()
                smoother.setOperators(matrix)
            if first:
                self.pc.setFromOptions()
        self.pc.setUp()
        self.setups += 1
        self.held, self.curvature = held.copy(), _diagonal(self.body, curvature)

    def _top(self, held: BoolArray, curvature: Array) -> Any:
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
        matrix.zeroRowsColumns(rows[held], diag=body.typical)
        if not body.supported:
            matrix.shift(_SHIFT * body.typical)
        return matrix

    def _coarsen(self, top: Any, held: BoolArray, first: bool) -> None:
        """Coarse matrices ``P'AP``; the finest prolongation reaches no unknown that is taken out."""
        from petsc4py import PETSc

        body = self.body
        mask = body.f.duplicate()
        mask.set(1.0)
        mask.array_w[body.unknown[held]] = 0.0
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
            _fill_diagonal(self.matrices[number], self.levels[number].typical)

    def stale(self, held: BoolArray, curvature: Array) -> float:
        """Part of all contact unknowns for which it was set up otherwise."""
        body = self.body
        own = _diagonal(body, curvature)
        stiff = np.abs(own - self.curvature) > 0.3 * (body.contact_diagonal + np.minimum(own, self.curvature))
        changed, count = body.ranks.total(np.count_nonzero((held != self.held) | (stiff & ~held)), held.size)
        return float(changed / count) if count else 0.0

    def apply(self, residual: Any, out: Any) -> None:
        """One cycle."""
        self.applications += 1
        self.pc.apply(residual, out)

    def destroy(self) -> None:
        """Give its memory back."""
        self.pc.destroy()
        for matrix in self.matrices:
            matrix.destroy()
        if len(self.levels) > 1:
            self.masked.destroy()


def _fill_diagonal(matrix: Any, typical: float) -> None:
    """Give rows that nothing reaches (held by supports, or taken out) a diagonal."""
    diagonal = matrix.getDiagonal()
    diagonal.array_w[:] = np.where(diagonal.array_r > 1e-10 * typical, diagonal.array_r, typical)
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
