"""Glue whose fracture energy depends on the mode: work along paths, fixed points by other means, and refusals."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import fsolve

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import (
    BenzeggaghKenane,
    MixedMode,
    ModeDependentGlue,
    PowerCriterion,
    Softening,
    Tresca,
)
from hemivar.laws.vector_law import is_convex, is_curve
from hemivar.solvers.newton_on_graph import GraphEquation, GraphPoint
from hemivar.systems.newton_equation import Accuracy
from tests.bodies import glued_plate, opened_point

PULL = (60.0, 60.0)

#: AS4/PEEK: N, mm, MPa.
PEEK = BenzeggaghKenane(0.969, 1.719, 2.284)
SOFT = BenzeggaghKenane(0.5, 0.9, 2.0)


def peek(shear_stiffness: float | None = None) -> ModeDependentGlue:
    return ModeDependentGlue(80.0, 100.0, 1e6, PEEK, shear_stiffness).at(None)


def soft(shear_stiffness: float | None = None) -> ModeDependentGlue:
    return ModeDependentGlue(30.0, 45.0, 1e4, SOFT, shear_stiffness).at(None)


def work(law: ModeDependentGlue, corners: list[tuple[float, float]]) -> float:
    """Work of the tractions along a path of openings and slips, by Gauss's rule on parts dense at the start."""
    nodes, weights = np.polynomial.legendre.leggauss(4)
    parts = np.unique(np.concatenate([np.linspace(0.0, 1.0, 6000), np.geomspace(1e-8, 1.0, 4000)]))
    t = (0.5 * (parts[1:] + parts[:-1])[:, None] + 0.5 * np.diff(parts)[:, None] * nodes).ravel()
    found = 0.0
    for start, end in itertools.pairwise(np.array(corners) * [-1.0, 1.0]):
        force = law.traction(start + t[:, None] * (end - start))
        found += float(((force @ (end - start)).reshape(-1, 4) @ weights * 0.5 * np.diff(parts)).sum())
    return found


def test_opening_costs_the_energy_of_opening_and_shear_that_of_shear() -> None:
    for law in (peek(), peek(1e6)):
        assert work(law, [(0.0, 0.0), (0.05, 0.0)]) == pytest.approx(0.969, rel=1e-7)
        assert work(law, [(0.0, 0.0), (0.0, 0.05)]) == pytest.approx(1.719, rel=1e-7)


def test_the_work_to_break_depends_on_the_way() -> None:
    """Shear to 0.01 mm, opening to separation, and back: more than opening alone, so that there is no potential."""
    there_and_back = [(0.0, 0.0), (0.0, 0.01), (0.08, 0.01), (0.08, 0.0), (0.04, 0.0)]
    assert work(peek(1e6), there_and_back) == pytest.approx(1.263735, abs=2e-6)
    opened_first = [(0.0, 0.0), (0.08, 0.0), (0.08, 0.01)]
    assert work(peek(1e6), opened_first) == pytest.approx(0.969, rel=1e-7)


def test_one_mode_all_along_costs_the_energy_of_the_criterion() -> None:
    for criterion in (SOFT, PowerCriterion(0.5, 0.9, 1.0), PowerCriterion(0.5, 0.9, 1.6)):
        law = ModeDependentGlue(30.0, 45.0, 1e4, criterion).at(None)
        ratio = float(law.ratio[0])
        for mode in (0.2, 0.5, 0.9):
            way = np.array([np.sqrt(1.0 - mode), np.sqrt(mode) / ratio])
            assert work(law, [(0.0, 0.0), tuple(0.2 * way)]) == pytest.approx(
                float(criterion.energy(np.array([mode]))[0][0]), rel=1e-6
            )
    linear = PowerCriterion(0.5, 0.9, 1.0).energy(np.array([0.5]))[0][0]
    assert linear == pytest.approx(1.0 / (0.5 / 0.5 + 0.5 / 0.9), rel=1e-12)
    assert SOFT.energy(np.array([0.5]))[0][0] == pytest.approx(0.5 + 0.4 * 0.25, rel=1e-12)


