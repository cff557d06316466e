"""Answers of laws at the edges of what they are made for: one side only, tiny or huge numbers, ends of a table."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws import (
    ContactLaw,
    CoulombBound,
    FormulaLaw,
    Friction,
    FunctionLaw,
    Layered,
    PenetrationBound,
    PiecewiseQuadratic,
    Softening,
    StateBound,
    Superpotential,
    ThresholdCompliance,
    table_law,
)
from hemivar.laws.minimisers import piece_bounds
from hemivar.laws.piecewise_law import stack
from hemivar.laws.proof import SAMPLED, Constant, Evidence, Proof
from hemivar.laws.testing import LawError, check_law
from hemivar.laws.transformed import affine, plus


class Table(PiecewiseQuadratic):
    """A law of a class that is looked at, and whose alpha may be stated wrongly."""

    told = 0.0

    @property
    def weak_convexity(self) -> Array:
        return np.array([self.told])


# ---- constants ----------------------------------------------------------------------------------------------


def test_a_growth_that_is_proved_on_one_side_only_is_proved() -> None:
    for text, c0 in (("max(r, 0)", 1.0), ("max(-2*r, 0)", 2.0)):
        law = FormulaLaw(text)
        assert law.proof("growth").sure
        assert law.growth[0][0] == pytest.approx(c0, rel=1e-6)


def test_a_narrow_peak_of_the_derivative_is_climbed() -> None:
    law = FunctionLaw(derivative=lambda r: 1.0 / (1.0 + ((r - 0.0051) / 0.02) ** 2))
    assert not law.proof("growth").sure
    assert 1.0 - 1e-5 <= law.growth[0][0] <= 1.0 + 1e-5


def test_the_asymptotic_curvature_has_one_entry_for_each_point() -> None:
    law = FormulaLaw("r^2 + abs(r - 1) + abs(r + 1)")
    for sign in (1.0, -1.0):
        found = law.asymptotic_curvature(sign)
        assert found.shape == (1,)
        assert found[0] == pytest.approx(2.0, rel=1e-6)


def test_small_turns_of_a_curvature_are_where_they_are() -> None:
    """The curvature of a function is sampled; it turns at multiples of pi, however small it is."""
    for sign in (0.05, -0.05):
        law = FunctionLaw(
            derivative=lambda r, sign=sign: sign * np.sin(r), curvature=lambda r, sign=sign: sign * np.cos(r), reach=8.0
        )
        np.testing.assert_allclose(law.knots[0], np.pi * np.arange(-3.0, 4.0), atol=0.1)


def test_what_grows_a_little_faster_than_a_square_is_seen() -> None:
    assert FormulaLaw("5e-12*abs(r)^3").asymptotic_curvature(1.0)[0] == np.inf
    assert FormulaLaw("-5e-12*abs(r)^3").asymptotic_curvature(-1.0)[0] == -np.inf


def test_growth_of_functions() -> None:
    bounded = FunctionLaw(np.log1p, lambda r: 1.0 / (1.0 + r), even=True)
    assert bounded.growth[1][0] == 0.0
    assert bounded.growth[0][0] == pytest.approx(1.0, rel=1e-6)
    rising = FunctionLaw(derivative=lambda r: r + 1.0 / (1.0 + ((r - 1.0051) / 0.02) ** 2))
    assert rising.growth[1][0] == pytest.approx(1.0, rel=1e-3)
    assert rising.growth[0][0] == pytest.approx(1.0, abs=2e-3)


def test_pieces_beyond_the_end_of_a_law_are_empty() -> None:
    """Few knots and many; the same for the place and for the value."""
    few = PiecewiseQuadratic(np.array([-0.1, 0.0, 0.2]), np.ones(4), np.zeros(3), lower=-0.1, upper=0.2)
    knots = np.linspace(-0.1, 0.2, 61)
    many = PiecewiseQuadratic(knots, np.ones(62), np.zeros(61), lower=-0.1, upper=0.2)
    assert many.searched
    for law in (few, many):
        last = law.knots.shape[-1]
        low, high = piece_bounds(law, np.array([0, 1, last]))
        np.testing.assert_array_equal(low[[0, 2]], [-0.1, 0.2])
        np.testing.assert_array_equal(high[[0, 2]], [-0.1, 0.2])
        assert low[1] == -0.1 < high[1]
        single = piece_bounds(law, np.array(0))
        assert (single[0], single[1]) == (-0.1, -0.1)
        assert np.all(np.isinf(law.value(np.array([-0.11, 0.21]))))
        empty = law.subdifferential(np.array([-0.11, 0.21]))
        assert np.all(empty.lower == np.inf)
        assert np.all(empty.upper == -np.inf)


def test_of_several_laws_one_whose_constants_are_sampled_is_enough() -> None:
    sampled = FunctionLaw(np.log1p, lambda r: 1.0 / (1.0 + r), even=True)
    known = ThresholdCompliance(0.3)
    both = stack([(sampled, 1), (known, 2)])
    assert both.proof("alpha").evidence == both.proof("growth").evidence == Evidence.SAMPLED
    assert both.proof("alpha").doubt == "known from samples only"
    known_only = stack([(known, 1), (ThresholdCompliance(0.5), 2)])
    assert known_only.proof("alpha").sure
    assert known_only.proof("growth").sure
    assert str(sampled.describe()).count("(sampled)") == 2
    assert "(sampled)" not in str(known.describe())


GROWTH, ALPHA, PROVED = FormulaLaw("r^2"), FormulaLaw("sqrt(1 + r^2)"), FormulaLaw("sin(r)")


@pytest.mark.parametrize(
    ("law", "alpha", "growth"), [(GROWTH, False, True), (ALPHA, True, False), (PROVED, False, False)]
)
def test_a_law_made_of_others_has_their_doubts_and_no_more(law: Superpotential, alpha: bool, growth: bool) -> None:
    """Each constant by itself: the growth of r^2 is sampled and its alpha is known, of sqrt(1 + r^2) the other way."""
    assert (not law.proof("alpha").sure, not law.proof("growth").sure) == (alpha, growth)
    slow = law.scaled(np.array([1.0, 0.1]))
    made = [slow, stack([(ThresholdCompliance(0.3), 1), (law, 2)]), plus(FormulaLaw("r"), slow), affine(law, 2.0, 0.1)]
    made += [affine(stack([(law, 2)]), 0.5), slow.take(np.array([1]))]
    for one in made:
        found = (not one.proof("alpha").sure, not one.proof("growth").sure)
        assert found == (alpha, growth), type(one)


def test_a_class_that_says_its_constants_are_sampled_means_both() -> None:
    class Guessed(ThresholdCompliance):
        def proof(self, constant: Constant) -> Proof:
            return SAMPLED

    law = Guessed(0.3)
    assert not law.proof("alpha").sure
    assert not law.proof("growth").sure
    assert not stack([(ThresholdCompliance(0.3), 1), (law, 1)]).proof("growth").sure


def test_a_description_says_where_each_formula_holds() -> None:
    law = PiecewiseQuadratic(np.array([0.0, 0.1, 0.3]), np.array([0.0, 2.0, -0.5, 1.0]), np.array([0.5, 0.0, -0.1]))
    told = law.describe()
    assert told.pieces == (
        "j'(r) = 0   for r < 0",
        "j'(r) = 0.5 + 2 r   for 0 < r < 0.1",
        "j'(r) = 0.75 - 0.5 r   for 0.1 < r < 0.3",
        "j'(r) = 0.2 + 1 r   for 0.3 < r",
    )
    assert [str(kink) for kink in told.kinks] == [
        "jump up from 0 to 0.5 at r = 0",
        "jump down from 0.6 to 0.5 at r = 0.3",
    ]
    assert told.domain == (-np.inf, np.inf)
    assert (told.alpha, told.alpha_places) == (np.inf, (0.3,))
    assert Softening(2.0, 0.1, 0.5).describe().alpha_places == (0.1,)


@pytest.mark.parametrize(
    ("knots", "ends", "text"),
    [
        ([-2.0, 0.0], {"lower": -2.0}, "j is finite for r >= -2 only"),
        ([0.0, 1.5], {"upper": 1.5}, "j is finite for r <= 1.5 only"),
        ([-2.0, 1.5], {"lower": -2.0, "upper": 1.5}, "j is finite for r >= -2 and r <= 1.5 only"),
        ([-2.0, 1.5], {}, None),
    ],
)
def test_a_description_says_where_the_law_ends(knots: list[float], ends: dict[str, float], text: str | None) -> None:
    law = PiecewiseQuadratic(np.array(knots), np.array([0.0, 1.0, 0.0]), np.zeros(2), **ends)
    said = [line for line in law.describe().lines if "finite for" in line]
    assert said == ([] if text is None else [text])


# ---- bounds -------------------------------------------------------------------------------------------------


def test_branches_that_meet_up_to_rounding_do_not_jump() -> None:
    assert 0.1 * 0.7 * 3.0 != 0.21
    bound = PenetrationBound("piecewise((0.1*s*3, s < 0.7), (0.21, True))")
    assert bound.lipschitz[0] == pytest.approx(0.3, rel=1e-6)


def test_a_jump_of_a_tiny_bound_is_a_jump() -> None:
    for size in (1e-8, 1.0, 1e8):
        assert PenetrationBound(lambda s, size=size: size * (s > 0.1)).lipschitz[0] == np.inf


def test_a_bound_is_known_as_far_as_it_is_asked() -> None:
    assert PenetrationBound("min(s, 5000)", reach=1e4).lipschitz[0] == pytest.approx(1.0, rel=1e-9)
    assert PenetrationBound("max(-3*(s + 5000), s + 5000)", reach=1e4).lipschitz[0] == pytest.approx(3.0, rel=1e-9)
    assert PenetrationBound(([0.0, 1.0], [0.0, 3.0])).proof.sure


def test_a_branch_of_a_bound_that_holds_elsewhere_is_not_asked_in_contact() -> None:
    """Each would be negative at a penetration where another branch holds: at 0, or at the reach."""
    bound = PenetrationBound("max(-3*(s + 1), s + 1)")
    np.testing.assert_allclose(bound.value(np.array([-2.0, 0.0, 1.0]), np.zeros(3)), [3.0, 1.0, 2.0])
    assert PenetrationBound("max(30 - s, 100*(s - 40))").lipschitz[0] == pytest.approx(100.0, rel=1e-6)
    for text in ("max(-3*(s + 1), s - 1)", "max(9 - s, 100*(s - 20))"):
        with pytest.raises(ProblemError, match="at least 0 where the body penetrates"):
            PenetrationBound(text)


def test_a_bound_without_a_constant_says_so() -> None:
    bound = PenetrationBound("sqrt(max(s, 0))")
    assert not bound.proof.sure or bound.lipschitz[0] == np.inf


def test_a_function_that_is_negative_somewhere_is_no_bound() -> None:
    with pytest.raises(ProblemError, match="it must be finite, and at least 0"):
        PenetrationBound(lambda s: 1.0 - 0.2 * s)
    with pytest.raises(ProblemError, match="-1 at penetration 5"):
        PenetrationBound(lambda s: 1.0 - 0.4 * s, reach=2.0).value(np.array([1.0, 5.0]), np.zeros(2))


def test_a_contact_law_says_whether_a_constant_of_its_bound_is_sampled() -> None:
    def law(bound: StateBound | float, profile: Superpotential | None = None) -> ContactLaw:
        return ContactLaw(ThresholdCompliance(0.3), Friction(bound) if profile is None else Friction(bound, profile))

    own = PenetrationBound(lambda s: np.clip(8.0 * s, 0.0, 0.8))
    exact = PenetrationBound(([0.0, 0.1], [0.0, 0.8]))
    sampled = FunctionLaw(np.log1p, lambda r: 1.0 / (1.0 + r), even=True)
    for bound, profile, expected in (
        (own, None, True),
        (exact, None, False),
        (exact, sampled, True),
        (0.5, sampled, False),
        (CoulombBound(0.3), sampled, False),
        (PenetrationBound(lambda s: 0.5 + 0.0 * s), sampled, True),  # samples may have missed a slope
    ):
        found = law(bound, profile)
        assert found.proof("lipschitz").sure is not expected
        assert found.lipschitz[0] == (
            8.0 if bound is exact else bound.lipschitz[0] if isinstance(bound, StateBound) else 0.0
        )


def test_smooth_friction_is_bent_the_same_way_in_all_directions_at_rest() -> None:
    law = ContactLaw(ThresholdCompliance(0.3), Friction(2.0, FormulaLaw("r^2", even=True)))
    line = law.linearise(np.array([[0.1, 0.0, 0.0]]))
    assert line.smooth.all()
    np.testing.assert_allclose(line.hessian[0, 1:, 1:], 4.0 * np.eye(2))


# ---- what a look at a user's law finds ----------------------------------------------------------------------


def test_one_side_is_enough_to_refuse_a_derivative_without_bound() -> None:
    for side in (1.0, -1.0):
        with pytest.raises(ProblemError, match="without bound"):
            FunctionLaw(
                lambda r, side=side: np.sqrt(np.maximum(side * r, 0.0)),
                lambda r, side=side: 0.5 * side * (side * r > 0.0) / np.sqrt(np.abs(r)),
                kinks=[0.5 * side],
            )


def test_a_small_jump_down_and_a_fall_on_the_negative_side_are_seen() -> None:
    class Falling(Table):
        told = 0.5

    ContactLaw(Falling(np.array([-0.3, -0.1]), np.array([0.0, -0.5, 0.0]), np.zeros(2)))
    with pytest.raises(ProblemError, match=r"alpha of law 'piecewise' is 0.5, but its derivative falls by 2"):
        ContactLaw(Falling(np.array([-0.3, -0.1]), np.array([0.0, -2.0, 0.0]), np.zeros(2)))
    with pytest.raises(ProblemError, match=r"jumps down at r = 0.2: give alpha = inf"):
        ContactLaw(Falling(np.array([0.0, 0.2]), np.array([0.0, 3.0, 0.0]), np.array([0.0, -3e-3])))


@pytest.mark.parametrize(("limit", "stiffness"), [(0.1, 2.0), (0.35, 1.0), (0.5, 7.0)])
def test_a_law_that_is_constant_beyond_a_knot_has_a_finite_slope(limit: float, stiffness: float) -> None:
    """Rounding of the value over ever shorter steps is no slope."""
    table = Softening(stiffness, limit, 0.3 * stiffness).table
    own = type("Own", (PiecewiseQuadratic,), {"__module__": __name__})
    ContactLaw(own(table.breakpoints[0], table.slopes[0], table.jumps[0]))


def test_of_a_law_with_several_points_the_first_is_looked_at() -> None:
    class Bent(PiecewiseQuadratic):
        bend = 1.0

        def piece_curvature(self, piece: IntArray, r: Array) -> Array:
            return self.bend * super().piece_curvature(piece, r)

        def take(self, index: IntArray) -> PiecewiseQuadratic:
            rows = type(self)(self.breakpoints[index], self.slopes[index], self.jumps[index])
            return rows

    table = np.zeros((2, 1)), np.array([[0.0, 3.0], [0.0, 4.0]]), np.zeros((2, 1))
    ContactLaw(Bent(*table))
    with pytest.raises(ProblemError, match="the curvature of law 'piecewise' is 6 between"):
        ContactLaw(type("Wrong", (Bent,), {"bend": 2.0, "__module__": __name__})(*table))


@pytest.mark.parametrize("bad", [[], [np.nan], [[0.1]], [np.inf], "a", [0.1, None]])
def test_lists_of_layers_are_finite_numbers(bad: Any) -> None:
    with pytest.raises(ProblemError, match=r"thicknesses of law 'layered' (must be a list|is not an array) of"):
        Layered(bad, [1.0])


def spoiled(law: PiecewiseQuadratic, **methods: Callable[..., Any]) -> str:
    """What the kit says of a law with some of its methods replaced."""
    spoiled = type("Spoiled", (type(law),), methods)
    with pytest.raises(LawError) as caught:
        check_law(spoiled(law.breakpoints, law.slopes, law.jumps, law.start, law.lower, law.upper))
    return str(caught.value)


SOFT = table_law([0.0, 0.1, 0.5], [0.0, 0.2, 0.0])


def test_the_kit_sees_answers_that_depend_on_the_company() -> None:
    def derivative(self: PiecewiseQuadratic, r: Array) -> Array:
        return np.asarray(PiecewiseQuadratic.derivative(self, r) * (1.0 + 1e-4 * (r.size == 12)))

    assert "derivative at contact point" in spoiled(SOFT, derivative=derivative)


def test_the_kit_sees_minimisers_of_a_scaled_law_that_are_a_little_off() -> None:
    class Off(PiecewiseQuadratic):
        def local_argmin(self, a: Array, b: Array) -> Array:
            return np.asarray(super().local_argmin(a, b) + 2e-4)

    def scaled(self: PiecewiseQuadratic, factor: Array | float) -> PiecewiseQuadratic:
        kind = Off if np.size(factor) == 1 and np.max(factor) == 3.0 else PiecewiseQuadratic
        f = np.atleast_1d(factor)
        return kind(self.breakpoints, f[:, None] * self.slopes, f[:, None] * self.jumps, f * self.start)

    assert "scaled(3) does not have the minimisers" in spoiled(SOFT, scaled=scaled)


def test_the_kit_looks_at_a_knot_at_the_end_of_its_reach() -> None:
    assert check_law(table_law([-1.0, -1.0, 1.0, 1.0], [-2.0, -1.0, 1.0, 3.0]), reach=1.0).passed


def test_the_kit_sees_a_law_that_is_hardly_uneven() -> None:
    law = table_law([-0.02, 0.0, 0.02], [-1.0, 0.0, 1.0 + 1e-5])
    with pytest.raises(LawError, match=r"the law is even: it is not: j\(0\.\d"):
        check_law(law, reach=0.02, friction=True)


@pytest.mark.parametrize("size", [1e-4, 1.0, 1e4])
def test_friction_that_is_hardly_uneven_is_refused(size: float) -> None:
    Friction(1.0, table_law([-0.02, 0.0, 0.02], [-size, 0.0, size]))
    with pytest.raises(ProblemError, match=r"is not even: .* at r = 0.02 and"):
        Friction(1.0, table_law([-0.02, -0.01, 0.01, 0.02], size * np.array([-1.0, -0.5, 0.5, 1.0 + 1e-4])))


def test_the_kit_measures_company_by_the_size_of_the_law() -> None:
    def local_argmin(self: PiecewiseQuadratic, a: Array, b: Array) -> Array:
        return np.asarray(PiecewiseQuadratic.local_argmin(self, a, b) + 1e-8 * (np.size(a) == 12))

    law = table_law([0.0, 1e-4, 5e-4], [0.0, 0.2, 0.0])
    assert "local_argmin at contact point" in spoiled(law, local_argmin=local_argmin)


# ---- tables -------------------------------------------------------------------------------------------------


def test_the_second_slip_of_a_table_may_be_one() -> None:
    law = table_law([0.0, 1.0, 2.0], [1.0, 3.0, 3.0], friction=True)
    np.testing.assert_allclose(law.derivative(np.array([0.5, 1.5, -0.5])), [2.0, 3.0, -2.0])
    np.testing.assert_allclose(law.subdifferential(np.zeros(1)).upper, 1.0)
    later = table_law([0.5, 1.0], [1.0, 3.0], friction=True)
    np.testing.assert_allclose(later.derivative(np.array([0.25, 0.75, -0.25, 7.0])), [1.0, 2.0, -1.0, 3.0])


def test_of_many_knots_one_on_which_the_force_vanishes_is_the_minimiser() -> None:
    """A steep valley with its bottom exactly on a knot, among slopes that fall elsewhere."""
    r = np.linspace(-3.0, 3.0, 61)
    law = table_law(r, np.where(np.abs(r) < 0.35, 100.0 * r, 35.0 * np.sign(r) * (1.0 - 0.3 * np.abs(r))))
    assert law.searched
    at: IntArray = np.flatnonzero(np.abs(law.knots[0]) < 1e-12)
    knot = law.knots[0][at]
    a = np.ones(1)
    assert law.local_argmin(a, a * knot + law.derivative(knot)) == pytest.approx(knot, abs=1e-12)
