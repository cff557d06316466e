"""Friction bounds that depend on the solution, inside Newton's equation."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.initial import initial_state
from hemivar.evolution.stepper import TimeStepper
from hemivar.laws import (
    Adhesive,
    Compliance,
    ContactLaw,
    CoulombBound,
    Friction,
    PenetrationBound,
    Signorini,
    SlipWeakening,
    StateBound,
    StaticKinetic,
    Superpotential,
    Tresca,
)
from hemivar.laws.friction.bounds import stack_bounds
from hemivar.solvers import Controls, FixedPoint, LoadStepping, NonsmoothNewton, SemismoothNewton, Status, solve
from hemivar.solvers.newton_on_graph import NewtonCache, active_set_newton
from hemivar.solvers.solve import suited
from hemivar.systems.condensed import CondensedProblem, condense
from hemivar.systems.newton_equation import Accuracy
from tests import bodies

from .pieces_of_friction import points_of, random_points


def in_space(seed: int, normal: Superpotential, friction: Friction, m: int = 4) -> DiscreteProblem:
    """Some points in space on any elastic body, pushed down and sideways."""
    random = np.random.default_rng(seed)
    root = random.normal(size=(3 * m, 3 * m))
    A = root @ root.T / (3 * m) + np.diag(random.uniform(0.2, 1.0, size=3 * m))
    load = random.normal(size=3 * m)
    load[::3] += 1.0
    law = ContactLaw(normal, friction)
    return DiscreteProblem.of_arrays(A, load, np.eye(3 * m), random.uniform(0.5, 2.0, size=m), np.zeros(m), law)


# ---- the one solution ----------------------------------------------------------------------------------------


def against_enumeration(seeds: range, most: int) -> tuple[int, int]:
    """How many problems have one solution, and how many of them took another way than Newton's equation alone."""
    alone = other = 0
    for seed in seeds:
        problem, points = random_points(seed, most)
        found, exact = solve(problem), points.solutions()
        assert exact, seed
        if len(exact) > 1:
            continue
        assert found.status is Status.CONVERGED, seed
        assert found.method == "semismooth-newton"
        size = np.abs(exact[0]).max() + 1e-3 * np.abs(points.b).max()  # stiffnesses are about 1
        np.testing.assert_allclose(found.local, exact[0], atol=1e-8 * size, err_msg=str(seed))
        alone, other = alone + 1, other + (found.fallbacks > 0)
    return alone, other


def test_random_problems_with_one_solution_end_there() -> None:
    alone, other = against_enumeration(range(40), 2)
    assert alone >= 38
    assert other <= 4


@pytest.mark.slow
def test_many_random_problems_with_one_solution_end_there() -> None:
    """One of them needs the bound raised in parts."""
    alone, other = against_enumeration(range(100, 300), 3)
    assert alone >= 190
    assert 1 <= other <= 6


def random_steps(seed: int, steps: int = 4) -> tuple[int, int]:
    """A block that falls, slides and lifts: its steps with one solution, and those that took another way."""
    random = np.random.default_rng(seed)
    mu, stiffness = float(random.uniform(0.1, 1.5)), None if seed % 2 else float(random.choice([5.0, 200.0]))
    normal = Signorini() if stiffness is None else Compliance(stiffness)
    lame, pull = random.uniform(1.0, 10.0, size=2), random.normal(size=2)
    push, gap = float(random.normal()), float(random.choice([0.0, 0.02]))
    problem = bodies.strip(
        hv.Contact(normal, Tresca(CoulombBound(mu)), gap=gap),
        (2, 1),
        size=(1.0, 0.5),
        lame=tuple(lame),
        density=1.0,
        viscosity=(0.1, 0.1),
        supports={},
        body_force=(push, -1.0),
        tractions={"top": tuple(pull)},
    )
    evolution = hv.Evolution(problem, inertia=True, velocity=tuple(random.normal(size=2)))
    discrete = discretize_evolution(evolution)
    advance = TimeStepper.of(discrete, hv.evolution.ImplicitEuler(), None, Controls())
    state, alone, other = initial_state(advance), 0, 0
    for _ in range(steps):
        taken = advance.take(state, float(random.choice([0.01, 0.1, 0.5])))
        stage, found = taken.stages[0], taken.solutions[0]
        exact = points_of(stage.problem, mu, stiffness).solutions()
        if len(exact) == 1:
            assert taken.status is Status.CONVERGED, seed
            size = np.abs(exact[0]).max() + np.abs(stage.problem.offset).max()
            np.testing.assert_allclose(found.local, exact[0], atol=1e-7 * size, err_msg=str(seed))
            alone, other = alone + 1, other + (found.fallbacks > 0)
        state = taken.state
    return alone, other


