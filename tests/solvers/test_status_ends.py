"""Every way a solve can end has a name, a remedy, and an iterate that is worth having."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.generators import result_of
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, Friction, PenetrationBound, PiecewiseQuadratic, ThresholdCompliance, Tresca
from hemivar.solvers import METHODS, Controls, NonsmoothNewton, Progress, Solver, Status, solve
from hemivar.solvers.base import State
from hemivar.solvers.controls import Budget
from hemivar.solvers.solve import solving
from hemivar.systems import CondensedProblem

from ..problems import bar, discrete_square

#: What remedies say and, capitalised, name.
REMEDIES = {
    Status.CONVERGED: ("residual is below the tolerance",),
    Status.INACCURATE: ("its own stopping rule", "NonsmoothNewton"),
    Status.MAX_STEPS: ("step limit", "Controls.max_steps"),
    Status.MAX_TIME: ("time limit", "Controls.max_time"),
    Status.STALLED: ("no step lowers", "Controls.rtol"),
    Status.CYCLING: ("active sets cycle", "NonsmoothNewton"),
    Status.NONFINITE: ("no longer finite", "NonsmoothNewton"),
    Status.NOT_CONTRACTING: ("does not contract", "FixedPoint"),
    Status.UNBOUNDED: ("no lower bound", "lower the load"),
    Status.NOT_CARRIED: ("may exceed what the foundation can carry", "hemivar solve --load-factor"),
    Status.AT_LIMIT: ("limit of friction", "add a support"),
    Status.INTERRUPTED: ("interrupted", "best iterate"),
    Status.OUT_OF_MEMORY: ("memory ran out", "multigrid"),
}


def test_every_status_has_a_remedy_in_words() -> None:
    assert set(REMEDIES) == set(Status)
    for status, words in REMEDIES.items():
        for word in words:
            assert word in status.remedy
            name, *parts = word.split(".") if word[0].isupper() else ("solve",)
            found: object = getattr(hv, name, None) or getattr(hv.solvers, name)
            for part in parts:
                found = getattr(found, part)  # what a remedy names is there


def test_step_limit() -> None:
    found = solve(discrete_square(n=16), controls=Controls(max_steps=1))
    assert found.status is Status.MAX_STEPS
    assert found.steps == 1
    assert found.residual.relative > 1e-9
    with pytest.raises(ProblemError, match="max_steps after 1 steps"):
        found.raise_for_status()


@pytest.mark.parametrize("method", METHODS)
def test_time_limit_is_kept_within_a_method(method: str) -> None:
    problem = discrete_square(n=16)
    found = solve(problem, METHODS[method], Controls(max_time=0.0))
    assert found.status is Status.MAX_TIME
    assert np.isfinite(found.unknowns).all()
    assert found.steps == 0
    assert found.evaluations <= 1


def test_callback_sees_every_step_and_can_stop() -> None:
    seen: list[Progress] = []
    problem = discrete_square(n=16)

    def watch(line: Progress) -> bool:
        seen.append(line)
        return line.step == 2

    found = solve(problem, controls=Controls(callback=watch))
    assert [line.step for line in seen] == [0, 1, 2]
    assert found.status is Status.INTERRUPTED
    assert found.history == tuple(seen)


def test_a_solve_tells_of_every_step_and_ends_where_it_is_told() -> None:
    problem = discrete_square(n=16)
    seen: list[Progress] = []
    found = result_of(solving(problem), seen.append)
    whole = solve(problem)
    np.testing.assert_array_equal(found.unknowns, whole.unknowns)
    assert [line.step for line in found.history] == [line.step for line in whole.history]
    assert found.history == tuple(seen)
    counted = solving(problem, controls=Controls(max_steps=20))  # by the steps of the method
    assert result_of(counted, lambda line: line.step == 2).status is Status.INTERRUPTED


def test_interrupt_from_the_keyboard_returns_the_best_iterate() -> None:
    def interrupt(line: Progress) -> None:
        if line.step == 2:
            raise KeyboardInterrupt

    found = solve(discrete_square(n=16), controls=Controls(callback=interrupt))
    assert found.status is Status.INTERRUPTED
    assert found.residual.relative < 10.0


@dataclass(frozen=True)
class _Idle(Solver):
    """A method that does nothing, badly."""

    value: float = 0.0
    name: ClassVar[str] = "idle"

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        return start

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        return State(state.r + self.value, state.lam)


def test_a_method_that_makes_no_progress_stalls() -> None:
    found = solve(discrete_square(n=4), _Idle())
    assert found.status is Status.STALLED
    assert found.steps == _Idle().patience + 1


def test_a_method_that_leaves_the_numbers_keeps_the_last_good_iterate() -> None:
    found = solve(discrete_square(n=4), _Idle(float("nan")))
    assert found.status is Status.NONFINITE
    assert np.isfinite(found.unknowns).all()


@dataclass(frozen=True)
class _Boaster(Solver):
    """A method that ends where it began, with a bound of its own for the error."""

    name: ClassVar[str] = "boaster"

    def begin(self, system: CondensedProblem, start: State, budget: Budget) -> State:
        return replace(start, ended=Status.CONVERGED, error_bound=1e-15)

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:
        raise AssertionError("never asked")


def test_an_error_bound_does_not_excuse_a_residual() -> None:
    found = solve(discrete_square(n=4), _Boaster())
    assert found.residual.relative > 0.1
    assert found.status is Status.INACCURATE


def test_energy_without_lower_bound_is_refused() -> None:
    falling = PiecewiseQuadratic([0.0], [-3.0, -3.0], [0.0], name="falling")  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="law 'falling' softens without bound, by 3"):
        solve(bar(0.4, falling))
    bound = Friction(PenetrationBound("8*s"))
    with pytest.raises(ProblemError, match="law 'falling' softens without bound, by 120"):
        solve(discrete_square(n=4).with_(law=ContactLaw(falling.scaled(40.0), bound)))
    # The body is stiff enough for a slower fall, and held from below where only one side falls.
    slower = PiecewiseQuadratic([0.0], [-0.5, -0.5], [0.0])  # type: ignore[arg-type]
    assert solve(bar(0.4, slower)).penetration[0] == pytest.approx(0.4)


def test_bad_initial_guesses_are_named() -> None:
    problem = discrete_square(n=4)
    with pytest.raises(ProblemError, match="shape"):
        solve(problem, initial=np.zeros(3))
    with pytest.raises(ProblemError, match="nan"):
        solve(problem, initial=np.full(problem.unknowns, np.nan))


def test_no_residual_is_hidden_by_a_kink_missed_by_rounding() -> None:
    """r = 1e-17 instead of 0 at a sticking point is a solution; a multiplier outside the law is not."""
    problem = DiscreteProblem.of_arrays(
        np.eye(2),
        np.array([0.0, 0.2]),
        np.eye(2),
        np.ones(1),
        np.zeros(1),
        ContactLaw(ThresholdCompliance(0.3, 2.0), Tresca(0.5)),
    )
    found = solve(problem, NonsmoothNewton())
    from hemivar.discrete import residual

    assert residual(problem, np.array([0.0, 1e-17]), np.array([[0.0, 0.2]])).total < 1e-15
    assert residual(problem, found.unknowns, found.multiplier).total < 1e-15
    assert residual(problem, np.array([0.0, 0.1]), np.array([[0.0, 0.1]])).inclusion > 0.05
