"""The law of an affine argument."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.laws import Adhesive, FormulaLaw, Softening, ThresholdCompliance, affine, table_law
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.piecewise_law import stack
from tests.samples import sampled

from .catalogue import NORMAL, conforms


@pytest.mark.parametrize("name", sampled(NORMAL, 5))
def test_transformed_laws_conform(name: str) -> None:
    conforms(affine(NORMAL[name], np.array([0.2, 2.0]), np.array([-0.4, 0.3])))


@pytest.mark.parametrize("name", NORMAL)
def test_every_answer_is_that_of_the_law_at_the_argument(name: str) -> None:
    law = NORMAL[name].take(np.array([0]))
    theta, c = 2.5, -0.3
    moved = affine(law, theta, c)
    s = np.concatenate([np.linspace(-1.0, 1.0, 41), law.knots[0]])
    s = s[(s >= law.domain.lower[0]) & (s <= law.domain.upper[0])]
    r = (s - c) / theta
    there = law.subdifferential(s)
    here = moved.subdifferential(r)
    knot = np.isin(s, law.knots[0])
    for found, wanted in ((here.lower, there.lower), (here.upper, there.upper)):
        np.testing.assert_array_equal(found[knot], wanted[knot])  # kinks stay kinks, to the last bit
        np.testing.assert_allclose(found[~knot], wanted[~knot], rtol=1e-9, atol=1e-12)
    rise = law.value(s) - law.value(s[:1])
    np.testing.assert_allclose(theta * (moved.value(r) - moved.value(r[:1])), rise, rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(moved.weak_convexity, theta * law.weak_convexity, rtol=1e-14)
    a, b = np.full(21, 4.0), np.linspace(-3.0, 3.0, 21)
    r = moved.local_argmin(a, b)  # the argument solves the problem of the law
    s = law.local_argmin(a / theta, b + a * c / theta)
    np.testing.assert_allclose(theta * r + c, s, rtol=1e-12, atol=1e-14)


def test_tables_stay_tables_and_forces_that_vanish_stay_zero() -> None:
    law = Softening(3.7, 0.123, 0.77)
    moved = affine(law, 1.0e5, np.array([0.3, -17.0]))
    assert isinstance(moved, PiecewiseQuadratic)
    assert (moved.derivative(np.array([1.0, 1.0])) == 0.0).all()  # far beyond the last spring
    assert (moved.recession(np.ones(2)) == 0.0).all()
    assert affine(law, 1.0) is law


def test_two_affine_arguments_are_one() -> None:
    for law in (ThresholdCompliance(0.3, 2.0), NORMAL["logarithm"]):
        twice, once = affine(affine(law, 2.0, 0.5), 3.0, -0.25), affine(law, 6.0, 0.0)
        r = np.linspace(-1.0, 1.0, 33)
        np.testing.assert_allclose(twice.derivative(r), once.derivative(r), rtol=1e-13)
        np.testing.assert_allclose(twice.value(r), once.value(r), rtol=1e-12, atol=1e-15)


def test_a_table_of_many_rows_is_not_copied_for_every_point() -> None:
    r = np.linspace(-1.0, 1.0, 5001)
    law = table_law(r, np.sin(3.0 * r))
    c = np.linspace(-0.1, 0.1, 7)
    moved = affine(law, 2.0, c)
    assert not isinstance(moved, PiecewiseQuadratic)
    r = np.linspace(-0.4, 0.4, 7)
    np.testing.assert_allclose(moved.derivative(r), np.sin(3.0 * (2.0 * r + c)), atol=1e-6)
    found = moved.local_argmin(np.full(7, 20.0), np.linspace(-1.0, 1.0, 7))
    for i in range(7):
        alone = affine(law, 2.0, c[i : i + 1]).local_argmin(np.full(1, 20.0), np.linspace(-1.0, 1.0, 7)[i : i + 1])
        assert found[i] == pytest.approx(alone[0], abs=1e-13)


@pytest.mark.parametrize("unit", [1e-150, 1e-9, 1e9, 1e150])
def test_the_unit_of_length_does_not_matter(unit: float) -> None:
    law, other = Adhesive(5.0, 1.0, 2.0), Adhesive(5.0 / unit, 1.0, 2.0 / unit)
    r = np.linspace(-1.5, 0.5, 41)
    for theta, c in ((0.3, 0.21), (7.0, -0.4)):
        one, two = affine(law, theta, c), affine(other, theta, c * unit)
        np.testing.assert_allclose(two.derivative(r * unit), one.derivative(r), rtol=1e-12, atol=1e-13)
        np.testing.assert_allclose(two.weak_convexity * unit, one.weak_convexity, rtol=1e-13)


def test_of_stacked_laws_each_part_is_moved() -> None:
    both = stack([(ThresholdCompliance(0.3, 2.0), 2), (NORMAL["logarithm"], 3)])
    theta, c = np.linspace(1.0, 2.0, 5), np.linspace(-0.2, 0.2, 5)
    moved = affine(both, theta, c)
    r = np.linspace(-0.5, 0.5, 5)
    np.testing.assert_allclose(moved.derivative(r), both.derivative(theta * r + c), rtol=1e-13)
    np.testing.assert_allclose(moved.weak_convexity, theta * both.weak_convexity, rtol=1e-14)


def test_alpha_of_a_formula_is_claimed_where_the_formula_shows_it() -> None:
    """The slope of a power falls without end, and alpha is known up to the reach: the argument stays within it."""
    law = FormulaLaw("r^2 - r^4", reach=1.0)
    theta, c = np.array([2.0, 0.5]), np.array([0.3, -0.4])
    moved = affine(law, theta, c)
    (reach,), (limit,) = moved.proof("alpha").reach, law.proof("alpha").reach
    assert reach == pytest.approx(0.35)
    assert (np.abs(theta * reach + np.abs(c)) <= limit + 1e-12).all()
    for within in (reach, 2.0 * reach):
        r = np.linspace(-within, within, 4001)
        falls = -np.diff([moved.take(np.array([k])).derivative(r) for k in (0, 1)], axis=1) / np.diff(r)
        claimed = np.broadcast_to(moved.proof("alpha").value(within)[0], 2)
        assert (falls.max(axis=1) <= claimed + 1e-6).all()
    assert moved.proof("alpha").value(reach)[0][0] <= 1.05 * theta[0] * 10.0


@pytest.mark.parametrize(
    ("theta", "c", "words"), [(0.0, 0.0, "positive"), (-1.0, 0.0, "positive"), (1.0, np.nan, "finite")]
)
def test_wrong_numbers_are_refused(theta: float, c: float, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        affine(ThresholdCompliance(0.3), theta, c)
