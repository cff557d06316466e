"""Growth of the energy along motions by hand, and verdicts that a few numbers decide."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.optimize
from numpy.typing import ArrayLike

from hemivar.basics.types import Array
from hemivar.discrete.recession import Coercivity, RecessionFunction, _cut_off, decide, growth_along
from hemivar.laws import (
    Compliance,
    ContactLaw,
    CoulombBound,
    Friction,
    NoContact,
    NoFriction,
    PiecewiseQuadratic,
    Signorini,
    ThresholdCompliance,
    Tresca,
)

INF = np.inf


def growth(
    work: ArrayLike, rows: ArrayLike, up: ArrayLike, down: ArrayLike, load: float | None = None, cones: ArrayLike = (),
    rates: ArrayLike = (),
) -> RecessionFunction:  # fmt: skip
    force = np.asarray(work, dtype=float)
    numbers = [np.asarray(given, dtype=float) for given in (rows, up, down)]
    lengths = np.asarray(rates, dtype=float)
    slips = np.asarray(cones, dtype=float).reshape(lengths.size, 2, force.size)
    size = float(np.abs(force).sum()) if load is None else load
    return RecessionFunction(force, size, *numbers, slips, lengths)


def test_growth_is_what_the_hinges_and_the_slips_take_less_the_work() -> None:
    some = growth(
        [1.0, 2.0], [[1.0, 1.0], [1.0, -1.0]], [3.0, 0.5], [7.0, 0.25], 10.0, [[[3.0, 0.0], [0.0, 4.0]]], [2.0]
    )
    # rows 2 and 0, slips (3, 4) of length 5
    value, size = some(np.array([1.0, 1.0]))
    assert value == pytest.approx(3.0 * 2.0 + 2.0 * 5.0 - 3.0)
    assert size == pytest.approx(10.0 + 6.0 + 10.0)
    # rows -3 and -1
    value, size = some(np.array([-2.0, -1.0]))
    assert value == pytest.approx(7.0 * 3.0 + 0.25 * 1.0 + 2.0 * np.hypot(6.0, 4.0) + 4.0)
    assert size == pytest.approx(20.0 + 21.0 + 0.25 + 2.0 * np.hypot(6.0, 4.0))


def test_growth_against_a_rigid_foundation_is_infinite_but_for_rounding() -> None:
    wall = growth([1.0], [[1.0]], [INF], [0.0])
    assert wall(np.array([1.0]))[0] == INF
    assert wall(np.array([-1.0]))[0] == 1.0
    tilted = growth([1.0, 0.0], [[1e-12, 1.0]], [INF], [0.0])
    assert tilted(np.array([1.0, 0.0]))[0] == -1.0  # it gives way by 1e-12
    assert growth([1.0, 0.0], [[1e-8, 1.0]], [INF], [0.0])(np.array([1.0, 0.0]))[0] == INF
    falls = growth([1.0], [[1.0]], [-INF], [0.0])
    assert falls(np.array([1.0]))[0] == -INF
    both = growth([1.0, 0.0], [[1.0, 0.0], [1.0, 0.0]], [-INF, INF], [0.0, 0.0])
    assert both(np.array([1.0, 0.0]))[0] == INF


def local(*points: ArrayLike) -> Array:
    """Local displacements of contact points, (m, d, a)."""
    return np.asarray(points, dtype=float)


def test_rates_of_laws_in_the_plane() -> None:
    """A pressure of at most 0.5 over weight 2 takes 1 a length; friction of at most 0.3 takes 0.6 on both sides."""
    law = ContactLaw(ThresholdCompliance(0.5, 0.0), Tresca(0.3)).at(np.zeros((1, 2)))
    some = growth_along(law, local([[1.0, 0.0], [0.0, 1.0]]), np.array([2.0]), np.array([0.25, 0.5]), 4.0)
    for z, expected in (((1, 0), 0.75), ((-1, 0), 0.25), ((0, 1), 0.1), ((0, -1), 1.1), ((1, 1), 0.85)):
        assert some(np.array(z, dtype=float))[0] == pytest.approx(expected)
    assert some.load == 4.0
    for bound in (0.0, 0.5, 1.0):  # a rate of 0, 1 and 2
        free = ContactLaw(NoContact(), Tresca(bound)).at(np.zeros((1, 2)))
        along = growth_along(free, local(np.eye(2)), np.array([2.0]), np.zeros(2), 1.0)
        assert along(np.array([0.0, 1.0]))[0] == along(np.array([0.0, -1.0]))[0] == 2.0 * bound
        assert along.up.size == (bound > 0.0)
    for jump in (0.0, 1.0, 2.0):  # what pulls with 0, 1 and 2 where it is open, and presses with nothing
        pulls = PiecewiseQuadratic([0.0], [0.0, 0.0], [jump], start=-jump)  # type: ignore[arg-type]
        opening = growth_along(ContactLaw(pulls).at(np.zeros((1, 1))), local([[1.0]]), np.ones(1), np.zeros(1), 1.0)
        assert (opening(np.ones(1))[0], opening(-np.ones(1))[0]) == (0.0, jump)
        assert opening.up.size == (jump > 0.0)


def test_rates_of_laws_in_space() -> None:
    """The length of the slip counts, not its parts; where friction is infinite no part may slip."""
    points = local(np.eye(3), np.eye(3))
    for bound in (0.0, 0.5, 1.0):  # a rate of 0, 1 and 2
        free = growth_along(
            ContactLaw(NoContact(), Tresca(bound)).at(np.zeros((1, 3))), points[:1], np.array([2.0]), np.zeros(3), 1.0
        )
        assert free(np.array([0.0, 3.0, -4.0]))[0] == pytest.approx(10.0 * bound)
        assert free.rates.size == (bound > 0.0)
    law = ContactLaw(NoContact(), Tresca(np.array([0.3, 0.5]))).at(np.zeros((2, 3)))
    some = growth_along(law, points, np.array([2.0, 1.0]), np.zeros(3), 1.0)
    assert some(np.array([5.0, 3.0, -4.0]))[0] == pytest.approx(1.1 * 5.0)
    assert some(np.array([5.0, 0.0, 0.0]))[0] == 0.0
    rigid = growth_along(
        ContactLaw(Signorini(), Tresca(0.3)).at(np.zeros((2, 3))), points, np.ones(2), np.zeros(3), 1.0
    )
    assert rigid(np.array([0.1, 3.0, 4.0]))[0] == INF
    assert rigid(np.array([-0.1, 3.0, 4.0]))[0] == pytest.approx(0.6 * 5.0)


@pytest.mark.parametrize("friction", [NoFriction(), Friction(CoulombBound(0.5))])
def test_friction_that_may_vanish_takes_nothing(friction: Friction) -> None:
    law = ContactLaw(Compliance(1.0), friction).at(np.zeros((1, 2)))
    some = growth_along(law, local(np.eye(2)), np.ones(1), np.zeros(2), 1.0)
    assert some(np.array([0.0, 1.0]))[0] == 0.0
    assert decide(some).verdict is Coercivity.BALANCED


def test_scalar_laws_have_no_friction() -> None:
    law = ContactLaw(ThresholdCompliance(0.5, 0.0), Tresca(0.3)).at(np.zeros((2, 1)))
    some = growth_along(law, local([[1.0]], [[-1.0]]), np.array([1.0, 3.0]), np.zeros(1), 1.0)
    assert some(np.array([1.0]))[0] == pytest.approx(0.5)
    assert some(np.array([-1.0]))[0] == pytest.approx(1.5)


def test_a_body_that_cannot_move_is_held() -> None:
    assert decide(growth([], np.zeros((0, 0)), [], [])).verdict is Coercivity.HELD


@pytest.mark.parametrize("units", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize(
    ("work", "up", "down", "verdict", "direction"),
    [
        (1.0, 2.0, 0.5, Coercivity.HELD, None),
        (1.0, 0.5, 0.0, Coercivity.FALLS, 1.0),
        (-1.0, 2.0, 0.5, Coercivity.FALLS, -1.0),
        (1.0, 1.0, 0.0, Coercivity.BALANCED, 1.0),
        (-1.0, 0.0, 1.0, Coercivity.BALANCED, -1.0),
        (1.0, INF, 0.0, Coercivity.HELD, None),
        (0.0, 1.0, 0.0, Coercivity.BALANCED, -1.0),
        (0.0, -1.0, 2.0, Coercivity.FALLS, 1.0),
        (1.0, -INF, 2.0, Coercivity.FALLS, 1.0),
    ],
)
def test_one_motion(
    units: float, work: float, up: float, down: float, verdict: Coercivity, direction: float | None
) -> None:
    found = decide(growth([units * work], [[1.0]], [units * up], [units * down]))
    assert found.verdict is verdict
    if direction is None:
        assert found.direction is None
    else:
        assert found.direction is not None
        assert found.direction[0] == direction
        least = {1.0: up - work, -1.0: down + work}[direction]
        assert found.growth == pytest.approx(units * least, abs=0.0)


@pytest.mark.parametrize("units", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("excess", [1e-8, -1e-8])
def test_a_hair_more_than_the_load_holds_and_a_hair_less_does_not(units: float, excess: float) -> None:
    """Rates of 1 +- 1e-8 against a work of 1 along each motion, beside a rate that is a thousand times larger."""
    rates = units * np.array([1.0 + excess, 1.0 + excess, 1e3])
    found = decide(growth([units, units], [[1, 0], [0, 1], [1, -1]], rates, rates))
    assert found.verdict is (Coercivity.HELD if excess > 0.0 else Coercivity.FALLS)
    if excess < 0.0:
        assert found.growth == pytest.approx(units * np.sqrt(2.0) * excess, rel=1e-6, abs=0.0)


@pytest.mark.parametrize("units", [1e-12, 1.0, 1e12])
def test_a_body_without_load_is_held_in_any_units(units: float) -> None:
    rates = units * np.ones(2)
    assert decide(growth([0.0, 0.0], np.eye(2), rates, rates)).verdict is Coercivity.HELD
    assert decide(growth([0.0, 0.0], np.eye(2), rates, [units, 0.0])).verdict is Coercivity.BALANCED
    assert decide(growth([0.0, 0.0], [[1, 1]], [units], [units])).verdict is Coercivity.BALANCED
    cone = [[[1.0, 0.0], [0.0, 1.0]]]
    assert decide(growth([0.0, 0.0], np.zeros((0, 2)), [], [], 0.0, cone, [units])).verdict is Coercivity.HELD


def test_conditions_on_both_sides_leave_no_motion() -> None:
    """Bilateral contact: every row is a condition twice, and each of them is taken up."""
    for work in ([0.0, -1.0], [1.0, 1.0], [-1.0, 0.5]):
        assert decide(growth(work, np.eye(2), [INF] * 2, [INF] * 2)).verdict is Coercivity.HELD
    three = np.array([[1.0, 0.2, 0.0], [0.0, 1.0, 0.3], [0.1, 0.0, 1.0], [1.0, 1.0, 1.0]])
    for sign in (1.0, -1.0):
        for axis in range(3):
            work = sign * np.eye(3)[axis]
            assert decide(growth(work, three, [INF] * 4, [INF] * 4)).verdict is Coercivity.HELD
            assert decide(growth(work, three[:2], [INF] * 2, [INF] * 2)).verdict is Coercivity.FALLS


def test_what_pulls_across_the_axes_is_found_there() -> None:
    """Along both axes the energy grows, along the diagonal it falls: the chord of the concave hinge must count."""
    found = decide(growth([0.0, 0.0], [[1.0, -1.0], [1.0, 1.0]], [1.0, -0.7], [1.0, -0.7], 1.0))
    assert found.verdict is Coercivity.FALLS
    assert found.direction is not None
    np.testing.assert_allclose(np.abs(found.direction), np.sqrt(0.5))
    assert found.growth == pytest.approx(-1.4 * np.sqrt(0.5))
    held = decide(growth([0.0, 0.0], [[1.0, -1.0], [1.0, 1.0], [1.0, 1.0]], [1.0, -0.7, 0.8], [1.0, -0.7, 0.8], 1.0))
    assert held.verdict is Coercivity.HELD


@pytest.mark.parametrize("status", [0, 1, 4])
def test_a_programme_that_ends_without_a_bound_holds_nothing(status: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Held is shown by bounds alone: not by a solver that gives up, nor by one that brings no multipliers."""

    def linprog(cost: Array, matrix: Array, *_: object, **__: object) -> SimpleNamespace:
        multipliers = SimpleNamespace(marginals=np.zeros(matrix.shape[0]))
        return SimpleNamespace(status=status, x=np.ones(len(cost)), ineqlin=multipliers)

    monkeypatch.setattr(scipy.optimize, "linprog", linprog)
    held = growth([1.0, 1.0], np.eye(2), [3.0, 3.0], [3.0, 3.0])
    assert decide(held).verdict is Coercivity.UNDECIDED
    falling = growth([1.0, 1.0], np.eye(2), [3.0, 0.5], [3.0, 3.0])
    assert decide(falling).verdict is Coercivity.FALLS  # a motion along an axis needs no programme


