"""Formulas: values against numpy, and refusal of everything that is not arithmetic."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hemivar.errors import ProblemError
from hemivar.formula import Formula, FormulaArray
from hemivar.formula.formula import ScalarFormula
from hemivar.formula.reader import FUNCTIONS

POINTS = np.random.default_rng(1).uniform(0.1, 2.0, (7, 2))
X, Y = POINTS.T


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("0.1*x*(1-x)", 0.1 * X * (1 - X)),
        ("-x^2", -(X**2)),
        ("2 ** -y", 2**-Y),
        ("2^3^0.5", np.full(7, 2 ** (3**0.5))),
        ("x/y - +3", X / Y - 3),
        ("sin(pi*x) + cos(y)*tan(0.1*x)", np.sin(np.pi * X) + np.cos(Y) * np.tan(0.1 * X)),
        ("exp(-x) * log(y + 1) * sqrt(x) * tanh(y)", np.exp(-X) * np.log(Y + 1) * np.sqrt(X) * np.tanh(Y)),
        ("abs(x - y)", np.abs(X - Y)),
        ("min(x, y)", np.minimum(X, Y)),
        ("max(x, y, 1.0, 0)", np.maximum(np.maximum(X, Y), 1.0)),
        ("1e-3 + 2.5E2", np.full(7, 250.001)),
        ("7", np.full(7, 7.0)),
        ("\n  x +\n  y  ", X + Y),
    ],
)
def test_values(text: str, expected: np.ndarray) -> None:
    np.testing.assert_allclose(Formula(text)(POINTS), expected, rtol=1e-14)


def test_result_has_one_number_per_point_and_is_fresh() -> None:
    formula = Formula("x")
    first = formula(POINTS)
    first[:] = 0.0
    assert first.shape == (7,)
    assert np.all(formula(POINTS) == X)
    assert Formula("1")(POINTS[:0]).shape == (0,)


def test_three_coordinates() -> None:
    points = np.arange(12.0).reshape(4, 3)
    np.testing.assert_array_equal(Formula("z - x")(points), 2.0)
    assert Formula("z - x").variables == {"x", "z"}
    assert Formula("2 * pi").variables == frozenset()


leaves = st.one_of(st.sampled_from(["x", "y", "pi"]), st.floats(0.1, 9.0).map(lambda v: f"{v:.3g}"))
trees = st.recursive(
    leaves,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from([" + ", "-", "*", " / "]), inner).map(lambda t: f"({t[0]}{t[1]}{t[2]})"),
        st.tuples(st.sampled_from(["sin", "cos", "tanh", "abs"]), inner).map(lambda t: f"{t[0]}({t[1]})"),
        inner.map(lambda t: f"-{t}"),
        inner.map(lambda t: f"({t})^2"),
    ),
    max_leaves=8,
)


@settings(max_examples=60, deadline=None)
@given(trees)
def test_any_formula_has_the_value_that_numpy_gives(text: str) -> None:
    names = {name: FUNCTIONS[name] for name in ("sin", "cos", "tanh", "abs")}
    code = re.sub(r"[\d.]+", r"number(\g<0>)", text).replace("^", "**")
    known = {**names, "number": np.float64, "x": X, "y": Y, "pi": np.float64(np.pi)}
    with np.errstate(all="ignore"):
        expected = eval(code, {"__builtins__": {}}, known)
    expected = np.broadcast_to(expected, 7)
    if np.isfinite(expected).all():
        np.testing.assert_allclose(Formula(text)(POINTS), expected, rtol=1e-10, atol=1e-300)
    else:
        with pytest.raises(ProblemError, match="finite"):
            Formula(text)(POINTS)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "empty"),
        ("   ", "empty"),
        ("2x", "character 1: not understood"),
        ("x*0x10", "character 3: '0x10' is not a number; write it in decimal digits"),
        ("1_5*x", "character 1: '1_5' is not a number"),
        ("0b1", "'0b1' is not a number"),
        ("x +", "character 3: not understood"),
        ("0.1 * (x", "character 7: not understood"),
        ("x^2 y", "character 5: not understood"),
        ("x < 1", "character 3: '<' does not belong"),
        ("x == 1", "character 3: '=' does not belong"),
        ("x if y else 1", "character 1: only numbers"),
        ("x and y", "character 1: only numbers"),
        ("x.real", "character 1: only numbers"),
        ("(x, y)", "character 1: only numbers"),
        ("x // 2", "character 2: operator not known"),
        ("x % 2", "character 3: '%' does not belong"),
        ("x @ y", "character 3: '@' does not belong"),
        ("lambda: x", "character 7: ':' does not belong"),
        ("[x]", "character 1: '\\[' does not belong"),
        ("x; y", "character 2: ';' does not belong"),
        ("x # comment", "character 3: '#' does not belong"),
        ("'x'", "character 1: .* does not belong"),
        ("\N{GREEK SMALL LETTER ALPHA}", "character 1: .* does not belong"),
        ("x\0", "character 2: .* does not belong"),
        ("__import__(x)", "character 1: function '__import__' is not known"),
        ("eval(x)", "function 'eval' is not known; use sin, cos"),
        ("1 + sinn(x)", "character 5: function 'sinn' is not known; did you mean 'sin'"),
        ("2^3*s", "character 5: 's' is not known"),
        ("x^2 + q", "character 7: 'q' is not known"),
        ("sin", "'sin' is a function; write sin"),
        ("pi(x)", "'pi' is not a function"),
        ("sin(x, y)", "sin takes one argument, not 2"),
        ("sin()", "sin takes one argument, not 0"),
        ("max(x)", "max takes two or more arguments, not 1"),
        ("min(x, *y)", "character 8: only numbers"),
        ("True", "not numbers"),
        ("1j", "only numbers"),
        ("...", "only numbers"),
        ("1e999", "too large"),
        ("9" * 800, "too large"),
        ("x" + " + x" * 300, "at most 1000"),
        ("x" + "+x" * 400, "nested too deeply"),
        ("-" * 500 + "x", "nested too deeply"),
        ("(" * 400 + "x" + ")" * 400, "formula"),
    ],
)
def test_refusals_name_the_character(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words) as caught:
        Formula(text, "part.toml: gap")
    message = str(caught.value)
    assert message.startswith("part.toml: gap: formula '")
    assert message.isprintable()


def test_values_are_checked_where_they_are_taken() -> None:
    with pytest.raises(ProblemError, match=r"gap: formula '1/x' is inf at x = 0, y = 0.5; give a formula"):
        Formula("1/x", "gap")(np.array([[1.0, 0.5], [0.0, 0.5]]))
    with pytest.raises(ProblemError, match=r"is nan at x = 1, y = 2"):
        Formula("log(-x)")(np.array([[1.0, 2.0]]))
    with pytest.raises(ProblemError, match=r"is -1 at x = 0, y = 0; it must be at least 0"):
        Formula("x - 1", minimum=0.0)(np.zeros((1, 2)))
    with pytest.raises(ProblemError, match="uses z, but the points have only 2 coordinates"):
        Formula("z")(POINTS)
    with pytest.raises(ProblemError, match="is inf"):
        Formula("9^9^9^9")(POINTS)


def test_arrays_of_formulas() -> None:
    vector = FormulaArray((1.0, Formula("x*y")), (2,))
    np.testing.assert_allclose(vector(POINTS), np.column_stack([np.ones(7), X * Y]))
    matrix = FormulaArray((1.0, Formula("x"), 2.0, 3.0), (2, 2))
    assert matrix(POINTS).shape == (7, 2, 2)
    np.testing.assert_allclose(matrix(POINTS)[:, 0, 1], X)


# ---- formulas of one variable ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "r^3 - 2*r/(1 + r^2)",
        "sin(2*r)*cos(r) - tan(r/4)",
        "exp(-r^2)*log(2 + r) + sqrt(2 + r)",
        "tanh(r)^2 / (3 - r)",
        "2^r + (2 + r)^r - -r",
        "-(r - 1)*-(r + 2)",
        "5",
    ],
)
def test_symbolic_derivatives(text: str) -> None:
    smooth = ScalarFormula(text).branch(0.3)
    slope, curvature = smooth.derivative(), smooth.derivative().derivative()
    r, h = np.linspace(-1.0, 1.0, 21), 1e-5
    np.testing.assert_allclose(slope(r), (smooth(r + h) - smooth(r - h)) / (2 * h), rtol=1e-7, atol=1e-8)
    np.testing.assert_allclose(curvature(r), (slope(r + h) - slope(r - h)) / (2 * h), rtol=1e-7, atol=1e-8)


def test_piecewise_formulas_and_their_switches() -> None:
    formula = ScalarFormula("piecewise((0, r < 0), (10*r^2, 0 <= r < 0.1), 0.1)")
    np.testing.assert_allclose(formula(np.array([-1.0, 0.05, 0.1, 2.0])), [0.0, 0.025, 0.1, 0.1])
    np.testing.assert_array_equal(formula.switches(1.0)[0], [0.0, 0.1])
    assert str(formula.branch(0.05).derivative()) == "20 * r"
    nested = ScalarFormula("abs(abs(r) - 1) + max(0, r^2 - 4, r)")
    places, sure = nested.switches(10.0)
    np.testing.assert_allclose(places, [-2.0, -1.0, 0.0, 1.0, 2.0, 0.5 + 17**0.5 / 2])
    assert sure
    assert ScalarFormula("8*s", "s")(np.array([2.0]))[0] == 16.0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("r < 1", "character 1: comparisons are allowed in piecewise"),
        ("piecewise(r)", "character 11: this entry of piecewise has no condition"),
        ("piecewise()", "has no entry"),
        ("piecewise((r, r < 1, 2))", r"an entry of piecewise is \(value, condition\)"),
        ("piecewise((1, r == 0))", "character 15: this is not a condition"),
        ("piecewise((1, True), (2, r < 0))", "character 22: this entry of piecewise is never reached"),
        ("piecewise((1, True), 2)", "never reached"),
        ("piecewise((1, r < y))", "character 19: 'y' is not known"),
        ("1 + x", "character 5: 'x' is not known; use r"),
        ("__import__('os')", "does not belong"),
    ],
)
def test_bad_formulas_of_one_variable(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        ScalarFormula(text)
    with pytest.raises(ProblemError, match=r"does not belong|only numbers|not known"):
        Formula("piecewise((1, x < 0), (2, True))")


@given(trees)
@settings(max_examples=60, deadline=None)
def test_enclosures_hold_all_values(text: str) -> None:
    smooth = ScalarFormula(text.replace("x", "r").replace("y", "(r + 1)").replace("er", "ex")).branch(0.4)
    for order in range(2):
        low, width = np.linspace(-2.0, 2.0, 21), 10.0 ** np.linspace(-6.0, 0.5, 21)
        below, above = smooth.enclosed(low, low + width)
        for share in (0.0, 0.3, 0.77, 1.0):
            values = smooth(low + share * width)
            known = np.isfinite(values)
            assert np.all((values >= below - 1e-300)[known]), (text, order)
            assert np.all((values <= above + 1e-300)[known]), (text, order)
        smooth = smooth.derivative()


@pytest.mark.parametrize(
    ("text", "low", "high", "known"),
    [
        ("r^(-0.5)", 1.0, 4.0, (0.5, 1.0)),
        ("1/r", 0.0, 0.0, (-np.inf, np.inf)),
        ("1/r", -2.0, 0.0, (-np.inf, -0.5)),
    ],
)
def test_enclosures_of_powers_that_fall(text: str, low: float, high: float, known: tuple[float, float]) -> None:
    below, above = ScalarFormula(text).branch(1.0).enclosed(np.array([low]), np.array([high]))
    assert (below[0], above[0]) == pytest.approx(known, rel=1e-12)
    assert below[0] <= known[0]
    assert above[0] >= known[1]


@pytest.mark.parametrize(
    ("text", "as_power"),
    [
        ("r*r", "r^2"),
        ("(r - 0.1)*(r - 0.1)/3", "(r - 0.1)^2/3"),
        ("2*(r - 0.1)*(r - 0.1)", "2*(r - 0.1)^2"),
        ("-r*r", "-r^2"),
        ("r*(-r)", "-r^2"),
        ("(r/3)*r", "r^2/3"),
        ("r*r*r*r", "r^4"),
        ("r^2*r*r^2", "r^5"),
        ("sin(r)*sin(r)", "sin(r)^2"),
        ("(r*r - 1)*(r*r - 1)", "(r^2 - 1)^2"),
        ("1/(1 + r*r)", "1/(1 + r^2)"),
    ],
)
def test_bounds_of_equal_factors_are_those_of_their_power(text: str, as_power: str) -> None:
    """An interval does not remember that two factors have one value."""
    low, high = np.array([-0.7, -0.2, 0.4]), np.array([0.6, 1.1, 0.5])
    found, wanted = (ScalarFormula(one).branch(0.2).enclosed(low, high) for one in (text, as_power))
    np.testing.assert_allclose(found, wanted, rtol=1e-12, atol=1e-14)
    places = np.stack([low, high, 0.5 * (low + high)])
    assert (ScalarFormula(text).branch(0.2)(places.ravel()).reshape(3, 3) <= found[1]).all()
    corners = np.array([[[-0.7, 0.0], [0.6, 0.0]]])
    mean = [Formula(one.replace("r", "x")).expansion(corners).off for one in (text, as_power)]
    np.testing.assert_allclose(*mean, rtol=1e-12, atol=1e-14)


def test_where_rounding_moves_an_angle_a_tangent_is_anything() -> None:
    place = 2e13 + np.arange(8.0)
    below, above = ScalarFormula("tan(r)").branch(1.0).enclosed(place, place)
    assert (below == -np.inf).all()
    assert (above == np.inf).all()
