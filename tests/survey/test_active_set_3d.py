"""Active sets where the slip is a vector: the plane's sets in a plane, and the default method's solution in space."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.laws import (
    ContactLaw,
    CoulombBound,
    Friction,
    Logarithmic,
    NoFriction,
    Signorini,
    SlipTable,
    SlipWeakening,
    Superpotential,
    ThresholdCompliance,
    Tresca,
)
from hemivar.laws.vector_law import spread
from hemivar.mechanics import Contact
from hemivar.solvers import NormalState, Status, TangentialState, solve
from hemivar.solvers.base import State
from hemivar.solvers.controls import Budget
from hemivar.solvers.solve import suited
from hemivar.survey import NewtonKrylov, PrimalDualActiveSet
from hemivar.survey.active_set import ExactInner, InnerSolver, RadialSets
from hemivar.systems import condense
from tests import bodies
from tests.samples import sampled

from ..mesh.meshes import cube
from ..problems import OTHER_DATA, SURVEY_DATA, discrete_square, relative_difference

#: Body force, normal law, friction.
CASES: dict[str, tuple[tuple[float, float, float], Superpotential, Friction]] = {
    "slips": ((-0.5, 0.3, -1.0), ThresholdCompliance(0.1, 10.0), Tresca(0.1)),
    "sticks in part": ((-0.8, 0.5, -0.8), ThresholdCompliance(0.3, 2.0), Tresca(0.7)),
    "sticks": ((-0.2, 0.1, -1.0), ThresholdCompliance(0.3, 2.0), Tresca(5.0)),
    "rigid": ((0.5, 0.2, -1.0), Signorini(), Tresca(0.3)),
    "lifting": ((-0.6, 0.2, 0.3), Signorini(), Tresca(0.05)),
    "without friction": ((0.5, 0.2, -1.0), Signorini(), NoFriction()),
    "weakening": ((0.5, 0.2, -1.0), ThresholdCompliance(0.3, 2.0), SlipWeakening(0.3)),
    "logarithmic": ((0.5, 0.2, -1.0), ThresholdCompliance(0.3, 2.0), Logarithmic(0.3)),
    "table with a knot at a slip": (
        (0.5, 0.2, -1.0),
        Signorini(),
        SlipTable(0.3, [0.0, 0.02, 0.1, 1.0], [1.0, 0.9, 0.7, 0.7]),
    ),
    "Coulomb": ((0.3, 0.2, -1.0), Signorini(), Friction(CoulombBound(0.4))),
}


def cube_of_case(case: str) -> DiscreteProblem:
    force, normal, friction = CASES[case]
    return discretize(bodies.body(cube(3), Contact(normal, friction), body_force=force))


@pytest.mark.parametrize(
    ("inner", "case"),
    sampled(itertools.product((ExactInner(), NewtonKrylov()), CASES), 3),
    ids=lambda value: value if isinstance(value, str) else type(value).__name__,
)
def test_the_default_method_agrees(case: str, inner: InnerSolver) -> None:
    problem = cube_of_case(case)
    expected = solve(problem)
    solver = PrimalDualActiveSet(inner)
    found = solve(problem, suited(solver, problem))
    assert found.status is expected.status is Status.CONVERGED
    assert relative_difference(found, expected) < 1e-8


def test_the_cases_hold_every_state() -> None:
    """A case that only slips would not test the sets."""
    sliding = solve(cube_of_case("sticks in part")).tangential_state
    assert {TangentialState.STICK, TangentialState.SLIP} <= set(sliding.tolist())
    assert (solve(cube_of_case("sticks")).tangential_state == TangentialState.STICK).all()
    assert (solve(cube_of_case("lifting")).normal_state == NormalState.OPEN).any()


@pytest.mark.parametrize("data", [*SURVEY_DATA, *(key for key in OTHER_DATA if key != "power")])
def test_a_third_direction_that_nothing_happens_in_changes_no_step(data: str) -> None:
    """The survey's problem beside an unloaded body without coupling: the sets go the same way as in the plane."""
    plane = discrete_square(data, 8)
    m, n = plane.contact_points, plane.unknowns
    zero = sp.csr_array((m, m))
    trace = sp.block_array([[plane.contact.trace, None], [None, sp.eye_array(m)]], format="csr")
    order = np.stack([2 * np.arange(m), 2 * np.arange(m) + 1, 2 * m + np.arange(m)], axis=1).ravel()
    size = float(plane.stiffness.diagonal().min())
    space = DiscreteProblem.of_arrays(
        sp.block_array([[plane.stiffness, None], [None, size * sp.eye_array(m) + zero]], format="csr"),
        np.concatenate([plane.load, np.zeros(m)]),
        trace[order],
        plane.contact.weights,
        plane.gap,
        plane.law,
    )
    expected, found = solve(plane, PrimalDualActiveSet()), solve(space, PrimalDualActiveSet())
    assert expected.status is found.status is Status.CONVERGED
    assert found.steps == expected.steps
    size = float(np.abs(expected.unknowns).max())
    np.testing.assert_allclose(found.unknowns[:n], expected.unknowns, atol=1e-10 * size)
    np.testing.assert_array_equal(found.states.numbers, expected.states.numbers)
    assert [line.changed for line in found.history] == [line.changed for line in expected.history]


