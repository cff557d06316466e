"""Laws of which the potential alone is given: their derivatives, and what these are known to be off by."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.certificates import certify
from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, FunctionLaw, Superpotential
from hemivar.laws.own.function_law import differences
from hemivar.laws.stacked import stack
from hemivar.solvers import Controls, Status, solve

#: Potentials of unit width, their derivatives, and where the curvature turns round.
SHAPES: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array], tuple[float, ...]]] = {
    "log": (lambda x: np.log1p(x**2), lambda x: 2.0 * x / (1.0 + x**2), (-(3.0**0.5), 3.0**0.5)),
    "bump": (lambda x: 1.0 - np.exp(-(x**2)), lambda x: 2.0 * x * np.exp(-(x**2)), (-(1.5**0.5), 1.5**0.5)),
    "tanh": (lambda x: np.logaddexp(x, -x), np.tanh, ()),
}
WIDTHS = (1.0, 1e-5)


def narrow(name: str, width: float) -> Superpotential:
    value = SHAPES[name][0]
    return FunctionLaw(lambda r: width * value(r / width))


def one_point(law: Superpotential, stiffness: float, load: float) -> DiscreteProblem:
    return DiscreteProblem.of_arrays(  # type: ignore[arg-type]
        np.eye(1) * stiffness, np.array([load]), np.eye(1), np.ones(1), np.zeros(1), ContactLaw(law)
    )


@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("name", SHAPES)
def test_derivatives_of_any_width_are_as_exact_as_they_say(name: str, width: float) -> None:
    slope, turns = SHAPES[name][1:]
    law = narrow(name, width)
    r = np.concatenate([np.linspace(-10.0, 10.0, 201), width * np.linspace(-5.0, 5.0, 201)])
    off, told = np.abs(law.derivative(r) - slope(r / width)), law.derivative_error(r)
    assert (off <= 2.0 * told).all()
    assert told.max() < 1e-10
    assert law.derivative_accuracy == pytest.approx(law.derivative_error(np.linspace(-10.0, 10.0, 501)).max())
    assert f"an error of about {law.derivative_accuracy:.1e} at most" in str(law.describe())
    found = law.knots[0]
    for turn in turns:
        assert np.abs(found - width * turn).min() < 0.1 * width
    problem = one_point(law, 3.0 / width, 1.7)
    solution = solve(problem)
    (u,) = solution.unknowns
    assert solution.status is Status.CONVERGED
    assert solution.warnings == ()
    true = abs(3.0 / width * u + slope(np.array([u / width]))[0] - 1.7) / 1.7
    assert true <= 1.01 * solution.residual.relative < 1e-9


def test_a_residual_that_cannot_be_known_is_not_called_small() -> None:
    """Values of single precision: derivatives are known to some 1e-5 only, and so is the residual."""

    def rough(r: Array) -> Array:
        return np.float64(np.float32(np.cos(1.0) - np.cos(1.0 + r)))  # type: ignore[return-value]

    law = FunctionLaw(rough, curvature=lambda r: np.cos(1.0 + r), reach=2.0)
    assert 1e-7 < law.derivative_accuracy < 1e-2
    solution = solve(one_point(law, 3.0, -1.0), controls=Controls(rtol=1e-8))
    (u,) = solution.unknowns
    true = abs(3.0 * u + np.sin(1.0 + u) + 1.0)
    assert solution.status is not Status.CONVERGED
    assert solution.residual.relative >= max(0.5 * true, 1e-8)
    (message,) = solution.warnings
    assert message.startswith(
        "the derivative of a law is found by differences of its potential and may have an error of "
    )
    assert "give the derivative as a function too" in message
    certificate = certify(solution)
    assert not certificate.stationary
    assert message in certificate.warnings
    assert solve(one_point(law, 3.0, -1.0), controls=Controls(rtol=0.01)).status is Status.CONVERGED
    exact = FunctionLaw(rough, lambda r: np.sin(1.0 + r), lambda r: np.cos(1.0 + r), reach=2.0)
    assert not exact.by_differences
    assert solve(one_point(exact, 3.0, -1.0)).warnings == ()


def test_laws_made_of_others_know_it_too() -> None:
    law, r = narrow("log", 1.0), np.array([0.3, 2.0])
    told = law.derivative_error(r)
    assert (told > 0.0).all()
    np.testing.assert_allclose(law.scaled(3.0).derivative_error(r), 3.0 * told)
    assert law.scaled(3.0).derivative_accuracy == pytest.approx(3.0 * law.derivative_accuracy)
    both = stack([(law, 1), (FunctionLaw(lambda s: s**2, lambda s: 2.0 * s), 1)])
    np.testing.assert_allclose(both.derivative_error(r), [told[0], 0.0])
    assert both.by_differences


def test_differences_stay_on_their_piece() -> None:
    """A function that is another one beyond its ends: one-sided, and no less honest."""

    def value(r: Array) -> Array:
        return np.where((r >= 0.0) & (r <= 1.0), np.exp(r), 1e3)

    r = np.concatenate([[0.0, 1.0], np.geomspace(1e-9, 0.5, 20), 1.0 - np.geomspace(1e-9, 0.5, 20)])
    found = differences(value, r, 0.0, 1.0, 0.1, 2)
    assert (np.abs(found.first - np.exp(r)) <= 2.0 * found.first_error).all()
    assert (np.abs(found.second - np.exp(r)) <= 2.0 * found.second_error).all()
    assert found.first_error.max() < 1e-8
    assert found.second_error.max() < 1e-5
