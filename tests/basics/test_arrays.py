"""The check of arrays and the norm."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics.arrays import norm, real_array
from hemivar.errors import ProblemError


@pytest.mark.parametrize("size", [1e-320, 1e-200, 1.0, 1e160, 1.7e308 / 5])
def test_norm_neither_overflows_nor_underflows(size: float) -> None:
    assert norm([3.0 * size, 4.0 * size]) == pytest.approx(5.0 * size, rel=1e-3 if size < 1e-300 else 1e-15)


def test_norm_of_nothing_and_of_what_is_not_finite() -> None:
    assert norm([]) == 0.0
    assert norm([1.0, np.inf]) == np.inf
    assert np.isnan(norm([1.0, np.nan]))


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([1.0, 2.0 + 0.0j], "load is complex"),
        (np.array([1.0, 2j], dtype=object), "load is complex"),
        ([1.0, np.nan], r"load\[1\] = nan"),
        ([1.0, [2.0, 3.0]], "load is no array of numbers"),
        (["a", "b"], "load is no array of numbers"),
        ([[1.0]], "1 axis"),
    ],
)
def test_arrays_that_are_refused(value: object, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        real_array(value, "load", 1)  # type: ignore[arg-type]
