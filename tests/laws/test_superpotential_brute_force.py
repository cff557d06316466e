"""Every scalar law against brute force on a dense grid, and the identities that tie its answers together."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws import (
    Adhesive,
    Bilateral,
    Compliance,
    NoContact,
    PiecewiseQuadratic,
    Signorini,
    Superpotential,
    ThresholdCompliance,
)
from hemivar.laws.friction import ABSOLUTE_VALUE
from hemivar.laws.friction.profiles import LogarithmicWeakening
from hemivar.laws.piecewise_law import stack

NAMED = {
    "survey": ThresholdCompliance(0.3, 2.0),
    "survey without slope": ThresholdCompliance(0.7),
    "signorini": Signorini(),
    "bilateral": Bilateral(),
    "none": NoContact(),
    "spring": Compliance(3.0),
    "power": Compliance(5.0, 2.5),
    "tresca": ABSOLUTE_VALUE.scaled(0.5),
    "stacked": stack([(ThresholdCompliance(0.3, 2.0), 1)]),
}

numbers = st.floats(-3.0, 3.0, allow_nan=False)


@st.composite
def tables(draw: st.DrawFn, convex: bool = False) -> PiecewiseQuadratic:
    """Random piecewise-quadratic laws with up and down jumps, coercive at both ends."""
    count = draw(st.integers(1, 4))
    gaps = draw(st.lists(st.floats(0.05, 1.0), min_size=count, max_size=count))
    knots = np.cumsum(gaps) - draw(st.floats(0.0, 2.0))
    low = 0.0 if convex else -2.0
    slopes = np.array(draw(st.lists(st.floats(low, 2.0), min_size=count + 1, max_size=count + 1)))
    slopes[[0, -1]] = np.abs(slopes[[0, -1]])
    jumps = np.array(draw(st.lists(st.floats(low, 2.0), min_size=count, max_size=count)))
    lower = knots[0] if draw(st.booleans()) else -np.inf
    upper = knots[-1] if draw(st.booleans()) else np.inf
    return PiecewiseQuadratic(knots, slopes, jumps, draw(numbers), lower, upper)


def grid_of(law: Superpotential, reach: float = 12.0) -> np.ndarray:
    domain = law.domain
    grid = np.linspace(max(-reach, float(domain.lower[0])), min(reach, float(domain.upper[0])), 40001)
    finite = law.knots[np.isfinite(law.knots)]
    return np.unique(np.concatenate([grid, finite]))


def _vector(law: Superpotential, grid: np.ndarray) -> np.ndarray:
    """Values of a law for one contact point on a whole grid."""
    try:
        return np.asarray(law.value(grid))
    except (ValueError, IndexError):
        return np.array([law.value(np.array([x]))[0] for x in grid])


def check_minimiser(law: Superpotential, a: float, b: float) -> None:
    grid = grid_of(law)
    energies = 0.5 * a * grid**2 - b * grid + _vector(law, grid)
    best = float(energies.min())
    r = law.local_argmin(np.array([a]), np.array([b]))
    found = float((0.5 * a * r**2 - b * r + law.value(r))[0])
    assert np.isfinite(found)
    # The grid can only be worse than the true minimum, and by less than its spacing allows.
    assert found <= best + 1e-12 * (1.0 + abs(best))
    if np.abs(grid[np.argmin(energies)]) < 11.9:
        assert found >= best - 1e-5


def check_prox(law: Superpotential, x: float, tau: float) -> None:
    grid = grid_of(law)
    energies = _vector(law, grid) + (grid - x) ** 2 / (2.0 * tau)
    r = law.prox(np.array([x]), tau)
    found = float((law.value(r) + (r - x) ** 2 / (2.0 * tau))[0])
    assert found <= energies.min() + 1e-12 * (1.0 + abs(energies.min()))
    lam = (x - r) / tau
    assert float(law.distance(r, lam)[0]) <= 1e-9 * (1.0 + abs(lam[0]))


@pytest.mark.parametrize("name", NAMED)
@given(a=st.floats(0.2, 20.0), b=numbers)
@settings(max_examples=25, deadline=None)
def test_named_laws_minimise_the_local_energy(name: str, a: float, b: float) -> None:
    check_minimiser(NAMED[name], a, b)


@pytest.mark.parametrize("name", NAMED)
@given(x=numbers, tau=st.floats(0.05, 2.0))
@settings(max_examples=25, deadline=None)
def test_named_laws_have_the_right_prox(name: str, x: float, tau: float) -> None:
    check_prox(NAMED[name], x, tau)


@given(law=tables(), a=st.floats(2.5, 20.0), b=numbers)
@settings(max_examples=150, deadline=None)
def test_any_table_minimises_the_local_energy(law: PiecewiseQuadratic, a: float, b: float) -> None:
    check_minimiser(law, a, b)


@given(law=tables(), a=st.floats(0.3, 1.5), b=numbers)
@settings(max_examples=100, deadline=None)
def test_the_minimiser_is_global_where_the_local_energy_is_not_convex(
    law: PiecewiseQuadratic, a: float, b: float
) -> None:
    check_minimiser(law, a, b)


@given(law=tables(), x=numbers, tau=st.floats(0.05, 0.4))
@settings(max_examples=100, deadline=None)
def test_any_table_has_the_right_prox(law: PiecewiseQuadratic, x: float, tau: float) -> None:
    check_prox(law, x, tau)


@given(law=tables(convex=True), a=st.floats(0.2, 20.0), b=numbers)
@settings(max_examples=100, deadline=None)
def test_the_shortcut_for_convex_laws_agrees_with_the_enumeration(law: PiecewiseQuadratic, a: float, b: float) -> None:
    points, energies = law.local_minimisers(np.array([a]), np.array([b]))
    expected = points[0, int(np.argmin(energies[0]))]
    assert float(law.local_argmin(np.array([a]), np.array([b]))[0]) == pytest.approx(expected, abs=1e-12)


def integral(law: PiecewiseQuadratic, low: float, high: float) -> float:
    """That of the derivative, which is linear between knots: the midpoint rule is exact."""
    ends = np.unique(np.clip(np.append(law.knots[0], [low, high]), low, high))
    return sum(float(law.derivative(np.array([0.5 * (a + b)]))[0]) * (b - a) for a, b in itertools.pairwise(ends))


@given(law=tables(), left=numbers, right=numbers)
@settings(max_examples=100, deadline=None)
def test_value_is_the_integral_of_the_derivative(law: PiecewiseQuadratic, left: float, right: float) -> None:
    low = np.clip(min(left, right), law.domain.lower[0], law.domain.upper[0])
    high = np.clip(max(left, right), law.domain.lower[0], law.domain.upper[0])
    difference = float((law.value(np.array([high])) - law.value(np.array([low])))[0])
    assert difference == pytest.approx(integral(law, low, high), abs=1e-11)


@given(law=tables(), r=numbers, size=st.integers(-12, 0))
@settings(max_examples=100, deadline=None)
def test_small_values_keep_their_digits_beside_far_knots(law: PiecewiseQuadratic, r: float, size: int) -> None:
    rest, place = np.clip([0.0, r * 10.0**size], law.domain.lower[0], law.domain.upper[0])
    stored = float(law.value(np.array([place]))[0]) * (1.0 if place > rest else -1.0)
    assert stored == pytest.approx(integral(law, min(rest, place), max(rest, place)), rel=1e-11, abs=1e-13 * abs(place))


@pytest.mark.parametrize("share", [1.0, 1e-6, 1e-12])
def test_an_adhesive_stores_little_where_it_is_hardly_open(share: float) -> None:
    """The energy of its springs, not rounded by its fracture energy."""
    opening = share * 1e-3
    glue = Adhesive(3500.0, 100.0, 300.0).at(None)
    assert glue.value(np.array([-opening]))[0] == pytest.approx(1750.0 * opening**2, rel=1e-10, abs=0.0)


@pytest.mark.parametrize("name", NAMED)
@given(r=numbers)
@settings(max_examples=30, deadline=None)
def test_derivative_of_named_laws_is_that_of_their_value(name: str, r: float) -> None:
    law = NAMED[name]
    step = 1e-6
    points = np.array([r - step, r + step])
    inside = (points >= law.domain.lower[0]) & (points <= law.domain.upper[0])
    if not inside.all() or np.any(np.abs(law.knots[np.isfinite(law.knots)] - r) < 2 * step):
        return
    ahead, behind = law.value(points[1:]), law.value(points[:1])
    slope = float(((ahead - behind) / (2 * step))[0])
    assert slope == pytest.approx(float(law.derivative(np.array([r]))[0]), abs=1e-7)


@given(law=tables(), r=numbers, s=numbers)
@settings(max_examples=150, deadline=None)
def test_weak_convexity_bounds_every_decrease_of_the_derivative(law: PiecewiseQuadratic, r: float, s: float) -> None:
    alpha = float(law.weak_convexity[0])
    low, high = min(r, s), max(r, s)
    if low < law.domain.lower[0] or high > law.domain.upper[0] or low == high:
        return
    at_low = law.subdifferential(np.array([low]))
    at_high = law.subdifferential(np.array([high]))
    fall = float(at_low.upper[0] - at_high.lower[0])
    if np.isfinite(fall) and np.isfinite(alpha):
        assert fall <= alpha * (high - low) + 1e-10


def test_weak_convexity_is_sharp_and_infinite_at_downward_jumps() -> None:
    softening = PiecewiseQuadratic([0.0, 0.1, 0.5], [0.0, 2.0, -0.5, 0.0], [0.0, 0.0, 0.0])  # type: ignore[arg-type]
    assert softening.weak_convexity == pytest.approx(0.5)
    capped = PiecewiseQuadratic([0.0, 0.1], [0.0, 20.0, 0.0], [0.0, -2.0])  # type: ignore[arg-type]
    assert np.isinf(capped.weak_convexity).all()


@given(law=tables(), r=numbers)
@settings(max_examples=100, deadline=None)
def test_growth_constants_bound_the_subdifferential(law: PiecewiseQuadratic, r: float) -> None:
    c0, c1 = law.growth
    if not np.isfinite(c0).all():
        return
    interval = law.subdifferential(np.array([r]))
    largest = max(abs(float(interval.lower[0])), abs(float(interval.upper[0])))
    assert largest <= float(c0[0] + c1[0] * abs(r)) + 1e-10


@given(law=tables(), r=numbers, lam=numbers)
@settings(max_examples=100, deadline=None)
def test_distance_to_the_graph_is_zero_on_it_and_survives_rounding(
    law: PiecewiseQuadratic, r: float, lam: float
) -> None:
    point = np.clip(np.array([r]), law.domain.lower, law.domain.upper)
    interval = law.subdifferential(point)
    on_graph = np.clip(np.array([lam]), interval.lower, interval.upper)
    assert float(law.graph_distance(point, on_graph, 0.1)[0]) <= 1e-12
    knot = law.knots[:, 0]
    at_knot = law.subdifferential(knot)
    middle = np.clip(np.zeros(1), at_knot.lower, at_knot.upper)
    assert float(law.graph_distance(knot + 1e-15, middle, 0.1)[0]) <= 1e-13


def test_signorini_is_infinite_outside_and_no_penalty() -> None:
    law = Signorini()
    np.testing.assert_array_equal(law.value(np.array([-1.0, 0.0, 1e-300])), [0.0, 0.0, np.inf])
    np.testing.assert_array_equal(law.prox(np.array([-2.0, 5.0]), 1e-9), [-2.0, 0.0])
    assert np.isinf(law.subdifferential(np.zeros(1)).upper[0])
    assert law.distance(np.array([1e-300]), np.array([3.0]))[0] == np.inf


@pytest.mark.parametrize("beyond", [1, 60])
def test_a_knot_outside_the_domain_is_no_minimiser(beyond: int) -> None:
    """``r^2/2 - b r`` for r in [0, 1], with knots that the table has outside: ``r = min(max(b, 0), 1)``."""
    knots = np.concatenate([-1.0 - np.arange(beyond)[::-1], [0.0, 1.0], 2.0 + np.arange(beyond)])
    law = PiecewiseQuadratic(knots, np.zeros(knots.size + 1), np.zeros(knots.size), lower=0.0, upper=1.0)
    a, b = np.ones(4), np.array([-5.0, 0.0, 0.4, 7.0])
    np.testing.assert_allclose(law.local_argmin(a, b), [0.0, 0.0, 0.4, 1.0], atol=1e-15)


def test_recession_tells_how_far_a_law_holds() -> None:
    up, down = np.array([1.0]), np.array([-1.0])
    assert ThresholdCompliance(0.3, 2.0).recession(up) == np.inf
    assert ThresholdCompliance(0.3).recession(2 * up) == pytest.approx(0.6)
    assert ThresholdCompliance(0.3).recession(down) == 0.0
    assert Signorini().recession(up) == np.inf
    assert Bilateral().recession(down) == np.inf
    assert ABSOLUTE_VALUE.scaled(0.5).recession(-3 * up) == pytest.approx(1.5)


@pytest.mark.parametrize(
    "law", [ThresholdCompliance(np.ones(4), 2.0), Compliance(np.arange(1.0, 5.0)), Compliance(2.0, np.full(4, 1.5))]
)
def test_parameters_for_every_point(law: Superpotential) -> None:
    r = np.array([-0.1, 0.0, 0.2, 0.4])
    together = law.prox(r, 0.5), law.value(r), law.distance(r, np.full(4, 0.3))
    for j in range(4):
        one = law.take(np.array([j]))
        alone = one.prox(r[j : j + 1], 0.5), one.value(r[j : j + 1]), one.distance(r[j : j + 1], np.full(1, 0.3))
        for whole, part in zip(together, alone, strict=True):
            assert whole[j] == pytest.approx(part[0], abs=1e-14)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ThresholdCompliance(-0.1).at(None), ["q_max", "survey", "-0.1", "at least 0"]),
        (lambda: ThresholdCompliance(float("nan")).at(None), ["q_max", "finite"]),
        (lambda: ThresholdCompliance("soft").at(None), ["q_max", "formula 'soft'"]),
        (lambda: ThresholdCompliance(lambda x: np.ones((3, 2))).at(np.zeros((4, 2))), ["q_max", "shape"]),
        (lambda: ThresholdCompliance(lambda x: x[:, 0]).prox(np.zeros(2), 1.0), ["q_max", "function of x", "law.at"]),
        (lambda: Compliance(1.0, 0.5).at(None), ["exponent", "at least 1"]),
        (lambda: PiecewiseQuadratic([0.0, 0.0], [0.0] * 3, [0.0] * 2), ["increase"]),
        (lambda: PiecewiseQuadratic([0.0], [0.0], [0.0]), ["2 slopes"]),
        (lambda: PiecewiseQuadratic([0.0], [0.0, 0.0], [0.0], upper=1.0), ["one of the knots"]),
    ],
)
def test_bad_parameters_are_named(make: object, words: list[str]) -> None:
    with pytest.raises(ProblemError) as caught:
        make()  # type: ignore[operator]
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("exponent", [1.0, 1.5, 3.0])
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e12])
def test_a_force_on_a_spring_alone_has_its_place(exponent: float, size: float) -> None:
    """The least of ``j(r) - b r``, with no other stiffness: ``c r^p = b``."""
    law = Compliance(3.0 * size, exponent)
    b = size * np.array([1e-6, 0.02, 0.3, 7.0, 1e4])
    found = law.local_argmin(np.zeros(5), b)
    np.testing.assert_allclose(found, (b / (3.0 * size)) ** (1.0 / exponent), rtol=1e-12)


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_a_curved_piece_is_searched_in_few_rounds(size: float) -> None:
    """Newton's iteration ends where rounding leaves nothing to find, and does not go back to halves from there."""

    class Counted(LogarithmicWeakening):
        looks = 0

        def piece_derivative(self, piece: IntArray, r: Array) -> Array:
            Counted.looks += 1
            return super().piece_derivative(piece, r)

    law = Counted(0.3)
    rng, eps = np.random.default_rng(5), np.finfo(float).eps
    for a, b in rng.lognormal(0.0, 2.0, (100, 2, 50)):
        stiffness, force = 0.3**-2.0 + 100.0 * a, 1.0 / 0.3 + size * b  # beside it the law is convex, and slips
        Counted.looks = 0
        r = law.local_argmin(stiffness, force)
        assert Counted.looks <= 12
        assert (np.abs(stiffness * r + 1.0 / (0.3 + r) - force) <= 4.0 * eps * force).all()
