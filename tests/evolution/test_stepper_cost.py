"""What a step costs, counted: factorisations, sweeps through factors, calls, memory; and whether it is right."""

from __future__ import annotations

import contextlib
import gc
import math
import tracemalloc
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.certificates.smallness import smallness
from hemivar.discrete.operators import Operator
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution import Evolution, descent, discrete, march, stage_solver
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.initial import initial_state
from hemivar.evolution.march import March, marching
from hemivar.evolution.margin import Margins
from hemivar.evolution.save import Save
from hemivar.evolution.schemes import Scheme
from hemivar.evolution.stage import _forces as forces
from hemivar.evolution.stage import extrapolated_multiplier, out_of_balance_force, stage_state
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.fem import assembly
from hemivar.fem.initial_load import initial_load
from hemivar.linear import factorisation
from hemivar.solvers.newton_on_graph import ForceResidual, NewtonCache, active_set_newton
from hemivar.systems import elimination
from tests import bodies
from tests.counting import at_most_calls
from tests.samples import sampled

STEP = 0.01
NONE = Save(every=1e9)


def of_the_rate(problem: hv.ContactProblem) -> hv.ContactProblem:
    """The problem with friction of the slip rate in time."""
    contact = {name: replace(one, friction=replace(one.friction, of="rate")) for name, one in problem.contact.items()}
    return replace(problem, contact=contact)


