"""Sums of laws."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.laws import (
    Adhesive,
    Capped,
    Compliance,
    FormulaLaw,
    NoContact,
    PiecewiseQuadratic,
    Signorini,
    SlipWeakening,
    Softening,
    Superpotential,
    ThresholdCompliance,
    affine,
    plus,
)
from hemivar.laws.piecewise_law import stack
from hemivar.laws.testing import check_law
from tests.samples import sampled

from .catalogue import NORMAL, conforms

SECOND = ("softening", "slip weakening", "power", "layers on rigid ground")


def sampled_fall(law: Superpotential, low: float, high: float) -> float:
    """The steepest fall of the derivative between neighbours of a grid that avoids the knots."""
    knots = np.concatenate([law.knots[0][np.isfinite(law.knots[0])], [low, high]])
    grid = np.linspace(low, high, 40001)
    grid = grid[np.abs(grid[:, None] - knots).min(axis=1) > 1e-4 * (high - low)]
    slope = law.derivative(grid)
    near = np.diff(grid) < 2.0 * (high - low) / 40000
    return float(np.max(np.where(near, -np.diff(slope) / np.diff(grid), 0.0), initial=0.0))


@pytest.mark.parametrize(("name", "other"), sampled(zip(NORMAL, itertools.cycle(SECOND), strict=False), 4))
def test_sums_conform(name: str, other: str) -> None:
    check_law(plus(NORMAL[name], affine(NORMAL[other], 0.7, 0.05)))


def test_value_and_subdifferential_are_those_of_the_terms() -> None:
    terms = [NORMAL[name] for name in ("softening glue", "slip weakening", "saw-tooth on springs", "power")]
    law = plus(*terms)
    r = np.unique(np.concatenate([np.linspace(-1.5, 0.0, 301), *(t.knots[0][t.knots[0] <= 0.0] for t in terms)]))
    np.testing.assert_allclose(law.value(r), sum(t.value(r) for t in terms), rtol=1e-12, atol=1e-13)
    inside = r < 0.0
    found = law.subdifferential(r[inside])
    left = sum(t.derivative(r[inside]) for t in terms)
    assert found.contains(np.asarray(left), 1e-12).all()


def test_alpha_is_attained_and_not_only_a_sum() -> None:
    beside = plus(Softening(2.0, 0.1, 0.5), Compliance(0.3))
    assert beside.weak_convexity[0] == pytest.approx(0.2, abs=1e-12)
    assert sampled_fall(beside, 0.0, 0.5) == pytest.approx(0.2, rel=1e-6)
    elsewhere = plus(Softening(2.0, 0.1, 0.5), affine(Softening(2.0, 0.1, 0.4), 1.0, 5.0))  # falls at other places
    assert elsewhere.weak_convexity[0] == pytest.approx(0.5, abs=1e-12)
    same = plus(Softening(2.0, 0.1, 0.5), Softening(3.0, 0.1, 0.4))
    assert same.weak_convexity[0] == pytest.approx(0.9, abs=1e-12)


def test_an_upward_jump_may_outweigh_a_downward_one() -> None:
    down = Capped(20.0, 0.1)  # falls by 2 at r = 0.1
    up = PiecewiseQuadratic([0.1], [0.0, 0.0], [3.0])
    assert np.isinf(down.weak_convexity[0])
    assert plus(down, up).weak_convexity[0] == 0.0
    assert np.isinf(plus(down, up.scaled(0.5)).weak_convexity[0])
    exactly = PiecewiseQuadratic([0.1], [0.0, 0.0], [float(-down.table.jumps[0, 1])])
    assert plus(down, exactly).weak_convexity[0] == 0.0
    assert not plus(down, exactly).at_kink(np.array([0.1]))[0]


def test_where_curvatures_oppose_each_other_alpha_is_enclosed() -> None:
    weakening, strengthening = SlipWeakening(1.0, 1.5, 0.5, 4.0).radial, SlipWeakening(1.0, 0.5, 2.5, 1.5).radial
    law = plus(weakening, strengthening)
    check_law(law, friction=True)
    alpha = float(law.weak_convexity[0])
    s = np.linspace(0.0, 5.0, 2000001)
    exact = float(np.max(4.0 * np.exp(-4.0 * s) - 3.0 * np.exp(-1.5 * s)))
    assert exact * (1.0 - 1e-12) <= alpha <= exact * 1.011
    turned = law.knots[0][np.isfinite(law.knots[0]) & (law.knots[0] > 0.0)]
    assert np.abs(turned - np.log(16.0 / 4.5) / 2.5).min() < 1e-6  # where 16 exp(-4 s) = 4.5 exp(-1.5 s)


def test_laws_that_are_nothing_are_left_out() -> None:
    law = Compliance(5.0, 2.5)
    assert plus(law, NoContact()) is law
    assert plus(NoContact(), law, NoContact()) is law
    assert isinstance(plus(NoContact(), ThresholdCompliance(0.3)), PiecewiseQuadratic | ThresholdCompliance)


def test_the_domain_is_what_all_terms_allow() -> None:
    law = plus(Signorini(), Adhesive(5.0, 1.0, 2.0, compression=3.0))
    assert law.domain.upper[0] == 0.0
    assert law.value(np.array([0.1]))[0] == np.inf
    with pytest.raises(ProblemError, match="no displacement is allowed by all of the laws 'signorini' and 'bilateral'"):
        plus(Signorini(), affine(NORMAL["bilateral"], 1.0, -0.5))


def test_sums_of_points_with_different_knots() -> None:
    shift = np.array([0.0, 0.3, -0.2, 5.0])
    law = plus(NORMAL["layers on rigid ground"], affine(NORMAL["softening"], 1.0, shift))
    conforms(law)
    conforms(plus(NORMAL["logarithmic"], affine(NORMAL["softening"], 1.0, shift)))
    both = plus(
        stack([(ThresholdCompliance(0.3, 2.0), 2), (FormulaLaw("log(1 + r)", even=True), 2)]),
        affine(Compliance(3.0), 1.0, shift),
    )
    r = np.array([0.1, -0.5, 0.4, -4.9])
    np.testing.assert_allclose(both.derivative(r), [0.5 + 0.3, -0.0, 1.0 / 1.4 + 0.6, -1.0 / 5.9 + 0.3], atol=1e-12)