def test_strengths_and_stiffnesses_are_those_stated() -> None:
    law = soft(2e4)
    small = 1e-6
    assert law.traction(np.array([[-small, 0.0]]))[0, 0] == pytest.approx(-1e4 * small, rel=1e-9)
    assert law.traction(np.array([[0.0, small]]))[0, 1] == pytest.approx(2e4 * small, rel=1e-9)
    grid = np.linspace(0.0, 0.05, 100_001)
    zero = np.zeros(grid.size)
    assert -law.traction(np.column_stack([-grid, zero]))[:, 0].min() == pytest.approx(30.0, rel=1e-3)
    assert law.traction(np.column_stack([zero, grid]))[:, 1].max() == pytest.approx(45.0, rel=1e-3)
    turon = soft()
    assert float(turon.ratio[0]) ** 2 == pytest.approx(0.5 / 0.9 * (45.0 / 30.0) ** 2, rel=1e-12)


@pytest.mark.parametrize("criterion", [SOFT, PowerCriterion(0.5, 0.9, 1.5), PowerCriterion(0.9, 0.5, 2.0)])
def test_rates_by_the_mode_are_derivatives(criterion: BenzeggaghKenane | PowerCriterion) -> None:
    mode, step = np.linspace(0.05, 0.95, 19), 1e-6
    first, second = np.array([0.003]), np.array([0.004])
    for of in (criterion.energy, lambda b: criterion.onset(b, first, second)):
        slope = (of(mode + step)[0] - of(mode - step)[0]) / (2.0 * step)
        assert of(mode)[1] == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize("shear_stiffness", [None, 3e4])
def test_tractions_change_no_faster_than_the_constants_say(shear_stiffness: float | None) -> None:
    """Pairs of states, near to each other and far apart: the frozen tractions of one place differ by L at most."""
    random = np.random.default_rng(8)
    law = soft(shear_stiffness)
    limit, steepest = float(law.lipschitz[0]), 0.0
    low = float(law.least_damage[0])
    for size in (1e-5, 1e-3, 1e-1, 3.0):
        one = random.uniform(-1.0, 1.0, (4000, 2)) * low * 10.0 ** random.uniform(-1.0, 1.0, (4000, 1))
        two = one + random.normal(size=one.shape) * size * low
        v = np.abs(random.uniform(-1.0, 1.0, one.shape)) * [-1.0, 1.0] * 0.05
        forces = [law.frozen(state, state).linearise(v).gradient for state in (one, two)]
        apart = np.linalg.norm(one - two, axis=1)
        steepest = max(steepest, float((np.linalg.norm(forces[0] - forces[1], axis=1) / apart).max()))
    assert 0.15 * limit <= steepest <= limit
    for mode in np.linspace(0.0, 1.0, 7):
        frozen = law.at_mode(float(mode))
        assert (frozen.weak_convexity[0] <= law.weak_convexity[0] * (1.0 + 1e-12)).all()
        assert (frozen.weak_convexity[1] <= law.weak_convexity[1] * (1.0 + 1e-12)).all()


def test_a_benzeggagh_kenane_exponent_below_one_has_no_lipschitz_constant() -> None:
    law = ModeDependentGlue(30.0, 45.0, 1e4, BenzeggaghKenane(0.5, 0.9, 0.8)).at(None)
    assert np.isinf(law.lipschitz).all()
    same = ModeDependentGlue(30.0, 30.0, 1e4, BenzeggaghKenane(0.5, 0.5, 0.8)).at(None)
    assert (same.lipschitz == 0.0).all()  # one energy, one strength: the mode is of no effect


# ---- solutions ----------------------------------------------------------------------------------------------


def by_hand(w: float, s: float, ratio: float) -> Array:
    """Tractions of soft glue at the opening w > 0 and the slip s > 0, written out."""
    rho = np.hypot(w, ratio * s)
    mode = (ratio * s / rho) ** 2
    first, second = 30.0 / 1e4, 45.0 / (ratio * 1e4)
    onset = np.sqrt(first**2 + (second**2 - first**2) * mode**2)
    last = 2.0 * (0.5 + 0.4 * mode**2) / (1e4 * onset)
    pull = 1e4 * rho if rho <= onset else 1e4 * onset * max(last - rho, 0.0) / (last - onset)
    return np.array([pull / rho * w, ratio**2 * pull / rho * s])