@pytest.mark.parametrize(("rate", "verdict"), [(-1.0, Coercivity.FALLS), (-0.8, None), (-0.5, Coercivity.HELD)])
def test_friction_that_pushes_counts_with_the_longest_slip(rate: float, verdict: Coercivity | None) -> None:
    """Along (1, 1) the slip is sqrt(2) long, and 1.2 is all that resists it."""
    some = growth([0.0, 0.0], [[1, -1], [1, 1]], [1.0, 0.6], [1.0, 0.6], 1.0, [np.eye(2)], [rate])
    assert some(np.ones(2))[0] == pytest.approx(1.2 + rate * np.sqrt(2.0))
    found = decide(some)
    if verdict is not None:
        assert found.verdict is verdict
    else:  # it grows, too little to be shown by the bounds of a box
        assert found.verdict in (Coercivity.HELD, Coercivity.UNDECIDED)
    if verdict is Coercivity.FALLS:
        assert found.growth == pytest.approx((1.2 + rate * np.sqrt(2.0)) / np.sqrt(2.0))


def test_slips_of_any_sign_on_random_growths_by_sampling_every_direction() -> None:
    rng = np.random.default_rng(23)
    angle = np.linspace(0.0, 2.0 * np.pi, 721)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    seen = dict.fromkeys(Coercivity, 0)
    for _ in range(30):
        q, p = int(rng.integers(2, 5)), int(rng.integers(1, 3))
        up, down = rng.uniform(0.2, 2.0, (2, q))
        some = growth(
            0.3 * rng.normal(size=2), rng.normal(size=(q, 2)), up, down, None, rng.normal(size=(p, 2, 2)),
            rng.uniform(-0.6, 0.2, p),
        )  # fmt: skip
        least = min(some(z)[0] for z in circle)
        found = decide(some)
        seen[found.verdict] += 1
        if least < -1e-3:
            assert found.verdict in (Coercivity.FALLS, Coercivity.UNDECIDED)
        if found.verdict is Coercivity.FALLS:
            assert found.growth < 0.0
    assert min(seen[Coercivity.HELD], seen[Coercivity.FALLS]) > 2


