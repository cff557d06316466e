"""Load stepping: the load grows from zero, each solution being the start of the next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import expect, whole_number
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.load_line import LoadLine
from hemivar.solvers.base import PosedSystem, Solver, State
from hemivar.solvers.controls import Budget, Controls
from hemivar.solvers.loop import iterate
from hemivar.solvers.newton import NonsmoothNewton, Search
from hemivar.solvers.status import STOPPED
from hemivar.systems.workspace import Workspace

__all__ = ["LoadStepping"]


def _downhill() -> Solver:
    return NonsmoothNewton(search=Search.DOWNHILL)


@dataclass(frozen=True)
class LoadStepping(Solver):
    """Solves for load factors from 0 to 1, each from the last, and so follows the branch that starts at zero load.

    With the default inner method, which only walks downhill, the body stays on the supported branch until that
    branch ends; with ``NonsmoothNewton()`` as inner method it leaves it as soon as a point on its own has less
    energy elsewhere.  The load is scaled; gaps and prescribed displacements are not.

    Parameters
    ----------
    inner : Solver
        Method at each load.
    steps : int
        Number of loads.
    rtol : float
        Tolerance of the intermediate solutions, relative to the full load.
    """

    inner: Solver = field(default_factory=_downhill)
    steps: int = 10
    rtol: float = 1e-9

    def __post_init__(self) -> None:
        expect(self.inner, Solver, "LoadStepping.inner", "pass a method such as NonsmoothNewton()")
        whole_number(self.steps, "LoadStepping.steps", 1)

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
        line = LoadLine(system.problem)
        full = float(np.linalg.norm(system.problem.load))
        r, evaluations = start.r, start.evaluations
        for factor in np.linspace(0.0, 1.0, self.steps + 1)[:-1]:
            partial = system.for_problem(line.at(float(factor)))
            r = partial.start(r)
            controls = Controls(rtol=0.0, atol=self.rtol * full, max_time=budget.left)
            found, status, _ = iterate(self.inner, partial, State(r, partial.multiplier(r)), controls, budget)
            self.inner.release(found)
            r, evaluations = found.r, evaluations + found.evaluations
            if status in STOPPED:  # what was reached under part of the load is the best there is
                r = system.start(r)
                return State(r, system.multiplier(r), evaluations, status)
        r = system.start(r)
        return self.inner.begin(system, replace(start, r=r, lam=system.multiplier(r), evaluations=evaluations), budget)

    def step(self, system: PosedSystem, state: State, budget: Budget) -> State:
        return self.inner.step(system, state, budget)

    def settle(self, system: PosedSystem, state: State, budget: Budget) -> State | None:
        return None if state.ended is not None else self.inner.settle(system, state, budget)

    def release(self, state: State) -> None:
        self.inner.release(state)
