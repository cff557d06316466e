"""A method that fails hands on where none was asked for, and what is printed as a remedy is one."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pytest

import hemivar as hv
from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, Friction, PenetrationBound, PiecewiseQuadratic, Superpotential
from hemivar.solvers import (
    METHODS,
    Controls,
    FixedPoint,
    LoadStepping,
    NonsmoothMultigrid,
    NonsmoothNewton,
    Progress,
    ProximalNewton,
    Search,
    SemismoothNewton,
    Solver,
    Status,
    solve,
)
from hemivar.solvers.base import State
from hemivar.solvers.controls import Budget
from hemivar.solvers.fallbacks import others
from hemivar.solvers.solve import default_method
from hemivar.systems import CondensedProblem, Workspace

from ..counting import time_by_looks
from ..problems import bar, discrete_square, relative_difference
from .test_controls_interruption import stopped

#: The module, whose name is that of a function of its package, too.
SOLVING = importlib.import_module("hemivar.solvers.solve")


@dataclass(frozen=True)
class _Stuck(NonsmoothNewton):
    """Newton's method that does not move."""

    value: float = 0.0
    name: ClassVar[str] = "stuck"

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:  # type: ignore[override]
        return replace(state, r=state.r + self.value, residual=None)


@pytest.fixture
def stuck(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SOLVING, "choose", lambda problem: (_Stuck(), "stuck"))


def reacting() -> DiscreteProblem:
    """One point whose friction bound reacts on the penetration 1.9 times as strongly as it changes."""
    return DiscreteProblem.of_arrays(
        np.array([[1.0, -0.9], [-0.9, 1.0]]),  # type: ignore[arg-type]
        np.array([0.1, 20.0]),
        np.eye(2),  # type: ignore[arg-type]
        np.ones(1),
        np.zeros(1),
        ContactLaw(
            PiecewiseQuadratic([0.0], [0.0, 0.0], [0.0]), Friction(PenetrationBound(lambda s: 0.4 * np.maximum(s, 0.0)))
        ),
    )


@pytest.mark.usefixtures("stuck")
def test_the_result_says_which_method_took_over_and_why() -> None:
    problem = discrete_square(n=8)
    found = solve(problem)
    assert found.status is Status.CONVERGED
    assert found.method == "multigrid"
    assert relative_difference(found, solve(problem, NonsmoothNewton())) < 1e-8
    assert found.remarks[0].startswith("multigrid took over: stuck ended stalled after 13 steps, relative residual ")
    assert found.remarks[0] in found.warnings


class _RunsAway(NonsmoothNewton):
    """Newton's method that finds no end of the energy downhill."""

    def step(self, system: CondensedProblem, state: State, budget: Budget) -> State:  # type: ignore[override]
        if self.search is Search.GLOBAL:
            return super().step(system, state, budget)
        return replace(state, ended=Status.UNBOUNDED)


