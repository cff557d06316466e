"""Ends of intervals: rounded outwards, and the whole line where an operation has no number."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest

from hemivar.formula.enclosure import enclosed
from hemivar.formula.intervals import ENCLOSED, mended
from hemivar.formula.reader import Reader


def test_ends_are_rounded_outwards() -> None:
    tenths = np.array([0.1, -0.1, 0.3])
    low, high = mended(tenths, tenths)
    for below, above, exact in zip(low, high, (Fraction(1, 10), Fraction(-1, 10), Fraction(3, 10)), strict=True):
        assert Fraction(below) < exact < Fraction(above)
    assert (high - low <= 1e-14).all()


def test_no_number_is_the_whole_line_and_the_infinite_stays() -> None:
    with np.errstate(invalid="ignore"):
        low, high = mended(np.array([np.nan, 1.0, -np.inf, np.inf]), np.array([2.0, np.nan, 3.0, np.inf]))
    assert low.tolist()[0] == -np.inf
    assert high.tolist()[0] == pytest.approx(2.0)
    assert (low[1] < 1.0) & (high[1] == np.inf)
    assert (low[2] == -np.inf) & (high[2] > 3.0)
    assert (low[3], high[3]) == (np.inf, np.inf)


def test_zero_times_infinity_is_zero() -> None:
    """The infinite end is a bound and no value: zero times all that lies below it is zero."""
    low, high = ENCLOSED["*"]((np.zeros(2), np.array([0.0, 1.0])), (np.zeros(2), np.full(2, np.inf)))
    assert low.tolist() == [0.0, 0.0]
    assert high.tolist() == [0.0, np.inf]


@pytest.mark.parametrize("text", ["0.1", "0.1 + 0.2", "0.7*3"])
def test_written_numbers_lie_between_their_ends(text: str) -> None:
    """A tenth is no number of the machine: what stands for it must reach to both sides."""
    graph, node = Reader(text, "", ("r",)).graph()
    low, high = enclosed(graph, node, np.zeros(1), np.ones(1))
    exact = {"0.1": Fraction(1, 10), "0.1 + 0.2": Fraction(3, 10), "0.7*3": Fraction(21, 10)}[text]
    assert Fraction(low[0]) < exact < Fraction(high[0])


def test_waves_stay_between_minus_one_and_one() -> None:
    for text in ("sin(r)", "cos(r)", "tanh(r)"):
        graph, node = Reader(text, "", ("r",)).graph()
        low, high = enclosed(graph, node, np.array([-100.0]), np.array([100.0]))
        assert (low[0], high[0]) == (-1.0, 1.0)