ACROSS, ALONG = [1.0, -1.0], [1.0, 1.0]


def skewed(across: float, along: float, up: float, down: float) -> RecessionFunction:
    """``across |x - y| + along |x + y|`` and a hinge of x + y that falls: concave where ``up + down < 0``."""
    return growth([0.0, 0.0], [ACROSS, ALONG, ALONG], [across, along, up], [across, along, down], 1.0)


@pytest.mark.parametrize(
    ("numbers", "verdict", "direction"),
    [
        ((9.0, 1.0, -3.0, -3.0), Coercivity.FALLS, None),
        ((9.0, 1.0, -0.2, -0.3), Coercivity.HELD, None),
        ((1.02, 3.0, -4.0, -0.1), Coercivity.FALLS, 1.0),
        ((1.02, 3.0, -0.1, -4.0), Coercivity.FALLS, -1.0),
        ((1.02, 3.0, -2.9, -2.9), Coercivity.HELD, None),
    ],
)
def test_a_hinge_that_falls_to_both_sides(
    numbers: tuple[float, float, float, float], verdict: Coercivity, direction: float | None
) -> None:
    """By hand: least along (1, 1) and (-1, -1), where the growth is 2 (along + up) and 2 (along + down) over sqrt 2."""
    found = decide(skewed(*numbers))
    assert found.verdict is verdict
    if verdict is Coercivity.FALLS:
        along, least = numbers[1], min(numbers[2:])
        assert found.growth == pytest.approx(np.sqrt(2.0) * (along + least))
    if direction is not None:
        assert found.direction == pytest.approx(direction * np.sqrt(0.5) * np.ones(2))


