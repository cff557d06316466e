"""The bottom of the energy along a line, against the energy at many places of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, Friction, PiecewiseQuadratic, Superpotential, VectorLaw
from hemivar.laws.crossings import Crossings
from hemivar.laws.friction.profiles import ExponentialWeakening
from hemivar.solvers.line_search import SearchLine, bottom_of_pieces
from hemivar.systems import Workspace
from hemivar.systems.contact_moves import Search
from hemivar.systems.newton_equation import LinearisedPoint

SEEDS = range(12)
#: Where the energy is looked at.
LENGTHS = np.linspace(0.0, 4.0, 2001)


def pieces(rng: np.random.Generator, m: int, convex: bool, walls: bool) -> PiecewiseQuadratic:
    """A random law with straight pieces, another one at each point."""
    knots = np.cumsum(rng.uniform(0.05, 0.5, (m, 4)), axis=1) - 0.8
    low = 0.0 if convex else -1.5
    slopes, jumps = rng.uniform(low, 2.0, (m, 5)), rng.uniform(low, 1.0, (m, 4)) * (rng.random((m, 4)) < 0.5)
    slopes[:, [0, -1]] = np.abs(slopes[:, [0, -1]])
    ends = {"lower": knots[:, 0], "upper": knots[:, -1]} if walls else {}
    return PiecewiseQuadratic(knots, slopes, jumps, start=rng.normal(size=m), **ends)


def random_points(rng: np.random.Generator, law: VectorLaw, m: int, components: int) -> DiscreteProblem:
    n = m * components
    root = rng.normal(size=(n, n))
    return DiscreteProblem.of_arrays(
        root @ root.T / n + 0.05 * np.eye(n), rng.normal(size=n), np.eye(n), rng.uniform(0.5, 2.0, m), np.zeros(m), law
    )


def line_of(problem: DiscreteProblem, rng: np.random.Generator, search: Search) -> SearchLine:
    """A line from a random place, downhill at its beginning."""
    system = Workspace().condensed(problem)
    r = system.start(0.2 * rng.normal(size=problem.contact.shape))
    at = LinearisedPoint.of(system, r, r, system.out_of_balance(r))
    way = np.where(at.moving, at.force - system.weights[:, None] * at.multiplier, 0.0)
    way *= rng.uniform(0.1, 2.0, way.shape)
    return SearchLine.of(system, at, way, system.multiply(way), search)


def energies(line: SearchLine) -> Array:
    return np.array([line.energy_change(t, line.across(t)) for t in LENGTHS])


def assert_first(line: SearchLine, length: float, there: float, sampled: Array, slack: float = 1e-12) -> None:
    """The energy falls up to a length, and rises behind it."""
    before, behind = sampled[length >= LENGTHS], length * (1.0 + 1e-5)
    assert (np.diff(before) <= slack).all()
    assert there <= before[-1] + slack
    assert there <= line.energy_change(behind, line.across(behind)) + slack


@pytest.mark.parametrize("walls", [False, True])
@pytest.mark.parametrize("convex", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_bottom_over_pieces_is_that_of_a_fine_sampling(seed: int, convex: bool, walls: bool) -> None:
    rng = np.random.default_rng([seed, convex, walls])
    law = ContactLaw(pieces(rng, 12, convex, walls), Friction(rng.uniform(0.0, 1.0, 12)))
    line = line_of(random_points(rng, law, 12, 2), rng, Search.GLOBAL)
    knots = law.crossings(line.at.r, line.along)
    assert knots is not None
    sampled = energies(line)
    found = [bottom_of_pieces(knots, line.system.weights, line.slope, line.square, convex, k) for k in (True, False)]
    gains = [line.energy_change(low.length, line.across(low.length, knots)) for low in found]
    assert_first(line, found[0].length, gains[0], sampled)
    assert gains[1] <= sampled.min() + 1e-12
    assert found[1].length == pytest.approx(LENGTHS[np.argmin(sampled)], abs=4e-3)
    assert not any(low.endless for low in found)


@pytest.mark.parametrize("seed", SEEDS)
def test_slopes_close_in_the_bottom_that_the_pieces_say(seed: int) -> None:
    rng = np.random.default_rng(seed)
    law = ContactLaw(pieces(rng, 12, True, False), Friction(rng.uniform(0.0, 1.0, 12)))
    line = line_of(random_points(rng, law, 12, 2), rng, Search.GLOBAL)
    (known,) = [line.bottom(1.0)]
    object.__setattr__(line.system.law, "crossings", lambda r, way: None)
    sought = replace(line).bottom(1.0)
    assert sought.energy_change == pytest.approx(known.energy_change, rel=1e-5)


@pytest.mark.parametrize("components", [2, 3])
@pytest.mark.parametrize("seed", SEEDS)
def test_bottoms_of_laws_that_are_not_quadratic(seed: int, components: int) -> None:
    rng = np.random.default_rng([seed, components])
    friction = Friction(rng.uniform(0.0, 1.0, 9), ExponentialWeakening(1.0, 0.5, 3.0))
    law = ContactLaw(hv.Compliance(rng.uniform(0.0, 5.0, 9)), Friction(friction.bound) if seed % 2 else friction)
    line = line_of(random_points(rng, law, 9, components), rng, Search.DOWNHILL)
    sampled = energies(line)
    low, _ = line._bottom_across()
    assert_first(
        line, low.length, line.energy_change(low.length, line.across(low.length)), sampled, 1e-5 * abs(sampled.min())
    )


@pytest.mark.parametrize("law", [hv.Signorini(), hv.Compliance(3.0)])
@pytest.mark.parametrize("seed", SEEDS)
def test_the_way_that_stops_at_ends_of_pieces_has_the_slope_of_its_energy(seed: int, law: Superpotential) -> None:
    rng = np.random.default_rng(seed)
    line = line_of(random_points(rng, ContactLaw(law, Friction(rng.uniform(0.0, 1.0, 12))), 12, 2), rng, Search.GLOBAL)
    lengths = np.concatenate([rng.uniform(0.0, 1.0, 5), rng.uniform(1.0, 9.0, 5)])
    exits = line._exits[0]
    for t in lengths[np.abs(lengths[:, None, None] - exits).min(axis=(1, 2)) > 1e-4]:
        quotient = (
            line.energy_change(t + 1e-5, line.cut(t + 1e-5)) - line.energy_change(t - 1e-5, line.cut(t - 1e-5))
        ) / 2e-5
        assert line._slope_cut(t) == pytest.approx(quotient, abs=1e-6)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e12])
def test_a_direction_of_any_size_ends_at_the_same_bottom(size: float) -> None:
    rng = np.random.default_rng(7)
    law = ContactLaw(hv.Signorini(), Friction(rng.uniform(0.0, 1.0, 12)))
    line = line_of(random_points(rng, law, 12, 2), rng, Search.GLOBAL)
    scaled = SearchLine.of(line.system, line.at, size * line.direction, size * line.bent)
    assert scaled.bottom(1.0 / size).energy_change == pytest.approx(line.bottom(1.0).energy_change, rel=1e-6)


@pytest.mark.parametrize(("pull", "endless"), [(0.3, False), (0.7, True)])
@pytest.mark.parametrize("known", [True, False])
def test_an_energy_that_falls_without_end_is_said_to(pull: float, endless: bool, known: bool) -> None:
    """Two points and a spring between them, the first one pulled along the surface against the bound 0.5."""
    law = ContactLaw(hv.Compliance(1.0), Friction(0.5))
    stiffness, load = la.block_diag(1.0, [[1.0, -1.0], [-1.0, 1.0]]), np.array([0.1, pull, 0.0])
    problem = DiscreteProblem.of_arrays(stiffness, load, np.eye(2, 3), np.ones(1), np.zeros(1), law)
    system = Workspace().condensed(problem)
    r = np.array([[0.05, 0.01]])
    at = LinearisedPoint.of(system, r, r, system.out_of_balance(r))
    way = np.array([[0.0, 1.0]])
    line = SearchLine.of(system, at, way if pull > 0.5 else -way, system.multiply(way))
    if not known:
        object.__setattr__(system.law, "crossings", lambda r, way: None)
    found = line.bottom(1.0)
    assert found.endless == endless
    if not endless:
        assert system.local(found.x)[0, 1] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize(("square", "lowest", "endless"), [(0.1, 20.0, False), (0.0, 1.0, True)])
def test_the_first_bottom_the_lowest_one_and_none_at_all(square: float, lowest: float, endless: bool) -> None:
    """The slope is -1 up to a kink at 1, 1 up to 2, and -2 from there on, and what the body adds."""
    index, one = np.zeros(2, dtype=np.int64), np.zeros(1)
    at = np.array([1.0, 2.0])
    knots = Crossings(one, one, index, index, at, at, np.array([2.0, -3.0]), np.zeros(2))
    first = bottom_of_pieces(knots, np.ones(1), 1.0, square, convex=False, first=True)
    low = bottom_of_pieces(knots, np.ones(1), 1.0, square, convex=False, first=False)
    assert (first.length, first.endless) == (1.0, False)
    assert low.length == pytest.approx(lowest)
    assert low.endless is endless


@pytest.mark.parametrize("seed", SEEDS)
def test_points_that_end_at_a_knot_are_on_it(seed: int) -> None:
    rng = np.random.default_rng(seed)
    line = line_of(random_points(rng, ContactLaw(hv.Signorini()), 12, 2), rng, Search.GLOBAL)
    knots = line.system.law.crossings(line.at.r, line.along)
    assert knots is not None
    for length, point in zip(knots.length, knots.point, strict=True):
        assert line.across(length, knots)[point, 0] == 0.0
