"""A law that answers its primitives alone: all else follows, as the laws that know better say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array, IntArray
from hemivar.laws import (
    BilinearCohesion,
    Compliance,
    ContactLaw,
    CoupledFormulaLaw,
    MixedMode,
    PiecewiseQuadratic,
    Softening,
    VectorLaw,
)
from hemivar.laws.coupled.friction_beside import FrictionBeside
from hemivar.laws.superpotential import Interval
from hemivar.laws.testing import check_vector_law
from hemivar.laws.vector_law import Linearisation, Sides, at_normal_kink, snapped


@dataclass(frozen=True, eq=False)
class Primitive(VectorLaw):
    """The primitives of another law."""

    base: VectorLaw
    name: str = "primitive"

    def take(self, index: IntArray) -> VectorLaw:
        return Primitive(self.base.take(index))

    def value(self, r: Array) -> Array:
        return self.base.value(r)

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        return self.base.nearest_multiplier(r, lam)

    def local_argmin(self, a: Array, b: Array) -> Array:
        return self.base.local_argmin(a, b)

    def linearise(self, r: Array) -> Linearisation:
        return self.base.linearise(r)

    def recession(self, direction: Array) -> Array:
        return self.base.recession(direction)

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        return self.base.weak_convexity

    @property
    def penetrations(self) -> Interval:
        return self.base.penetrations


LAWS: dict[str, VectorLaw] = {
    "glue on springs": MixedMode(BilinearCohesion(stiffness=24.0, strength=2.4, energy=0.6), 1.5, Compliance(100.0)).at(
        None
    ),
    "glue on rigid ground": MixedMode(BilinearCohesion(stiffness=24.0, strength=2.4, energy=0.6), 1.5).at(None),
    "friction on springs": ContactLaw(Compliance(2.0), hv.Tresca(0.3)).at(None),
    "friction on rigid ground": ContactLaw(hv.Signorini(), hv.Tresca(0.3)).at(None),
}


@pytest.mark.parametrize("name", ["glue on springs", "friction on rigid ground"])
def test_they_pass_the_kit(name: str) -> None:
    check_vector_law(Primitive(LAWS[name]), reach=0.6)


def places(components: int) -> tuple[Array, Array, Array]:
    """Displacements at kinks and beside, multipliers, and compliances."""
    random = np.random.default_rng(4)
    r = random.uniform(-0.3, 0.0, (24, components))
    r[::2, 0], r[::3, 1:] = 0.0, 0.0
    r[1:6, 0] *= 1e-10
    return r, random.uniform(-2.0, 0.0, r.shape), random.uniform(0.02, 0.2, (24, 2))


@pytest.mark.parametrize("components", [2, 3])
@pytest.mark.parametrize("name", sorted(LAWS))
def test_what_follows_is_what_the_law_says(name: str, components: int) -> None:
    law, one = LAWS[name], Primitive(LAWS[name])
    r, lam, tau = places(components)
    np.testing.assert_allclose(one.distance(r, lam), law.distance(r, lam), rtol=1e-12, atol=1e-15)
    for pair in (lam, law.nearest_multiplier(r, lam)):
        off, fitted = one.graph_distance(r, pair, tau), one.fitted(r, pair, tau)
        missed = np.linalg.norm((r - fitted) / tau[:, [0, *[1] * (components - 1)]], axis=1)
        np.testing.assert_allclose(np.hypot(missed, law.distance(fitted, pair)), off, rtol=1e-12, atol=1e-15)
        if "glue" in name:  # it knows that a slip of zero is no kink
            assert (off <= law.graph_distance(r, pair, tau) * (1.0 + 1e-12) + 1e-15).all()
            continue
        np.testing.assert_allclose(off, law.graph_distance(r, pair, tau), rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(fitted, law.fitted(r, pair, tau), atol=1e-15)
    np.testing.assert_array_equal(snapped(one, r, 1e-8)[:, 0], snapped(law, r, 1e-8)[:, 0])
    np.testing.assert_array_equal(at_normal_kink(one, r), at_normal_kink(law, r))
    np.testing.assert_array_equal(one.admissible(r), law.admissible(r))
    for rate, expected in zip(one.rates, law.rates, strict=True):
        np.testing.assert_allclose(rate, expected)
    outside = np.full((1, components), 0.2)
    np.testing.assert_allclose(one.distance(outside, 0.0 * outside), law.distance(outside, 0.0 * outside))
    for sign in (-1.0, 1.0):
        for bend, expected in zip(one.asymptotic_curvature(sign), law.asymptotic_curvature(sign), strict=True):
            np.testing.assert_allclose(bend, expected)


def seen(sides: list[Sides]) -> list[Sides]:
    return [one for one in sides if one.point.size]


def test_a_pair_at_rest_uses_a_share_of_what_resists() -> None:
    """0.25 of 0.3 is held, 0.3 is at the end; the curvature of what opens is that of the springs."""
    one = Primitive(ContactLaw(Compliance(2.0), hv.Tresca(0.3)).at(None))
    r, tau = np.array([[0.1, 0.0, 0.0]] * 2), np.full((2, 2), 0.1)
    lam = np.array([[0.2, 0.15, 0.2], [0.2, 0.18, 0.24]])
    rest, normal = seen(one.sides(r, lam, np.ones((2, 3), dtype=bool), tau, 1e-9))
    np.testing.assert_allclose(rest.multiplier, [0.25, 0.25, 0.3, 0.3])
    np.testing.assert_allclose(rest.above, 0.3)
    np.testing.assert_allclose(normal.axis, [[1.0, 0.0, 0.0]] * 2)
    np.testing.assert_allclose([normal.curvature_below, normal.curvature_above], 2.0)
    np.testing.assert_allclose(one.resistance(r, lam), 0.3)


def test_a_kink_has_two_sides() -> None:
    """Glue of stiffness 5 that touches rigid ground: springs in opening, no end above."""
    rigid = Primitive(MixedMode(BilinearCohesion(stiffness=5.0, strength=1.0, energy=0.6), 1.0).at(None))
    still = np.zeros((1, 2))
    lam, active, tau = np.array([[0.4, 0.0]]), np.ones((1, 2), dtype=bool), np.full((1, 2), 0.1)
    normal, slip = seen(rigid.sides(still, lam, active, tau, 1e-9))
    assert (normal.below[0], normal.above[0], normal.curvature_below[0]) == (0.0, np.inf, 5.0)
    np.testing.assert_allclose((slip.curvature_below[0], slip.curvature_above[0]), 5.0)


def test_a_law_that_lets_go_at_once_falls_at_its_kink() -> None:
    """Glue of stiffness 5 breaks at the opening 0.4: it pulls with 2 before, with nothing beyond."""
    law = ContactLaw(PiecewiseQuadratic([-0.4, 0.0], [0.0, 5.0, 0.0], [-2.0, 0.0])).at(None)
    r, active, tau = np.array([[-0.4]]), np.ones((1, 1), dtype=bool), np.full((1, 2), 0.1)
    for one in (law, Primitive(law)):
        (side,) = seen(one.sides(r, np.array([[-1.0]]), active, tau, 1e-9))
        np.testing.assert_allclose((side.below[0], side.above[0]), (0.0, -2.0))


def test_springs_end_where_nothing_goes_deeper() -> None:
    law = ContactLaw(PiecewiseQuadratic([0.0, 0.1], [0.0, 2.0, 0.0], [0.0, 0.0], upper=0.1)).at(None)
    r, active, tau = np.array([[0.1]]), np.ones((1, 1), dtype=bool), np.full((1, 2), 0.1)
    for one in (law, Primitive(law)):
        (side,) = seen(one.sides(r, np.array([[1.0]]), active, tau, 1e-9))
        np.testing.assert_allclose((side.below[0], side.above[0]), (0.2, np.inf))


def test_where_a_curvature_jumps_the_lower_one_counts() -> None:
    """At the peak of glue it is 24 before and -6 beyond along the opening, and the secant across it."""
    one = Primitive(LAWS["glue on springs"])
    active, tau = np.ones((1, 2), dtype=bool), np.full((1, 2), 0.1)
    opening, across = seen(one.sides(np.array([[-0.1, 0.0]]), np.array([[-2.4, 0.0]]), active, tau, 1e-8))
    np.testing.assert_allclose(np.abs([opening.axis[0], across.axis[0]]), np.eye(2))
    np.testing.assert_allclose((opening.curvature_below[0], opening.curvature_above[0]), (-6.0, 24.0))
    np.testing.assert_allclose((across.curvature_below[0], across.curvature_above[0]), 54.0)


def test_a_rigid_formula_resists_a_slip_no_more_than_its_slope() -> None:
    """It was infinite, for ways along the surface counted as ways into it."""
    law = CoupledFormulaLaw("0.02*(1 - exp(-(r^2 + 4*s^2)/0.09))", reach=2.0, rigid=True)
    up, down, slip = law.strongest(np.zeros((1, 2)), 1.5)
    steepest = 0.02 * np.sqrt(2.0 / 0.09) * np.exp(-0.5)  # along r; twice that along s
    assert up[0] == np.inf
    share = np.sqrt(0.5)  # of both together, on the way on which each does as much
    np.testing.assert_allclose([down[0], slip[0]], [share * steepest, 2.0 * share * steepest], rtol=0.02)


def test_glue_that_touches_springs_is_as_stiff_as_they_are() -> None:
    """Of both sides of the displacement 0; it had no stiffness there at all."""
    line = LAWS["glue on springs"].linearise(np.zeros((1, 2)))
    np.testing.assert_allclose(line.hessian[0], np.diag([100.0, 54.0]))


def test_a_slip_from_rest_counts_from_the_middle_of_what_is_there() -> None:
    """Glue of stiffness 54 along the slip has slipped by 0.02: friction has up to 0.5 beside these 1.08."""
    law = FrictionBeside(LAWS["glue on springs"], np.array([0.5]), np.array([[0.02]]))
    r, lam = np.array([[0.1, 0.02]]), np.array([[10.0, 1.38]])
    rest, normal = seen(law.sides(r, lam, np.ones((1, 2), dtype=bool), np.full((1, 2), 0.1), 1e-9))
    np.testing.assert_allclose((rest.multiplier[0], rest.below[0], rest.above[0]), (0.3, -0.5, 0.5))
    np.testing.assert_allclose((rest.curvature_below[0], normal.curvature_below[0]), (54.0, 100.0))


def test_beside_rigid_ground_it_is_as_stiff_as_it_is() -> None:
    one = Primitive(LAWS["glue on rigid ground"])
    r, tau = np.array([[-1e-12, -0.01]]), np.full((1, 2), 0.1)
    bends = [side.curvature_below[0] for side in seen(one.sides(r, 0.0 * r, np.ones((1, 2), dtype=bool), tau, 1e-8))]
    np.testing.assert_allclose(sorted(bends), [24.0, 54.0])


def test_downhill_stays_in_the_valley_where_it_begins() -> None:
    """Glue of stiffness 24 on a spring of 3, pulled by 1.35: intact at 0.05, and lower where it is broken, at 0.45."""
    one = Primitive(MixedMode(BilinearCohesion(stiffness=24.0, strength=2.4, energy=0.2), 1.5).at(None))
    a, b = np.full((2, 2), 3.0), np.array([[-1.35, 0.0]] * 2)
    found = one.local_minimiser(a, b, np.array([[-0.01, 0.0], [-0.4, 0.0]]))
    np.testing.assert_allclose(found, [[-0.05, 0.0], [-0.45, 0.0]], atol=1e-12)


def test_what_misses_a_kink_by_rounding_is_put_on_it() -> None:
    one = Primitive(LAWS["friction on rigid ground"])
    found = snapped(one, np.array([[-1e-10, 1e-10], [-1e-3, 1e-3]]), 1e-9)
    np.testing.assert_array_equal(found, [[0.0, 0.0], [-1e-3, 1e-3]])


def test_glue_is_past_its_peak_where_it_opens_and_falls() -> None:
    one = Primitive(LAWS["glue on springs"])
    r = np.array([[-0.05, 0.0], [-0.2, 0.0], [0.01, 0.15]])  # before the peak, beyond it, pressed
    assert one.past_peak(r).tolist() == [False, True, False]
    springs = Primitive(ContactLaw(Softening(4.0, 0.2, 1.5)).at(None))
    assert springs.linearise(np.array([[0.5]])).hessian[0, 0, 0] < 0.0
    assert not springs.past_peak(np.array([[0.5]]))[0]


def test_without_a_slip_nothing_is_met_aslant() -> None:
    one = Primitive(ContactLaw(Compliance(2.0)).at(None))
    up, down, slip = one.strongest(np.zeros((1, 1)), 1.5)
    np.testing.assert_allclose((up[0], down[0], slip[0]), (3.0, 0.0, 0.0), atol=1e-12)