@pytest.mark.parametrize("load", [(60.0, 30.0), (40.0, 60.0), (20.0, 75.0), (90.0, 90.0)])
def test_a_point_on_springs_is_the_root_of_its_equations(load: tuple[float, float]) -> None:
    law, springs = soft(), 5000.0
    ratio = float(law.ratio[0])
    found = hv.solve(opened_point(springs, load, law))
    assert found.status.name == "CONVERGED"
    w, s = found.local[0] * [-1.0, 1.0]

    def balance(x: Array) -> Array:
        return springs * x + by_hand(x[0], x[1], ratio) - np.array(load)

    assert np.abs(balance(np.array([w, s]))).max() <= 1e-8 * max(load)
    root = fsolve(balance, np.array(load) / (springs + 1e4), xtol=1e-13)
    assert found.local[0] * [-1.0, 1.0] == pytest.approx(root, rel=1e-8)


@pytest.mark.parametrize(("strength", "shear"), [(0.4, 1.5), (1.2, 0.4)])
def test_a_chart_is_as_stiff_in_either_direction_as_the_steeper_one_needs(strength: float, shear: float) -> None:
    law = ModeDependentGlue(strength, shear, 20.0, BenzeggaghKenane(0.05, 0.1, 2.0)).at(None)
    least = np.stack([alpha + law.lipschitz for alpha in law.weak_convexity], axis=1)
    assert least.max() > 1.02 * least.min()
    between, above = 1.01 * least, np.full((1, 2), 1.01 * least.max())
    assert not is_curve(law, between, 2)
    assert is_curve(law, above, 2)
    p = np.array([[-3.0, 1.0]])
    on = law.on_graph(p, above)
    np.testing.assert_allclose(above * on.r + on.multiplier, p, rtol=1e-12)
    with pytest.raises(hv.errors.ProblemError, match="is a curve for stiffnesses above"):
        law.on_graph(p, between)


def test_a_body_is_solved_by_newtons_method() -> None:
    found = hv.solve(glued_plate(soft(), PULL))
    again = hv.solve(glued_plate(soft(), PULL), hv.solvers.FixedPoint(hv.solvers.NonsmoothMultigrid(), relaxation=0.8))
    assert found.status.name == again.status.name == "CONVERGED"
    assert found.method == "semismooth-newton"
    assert again.local == pytest.approx(found.local, abs=1e-8 * np.abs(found.local).max())
    law = soft()
    assert np.abs(law.traction(found.local) - found.multiplier).max() <= 1e-8 * np.abs(found.multiplier).max()
    assert found.debonding["damage"].max() > 0.0
    assert "softening" in found.states.names[0] or "debonded" in found.states.names[0]
    assert not is_convex(found.problem.law)


@pytest.mark.parametrize(("load", "damage"), [((25.0, 25.0), 0.0), ((40.0, 40.0), 0.5), ((50.0, 50.0), 0.8)])
def test_newtons_equation_contains_the_mode(load: tuple[float, float], damage: float) -> None:
    """In a few rounds it is where the fixed point is after ten times as many looks, condensed or on all unknowns."""
    problem = hv.discretize(glued_plate(soft(), load))
    fixed = hv.solve(problem, hv.solvers.FixedPoint(hv.solvers.NonsmoothNewton().local_descent()))
    for method in (None, "newton", "multigrid"):
        found = hv.solve(problem, method)
        assert found.status.name == "CONVERGED"
        assert found.fallbacks == 0
        assert found.local == pytest.approx(fixed.local, abs=1e-7 * np.abs(fixed.local).max())
        assert found.steps <= 10
    assert float(fixed.debonding["damage"].max()) >= damage


