"""Derivatives of formulas of the place, against those by hand and against differences."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.formula import Formula

POINTS = np.random.default_rng(3).uniform(0.2, 0.9, (9, 2))
X, Y = POINTS.T


@pytest.mark.parametrize(
    ("text", "by_x", "by_y"),
    [
        ("3", 0 * X, 0 * X),
        ("x^2*y - y/x", 2 * X * Y + Y / X**2, X**2 - 1 / X),
        ("sin(pi*x)*cos(y)", np.pi * np.cos(np.pi * X) * np.cos(Y), -np.sin(np.pi * X) * np.sin(Y)),
        ("2^(x*y) + (-x)^3", np.log(2) * Y * 2 ** (X * Y) - 3 * X**2, np.log(2) * X * 2 ** (X * Y)),
        ("min(x, 2*x) + max(y, -1)", 0 * X + 1, 0 * X + 1),
        ("abs(-x) - abs(y)", 0 * X + 1, 0 * X - 1),
    ],
)
def test_gradients_by_hand(text: str, by_x: np.ndarray, by_y: np.ndarray) -> None:
    np.testing.assert_allclose(Formula(text).gradient(POINTS), np.column_stack([by_x, by_y]), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("text", ["tan(x*y) + tanh(x - y)", "exp(x)*log(y)/sqrt(x + y)", "x^y", "1/(x + 2*y)^1.5"])
def test_gradients_are_limits_of_differences(text: str) -> None:
    formula, h = Formula(text), 1e-6
    for axis in (0, 1):
        step = h * np.eye(2)[axis]
        difference = (formula(POINTS + step) - formula(POINTS - step)) / (2 * h)
        np.testing.assert_allclose(formula.gradient(POINTS)[:, axis], difference, rtol=1e-7)


def test_a_slope_that_is_not_finite_is_refused_with_its_place() -> None:
    with pytest.raises(ProblemError, match=r"no finite derivative at x = 0, y = 0.5"):
        Formula("sqrt(x)").gradient(np.array([[1.0, 0.5], [0.0, 0.5]]))
