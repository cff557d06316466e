"""Load stepping (incremental loading): the load grows from zero, each solution being the start of the next."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import expect, number, whole_number
from hemivar.basics.generators import result_of
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.load_line import LoadLine
from hemivar.solvers.base import Solver, SolverSystem, State
from hemivar.solvers.controls import Budget, Controls
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton import NonsmoothNewton, Search
from hemivar.solvers.status import STOPPED, Status
from hemivar.systems.workspace import Workspace

__all__ = ["Climb", "LoadStepping", "Reached", "SystemClimb"]

#: The shortest step of the load factor, and the residual of an equilibrium that rounding hides.
_SHORTEST, _NEAR = 1e-5, 1e-8


def _local_descent() -> Solver:
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

    inner: Solver = field(default_factory=_local_descent)
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

    def local_descent(self) -> Solver:
        return replace(self, inner=self.inner.local_descent())

    def prepare(self, problem: DiscreteProblem, workspace: Workspace) -> object:
        return self.inner.prepare(problem, workspace)

    def refuse(self, problem: DiscreteProblem) -> str | None:
        return self.inner.refuse(problem)

    def begin(self, system: SolverSystem, start: State, budget: Budget) -> State:
        climbed = result_of(SystemClimb(self, LoadLine.to(system.problem), budget, system=system).up(start))
        r = system.start(climbed.at.r)
        here = State(r, system.multiplier(r), climbed.at.evaluations)
        if climbed.status in STOPPED:
            return replace(here, ended=climbed.status)
        if climbed.low == 1.0:
            return self.inner.begin(system, here, budget)
        if climbed.status is Status.UNBOUNDED or system.problem.limit is not None:
            return replace(here, ended=Status.NOT_CARRIED, carried=(climbed.low, climbed.failed))
        return replace(here, ended=climbed.status)

    def _next(self, low: float, failed: float, length: float) -> float:
        """The next load factor: halfway to one that failed, and that one itself from close by."""
        if failed == np.inf:
            return low + length if low + length < 1.0 - 1e-9 else 1.0
        return failed if self._close(low, failed) else 0.5 * (low + failed)

    def _close(self, low: float, high: float) -> bool:
        return high - low <= max(self.width * high, _SHORTEST)

    def step(self, system: SolverSystem, state: State, budget: Budget) -> State:
        return self.inner.step(system, state, budget)

    def settle(self, system: SolverSystem, state: State, budget: Budget) -> State | None:
        return None if state.ended is not None else self.inner.settle(system, state, budget)

    def release(self, state: State) -> None:
        self.inner.release(state)


@dataclass(frozen=True, eq=False)
class Reached:
    """How far the load has grown.

    Attributes
    ----------
    at : State
        The equilibrium of the largest load that has one; where the body began if there is none.
    low : float
        Its load factor.
    failed : float
        The next one at which none was found, infinite where there is none.
    length : float
        Of the next step.
    status : Status
        How the last search ended.
    tried : int
        Load factors so far.
    top : float
        What is called a load factor of 1 here.
    """

    at: State
    low: float
    failed: float
    length: float
    status: Status
    tried: int = 0
    top: float = 1.0

    @property
    def carried(self) -> float:
        """The largest load factor with an equilibrium."""
        return self.top * self.low

    @property
    def not_carried(self) -> float | None:
        """The next one at which none was found; None where there is none."""
        return self.top * self.failed if self.failed < np.inf else None


@dataclass(frozen=True, eq=False)
class Climb(ABC):
    """Equilibria of a body while its load grows."""

    method: LoadStepping
    line: LoadLine  # the load, from nothing to the full one
    budget: Budget
    top: float = 1.0  # the load factor of the full load, by which is reported

    @abstractmethod
    def _to(self, factor: float, start: State) -> tuple[State, Status]:
        """The equilibrium at a load factor, from that at another one; and how the search for it ended."""

    def up(self, start: State) -> Generator[Reached, bool | None, Reached]:
        """Raise the load; yields what is reached after every load factor, and stops after it if it is sent True."""
        at, status = self._to(0.0, start)
        # Without its load a body that contact alone holds may have no equilibrium, and needs none.
        at = at if status is Status.CONVERGED or status in STOPPED else start
        reached, bracketed = Reached(at, 0.0, np.inf, 1.0 / self.method.steps, status, top=self.top), False
        while reached.low < 1.0 and not bracketed and reached.status not in STOPPED:
            try:
                reached, bracketed = self._after(reached)
                if (yield reached):
                    raise KeyboardInterrupt
            except KeyboardInterrupt:
                return replace(reached, status=Status.INTERRUPTED)
        return reached

    def _after(self, reached: Reached) -> tuple[Reached, bool]:
        """What is reached with the next load factor, and whether one that is not carried is close to one that is."""
        low, failed = reached.low, reached.failed
        factor = self.method._next(low, failed, reached.length)
        end, status = self._to(factor, reached.at)
        onward = replace(reached, status=status, tried=reached.tried + 1)
        if status is Status.CONVERGED:
            length = min(1.0 / self.method.steps, 2.0 * (factor - low))
            return replace(
                onward, at=end, low=factor, failed=failed if factor < failed else np.inf, length=length
            ), False
        at = replace(reached.at, evaluations=end.evaluations)
        if status in STOPPED:
            return replace(onward, at=at), False
        return replace(onward, at=at, failed=factor), self.method._close(low, factor)


@dataclass(frozen=True, eq=False)
class SystemClimb(Climb):
    """Those of a body whose stiffness stays."""

    system: SolverSystem = field(kw_only=True)  # that of the full load

    def _to(self, factor: float, start: State) -> tuple[State, Status]:
        inner, system, budget = self.method.inner, self.system.for_problem(self.line.at(factor)), self.budget
        full = float(np.linalg.norm(self.system.problem.load))
        r = system.start(start.r)
        most = 4 * inner.default_steps  # below the largest load steps win little
        controls = Controls(rtol=0.0, atol=self.method.rtol * full, max_time=budget.left, max_steps=most)
        end, status, _ = iterate(inner, system, State(r, system.multiplier(r)), controls, budget)
        inner.release(end)
        if status not in STOPPED and system.residual(end.r, end.lam).total <= _NEAR * full:
            status = Status.CONVERGED
        return State(end.r, end.lam, start.evaluations + end.evaluations), status
