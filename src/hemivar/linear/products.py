"""Products and diagonals of sparse matrices, where those of SciPy take longer than they need to."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array
from hemivar.kernels import kernels

try:  # what ``@`` ends in
    from scipy.sparse._sparsetools import csr_matvec
except ImportError:  # SciPy has moved it
    csr_matvec = None

__all__ = ["diagonal", "product"]


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
