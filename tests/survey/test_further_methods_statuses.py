"""Every way a solve can end has a name, a remedy, and an iterate that is worth having."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.errors import MethodError, ProblemError
from hemivar.laws import PiecewiseQuadratic
from hemivar.solvers import METHODS, Controls, Status, solve
from hemivar.solvers.base import State
from hemivar.solvers.controls import Budget
from hemivar.survey import AugmentedLagrangian, ExactInner, Powell, PrimalDualActiveSet
from hemivar.systems import condense
from tests.counting import time_by_looks
from tests.problems import bar, discrete_square


def test_long_minimisation_returns_its_best_iterate_at_the_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = discrete_square("figure 1", n=64)  # takes Powell ten seconds and more
    start = solve(problem, Powell(), Controls(max_time=0.0))
    time_by_looks(monkeypatch)
    found = solve(problem, Powell(), Controls(max_time=0.02))
    assert found.status is Status.MAX_TIME
    assert found.energy < start.energy
    assert 1000 < found.evaluations <= 2000  # in twenty looks at the time


def test_active_sets_that_repeat_are_reported() -> None:
    """One point on a foundation that softens faster than the bar is stiff: the sets go round in circles."""
    law = PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], [0.0] * 3)  # type: ignore[arg-type]
    found = solve(bar(0.5, law), PrimalDualActiveSet())
    assert found.status in (Status.CYCLING, Status.CONVERGED)
    if found.status is Status.CONVERGED:
        assert found.residual.relative < 1e-9


@pytest.mark.parametrize("inner", [ExactInner()])
def test_cycle_detection_names_the_cycle(inner: ExactInner) -> None:
    problem = discrete_square(n=8)
    solver = PrimalDualActiveSet(inner)
    condensed = condense(problem)
    budget = Budget(np.inf)
    start = condensed.start()
    state = solver.begin(condensed, State(start, condensed.multiplier(start)), budget)
    first = solver.step(condensed, state, budget)
    sets, seen = first.memory
    # Pretend that the sets that come next have been met before.
    following = solver.step(condensed, first, budget)
    known = State(first.r, first.lam, memory=(sets, seen | {following.memory[0].tobytes()}))
    assert solver.step(condensed, known, budget).ended is Status.CYCLING


@pytest.mark.parametrize("method", [name for name in METHODS if name not in ("newton", "multigrid", "direct-powell")])
def test_methods_for_convex_laws_refuse_a_law_that_jumps_down(method: str) -> None:
    capped = PiecewiseQuadratic([0.0, 0.1], [0.0, 20.0, 0.0], [0.0, -2.0], name="capped")  # type: ignore[arg-type]
    with pytest.raises(MethodError, match=f"{method} cannot solve this problem") as caught:
        solve(bar(0.4, capped), METHODS[method])
    assert "use newton" in str(caught.value)


def test_bad_controls_and_options_are_named() -> None:
    with pytest.raises(ProblemError, match=r"Controls\.rtol is -1"):
        Controls(rtol=-1.0)
    with pytest.raises(ProblemError, match=r"Controls\.max_time is nan"):
        Controls(max_time=float("nan"))
    with pytest.raises(ProblemError, match=r"Controls\.max_steps is 0"):
        Controls(max_steps=0)
    with pytest.raises(ProblemError, match="penalty is -1"):
        AugmentedLagrangian(penalty=-1.0)
    with pytest.raises(ProblemError, match="tolerances"):
        Powell(ftol=0.0)
