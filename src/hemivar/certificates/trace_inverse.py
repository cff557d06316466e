"""The pseudo-inverse of the trace: displacements with a given trace, and small symmetric systems."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array, BoolArray

__all__ = ["gram_solve", "lift", "symmetric_inverse"]


def gram_solve(trace: sp.csr_array, rhs: Array, active: BoolArray) -> Array | None:
    """``(B B')^-1 rhs`` on the active rows, 0 elsewhere, (k,); None if rows of the trace depend on one another."""
    out = np.zeros(trace.shape[0])
    if not np.any(rhs[active]):
        return out
    part = sp.csr_array(trace[np.flatnonzero(active)])
    gram = sp.csc_array(part @ part.T)
    diagonal = gram.diagonal()
    off = gram - sp.diags_array(diagonal)
    if np.abs(off.data).max(initial=0.0) == 0.0:
        out[active] = rhs[active] / diagonal
        return out
    try:
        solution = spla.splu(gram).solve(rhs[active])
    except RuntimeError:
        return None
    miss = np.abs(gram @ solution - rhs[active]).max()
    if not miss <= 1e-8 * np.abs(rhs[active]).max():
        return None
    out[active] = solution
    return out


def lift(trace: sp.csr_array, change: Array, active: BoolArray) -> Array | None:
    """Displacements ``v = B'(B B')^-1 change`` whose trace changes by ``change`` on the active rows."""
    inner = gram_solve(trace, change, active)
    return None if inner is None else np.asarray(trace.T @ inner)


def symmetric_inverse(matrix: Array) -> Array | None:
    """Inverse of a small symmetric positive definite matrix, None if it is not one."""
    try:
        factor = la.cho_factor(0.5 * (matrix + matrix.T))
    except la.LinAlgError:
        return None
    inverse = la.cho_solve(factor, np.eye(len(matrix)))
    return np.asarray(0.5 * (inverse + inverse.T))
