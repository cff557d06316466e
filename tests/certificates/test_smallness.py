"""The constants, against dense eigenproblems and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from hemivar.certificates import EnergyNorm, bound, smallness
from hemivar.certificates.bound import Point, error_bound
from hemivar.certificates.smallness import ellipticity, one_solution, trace_constants
from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.fem.assembly import stiffness_matrix
from hemivar.gallery import survey
from hemivar.laws import Compliance, ContactLaw, Friction, PenetrationBound, PiecewiseQuadratic, StateBound
from hemivar.mechanics import Material
from tests import bodies
from tests.certificates.problems import bar_problem, softening, survey_softening, weakening


def test_bar() -> None:
    found = smallness(bar_problem(0.4, 2.0, 0.1, 0.5))
    assert found.constant == pytest.approx(0.5, rel=1e-10)  # alpha / kappa
    assert found.margin == pytest.approx(0.5, rel=1e-10)
    assert found.m_A is None
    assert found.trace_constant is None
    assert found.survey_condition is None
    assert smallness(bar_problem(0.4, 2.0, 0.1, 2.0)).margin == pytest.approx(-1.0, rel=1e-10)


@pytest.mark.parametrize("n", [4, 20])
def test_constant_is_the_largest_eigenvalue(n: int) -> None:
    """Small and many contact points take different paths."""
    problem = survey_softening(1.5, n=n, friction=Friction(0.05, weakening(0.4, 10.0)))
    found = smallness(problem)
    B, K, w, d = (
        problem.contact.trace.toarray(),
        problem.stiffness.toarray(),
        problem.contact.weights,
        problem.contact.components,
    )

    def top(normal: float, tangential: float) -> float:
        weight = np.tile([normal, tangential], len(w)) * np.repeat(w, d)
        return float(la.eigh(B.T @ (weight[:, None] * B), K, eigvals_only=True)[-1])

    assert found.alpha_tangential == pytest.approx(0.5)
    assert found.constant == pytest.approx(top(1.5, 0.5), rel=1e-6)
    assert found.constant_normal == pytest.approx(top(1.5, 0.0), rel=1e-6)
    assert found.constant_tangential == pytest.approx(top(0.0, 0.5), rel=1e-6)
    assert found.constant >= top(1.5, 0.5) * (1.0 - 1e-12)
    assert max(found.constant_normal, found.constant_tangential) <= found.constant
    assert found.constant <= found.constant_normal + found.constant_tangential
    # the discrete margin is sharper than the survey's condition
    assert found.survey_margin is not None
    assert found.margin >= found.survey_margin


@pytest.mark.parametrize(("rate", "alpha"), [(0.3, 0.0), (1.2, 0.5), (3.0, 0.9), (0.3, 1.8)])
def test_margin_of_one_point_with_a_bound_that_depends_on_the_penetration(rate: float, alpha: float) -> None:
    """c = alpha / k_nu, coupling = L / sqrt(k_nu k_tau), and both count."""
    stiffness = np.diag([1.5, 6.0])
    normal = softening(2.0, 0.1, alpha) if alpha > 0.0 else Compliance(1.0)
    law = ContactLaw(normal, Friction(PenetrationBound(([0.0, 1.0], [0.0, rate]))))
    problem = DiscreteProblem.of_arrays(stiffness, np.ones(2), np.eye(2), np.ones(1), np.zeros(1), law)
    found = smallness(problem)
    coupling = rate / np.sqrt(1.5 * 6.0)
    assert found.coupling == pytest.approx(coupling, rel=1e-10)
    assert found.constant == pytest.approx(alpha / 1.5, rel=1e-10)
    assert found.margin == pytest.approx(1.0 - alpha / 1.5 - coupling, rel=1e-10)
    assert found.contraction == (pytest.approx(coupling / (1.0 - alpha / 1.5)) if alpha < 1.5 else np.inf)
    assert found.m_L == pytest.approx(rate)
    assert one_solution(problem, found) == (found.margin > 0.0)


def test_trace_constant_by_a_dense_eigenproblem() -> None:
    problem = discretize(survey("5.1", 6))
    found = trace_constants(problem)
    assert problem.field is not None
    P = problem.field.basis.toarray()
    V = P.T @ stiffness_matrix(problem.field.mesh, Material.lame(0.0, 0.5)).toarray() @ P
    B = problem.contact.trace.toarray()
    w = np.repeat(problem.contact.weights, 2)
    assert found.both**2 == pytest.approx(la.eigh(B.T @ (w[:, None] * B), V, eigvals_only=True)[-1], rel=1e-8)
    assert max(found.normal, found.tangential) < found.both < np.hypot(found.normal, found.tangential)


def test_trace_constant_converges() -> None:
    values = [trace_constants(discretize(survey("5.1", n))).both for n in (8, 16, 32)]
    assert values[0] < values[1] < values[2]
    assert values[2] - values[1] < 0.5 * (values[1] - values[0])
    assert values[2] == pytest.approx(1.8345, abs=2e-3)


@pytest.mark.parametrize(
    ("material", "expected"),
    [
        (Material.lame(4.0, 4.0), 8.0),
        (Material.lame(-1.0, 4.0), 6.0),  # 2 mu + 2 lam is the smaller one
        (Material.tensor(np.diag([5.0, 6.0, 1.5])), 3.0),
        (Material.lame(4.0, lambda x: 4.0 + x[:, 0]), 8.0),
    ],
)
def test_ellipticity(material: Material, expected: float) -> None:
    problem = bodies.square(softening(1.0, 0.1, 0.1), 16, material=material, body_force=(0.0, -0.1))
    assert ellipticity(problem) == pytest.approx(expected, rel=5e-3)


def weakening_point(bound: StateBound, load: tuple[float, float] = (1.0, 0.05)) -> DiscreteProblem:
    """Springs of stiffness 1, a foundation of stiffness 0.5, friction that weakens by 2 per length of slip."""
    law = ContactLaw(Compliance(0.5), Friction(bound, weakening(0.4, 2.0)))
    return bodies.points_on_springs(1.0, load, law, 2)


def test_a_bound_that_no_penetration_changes_is_known_without_a_solution() -> None:
    """Its alpha is that of the profile times the bound; where the penetration counts nothing is known."""
    assert smallness(weakening_point(PenetrationBound(([0.0, 1.0], [0.3, 0.3])))).alpha_tangential == pytest.approx(0.6)
    found = smallness(weakening_point(PenetrationBound(([0.0, 1.0], [0.3, 0.4]))))
    assert found.alpha_tangential == np.inf
    assert found.margin == -np.inf


@pytest.mark.parametrize("rate", [0.05, 0.2, 0.25])
def test_near_a_solution_the_bounds_of_all_solutions_are_known(rate: float) -> None:
    """u = 2/3 presses whatever the friction, which has then the bound 0.1 + 2/3 rate, and weakens by twice that."""
    problem = weakening_point(PenetrationBound(([0.0, 1.0], [0.1, 0.1 + rate])))
    u = np.array([2.0 / 3.0, 0.0])
    lam = np.array([[1.0 / 3.0, 0.05]])
    exact = 2.0 * (0.1 + 2.0 / 3.0 * rate)
    found = smallness(problem, displacement=u, multiplier=lam)
    assert exact <= found.alpha_tangential <= exact * (1.0 + 1e-4)
    assert found.coupling == pytest.approx(rate)
    assert found.margin == pytest.approx(1.0 - exact - rate, abs=1e-4)
    assert smallness(problem, displacement=u).alpha_tangential == found.alpha_tangential
    # from farther away they are bounded by the distance, and never below what they are
    for off in (1e-3, 1e-2, 0.1):
        wide = smallness(problem, displacement=u - np.array([off, 0.0]), multiplier=lam)
        if found.margin > 0.0:
            assert exact <= wide.alpha_tangential
            assert found.margin - 20.0 * rate * off <= wide.margin <= found.margin + 1e-4


def test_a_point_deep_in_the_foundation_does_not_spoil_the_bound_of_a_shallow_one() -> None:
    """Pressed by 1.5 and by 0.0015 on springs of stiffness 1 and 0.5: friction of rate 0.1, which weakens by 2."""
    law = ContactLaw(Compliance(0.5), Friction(PenetrationBound(([0.0, 1.0], [0.0, 0.1])), weakening(0.4, 2.0)))
    load = np.array([1.5, 0.0, 0.0015, 0.0])
    problem = DiscreteProblem.of_arrays(np.eye(4), load, np.eye(4), np.ones(2), np.zeros(2), law)
    found = smallness(problem, displacement=load / 1.5, multiplier=(load / 3.0).reshape(2, 2))
    assert found.alpha_tangential == pytest.approx(0.2, rel=1e-5)
    assert found.coupling == pytest.approx(0.1)
    assert found.margin == pytest.approx(0.7, abs=1e-4)


def test_a_multiplier_that_is_given_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a large problem, where no better pair is sought: a point that sticks, and one behind it that is off by e.

    The given pair is as far from all solutions as e in energy; the force that balances the contact point leaves
    ``K_bb e`` behind it, which is more in the dual norm.
    """
    monkeypatch.setattr(bound, "REPEATED", 0)
    law = ContactLaw(Compliance(0.5), Friction(PenetrationBound(([0.0, 1.0], [0.2, 0.3])), weakening(0.4, 0.5)))
    K = np.array([[1.0, 0.0, 0.0], [0.0, 3.0, -2.0], [0.0, -2.0, 3.0]])
    problem = DiscreteProblem.of_arrays(K, np.array([1.0, 0.05, 0.0]), np.eye(2, 3), np.ones(1), np.zeros(1), law)
    exact, lam = np.array([2.0 / 3.0, 0.0, 0.0]), np.array([[1.0 / 3.0, 0.05]])
    known = smallness(problem, displacement=exact, multiplier=lam).alpha_tangential
    off = exact + np.array([0.0, 0.0, 0.01])
    given = smallness(problem, displacement=off, multiplier=lam).alpha_tangential
    balanced = smallness(problem, displacement=off).alpha_tangential
    assert known <= given < balanced
    assert (balanced - known) / (given - known) == pytest.approx(
        np.sqrt(9.0 / 5.0), rel=1e-3
    )  # K_bb^2 (K^-1)_bb / K_bb


