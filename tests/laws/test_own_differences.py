"""Laws of which the derivative is given: curvatures by differences, whatever the width of the function."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.laws import ContactLaw, FunctionLaw
from hemivar.laws.own.function_law import differences
from hemivar.solvers import Status, solve

Function = Callable[[Array], Array]
#: Potentials of unit width, derivatives, curvatures, and where these turn round.
SHAPES: dict[str, tuple[Function, Function, Function, tuple[float, ...]]] = {
    "log": (
        lambda x: np.log1p(x**2),
        lambda x: 2.0 * x / (1.0 + x**2),
        lambda x: 2.0 * (1.0 - x**2) / (1.0 + x**2) ** 2,
        (-(3.0**0.5), 0.0, 3.0**0.5),
    ),
    "bump": (
        lambda x: 1.0 - np.exp(-(x**2)),
        lambda x: 2.0 * x * np.exp(-(x**2)),
        lambda x: 2.0 * (1.0 - 2.0 * x**2) * np.exp(-(x**2)),
        (-(1.5**0.5), 0.0, 1.5**0.5),
    ),
    "tanh": (
        lambda x: np.logaddexp(x, -x),
        np.tanh,
        lambda x: 4.0 * np.exp(-2.0 * np.abs(x)) / (1.0 + np.exp(-2.0 * np.abs(x))) ** 2,
        (0.0,),
    ),
}


@pytest.mark.parametrize("width", [1.0, 1e-5])
@pytest.mark.parametrize("name", SHAPES)
def test_curvatures_of_any_width_are_exact_and_their_turns_are_found(name: str, width: float) -> None:
    value, slope, bend, turns = SHAPES[name]
    law = FunctionLaw(lambda r: width * value(r / width), lambda r: slope(r / width))
    r = np.concatenate([np.linspace(-10.0, 10.0, 201), width * np.linspace(-5.0, 5.0, 201)])
    np.testing.assert_allclose(width * law.curvature(r), bend(r / width), atol=1e-9)
    for turn in turns:
        assert np.abs(law.knots[0] - width * turn).min() < 0.1 * width
    solution = solve(
        DiscreteProblem.of_arrays(  # type: ignore[arg-type]
            np.eye(1) * 3.0 / width, np.array([1.7]), np.eye(1), np.ones(1), np.zeros(1), ContactLaw(law)
        )
    )
    assert solution.status is Status.CONVERGED
    (u,) = solution.unknowns
    assert 3.0 * u / width + slope(np.array([u / width]))[0] == pytest.approx(1.7, rel=1e-9)


def test_differences_stay_on_their_piece() -> None:
    """A function that is another one beyond its ends: one-sided, and no less exact."""

    def value(r: Array) -> Array:
        return np.where((r >= 0.0) & (r <= 1.0), np.exp(r), 1e3)

    r = np.concatenate([[0.0, 1.0], np.geomspace(1e-9, 0.5, 20), 1.0 - np.geomspace(1e-9, 0.5, 20)])
    np.testing.assert_allclose(differences(value, r, 0.0, 1.0, 0.1), np.exp(r), rtol=1e-8)


def test_values_of_single_precision_have_the_derivatives_that_they_show() -> None:
    """Steps below the rounding of the values see none of their rise, and are not taken."""

    def rough(r: Array) -> Array:
        return np.float64(np.float32(np.sin(1.0 + r)))  # type: ignore[return-value]

    r = np.linspace(-1.5, 1.5, 101)
    np.testing.assert_allclose(differences(rough, r, -np.inf, np.inf, 0.2), np.cos(1.0 + r), atol=1e-4)


def test_what_is_narrower_than_the_first_steps_is_seen_at_its_middle() -> None:
    t = np.linspace(-2.0, 2.0, 41)
    rates = differences(lambda r: np.exp(-(((r - 0.3) / 1e-5) ** 2)), 0.3 + 1e-5 * t, -np.inf, np.inf, 0.2)
    np.testing.assert_allclose(1e-5 * rates, -2.0 * t * np.exp(-(t**2)), atol=1e-6)
