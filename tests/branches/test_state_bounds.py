"""Friction whose bound depends on the penetration: nothing is frozen, each solution counts once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from hemivar.branches import find_solutions, follow_path
from hemivar.certificates import certify, smallness
from hemivar.discrete import DiscreteProblem
from hemivar.laws import Compliance, ContactLaw, CoulombBound, Friction, PenetrationBound, SlipWeakening, Tresca
from hemivar.solvers import FixedPoint, LoadStepping, Status, solve
from tests.bodies import points_on_springs


def sliding_point(
    friction: Friction, load: tuple[float, float] = (1.0, 0.12), stiffness: float = 0.5
) -> DiscreteProblem:
    """One contact point on springs of stiffness 1."""
    law = ContactLaw(Compliance(stiffness), friction)
    return points_on_springs(1.0, load, law, 2)


def weakening(rate: float = 200.0) -> DiscreteProblem:
    """r_n = 2/3 whatever the slip; the bound there is 2/15."""
    return sliding_point(SlipWeakening(PenetrationBound(([0.0, 1.0], [0.0, 0.2])), 1.0, 0.5, rate))


def slips(rate: float = 200.0) -> list[float]:
    """The closed form: stick, and the zeros of 0.12 - s - 2/15 (1/2 + 1/2 exp(-rate s))."""

    def force(s: float) -> float:
        return 0.12 - s - 2.0 / 15.0 * (0.5 + 0.5 * np.exp(-rate * s))

    turn = np.log(rate / 15.0) / rate
    return [0.0, brentq(force, 0.0, turn, xtol=1e-15), brentq(force, turn, 1.0, xtol=1e-15)]


def test_weakening_under_a_bound_that_opens_with_the_penetration_has_three_solutions() -> None:
    found = find_solutions(weakening(), starts=0)
    assert not found.exhaustive
    np.testing.assert_allclose([s.penetration[0] for s in found], 2.0 / 3.0, atol=1e-12)
    np.testing.assert_allclose(sorted(s.slip[0, 0] for s in found), slips(), atol=1e-10)


@pytest.mark.parametrize("at", ["open", "solution", "stick"])
def test_no_state_makes_it_unique(at: str) -> None:
    problem = weakening()
    solution = solve(problem)
    pairs = {
        "open": (np.array([-1.0, 0.0]), np.zeros((1, 2))),
        "solution": (solution.unknowns, solution.multiplier),
        "stick": (np.array([2.0 / 3.0, 0.0]), np.array([[1.0 / 3.0, 0.12]])),
    }
    certificate = certify(problem, *pairs[at])
    assert certificate.unique is None
    assert not certificate.margin > 0.0
    assert certificate.smallness.alpha_tangential > 1.0
    assert not smallness(problem).margin > 0.0


def test_where_weakening_is_slow_the_one_solution_is_proved() -> None:
    problem = weakening(5.0)
    solution = solve(problem)
    certificate = certify(problem, solution.unknowns, solution.multiplier)
    # alpha = 5 * 0.5 * 2/15 and m_L = 0.2, all on unit stiffness
    assert certificate.margin == pytest.approx(1.0 - 1.0 / 3.0 - 0.2, abs=1e-4)
    assert certificate.unique is True
    assert certificate.error_bound < 1e-8
    found = find_solutions(problem, starts=0)
    assert found.exhaustive
    assert len(found) == 1


def test_the_bound_of_the_error_holds_for_every_solution() -> None:
    """From pairs with another friction bound than the solution's, which must not lend their margin."""
    problem = weakening(5.0)
    exact = solve(problem).unknowns
    random = np.random.default_rng(1)
    finite = 0
    for _ in range(60):
        u = exact + 10.0 ** random.uniform(-6.0, 0.3) * random.normal(size=2)
        bound = certify(problem, u).error_bound
        assert bound >= np.linalg.norm(u - exact) * (1.0 - 1e-12)
        finite += np.isfinite(bound)
    assert finite > 20


@pytest.mark.parametrize("bound", [PenetrationBound(([0.0, 1.0], [0.0, 4.0])), PenetrationBound("0.3*max(s, 0)")])
@pytest.mark.parametrize("load", [(1.0, 0.12), (1.0, 0.9), (0.3, -0.4)])
def test_one_solution_is_given_once(bound: PenetrationBound, load: tuple[float, float]) -> None:
    found = find_solutions(sliding_point(Tresca(bound), load), starts=4)
    assert len(found) == 1, [s.local.tolist() for s in found]


def test_coulomb_friction_has_its_solutions_on_the_curve_as_well() -> None:
    found = find_solutions(sliding_point(Tresca(CoulombBound(0.3)), (1.0, 0.5)), starts=2)
    assert len(found) == 1
    assert not found.exhaustive
    # pressure 1/3, so that friction is 0.1
    np.testing.assert_allclose(found[0].local, [[2.0 / 3.0, 0.4]], atol=1e-9)


def test_a_path_ends_where_a_solve_does() -> None:
    problem = sliding_point(Friction(PenetrationBound(([0.0, 1.0], [0.0, 0.15]))))
    path = follow_path(problem)
    np.testing.assert_allclose(path.local[-1, 0], [2.0 / 3.0, 0.12 - 0.1], atol=1e-12)  # slips against a bound of 0.1
    found = solve(problem, FixedPoint(LoadStepping()))
    assert found.status is Status.CONVERGED
    np.testing.assert_allclose(found.local, path.local[-1], atol=1e-8)


@pytest.mark.slow
def test_a_path_goes_through_the_three_solutions() -> None:
    """Of the closed form, at load 1; without an energy no stretch is called by it."""
    path = follow_path(weakening(), (0.0, 2.0))
    assert len(path.folds) == 2
    found = sorted(float(r[0, 1]) for r, _ in path.at(1.0))
    np.testing.assert_allclose(found, slips(), atol=1e-5)
    assert np.isnan(path.energy).all()
