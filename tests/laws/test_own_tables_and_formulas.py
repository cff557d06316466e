"""Laws from tables, formulas and Python functions."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hemivar.errors import ProblemError
from hemivar.laws import (
    ContactLaw,
    FormulaLaw,
    Friction,
    FunctionLaw,
    Layered,
    Logarithmic,
    PenetrationBound,
    PiecewiseQuadratic,
    Signorini,
    SlipTable,
    SlipWeakening,
    ThresholdCompliance,
    read_law_table,
    table_law,
)
from hemivar.laws.testing import check_law
from tests.counting import at_most_calls

R = np.linspace(-1.5, 3.0, 41)


# ---- tables ----------------------------------------------------------------------------------------------


def test_a_table_is_integrated_with_its_jumps() -> None:
    law = table_law([0.0, 0.1, 0.1], [0.0, 2.0, 0.0])
    np.testing.assert_allclose(law.value(np.array([-1.0, 0.05, 0.1, 3.0])), [0.0, 0.025, 0.1, 0.1], atol=1e-15)
    at = law.subdifferential(np.array([0.1]))
    assert (at.lower[0], at.upper[0]) == (0.0, 2.0)
    assert law.weak_convexity[0] == np.inf


@pytest.mark.parametrize(("extend", "expected"), [("constant", [-1.0, 3.0]), ("linear", [-5.0, 7.0])])
def test_beyond_the_ends(extend: str, expected: list[float]) -> None:
    law = table_law([0.0, 1.0], [-1.0, 3.0], extend=extend)
    np.testing.assert_allclose(law.derivative(np.array([-1.0, 2.0])), expected)


@given(
    gaps=st.lists(st.floats(0.0, 1.0), min_size=1, max_size=6),
    data=st.data(),
)
@settings(max_examples=25, deadline=None)
def test_any_table_passes_the_kit(gaps: list[float], data: st.DataObject) -> None:
    r = np.cumsum([0.0, *(round(g, 3) if g > 0.05 else 0.0 for g in gaps)]) - round(data.draw(st.floats(0.0, 1.0)), 3)
    keep = np.ones(r.size, dtype=bool)
    keep[2:] = r[2:] != r[:-2]
    values = np.round(data.draw(st.lists(st.floats(-2.0, 2.0), min_size=r.size, max_size=r.size)), 3)
    if keep.sum() < 2 or np.all(values == 0.0):
        return
    law = table_law(r[keep], values[keep])
    assert check_law(law).passed
    np.testing.assert_allclose(law.derivative(r[keep][:1]), values[keep][:1], atol=1e-12)


def test_a_table_may_fall_at_its_end_and_go_on_falling() -> None:
    """Friction may not, for it would be negative farther out."""
    law = table_law([0.0, 1.0, 2.0], [0.0, 2.0, 1.5], extend="linear")
    np.testing.assert_allclose(law.derivative(np.array([-1.0, 0.5, 1.5, 3.0, 7.0])), [-2.0, 1.0, 1.75, 1.0, -1.0])


def test_friction_tables_are_even() -> None:
    law = table_law([0.0, 0.2, 0.2, 1.0], [1.0, 0.8, 0.5, 0.5], friction=True)
    assert check_law(law, friction=True).passed
    at_rest = law.subdifferential(np.zeros(1))
    assert (at_rest.lower[0], at_rest.upper[0]) == (-1.0, 1.0)
    late = table_law([0.1, 0.2], [1.0, 0.5], friction=True)
    np.testing.assert_allclose(late.derivative(np.array([0.05, -0.05, 0.15])), [1.0, -1.0, 0.75])


def test_reading_tables(tmp_path: Path) -> None:
    expected = table_law([0.0, 0.1, 0.1], [0.0, 2.0, 0.5])
    for i, text in enumerate(
        [
            "r,derivative\n0,0\n0.1,2\n0.1,0.5\n",
            "# glue\n\n0;0\n1e-1;2\n.1;0.5",
            "\ufeffr\tj'\n0\t0\n0.1\t2\n0.1\t0.5\n",
            "derivative,r\n0,0\n2,0.1\n0.5,0.1\n",
            '"Derivative" , "note" , "R"\n0,,0\n"2","a, b",0.1\n\n0.5,,"0.1"\n',
            "penetration derivative\n0 0\n0.1  2\n 0.1 0.5",
            "r;derivative\r\n0;0\r\n0.1;2\r\n# end\r\n0.1;0.5\r\n",
        ]
    ):
        path = tmp_path / f"{i}.csv"
        path.write_text(text, encoding="utf-8")
        law = read_law_table(path)
        np.testing.assert_array_equal(law.derivative(R), expected.derivative(R))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("r,derivative\n0,0\n0.2,1\n0.1,0\n", ["row 3", "r = 0.1 comes after 0.2"]),
        ("0,0\n", ["1 row;", "at least 2"]),
        ("", ["0 rows"]),
        ("0,0\n1,soft\n", ["line 2", "these are not two numbers", "(found: 1)"]),
        ("0,0\n1\n", ["line 2", "not two numbers"]),
        ("0,1,2,5\n1,0,3,5\n", ["line 1", "4 columns without names", "decimal points, not commas", "r and derivative"]),
        ("0,1\n0,5,2\n", ["line 2", "3 columns where the first line has 2"]),
        ("0,1;2,5\n", ["line 1", "there are decimal commas; write decimal points"]),
        ("r;derivative\n0,1;2,5\n", ["line 2", "there are decimal commas"]),
        ("0,1 0,5\n", ["line 1", "3 columns without names", "decimal points"]),
        ("r,force\n0,0\n1,1\n", ["line 1", "no column named derivative", "(the line has 2)"]),
        ("r,r,derivative\n0,0,1\n1,1,1\n", ["line 1", "2 columns are named r"]),
        ("r,derivative,penetration\n0,0,1\n1,1,1\n", ["2 columns are named r"]),
        ("r\n0\n1\n", ["line 1", "no column named derivative"]),
        ("0\n1\n", ["line 1", "not two numbers"]),
        ("r,derivative\nr,derivative\n0,1\n", ["line 2", "not two numbers"]),
        ("0,1_000\n1,1\n", ["line 1", "not two numbers"]),
        ("0,1,\n1,1,\n", ["line 1", "3 columns without names"]),
        ('0,"' + "1" * 200_000 + '"\n', ["line 1", "not a line of a table", "131072"]),
        ("0,\0\n", ["line 1", "not two numbers"]),
        ("0,0\n1,nan\n", ["row 2", "finite"]),
        ("0,0\n1,1\n1,2\n1,3\n", ["row 4", "a third time"]),
    ],
)
def test_bad_tables_are_reported_with_their_row(tmp_path: Path, text: str, words: list[str]) -> None:
    path = tmp_path / "law.csv"
    path.write_text(text)
    with pytest.raises(ProblemError) as caught:
        read_law_table(path)
    for word in [str(path), *words]:
        assert word in str(caught.value)
    with pytest.raises(ProblemError, match="no such file"):
        read_law_table(tmp_path / "none.csv")


@pytest.mark.parametrize(
    "text",
    [
        "root:SECRET:0",
        "SECRET,1\n",
        "0,0\nSECRET,1\n",
        "SECRET 1 2",
        "1,SECRET,3\n",
        '0,"SECRET\n',
        "0,0\n1,2,SECRET\n",
    ],
)
def test_of_a_file_that_is_no_table_nothing_is_told(tmp_path: Path, text: str) -> None:
    path = tmp_path / "law.csv"
    path.write_text(text)
    with pytest.raises(ProblemError, match="line ") as caught:
        read_law_table(path)
    assert "SECRET" not in str(caught.value)


def test_friction_tables_refuse_negative_slips() -> None:
    with pytest.raises(ProblemError, match=r"row 1: r = -0.1 is negative"):
        table_law([-0.1, 0.1], [1.0, 1.0], friction=True)


def test_friction_is_never_negative() -> None:
    for make in (
        lambda: table_law([0.0, 0.1], [1.0, -0.5], friction=True),
        lambda: SlipTable(0.3, [0.0, 0.1], [1.0, -0.5]),
    ):
        with pytest.raises(ProblemError, match=r"row 2: the friction -0.5 is negative"):
            make()
    with pytest.raises(ProblemError, match=r"law 'formula' is negative friction, -2 at the slip r = 0.5"):
        Friction(0.3, FormulaLaw("r - 3*max(r - 0.5, 0)", even=True, reach=1.0))
    with pytest.raises(ProblemError, match=r"law 'function'.*negative"):
        Friction(0.3, FunctionLaw(derivative=lambda r: 0.1 - r, even=True))
    with pytest.raises(ProblemError, match=r"row 2: with extend = linear the falling friction"):
        table_law([0.0, 0.1], [1.0, 0.9], extend="linear", friction=True)


def test_a_profile_of_friction_is_even() -> None:
    for profile in (FormulaLaw("abs(r) + r"), table_law([0.0, 0.1], [0.0, 1.0]), ThresholdCompliance(0.3), Signorini()):
        with pytest.raises(ProblemError, match=r"must be even|is not even"):
            Friction(0.3, profile)
    Friction(0.3, FormulaLaw("abs(r) + 0.1*r^2"))


# ---- formulas --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "even", "expected"),
    [
        ("7/10*abs(r) - 3/10*exp(-abs(r))", False, SlipWeakening(1.0).radial),
        ("7/10*r - 3/10*exp(-r)", True, SlipWeakening(1.0).radial),
        ("log(1 + 4*r)", True, Logarithmic(1.0, 0.25).radial),
        ("piecewise((0, r < 0), (10*r^2, r < 0.1), (0.1, True))", False, table_law([0, 0.1, 0.1], [0, 2, 0])),
        ("piecewise((0, r <= 0), (10*r^2, 0 < r <= 0.1), 0.1)", False, table_law([0, 0.1, 0.1], [0, 2, 0])),
        ("min(10*max(r, 0)^2, 0.1)", False, table_law([0, 0.1, 0.1], [0, 2, 0])),
        ("5 + max(r, 0)*3 + r^2", False, PiecewiseQuadratic([0.0], [2.0, 2.0], [3.0])),  # type: ignore[arg-type]
    ],
)
def test_formulas_agree_with_named_laws(text: str, even: bool, expected: object) -> None:
    law = FormulaLaw(text, even=even)
    a, b = np.full(R.size, 0.9), np.linspace(-2.0, 2.0, R.size)
    for name, arguments in (
        ("value", (R,)),
        ("derivative", (R + 1e-3,)),
        ("curvature", (R + 1e-3,)),
        ("local_argmin", (a, b)),
    ):
        np.testing.assert_allclose(getattr(law, name)(*arguments), getattr(expected, name)(*arguments), atol=1e-12)
    assert law.weak_convexity[0] == pytest.approx(expected.weak_convexity[0])  # type: ignore[attr-defined]
    assert law.weak_convexity[0] >= expected.weak_convexity[0]  # type: ignore[attr-defined]
    assert law.proof("alpha").sure


def test_kinks_are_exact_or_found() -> None:
    law = FormulaLaw("abs(r - 0.123456789) + max(exp(r) - 2, 0)")
    np.testing.assert_allclose(law.knots[0], [0.123456789, np.log(2.0)], rtol=1e-14)
    small = FormulaLaw("piecewise((0, r < 1e-4), (1e6*(r - 1e-4)^2, True))")
    assert 1e-4 in small.knots[0]
    assert 0.3 in FormulaLaw("r^2", kinks=[0.3]).knots[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("log(1+r)", ["not finite", "r = -", "piecewise, max(r, 0) or abs(r)"]),
        ("piecewise((0, r < 0), (1, r > 0))", ["0 to the left and 1 to the right of r = 0", "continuous"]),
        ("2 * x", ["character 5", "'x' is not known"]),
        ("r +", ["character 3"]),
        ("piecewise((r, r < 0), (0, r = 0))", ["not understood"]),
        ("r.real", ["only numbers, r, pi"]),
    ],
)
def test_bad_formulas(text: str, words: list[str]) -> None:
    with pytest.raises(ProblemError) as caught:
        FormulaLaw(text, where="[contact.bottom] normal.potential")
    for word in ["[contact.bottom] normal.potential: ", *words]:
        assert word in str(caught.value)


# ---- functions -------------------------------------------------------------------------------------------


def _j(r: np.ndarray) -> np.ndarray:
    return np.where(r > 0, np.sin(r) + 0.5 * r, 0.1 * r**2)


def _d(r: np.ndarray) -> np.ndarray:
    return np.where(r > 0, np.cos(r) + 0.5, 0.2 * r)


def _c(r: np.ndarray) -> np.ndarray:
    return np.where(r > 0, -np.sin(r), 0.2)


@pytest.mark.parametrize(
    "law",
    [
        FunctionLaw(derivative=_d, kinks=[0.0]),
        FunctionLaw(_j, _d, kinks=[0.0]),
        FunctionLaw(_j, _d, _c, kinks=[0.0]),
        FunctionLaw(derivative=lambda r: float(np.cos(r) + 0.5) if r > 0 else 0.2 * r, kinks=[0.0]),
    ],
)
def test_what_is_not_given_is_computed(law: FunctionLaw) -> None:  # type: ignore[valid-type]
    r = np.concatenate([R, [1e-7, -1e-7, 1e-3, 7.0]])
    r = r[r != 0.0]
    np.testing.assert_allclose(law.value(r), _j(r), atol=1e-12)
    np.testing.assert_allclose(law.derivative(r), _d(r), atol=2e-9)
    np.testing.assert_allclose(law.curvature(r), _c(r), atol=2e-6)
    at = law.subdifferential(np.zeros(1))
    assert (at.lower[0], at.upper[0]) == pytest.approx((0.0, 1.5), abs=1e-8)
    assert law.weak_convexity[0] == pytest.approx(1.0, rel=1e-4)


def test_functions_that_cannot_be_used_are_refused() -> None:
    for functions in ((), (np.square,), (np.square, None, np.ones_like)):
        with pytest.raises(ProblemError, match=r"law 'mine' has no derivative; give .*, or write .*FormulaLaw"):
            FunctionLaw(*functions, name="mine")
    with pytest.raises(ProblemError, match="not finite at r = "):
        FunctionLaw(derivative=lambda r: np.full(np.shape(r), np.nan))
    with pytest.raises(ProblemError, match="continuous"):
        FunctionLaw(lambda r: np.where(r > 1.0, 1.0, 0.0), np.zeros_like, kinks=[1.0])
    with pytest.raises(ProblemError, match="potential is integrated, too coarsely here: give a function for it too"):
        FunctionLaw(derivative=lambda r: 1e5 * r * np.exp(-((1e5 * r) ** 2)))
    with pytest.raises(ProblemError, match="kinks of law 'function'"):
        FunctionLaw(derivative=lambda r: 2.0 * r, kinks=[np.nan])


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: FunctionLaw(lambda r: r**2, lambda r: 4.0 * r), ["the derivative of law", "should be"]),
        (lambda: FunctionLaw(_j, lambda r: 2.0 * _d(r), kinks=[0.0]), ["the derivative of law", "between r = "]),
        (lambda: FunctionLaw(_j, _d, lambda r: -_c(r), kinks=[0.0]), ["the curvature of law"]),
        (lambda: FunctionLaw(_j, _d, lambda r: 0.0 * r, kinks=[0.0]), ["the curvature of law"]),
        (lambda: FunctionLaw(derivative=_d, curvature=lambda r: 2.0 * _c(r), kinks=[0.0]), ["the curvature of law"]),
        (
            lambda: FunctionLaw(lambda r: np.sqrt(r + 1.0), lambda r: 2.0 / np.sqrt(r + 1.0), even=True),
            ["the derivative of law", "should be"],
        ),
        (lambda: FunctionLaw(derivative=lambda r: 1.0 * (r > 0.37)), ["jumps", "r = 0.37", "kinks"]),
        (lambda: FunctionLaw(derivative=lambda r: 1.0 * (r > 0.37), kinks=[0.3]), ["jumps", "r = 0.37"]),
        (lambda: FunctionLaw(derivative=lambda r: np.sign(r) * np.abs(r) ** -0.1), ["without bound", "r = 0"]),
    ],
)
def test_functions_that_contradict_each_other_are_refused(make: Callable[[], object], words: list[str]) -> None:
    with pytest.raises(ProblemError) as caught:
        make()
    for word in words:
        assert word in str(caught.value)


@given(factor=st.floats(0.05, 20.0), rate=st.floats(0.2, 30.0), place=st.floats(-2.0, 2.0), scale=st.floats(1e-6, 1e6))
@settings(max_examples=20, deadline=None)
def test_functions_in_order_are_accepted_and_others_not(factor: float, rate: float, place: float, scale: float) -> None:
    def value(r: np.ndarray) -> np.ndarray:
        return np.asarray(scale * (np.sin(rate * r) / rate + np.abs(r - place)))

    def slope(r: np.ndarray) -> np.ndarray:
        return np.asarray(scale * (np.cos(rate * r) + np.sign(r - place)))

    FunctionLaw(value, slope, kinks=[place])
    if abs(factor - 1.0) > 0.1:
        with pytest.raises(ProblemError, match="should be"):
            FunctionLaw(value, lambda r: factor * slope(r), kinks=[place])


class _Spring(PiecewiseQuadratic):
    """A law of a user's own class, with a curvature and an alpha that may be wrong."""

    bend = 1.0
    told = 2.0

    def piece_curvature(self, piece: np.ndarray, r: np.ndarray) -> np.ndarray:
        return self.bend * super().piece_curvature(piece, r)

    @property
    def weak_convexity(self) -> np.ndarray:
        return np.array([self.told])


