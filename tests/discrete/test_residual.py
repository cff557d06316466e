"""The one residual: what it is held against, and what it never calls solved."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hemivar.certificates import PointKind, certify
from hemivar.discrete import DiscreteProblem, residual
from hemivar.discrete.residual import LoadScale, Residual, contact_compliance, resting_multiplier
from hemivar.errors import MethodError, ProblemError
from hemivar.laws import (
    Compliance,
    ContactLaw,
    FinitePenetration,
    FormulaLaw,
    NoFriction,
    Signorini,
    Superpotential,
    Tresca,
)
from hemivar.solvers import METHODS, Controls, Status, solve

from ..problems import discrete_square


def spring(load: float, law: Superpotential, gap: float = 0.0, stiffness: float = 1.0) -> DiscreteProblem:
    """One unknown on a spring, with contact."""
    one = np.ones((1, 1))
    return DiscreteProblem.of_arrays(stiffness * one, [load], one, [1.0], [gap], ContactLaw(law, NoFriction()))  # type: ignore[arg-type]


@pytest.mark.parametrize("bad", [math.inf, math.nan])
@pytest.mark.parametrize("place", range(4))
def test_what_is_not_finite_is_never_below(bad: float, place: int) -> None:
    numbers = [0.0, 0.0, 1.0, 0.0]
    assert Residual(*numbers).below(0.0, 1e-9)
    numbers[place] = bad
    assert not Residual(*numbers).below(0.0, 1e-9)
    assert not Residual(*numbers).below(math.inf, 1e-9)


def test_a_residual_below_rounding_that_swamps_the_load_shows_nothing() -> None:
    assert Residual(0.0, 0.0, 1.0, 1e-4).below(0.0, 1e-9)
    swamped = Residual(0.0, 0.0, 1.0, 1e-2)
    assert not swamped.below(0.0, 1e-9)
    assert swamped.relative == 1e-2


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "direct-lbfgs" else []) for name in METHODS]
)
def test_a_problem_without_solution_is_not_solved_by_running_away(name: str) -> None:
    """K = 1 and j' = -r leave u + lambda = 0 for every u, whatever the load."""
    problem = spring(0.5, FormulaLaw("-0.5*r^2"))
    try:
        found = solve(problem, METHODS[name])
    except (MethodError, ProblemError):
        return
    assert found.status is not Status.CONVERGED
    assert found.residual.relative > 0.1


@pytest.mark.parametrize("far", [5e9, 1e13, 5e15, 1e20])
def test_far_away_the_pair_of_such_a_problem_stays_unsolved(far: float) -> None:
    problem = spring(0.5, FormulaLaw("-0.5*r^2"))
    found = residual(problem, np.array([far]), np.array([[-far]]))
    assert not found.below(0.0, 1e-9)
    assert certify(problem, np.array([far]), np.array([[-far]])).kind is PointKind.NOT_STATIONARY


def test_a_foundation_alone_sets_the_scale_where_it_loads_the_body() -> None:
    compliant = spring(0.0, Compliance(3.0), gap=-0.5)  # u + 3 (u + 0.5) = 0
    exact = np.array([-0.375])
    assert residual(compliant, exact, np.array([[0.375]])).scale == pytest.approx(0.375)
    off = residual(compliant, 1.001 * exact, np.array([[0.375]]))
    assert off.equilibrium / off.scale == pytest.approx(1e-3)
    assert not off.below(0.0, 1e-4)
    rigid = spring(0.0, Signorini(), gap=-0.5, stiffness=4.0)  # pushed back by 0.5
    assert residual(rigid, np.array([-0.5]), np.array([[2.0]])).scale == pytest.approx(2.0)
    for problem, u in ((compliant, -0.375), (rigid, -0.5)):
        found = solve(problem)
        assert found.status is Status.CONVERGED
        assert found.unknowns == pytest.approx([u], rel=1e-12)


def test_what_the_foundation_would_exert_at_rest_does_not_loosen_the_tolerance() -> None:
    """A stiff foundation that overlaps the body: its force at rest is 1e6 times the one in equilibrium."""
    problem = spring(0.0, Compliance(1e6), gap=-0.5)
    lam = 0.5 / (1.0 + 1e-6)
    assert residual(problem, np.array([-lam]), np.array([[lam]])).scale == pytest.approx(lam)