def test_in_space_newtons_method_is_the_fixed_point() -> None:
    stated = hv.ContactProblem(
        hv.box((1.0, 0.5, 0.5), (4, 2, 2)),
        hv.Material.young(3000.0, 0.3),
        {"bottom": hv.Contact(soft())},
        {"left": hv.Clamped()},
        tractions={"top": (20.0, 10.0, 25.0)},
    )
    problem = hv.discretize(stated)
    found, fixed = (
        hv.solve(problem),
        hv.solve(problem, hv.solvers.FixedPoint(hv.solvers.NonsmoothNewton().local_descent())),
    )
    assert found.method == "semismooth-newton"
    assert found.fallbacks == 0
    assert found.debonding["damage"].max() > 0.1
    assert found.local == pytest.approx(fixed.local, abs=1e-7 * np.abs(fixed.local).max())


def test_a_body_that_is_not_linear_keeps_the_fixed_point() -> None:
    stated = hv.ContactProblem(
        hv.rectangle((1.0, 0.5), (4, 2)),
        hv.Material.ramberg_osgood(3000.0, 0.3, 60.0, 4.0),
        {"bottom": hv.Contact(soft())},
        {"left": hv.Clamped()},
        tractions={"top": (20.0, 20.0)},
    )
    found = hv.solve(stated)
    assert found.status.name == "CONVERGED"
    assert found.method.startswith("fixed-point(")


