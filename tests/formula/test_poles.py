"""Poles of formulas: found with their place, which is known in closed form, or refused as an argument of a proof."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, march
from hemivar.formula import Formula, FormulaArray
from hemivar.formula.formula import ScalarFormula
from hemivar.formula.poles import pole_of_pieces
from hemivar.formula.smooth import SmoothFormula
from hemivar.laws import CoupledFormulaLaw, FormulaLaw, PenetrationBound
from tests import bodies

#: Formulas whose derivative is nowhere negative, and the pole nearest to zero.
RISING_WITH_POLE = {
    "1/(1 - r)": 1.0,
    "(1 - r)^(-1)": 1.0,
    "1/(pi - r)": math.pi,
    "tan(r)": 0.5 * math.pi,
    "exp(-1/r)": 0.0,
    "tanh(-1/r)": 0.0,
    "1/(1 + exp(1/r))": 0.0,
    "-1/(exp(r) - 2)": math.log(2.0),
    "-1/(r^3 + 2)": -(2.0 ** (1.0 / 3.0)),
    "r/1000 + tan(40*r)/1e9": math.pi / 80.0,
}
#: Formulas without a pole, though they divide, take roots, powers and logarithms.
HARMLESS = (
    "r/(1 + r^2)",
    "r/sqrt(r^2 + 1e-12)",
    "log(1 + exp(r))",
    "r/(abs(r) + 1e-3)",
    "max(r, 0)^1.5",
    "sqrt(max(3*r - 0.3, 0))",
    "r/(r*r + 1e-30)/1e18",
    "r/(2 + sin(5*r))",
    "tan(tanh(r))",
    "2^r/1000",
    "piecewise((0, r <= 0), (exp(-1/r), True))",
)


def smooth(text: str) -> SmoothFormula:
    return ScalarFormula(text).branch(0.5)


def test_a_joint_that_stiffens_is_continued_as_its_message_says() -> None:
    """Closure of a rock joint, p = 10 r/(1 - r/0.5): r = P/(10 + 2 P) under the pressure P."""
    closure = "10*r/(1 - r/0.5)"
    with pytest.raises(ProblemError, match=r"piecewise\(\(FORMULA, r < 0.49\), \(LINE, True\)\)"):
        FormulaLaw(derivative=f"piecewise((0, r < 0), ({closure}, True))")
    line = "245 + 25000*(r - 0.49)"
    law = FormulaLaw(derivative=f"piecewise((0, r < 0), ({closure}, r < 0.49), ({line}, True))")
    for p in (1.0, 5.0):
        problem = bodies.square(law, 2, supports={"left": "roller"}, tractions={"top": hv.Pressure(p)})
        found = hv.solve(replace(problem, material=hv.Material.young(20e3, 0.0))).raise_for_status()
        np.testing.assert_allclose(found.penetration, p / (10.0 + 2.0 * p), rtol=1e-6)


@pytest.mark.parametrize("text", RISING_WITH_POLE)
def test_a_derivative_with_a_pole_is_refused_with_its_place(text: str) -> None:
    place = RISING_WITH_POLE[text]
    with pytest.raises(ProblemError, match=rf"a pole, or no value, at r = {place:.6g}:".replace(".", r"\.")) as caught:
        FormulaLaw(derivative=text)
    assert ("or continue it by its tangent: piecewise" in str(caught.value)) == (place != 0.0)


@pytest.mark.parametrize("text", HARMLESS)
def test_formulas_without_a_pole_are_taken(text: str) -> None:
    FormulaLaw(derivative=text)


@pytest.mark.parametrize("text", ["-sqrt(r^2)", "-((r - 1)^2)^0.5", "(r^2)^0.75"])
def test_a_root_that_hides_a_kink_is_refused(text: str) -> None:
    """The first two are concave at a kink, where the second derivative in symbols is zero on either side."""
    with pytest.raises(ProblemError, match="a pole, or no value"):
        FormulaLaw(text)


def test_bounds_and_zeros_do_not_pass_through_a_pole() -> None:
    """The slope of tan is positive, yet its value at the end bounds nothing, and where its sign differs is no zero."""
    ends = np.array([0.0]), np.array([3.0])
    for sign in (1.0, -1.0):
        one = smooth("tan(r)") if sign > 0.0 else smooth("tan(r)").negative()
        assert one.supremum(*ends, 3.0, 0.0).bound == np.inf
    zeros = smooth("tan(r) - 0.5").zeros(6.0)
    exact = math.atan(0.5) + np.pi * np.arange(-2, 2)
    for place in exact[np.abs(exact) < 6.0]:
        assert zeros is None or np.abs(zeros - place).min() < 1e-12


@pytest.mark.parametrize("text", RISING_WITH_POLE)
def test_the_nearest_pole_is_found_between_ends(text: str) -> None:
    one = smooth(text)
    found = pole_of_pieces([one], np.array([-10.0, 10.0]), 10.0)
    assert found is not None
    assert found.sure
    assert found.place == pytest.approx(RISING_WITH_POLE[text], rel=1e-12, abs=1e-14)
    beside = (1.0 - 1e-9) * abs(found.place)
    if beside:
        assert pole_of_pieces([one], np.array([-beside, beside]), 10.0) is None


@pytest.mark.parametrize(
    ("text", "place"), [("1/(1 - s)^2", "1"), ("1/abs(1 - s)", "1"), ("0.3/(1 + s)", "-1"), ("tan(s)^2", r"1\.5708")]
)
def test_friction_bounds_with_a_pole_are_refused_with_its_place(text: str, place: str) -> None:
    with pytest.raises(ProblemError, match=f"friction bound: .* a pole, or no value, at s = {place}:"):
        PenetrationBound(text)


def test_a_friction_bound_of_the_contact_alone_is_taken() -> None:
    """0.3 / (1 + s) is steepest at s = 0."""
    assert PenetrationBound("0.3/(1 + max(s, 0))").lipschitz[0] == pytest.approx(0.3, rel=1e-6)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("r^2 + s^2 + 1/(1 - r)", "r = 1, s"),
        ("r^2 + s^2 + 0.01/(s - 0.777)^2", "s = 0.777:"),
        ("r^2 + s^2 + 1e-4*tanh(1/(r - 1.23456))", "r = 1.23456, s"),
        ("r^2 + s^2 - log(abs(1.23456 - r))", "r = 1.23456, s"),
    ],
)
def test_coupled_formulas_with_a_pole_are_refused_with_its_place(text: str, place: str) -> None:
    with pytest.raises(ProblemError, match="a pole, or no value, at .*" + place.replace(".", r"\.")):
        CoupledFormulaLaw(text, reach=2.0)


@pytest.mark.parametrize("text", ["sqrt(r^2 + s^2 + 0.01)", "piecewise((r^2 + s^2, r < 0), (r^2 + s^2 + r^2.5, True))"])
def test_coupled_formulas_without_a_pole_are_taken(text: str) -> None:
    CoupledFormulaLaw(text, reach=2.0)


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("tr^2 + dev2 + 0.001*tan(100*tr)^2", r"tr = -?0\.0(157080|471239|785398),"),
        ("tr^2 + dev2 - log(abs(0.05 - tr)) + log(0.05) - 20*tr", r"tr = 0\.05,"),
        ("tr^2 + dev2 + dev2/(0.002 - dev2)", r"dev2 = 0\.002:"),
        ("exx^2 + eyy^2 + 2*exy^2 + 1e-3*exx^2/(0.0512345 - exx)", r"exx = 0\.0512345,"),
    ],
)
def test_materials_with_a_pole_are_refused_with_its_place(text: str, place: str) -> None:
    with pytest.raises(ProblemError, match="energy: .* a pole, or no value, at .*" + place):
        hv.Material.potential(text, reach=0.1)


def test_a_material_whose_pole_lies_beyond_the_reach_is_taken() -> None:
    """The volume grows by sqrt(3) times the reach at most: the pole of the logarithm at 0.2 is not met."""
    hv.Material.potential("tr^2 + dev2 - log(0.2 - tr) + log(0.2) - 5*tr", reach=0.1)


@pytest.mark.parametrize(
    ("text", "place"),
    [("1/(1 - t)", "1"), ("1/abs(t - 1)", "1"), ("tan(t)", r"1\.5708"), ("exp(1/(t - 0.3))", r"0\.3")],
)
def test_loads_with_a_pole_in_time_are_refused_with_its_time(text: str, place: str) -> None:
    with pytest.raises(ProblemError, match=f"a pole, or no value, at t = {place}:"):
        Formula(text).refuse_pole_in_time(0.0, 2.0)


@pytest.mark.parametrize("text", ["1/(1 - t)", "min(t, 1)", "1/t", "sqrt(t)", "x/(1 - t)"])
def test_loads_without_a_pole_in_time_are_taken(text: str) -> None:
    """One at an end is met by the values themselves."""
    Formula(text).refuse_pole_in_time(0.0, 1.0)


def test_a_march_over_a_pole_is_refused() -> None:
    """No step need hit it: without the question the load changes its sign between two steps."""
    pull = FormulaArray((0.0, Formula("0.001/(0.55 - t)")), (2,))
    column = bodies.column(top=hv.Clamped(), lame=(1, 1), density=1.0, tractions={"bottom": pull})
    body = Evolution(column, inertia=True)
    with pytest.raises(ProblemError, match=r"at t = 0\.55: .* or an end of the time below 0\.55"):
        march(body, 1.0, step=0.1)
    assert march(body, 0.5, step=0.1).times[-1] == pytest.approx(0.5)
