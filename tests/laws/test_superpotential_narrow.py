"""Smooth laws of any width, from nanometres in metres to far beyond the reach: nothing of them is missed."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import scipy.optimize as opt

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, FormulaLaw, Superpotential
from hemivar.solvers import NonsmoothNewton, Solution, Status

#: Widths of the laws beside the default reach of 10, and those of the slow tests.
WIDTHS = (1e-9, 1e-3, 1e3)
MORE_WIDTHS = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-2, 0.1, 1.0, 30.0)
Function = Callable[[Array], Array]
#: Formula of a height A and a width b, value and derivative, and where the curvature turns round in units of b.
FAMILIES: dict[str, tuple[str, Function, Function, tuple[float, ...]]] = {
    "logarithm": (
        "A*log(1+(r/b)^2)",
        lambda x: np.log1p(x**2),
        lambda x: 2.0 * x / (1.0 + x**2),
        (-math.sqrt(3.0), 0.0, math.sqrt(3.0)),
    ),
    "well": (
        "A*(1-exp(-(r/b)^2))",
        lambda x: -np.expm1(-(x**2)),
        lambda x: 2.0 * x * np.exp(-(x**2)),
        (-math.sqrt(1.5), 0.0, math.sqrt(1.5)),
    ),
    "glue": (
        "piecewise((0, r<0), (A*r/b*exp(-r/b), True))",
        lambda x: np.where(x < 0.0, 0.0, np.maximum(x, 0.0) * np.exp(-np.maximum(x, 0.0))),
        lambda x: np.where(x < 0.0, 0.0, (1.0 - np.maximum(x, 0.0)) * np.exp(-np.maximum(x, 0.0))),
        (0.0, 3.0),
    ),
}


def one_unknown(k: float, f: float, law: Superpotential) -> Solution:
    matrix, load = np.array([[k]]), np.array([f])
    return hv.solve(
        DiscreteProblem.of_arrays(matrix, load, np.eye(1), np.ones(1), np.zeros(1), ContactLaw(law)), NonsmoothNewton()
    )


def lowest(k: float, f: float, A: float, b: float, value: Function, slope: Function) -> float:
    """The lowest energy of one unknown, from every sign change of its derivative on a dense grid in units of b."""
    end = 4.0 * abs(f / k) / b + 30.0
    x = np.geomspace(1e-7, end, 30_000)
    x = np.unique(np.concatenate([-x, [0.0], x, np.linspace(-20.0, 20.0, 20_001)]))

    def force(at: Array | float) -> Array:
        return np.asarray(k * b * np.asarray(at) - f + A / b * slope(np.asarray(at)))

    values = force(x)
    rises = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    roots = np.array([opt.brentq(lambda at: float(force(at)), x[i], x[i + 1], maxiter=500) for i in rises])
    return float((0.5 * k * (b * roots) ** 2 - f * b * roots + A * value(roots)).min())


@pytest.mark.parametrize("widths", [WIDTHS, pytest.param(MORE_WIDTHS, marks=pytest.mark.slow)], ids=["few", "many"])
@pytest.mark.parametrize("family", FAMILIES)
def test_laws_of_any_width_are_minimised(family: str, widths: tuple[float, ...]) -> None:
    """Each width with strong and weak laws, against the lowest of all roots on a dense grid; the default reach."""
    text, value, slope, _ = FAMILIES[family]
    rng = np.random.default_rng(3)
    for b in widths:
        for _ in range(2):
            k = float(rng.uniform(0.5, 2.0))
            A = float(f"{k * b * b * 10.0 ** rng.uniform(-1.0, 1.5):.4g}")
            f = float(k * b * 10.0 ** rng.uniform(-1.0, 1.5))
            law = FormulaLaw(text.replace("A", repr(A)).replace("b", repr(b)))
            found = one_unknown(k, f, law)
            assert found.status is Status.CONVERGED, (b, A, f, k)
            u = float(found.unknowns[0])
            energy = 0.5 * k * u * u - f * u + A * float(value(np.array(u / b)))
            best = lowest(k, f, A, b, value, slope)
            assert energy <= best + 1e-8 * (abs(best) + f * f / k), (b, A, f, k)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_curvature_turns_where_it_does(family: str) -> None:
    """Zeros of the third derivative, known in closed form, are the knots, at whatever scale."""
    text, _, _, turns = FAMILIES[family]
    for b in WIDTHS:
        law = FormulaLaw(text.replace("A", "1").replace("b", repr(b)))
        np.testing.assert_allclose(law.knots[0], np.array(turns) * b, rtol=1e-9, atol=1e-12 * b)


def test_a_well_away_from_the_origin_is_found() -> None:
    """A well 10^-9 of its place wide, between 1000 samples, and its turns in closed form."""
    law = FormulaLaw("r^2 - exp(-((r-0.3)/1e-8)^2)")
    turns = 0.3 + 1e-8 * np.array([-math.sqrt(1.5), 0.0, math.sqrt(1.5)])
    for turn in turns:
        assert np.abs(law.knots[0] - turn).min() < 1e-15


def test_waves_beyond_the_reach_have_no_false_end() -> None:
    """No turn is sought far beyond the reach; the energy is bounded below all the same, and its minimum is found."""
    law = FormulaLaw("50*sin(r)", reach=0.5)
    for f in (200.0, 3000.0, -777.0):
        found = one_unknown(1.0, f, law)
        assert found.status is Status.CONVERGED
        u = np.linspace(f - 60.0, f + 60.0, 400_001)
        best = float((0.5 * u**2 - f * u + 50.0 * np.sin(u)).min())
        x = float(found.unknowns[0])
        assert 0.5 * x**2 - f * x + 50.0 * math.sin(x) <= best + 60.0  # a minimiser of some wave
        assert abs(x - f + 50.0 * math.cos(x)) < 1e-6 * abs(f)


def test_what_has_no_minimum_is_still_unbounded() -> None:
    """The recession decides: a law that falls faster than the body rises."""
    with pytest.raises(ProblemError, match="the energy has no lower bound"):
        one_unknown(1.0, 0.1, FormulaLaw("-r^2"))
    assert one_unknown(1.0, 0.1, FormulaLaw("-r^2/4")).status is Status.CONVERGED


def test_too_narrow_is_said_so() -> None:
    with pytest.raises(ProblemError, match=r"r = 0\.3 within too short a length for the reach 10; take"):
        FormulaLaw("sqrt((r-0.3)^2+1e-18)")
    assert FormulaLaw("sqrt(r^2+1e-18)").knots.size >= 1  # zero is looked at most closely
    with pytest.raises(ProblemError, match="kinks and turns of its curvature"):
        FormulaLaw("r^2 + sin(1e5*r)")
