"""Quadratic polynomials near to a formula: their bound holds at random points, and is not far above what is seen."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.formula.formula import Formula

SMOOTH = [
    "exp(x*y)", "sin(2*x + y)*cos(x)", "x/(1 + y^2)", "sqrt(1 + x^2 + y^2)", "log(2 + x*y)", "tanh(x - y) + tan(x/4)",
    "(2 + x)^1.5*y", "(2 + x)^(1 + y/2)", "x^3 - 3*x*y^2 + 1/(3 + x)",
]  # fmt: skip
KINKED = ["abs(x - 0.3*y)", "max(x, y)^2", "min(x + y, 0.2)*exp(x)", "abs(x)^0.5", "sqrt(abs(y))"]


def simplices(count: int, p: int, size: float, seed: int) -> Array:
    """Corners (count, p + 1, 2) of segments and triangles within the unit square."""
    rng = np.random.default_rng(seed)
    return rng.uniform(-0.8, 0.8, (count, 1, 2)) + size * rng.uniform(-0.5, 0.5, (count, p + 1, 2))


def seen(formula: Formula, corners: Array, seed: int = 1) -> tuple[Array, Array]:
    """The largest difference at corners and random points of each simplex, and the bound of it."""
    p = corners.shape[1] - 1
    weights = np.concatenate([np.eye(p + 1), np.random.default_rng(seed).dirichlet(np.full(p + 1, 0.5), 100)])
    expansion = formula.expansion(corners)
    points = np.einsum("qi,kid->kqd", weights, corners)
    values = formula(points.reshape(-1, 2)).reshape(points.shape[:2])
    return np.abs(values - expansion.at(weights)).max(axis=1), expansion.off


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("text", [*SMOOTH, *KINKED])
def test_the_bound_holds(text: str, p: int) -> None:
    for size in (1e-3, 0.05, 0.4):
        difference, bound = seen(Formula(text), simplices(40, p, size, 0))
        assert (difference <= bound).all()
        assert np.isfinite(bound).all() or "0.5" in text or "sqrt(abs" in text


@pytest.mark.parametrize("p", [1, 2])
def test_polynomials_of_degree_two_are_their_expansion(p: int) -> None:
    difference, bound = seen(Formula("1 + 2*x - y + 3*x^2 - x*y + 0.5*y^2"), simplices(40, p, 0.5, 2))
    assert difference.max() < 1e-14
    assert bound.max() < 1e-12


@pytest.mark.parametrize("p", [1, 2])
@pytest.mark.parametrize("text", SMOOTH)
def test_the_bound_falls_with_the_cube_of_the_size(text: str, p: int) -> None:
    large, small = (seen(Formula(text), simplices(40, p, size, 3))[1].max() for size in (0.08, 0.02))
    assert small < large / 40.0


def test_the_bound_of_a_kink_falls_with_the_size() -> None:
    large, small = (seen(Formula("abs(x)"), simplices(400, 2, size, 4))[1].max() for size in (0.4, 0.04))
    assert small < large / 7.0


def test_the_bound_of_a_cube_along_a_segment_is_that_by_hand() -> None:
    """``x^3`` on [a, a + h]: with bends from 6 a h^2 to 6 (a + h) h^2 the rest is at most 3 h^3 (1/2)^2 / 2."""
    a, h = 0.5, 0.1
    corners = np.array([[[a, 0.0], [a + h, 0.0]]])
    assert Formula("x^3").expansion(corners).off[0] == pytest.approx(3.0 * h**3 / 8.0, rel=1e-9)


def test_mixed_bends_of_a_triangle_count_as_by_hand() -> None:
    """``x^2 y`` on the triangle (0, 0), (1, 0), (0, 1): bends 2 y, 2 x, 0 have radius 1 each but for the last.

    |xi_1^2| is at most 4/9 and |xi_1 xi_2| at most 2/9, so the rest is at most 1/2 4/9 + 2/9 = 4/9.
    """
    corners = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])
    assert Formula("x^2*y").expansion(corners).off[0] == pytest.approx(4.0 / 9.0, rel=1e-9)
