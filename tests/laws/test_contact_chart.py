"""Laws laid out in tables answer as the laws do."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import ContactLaw
from hemivar.laws.contact_chart import ContactChart
from hemivar.laws.friction import Friction
from hemivar.laws.friction.profiles import ExponentialWeakening, LogarithmicWeakening
from hemivar.laws.piecewise_law import stack
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed import affine, bonded
from hemivar.laws.vector_law import is_curve

M = 300
KINKS = hv.laws.PiecewiseQuadratic([-0.5, 0.0, 0.5], [0.0, 2.0, -1.0, 0.0], [0.1, 0.2, 0.1], start=-0.3)
WEAKENING = hv.laws.PiecewiseQuadratic([-1.0, 0.0, 1.0], [0.0, -0.2, -0.2, 0.0], [0.0, 1.6, 0.0], start=-0.6)
GLUE = bonded(hv.Compliance(5.0).at(None), 2.0, 0.1, 0.3, np.linspace(0.0, 1.0, M), 0.1)
LAWS = {
    "spring": ContactLaw(hv.Compliance(3.0), Friction(0.2)),
    "rigid": ContactLaw(hv.Signorini(), Friction(0.3, LogarithmicWeakening(2.0))),
    "kinks": ContactLaw(KINKS, Friction(np.linspace(0.0, 0.4, M))),
    "bent": ContactLaw(hv.Compliance(3.0, 2.0), Friction(0.3, WEAKENING)),
    "glue": ContactLaw(GLUE, Friction(0.2)),
    "two": ContactLaw(stack([(hv.Signorini().at(None), 100), (KINKS, M - 100)]), Friction(0.1)),
}
STIFF = np.column_stack([np.full(M, 4.0), np.full(M, 3.0)])


def chart(law: ContactLaw, c: int, stiffness: Array = STIFF) -> ContactChart:
    found = law.chart(stiffness, c)
    assert isinstance(found, ContactChart)
    return found


def all_of(pair: Array, c: int) -> Array:
    return pair[:, [0, 1, 1][:c]]


@pytest.mark.parametrize(
    "law", [KINKS, WEAKENING, GLUE, LogarithmicWeakening(2.0), ExponentialWeakening(1.0, 0.4, 3.0)]
)
def test_slope_and_curvature_are_the_same_asked_together(law: Superpotential) -> None:
    r, turned = np.linspace(-1.5, 1.5, M), np.linspace(-0.2, 0.2, M)
    for made in (law, law.scaled(np.linspace(0.0, 2.0, M)), affine(law.scaled(0.7), 1.3, turned)):
        for piece in range(made.knots.shape[-1] + 1):
            on = np.full(M, piece)
            slope, bend = made.piece_line(on, r)
            np.testing.assert_array_equal(slope, made.piece_derivative(on, r))
            np.testing.assert_array_equal(bend, made.piece_curvature(on, r))


def stiff_beside(law: ContactLaw) -> Array:
    """A stiffness beside which the law is a curve."""
    return 1.2 * np.column_stack([np.maximum(STIFF[:, i], law.weak_convexity[i]) for i in (0, 1)])


@pytest.mark.parametrize("c", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(LAWS))
def test_pairs_are_those_of_the_law(name: str, c: int) -> None:
    law = LAWS[name].at(np.zeros((M, 2)))
    stiffness = stiff_beside(law)
    assert is_curve(law, stiffness, c)
    p = np.random.default_rng(1).normal(scale=2.0, size=(M, c))
    p[:20] = 0.0
    expected, on = law.on_graph(p, stiffness), chart(law, c, stiffness).at(p)
    np.testing.assert_allclose(on.r, expected.r, atol=1e-9)
    np.testing.assert_allclose(on.multiplier, expected.multiplier, atol=1e-8)
    np.testing.assert_allclose(on.jacobian, expected.jacobian, atol=1e-7)
    held = np.abs(on.jacobian).max(axis=2) == 0.0
    assert held[:, 0].any() or name in ("spring", "bent", "glue")


@pytest.mark.parametrize("c", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(LAWS))
def test_near_a_pair_what_is_missed_is_of_second_order(name: str, c: int) -> None:
    law, random = LAWS[name].at(np.zeros((M, 2))), np.random.default_rng(1)
    stiffness = stiff_beside(law)
    p = random.normal(scale=2.0, size=(M, c))
    exact, quick = law.on_graph(p, stiffness), chart(law, c, stiffness)
    off = random.normal(size=(M, c))
    missed = [np.abs(quick.at(p, exact.r + size * off).r - exact.r) for size in (0.0, 1e-5, 1e-3)]
    assert missed[0].max() <= 1e-9
    assert np.quantile(missed[1], 0.9) <= 1e-9  # some lie beside the end of a piece
    assert np.quantile(missed[2], 0.9) <= 1e-4
    away = quick.at(p, off)
    np.testing.assert_allclose(all_of(stiffness, c) * away.r + away.multiplier, p, atol=1e-12)


@pytest.mark.parametrize("c", [1, 2, 3])
@pytest.mark.parametrize("name", ["rigid", "kinks", "bent", "two"])
def test_pairs_of_laws_of_the_state_are_those_of_the_law(name: str, c: int) -> None:
    stated = LAWS[name]
    law = ContactLaw(stated.normal, Friction(hv.laws.CoulombBound(0.4), stated.friction.profile)).at(np.zeros((M, 2)))
    stiffness = 3.0 * STIFF
    p = np.random.default_rng(3).normal(scale=2.0, size=(M, c))
    expected, on = law.on_graph(p, stiffness), chart(law, c, stiffness).at(p)
    for found, exact in ((on.r, expected.r), (on.multiplier, expected.multiplier), (on.jacobian, expected.jacobian)):
        np.testing.assert_allclose(found, exact, atol=1e-8)
    assert c == 1 or np.count_nonzero(on.jacobian[:, 1:, 0]) > M // 10


def test_far_away_multipliers_lose_no_more_than_places() -> None:
    """``p = a r + lam`` has fewer digits than lam there; what it does not tell of r does not matter to a soft law."""
    far = chart(ContactLaw(hv.table_law([0.0, 1.0], [0.0, 0.3])).at(np.zeros((M, 2))), 1)
    r = 1e12 + np.linspace(0.0, 1.0, M)[:, None]
    on = far.at(STIFF[:, :1] * r + 0.3, r)
    np.testing.assert_allclose(on.r, r, rtol=1e-15)
    np.testing.assert_array_equal(on.multiplier, 0.3)


@pytest.mark.parametrize("c", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(LAWS))
def test_distances_and_rest_are_those_of_the_law(name: str, c: int) -> None:
    law, random = LAWS[name].at(np.zeros((M, 2))), np.random.default_rng(2)
    r, lam = random.normal(scale=0.6, size=(2, M, c))
    r[:30] = 0.0
    r[30:60, 0] = 0.5
    tau = np.full((M, 2), 0.3)
    found = chart(law, c).graph_distance(r, lam, all_of(tau, c))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), law.graph_distance(r, lam, tau), rtol=1e-12)
    inside = law.admissible(r)
    least = law.nearest_multiplier(inside, np.zeros_like(r))
    np.testing.assert_allclose(chart(law, c).least_multiplier(inside), least, atol=1e-14)


@pytest.mark.parametrize("c", [1, 2, 3])
@pytest.mark.parametrize("name", ["rigid", "kinks", "bent"])
def test_distances_of_laws_of_the_state_are_those_under_their_bounds(name: str, c: int) -> None:
    stated, random = LAWS[name], np.random.default_rng(5)
    law = ContactLaw(stated.normal, Friction(hv.laws.CoulombBound(0.4), stated.friction.profile)).at(np.zeros((M, 2)))
    r, lam = random.normal(scale=0.6, size=(2, M, c))
    r[:100, 1:], r[:30, 0] = 0.0, 0.0
    tau = np.full((M, 2), 0.3)
    found = np.linalg.norm(chart(law, c).graph_distance(r, lam, all_of(tau, c)), axis=1)
    np.testing.assert_allclose(found, law.frozen(r, lam).graph_distance(r, lam, tau), rtol=1e-12)
    inside = law.admissible(r)
    least = law.frozen(inside, np.zeros_like(r)).nearest_multiplier(inside, np.zeros_like(r))
    np.testing.assert_allclose(chart(law, c).least_multiplier(inside), least, atol=1e-14)


def test_laws_with_many_knots_have_no_tables() -> None:
    knots = np.linspace(0.0, 1.0, 60)
    many = ContactLaw(hv.laws.PiecewiseQuadratic(knots, np.linspace(0.0, 1.0, 61), np.zeros(60)))
    found = many.chart(STIFF, 2)
    assert found is not None
    assert not isinstance(found, ContactChart)