def test_laws_of_own_classes_are_looked_at() -> None:
    table = ([0.0, 0.1, 0.3], [0.0, 3.0, -2.0, 0.0], [0.0, 0.0, 0.0])
    ContactLaw(_Spring(*table))  # type: ignore[arg-type]
    wrong = type("Wrong", (_Spring,), {"bend": 2.0, "__module__": __name__})
    with pytest.raises(ProblemError, match="the curvature of law 'piecewise' is"):
        ContactLaw(wrong(*table))
    soft = type("Soft", (_Spring,), {"told": 1.0, "__module__": __name__})
    with pytest.raises(ProblemError, match=r"alpha of law 'piecewise' is 1, but its derivative falls by 2"):
        ContactLaw(soft(*table))
    with pytest.raises(ProblemError, match=r"jumps down at r = 0.3"):
        ContactLaw(_Spring(table[0], table[1], [0.0, 0.0, -0.1]))  # type: ignore[arg-type]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "make",
    [
        lambda: ThresholdCompliance(0.3 + 0.1j).at(np.zeros((2, 2))),  # type: ignore[arg-type]
        lambda: ThresholdCompliance(lambda x: x[:, 0] + 1j).at(np.zeros((2, 2))),  # type: ignore[arg-type, return-value]
        lambda: PiecewiseQuadratic(np.array([0.0]), np.array([0.0, 1j]), np.array([0.0])),
        lambda: table_law([0.0, 1.0], [0.0, 1.0 + 1j]),  # type: ignore[list-item]
        lambda: Layered([0.1], [1.0 + 1j]),  # type: ignore[list-item]
        lambda: ThresholdCompliance(0.3).scaled(np.array([1.0 + 1j])),
        lambda: FormulaLaw("abs(r)").scaled(np.array([1.0 + 1j])),
        lambda: FunctionLaw(derivative=lambda r: r + 0j),
        lambda: PenetrationBound(([0.0, 1.0], [0.0, 1j])),
        lambda: PenetrationBound(lambda s: s + 0j),
    ],
)
def test_complex_numbers_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(ProblemError, match="complex"):
        make()