def test_a_step_of_newtons_method_across_a_barrier_is_taken_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Glue that holds from rest is not found broken, though the broken state is an equilibrium too."""
    problem, step = opened_point(500.0, (20.0, 1.0), soft()), GraphEquation.step

    def leap(self: GraphEquation, at: GraphPoint, accuracy: Accuracy) -> tuple[Array, Array, int] | None:
        far = np.array([[-0.04, 0.002]])
        if np.abs(at.r).max() > 0.01:
            return step(self, at, accuracy)
        return far, self.system.out_of_balance(far), 1

    monkeypatch.setattr(GraphEquation, "step", leap)
    found = hv.solve(problem)
    assert found.status.name == "CONVERGED"
    assert found.fallbacks == 1
    assert found.local[0, 0] == pytest.approx(-20.0 / 10500.0, rel=1e-6)
    broken = hv.solve(problem, initial=np.array([-0.04, 0.002]))
    assert broken.local[0, 0] == pytest.approx(-20.0 / 500.0, rel=1e-6)


def test_glue_that_a_load_tears_is_not_searched_by_halved_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """|F| creeps where it lets go: each look at it is a mode sought for every point."""
    looks, at = [0], GraphEquation.at

    def counted(self: GraphEquation, x: Array, force: Array | None = None) -> GraphPoint | None:
        looks[0] += 1
        return at(self, x, force)

    monkeypatch.setattr(GraphEquation, "at", counted)
    torn = hv.ContactProblem(
        hv.rectangle((2.0, 1.0), (32, 16), pattern="right"),
        hv.Material.lame(4.0, 4.0),
        {"bottom": hv.Contact(ModeDependentGlue(0.5, 0.6, 24.0, BenzeggaghKenane(0.01, 0.02, 2.0)))},
        {"left": hv.Clamped()},
        body_force=(0.9, 1.2),
    )
    found = hv.solve(torn)
    assert found.method == "semismooth-newton"
    assert found.fallbacks == 1
    assert found.debonding["damage"].max() == 1.0
    assert looks[0] <= 12
    fixed = hv.solve(torn, hv.solvers.FixedPoint(hv.solvers.NonsmoothNewton()))
    assert found.local == pytest.approx(fixed.local, abs=1e-7 * np.abs(fixed.local).max())


def test_a_stiff_body_has_a_margin_with_the_lipschitz_constant_in_it() -> None:
    """The coupling is L times the largest eigenvalue of the trace over the stiffness, here L/springs; sampled."""
    law = soft()
    springs = 2.0 * float(law.lipschitz[0])
    problem = opened_point(springs, (10.0, 10.0), law)
    found = hv.certificates.smallness(problem)
    assert found.m_L == pytest.approx(float(law.lipschitz[0]), rel=1e-12)
    assert found.coupling == pytest.approx(0.5, rel=1e-9)
    alpha = max(float(part[0]) for part in law.weak_convexity)
    assert found.margin == pytest.approx(0.5 - alpha / springs, rel=1e-6)
    assert found.sampled
    certificate = hv.certify(hv.solve(problem))
    assert certificate.unique is not True
    assert hv.certify(hv.solve(opened_point(100.0, (10.0, 10.0), law))).margin < 0.0


def test_one_energy_and_strength_for_both_modes_is_mixed_mode() -> None:
    law = ModeDependentGlue(30.0, 30.0, 1e4, BenzeggaghKenane(0.5, 0.5, 2.0))
    one = MixedMode(hv.laws.BilinearCohesion(30.0, 0.5, 1e4))
    here, there = hv.solve(glued_plate(law, PULL)), hv.solve(glued_plate(one, PULL))  # type: ignore[arg-type]
    assert here.local == pytest.approx(there.local, abs=1e-9 * np.abs(there.local).max())


def test_laws_may_vary_over_the_boundary() -> None:
    law = ModeDependentGlue(
        lambda x: 30.0 * (1.0 + x[:, 0]), 45.0, 1e4, BenzeggaghKenane(0.5, lambda x: 0.9 + x[:, 0], 2.0)
    )
    assert hv.solve(glued_plate(law, PULL)).status.name == "CONVERGED"
    both = law.at(np.array([[0.0, 0.0], [1.0, 0.0]]))
    r = np.array([[-0.01, 0.003], [-0.01, 0.003]])
    for i in range(2):
        assert both.take(np.array([i])).traction(r[i : i + 1]) == pytest.approx(both.traction(r)[i : i + 1])


# ---- what is refused, files, the command ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: MixedMode(PEEK), "has two fracture energies, and a superpotential that debonds has "
        "one"),  # type: ignore[arg-type]
        (lambda: soft().value(np.zeros((1, 2))), "has no potential: a superpotential that debonds has one fracture"),
        (lambda: soft().local_argmin(np.ones((1, 2)), np.zeros((1, 2))), "has no potential"),
        (lambda: soft().local_minimiser(np.ones((1, 2)), np.zeros((1, 2)), np.zeros((1, 2))), "has no potential"),
        (lambda: ModeDependentGlue(80.0, 100.0, 1e6, "bk"), "the criterion of law 'mode-dependent' is "
        "'bk'"),  # type: ignore[arg-type]
        (lambda: ModeDependentGlue(0.0, 100.0, 1e6, PEEK).at(None), "strength of law 'mode-dependent' is 0"),
        (lambda: ModeDependentGlue(80.0, -1.0, 1e6, PEEK).at(None), "it must be positive"),
        (lambda: ModeDependentGlue(80.0, 100.0, np.nan, PEEK).at(None), "finite number"),
        (lambda: ModeDependentGlue(80.0, 100.0, 1e6, PEEK, 0.0).at(None), "shear_stiffness"),
        (lambda: ModeDependentGlue(80.0, 100.0, 1e3, PEEK).at(None), "less than is stored at the strength"),
        (lambda: ModeDependentGlue(80.0, 100.0, 1e6, PEEK, compression=Softening(2.0, 0.1, 0.5)).at(None), "not con"),
        (lambda: ModeDependentGlue(80.0, 100.0, 1e6, PEEK, compression=3.0), "the compression"),  # type: ignore[arg-type]
        (lambda: BenzeggaghKenane(0.0, 1.0, 2.0), "opening of criterion 'benzeggagh-kenane' is 0"),
        (lambda: BenzeggaghKenane(1.0, 1.0, -2.0), "exponent of criterion"),
        (lambda: PowerCriterion(1.0, "much", 1.0), "shear of criterion 'power'"),  # type: ignore[arg-type]
        (lambda: peek().at_mode(1.5), "give a number between 0"),
        (lambda: hv.Contact(soft(), Tresca(0.3)), "leave the friction 'tresca' out"),
    ],
)  # fmt: skip
def test_bad_input_is_named(make: Callable[[], object], words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words):
        make()
