"""Sparse linear algebra of the certificates: the energy norm, its dual, and largest eigenvalues on the contact."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar._typing import Array, BoolArray

__all__ = ["EnergyNorm", "gram_solve", "largest_eigenvalue", "lift", "symmetric_inverse"]

#: A pivot this small against the diagonal entry of its row means that the matrix is singular.
_SINGULAR = 1e-13
#: Relative accuracy asked of an eigenvalue; what is returned is raised by as much.
_EIGEN_TOLERANCE = 1e-8
_DENSE = 24


class EnergyNorm:
    """A symmetric positive definite matrix K, factorised: ``|v|_K``, ``K^-1 b`` and ``|b|_{K^-1}``.

    Parameters
    ----------
    stiffness : sparse array (n, n)
        K; if it is singular (a body that nothing but contact holds), :attr:`definite` is False and nothing else
        may be asked for but :meth:`norm`.
    """

    def __init__(self, stiffness: sp.csr_array) -> None:
        self.stiffness = stiffness
        self._diagonal = stiffness.diagonal()
        self._factor: spla.SuperLU | None = None
        if stiffness.shape[0] == 0:
            return
        try:
            factor = spla.splu(
                sp.csc_array(stiffness),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True, "Equil": False},
            )
        except RuntimeError:
            return
        order = np.argsort(factor.perm_c)
        if np.all(factor.U.diagonal() > _SINGULAR * self._diagonal[order]):
            self._factor = factor

    @property
    def definite(self) -> bool:
        """Whether K is positive definite."""
        return self._factor is not None

    def solve(self, rhs: Array) -> Array:
        """``K^-1 rhs`` for one (n,) or several (n, k) right-hand sides."""
        assert self._factor is not None
        return np.asarray(self._factor.solve(np.asarray(rhs, dtype=float)))

    def norm(self, v: Array) -> float:
        """``|v|_K = sqrt(v'K v)``."""
        return float(np.sqrt(max(float(v @ (self.stiffness @ v)), 0.0)))

    def dual_norm(self, b: Array) -> float:
        """``|b|_{K^-1} = sqrt(b'K^-1 b)``."""
        return float(np.sqrt(max(float(b @ self.solve(b)), 0.0)))

    def rounding_norm(self, size: Array) -> float:
        """Bound of ``|b|_{K^-1}`` over all b with ``|b_i| <= size_i``."""
        scaled = size / np.sqrt(self._diagonal)
        return float(np.linalg.norm(scaled) / np.sqrt(self.lowest))

    @cached_property
    def lowest(self) -> float:
        """A lower bound of the smallest eigenvalue of K scaled to a unit diagonal."""
        root = np.sqrt(self._diagonal)
        n = root.size
        if n <= _DENSE:
            scaled = self.stiffness.toarray() / np.outer(root, root)
            return float(np.linalg.eigvalsh(scaled)[0])
        inverse = spla.LinearOperator((n, n), matvec=lambda x: root * self.solve(root * x.ravel()), dtype=float)
        top = spla.eigsh(inverse, k=1, tol=0.05, v0=_start(n), ncv=8, return_eigenvectors=False)
        return float(0.9 / top[0])


def _start(n: int) -> Array:
    """A starting vector with every component present and most of it smooth."""
    return 1.0 + 0.3 * np.random.default_rng(11).standard_normal(n)


def largest_eigenvalue(trace: sp.csr_array, weight: Array, energy: EnergyNorm) -> float:
    """Largest eigenvalue of ``(B' diag(weight) B, K)``, an upper bound up to the accuracy of the eigensolver.

    Works on the rows of B that count: one solve with K for each step of a Lanczos iteration.

    Parameters
    ----------
    trace : sparse array (k, n)
        B.
    weight : array (k,)
        Weights >= 0; rows of weight zero are dropped.
    energy : EnergyNorm
        K, which must be positive definite.
    """
    rows = np.flatnonzero((weight > 0.0) & (np.diff(trace.indptr) > 0))
    if rows.size == 0:
        return 0.0
    part = sp.csr_array(sp.diags_array(np.sqrt(weight[rows])) @ trace[rows])
    if rows.size <= _DENSE:
        columns = part.T.toarray()
        flexibility = part @ energy.solve(columns)
        return float(np.linalg.eigvalsh(0.5 * (flexibility + flexibility.T))[-1] * (1.0 + 1e-12))
    operator = spla.LinearOperator(
        (rows.size, rows.size), matvec=lambda x: part @ energy.solve(part.T @ x.ravel()), dtype=float
    )
    top = spla.eigsh(
        operator, k=1, which="LA", tol=_EIGEN_TOLERANCE, v0=_start(rows.size), ncv=12, return_eigenvectors=False
    )
    return float(top[0] * (1.0 + _EIGEN_TOLERANCE))


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