def test_random_steps_with_one_solution_end_there() -> None:
    alone, other = np.sum([random_steps(seed) for seed in range(6)], axis=0)
    assert alone >= 22
    assert other <= 2


@pytest.mark.slow
def test_many_random_steps_with_one_solution_end_there() -> None:
    alone, other = np.sum([random_steps(seed) for seed in range(100, 130)], axis=0)
    assert alone >= 110
    assert other <= 6


@pytest.mark.parametrize(
    "normal", [Signorini(), Compliance(20.0), Adhesive(24.0, 0.5, 0.1, 0.2)], ids=lambda law: law.name
)
@pytest.mark.parametrize("mu", [0.2, 0.5])
def test_in_space_friction_is_against_the_slip(normal: Superpotential, mu: float) -> None:
    """The cone is a ball of the pressure times mu, whatever the direction; and it is what the fixed point finds."""
    slipped = 0
    for seed in range(3):
        problem = in_space(seed, normal, Tresca(CoulombBound(mu)))
        found, frozen = solve(problem), solve(problem, FixedPoint())
        assert found.status is Status.CONVERGED
        slip, force = found.local[:, 1:], found.multiplier[:, 1:]
        bound = mu * np.maximum(found.multiplier[:, 0], 0.0)
        moves = np.linalg.norm(slip, axis=1) > 1e-8
        assert (np.linalg.norm(force, axis=1) <= bound * (1.0 + 1e-9) + 1e-12).all()
        direction = slip[moves] / np.linalg.norm(slip[moves], axis=1)[:, None]
        np.testing.assert_allclose(force[moves], bound[moves, None] * direction, atol=1e-7)
        slipped += int(np.count_nonzero(moves & (bound > 0.0)))
        if frozen.status is Status.CONVERGED:
            np.testing.assert_allclose(found.local, frozen.local, atol=1e-7)
    assert slipped >= 3


@pytest.mark.parametrize("weakens", [False, True])
@pytest.mark.parametrize("bound", [CoulombBound(0.4), PenetrationBound("0.3*s + s^2")], ids=["pressure", "penetration"])
@pytest.mark.parametrize("normal", [Signorini(), Compliance(3.0)], ids=["rigid", "compliant"])
@pytest.mark.parametrize("dim", [2, 3])
def test_newtons_equation_is_the_derivative(dim: int, normal: Superpotential, bound: StateBound, weakens: bool) -> None:
    """Near a solution the step of Newton's equation from a place off it is second order: it is exact to the square."""
    problem = in_space(3, normal, SlipWeakening(bound, 1.0, 0.6, 2.0) if weakens else Tresca(bound))
    if dim == 2:
        keep = np.arange(12) % 3 != 2
        A = problem.stiffness.toarray()[np.ix_(keep, keep)]
        load = problem.load[keep]
        problem = DiscreteProblem.of_arrays(A, load, np.eye(8), problem.contact.weights, np.zeros(4), problem.law)
    exact = solve(problem, controls=Controls(rtol=1e-13))
    assert exact.status is Status.CONVERGED
    system = condense(problem)
    way = np.random.default_rng(0).normal(size=exact.local.shape)
    left = [float(np.abs(newton_step(system, exact.local + size * way) - exact.local).max()) for size in (1e-4, 1e-6)]
    assert left[0] <= 1e-6
    assert left[1] <= max(3e-4 * left[0], 3e-12)


