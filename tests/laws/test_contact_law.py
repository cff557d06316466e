"""The law of a contact point: normal and radial tangential part together."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.laws import (
    Adhesive,
    Capped,
    Compliance,
    ContactLaw,
    CoulombBound,
    FinitePenetration,
    Friction,
    NoContact,
    NoFriction,
    PiecewiseQuadratic,
    Signorini,
    SlipWeakening,
    StaticKinetic,
    Superpotential,
    ThresholdCompliance,
    Tresca,
)
from hemivar.laws.minimisers import piece_bounds
from hemivar.laws.scalar_graph import prox_slope
from hemivar.laws.vector_law import frozen_at, prox, prox_jacobian

#: Weakening friction in the slip r: 0.8 |r| up to 0.2, sliding on at 0.4 with a slope down in between.
WEAKENING = PiecewiseQuadratic(
    [-0.4, 0.0, 0.4],
    [0.0, -1.0, -1.0, 0.0],
    [0.0, 2 * 0.9, 0.0],
    start=-0.5,
    name="weakening",  # type: ignore[arg-type]
)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("friction", [Tresca(0.5), Friction(0.7, WEAKENING), NoFriction()])
def test_local_argmin_beats_random_points(d: int, friction: Friction) -> None:
    rng = np.random.default_rng(11)
    law = ContactLaw(ThresholdCompliance(0.3, 2.0), friction)
    m = 60
    a, b = rng.uniform(1.5, 4.0, (m, 2)), rng.normal(size=(m, d))
    r = law.local_argmin(a, b)

    def energy(x: Array) -> Array:
        quadratic = 0.5 * a[:, 0] * x[:, 0] ** 2 + 0.5 * a[:, 1] * (x[:, 1:] ** 2).sum(axis=1)
        return np.asarray(quadratic - (b * x).sum(axis=1) + law.value(x))

    best = energy(r)
    for size in (1e-3, 0.1, 1.0):
        for _ in range(300):
            assert (best <= energy(r + size * rng.normal(size=r.shape)) + 1e-12).all()


@pytest.mark.parametrize("d", [2, 3])
def test_prox_gives_a_pair_on_the_graph(d: int) -> None:
    rng = np.random.default_rng(3)
    law = ContactLaw(ThresholdCompliance(0.3, 2.0), Tresca(0.5))
    x, tau = rng.normal(size=(200, d)), rng.uniform(0.1, 1.0, (200, 2))
    r = prox(law, x, tau)
    lam = (x - r) / np.concatenate([tau[:, :1], np.repeat(tau[:, 1:], d - 1, axis=1)], axis=1)
    assert law.distance(r, lam).max() < 1e-12
    assert law.graph_distance(r, lam, tau).max() < 1e-12


@pytest.mark.parametrize("d", [2, 3])
def test_prox_jacobian_is_the_derivative_of_prox(d: int) -> None:
    rng = np.random.default_rng(5)
    law = ContactLaw(Compliance(3.0, 2.0), Tresca(0.5))
    x, tau = rng.normal(size=(100, d)), rng.uniform(0.3, 1.0, (100, 2))
    jacobian = prox_jacobian(law, x, tau)
    step = 1e-7
    for c in range(d):
        shift = np.zeros(d)
        shift[c] = step
        difference = (prox(law, x + shift, tau) - prox(law, x - shift, tau)) / (2 * step)
        # Points within a step of a kink have no derivative.
        near = np.abs(np.linalg.norm(x[:, 1:], axis=1) - 0.5 * tau[:, 1]) < 1e-4
        np.testing.assert_allclose(jacobian[~near, :, c], difference[~near], atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_linearisation_is_the_derivative_of_the_value(d: int) -> None:
    rng = np.random.default_rng(6)
    law = ContactLaw(ThresholdCompliance(0.3, 2.0), Friction(0.7, WEAKENING))
    r = rng.normal(size=(80, d)) * 0.5
    line = law.linearise(r)
    assert line.smooth.all()
    step = 1e-6
    for c in range(d):
        shift = np.zeros(d)
        shift[c] = step
        slope = (law.value(r + shift) - law.value(r - shift)) / (2 * step)
        np.testing.assert_allclose(line.gradient[:, c], slope, atol=1e-6)
        curvature = (law.linearise(r + shift).gradient - law.linearise(r - shift).gradient) / (2 * step)
        np.testing.assert_allclose(line.hessian[:, :, c], curvature, atol=1e-4)


def test_friction_turns_with_the_slip() -> None:
    law = ContactLaw(Signorini(), Tresca(0.5))
    rng = np.random.default_rng(8)
    r, lam = rng.normal(size=(40, 3)), rng.normal(size=(40, 3))
    r[:, 0] = 0.0
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned_r, turned_lam = r.copy(), lam.copy()
    turned_r[:, 1:], turned_lam[:, 1:] = r[:, 1:] @ turn.T, lam[:, 1:] @ turn.T
    np.testing.assert_allclose(law.value(turned_r), law.value(r))
    np.testing.assert_allclose(law.distance(turned_r, turned_lam), law.distance(r, lam))


def test_clamp_keeps_a_step_on_its_piece() -> None:
    law = ContactLaw(ThresholdCompliance(0.3, 2.0), Tresca(0.5))
    start = np.array([[-0.1, 0.2], [0.1, -0.2], [-0.1, 0.2]])
    end = np.array([[0.3, -0.1], [-0.2, -0.5], [-0.4, 0.9]])
    np.testing.assert_allclose(law.clamp(start, end), [[0.0, 0.0], [0.0, -0.5], [-0.4, 0.9]])


@pytest.mark.parametrize("components", [1, 2])
@pytest.mark.parametrize("normal", [ThresholdCompliance(0.3, 2.0), Capped(5.0, 0.1, 0.4), Compliance(3.0, 1.5)])
@pytest.mark.parametrize("friction", [Tresca(0.5), SlipWeakening(0.6, 0.2, 0.3), Friction(0.7, WEAKENING)])
def test_a_step_that_is_cut_back_meets_no_kink_on_its_way(
    normal: Superpotential, friction: Friction, components: int
) -> None:
    """What the law stores on the way is the integral of its gradient."""
    law, random = ContactLaw(normal, friction), np.random.default_rng(components)
    start = random.normal(scale=0.3, size=(400, components))
    end = start + random.normal(scale=0.3, size=start.shape)
    end[:40], start[:20, 0] = start[:40], 0.0
    way = law.clamp(start, end) - start
    work = np.zeros(len(start))
    for t, weight in zip(*np.polynomial.legendre.leggauss(30), strict=True):
        line = law.linearise(start + 0.5 * (1.0 + t) * way)
        assert line.smooth[way.any(axis=1), 0].all()
        work += 0.5 * weight * (line.gradient * way).sum(axis=1)
    np.testing.assert_allclose(law.value(start + way) - law.value(start), work, atol=1e-6)
    cut = np.abs(start + way - end).max(axis=1) > 1e-12
    assert 50 < np.count_nonzero(cut) < 350


def test_laws_of_several_boundaries_are_joined_point_by_point() -> None:
    points = np.random.default_rng(1).random((5, 2))
    first = ContactLaw(ThresholdCompliance(lambda x: 1.0 + x[:, 0], 2.0), Tresca(0.5)).at(points)
    second = ContactLaw(Signorini(), Friction(0.7, WEAKENING)).at(np.zeros((3, 2)))
    law = ContactLaw.concatenate([(first, 5), (second, 3)])
    r = np.random.default_rng(2).normal(size=(8, 2))
    np.testing.assert_array_equal(law.value(r), np.concatenate([first.value(r[:5]), second.value(r[5:])]))
    lam = np.random.default_rng(3).normal(size=(8, 2))
    np.testing.assert_array_equal(
        law.distance(r, lam), np.concatenate([first.distance(r[:5], lam[:5]), second.distance(r[5:], lam[5:])])
    )
    some = np.array([6, 1, 4])
    np.testing.assert_array_equal(law.take(some).value(r[some]), law.value(r)[some])
    a, b = np.full((8, 2), 3.0), np.random.default_rng(4).normal(size=(8, 2))
    np.testing.assert_array_equal(law.take(some).local_argmin(a[some], b[some]), law.local_argmin(a, b)[some])


def test_what_is_no_law_is_refused() -> None:
    with pytest.raises(ProblemError, match="normal law must be a superpotential"):
        ContactLaw(0.3)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="friction law must be a Friction"):
        ContactLaw(Signorini(), 0.5)  # type: ignore[arg-type]
    with pytest.raises(ProblemError, match="bound of friction law 'tresca' is -1"):
        ContactLaw(Signorini(), Tresca(-1.0)).at(np.zeros((2, 2)))


# ---- the nearest element of the subdifferential ------------------------------------------------------------

#: Steps of the difference quotients and of the grids of multipliers.
STEP, FINE = 1e-7, 2001
NORMAL_LAWS = {
    "survey": (ThresholdCompliance(0.3, 2.0), [-0.2, 0.0, 0.1]),
    "rigid": (Signorini(), [-0.2, 0.0]),
    "stop": (FinitePenetration(3.0, 0.2), [-0.1, 0.0, 0.1, 0.2]),
    "breaking": (Capped(20.0, 0.1, 0.3), [-0.1, 0.0, 0.05, 0.1, 0.3]),
    "glue": (Adhesive(5.0, 1.0), [-0.4, -0.2, -0.1, 0.0]),
    "curved": (Compliance(3.0, 2.0), [-0.1, 0.0, 0.3]),
}
FRICTIONS = {
    "tresca": Tresca(0.5),
    "weakening": SlipWeakening(0.5, rate=4.0),
    "dropping": StaticKinetic(0.5, 0.1, 1.0, 0.4),
    "table": Friction(0.7, WEAKENING),
}


def hull(law: Superpotential, r: float) -> tuple[float, float]:
    """Clarke's subdifferential at r from difference quotients of the value alone."""
    at = law.value(np.array([r - STEP, r, r + STEP]))
    slopes = np.diff(at) / STEP
    ends = np.where(np.isinf(at[[0, 2]]), np.array([-np.inf, np.inf]), slopes)
    return float(ends.min()), float(ends.max())