def test_what_is_in_balance_along_a_motion_of_both_grows_by_nothing() -> None:
    """Against a load of (1, 1) along (1, 1), where the hinge takes as much as the load does."""
    found = decide(growth([1.0, 1.0], [ACROSS, ALONG], [5.0, 1.0], [5.0, 3.0]))
    assert found.verdict is Coercivity.BALANCED
    assert found.direction == pytest.approx(np.sqrt(0.5) * np.ones(2))
    assert abs(found.growth) < 1e-9


@pytest.mark.parametrize("units", [1e-9, 1.0, 1e9])
def test_rates_far_above_the_load_are_cut_off_and_rigid_ones_stay_rigid(units: float) -> None:
    """At a thousand times the load, a row of size 2 and a slip of size 4; where one side falls, convex as before."""
    up, down = [1e9, INF, 1e9, 3.0, 1e9, 499.0], [1.0, 2.0, INF, 1e9, -1e6, 499.0]
    times = units * np.ones(6)
    some = growth(
        [units], [[2.0]] * 6, times * up, times * down, units, [[[4.0], [0.0]]] * 2, units * np.array([7.0, 1e5])
    )
    found = _cut_off(some)
    np.testing.assert_allclose(found.up / units, [500.0, INF, 1e9, 3.0, 1e6, 499.0])
    np.testing.assert_allclose(found.down / units, [1.0, 2.0, INF, 500.0, -1e6, 499.0])
    np.testing.assert_allclose(found.rates / units, [7.0, 250.0])
    assert some.up[0] == 1e9 * units  # what was given stays as it is
    still = growth([0.0], [[2.0]], [1e9], [1e9])
    assert _cut_off(still) is still
