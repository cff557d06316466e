"""Sparse matrix-vector products and diagonals, where those of SciPy take longer than they need to."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import CACHED
from hemivar.basics.types import Array
from hemivar.kernels import kernels

try:  # what ``@`` ends in
    from scipy.sparse._sparsetools import csr_matvec
except ImportError:  # SciPy has moved it
    csr_matvec = None

__all__ = ["diagonal", "portions", "product"]

#: Rows of a portion: with 64 entries each, as many as a body in space has, they are cached.
_ROWS = CACHED // 64


def diagonal(A: sp.csr_array) -> Array:
    """``A.diagonal()`` of a square matrix by rows, which looks for one entry in each row and does not read them all."""
    compiled = kernels()
    narrow = A.indptr.dtype == A.indices.dtype == np.int32 and A.data.dtype == np.float64
    if compiled is None or not narrow or not A.has_canonical_format:
        return np.asarray(A.diagonal())
    return compiled.diagonal(A.indptr, A.indices, A.data)


def product(A: sp.csr_array, x: Array) -> Array:
    """``A @ x`` of a matrix of floats by rows, to the last bit.

    ``A (n, k)``; ``x (k,)``.
    """
    rows, columns = A.shape
    data = A.data
    plain = x.dtype == data.dtype == np.float64 and x.shape == (columns,) and x.flags.c_contiguous
    if csr_matvec is None or not plain:
        return np.asarray(A @ x)
    out = np.zeros(rows)
    csr_matvec(rows, columns, A.indptr, A.indices, data, x, out)
    return out


def portions(A: sp.csr_array, change: Callable[[Array], Array]) -> Iterator[tuple[slice, sp.csr_array]]:
    """Some rows of a matrix after the other, with other entries: a copy of all takes longer than what is done with it.

    Which rows, and their part of the matrix with the entries that ``change`` makes of (k,).
    """
    for start in range(0, A.shape[0], _ROWS):
        first = A.indptr[start : start + _ROWS + 1]
        entries = slice(first[0], first[-1])
        parts = (change(A.data[entries]), A.indices[entries], first - first[0])
        yield slice(start, start + _ROWS), sp.csr_array(parts, shape=(first.size - 1, A.shape[1]))