@pytest.mark.parametrize("size", [1e160, 1e200, 1e300, 1e-160, 1e-300])
def test_loads_whose_energies_over_or_underflow_are_refused(size: float) -> None:
    with pytest.raises(ProblemError, match="flow; use units that suit the problem"):
        spring(size, Signorini())
    spring(1e120 if size > 1.0 else 1e-120, Signorini())


@pytest.mark.parametrize("size", [1e100, 1e130])
@pytest.mark.parametrize("name", ["newton", "multigrid"])
def test_sizes_near_the_ends_of_the_numbers(name: str, size: float) -> None:
    plain = discrete_square("rigid")
    data = {
        "stiffness": plain.stiffness,
        "trace": plain.contact.trace,
        "weights": plain.contact.weights,
        "gap": plain.gap,
    }
    law = ContactLaw(Signorini(), Tresca(0.1 * size))
    found = solve(
        DiscreteProblem.of_arrays(load=size * plain.load, law=law.at(plain.contact.points), **data),
        METHODS[name],
    )
    reference = solve(plain)
    assert found.status is Status.CONVERGED
    assert found.unknowns / size == pytest.approx(reference.unknowns, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("far", [1e160, 1e200, 1e300])
def test_a_certificate_with_numbers_that_are_not_finite_claims_nothing(far: float) -> None:
    problem = discrete_square()
    u = far * solve(problem).unknowns
    with np.errstate(all="ignore"):
        found = certify(problem, u)
    assert found.kind is PointKind.NOT_STATIONARY
    assert found.unique is None
    assert found.error_bound == math.inf


@pytest.mark.parametrize(
    ("change", "word"), [({"rtol": 1e10}, "rtol"), ({"rtol": 1.0}, "rtol"), ({"atol": math.inf}, "atol")]
)
def test_tolerances_that_would_accept_anything_are_refused(change: dict[str, float], word: str) -> None:
    with pytest.raises(ProblemError, match=rf"Controls\.{word}"):
        Controls(**change)  # type: ignore[arg-type]
    problem = discrete_square()
    with pytest.raises(ProblemError, match="tolerance of a certificate is 1"):
        certify(problem, np.zeros(problem.unknowns), tolerance=1e10)


def test_the_rounding_that_is_forgiven_is_that_of_the_sums() -> None:
    """Eight units in the last place of ``|K| |u| + |f|``, and never more than a millionth of the load."""
    problem = spring(3.0, Compliance(1.0), stiffness=4.0)
    eps = float(np.finfo(float).eps)
    for u, lam in ((0.6, 0.6), (0.7, 0.6), (-2.0, 0.0)):
        found = residual(problem, np.array([u]), np.array([[lam]]))
        assert found.noise == pytest.approx(8.0 * eps * (4.0 * abs(u) + 3.0), rel=1e-14, abs=0.0)
        assert found.rounding == found.noise
    assert Residual(0.0, 0.0, 2.0, 1.0).rounding == pytest.approx(2e-6)
    edge = Residual(0.0, 3.0e-9, 1.0, 1e-9)
    assert edge.below(1e-9, 1.0000001e-9)
    assert not edge.below(1e-9, 0.9999999e-9)
    assert Residual(3.0, 4.0, 10.0, 0.0).total == 5.0
    assert Residual(3.0, 4.0, 10.0, 0.0).relative == 0.5
    assert Residual(3.0, 4.0, 0.0, 0.0).relative == 5.0


def test_both_parts_of_a_residual_by_hand() -> None:
    """Weight 2, trace -1, gap 0.25: r = -u - 0.25."""
    problem = DiscreteProblem.of_arrays(
        [[4.0]], [3.0], [[-1.0]], [2.0], [0.25], ContactLaw(Signorini(), NoFriction())  # type: ignore[arg-type]
    )  # fmt: skip
    off = residual(problem, np.array([0.5]), np.array([[0.125]]))
    assert off.equilibrium == pytest.approx(abs(3.0 - 4.0 * 0.5 + 2.0 * 0.125))
    assert off.inclusion == pytest.approx(2.0 * 0.125)  # r = -0.75: no pressure without contact
    assert off.scale == 3.0
    deep = residual(problem, np.array([-0.5]), np.array([[0.125]]))
    assert deep.inclusion == pytest.approx(4.0 * 0.25)  # beyond the end by 0.25, as a force 2 (0.25 / (2 / 4))
    assert deep.equilibrium == pytest.approx(3.0 + 2.0 + 0.25)


def test_a_foundation_that_loads_the_body_more_than_the_load_sets_the_scale() -> None:
    compliant = spring(0.1, Compliance(3.0), gap=-0.5)  # u + 3 (u + 0.5) = 0.1
    assert residual(compliant, np.array([-0.35]), np.array([[0.45]])).scale == pytest.approx(0.45)
    assert residual(compliant, np.array([-0.35]), np.array([[4.5]])).scale == pytest.approx(1.5)  # j'(0.5)
    ends = spring(0.0, FinitePenetration(0.0, 0.2), gap=-0.5, stiffness=4.0)  # pushed back by 0.3
    assert residual(ends, np.array([-0.3]), np.array([[1.2]])).scale == pytest.approx(1.2)
    assert residual(ends, np.array([-0.3]), np.array([[9.0]])).scale == pytest.approx(1.2)
    assert Residual(3.0, 4.0, 0.5, 0.0).relative == 10.0


def test_what_presses_on_a_body_that_has_not_moved() -> None:
    """Beyond its domain a law is met at the end of it, and the rest of the way is a force on the compliance."""
    compliance = np.array([[0.5, 9.0], [0.25, 9.0]])
    offset = np.array([[-0.1, 0.7], [0.3, -0.2]])
    rigid = ContactLaw(Signorini(), Tresca(0.5)).at(np.zeros((2, 2)))
    np.testing.assert_allclose(resting_multiplier(rigid, offset, compliance), [[0.1 / 0.5, -0.5], [0.0, 0.5]])
    ends = ContactLaw(FinitePenetration(4.0, 0.06), Tresca(0.5)).at(np.zeros((2, 2)))
    np.testing.assert_allclose(
        resting_multiplier(ends, offset, compliance), [[4.0 * 0.06 + 0.04 / 0.5, -0.5], [0.0, 0.5]]
    )


@pytest.mark.parametrize(
    ("load", "rest", "force", "scale"),
    [(0.0, 0.0, 3.0, 3.0), (0.0, 2.0, 3.0, 2.0), (0.0, 4.0, 3.0, 3.0), (1.0, 0.5, 3.0, 1.0), (1.0, 2.0, 1.5, 1.5)],
)
def test_a_force_that_only_the_iterate_makes_is_a_scale_only_where_there_is_no_other(
    load: float, rest: float, force: float, scale: float
) -> None:
    assert LoadScale(load, rest).of(force) == scale


def test_the_compliance_of_contact_points_by_hand() -> None:
    """Weight over stiffness: the softest tangent in space, the largest of all for points that see nothing."""
    law = ContactLaw(Signorini(), Tresca(0.1))
    solid = DiscreteProblem.of_arrays(
        np.diag([1.0, 2.0, 4.0]), np.zeros(3), np.eye(3), np.array([3.0]), np.zeros(1), law
    )
    np.testing.assert_allclose(contact_compliance(solid), [[3.0, 1.5]])
    blind = DiscreteProblem.of_arrays(
        np.diag([0.5, 2.0]), np.zeros(2), np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([3.0, 5.0]), np.zeros(2),
        ContactLaw(Signorini()),
    )  # fmt: skip
    np.testing.assert_allclose(contact_compliance(blind)[:, 0], [3.0 / 0.5, 5.0 / 0.5])
    nothing = DiscreteProblem.of_arrays(
        np.eye(2), np.zeros(2), np.zeros((1, 2)), np.array([3.0]), np.zeros(1), ContactLaw(Signorini())
    )
    np.testing.assert_allclose(contact_compliance(nothing), [[3.0, 3.0]])
