"""Fixed-point iteration for friction bounds that depend on the solution: freeze the bound, solve, move on."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from hemivar.basics.arguments import check_numbers, expect
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws.vector_law import spread
from hemivar.solvers.base import Solver, State
from hemivar.solvers.controls import Budget, Controls
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton import NonsmoothNewton
from hemivar.solvers.status import STOPPED, Status
from hemivar.solvers.truncated_newton import TruncatedNewton
from hemivar.systems.contact_system import PointSystem
from hemivar.systems.workspace import Workspace

__all__ = ["FixedPoint", "Outer"]

_FATAL = (Status.NONFINITE, Status.UNBOUNDED, Status.NOT_CARRIED)
#: Relative residual of an ordinary problem that has no solution; two of them in a row end the iteration.
_OFF = 1e-3
#: Multiples of the multiplier by which a bound is evaluated, one after the other, until friction holds the body: where
#: it begins pressure may be elsewhere, or less, than in the end.
_HOLDS = (1.0, 8.0, 64.0)


@dataclass(frozen=True)
class FixedPoint(Solver):
    """Outer fixed point ``w -> argmin_v E(v; J(w, .))`` for two-argument functionals J(w, v) (survey, section 2).

    Each step evaluates the bounds of the law at w (penetration, pressure), solves the ordinary problem that is left,
    and moves w to its solution.  The ratio of successive changes in the energy norm is the measured contraction factor;
    the iteration is given up as NOT_CONTRACTING where it stays at 1 or above.

    Parameters
    ----------
    inner : Solver
        Method for the ordinary problems.
    relaxation : float
        Part of the way from w to the solution that w moves, in (0, 1]; smaller values help where the bound reacts
        strongly.
    max_outer : int
        Limit of steps.
    inner_rtol : float
        Relative tolerance of the ordinary problems.
    """

    inner: Solver = field(default_factory=NonsmoothNewton)
    relaxation: float = 1.0
    max_outer: int = 50
    inner_rtol: float = 1e-11

    def __post_init__(self) -> None:
        expect(self.inner, Solver, "FixedPoint.inner", "pass a method such as NonsmoothNewton()")
        check_numbers(self)
        if not 0.0 < self.relaxation <= 1.0:
            raise ProblemError(f"FixedPoint.relaxation is {self.relaxation}; it must be in (0, 1]")
        if self.max_outer < 1:
            raise ProblemError(f"FixedPoint.max_outer is {self.max_outer}; it must be at least 1")
        if isinstance(self.inner, FixedPoint):
            raise ProblemError("FixedPoint inside FixedPoint has no effect; give the method itself as inner")

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name in tables."""
        return f"fixed-point({self.inner.name})"

    @property
    def default_steps(self) -> int:  # type: ignore[override]
        """Limit of steps."""
        return self.max_outer

    @property
    def patience(self) -> int:  # type: ignore[override]
        """Left to the measured contraction."""
        return self.max_outer

    @property
    def handles_state(self) -> bool:
        return True

    @property
    def displaces(self) -> bool:  # type: ignore[override]
        """As the method inside."""
        return self.inner.displaces

    @property
    def handles_nonlinear(self) -> bool:
        return self.inner.handles_nonlinear

    def refuse(self, problem: DiscreteProblem) -> str | None:
        if not problem.law.state_dependent or isinstance(self.inner, TruncatedNewton):  # which asks for no law
            return self.inner.refuse(problem)
        start = problem.local(np.zeros(problem.unknowns))
        return self.inner.refuse(problem.with_(law=problem.law.frozen(start, np.zeros(start.shape))))

    def begin(self, system: PointSystem, start: State, budget: Budget) -> State:
        return replace(start, memory=Outer(start.r, start.lam))

    @property
    def condenses(self) -> bool:
        return self.inner.condenses

    def for_tolerance(self, rtol: float) -> Solver:
        return replace(self, inner=self.inner.for_tolerance(self.inner_rtol))

    def local_descent(self) -> Solver:
        return replace(self, inner=self.inner.local_descent())

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> object:
        return self.inner.prepare(problem, workspace)

    def step(self, system: PointSystem, state: State, budget: Budget) -> State:
        memory: Outer = state.memory
        rounding, part, evaluations = 64.0 * np.finfo(float).eps, 1.0, state.evaluations
        for part in _HOLDS if system.law.state_dependent else (1.0,):
            ordinary, inner, status = self._ordinary(system, state, part, budget)
            evaluations += inner.evaluations
            if status is not Status.UNBOUNDED:
                break
        if status in (*_FATAL, *STOPPED):
            return State(inner.r, inner.lam, evaluations, status, memory=memory, contraction=state.contraction)
        multiplier = np.where(
            system.active, ordinary.law.nearest_multiplier(system.local(inner.r), inner.lam), inner.lam
        )
        change = _size(system, inner.r - memory.r, multiplier - memory.lam)
        size = _size(system, inner.r, multiplier)
        settled = change <= rounding * size
        ratios = memory.ratios
        if np.isfinite(memory.change) and part == 1.0 and memory.change > 1e3 * rounding * size:
            ratios = (*ratios, change / memory.change)[-6:]
        contraction = float(np.exp(np.mean(np.log(np.maximum(ratios[-4:], 1e-300))))) if ratios else state.contraction
        off = status is not Status.CONVERGED and not ordinary.residual(inner.r, inner.lam).relative <= _OFF
        unsolved = memory.unsolved + 1 if off else 0
        ended = Status.STALLED if unsolved >= 2 else None
        if settled and part != 1.0:
            ended = Status.UNBOUNDED
        elif settled and status is not Status.CONVERGED:
            ended = status
        elif len(ratios) >= 6 and contraction is not None and contraction >= 0.999 and not settled:
            ended = Status.NOT_CONTRACTING
        theta = self.relaxation
        new = Outer(
            memory.r + theta * (inner.r - memory.r),
            memory.lam + theta * (multiplier - memory.lam),
            change,
            ratios,
            inner.memory,
            unsolved,
        )
        return State(inner.r, multiplier, evaluations, ended, memory=new, contraction=contraction)

    def _ordinary(
        self, system: PointSystem, state: State, part: float, budget: Budget
    ) -> tuple[PointSystem, State, Status]:
        """The problem whose bounds are frozen at a part of the multiplier, where its solution was looked for, and how
        that ended."""
        memory: Outer = state.memory
        # The tolerance refers to the load of this problem, so that it keeps its meaning for a load of zero.
        controls = Controls(rtol=self.inner_rtol, max_time=max(budget.limit - budget.spent, 0.0))
        law = system.law.frozen(system.local(memory.r), part * memory.lam) if system.law.state_dependent else system.law
        ordinary = system.with_law(law)
        r = ordinary.start(state.r)
        start = State(r, ordinary.multiplier(r), memory=memory.inner)
        return ordinary, *iterate(self.inner, ordinary, start, controls, budget)[:2]

    def release(self, state: State) -> None:
        if isinstance(state.memory, Outer):
            self.inner.release(replace(state, memory=state.memory.inner))


@dataclass(frozen=True, eq=False)
class Outer:
    """What the iteration keeps between its steps."""

    r: Array  # the point at which the bounds are evaluated next
    lam: Array  # (m, d): the multiplier there
    change: float = np.inf  # the size of the last change of them
    ratios: tuple[float, ...] = ()  # of the last changes, each to the one before
    inner: Any = None  # what the inner method remembers; one that can makes use of it
    unsolved: int = 0  # how many of the last ordinary problems in a row were not solved


def _size(system: PointSystem, r: Array, lam: Array) -> float:
    """Energy norm of a change of displacement, with that of the multiplier in the norm that goes with it."""
    compliance = spread(system.compliance, lam.shape[1])
    own = float((system.weights[:, None] * compliance * np.where(system.active, lam, 0.0) ** 2).sum())
    return float(np.hypot(system.stretch(r), np.sqrt(system.vectors.total(own)[0])))
