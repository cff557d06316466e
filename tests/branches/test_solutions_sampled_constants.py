"""What rests on sampled constants is an estimate, and is never called unique, exhaustive or guaranteed."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.branches import find_solutions
from hemivar.certificates import Certificate, PointKind, certify, smallness
from hemivar.certificates.smallness import one_solution
from hemivar.discrete import DiscreteProblem
from hemivar.laws import Compliance, ContactLaw, FormulaLaw, Friction, FunctionLaw, PenetrationBound, Superpotential
from hemivar.solvers import solve
from tests.bodies import points_on_springs
from tests.samples import slow

STEP = "6e-4*(1 + tanh((s - 1)/3e-4))"


def certified(problem: DiscreteProblem) -> Certificate:
    found = solve(problem)
    return certify(problem, found.unknowns, found.multiplier)


def check_words(problem: DiscreteProblem, sampled: bool) -> None:
    """Nothing is claimed where it is sampled; where it is not, everything is."""
    certificate = certified(problem)
    constants = smallness(problem)
    assert certificate.stationary
    assert certificate.margin > 0.0
    assert constants.sampled == certificate.error_bound_sampled == sampled
    assert one_solution(problem, constants) == (not sampled)
    assert certificate.unique is (None if sampled else True)
    text = "\n".join(certificate.lines(whole=True))
    record = certificate.record()
    assert record["error_bound_sampled"] == sampled
    assert (record["alpha_sampled"] or record["m_L_sampled"]) == sampled
    found = find_solutions(problem, starts=2, enumerate_up_to=0)
    assert found.exhaustive == find_solutions(problem, starts=2).exhaustive == (not sampled)
    if sampled:
        kinds = [PointKind.LOCAL_MINIMISER, PointKind.DIRECTIONALLY_STATIONARY]
        assert certificate.kind in ([kind.bound_fixed for kind in kinds] if problem.law.state_dependent else kinds)
        for word in ("unique m", "unique s", "the only solution", "at most", "guaranteed", "global"):
            assert word not in text
        assert "an estimate, from sampled constants" in text
        assert "the margin is positive, but sampled" in text
        assert "rests on sampled constants" in found.searched
    else:
        assert "the only solution" in text
        assert "estimate" not in text
        assert "sampled" not in text + found.searched


@pytest.mark.parametrize(
    ("bound", "sampled"),
    [
        ("min(max(s, 0), 0.5)/4", False),
        (lambda s: np.clip(s, 0.0, 0.5) / 4.0, True),
        (lambda s: np.full(np.shape(s), 0.1), True),
        (lambda s: 0.1 + np.maximum(0.0, 1e4 * (1e-6 - np.abs(s - 1.2346543))), True),  # no sample meets the spike
        (([0.0, 0.5], [0.0, 0.125]), False),
        ("0.1 + 0.01*s^2", True),
    ],
)
def test_friction_bounds(bound: object, sampled: bool) -> None:
    check_words(
        points_on_springs(1.0, (1.0, 0.3), ContactLaw(Compliance(0.5), Friction(PenetrationBound(bound))), 2), sampled
    )


@pytest.mark.parametrize(
    ("law", "sampled"),
    [
        (FormulaLaw("piecewise((0, r < 0), (1 - exp(-r), True))"), False),
        (FunctionLaw(derivative=lambda r: np.where(r > 0.0, 0.1 * np.exp(-r), 0.0), kinks=[0.0]), True),
        slow(FunctionLaw(derivative=lambda r: np.maximum(r, 0.0), kinks=[0.0]), True),
    ],
)
def test_laws(law: Superpotential, sampled: bool) -> None:
    check_words(points_on_springs(1.0, (1.0, 0.3), ContactLaw(law.scaled(0.3), Friction(0.1)), 2), sampled)


def test_three_solutions_are_not_each_unique() -> None:
    """Friction that rises within 3e-4 of the penetration 1, by 2 per length; a grid sees the slope 0.52."""
    for bound in (STEP, lambda s: 6e-4 * (1.0 + np.tanh((s - 1.0) / 3e-4))):
        friction = Friction(PenetrationBound(bound))
        # penetration and slip are coupled, so that friction pushes the body in
        K = np.array([[1.0, -0.6], [-0.6, 1.0]])
        problem = DiscreteProblem.of_arrays(  # type: ignore[arg-type]
            K, np.array([0.9997, 0.5]), np.eye(2), np.ones(1), np.zeros(1), ContactLaw(Compliance(0.5), friction)
        )
        constants = smallness(problem)
        assert not one_solution(problem, constants)
        assert not find_solutions(problem, starts=3).exhaustive
        certificate = certified(problem)
        assert certificate.unique is not True
        assert "unique" not in certificate.kind.value
