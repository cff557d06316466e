"""Bounds in words are bounds still."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hemivar.basics.rounding import rounded_down, rounded_up


@pytest.mark.parametrize("digits", [1, 3, 6])
def test_rounding_goes_one_way(digits: int) -> None:
    rng = np.random.default_rng(2)
    for value in rng.normal(size=300) * 10.0 ** rng.integers(-12, 12, 300):
        low, high = float(rounded_down(value, digits)), float(rounded_up(value, digits))
        assert low <= value <= high
        assert high - low <= 1.001 * abs(value) * 10.0 ** (1 - digits)


def test_what_is_no_ordinary_number() -> None:
    assert rounded_up(0.0) == "0"
    assert rounded_up(math.inf) == "inf"
    assert rounded_down(math.nan) == "nan"
    assert rounded_up(0.07843) == "0.0785"
    assert rounded_down(-0.07841, 2) == "-0.079"