def test_formulas_end_after_bounded_work() -> None:
    """Each is accepted or refused; their derivatives as trees, or their kinks one by one, took half a minute."""
    nested = {"abs({} - 0.37)": 30, "sin({})": 40, "({}*r + 1)": 80, "(2 + abs({}))^0.5": 20}
    texts = ["abs(sin(100*r))", "abs(sin(1e5*r))", "sin(1e4*r)", "(" * 80 + "r" + ")" * 80]
    for pattern, count in nested.items():
        text = "r"
        for _ in range(count):
            text = pattern.format(text)
        texts.append(text)
    for text in texts:
        with at_most_calls(2_000_000), contextlib.suppress(ProblemError), warnings.catch_warnings():
            warnings.simplefilter("error")
            FormulaLaw(text).describe()


@pytest.mark.parametrize("text", ["sqrt(abs(r))", "abs(r)^0.9", "(r^2)^0.45", "1/(r - 0.3)", "tan(r)", "max(r, 0)^0.5"])
def test_slopes_without_bound_are_refused_with_their_place(text: str) -> None:
    with pytest.raises(ProblemError, match=r"derivative of .* (is not finite|has a pole, or no value,) at r = "):
        FormulaLaw(text)


def test_alpha_of_a_formula_is_a_bound() -> None:
    """A bump of width 1e-4, which sampling steps over."""
    law = FormulaLaw("r^2 + 1e-7*(1 - exp(-((r - 0.123456)/1e-4)^2))")
    exact = 4e-7 * np.exp(-1.5) / 1e-8 - 2.0  # the bump bends most where the square of (r - 0.123456)/1e-4 is 3/2
    assert law.proof("alpha").sure
    assert exact <= law.weak_convexity[0] <= exact * (1.0 + 1e-6)
    assert FormulaLaw("r^2/(1 + r^2)").weak_convexity[0] == pytest.approx(0.5, rel=1e-6)
    assert FormulaLaw("r^2/(1 + r^2)").proof("alpha").sure
    assert not FunctionLaw(derivative=lambda r: 2.0 * r).proof("alpha").sure
