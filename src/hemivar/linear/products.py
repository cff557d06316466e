"""Products of small sparse matrices, of which SciPy's inquiries take longer than the sums."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array

try:  # what ``@`` ends in
    from scipy.sparse._sparsetools import csr_matvec
except ImportError:  # SciPy has moved it
    csr_matvec = None

__all__ = ["product"]


def product(A: sp.csr_array, x: Array) -> Array:
    """``A @ x`` of a matrix of floats by rows, to the last bit.

    Parameters
    ----------
    A : sparse array (n, k)
    x : array (k,)
    """
    rows, columns = A.shape
    data = A.data
    plain = x.dtype == data.dtype == np.float64 and x.shape == (columns,) and x.flags.c_contiguous
    if csr_matvec is None or not plain:
        return np.asarray(A @ x)
    out = np.zeros(rows)
    csr_matvec(rows, columns, A.indptr, A.indices, data, x, out)
    return out