def damped_body(law: str, n: int = 8, viscosity: tuple[float, float] = (0.4, 0.4)) -> Evolution:
    """One of the survey's bodies with mass and viscosity."""
    made = {
        "survey": lambda: gallery.survey("5.1", n, "right"),
        "softening": lambda: of_the_rate(gallery.survey_logarithmic(0.3, n, "right")),
        "cube": lambda: gallery.survey_cube("5.1", n // 2),
    }[law]()
    return Evolution(replace(made, material=replace(made.material, density=1.0, viscosity=viscosity)), inertia=True)


def debonding_square(n: int = 4) -> Evolution:
    """A block pulled off its glue, which breaks slowly."""
    bond = hv.Contact(hv.laws.NoContact(), memory=(hv.laws.Bonding(50.0, 0.05, 0.2),))
    problem = bodies.square(
        bond, n, viscosity=(0.4, 0.4), supports={"top": hv.Fixed(x=0.0, y=lambda x, t: np.full(len(x), 0.5 * t))}
    )
    return Evolution(problem)


@pytest.fixture
def counted(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Factorisations of condensed bodies, whole solves and sweeps through a half of the factors."""
    found: Counter[str] = Counter()

    def watch(owner: object, name: str, what: str) -> None:
        original = getattr(owner, name)

        def counting(*given: object) -> object:
            found[what] += 1
            return original(*given)

        monkeypatch.setattr(owner, name, counting)

    watch(elimination, "factorise", "factors")
    watch(factorisation.SuperLUFactorisation, "_solve", "solves")
    watch(factorisation._TriangularFactors, "forward", "halves")
    watch(factorisation._TriangularFactors, "backward", "halves")
    return found


@pytest.mark.parametrize("law", ["survey", "softening", "cube"])
def test_a_step_that_stays_costs_two_half_sweeps_and_no_factorisation(law: str, counted: Counter[str]) -> None:
    if law == "cube" and factorisation.pardiso_available():
        pytest.skip("in space PARDISO takes the place of the factors whose sweeps are counted")
    run = marching(damped_body(law), March(1.0, step=STEP, save=NONE, method=hv.solvers.NonsmoothNewton()))
    next(run)  # with the search for the largest step, whose bodies are condensed as well
    counted.clear()
    for _ in range(30):
        next(run)
    assert counted["factors"] == counted["solves"] == 0
    assert 2 * 30 <= counted["halves"] <= 2 * 30 + 4


@pytest.mark.parametrize("others", [False, True], ids=["in proportion", "not in proportion"])
@pytest.mark.parametrize("law", ["survey", "softening", "cube"])
def test_a_step_multiplies_by_each_matrix_once(law: str, others: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """And not at all by a viscosity that is a multiple of the stiffness."""
    found: Counter[int] = Counter()
    original = Operator.times

    def counting(operator: Operator, x: Array) -> Array:
        found[id(operator)] += 1
        return original(operator, x)

    viscosity = (0.4, 0.2) if others else (0.4, 0.4)
    run = marching(
        damped_body(law, viscosity=viscosity), March(1.0, step=STEP, save=NONE, method=hv.solvers.NonsmoothNewton())
    )
    next(run)
    monkeypatch.setattr(Operator, "times", counting)
    for _ in range(30):
        next(run)
    assert list(found.values()) == [30, 30] + ([30] if others else [])


@pytest.mark.parametrize("longer", [0.3, 1.0, 1.9, 7.0])
def test_a_step_begins_with_the_forces_of_its_prediction(longer: float) -> None:
    advance, taken, _, _ = last(damped_body("softening"), 12)
    stage = advance.take(taken[-1].state, longer * STEP).stages[0]
    parts = forces(advance.discrete, stage.operator, stage.before, stage.prediction)
    parts.pop("inertial")  # none where the body is expected: see below
    size = sum(np.abs(part) for part in parts.values()) + np.abs(stage.load)
    rest = stage.problem.load - (stage.load - sum(parts.values()))
    assert np.abs(rest).max() <= 1e-13 * size.max()
    known = taken[-1].state.history
    assert known is not None
    assert known.force is not None
    stretched = taken[-1].state.body.displacement - taken[-1].before.body.displacement
    np.testing.assert_allclose(known.force, advance.discrete.stiffness.times(stretched), atol=1e-13 * size.max())


def test_pressure_and_friction_are_expected_to_go_on_as_they_did(monkeypatch: pytest.MonkeyPatch) -> None:
    _, taken, _, _ = last(damped_body("softening"), 8)
    before, state = taken[-1].before.multiplier, taken[-1].state
    change = state.multiplier - before
    assert np.abs(change).max() > 1e-4
    for part in (0.0, 0.5, 2.0):
        expected = state.multiplier + part * change
        np.testing.assert_allclose(extrapolated_multiplier(state, part * STEP), expected, atol=1e-14)
    np.testing.assert_array_equal(extrapolated_multiplier(state, 3.0 * STEP), state.multiplier)

    def equations() -> int:
        run = marching(
            damped_body("softening", 16), March(1.0, step=STEP, save=NONE, method=hv.solvers.NonsmoothNewton())
        )
        return sum(next(run).row.solver_steps for _ in range(40))

    told = equations()
    monkeypatch.setattr("hemivar.evolution.stage_solver.extrapolated_multiplier", lambda state, _: state.multiplier)
    assert told < 0.9 * equations()


@pytest.mark.parametrize(
    "scheme",
    [
        hv.evolution.ImplicitEuler(),
        hv.evolution.Midpoint(),
        hv.evolution.Newmark(),
        hv.evolution.GeneralizedAlpha(0.8),
        hv.evolution.SDIRK2(),
    ],
    ids=lambda scheme: scheme.name,
)
def test_what_forces_leave_of_the_load_is_what_the_stiffness_leaves(scheme: Scheme) -> None:
    stated = damped_body("survey").problem
    assert isinstance(stated, hv.ContactProblem)
    soft = replace(stated.material, branches=[hv.materials.Branch(lame=(2, 2), time=0.5)])
    discrete = discretize_evolution(Evolution(replace(stated, material=soft), inertia=scheme.takes_mass))
    advance = TimeStepper.of(discrete, scheme, hv.solvers.NonsmoothNewton(), hv.Controls())
    state = initial_state(advance)
    for _ in range(4):
        taken = advance.take(state, STEP)
        state = taken.state
    random = np.random.default_rng(3)
    for stage, solution in zip(taken.stages, taken.solutions, strict=True):
        u = solution.unknowns + random.normal(scale=np.abs(solution.unknowns).max(), size=solution.unknowns.shape)
        reached = stage_state(discrete, stage, u)
        found = out_of_balance_force(discrete, stage, reached, 0.0)
        rest = stage.problem.out_of_balance(u)
        assert np.linalg.norm(found.force - rest) <= 1e-14 * found.size
        assert found.size <= 1e6 * np.linalg.norm(rest)  # else that would say nothing
        rough = out_of_balance_force(discrete, stage, reached, math.inf).size
        assert found.size <= rough <= 30.0 * found.size
        direct = hv.discrete.residual(stage.problem, solution.unknowns, solution.multiplier)
        assert abs(solution.residual.equilibrium - direct.equilibrium) <= solution.residual.noise + direct.noise


def test_a_residual_that_only_rounding_explains_is_asked_of_the_stiffness() -> None:
    """A body that flies far off, whose displacement is known to fewer digits than what a step adds to it."""
    problem = hv.discretize(gallery.survey("5.1", 6, "right"))
    system, known = hv.systems.Workspace().condensed(problem, many=True), hv.solve(problem)
    asked: list[Array] = []

    def vague(u: Array) -> ForceResidual:
        asked.append(u)
        return ForceResidual(np.array(problem.contact_force(known.multiplier)), 1e6)

    found = active_set_newton(system, known.local, known.multiplier, hv.Controls(), NewtonCache(), vague)
    assert found is not None
    assert len(asked) == 1
    assert found.residual.noise < 1e-12  # and not 8 eps 1e6
    np.testing.assert_allclose(
        found.residual.equilibrium,
        hv.discrete.residual(problem, found.unknowns, found.multiplier).equilibrium,
        atol=1e-14,
    )


def test_a_step_of_coulomb_on_levels_begins_where_contact_is_expected() -> None:
    """Two solves of Newton's equation, the second to the end, where the sets of contact stay; and the right answer."""
    stated = damped_body("cube", 12)
    problem = stated.problem
    rubs = dict.fromkeys(problem.contact, hv.Contact(hv.Compliance(50.0), hv.Coulomb(0.3)))
    stated = replace(stated, problem=replace(problem, contact=rubs))
    whole = hv.solvers.SemismoothNewton(hv.solvers.FixedPoint(hv.solvers.NonsmoothMultigrid()))
    few = march(stated, 0.08, step=STEP, method=whole)
    assert few["solver_steps"][3:].max() <= 2
    dense = march(stated, 0.08, step=STEP, method=hv.solvers.SemismoothNewton())
    np.testing.assert_allclose(few["normal_force"], dense["normal_force"], rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("method", ["multigrid", "newton"])
def test_dense_algebra_of_a_step_takes_one_thread_where_all_is_on_levels(
    method: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its vectors are too small to be shared out: threads that wait for them cost many times the step."""
    asked: list[bool] = []

    def noted(wanted: bool = True) -> contextlib.AbstractContextManager[None]:
        asked.append(wanted)
        return contextlib.nullcontext()

    monkeypatch.setattr("hemivar.evolution.stepper.one_thread", noted)
    march(damped_body("survey"), 2.0 * STEP, step=STEP, method=method, save=NONE)
    assert asked == 2 * [method == "multigrid"]


def test_steps_on_a_ladder_factorise_once_for_each_rung(counted: Counter[str]) -> None:
    control = hv.evolution.AdaptiveStep(rtol=1e-2, first_step=STEP)
    history = march(damped_body("survey"), 0.5, step=control, save=NONE, method=hv.solvers.NonsmoothNewton())
    lengths = np.unique(np.round(np.log2(history["step"][1:] / STEP), 9))
    assert history.times.size > 3 * lengths.size
    assert counted["factors"] <= lengths.size + 2  # and where steps were rejected


def test_a_step_calls_few_functions() -> None:
    run = marching(damped_body("survey"), March(1.0, step=STEP, save=NONE, method=hv.solvers.NonsmoothNewton()))
    for _ in range(10):
        next(run)
    with at_most_calls(20 * 600):
        for _ in range(20):
            next(run)


@pytest.mark.slow
def test_memory_does_not_grow_but_for_the_rows_of_the_table() -> None:
    def growth(n: int) -> float:
        """KiB for each of the steps 100 to 300."""
        run = marching(damped_body("survey", n), March(10.0, step=STEP, save=NONE, method=hv.solvers.NonsmoothNewton()))
        for _ in range(100):
            next(run)
        gc.collect()
        tracemalloc.start()
        for _ in range(10):  # what is kept of the last steps has all been made anew
            next(run)
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(200):
            next(run)
        gc.collect()
        kept = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
        return kept / 1024.0 / 200

    small, large = growth(4), growth(24)
    assert large < 4.0
    assert large < small + 0.5  # a vector of the larger body alone would be 9 KiB


@pytest.mark.parametrize("law", ["survey", "softening", "cube"])
def test_near_solutions_are_those_of_the_search(law: str, monkeypatch: pytest.MonkeyPatch) -> None:
    options = {"step": STEP, "save": NONE, "method": hv.solvers.NonsmoothNewton(), "controls": hv.Controls(rtol=1e-11)}
    quick = march(damped_body(law), 20 * STEP, **options)
    monkeypatch.setattr("hemivar.evolution.stage_solver.active_set_newton", lambda *_: None)
    searched = march(damped_body(law), 20 * STEP, **options)
    for name in ("displacement", "velocity"):
        one, other = getattr(quick.state.body, name), getattr(searched.state.body, name)
        np.testing.assert_allclose(one, other, atol=1e-8 * np.abs(other).max())
    lam = searched.state.multiplier
    np.testing.assert_allclose(quick.state.multiplier, lam, atol=1e-7 * np.abs(lam).max())
    np.testing.assert_allclose(quick["margin"], searched["margin"], rtol=1e-7)


@pytest.mark.parametrize("seed", range(6))
def test_a_far_start_ends_at_the_solution_or_is_given_up(seed: int) -> None:
    random = np.random.default_rng(seed)
    problem = hv.discretize(gallery.survey("5.1", 6, "right"))
    system = hv.systems.Workspace().condensed(problem, many=True)
    known = hv.solve(problem)
    r = known.local + random.normal(scale=10.0 ** random.uniform(-4, 1), size=known.local.shape)
    lam = random.normal(scale=np.abs(known.multiplier).max(), size=known.local.shape)
    found = active_set_newton(system, r, lam, hv.Controls(), NewtonCache())
    if found is not None:
        assert hv.discrete.residual(problem, found.unknowns, found.multiplier).below(0.0, 1e-9)
        np.testing.assert_allclose(found.unknowns, known.unknowns, atol=1e-7 * np.abs(known.unknowns).max())


def test_where_a_step_may_have_several_solutions_the_way_to_it_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, look = [], stage_solver.path_bends_downwards

    def looked_at(*given: Any) -> bool:
        asked.append(look(*given))
        return asked[-1]

    monkeypatch.setattr(stage_solver, "path_bends_downwards", looked_at)
    law = hv.laws.PiecewiseQuadratic([0.0, 0.1, 0.2], [0.0, 2.0, -2.0, 0.0], np.zeros(3))
    problem = bodies.column(law, 1.0, top=hv.Fixed(y=lambda x, t: np.full(len(x), -t)))
    history = march(Evolution(problem), 0.05, step=0.01, save=NONE)
    assert (history["margin"][1:] < 0.0).all()
    assert asked == [False] * 5


def last(evolution: Evolution, steps: int) -> tuple[TimeStepper, list[StepResult], Margins, list[float]]:
    """Steps of a march, with the largest steps that its margins have told."""
    advance = TimeStepper.of(
        discretize_evolution(evolution), hv.evolution.ImplicitEuler(), hv.solvers.NonsmoothNewton(), hv.Controls()
    )
    state, taken, margins = initial_state(advance), [], Margins(advance)
    told = []
    for _ in range(steps):
        taken.append(advance.take(state, STEP))
        state = taken[-1].state
        told.append(margins.largest_step(taken[-1]))
    return advance, taken, margins, told


def test_the_largest_step_does_not_depend_on_what_was_asked_before(counted: Counter[str]) -> None:
    advance, taken, _, told = last(debonding_square(), 60)
    assert len(set(told)) > 5  # the glue breaks
    spent = counted["factors"]
    assert spent < 20 + 2 * len(set(told))
    again = Margins(advance)
    assert [again.largest_step(one) for one in taken[::-7]] == told[::-7]


def test_the_margin_changes_its_sign_at_the_largest_step() -> None:
    advance, taken, _, told = last(debonding_square(), 40)
    before, largest = taken[-1].before, told[-1]

    def margin(step: float) -> float:
        [(factors, law)] = advance.stage_laws(before, step)
        return smallness(advance.stages.bodies.body(*factors).with_(law=law), trace_constant=False).margin

    assert 0.0 < largest < np.inf
    assert margin(largest) > 0.0 > margin(1.011 * largest)


def test_margins_of_condensed_bodies_are_those_of_certificates() -> None:
    for evolution in (debonding_square(), damped_body("softening"), damped_body("softening", 32)):
        advance = TimeStepper.of(
            discretize_evolution(evolution), hv.evolution.ImplicitEuler(), hv.solvers.NonsmoothNewton(), hv.Controls()
        )
        stage = advance.take(initial_state(advance), STEP).stages[0]
        problem = stage.problem
        assert advance.stages.constant(stage, problem.law) == pytest.approx(
            smallness(problem, trace_constant=False).constant, rel=1e-7
        )


def test_no_force_of_inertia_acts_where_a_body_is_expected() -> None:
    discrete = discretize_evolution(damped_body("survey"))
    advance = TimeStepper.of(discrete, hv.evolution.ImplicitEuler(), hv.solvers.NonsmoothNewton(), hv.Controls())
    taken = advance.take(initial_state(advance), STEP)
    stage = advance.take(taken.state, STEP).stages[0]
    whole = forces(discrete, stage.operator, stage.before, stage.prediction)
    size = float(np.abs(discrete.mass.times(taken.state.body.velocity / STEP)).max())  # type: ignore[union-attr]
    np.testing.assert_allclose(whole["inertial"], np.zeros_like(stage.prediction), atol=1e-12 * size)


def test_softening_is_infinite_where_a_law_falls_off_a_cliff() -> None:
    problem = hv.discretize(gallery.survey("5.1", 4, "right"))
    reduced = hv.systems.Workspace().condensed(problem).body
    none: Array = np.zeros(1)
    assert reduced.softening(none, none) == 0.0
    assert reduced.softening(np.array([np.inf]), none) == np.inf


GLUE = hv.laws.BilinearCohesion(0.5, 0.05, 24.0)
SOFT = {
    "coulomb": (2, hv.Contact(GLUE, hv.Coulomb(0.4))),
    "coulomb in space": (3, hv.Contact(GLUE, hv.Coulomb(0.4))),
    "two energies": (
        2, hv.Contact(hv.laws.ModeDependentGlue(0.5, 0.6, 24.0, hv.laws.BenzeggaghKenane(0.05, 0.1, 2.0))),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", sampled(SOFT, ["two energies"]))
def test_the_way_down_of_a_law_without_a_potential_is_short(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once a step stays on its pieces Newton's method leads to the end of the way: the same, and in fewer solves."""
    dim, contact = SOFT[name]
    solves, solve = Counter[str](), descent.solve

    def counted(problem: DiscreteProblem, *options: object, **more: object) -> hv.Solution:
        solves[name] += 1
        return solve(problem, *options, **more)  # type: ignore[arg-type]

    monkeypatch.setattr(descent, "solve", counted)
    for quicker in ("_without_barrier", "_walked"):  # what bodies take that are not condensed
        monkeypatch.setattr(stage_solver.StageSolver, quicker, lambda *_: None)
    stated = hv.ContactProblem(
        hv.rectangle((2.0, 1.0), (4, 2), pattern="right") if dim == 2 else hv.box((2.0, 1.0, 1.0), (4, 2, 2)),
        hv.Material.lame(4.0, 4.0),
        {"bottom": contact},
        {"left": hv.Clamped()},
        body_force=lambda x, t: np.array([0.3, *([0.1] * (dim - 2)), 1.0])[:dim] * np.full((len(x), 1), 0.7 * t),
    )
    quick = march(Evolution(stated), until=0.3, step=0.1, controls=hv.Controls(rtol=1e-9))
    few = solves[name]
    assert 0 < few <= 100 * (dim - 1)
    monkeypatch.setattr(descent._Backoff, "due", lambda self, stays: False)  # by the steps of the way alone
    slow = march(Evolution(stated), until=0.3, step=0.1, controls=hv.Controls(rtol=1e-9))
    size = np.abs(slow.at(0.3).local).max()
    np.testing.assert_allclose(quick.at(0.3).local, slow.at(0.3).local, atol=1e-7 * size)
    assert solves[name] > (5 - dim) * few


@pytest.mark.parametrize("growing", [False, True])
def test_initial_stress_that_stays_is_integrated_once(growing: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The load of each time is that of the statement bound to it, beside a weight that changes."""
    stress = np.diag([3.0, -1.0])
    problem = hv.ContactProblem(
        hv.rectangle((2.0, 1.0), (4, 2)),
        hv.Material.lame(4.0, 4.0),
        supports={"top": "clamped"},
        body_force=lambda x, t: np.stack([t * x[:, 0], -1.0 - x[:, 1]], axis=1),
        initial_stress=(lambda x, t: np.tile((1.0 + t) * stress, (len(x), 1, 1))) if growing else stress,
    )
    body, times = discretize_evolution(Evolution(problem)), (0.0, 0.5, 2.0)
    own = [hv.discretize(problem.at_time(t)).load for t in times]
    integrated = []
    for module in (assembly, discrete):
        monkeypatch.setattr(module, "initial_load", lambda stated: integrated.append(1) or initial_load(stated))
    for t, load in zip(times, own, strict=True):
        np.testing.assert_array_equal(body.data_at(t).load[: body.unknowns], load)
    assert len(integrated) == (len(times) if growing else 1)