def test_rules_of_the_sets_are_their_linearisation() -> None:
    """The rows vanish to second order at a point next to one that keeps the rules."""
    rng = np.random.default_rng(5)
    problem = cube_of_case("table with a knot at a slip")
    system = condense(problem)
    normal, table = problem.law.normal, problem.law.tangential
    m, d = system.shape
    tau = system.compliance
    for law in (problem.law.tangential, cube_of_case("logarithmic").law.tangential):
        size = rng.uniform(0.03, 0.09, m)
        direction = rng.normal(size=(m, d - 1))
        direction /= np.linalg.norm(direction, axis=1)[:, None]
        r, lam = np.zeros((m, d)), np.zeros((m, d))
        at_knot = (np.arange(m) % 2 == 0) & (law is table)
        knot = int(np.flatnonzero(np.isclose(np.ravel(law.knots), 0.02))[0]) if law is table else 0
        r[:, 1:] = np.where(at_knot, 0.02, size)[:, None] * direction
        lam[:, 1:] = law.derivative(np.linalg.norm(r[:, 1:], axis=1))[:, None] * direction
        piece = np.where(at_knot, 2 * knot + 1, 2 * law.piece_of(np.linalg.norm(r[:, 1:], axis=1)))
        state = np.stack([np.zeros(m, dtype=np.int64), piece], axis=1)
        sets = RadialSets(system, (normal, law), state, tau, r, lam)
        R, L, c = sets.rows()

        def rest(r: Array, lam: Array) -> Array:
            return np.einsum("mij,mj->mi", R, r) + np.einsum("mij,mj->mi", L, spread(tau, d) * lam) - c  # noqa: B023

        np.testing.assert_allclose(rest(r, lam)[:, 1:], 0.0, atol=1e-12)
        # Another pair that keeps the rules, a little further on: turned, and with another size of slip or friction.
        step = 1e-4
        turned = direction + step * rng.normal(size=direction.shape)
        turned /= np.linalg.norm(turned, axis=1)[:, None]
        other_size = np.where(at_knot, 0.02, size * (1.0 + step))
        strength = law.piece_derivative(piece // 2, other_size) * np.where(at_knot, 1.0 + step, 1.0)
        near_r, near_lam = r.copy(), lam.copy()
        near_r[:, 1:], near_lam[:, 1:] = other_size[:, None] * turned, strength[:, None] * turned
        first = np.abs(near_r - r).max() + np.abs(spread(tau, d) * (near_lam - lam)).max()
        assert first > 1e-6
        assert np.abs(rest(near_r, near_lam)[:, 1:]).max() < 20.0 * step * first


def test_sets_that_come_back_without_progress_are_a_cycle() -> None:
    problem = cube_of_case("slips")
    system = condense(problem)
    solver, budget = PrimalDualActiveSet(), Budget(np.inf)
    start = system.start()
    state = solver.begin(system, State(start, system.multiplier(start)), budget)
    following = solver.step(system, state, budget)
    assert following.ended is None
    sets, _ = state.memory
    new, _ = following.memory
    assert not np.array_equal(sets, new)
    met = replace(state, memory=(sets, {new.tobytes(): 0.0}))
    assert solver.step(system, met, budget).ended is Status.CYCLING
    worse = replace(state, memory=(sets, {new.tobytes(): np.inf}))
    assert solver.step(system, worse, budget).ended is None


def test_units_do_not_matter() -> None:
    """Metres and pascals, or millimetres and megapascals."""
    problem = cube_of_case("sticks in part")
    scaled = DiscreteProblem.of_arrays(
        1e6 * problem.stiffness,
        1e9 * problem.load,
        problem.contact.trace,
        problem.contact.weights,
        1e3 * problem.gap,
        ContactLaw(ThresholdCompliance(0.3e9, 2.0e6), Tresca(0.7e9)),
    )
    first, second = solve(problem, PrimalDualActiveSet()), solve(scaled, PrimalDualActiveSet())
    assert first.status is second.status is Status.CONVERGED
    assert first.steps == second.steps
    np.testing.assert_allclose(second.unknowns, 1e3 * first.unknowns, atol=1e-9 * 1e3 * np.abs(first.unknowns).max())
