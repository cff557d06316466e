"""Laws by the formula of their derivative: the same law as by the potential, and integrals against scipy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.laws import ContactLaw, FormulaLaw, Friction
from hemivar.laws.testing import check_law
from tests.problems import square

#: Potentials of r, and their derivatives by hand.
PAIRS = {
    "compliance": ("max(r, 0)^2", "2*max(r, 0)"),
    "softening": ("piecewise((0, r < 0), (1 - (1 + r)*exp(-r), True))", "piecewise((0, r < 0), (r*exp(-r), True))"),
    "a jump down": (
        "piecewise((0, r < 0), (10*r^2, r < 0.1), (0.1, True))", "piecewise((0, r < 0), (20*r, r < 0.1), (0, True))"
    ),
    "a jump up": ("0.3*abs(r) + r^2", "piecewise((2*r - 0.3, r < 0), (2*r + 0.3, True))"),
    "waves": ("0.3*cos(5*r) + 0.05*r^2", "0.1*r - 1.5*sin(5*r)"),
    "narrow": ("1e-4*(1 - exp(-((r - 0.12)/1e-3)^2)) + r^2", "0.2*(r - 0.12)/1e-3*exp(-((r - 0.12)/1e-3)^2) + 2*r"),
    "three pieces": (
        "piecewise((r^2, r < -1), (2*r^2 - 1, r < 1), (r^3/3 + 2/3 + r - 1, True))",
        "piecewise((2*r, r < -1), (4*r, r < 1), (r^2 + 1, True))",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRS)
def test_the_law_is_that_of_the_potential(name: str) -> None:
    potential, derivative = PAIRS[name]
    expected, found = FormulaLaw(potential), FormulaLaw(derivative=derivative)
    r = np.concatenate([np.linspace(-9.0, 9.0, 1501), np.linspace(0.1, 0.14, 101), [-1e-9, 0.0, 1e-9]])
    scale = np.abs(expected.value(r)).max()
    np.testing.assert_allclose(found.value(r), expected.value(r), atol=3e-14 * scale)
    np.testing.assert_allclose(found.derivative(r), expected.derivative(r), atol=1e-12 * scale)
    np.testing.assert_allclose(found.weak_convexity, expected.weak_convexity, rtol=1e-6)
    assert found.proof("alpha").sure == expected.proof("alpha").sure
    np.testing.assert_allclose(found.growth, expected.growth, rtol=1e-6, atol=1e-9)
    for sign in (1.0, -1.0):
        np.testing.assert_allclose(found.recession(np.array([sign])), expected.recession(np.array([sign])), rtol=1e-6)


@pytest.mark.parametrize("name", ["softening", "a jump up", "a jump down"])
def test_it_passes_the_tests_of_a_law(name: str) -> None:
    check_law(FormulaLaw(derivative=PAIRS[name][1]))


@pytest.mark.parametrize("text", ["r*exp(-r^2) + tanh(5*r)", "tanh(40*(r - 1)) + tanh(40)", "max(r, 0)^1.5/(1 + r^2)"])
def test_potentials_that_have_no_simple_formula_are_integrals(text: str) -> None:
    law = FormulaLaw(derivative=text)
    places = np.array([-7.0, -0.3, 0.02, 0.99, 1.03, 2.5, 9.0])

    def slope(r: float) -> float:
        return float(law.derivative(np.array([r]))[0])

    expected = [quad(slope, 0.0, r, epsabs=1e-13, epsrel=1e-13, limit=500, points=[0.9, 1.1] if r > 1.1 else None)[0]
                for r in places]  # fmt: skip
    np.testing.assert_allclose(law.value(places), expected, rtol=1e-11, atol=1e-12)
    # beyond the reach, over parts that double
    assert law.value(np.array([200.0]))[0] == pytest.approx(
        expected[-1] + quad(slope, 9.0, 200.0, epsabs=1e-12, epsrel=1e-12, limit=500)[0], rel=1e-9
    )


def test_friction_by_its_derivative() -> None:
    expected = Friction(0.3, FormulaLaw("log(1 + r)", even=True))
    found = Friction(0.3, FormulaLaw(derivative="1/(1 + r)", even=True))
    answers = []
    for friction in (expected, found):
        contact = {"bottom": hv.Contact(normal=hv.Compliance(2.0), friction=friction)}
        answers.append(hv.solve(replace(square(n=4), contact=contact)).raise_for_status())
    np.testing.assert_allclose(answers[1].unknowns, answers[0].unknowns, atol=1e-9)
    assert answers[1].energy == pytest.approx(answers[0].energy, rel=1e-10)
    assert ContactLaw(hv.Signorini(), found).at(None)


def test_what_is_no_derivative_is_refused() -> None:
    refused: list[tuple[Callable[[], object], str]] = [
        (lambda: FormulaLaw(), "give either"),
        (lambda: FormulaLaw("r^2", derivative="2*r"), "give either"),
        (lambda: FormulaLaw(derivative=2.0), "give a text"),  # type: ignore[arg-type]
        (lambda: FormulaLaw(derivative="1/r"), "a pole, or no value, at r = 0"),
        (lambda: FormulaLaw(derivative="log(r)"), "not finite"),
    ]
    for make, words in refused:
        with pytest.raises(ProblemError, match=words):
            make()