def test_far_from_unique_no_bound_is_known() -> None:
    problem = weakening_point(PenetrationBound(([0.0, 1.0], [0.0, 0.9])))
    found = smallness(problem, displacement=np.array([2.0 / 3.0, 0.0]), multiplier=np.array([[1.0 / 3.0, 0.05]]))
    assert found.alpha_tangential == np.inf
    assert found.margin == -np.inf


def test_a_bound_that_opens_at_one_point_alone_couples_all_the_same() -> None:
    """Two points; one slips nowhere, for a support holds it, and one has a bound of its own."""
    K = np.diag([1.5, 6.0, 1.0, 1.0])
    law = ContactLaw(Compliance(1.0), Friction(PenetrationBound(([0.0, 1.0], [0.0, 0.3]))))
    trace = np.eye(4)
    trace[3] = 0.0
    problem = DiscreteProblem.of_arrays(K, np.ones(4), trace, np.ones(2), np.zeros(2), law)
    found = smallness(problem)
    assert found.coupling == pytest.approx(0.3 / np.sqrt(1.5 * 6.0))
    assert found.margin == pytest.approx(1.0 - found.coupling)
    trace[1] = 0.0
    still = smallness(DiscreteProblem.of_arrays(K, np.ones(4), trace, np.ones(2), np.zeros(2), law))
    assert (still.coupling, still.m_L, still.contraction, still.margin) == (0.0, 0.0, 0.0, 1.0)


