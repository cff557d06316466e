"""Friction bounds that depend on the solution, inside Newton's equation of all unknowns."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.laws import Compliance, CoulombBound, PenetrationBound, Signorini, SlipWeakening, Superpotential, Tresca
from hemivar.laws.friction import Friction
from hemivar.laws.vector_law import spread
from hemivar.linear.krylov import minimal_residuals
from hemivar.solvers import Controls, FixedPoint, NonsmoothMultigrid, SemismoothNewton, Solution, Status, solve
from hemivar.systems import condense
from hemivar.systems.body_on_levels import set_up
from hemivar.systems.dense_newton import DenseNewton
from hemivar.systems.newton_equation import Accuracy, LinearisedPoint
from hemivar.systems.workspace import Workspace
from tests.samples import slow

from .pieces_of_friction import random_points
from .test_semismooth import bounce

WHOLE = SemismoothNewton(FixedPoint(NonsmoothMultigrid()))


def pressed_and_drawn(
    dim: int, n: int, normal: Superpotential, friction: Friction, scale: float = 1.0
) -> DiscreteProblem:
    """A block that is pressed on its foundation and drawn along it; lengths and stresses in units of ``scale``."""
    return hv.discretize(
        hv.ContactProblem(
            mesh=hv.rectangle((2.0, 1.0), (2 * n, n), "cross") if dim == 2 else hv.box((1.0, 1.0, 1.0), n),
            material=hv.Material.lame(4.0 * scale, 4.0 * scale),
            supports={"left": hv.Clamped()} if dim == 2 else {"top": hv.Fixed(x=0.02, y=0.0, z=-0.1)},
            contact={"bottom": hv.Contact(normal, friction)},
            body_force=(-1.2 * scale, -0.9 * scale) if dim == 2 else (0.3 * scale, 0.2 * scale, -0.5 * scale),
        )
    )


def energy_distance(found: Solution, other: Solution) -> float:
    """Relative, in the energy norm."""
    K, off = found.problem.stiffness, found.unknowns - other.unknowns
    return float(np.sqrt((off @ (K @ off)) / (other.unknowns @ (K @ other.unknowns))))


@pytest.mark.parametrize(
    ("dim", "n", "normal", "weakens"),
    [
        (2, 16, Signorini(), True),
        (3, 6, Compliance(20.0), False),
        slow(2, 16, Signorini(), False),
        slow(2, 16, Compliance(20.0), False),
        slow(2, 16, Compliance(20.0), True),
        slow(3, 6, Signorini(), False),
        slow(3, 6, Signorini(), True),
        slow(3, 6, Compliance(20.0), True),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_all_methods_agree_and_cycles_are_few(dim: int, n: int, normal: Superpotential, weakens: bool) -> None:
    """Coulomb's law costs about twice the cycles of Tresca's, where the fixed point takes one such solve a round."""
    bound = CoulombBound(0.3)
    problem = pressed_and_drawn(dim, n, normal, SlipWeakening(bound, 1.0, 0.8, 5.0) if weakens else Tresca(bound))
    tight = Controls(rtol=1e-11)
    found = solve(problem, WHOLE, tight)
    assert found.status is Status.CONVERGED
    assert found.method == "semismooth-multigrid"
    assert found.fallbacks == 0
    assert energy_distance(found, solve(problem, SemismoothNewton(), tight)) < 1e-9
    assert energy_distance(found, solve(problem, FixedPoint(), Controls(rtol=1e-10))) < 1e-8
    slips = np.linalg.norm(found.slip, axis=1) > 1e-9
    assert (slips & (found.pressure > 1e-9)).any()  # friction is at its bound somewhere
    usual = solve(problem, WHOLE)
    frozen = solve(problem.with_(law=problem.law.frozen(found.local, found.multiplier)), NonsmoothMultigrid())
    rounds = solve(problem, FixedPoint(NonsmoothMultigrid()))
    assert usual.evaluations <= 3.0 * frozen.evaluations
    assert usual.evaluations <= 0.5 * rounds.evaluations


@pytest.mark.parametrize("dim", [2, 3])
def test_cycles_do_not_grow_with_the_mesh(dim: int) -> None:
    cycles = [
        solve(pressed_and_drawn(dim, n, Signorini(), Tresca(CoulombBound(0.3))), WHOLE).evaluations
        for n in ((8, 16, 32) if dim == 2 else (6, 12))
    ]
    assert max(cycles) <= 1.5 * min(cycles) + 3


def test_units_change_nothing() -> None:
    one, mega = (
        solve(pressed_and_drawn(2, 8, Signorini(), Tresca(CoulombBound(0.3)), scale), WHOLE) for scale in (1.0, 1e6)
    )
    np.testing.assert_allclose(one.local, mega.local, rtol=1e-9, atol=1e-12)
    assert one.evaluations == mega.evaluations


def test_a_bound_that_follows_the_penetration() -> None:
    problem = pressed_and_drawn(2, 8, Compliance(20.0), Tresca(PenetrationBound("8*max(s, 0) + s^2")))
    found = solve(problem, WHOLE)
    assert found.status is Status.CONVERGED
    assert found.fallbacks == 0
    assert energy_distance(found, solve(problem, SemismoothNewton())) < 1e-8


def test_random_points_with_one_solution_end_there() -> None:
    """Against enumeration of all states of the points."""
    other = alone = 0
    for seed in range(25):
        problem, points = random_points(seed, 3)
        exact = points.solutions()
        if len(exact) > 1:
            continue
        found = solve(problem, WHOLE)
        assert found.status is Status.CONVERGED, seed
        size = np.abs(exact[0]).max() + 1e-3 * np.abs(points.b).max()
        np.testing.assert_allclose(found.local, exact[0], atol=1e-7 * size, err_msg=str(seed))
        alone, other = alone + 1, other + (found.fallbacks > 0)
    assert alone >= 15
    assert other <= 3


@pytest.mark.parametrize("weakens", [False, True])
@pytest.mark.parametrize("normal", [Signorini(), Compliance(20.0)], ids=lambda law: law.name)
@pytest.mark.parametrize("dim", [2, 3])
def test_the_equation_of_all_unknowns_is_that_of_the_condensed_body(
    dim: int, normal: Superpotential, weakens: bool
) -> None:
    """Where the inside is in equilibrium, both change the contact points by the same, and leave the inside there."""
    bound = CoulombBound(0.3)
    problem = pressed_and_drawn(dim, 4, normal, SlipWeakening(bound, 1.0, 0.8, 5.0) if weakens else Tresca(bound))
    system, body = condense(problem), set_up(problem, Workspace())
    chart, stiffness = problem.law.chart(1.0 / system.compliance, dim), spread(1.0 / system.compliance, dim)
    assert chart is not None
    random = np.random.default_rng(1)
    r = solve(problem).local + 2e-3 * random.normal(size=system.shape)
    r = np.where(system.active, r, system.fixed)
    on = chart.at(stiffness * r + system.multiplier(r), r)
    place = np.where(system.active, on.r, system.fixed)
    at = LinearisedPoint.on_graph(system, place, system.out_of_balance(place), on, stiffness)
    assert at.pushed is not None
    assert at.pushed.any() or at.blocks[:, 1:, 0].any()  # it is not symmetric
    dense = DenseNewton(system).solve(at, Accuracy(0.0, 0.0, 1)).step
    x = system.unknowns(place)
    equation = body.newton_equation()
    there = LinearisedPoint.on_graph(body, x, body.out_of_balance(x), on, stiffness)
    step = equation.solve(there, Accuracy(1e-13, 0.0, 40)).step
    equation.release()
    np.testing.assert_allclose(body.at_contact(step), dense, atol=1e-9 * np.abs(dense).max())
    left = body.less_contact(body.out_of_balance(x + step), body.at_contact(body.out_of_balance(x + step)))
    assert np.abs(left).max() <= 1e-10 * np.abs(problem.load).max()


def test_without_a_derivative_the_fixed_point_takes_over() -> None:
    def ramp(s: Array) -> Array:
        return np.asarray(0.5 * np.maximum(s, 0.0))

    problem = pressed_and_drawn(2, 8, Compliance(20.0), Tresca(PenetrationBound(ramp)))
    found = solve(problem, WHOLE)
    assert found.status is Status.CONVERGED
    assert found.fallbacks == 1
    assert energy_distance(found, solve(problem, FixedPoint())) < 1e-7


def test_a_solve_that_is_stopped_gives_its_levels_back() -> None:
    problem, kept = pressed_and_drawn(2, 16, Signorini(), Tresca(CoulombBound(0.3))), Workspace()
    stopped = solve(problem, WHOLE, Controls(max_time=0.0), workspace=kept)
    assert stopped.status is Status.MAX_TIME
    again, new = solve(problem, WHOLE, workspace=kept), solve(problem, WHOLE)
    np.testing.assert_array_equal(again.unknowns, new.unknowns)


def test_a_march_is_that_of_the_condensed_body() -> None:
    evolution = bounce(2, Tresca(CoulombBound(0.3)))
    found = hv.march(evolution, 0.12, step=0.015, method=WHOLE, controls=Controls(rtol=1e-10))
    condensed = hv.march(evolution, 0.12, step=0.015, controls=Controls(rtol=1e-10))
    assert found.finished
    assert (found["fallbacks"] == 0).all()
    assert found["friction"][-1] > 0.0
    for name in ("elastic", "kinetic", "friction", "normal_force", "friction_force"):
        np.testing.assert_allclose(
            found[name], condensed[name], atol=1e-7 * np.abs(condensed[name]).max(), err_msg=name
        )


# ---- minimal residuals ---------------------------------------------------------------------------------------


def test_minimal_residuals_are_those_of_least_squares() -> None:
    """After k steps the residual is the least of all vectors of the Krylov space, found by dense least squares."""
    random = np.random.default_rng(0)
    n = 12
    A, b = random.normal(size=(n, n)) + 4.0 * np.eye(n), random.normal(size=n)
    M = np.diag(random.uniform(0.5, 2.0, n))
    for k in (1, 3, 6):
        found, iterations = minimal_residuals(lambda v: A @ v, b, lambda v: M @ v, 0.0, k)
        assert iterations == k
        basis = np.stack([np.linalg.matrix_power(M @ A, i) @ (M @ b) for i in range(k)], axis=1)
        least = np.linalg.norm(b - A @ basis @ np.linalg.lstsq(A @ basis, b, rcond=None)[0])
        assert np.linalg.norm(b - A @ found) == pytest.approx(least, rel=1e-9)
    exact, _ = minimal_residuals(lambda v: A @ v, b, lambda v: M @ v, 1e-12, 40)
    np.testing.assert_allclose(exact, np.linalg.solve(A, b), rtol=1e-9)


def test_minimal_residuals_end_at_once_where_there_is_nothing_to_do() -> None:
    nothing, iterations = minimal_residuals(lambda v: v, np.zeros(3), lambda v: v, 0.0, 5)
    assert iterations == 0
    assert not nothing.any()
    late, iterations = minimal_residuals(lambda v: v + 0.5 * v[::-1], np.arange(3.0), lambda v: v, 0.0, 5, lambda: 1.0)
    assert iterations == 1
    assert late.any()