def newton_step(system: CondensedProblem, r: Array) -> Array:
    """Where Newton's equation at r leads."""
    equation = NewtonCache().equation(system)
    assert equation is not None
    point = equation.at(r)
    assert point is not None
    found = equation.step(point, Accuracy(0.0, 0.0, 1))
    assert found is not None
    return found[0]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("normal", [Signorini(), Adhesive(24.0, 0.05, 0.5, 0.2)], ids=lambda law: law.name)
def test_where_supports_hold_contact_points_in_a_direction(dim: int, normal: Superpotential) -> None:
    """Rollers on the side meet the foundation at a corner or an edge; the top is pushed down, the side pulled."""
    pressed = hv.Fixed(y=-0.1) if dim == 2 else hv.Fixed(y=0.0, z=-0.1)
    problem = hv.discretize(
        bodies.body(
            hv.rectangle((1.0, 1.0), (6, 6)) if dim == 2 else hv.box((1.0, 1.0, 1.0), (3, 3, 3)),
            hv.Contact(normal, Tresca(CoulombBound(0.3))),
            supports={"left": hv.Roller(), "top": pressed},
            tractions={"right": (0.5, 0.0) if dim == 2 else (0.5, 0.2, 0.0)},
        )
    )
    assert not condense(problem).active.all()
    found, frozen = solve(problem), solve(problem, FixedPoint())
    assert found.status is Status.CONVERGED
    assert found.fallbacks == 0
    np.testing.assert_allclose(found.local, frozen.local, atol=1e-9)
    np.testing.assert_allclose(found.multiplier, frozen.multiplier, atol=1e-7)


def test_where_a_support_holds_the_normal_direction_the_bound_stays() -> None:
    """At the corner the side is held at a jump of the law, whose least pressure, 0.2, bounds the friction there."""
    problem = hv.discretize(
        bodies.square(
            hv.Contact(hv.table_law([0.0, 0.0], [0.2, 0.5]), Tresca(CoulombBound(0.3))),
            4,
            supports={"left": hv.Fixed(y=0.0), "top": hv.Fixed(x=0.0, y=0.0)},
            tractions={"right": (0.5, -0.5)},
        )
    )
    found, corner = solve(problem), np.flatnonzero(~condense(problem).active[:, 0])
    assert found.status is Status.CONVERGED
    assert found.fallbacks == 0
    assert found.local[corner, 1] > 1e-3
    np.testing.assert_allclose(found.multiplier[corner], [[0.2, 0.06]], atol=1e-9)
    np.testing.assert_allclose(found.local, solve(problem, FixedPoint()).local, atol=1e-9)


# ---- bounds --------------------------------------------------------------------------------------------------

BOUNDS = {
    "coulomb": CoulombBound(0.3),
    "table": PenetrationBound(([-0.1, 0.0, 0.5, 0.7], [0.0, 0.0, 0.4, 0.1])),
    "formula": PenetrationBound("min(8*s, 0.8) + max(0, s)^2"),
    "several": stack_bounds([(CoulombBound(0.2), 4), (np.array([0.7]), 3), (PenetrationBound("s^2"), 4)]),
}


@pytest.mark.parametrize("name", BOUNDS)
def test_derivatives_of_bounds(name: str) -> None:
    bound, step = BOUNDS[name], 1e-6
    s, p = np.linspace(-0.33, 1.21, 11), np.linspace(-1.0, 2.0, 11)[::-1]
    in_s, in_p = bound.slopes(s, p)
    np.testing.assert_allclose(in_s, (bound.value(s + step, p) - bound.value(s - step, p)) / (2 * step), atol=1e-7)
    np.testing.assert_allclose(in_p, (bound.value(s, p + step) - bound.value(s, p - step)) / (2 * step), atol=1e-7)
    assert bound.differentiable


