"""Load stepping: the load grows from zero, each solution being the start of the next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import expect, number, whole_number
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.load_line import LoadLine
from hemivar.solvers.base import PosedSystem, Solver, State
from hemivar.solvers.controls import Budget, Controls
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton import NonsmoothNewton, Search
from hemivar.solvers.status import STOPPED, Status
from hemivar.systems.workspace import Workspace

__all__ = ["LoadStepping"]

#: Part of the load that is rounding, the shortest step, and the residual of an equilibrium that rounding hides.
_ROUNDED, _SHORTEST, _NEAR = 1e-9, 1e-5, 1e-8


def _downhill() -> Solver:
    return NonsmoothNewton(search=Search.DOWNHILL)


@dataclass(frozen=True)
class LoadStepping(Solver):
    """Solves for load factors from 0 to 1, each from the last, and so follows the branch that starts at zero load.

    With the default inner method, which only walks downhill, the body stays on the supported branch until that
    branch ends; with ``NonsmoothNewton()`` as inner method it leaves it as soon as a point on its own has less
    energy elsewhere.  The load is scaled, and the displacements that supports prescribe; gaps are not.

    A load without an equilibrium is approached in steps that are halved.  A body that its foundation holds up to a
    limit ends NOT_CARRIED, with the equilibrium of the largest load that has one, and ``Solution.carried``.

    Parameters
    ----------
    inner : Solver
        Method at each load.
    steps : int
        Number of loads, as long as each has an equilibrium.
    rtol : float
        Tolerance of the intermediate solutions, relative to the full load.
    width : float
        How closely the largest load that is carried is bracketed, relative to itself.
    """

    inner: Solver = field(default_factory=_downhill)
    steps: int = 10
    rtol: float = 1e-9
    width: float = 0.01

    def __post_init__(self) -> None:
        expect(self.inner, Solver, "LoadStepping.inner", "pass a method such as NonsmoothNewton()")
        whole_number(self.steps, "LoadStepping.steps", 1)
        if not 0.0 < number(self.width, "LoadStepping.width") < 1.0:
            raise ProblemError(f"LoadStepping.width is {self.width}; it must be between 0 and 1")

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name in tables."""
        return f"load-stepping({self.inner.name})"

    @property
    def default_steps(self) -> int:  # type: ignore[override]
        """Limit of steps at the full load."""
        return self.inner.default_steps

    @property
    def patience(self) -> int:  # type: ignore[override]
        """That of the inner method."""
        return self.inner.patience

    @property
    def descends(self) -> bool:  # type: ignore[override]
        """That of the inner method."""
        return self.inner.descends

    @property
    def handles_state(self) -> bool:
        return self.inner.handles_state

    @property
    def handles_nonlinear(self) -> bool:
        return self.inner.handles_nonlinear

    @property
    def condenses(self) -> bool:
        return self.inner.condenses

    def for_tolerance(self, rtol: float) -> Solver:
        return replace(self, inner=self.inner.for_tolerance(min(rtol, self.rtol)))

    def downhill(self) -> Solver:
        return replace(self, inner=self.inner.downhill())

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> object:
        return self.inner.prepare(problem, workspace)

    def refuse(self, problem: DiscreteProblem) -> str | None:
        return self.inner.refuse(problem)

    def begin(self, system: PosedSystem, start: State, budget: Budget) -> State:
        climb = _Climb(self, system, LoadLine.to(system.problem), budget)
        at, status = climb.to(0.0, start)
        # Without its load a body that contact alone holds may have no equilibrium, and needs none.
        at = at if status is Status.CONVERGED or status in STOPPED else start
        low, failed, length = 0.0, np.inf, 1.0 / self.steps
        while low < 1.0 and status not in STOPPED:
            factor = self._next(low, failed, length)
            found, status = climb.to(factor, at)
            if status is Status.CONVERGED or status in STOPPED:
                length = min(1.0 / self.steps, 2.0 * (factor - low))
                low, at, failed = factor, found, failed if factor < failed else np.inf
            elif self._close(low, factor):
                return climb.left(at, low, factor, status)
            else:
                failed, at = factor, replace(at, evaluations=found.evaluations)
        r = system.start(at.r)
        here = State(r, system.multiplier(r), at.evaluations, status if status in STOPPED else None)
        return here if here.ended is not None else self.inner.begin(system, here, budget)

    def _next(self, low: float, failed: float, length: float) -> float:
        """The next load factor: halfway to one that failed, and that one itself from close by."""
        if failed == np.inf:
            return low + length if low + length < 1.0 - _ROUNDED else 1.0
        return failed if self._close(low, failed) else 0.5 * (low + failed)

    def _close(self, low: float, high: float) -> bool:
        return high - low <= max(self.width * high, _SHORTEST)

    def step(self, system: PosedSystem, state: State, budget: Budget) -> State:
        return self.inner.step(system, state, budget)

    def settle(self, system: PosedSystem, state: State, budget: Budget) -> State | None:
        return None if state.ended is not None else self.inner.settle(system, state, budget)

    def release(self, state: State) -> None:
        self.inner.release(state)


@dataclass(frozen=True, eq=False)
class _Climb:
    """Equilibria of a body while its load grows."""

    method: LoadStepping
    system: PosedSystem
    line: LoadLine
    budget: Budget

    def to(self, factor: float, start: State) -> tuple[State, Status]:
        """The equilibrium at a load factor, from that at another one; and how the search for it ended."""
        inner, system, budget = self.method.inner, self.system.for_problem(self.line.at(factor)), self.budget
        full = float(np.linalg.norm(self.system.problem.load))
        r = system.start(start.r)
        controls = Controls(rtol=0.0, atol=self.method.rtol * full, max_time=budget.left)
        found, status, _ = iterate(inner, system, State(r, system.multiplier(r)), controls, budget)
        inner.release(found)
        if status not in STOPPED and system.residual(found.r, found.lam).total <= _NEAR * full:
            status = Status.CONVERGED
        return State(found.r, found.lam, start.evaluations + found.evaluations), status

    def left(self, at: State, low: float, high: float, status: Status) -> State:
        """The last equilibrium, where the next load has none."""
        r, limited = self.system.start(at.r), status is Status.UNBOUNDED or self.system.problem.limit is not None
        ended = State(r, self.system.multiplier(r), at.evaluations, Status.NOT_CARRIED if limited else status)
        return replace(ended, carried=(low, high)) if limited else ended
