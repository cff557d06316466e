"""Laws laid out in tables answer as the laws do."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import ContactLaw
from hemivar.laws.friction import Friction
from hemivar.laws.friction.profiles import ExponentialWeakening, LogarithmicWeakening
from hemivar.laws.separate import RadialLaw, SeparateLaw
from hemivar.laws.stacked import stack
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed import affine, bonded

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


def tables(law: ContactLaw, c: int) -> SeparateLaw | RadialLaw:
    found = RadialLaw.of(law, STIFF) if c == 3 else SeparateLaw.of(law, STIFF, c)
    assert found is not None
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


@pytest.mark.parametrize("c", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(LAWS))
def test_pairs_on_the_graph_stay_where_they_are(name: str, c: int) -> None:
    law = LAWS[name].at(np.zeros((M, 2)))
    p = np.random.default_rng(1).normal(scale=2.0, size=(M, c))
    place = law.prox(p / all_of(STIFF, c), 1.0 / STIFF)
    lam = p - all_of(STIFF, c) * place
    on, line = tables(law, c).onto(p, place), law.linearise(place)
    np.testing.assert_allclose(on.place, place, atol=1e-9)
    np.testing.assert_allclose(on.multiplier, lam, atol=1e-8)
    held = ~np.repeat(line.smooth, [1, c - 1], axis=1)
    np.testing.assert_array_equal(on.held, held)
    assert held[:, 0].any() or name in ("spring", "bent", "glue")
    curvature = on.curvature if c == 3 else on.curvature[:, :, None] * np.eye(c)
    np.testing.assert_allclose(curvature, line.hessian, atol=1e-7 * max(1.0, float(np.abs(line.hessian).max())))


@pytest.mark.parametrize("name", ["rigid", "bent"])
def test_points_that_are_off_their_pieces_go_where_the_law_puts_them(name: str) -> None:
    law, random = LAWS[name].at(np.zeros((M, 2))), np.random.default_rng(4)
    p, r = random.normal(scale=2.0, size=(2, M, 2))
    on = tables(law, 2).onto(p, r)
    assert on.moved
    for column, one in enumerate(law.scalar_laws(2)):
        if not one.straight:
            place = one.place_on_piece(STIFF[:, column], p[:, column], r[:, column])
            assert np.count_nonzero(place != r[:, column]) > M // 4
            np.testing.assert_allclose(on.place[:, column], place, rtol=1e-14)


@pytest.mark.parametrize("c", [1, 2, 3])
@pytest.mark.parametrize("name", sorted(LAWS))
def test_distances_and_rest_are_those_of_the_law(name: str, c: int) -> None:
    law, random = LAWS[name].at(np.zeros((M, 2))), np.random.default_rng(2)
    r, lam = random.normal(scale=0.6, size=(2, M, c))
    r[:30] = 0.0
    r[30:60, 0] = 0.5
    tau = np.full((M, 2), 0.3)
    found = tables(law, c).graph_distance(r, lam, all_of(tau, c))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), law.graph_distance(r, lam, tau), rtol=1e-12)
    inside = law.admissible(r)
    least = law.nearest_multiplier(inside, np.zeros_like(r))
    np.testing.assert_allclose(tables(law, c).least_multiplier(inside), least, atol=1e-14)


def test_laws_with_many_knots_have_no_tables() -> None:
    knots = np.linspace(0.0, 1.0, 60)
    many = ContactLaw(hv.laws.PiecewiseQuadratic(knots, np.linspace(0.0, 1.0, 61), np.zeros(60)))
    assert SeparateLaw.of(many, STIFF, 2) is None
    assert RadialLaw.of(many, STIFF) is None