def test_what_has_no_derivative_keeps_the_fixed_point() -> None:
    """Python functions, jumps, profiles that fall at once; and a search that crosses no barrier."""
    problem = in_space(0, Compliance(20.0), Tresca(CoulombBound(0.2)))
    jump = PenetrationBound(([0.0, 0.1, 0.1, 0.2], [0.0, 0.1, 0.3, 0.3]))
    for friction in (
        Tresca(PenetrationBound(lambda s: 0.1 * np.maximum(s, 0.0))),
        Tresca(jump),
        StaticKinetic(CoulombBound(0.2), 0.1),
    ):
        other = problem.with_(law=ContactLaw(Compliance(20.0), friction))
        assert suited(NonsmoothNewton(), other).name == "fixed-point(newton)"
    assert suited(NonsmoothNewton(), problem).name == "semismooth-newton"
    assert suited(NonsmoothNewton(search=hv.solvers.Search.DOWNHILL), problem).name == "fixed-point(newton)"
    python = PenetrationBound(lambda s: 0.1 * np.maximum(s, 0.0))
    with pytest.raises(hv.errors.ProblemError, match="derivatives"):
        python.slopes(np.zeros(1), np.zeros(1))


def reacting(bound: PenetrationBound) -> DiscreteProblem:
    """A bound that reacts 1.9 times on its penetration: ``r_n = 0.1 + 0.9 r_t``, ``r_t = 20 + 0.9 r_n - h``."""
    K = np.array([[1.0, -0.9], [-0.9, 1.0]])
    law = ContactLaw(hv.laws.PiecewiseQuadratic([0.0], [0.0, 0.0], [0.0]), Tresca(bound))
    return DiscreteProblem.of_arrays(K, np.array([0.1, 20.0]), np.eye(2), np.ones(1), np.zeros(1), law)


@pytest.mark.parametrize("source", ["0.4*max(s, 0)", ([0.0, 400.0], [0.0, 160.0])])
def test_a_bound_that_reacts_too_strongly_for_a_fixed_point(source: object) -> None:
    """Slipping ahead: ``r_t = 20 + 0.5 r_n`` and ``r_n = 0.1 + 0.9 r_t``, so ``r_n = 18.1/0.55``."""
    problem = reacting(PenetrationBound(source))  # type: ignore[arg-type]
    assert solve(problem, FixedPoint()).status is Status.NOT_CONTRACTING
    found = solve(problem)
    assert found.status is Status.CONVERGED
    assert found.fallbacks == 0
    assert found.local[0, 0] == pytest.approx(18.1 / 0.55, rel=1e-12)


def test_another_way_is_counted() -> None:
    """Where halved steps end, one step of the fixed point leads on; with one round only the fixed point itself does."""
    problem, points = random_points(198, 3)
    again = solve(problem)
    assert again.status is Status.CONVERGED
    assert again.fallbacks == 1
    assert again.contraction is None
    np.testing.assert_allclose(again.local, points.solutions()[0], atol=1e-8)
    problem = in_space(0, Signorini(), Tresca(CoulombBound(0.2)))
    few = solve(problem, SemismoothNewton(rounds=1))
    assert few.status is Status.CONVERGED
    assert few.fallbacks == 3
    np.testing.assert_allclose(few.local, solve(problem).local, atol=1e-8)
    python = problem.with_(law=ContactLaw(Signorini(), Tresca(PenetrationBound(lambda s: 0.0 * s + 0.1))))
    assert solve(python, SemismoothNewton()).fallbacks == 1


def test_what_softens_ends_where_the_method_inside_would_stay() -> None:
    """Three solutions, of which the middle one is a ridge: Newton's equation may lead there, and must not end there."""
    law = ContactLaw(Compliance(0.5), SlipWeakening(PenetrationBound(([0.0, 1.0], [0.0, 0.2])), 1.0, 0.5, 200.0))
    problem = DiscreteProblem.of_arrays(np.eye(2), np.array([1.0, 0.12]), np.eye(2), np.ones(1), np.zeros(1), law)
    for slip in np.linspace(0.0, 0.04, 6):
        found = solve(problem, initial=np.array([2.0 / 3.0, slip]))
        assert found.status is Status.CONVERGED
        curvature = 1.0 - 0.5 * 200.0 * 2.0 / 15.0 * np.exp(-200.0 * found.local[0, 1])
        assert found.local[0, 1] == 0.0 or curvature > 0.0


