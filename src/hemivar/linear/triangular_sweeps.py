"""Substitution through a unit lower triangle and its transpose, by the compiled kernels or by those of pyamg."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.kernels import Kernels
from hemivar.kernels import kernels as compiled_kernels
from hemivar.linear.pyamg_kernels import kernels

__all__ = ["PanelSweeps", "RowSweeps", "sweeps_of"]


@dataclass(frozen=True, eq=False)
class _Triangle:
    """A lower triangular matrix (n, n) with ones on its diagonal, by rows."""

    starts: IntArray
    columns: IntArray
    entries: Array

    def sweep(self, x: Array, first: int = 0) -> None:
        """Solve in place from row ``first`` on: ``x (n,)`` is the solution before it and the right side from it on.

        One sweep of Gauss and Seidel is forward substitution, and no sum looks at what has not been solved.
        """
        kernels().gauss_seidel(self.starts, self.columns, self.entries, x, x, first, x.size, 1)


@dataclass(frozen=True, eq=False)
class RowSweeps:
    """L by rows and, as a lower triangle too, its transpose from the last unknown to the first."""

    count: int  # columns from this one on are those of the identity
    lower: _Triangle
    upper: _Triangle

    @classmethod
    def of(cls, columns: sp.csc_array, count: int) -> RowSweeps:
        """From the first ``count`` columns of L (n, n)."""
        n, end = columns.shape[0], columns.indptr[-1]
        data = np.concatenate([columns.data, np.ones(n - count)])
        rows = np.concatenate([columns.indices, np.arange(count, n, dtype=columns.indices.dtype)])
        starts = np.concatenate([columns.indptr[:-1], end + np.arange(n - count + 1, dtype=columns.indptr.dtype)])
        by_rows = sp.csr_array(sp.csc_array((data, rows, starts), shape=(n, n)))
        upper = _Triangle(
            np.ascontiguousarray(data.size - starts[::-1], dtype=by_rows.indptr.dtype),
            np.ascontiguousarray(n - 1 - rows[::-1], dtype=by_rows.indices.dtype),
            np.ascontiguousarray(data[::-1]),
        )
        return cls(count, _Triangle(by_rows.indptr, by_rows.indices, by_rows.data), upper)

    def forward(self, x: Array) -> None:
        """``L^-1 x`` (n,) in place."""
        self.lower.sweep(x)

    def backward(self, x: Array) -> None:
        """``L'^-1 x`` (n,) in place."""
        turned = x[::-1].copy()
        self.upper.sweep(turned, x.size - self.count)
        x[:] = turned[::-1]


class PanelSweeps:
    """The same by the compiled kernels: L once, neighbouring columns with the same rows together.

    ``columns (n, count)``: the first columns of L, of each the rows in order, the one of the diagonal first; 32-bit
    indices. Raises ValueError: an array is not what it should be.
    """

    def __init__(self, kernels: Kernels, columns: sp.csc_array) -> None:
        self.kernels, (self.size, count) = kernels, columns.shape
        starts, rows, data = columns.indptr, columns.indices, columns.data
        for name, array, kind in (
            ("indptr", starts, np.int32),
            ("indices", rows, np.int32),
            ("data", data, np.float64),
        ):
            if array.dtype != kind or array.ndim != 1 or not array.flags.carray:
                raise ValueError(f"{name} of a triangle must be a contiguous array of {np.dtype(kind).name}")
        if starts.size != count + 1 or starts[0] != 0 or starts[-1] != rows.size or rows.size != data.size:
            raise ValueError("indptr of a triangle must rise from 0 to the number of its entries")
        if np.any(np.diff(starts) < 1) or not np.array_equal(rows[starts[:-1]], np.arange(count)):
            raise ValueError("every column of a triangle must begin with its diagonal")
        rising = np.diff(rows) > 0
        rising[starts[1:-1] - 1] = True
        if not rising.all() or rows.max(initial=-1) >= self.size:
            raise ValueError(f"rows of a triangle must rise in each column, up to {self.size - 1}")
        at = kernels.address
        self._pointer = kernels.made(kernels.call.hv_panels_new(count, at(starts), at(rows), at(data)))
        weakref.finalize(self, kernels.call.hv_panels_free, self._pointer)

    def __reduce__(self) -> str:
        raise TypeError("compiled factors belong to this process")

    def forward(self, x: Array) -> None:
        """``L^-1 x`` (n,) in place."""
        self.kernels.call.hv_panels_forward(self._pointer, self._place(x))

    def backward(self, x: Array) -> None:
        """``L'^-1 x`` (n,) in place."""
        self.kernels.call.hv_panels_backward(self._pointer, self._place(x))

    def _place(self, x: Array) -> int:
        if x.shape != (self.size,) or x.dtype != np.float64 or not x.flags.carray:
            raise ValueError(f"a contiguous vector of {self.size} numbers is needed, not {x.shape} of {x.dtype}")
        return self.kernels.address(x)


def sweeps_of(columns: sp.csc_array, count: int) -> RowSweeps | PanelSweeps:
    """Of the first ``count`` columns of L, (n, count)."""
    columns = sp.csc_array(sp.csr_array(columns))  # which sorts rows in half the time that sorting them takes
    compiled = compiled_kernels()
    narrow = columns.indptr.dtype == columns.indices.dtype == np.int32
    return RowSweeps.of(columns, count) if compiled is None or not narrow else PanelSweeps(compiled, columns)
