"""The conformance kit finds what is wrong with a law."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.laws import (
    Bilateral,
    Capped,
    Compliance,
    ContactLaw,
    FormulaLaw,
    Friction,
    FunctionLaw,
    NoContact,
    PenetrationBound,
    PiecewiseQuadratic,
    Signorini,
    SlipWeakening,
    Softening,
    ThresholdCompliance,
    Tresca,
)
from hemivar.laws.testing import LawError, check_law


@pytest.mark.parametrize(
    "law",
    [
        ThresholdCompliance(0.3, 2.0),
        ThresholdCompliance(np.array([0.3, 0.5]), 2.0),
        Signorini(),
        Bilateral(),
        NoContact(),
        Compliance(5.0, 2.5),
    ],
)
def test_good_laws_pass(law: object) -> None:
    assert check_law(law).passed  # type: ignore[arg-type]


@pytest.mark.parametrize("law", [Tresca(0.5), SlipWeakening(0.5), SlipWeakening(PenetrationBound("8*s"))])
def test_good_friction_laws_pass(law: Friction) -> None:
    assert len(check_law(law).checks) == 21


@dataclass(frozen=True, eq=False)
class Spoiled(PiecewiseQuadratic):
    """A softening law that some of the tests below spoil."""

    def take(self, index: Any) -> Any:
        return self


def spoiled(**methods: Any) -> PiecewiseQuadratic:
    kind = type("Spoiled", (Spoiled,), methods)
    return kind([0.0, 0.1, 0.5], [0.0, 2.0, -0.5, 0.0], [0.3, 0.0, 0.0])  # type: ignore[no-any-return]


def failures(law: Any, **options: Any) -> str:
    with pytest.raises(LawError) as caught:
        check_law(law, **options)
    assert isinstance(caught.value, AssertionError)
    report = check_law(law, raises=False, **options)
    assert not report.passed
    assert str(report) == str(caught.value)
    return str(report)


def test_the_law_to_be_spoiled_is_good() -> None:
    assert check_law(spoiled()).passed


def test_a_wrong_prox_is_caught() -> None:
    def prox(self: Any, x: Any, tau: Any) -> Any:
        return 1.01 * PiecewiseQuadratic.prox(self, x, tau)

    assert "prox is the global minimiser: it is not" in failures(spoiled(prox=prox))


@pytest.mark.parametrize(("length", "stress"), [(1e-4, 1e-4), (1.0, 1.0), (1e4, 1e4)])
def test_a_prox_that_stops_at_the_nearest_minimum_is_caught(length: float, stress: float) -> None:
    """In any units; the law itself passes in them."""
    table = Capped(20.0 * stress / length, 0.1 * length).table
    assert check_law(table).passed

    class Nearest(type(table)):  # type: ignore[misc]
        def take(self, index: Any) -> Any:
            return self

        def local_argmin(self, a: Any, b: Any) -> Any:
            points, energies = self.local_minimisers(a, b)
            points = np.where(np.isfinite(energies), points, np.inf)
            return np.min(points, axis=-1)

    law = Nearest([0.0, 0.1 * length], [0.0, 20.0 * stress / length, 0.0], [0.0, -2.0 * stress])
    assert "local_argmin is the global minimiser: it is not" in failures(law)


@pytest.mark.parametrize(
    ("alpha", "words"), [(0.4, "alpha is large enough: it is not"), (0.6, "alpha is not needlessly large: it is not")]
)
def test_a_wrong_alpha_is_caught(alpha: float, words: str) -> None:
    assert words in failures(spoiled(weak_convexity=property(lambda self: np.array([alpha]))))


def test_an_alpha_that_ignores_a_downward_jump_is_caught() -> None:
    law = type("Wrong", (Capped,), {"weak_convexity": property(lambda self: np.zeros(1))})(20.0, 0.1)
    assert "jumps down at r = 0.1: give alpha = inf" in failures(law)
    law = type("Wrong", (Softening,), {"weak_convexity": property(lambda self: np.array([np.inf]))})(2.0, 0.1, 0.5)
    assert "needlessly large" in failures(law)


def test_a_value_that_contradicts_its_derivative_is_caught() -> None:
    def piece_value(self: Any, piece: Any, r: Any) -> Any:
        return PiecewiseQuadratic.piece_value(self, piece, r) * np.where(np.asarray(piece) == 1, 1.001, 1.0)

    found = failures(spoiled(piece_value=piece_value))
    assert "the derivative is that of the value: it is not" in found
    assert "the value is continuous" in found
    found = failures(FunctionLaw(lambda r: r**2, lambda r: 2.02 * r))
    assert "the derivative is that of the value: it is not: the derivative is " in found


def test_a_wrong_curvature_is_caught() -> None:
    def piece_curvature(self: Any, piece: Any, r: Any) -> Any:
        return 0.9 * PiecewiseQuadratic.piece_curvature(self, piece, r)

    assert "the curvature is that of the derivative: it is not" in failures(spoiled(piece_curvature=piece_curvature))


@pytest.mark.parametrize("place", [0.1, 0.123456, -0.4])
def test_a_kink_missing_from_a_function_is_caught(place: float) -> None:
    with pytest.raises(ProblemError, match=r"jumps by 1.5 at r = "):
        FunctionLaw(derivative=lambda r: np.where(r > place, 1.0, -0.5) + r, kinks=[0.7])

    def piece_derivative(self: Any, piece: Any, r: Any) -> Any:
        return PiecewiseQuadratic.piece_derivative(self, piece, r) + 1.5 * (r > place + 3.3e-4)

    found = failures(spoiled(piece_derivative=piece_derivative))
    assert "no kink is missing among the knots: it is not: the derivative jumps by 1.5 at r = " in found
    assert check_law(FunctionLaw(derivative=lambda r: np.sign(r - place), kinks=[place])).passed


def test_wrong_growth_recession_and_shape_are_caught() -> None:
    wrong = spoiled(growth=property(lambda self: (np.array([0.1]), np.array([0.0]))))
    assert "the growth constants bound the subdifferential: it is not" in failures(wrong)
    wrong = spoiled(recession=lambda self, sign: np.ones(np.shape(sign)))
    assert "the recession is the growth rate far away: it is not" in failures(wrong)
    wrong = spoiled(piece_value=lambda self, piece, r: np.zeros(3))
    assert "right shape: it is not" in failures(wrong)
    wrong = spoiled(scaled=lambda self, factor: self)
    assert "scaled, take and at agree with the law: it is not" in failures(wrong)


def test_a_friction_law_that_is_not_even_is_caught() -> None:
    assert "the law is even: it is not" in failures(ThresholdCompliance(0.3, 2.0), friction=True)
    assert "the law is even" in failures(FormulaLaw("max(r, 0)"), friction=True)


def test_a_law_is_asked_as_the_law_of_a_point_too() -> None:
    """How fast prox moves, and the multiplier nearest to a force, which a scalar law has no other question about."""

    def curvature(self: Any, r: Any) -> Any:
        return 0.3 + 1.5 * PiecewiseQuadratic.curvature(self, r)

    found = failures(spoiled(curvature=curvature))
    assert "prox_jacobian is the derivative of prox: it is not" in found
    assert "the jacobian of on_graph is its derivative: it is not" in found
    found = failures(spoiled(distance=lambda self, r, lam: 0.01 + PiecewiseQuadratic.distance(self, r, lam)))
    assert "the nearest multiplier is an element: it is not" in found


def test_a_value_that_is_not_finite_at_a_minimiser_is_no_minimum() -> None:
    def local_argmin(self: Any, a: Any, b: Any) -> Any:
        return np.nan * PiecewiseQuadratic.local_argmin(self, a, b)

    assert "local_argmin is the global minimiser: it is not" in failures(spoiled(local_argmin=local_argmin))


def test_a_value_that_is_not_zero_at_zero_is_caught() -> None:
    def piece_value(self: Any, piece: Any, r: Any) -> Any:
        return PiecewiseQuadratic.piece_value(self, piece, r) + 0.1

    assert "zero at r = 0: it is not: the value is 0.1 at r = 0; subtract it" in failures(
        spoiled(piece_value=piece_value)
    )
    with pytest.raises(ProblemError, match=r"the value of law 'piecewise' is 0.1 at r = 0; subtract it"):
        ContactLaw(spoiled(piece_value=piece_value))
