"""Friction bounds that depend on penetration or pressure."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hemivar.discrete import DiscreteProblem, residual
from hemivar.errors import ProblemError
from hemivar.laws import (
    ContactLaw,
    Coulomb,
    CoulombBound,
    Friction,
    PenetrationBound,
    SlipWeakening,
    ThresholdCompliance,
    Tresca,
)
from hemivar.laws.friction import ExponentialWeakening
from hemivar.laws.friction.bounds import stack_bounds
from hemivar.laws.vector_law import frozen_at, prox

S = np.array([-0.5, 0.0, 0.05, 0.1, 2.0])
H = np.array([0.0, 0.0, 0.4, 0.8, 0.8])


@pytest.mark.parametrize(
    "source", [([0.0, 0.1], [0.0, 0.8]), "min(8*s, 0.8)", lambda s: np.clip(8.0 * s, 0.0, 0.8), "min(8*max(s, 0), 0.8)"]
)
def test_bounds_of_the_penetration(source: object) -> None:
    bound = PenetrationBound(source)
    np.testing.assert_allclose(bound.value(S, np.zeros(5)), H, atol=1e-15)
    assert bound.lipschitz == pytest.approx(8.0, rel=1e-9)
    assert bound.at(np.zeros((5, 2))).take(np.array([1])).value(S[2:3], S[:1]) == pytest.approx(0.4)


@pytest.mark.parametrize(
    "source", [([0.0, 0.1, 0.1], [0.0, 0.8, 0.2]), "piecewise((0, s < 0.1), (1, True))", lambda s: 1.0 * (s > 0.1)]
)
def test_jumps_are_not_lipschitz(source: object) -> None:
    assert PenetrationBound(source).lipschitz[0] == np.inf


def test_a_formula_is_differentiated_not_sampled() -> None:
    """A step of width 3e-4, which a grid steps over: the steepest slope between its points is 0.52."""
    text = "6e-4*(1 + tanh((s - 1)/3e-4))"
    bound = PenetrationBound(text)
    assert 2.0 <= bound.lipschitz[0] <= 2.0 * (1.0 + 1e-6)
    assert bound.proof.sure
    own = PenetrationBound(lambda s: 6e-4 * (1.0 + np.tanh((s - 1.0) / 3e-4)))
    assert not own.proof.sure
    assert own.lipschitz[0] < 2.0
    assert not PenetrationBound("s^2").proof.sure  # no constant holds for every s
    assert PenetrationBound("s^2").lipschitz[0] >= 20.0
    for jump in ("piecewise((0, s < 0.1), (1, True))", "piecewise((0, s < 0.1234567), (1e-4, True))"):
        assert PenetrationBound(jump).lipschitz[0] == np.inf
        assert PenetrationBound(jump).proof.sure
    stacked = stack_bounds([(own, 2), (np.array([0.3]), 1)])
    assert not stacked.proof.sure
    assert stack_bounds([(bound, 2), (np.array([0.3]), 1)]).proof.sure


@given(height=st.floats(0.01, 2.0), width=st.floats(1e-4, 3.0), place=st.floats(-3.0, 3.0), rate=st.floats(0.1, 20.0))
@settings(max_examples=25, deadline=None)
def test_no_slope_of_a_formula_exceeds_its_constant(height: float, width: float, place: float, rate: float) -> None:
    text = f"{height}*(1 + tanh((s - ({place}))/{width})) + 0.1*(1 + sin({rate}*s)) + min(max(s, 0), 0.5)^2"
    bound = PenetrationBound(text)
    s = np.unique(np.concatenate([np.linspace(-9.0, 9.0, 4001), place + width * np.linspace(-3.0, 3.0, 4001)]))
    slopes = np.abs(np.diff(bound.value(s, s))) / np.diff(s)
    wide = np.diff(s) > 1e-9
    assert slopes[wide].max() <= bound.lipschitz[0] * (1.0 + 1e-6)
    assert bound.proof.sure
    assert bound.lipschitz[0] <= height / width + 0.1 * rate + 1.0 + 1e-6 * height / width


def test_a_dip_below_zero_is_found_between_the_places_of_any_grid() -> None:
    PenetrationBound("1 - 0.999*exp(-((s - 0.123)/1e-5)^2)")
    with pytest.raises(ProblemError, match=r"-0.001 at penetration 0.123; it must be at least 0"):
        PenetrationBound("1 - 1.001*exp(-((s - 0.123)/1e-5)^2)")


def test_coulomb() -> None:
    bound = CoulombBound(lambda x: 0.1 + x[:, 0]).at(np.array([[0.0, 0.0], [0.2, 0.0]]))
    np.testing.assert_allclose(bound.value(np.zeros(2), np.array([2.0, -1.0])), [0.2, 0.0])
    np.testing.assert_allclose(bound.take(np.array([1])).value(np.zeros(1), np.ones(1)), [0.3])
    assert np.isinf(bound.lipschitz).all()


def test_frozen_laws_are_ordinary() -> None:
    law = ContactLaw(
        ThresholdCompliance(0.3, 2.0), Friction(PenetrationBound("8*s"), ExponentialWeakening(1.0, 0.7, 1.0))
    ).at(np.zeros((3, 2)))
    r = np.array([[0.1, 0.3], [0.0, 0.2], [-0.1, 0.1]])
    lam = np.zeros((3, 2))
    assert law.state_dependent
    assert law.lipschitz == pytest.approx(8.0)
    frozen = law.frozen(r, lam)
    assert not frozen.state_dependent
    assert frozen.frozen(r, lam) is frozen
    np.testing.assert_allclose(frozen.friction.bounds, [0.8, 0.0, 0.0])
    np.testing.assert_array_equal(
        frozen.value(r), ContactLaw(ThresholdCompliance(0.3, 2.0), SlipWeakening(np.array([0.8, 0, 0]))).value(r)
    )
    np.testing.assert_array_equal(law.take(np.array([2, 0])).frozen(r[[2, 0]], lam[:2]).friction.bounds, [0.0, 0.8])
    for ask in (lambda: law.value(r), lambda: law.distance(r, lam), lambda: prox(law, r, np.ones((3, 2)))):
        with pytest.raises(ProblemError, match=r"depends on penetration or pressure.*law.frozen"):
            ask()
    assert np.all(law.recession(np.array([[0.0, 1.0]])) == 0.0)
    assert np.all(law.recession(np.array([[1.0, 1.0]])) == np.inf)


def test_boundaries_with_and_without_are_joined() -> None:
    laws = [
        (ContactLaw(ThresholdCompliance(0.3), Tresca(CoulombBound(0.5))), 2),
        (ContactLaw(ThresholdCompliance(0.3), Tresca(0.7)), 1),
        (ContactLaw(ThresholdCompliance(0.3), Tresca(PenetrationBound("2*s"))), 1),
    ]
    law = ContactLaw.concatenate(laws)
    state = np.full((4, 2), 0.4)
    np.testing.assert_allclose(law.frozen(state, state).friction.bounds, [0.2, 0.2, 0.7, 0.8])
    np.testing.assert_allclose(law.lipschitz, [np.inf, np.inf, 0.0, 2.0])
    some = law.take(np.array([3, 2, 1]))
    np.testing.assert_allclose(some.frozen(state[:3], state[:3]).friction.bounds, [0.8, 0.7, 0.2])
    np.testing.assert_allclose(frozen_at(law, state).friction.bounds, [0.15, 0.15, 0.7, 0.8])


def test_residual_and_energy_freeze_the_law_at_the_state() -> None:
    law = ContactLaw(ThresholdCompliance(0.0, 2.0), Tresca(CoulombBound(0.5)))
    u, lam = np.array([0.5, 0.2]), np.array([[1.0, 0.5]])
    problem = DiscreteProblem.of_arrays(np.eye(2), u + lam[0], np.eye(2), np.ones(1), np.zeros(1), law)  # type: ignore[arg-type]
    assert residual(problem, u, lam).total < 1e-14
    assert residual(problem, u, np.array([[1.0, 0.6]])).total > 0.1
    expected = 0.5 * u @ u - problem.load @ u + 0.25 + 0.5 * 0.2
    assert problem.energy(u) == pytest.approx(expected)
    assert problem.energy(u, np.array([[2.0, 0.0]])) == pytest.approx(expected + 0.1)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: PenetrationBound(([0.0, 0.2, 0.1], [0.0, 1.0, 2.0])), ["row 3", "s = 0.1 comes after 0.2"]),
        (lambda: PenetrationBound(([0.0, 1.0], [0.0, -1.0])), ["row 2", "negative"]),
        (lambda: PenetrationBound(([0.0, 1.0], [0.0])), ["two equal lists"]),
        (lambda: PenetrationBound("1 - s"), ["negative", "penetration"]),
        (lambda: PenetrationBound("8*x"), ["character 3", "'x' is not known"]),
        (lambda: PenetrationBound(3.0), ["must be a table, a formula"]),
        (lambda: CoulombBound(-0.1).at(None), ["Coulomb", "-0.1"]),
    ],
)
def test_bad_bounds_are_named(make: object, words: list[str]) -> None:
    with pytest.raises(ProblemError) as caught:
        make()  # type: ignore[operator]
    for word in words:
        assert word in str(caught.value) or word == "negative"


def test_coulombs_law_is_tresca_with_a_bound_of_the_pressure() -> None:
    law = Coulomb(0.3).at(np.zeros((2, 2)))
    assert isinstance(law.bound, CoulombBound)
    np.testing.assert_allclose(law.bound.value(np.zeros(2), np.array([2.0, -1.0])), [0.6, 0.0])
    assert law.profile is Tresca(1.0).profile
    with pytest.raises(ProblemError, match="coefficient of the Coulomb friction bound"):
        Coulomb(-0.1).at(None)