def test_softening_counts_where_a_point_can_move() -> None:
    """The normal law softens at a point whose penetration a support holds: no displacement feels it."""
    law = ContactLaw(softening(3.0, 0.1, 0.8), Friction(0.5, weakening(0.4, 1.2)))
    both = DiscreteProblem.of_arrays(np.diag([2.0, 3.0]), np.ones(2), np.eye(2), np.ones(1), np.zeros(1), law)
    found = smallness(both)
    assert (found.alpha_normal, found.alpha_tangential, found.m_alpha) == pytest.approx((0.8, 0.6, 0.8))
    assert (found.constant_normal, found.constant_tangential) == pytest.approx((0.4, 0.2))
    assert found.constant == pytest.approx(0.4)
    for row, alphas, constant in ((0, (0.0, 0.6), 0.2), (1, (0.8, 0.0), 0.4)):
        trace = np.eye(2)
        trace[row] = 0.0
        held = smallness(both.of_arrays(np.diag([2.0, 3.0]), np.ones(2), trace, np.ones(1), np.zeros(1), law))
        assert (held.alpha_normal, held.alpha_tangential) == pytest.approx(alphas)
        assert held.constant == pytest.approx(constant)
        assert held.margin == pytest.approx(1.0 - constant)


def test_a_badly_conditioned_stiffness_costs_the_rounding_of_its_margin() -> None:
    """Two unknowns that move together almost freely: 1e-9 is left, and c is known to a few millionths."""
    for small in (1e-3, 1e-9):
        K = np.array([[1.0, -1.0 + small], [-1.0 + small, 1.0]])
        law = ContactLaw(softening(3.0, 0.1, small))
        problem = DiscreteProblem.of_arrays(K, np.ones(2), np.eye(2)[:1], np.ones(1), np.zeros(1), law)
        found = smallness(problem)
        assert found.constant == pytest.approx(0.5, rel=1e-3)  # alpha K^-1_11
        hidden = 1.0 - found.constant - found.margin
        eps = float(np.finfo(float).eps)
        assert 0.5 * eps / small <= hidden <= 100.0 * eps / small


