"""The serial certificate over ranks: the energy norm by the cycles of PETSc, and proofs of its eigenvalues by MUMPS."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.deadline import OutOfTime
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.certificates import Certificate, EnergyNorm
from hemivar.certificates.bound import Point
from hemivar.certificates.by_multigrid import Mode, SolveByCycles
from hemivar.certificates.certificate import ESTIMATE, certified
from hemivar.ranks.body_on_ranks import BodyOnRanks, BulkOnRanks
from hemivar.ranks.preconditioner import Multigrid
from hemivar.ranks.time_limit import TimeLimit
from hemivar.solvers import Solution

__all__ = ["CyclesOnRanks", "certify_on_ranks"]

#: Unknowns up to which a factorisation is made to show an eigenvalue at the upper end, in two dimensions and in three;
#: and to show the smallest one, which is of less use.
_FACTORISED = ((200_000, 30_000), (30_000, 6_000))
#: How much larger than what was found an eigenvalue is tried to be shown smaller than, and the accuracy of that.
_TRIALS, _ACCURATE, _STEPS = (5e-5, 1e-3), 5e-5, 60
#: K counts as singular if the smallest eigenvalue of it, scaled to a unit diagonal, is below this.
_SINGULAR = 1e-12


def certify_on_ranks(solution: Solution, tolerance: float = 1e-8, alarm: TimeLimit | None = None) -> Certificate | None:
    """The certificate of :func:`hemivar.certify`, as far as it is known; what is not is named in ``left_out``.

    The largest eigenvalue c of ``(B'W diag(alpha) B, K)`` is found by locally optimal conjugate gradients.  A
    factorisation by MUMPS, all pivots of ``c K - B'W diag(alpha) B`` being positive, shows that it is no larger; where
    that is too much work, or MUMPS is missing, uniqueness and a bound are not claimed.  ``method`` says which it was.
    There is none of numbers that are not finite.
    """
    own = np.isfinite(solution.unknowns).all() and np.isfinite(solution.multiplier).all()
    if solution.problem.vectors.largest(float(not own))[0]:
        return None
    with np.errstate(all="ignore"):
        began, alarm = time.perf_counter(), TimeLimit() if alarm is None else alarm
        bulk = solution.problem.bulk
        assert isinstance(bulk, BulkOnRanks)
        by = CyclesOnRanks((bulk.lower or bulk).body, alarm)
        point = Point(solution.problem, EnergyNorm(by), solution.unknowns, solution.multiplier)
        certificate = certified(point, tolerance, None, alarm)
        by.release()
        return replace(certificate, seconds=time.perf_counter() - began)


@dataclass(frozen=True, eq=False)
class _Stiffness:
    """K of a body, to be multiplied with one vector (n,) or several (n, k)."""

    body: BodyOnRanks

    def __matmul__(self, x: Array) -> Array:
        if x.ndim == 1:
            return self.body.multiply(x)
        return np.stack([self.body.multiply(column) for column in x.T], axis=1)


class CyclesOnRanks(SolveByCycles):
    """The stiffness of a linear body over ranks and a cycle for it; ``alarm`` ends a search between two cycles."""

    def __init__(self, body: BodyOnRanks, alarm: TimeLimit, examined: bool = True) -> None:
        self.body, self.alarm, self.examined = body, alarm, examined
        self._multigrid: Multigrid | None = None
        super().__init__(_Stiffness(body), body.elastic.matrix_diagonal, self._cycled, body.ranks)

    def _cycled(self, right: Array) -> Array:
        if self.late:
            raise OutOfTime
        if self._multigrid is None:
            self._multigrid = Multigrid(self.body)
            self._multigrid.change(right, np.zeros(self.body.unknown.size, dtype=bool), self._no_law)
        return self._multigrid.cycle(right)

    @property
    def _no_law(self) -> Array:
        return np.zeros((*self.body.active.shape, self.body.dim))

    @property
    def late(self) -> bool:
        """Whether the work is to end, as all ranks see it."""
        return bool(self.body.ranks.largest(self.alarm.due())[0])

    @property
    def definite(self) -> bool:
        """Whether the supports alone stop every rigid motion; where it is examined, K is not singular either."""
        return self.body.supported and (not self.examined or self.lowest > _SINGULAR)

    @cached_property
    def lowest(self) -> float:
        """The smallest eigenvalue of K scaled to a unit diagonal, by half; on small problems it is shown."""
        eigenvalue = super().lowest
        if not eigenvalue > _SINGULAR:
            return 0.0
        shown = self._shown(1, 1.0, np.zeros(self.body.unknown.size), eigenvalue)
        self.method = "factorisation" if shown else "multigrid"
        return 0.0 if shown is False else eigenvalue

    def top(self, part: sp.csr_array, near: float | None = None) -> Mode:
        """The largest eigenvalue of ``(S'S, K)``, ``S`` (k, n), shown to be no larger where a factorisation can."""
        subspace = self._started(part)
        added = subspace.improve(self.quality, _STEPS, _ACCURATE)
        largest = float(subspace.values[0])
        softening: Array = np.bincount(part.indices, part.data**2, self.diagonal.size).astype(float)
        for trial in (*(largest * (1.0 + more) for more in _TRIALS), 0.5 * (largest + 1.0)):
            shown = None if largest >= 1.0 else trial < 1.0 and self._shown(0, trial, softening[self.body.unknown])
            if shown:
                return Mode(largest, trial * (1.0 + 1e-6), subspace.X[:, 0])
            if shown is None:
                break
        self.proves, self.method = False, ESTIMATE
        return Mode(largest, largest + added if largest >= 1.0 or shown is None else np.inf, subspace.X[:, 0])

    def _start(self) -> Array:
        return np.where(self.body.nodes.fixed, 0.0, super()._start())

    def _shown(self, which: int, factor: float, less: Array, scaled: float = 0.0) -> bool | None:
        """:func:`_definite` of a problem that is small enough for it, while there is time; None otherwise."""
        large = self.body.unknowns > _FACTORISED[which][self.body.dim == 3]
        return None if large or self.late else _definite(self.body, factor, less, scaled)

    def release(self) -> None:
        """Give its memory back."""
        if self._multigrid is not None:
            self._multigrid.release()


def _definite(body: BodyOnRanks, factor: float, less: Array, scaled: float = 0.0) -> bool | None:
    """Whether ``factor K - diag(less)``, ``less`` at the contact unknowns, is positive definite; None if not known.

    With ``scaled`` that multiple of the diagonal of K is taken off as well.
    """
    from petsc4py import PETSc

    matrix = body.K.duplicate(copy=True)
    off = body.K.getDiagonal()
    off.scale(-scaled)
    off.array_w[body.unknown] -= less
    matrix.scale(factor)
    pc = PETSc.PC().create(body.ranks.comm)
    try:
        matrix.setDiagonal(off, addv=PETSc.InsertMode.ADD_VALUES)
        matrix.setOption(PETSc.Mat.Option.SPD, False)
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        pc.setOperators(matrix)
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setMumpsIcntl(13, 1)  # signs of all pivots
        pc.getFactorMatrix().setMumpsIcntl(24, 1)  # and of those that are zero
        pc.setUp()
        _, _, positive = pc.getFactorMatrix().getInertia()
        return bool(positive == body.K.getSize()[0])
    except PETSc.Error:  # no MUMPS, or no memory for it
        return None
    finally:
        pc.destroy()
        matrix.destroy()
