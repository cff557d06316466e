"""The law of a contact point: normal and radial tangential part together."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.laws import Compliance, ContactLaw, Friction, NoFriction, PiecewiseQuadratic, Signorini, SurveyLaw, Tresca

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
    law = ContactLaw(SurveyLaw(0.3, 2.0), friction)
    m = 60
    a, b = rng.uniform(1.5, 4.0, (m, 2)), rng.normal(size=(m, d))
    r = law.local_argmin(a, b)

    def energy(x: np.ndarray) -> np.ndarray:
        quadratic = 0.5 * a[:, 0] * x[:, 0] ** 2 + 0.5 * a[:, 1] * (x[:, 1:] ** 2).sum(axis=1)
        return np.asarray(quadratic - (b * x).sum(axis=1) + law.value(x))

    best = energy(r)
    for size in (1e-3, 0.1, 1.0):
        for _ in range(300):
            assert (best <= energy(r + size * rng.normal(size=r.shape)) + 1e-12).all()


@pytest.mark.parametrize("d", [2, 3])
def test_prox_gives_a_pair_on_the_graph(d: int) -> None:
    rng = np.random.default_rng(3)
    law = ContactLaw(SurveyLaw(0.3, 2.0), Tresca(0.5))
    x, tau = rng.normal(size=(200, d)), rng.uniform(0.1, 1.0, (200, 2))
    r = law.prox(x, tau)
    lam = (x - r) / np.concatenate([tau[:, :1], np.repeat(tau[:, 1:], d - 1, axis=1)], axis=1)
    assert law.distance(r, lam).max() < 1e-12
    assert law.graph_distance(r, lam, tau).max() < 1e-12


@pytest.mark.parametrize("d", [2, 3])
def test_prox_jacobian_is_the_derivative_of_prox(d: int) -> None:
    rng = np.random.default_rng(5)
    law = ContactLaw(Compliance(3.0, 2.0), Tresca(0.5))
    x, tau = rng.normal(size=(100, d)), rng.uniform(0.3, 1.0, (100, 2))
    jacobian = law.prox_jacobian(x, tau)
    step = 1e-7
    for c in range(d):
        shift = np.zeros(d)
        shift[c] = step
        difference = (law.prox(x + shift, tau) - law.prox(x - shift, tau)) / (2 * step)
        # Points within a step of a kink have no derivative.
        near = np.abs(np.linalg.norm(x[:, 1:], axis=1) - 0.5 * tau[:, 1]) < 1e-4
        np.testing.assert_allclose(jacobian[~near, :, c], difference[~near], atol=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_linearisation_is_the_derivative_of_the_value(d: int) -> None:
    rng = np.random.default_rng(6)
    law = ContactLaw(SurveyLaw(0.3, 2.0), Friction(0.7, WEAKENING))
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
    law = ContactLaw(SurveyLaw(0.3, 2.0), Tresca(0.5))
    start = np.array([[-0.1, 0.2], [0.1, -0.2], [-0.1, 0.2]])
    end = np.array([[0.3, -0.1], [-0.2, -0.5], [-0.4, 0.9]])
    np.testing.assert_allclose(law.clamp(start, end), [[0.0, 0.0], [0.0, -0.5], [-0.4, 0.9]])


def test_laws_of_several_boundaries_are_joined_point_by_point() -> None:
    points = np.random.default_rng(1).random((5, 2))
    first = ContactLaw(SurveyLaw(lambda x: 1.0 + x[:, 0], 2.0), Tresca(0.5)).at(points)
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