@pytest.mark.parametrize("held", [0, 1, 2, 3, None])
def test_normal_and_tangential_softening_add_up_at_different_points(held: int | None) -> None:
    """Two points, whose components the body couples; one component at a time is held by a support."""
    rng = np.random.default_rng(3)
    root = rng.normal(size=(4, 4))
    K, w = root @ root.T + 2.0 * np.eye(4), np.array([0.5, 1.5])
    trace = np.eye(4)
    if held is not None:
        trace[held] = 0.0
    law = ContactLaw(softening(3.0, 0.1, 0.8), Friction(0.5, weakening(0.4, 1.2)))
    found = smallness(DiscreteProblem.of_arrays(K, np.ones(4), trace, w, np.zeros(2), law))
    weight = np.repeat(w, 2) * np.array([0.8, 0.6, 0.8, 0.6])
    top = la.eigh(trace.T @ (weight[:, None] * trace), K, eigvals_only=True)[-1]
    assert found.constant == pytest.approx(top, rel=1e-9)
    assert found.margin == pytest.approx(1.0 - top, rel=1e-9)


def test_a_profile_that_jumps_under_a_bound_of_zero_softens_nothing() -> None:
    jumping = PiecewiseQuadratic([-0.2, 0.0, 0.2], np.zeros(4), [-0.4, 2.0, -0.4], start=-0.6)  # type: ignore[arg-type]
    for size, alpha, margin in ((0.0, 0.0, 1.0), (0.3, np.inf, -np.inf)):
        law = ContactLaw(Compliance(0.5), Friction(PenetrationBound(([0.0, 1.0], [size, size])), jumping))
        found = smallness(DiscreteProblem.of_arrays(np.eye(2), np.ones(2), np.eye(2), np.ones(1), np.zeros(1), law))
        assert (found.alpha_tangential, found.margin) == (alpha, margin)


def test_pairs_beyond_the_largest_friction_bound_are_left_out() -> None:
    """A bound of 0.1 + 0.2 s at s = 2/3 is 7/30; what lies above the ceiling proves nothing."""
    problem = weakening_point(PenetrationBound(([0.0, 1.0], [0.1, 0.3])))
    u, lam = np.array([2.0 / 3.0, 0.0]), np.array([[1.0 / 3.0, 0.05]])
    here = 0.1 + 0.2 * 2.0 / 3.0
    point = Point(problem, EnergyNorm(problem.stiffness), u + np.array([0.0, 1e-3]), lam)
    free = error_bound(point, 0.5)
    assert 1e-3 <= free < 1e-2
    assert error_bound(point, 0.5, np.array([here * 1.001])) == pytest.approx(free, rel=1e-2)
    assert error_bound(point, 0.5, np.array([here * 0.999])) == np.inf
    for margin in (0.0, -1.0, np.nan, -np.inf):
        assert error_bound(point, margin) == np.inf


@pytest.mark.parametrize("weight", [0.01, 1.0, 30.0])
def test_bounds_of_all_solutions_hold_that_of_the_solution_whatever_the_weight(weight: float) -> None:
    """One point pressed to ``r = 1 / (2 + w 3)`` has friction ``r / 20``, which weakens by 2; seen from less deep."""
    law = ContactLaw(Compliance(3.0), Friction(PenetrationBound(([0.0, 1.0], [0.0, 0.05])), weakening(0.4, 2.0)))
    K, w = np.diag([2.0, 5.0]), np.array([weight])
    problem = DiscreteProblem.of_arrays(K, np.array([1.0, 0.0]), np.eye(2), w, np.zeros(1), law)
    r = 1.0 / (2.0 + 3.0 * weight)
    for part in (0.0, 0.3, 0.9, 1.0):
        found = smallness(problem, displacement=np.array([part * r, 0.0]))
        assert 2.0 * 0.05 * r * (1.0 - 1e-12) <= found.alpha_tangential < np.inf
