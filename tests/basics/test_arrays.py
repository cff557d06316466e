"""The check of arrays and the norm."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.basics.arrays import norm, real_array, real_matrix
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
        ([1.0, [2.0, 3.0]], "load is not an array of numbers"),
        (["a", "b"], "load is not an array of numbers"),
        ([[1.0]], "1 axis"),
    ],
)
def test_arrays_that_are_refused(value: object, message: str) -> None:
    with pytest.raises(ProblemError, match=message):
        real_array(value, "load", 1)  # type: ignore[arg-type]


@pytest.mark.parametrize("kind", ["csr", "csc", "bsr", "coo"])
@pytest.mark.parametrize("part", ["columns", "pointers", "negative"])
def test_a_damaged_sparse_matrix_is_refused_before_it_is_read(kind: str, part: str) -> None:
    """SciPy would read memory outside of the matrix."""
    matrix = sp.csr_array(np.arange(1.0, 17.0).reshape(4, 4)).asformat(kind)
    assert real_matrix(matrix, "A").shape == (4, 4)
    if kind == "coo":
        matrix.coords = (matrix.row.copy(), matrix.col.copy())
        matrix.coords[0 if part == "pointers" else 1][2] = -1 if part == "negative" else 10**6
    elif part == "pointers":
        matrix.indptr[1] = 10**6
    else:
        matrix.indices[-1] = -1 if part == "negative" else 10**6
    with pytest.raises(ProblemError, match=r"A is a damaged sparse matrix.*build it again"):
        real_matrix(matrix, "A")