def nearest_on_a_grid(low: float, high: float, lam: float) -> float:
    """The nearest to ``lam`` of many multipliers between the ends."""
    grid = np.linspace(max(low, -5.0), min(high, 5.0), FINE)
    return float(grid[np.argmin(np.abs(grid - lam))])


@pytest.mark.parametrize("components", [1, 3])
@pytest.mark.parametrize("name", NORMAL_LAWS)
def test_the_nearest_pressure_is_that_of_a_dense_grid(name: str, components: int) -> None:
    scalar, places = NORMAL_LAWS[name]
    asked = np.array([-4.0, -1.1, -0.3, -0.05, 0.0, 0.05, 0.2, 0.4, 1.3, 4.0])
    r, lam = (np.zeros((len(places) * asked.size, components)) for _ in range(2))
    r[:, 0], lam[:, 0] = np.repeat(places, asked.size), np.tile(asked, len(places))
    found = ContactLaw(scalar).nearest_multiplier(r, lam)
    expected = [nearest_on_a_grid(*hull(scalar, x), y) for x, y in zip(r[:, 0], lam[:, 0], strict=True)]
    np.testing.assert_allclose(found[:, 0], expected, atol=6e-3)
    assert not found[:, 1:].any()
    assert ContactLaw(scalar).distance(r, found).max() == 0.0


