"""Laws that fall without bound far out: alpha is that of a reach, and a solution is the only one within it."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from hemivar.certificates import Certificate, PointKind, certify
from hemivar.discrete import DiscreteProblem
from hemivar.laws import Compliance, ContactLaw, FormulaLaw, Friction, FunctionLaw, plus
from hemivar.laws.piecewise_law import stack
from hemivar.solvers import solve
from tests.bodies import points_on_springs
from tests.samples import sampled

FALLING = {
    "-exp(r)": (lambda r: -np.exp(r), lambda reach: math.exp(reach)),
    "r^3": (lambda r: 3.0 * r**2, lambda reach: 6.0 * reach),
    "30*r*exp(-r/0.05)": (
        lambda r: 30.0 * np.exp(-r / 0.05) * (1.0 - r / 0.05),
        lambda reach: 30.0 * np.exp(reach / 0.05) * (2.0 / 0.05 + reach / 0.05**2),
    ),
}


def certified(problem: DiscreteProblem) -> Certificate:
    return certify(solve(problem))


@pytest.mark.parametrize("text", FALLING)
def test_alpha_is_that_of_the_reach(text: str) -> None:
    known = FALLING[text][1]
    law = FormulaLaw(text, reach=0.2)
    assert law.weak_convexity[0] == pytest.approx(known(0.2), rel=1e-6)
    assert law.proof("alpha").reach == (0.2,)
    assert law.proof("alpha").value(0.1)[0][0] == pytest.approx(known(0.1), rel=1e-6)
    words = str(law.describe())
    assert "jumps down" not in words
    assert "for |r| <= 0.2" in words
    assert "falls without bound far out" in words
    assert "not bounded below, however stiff the body is" in words
    factor = law.scaled(3.0)
    assert factor.proof("alpha").value(0.1)[0][0] == pytest.approx(3.0 * known(0.1), rel=1e-6)
    pair = stack([(law, 1), (Compliance(2.0).at(None), 2)])
    assert pair.proof("alpha").reach == (0.2,)
    np.testing.assert_allclose(pair.proof("alpha").value(0.1)[0], [known(0.1), 0.0, 0.0], rtol=1e-6)
    springs = plus(law, FormulaLaw("r^2", reach=0.2))
    assert springs.weak_convexity[0] == pytest.approx(max(known(0.2) - 2.0, 0.0), rel=1e-6)
    assert springs.proof("alpha").value(0.5)[0][0] == math.inf


@pytest.mark.parametrize(("reach", "text"), sampled(itertools.product((10.0, 0.03), FALLING), 4))
def test_it_is_the_only_solution_within_the_reach(text: str, reach: float) -> None:
    """Against all zeros of the balance of forces on a fine grid."""
    slope, claimed = FALLING[text][0], 0
    for stiffness in (50.0, 3e3):
        for load in (1.1, -0.9, 40.3):
            certificate = certified(points_on_springs(stiffness, [load], ContactLaw(FormulaLaw(text, reach=reach))))
            if certificate.unique is None:
                continue
            assert isinstance(certificate.unique, str)
            within = certificate.smallness.reach_normal
            assert within <= reach
            r = np.linspace(-within, within, 200_001)
            assert np.count_nonzero(np.diff(np.sign(stiffness * r + slope(r) - load))) == 1
            assert certificate.kind is PointKind.LOCAL_MINIMISER
            claimed += 1
    assert claimed >= 2


def test_slips_have_a_reach_too() -> None:
    """Friction that swings the faster the larger the slip is: its derivative falls by ever more."""
    profile = FormulaLaw("r + r^4 + sin(r^3)", even=True, reach=1.3)
    law = ContactLaw(Compliance(0.5), Friction(0.1, profile))
    problem = DiscreteProblem.of_arrays(  # type: ignore[arg-type]
        np.eye(2), np.array([1.0, 0.13]), np.eye(2), np.ones(1), np.zeros(1), law
    )
    certificate = certified(problem)
    assert certificate.unique == "the only one with slips within the reach 1.3"
    s = np.linspace(0.0, 1.3, 100_001)
    bend = 12.0 * s**2 + 6.0 * s * np.cos(s**3) - 9.0 * s**4 * np.sin(s**3)
    assert certificate.smallness.alpha_tangential == pytest.approx(-0.1 * bend.min(), rel=1e-6)


def test_a_solution_outside_of_the_reach_is_not_called_the_only_one() -> None:
    certificate = certified(points_on_springs(3e3, [1.0], ContactLaw(FormulaLaw("r^3", reach=1e-4))))
    assert certificate.unique is None
    (reason,) = certificate.warnings
    assert reason.startswith("the penetration 0.0003333 lies outside of the reach 0.0001 of its law")
    assert "give the law a larger reach" in reason


def test_samples_prove_nothing_within_a_reach() -> None:
    law = FunctionLaw(lambda r: r**3, lambda r: 3.0 * r**2, lambda r: 6.0 * r, reach=2.0)
    assert law.weak_convexity[0] == pytest.approx(12.0)
    assert law.proof("alpha").reach == (0.0,)
    words = str(law.describe())
    assert "alpha = 12 (sampled)" in words
    assert "falls without bound far out" in words
    assert certified(points_on_springs(3e3, [1.0], ContactLaw(law))).unique is None