def test_nothing_ends_on_a_ridge() -> None:
    """Two points that slip together, joined by a spring stiffer than friction weakens: where ``0.12 - s`` first meets
    the friction is a solution from which the body slides away."""
    law = ContactLaw(Compliance(0.5), SlipWeakening(PenetrationBound(([0.0, 1.0], [0.0, 0.2])), 1.0, 0.5, 200.0))
    A = np.eye(4)
    A[np.ix_([1, 3], [1, 3])] += [[50.0, -50.0], [-50.0, 50.0]]
    load = np.array([1.0, 0.12, 1.0, 0.12])
    problem = DiscreteProblem.of_arrays(A, load, np.eye(4), np.ones(2), np.zeros(2), law)

    def force(s: float) -> float:
        return 0.12 - s - 2.0 / 15.0 * (0.5 + 0.5 * np.exp(-200.0 * s))

    ridge, valley = brentq(force, 0.0, 0.01, xtol=1e-15), brentq(force, 0.02, 1.0, xtol=1e-15)
    system = condense(problem)
    for slip, stands in ((ridge, False), (valley, True)):
        pair = np.full((2, 2), [2.0 / 3.0, slip]), np.full((2, 2), [1.0 / 3.0, 0.12 - slip])
        found = active_set_newton(system, *pair, Controls(), NewtonCache())
        assert (found is not None) is stands
        assert found is None or found.local[:, 1] == pytest.approx(valley, abs=1e-12)
        solution = solve(problem, initial=pair[0].ravel())
        assert solution.status is Status.CONVERGED
        assert solution.fallbacks == (0 if stands else 1)
        assert np.abs(solution.local[:, 1] - ridge).min() > 1e-3


def test_options_are_checked() -> None:
    with pytest.raises(hv.errors.ProblemError, match="fallback"):
        SemismoothNewton(NonsmoothNewton())  # type: ignore[arg-type]
    with pytest.raises(hv.errors.ProblemError, match="halvings"):
        SemismoothNewton(halvings=0)
    with pytest.raises(hv.errors.ProblemError, match="NonsmoothMultigrid"):
        SemismoothNewton(FixedPoint(LoadStepping(hv.solvers.NonsmoothMultigrid())))


# ---- in time -------------------------------------------------------------------------------------------------


def bounce(cells: int, friction: Friction) -> hv.Evolution:
    """A block that falls on a compliant foundation, bounces and rubs."""
    problem = bodies.strip(
        hv.Contact(Compliance(400.0), friction, gap=0.002),
        (2 * cells, cells),
        lame=(400.0, 400.0),
        density=1.0,
        viscosity=(0.2, 0.2),
        supports={},
        body_force=(0.0, -1.0),
    )
    return hv.Evolution(problem, inertia=True, velocity=(0.2, -0.1))


def test_a_march_is_that_of_the_fixed_point_and_says_how_it_was_solved() -> None:
    evolution = bounce(2, Tresca(CoulombBound(0.3)))
    found = hv.march(evolution, 0.12, step=0.015)
    frozen = hv.march(evolution, 0.12, step=0.015, method=FixedPoint())
    assert found.finished
    assert found["friction"][-1] > 0.0
    for name in ("elastic", "kinetic", "friction", "normal_force", "friction_force"):
        scale = np.abs(frozen[name]).max()
        np.testing.assert_allclose(found[name], frozen[name], atol=1e-7 * scale, err_msg=name)
    assert (found["fallbacks"] == 0).all()
    assert found["solver_steps"].mean() < 2.0
    assert found["solver_steps"].sum() < 0.7 * frozen["solver_steps"].sum()


def test_marches_without_coulomb_have_no_such_column() -> None:
    assert "fallbacks" not in hv.march(bounce(2, Tresca(0.3)), 0.02, step=0.01).columns