def test_beyond_the_end_of_a_law_the_pressure_is_that_of_the_end() -> None:
    law = ContactLaw(FinitePenetration(3.0, 0.2), Tresca(0.5))
    r, lam = np.array([[0.25, 0.0], [0.25, 0.1]]), np.array([[2.0, 0.9], [0.1, -0.2]])
    np.testing.assert_allclose(law.nearest_multiplier(r, lam), [[2.0, 0.5], [0.6, 0.5]])


@pytest.mark.parametrize("components", [2, 3])
@pytest.mark.parametrize("name", FRICTIONS)
def test_the_nearest_friction_is_that_of_a_dense_grid(name: str, components: int) -> None:
    """The gradients close by span the subdifferential: a ball at rest, else a piece of the line of the slip."""
    law = ContactLaw(NoContact(), FRICTIONS[name])
    tangents = components - 1
    random = np.random.default_rng(7)
    turns = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
    ways = np.array([[-1.0], [1.0]]) if tangents == 1 else np.stack([np.cos(turns), np.sin(turns)], axis=1)
    shares = np.linspace(0.0, 1.0, 400)

    def slope(along: Array, size: float) -> Array:
        """The rate of j along a slip, a little beyond ``size`` (or, negative, before it), by differences."""
        sizes = np.array([size, size + STEP]) if size >= 0.0 else np.array([-size - STEP, -size])
        at = np.concatenate([np.zeros((2, 1)), sizes[:, None] * along], axis=1)
        return np.asarray(np.diff(law.value(at))[0] / STEP * along)

    for size in (0.0, 0.05, 0.1, 0.4, 1.5):
        for way in ways[:: max(1, len(ways) // 5)]:
            if size == 0.0:
                elements = np.concatenate([shares[:, None] * slope(one, 0.0) for one in ways])
            else:
                ends = slope(way, -size), slope(way, size)
                elements = ends[0] + shares[:, None] * (ends[1] - ends[0])
            for lam in random.normal(scale=0.6, size=(6, tangents)):
                r, given = (np.concatenate([[0.0], x])[None] for x in (size * way, lam))
                found = law.nearest_multiplier(r, given)[0]
                assert found[0] == 0.0
                best = elements[np.argmin(np.linalg.norm(elements - lam, axis=1))]
                np.testing.assert_allclose(found[1:], best, atol=8e-3)
                assert law.distance(r, found[None]) < 1e-12


# ---- one local component ------------------------------------------------------------------------------------


@pytest.mark.parametrize("friction", [NoFriction(), Tresca(0.5), Tresca(CoulombBound(0.3))])
@pytest.mark.parametrize("name", NORMAL_LAWS)
def test_with_one_component_a_contact_law_is_its_normal_law(name: str, friction: Friction) -> None:
    """A bar or a membrane: r of shape (m, 1), no tangents, and a friction law that is never asked."""
    scalar, _ = NORMAL_LAWS[name]
    law = ContactLaw(scalar, friction).at(np.zeros((50, 1)))
    random = np.random.default_rng(2)
    ends = scalar.domain
    s = np.clip(random.normal(scale=0.3, size=50), ends.lower, ends.upper)
    s[:5] = np.clip([0.0, 0.0, 0.1, 0.2, -0.2], ends.lower, ends.upper)
    lam, b = random.normal(size=50), 3.0 * random.normal(size=50)
    a, tau = random.uniform(1.0, 9.0, (50, 1)), random.uniform(0.1, 1.0, (50, 1))
    r = s[:, None]
    pairs = [
        (law.value(r), scalar.value(s)),
        (law.distance(r, lam[:, None]), scalar.distance(s, lam)),
        (law.graph_distance(r, lam[:, None], tau), scalar.graph_distance(s, lam, tau[:, 0])),
        (law.local_argmin(a, b[:, None]), scalar.local_argmin(a[:, 0], b)[:, None]),
        (prox(law, b[:, None], tau), scalar.prox(b, tau[:, 0])[:, None]),
        (law.recession(np.sign(lam)[:, None]), scalar.recession(np.sign(lam))),
        (law.admissible(b[:, None]), np.clip(b, ends.lower, ends.upper)[:, None]),
        (law.take(np.arange(9)).value(r[:9]), scalar.value(s[:9])),
        (law.frozen(r, lam[:, None]).value(r), scalar.value(s)),
        (frozen_at(law, r).value(r), scalar.value(s)),
    ]
    for found, expected in pairs:
        assert found.shape == expected.shape
        np.testing.assert_array_equal(found, expected)
    moved, slope = prox_jacobian(law, b[:, None], tau), prox_slope(scalar, b, tau[:, 0])
    np.testing.assert_allclose(moved, slope[:, None, None], rtol=4.0 * np.finfo(float).eps)
    assert law.scalar_laws(1) == (law.normal,)
    nearest = law.nearest_multiplier(r, lam[:, None])
    assert nearest.shape == (50, 1)
    assert scalar.distance(s, nearest[:, 0]).max() == 0.0
    line = law.linearise(r)
    smooth = ~scalar.at_kink(s)
    np.testing.assert_array_equal(line.smooth, np.stack([smooth, np.zeros(50, dtype=bool)], axis=1))
    np.testing.assert_array_equal(line.gradient[:, 0], np.where(smooth, scalar.derivative(s), 0.0))
    np.testing.assert_array_equal(line.hessian[:, 0, 0], np.where(smooth, scalar.curvature(s), 0.0))
    clamped = law.clamp(r, b[:, None])[:, 0]
    np.testing.assert_array_equal(clamped, np.clip(b, *piece_bounds(scalar, scalar.piece_of(s))))
    joined = ContactLaw.concatenate([(law, 50), (ContactLaw(Signorini()).at(None), 2)])
    np.testing.assert_array_equal(joined.value(np.append(r, [[-1.0], [1.0]], axis=0))[-2:], [0.0, np.inf])