@pytest.mark.parametrize("bound", [0.5, PenetrationBound(lambda s: 0.4 * np.maximum(s, 0.0))], ids=["known", "state"])
def test_a_walk_that_runs_away_downhill_goes_on_across_barriers(
    bound: float | PenetrationBound, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also within a fixed point; the solution is that of the method that crosses them from the start."""
    problem = discrete_square(n=8).with_(law=ContactLaw(hv.Compliance(20.0), Friction(bound)).at(None))
    downhill, newton = _RunsAway(search=Search.DOWNHILL), NonsmoothNewton()
    across = replace(downhill, search=Search.GLOBAL)
    away, on, right = (FixedPoint(one) if problem.law.state_dependent else one for one in (downhill, across, newton))
    assert on in others(away, Status.UNBOUNDED, problem)
    monkeypatch.setattr(SOLVING, "choose", lambda problem: (away, "away"))
    found = solve(problem)
    assert found.status is Status.CONVERGED
    assert "took over" in found.remarks[0]
    assert relative_difference(found, solve(problem, right)) < 1e-6


@pytest.mark.usefixtures("stuck")
def test_steps_that_were_counted_and_a_stop_are_no_failure() -> None:
    problem = discrete_square(n=8)
    few = solve(problem, max_steps=2)
    assert (few.status, few.method, few.remarks) == (Status.MAX_STEPS, "stuck", ())

    def stop(line: Progress) -> bool:
        return line.step == 2

    assert solve(problem, controls=Controls(callback=stop)).method == "stuck"


def test_a_method_that_was_asked_for_is_the_only_one() -> None:
    found = solve(discrete_square(n=8), _Stuck())
    assert (found.status, found.remarks) == (Status.STALLED, ())


def test_a_bound_that_reacts_strongly_is_solved_in_smaller_steps() -> None:
    """Where it slips, r_n - .9 r_t = .1 and r_t - .9 r_n = 20 - .4 r_n."""
    found = solve(reacting())
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.local[0], [18.1 / 0.55, 20.0 + 9.05 / 0.55], rtol=1e-8)
    assert "ended not_contracting" in found.remarks[0]


@pytest.mark.usefixtures("stuck")
def test_all_methods_together_keep_the_time_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = discrete_square(n=8)
    monkeypatch.setattr(SOLVING, "others", lambda *given: [_Stuck(value=0.1 * k) for k in range(3)])
    whole = solve(problem)
    assert whole.remarks[0].count("ended stalled") == 3
    given: list[float] = []
    run = SOLVING._run

    def watched(problem: object, solver: object, controls: Controls, *more: object) -> object:
        given.append(controls.max_time)
        return run(problem, solver, controls, *more)

    monkeypatch.setattr(SOLVING, "_run", watched)
    solve(problem, max_time=60.0)
    assert len(given) == 4
    assert given[0] == 60.0
    assert (np.diff(given) < 0.0).all()
    time_by_looks(monkeypatch)
    limited = solve(problem, max_time=0.05)
    assert limited.status in (Status.STALLED, Status.MAX_TIME)
    assert len(limited.remarks[0].split(";")) < 3  # the last did not begin


FIRST = (
    NonsmoothNewton(),
    NonsmoothMultigrid(),
    FixedPoint(),
    SemismoothNewton(),
    SemismoothNewton(FixedPoint(NonsmoothMultigrid())),
    ProximalNewton(),
)


@pytest.mark.parametrize("ended", Status)
@pytest.mark.parametrize("first", FIRST, ids=lambda one: one.name)
def test_at_most_three_others_are_tried_and_none_twice(first: Solver, ended: Status) -> None:
    problem = discrete_square(n=4)
    found = list(others(first, ended, problem))
    assert len(found) <= 3
    assert len({repr(one) for one in (first, *found)}) == len(found) + 1
    final = (Status.CONVERGED, Status.MAX_TIME, Status.INTERRUPTED, Status.OUT_OF_MEMORY, Status.NOT_CARRIED)
    assert bool(found) is (ended not in final)
    if first.handles_state:
        assert all(one.handles_state for one in found)
    if first.handles_nonlinear:
        assert all(one.handles_nonlinear for one in found)


# ---- what breaks -------------------------------------------------------------------------------------------------


def glued_tower(stretch: float, **glue: float) -> hv.ContactProblem:
    """A block of height 10 and stiffness 1000 / (1 - .3^2), glued to its ground with the strength 2."""
    return hv.ContactProblem(
        mesh=hv.rectangle((4.0, 10.0), (2, 4)),
        material=hv.Material.young(1000.0, 0.3),
        supports={"top": hv.Fixed(y=stretch), "left": "roller"},
        contact={"bottom": hv.Contact(hv.Adhesive(stiffness=1e6, strength=2.0, **glue))},
    )


@pytest.mark.parametrize("glue", [{}, {"energy": 0.01}, {"softening": 10.0}])
@pytest.mark.parametrize("method", ["newton", "multigrid"])
def test_glue_below_its_strength_holds(glue: dict[str, float], method: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The tension of a block and its glue in series."""
    monkeypatch.setattr(SOLVING, "choose", lambda problem: (METHODS[method], ""))
    found = solve(glued_tower(0.01, **glue))
    assert -found.normal_force / 4.0 == pytest.approx(0.01 / (10.0 * (1.0 - 0.3**2) / 1000.0 + 1e-6), rel=1e-9)
    lower = solve(glued_tower(0.01, **glue), NonsmoothNewton())
    said = [remark for remark in found.remarks if "lower energy exists" in remark]
    assert bool(said) is (lower.energy < found.energy - 1e-6 * abs(found.energy))
    assert bool(said) is (glue == {})


def test_nothing_lower_is_claimed_where_the_bond_has_least_energy() -> None:
    """The bond stores s^2/2/k, what is broken frees s^2/2 h/E: as much, for s = 2 k y, at a stretch of nothing only;
    but a point alone lets go for the part of the body beside it, which at a small stretch costs more than it frees."""
    for stretch in (1e-9, 1e-8):
        assert solve(glued_tower(stretch)).remarks == ()


def test_glue_beyond_its_strength_has_let_go() -> None:
    found = solve(glued_tower(0.03)).raise_for_status()
    assert abs(found.normal_force) < 1e-9


def test_springs_that_break_hold_up_to_their_limit() -> None:
    """Springs of stiffness 20 that break at .1 under a bar: broken it has less energy at the load 3 (.5 u^2 - f u)."""
    capped = hv.laws.Capped(20.0, 0.1)
    problem = bar(3.0, capped)
    found, anywhere = solve(problem), solve(problem, NonsmoothNewton())
    assert found.penetration[0] == pytest.approx(1.5 / 21.0)
    assert anywhere.energy < found.energy
    assert "lower energy exists" in found.remarks[0]


@pytest.mark.parametrize("softening", [16.0, 34.0, 60.0])
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_foundation_that_softens_holds_below_its_limit(softening: float, unit: float) -> None:
    """A bar of stiffness 1 on springs 20 up to .1: intact up to the force 2.1, r = F/21; broken it has r = F."""
    law = hv.Softening(20.0, 0.1 * unit, softening)
    found, anywhere = (solve(bar(4.1 * unit, law), method) for method in (None, NonsmoothNewton()))
    grown = solve(bar(4.1 * unit, law), LoadStepping())
    assert found.penetration[0] == pytest.approx(2.05 * unit / 21.0, rel=1e-9)
    assert grown.penetration[0] == pytest.approx(found.penetration[0], rel=1e-9)
    assert anywhere.penetration[0] == pytest.approx(2.05 * unit, rel=1e-9)
    assert ["lower energy exists" in remark for remark in found.remarks] == [True]
    assert solve(bar(4.4 * unit, law)).remarks == ()  # beyond the peak the way down leads there


@pytest.mark.parametrize(
    ("law", "falls"),
    [
        (hv.Compliance(20.0), False),
        (hv.Softening(20.0, 0.1, 1.0), True),
        (hv.Softening(20.0, 0.1, 0.0), False),
        (hv.laws.FormulaLaw(derivative="r*exp(-r^2)", reach=3.0), True),
        (hv.laws.Capped(20.0, 0.1), True),
    ],
)
def test_laws_whose_force_falls_start_downhill(law: Superpotential, falls: bool) -> None:
    method = default_method(bar(1.0, law), Workspace())
    assert method == NonsmoothNewton(search=Search.DOWNHILL if falls else Search.GLOBAL)


# ---- remedies: each is carried out on a problem that gets it ------------------------------------------------------


def test_raising_a_limit_and_starting_nearby_help_where_steps_or_time_gave_out() -> None:
    problem = discrete_square(n=16)
    assert solve(problem, max_steps=1).status is Status.MAX_STEPS
    assert solve(problem, max_steps=100).status is Status.CONVERGED
    near = solve(problem.with_(load=0.999999 * problem.load))
    assert solve(problem, max_steps=1, initial=near).status is Status.CONVERGED
    assert solve(problem, max_time=0.0).status is Status.MAX_TIME
    assert solve(problem, max_time=60.0).status is Status.CONVERGED


def test_a_stalled_method_is_left_or_its_tolerance_is_raised() -> None:
    problem = discrete_square(n=16)
    assert solve(problem, _Stuck()).status is Status.STALLED
    assert solve(problem, METHODS["multigrid"]).status is Status.CONVERGED
    near = solve(problem.with_(load=0.999999 * problem.load))
    assert solve(problem, _Stuck(), initial=near).status is Status.STALLED
    assert solve(problem, _Stuck(), initial=near, rtol=1e-4).status is Status.CONVERGED


@pytest.mark.parametrize("relaxation", [0.5, 0.3])
def test_relaxation_helps_where_a_fixed_point_did_not_contract(relaxation: float) -> None:
    assert solve(reacting(), FixedPoint()).status is Status.NOT_CONTRACTING
    assert solve(reacting(), FixedPoint(relaxation=relaxation)).status is Status.CONVERGED


def test_a_lower_load_or_a_support_helps_where_the_energy_has_no_bound() -> None:
    """Two points joined by a spring, one of them on glue of strength 2."""
    law = ContactLaw(hv.Adhesive(24.0, 2.0, 6.0, 72.0))

    def joined(pull: float, held: float = 0.0) -> DiscreteProblem:
        K = np.array([[1.0, -1.0], [-1.0, 1.0 + held]])
        B, load = np.array([[1.0, 0.0]]), np.array([0.0, -pull])
        return DiscreteProblem.of_arrays(K, load, B, np.ones(1), np.zeros(1), law)  # type: ignore[arg-type]

    method = NonsmoothNewton(search=Search.DOWNHILL)
    assert solve(joined(3.0), method).status is Status.UNBOUNDED
    assert solve(joined(1.0), method).status is Status.CONVERGED
    assert solve(joined(3.0, held=1.0), method).status is Status.CONVERGED
    found = solve(joined(3.0))
    assert found.status is Status.NOT_CARRIED
    assert found.carried is not None
    assert 3.0 * found.carried[0] <= 2.0 <= 3.0 * found.carried[1]


def test_multigrid_helps_where_the_memory_gave_out() -> None:
    problem = discrete_square(n=16)
    assert solve(problem, stopped(MemoryError)).status is Status.OUT_OF_MEMORY
    assert solve(problem, METHODS["multigrid"]).status is Status.CONVERGED


def test_a_fixed_point_whose_ordinary_problems_are_not_solved_ends() -> None:
    found = solve(reacting(), FixedPoint(_Stuck(value=0.1)))
    assert found.status is Status.STALLED
    assert found.steps == 2
