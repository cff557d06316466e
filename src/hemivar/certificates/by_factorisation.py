"""The energy norm, its dual and largest eigenvalues on the contact, by a factorisation of K."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.certificates.subspace import Mode, counting_rows, start_vector
from hemivar.linear.definite import indefinite, positive_pivots, rounding

__all__ = ["EnergyNorm"]

#: Relative accuracy asked of an eigenvalue; what is returned is raised by as much.
_EIGEN_TOLERANCE = 1e-8
#: Rows up to which an eigenproblem is solved as a dense one.
_DENSE = 24


class EnergyNorm:
    """A symmetric positive definite matrix K, factorised: ``|v|_K``, ``K^-1 b`` and ``|b|_{K^-1}``.

    K counts as definite if its pivots are positive and its smallest eigenvalue, scaled to a unit diagonal, is above
    what rounding makes of zero: a pivot alone may be a rounding error many times larger than that.

    Parameters
    ----------
    stiffness : sparse array (n, n)
        K; if it is not shown to be definite (a body that nothing but contact holds), :attr:`definite` is False and
        nothing else may be asked for but :meth:`norm` and :attr:`indefinite`.
    singular : bool
        Whether K is known to be singular, by the motions without deformation of its mesh.

    Attributes
    ----------
    diagonal : array (n,)
        Of K.
    """

    factorised: ClassVar[bool] = True

    def __init__(self, stiffness: sp.csr_array, singular: bool = False) -> None:
        self.stiffness = stiffness
        self.diagonal = stiffness.diagonal()
        self._singular = singular
        self._factor: spla.SuperLU | None = None
        if stiffness.shape[0] == 0 or singular:
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
        if not positive_pivots(factor):
            return
        self._factor = factor
        if not self.lowest > rounding(stiffness, self.diagonal):
            self._factor = None

    @property
    def definite(self) -> bool:
        """Whether K has been shown to be positive definite."""
        return self._factor is not None

    @cached_property
    def indefinite(self) -> float | None:
        """An eigenvalue of K, scaled to a unit diagonal, below zero by more than rounding; None if there is none."""
        return None if self.definite or self._singular else indefinite(self.stiffness)

    def solve(self, rhs: Array) -> Array:
        """``K^-1 rhs`` for one (n,) or several (n, k) right-hand sides."""
        assert self._factor is not None
        check_time()
        return np.asarray(self._factor.solve(np.asarray(rhs, dtype=float)))

    def norm(self, v: Array) -> float:
        """``|v|_K = sqrt(v'K v)``."""
        return float(np.sqrt(max(float(v @ (self.stiffness @ v)), 0.0)))

    def riesz(self, b: Array, guess: Array | None = None) -> tuple[Array, float]:
        """``K^-1 b`` (n,) and ``|b|_{K^-1} = sqrt(b'K^-1 b)``; no guess is needed."""
        x = self.solve(b)
        return x, float(np.sqrt(max(float(b @ x), 0.0)))

    def least_dual_norm(self, b: Array) -> float:
        """``|b|_{K^-1}``."""
        return self.riesz(b)[1]

    def rounding_norm(self, weighted: float) -> float:
        """Bound of ``|b|_{K^-1}`` over all b with ``|D^-1/2 b|_2 <= weighted``, D the diagonal of K."""
        return float(weighted / np.sqrt(self.lowest))

    @cached_property
    def lowest(self) -> float:
        """A lower bound of the smallest eigenvalue of K scaled to a unit diagonal."""
        root = np.sqrt(self.diagonal)
        n = root.size
        if n <= _DENSE:
            scaled = self.stiffness.toarray() / np.outer(root, root)
            return float(np.linalg.eigvalsh(scaled)[0])
        inverse = spla.LinearOperator((n, n), matvec=lambda x: root * self.solve(root * x.ravel()), dtype=float)
        top = spla.eigsh(inverse, k=1, tol=0.05, v0=start_vector(n), ncv=8, return_eigenvectors=False)
        return float(0.9 / top[0])

    def largest_eigenvalue(self, trace: sp.csr_array, weight: Array, near: float | None = None) -> Mode:
        """Largest eigenvalue of ``(B' diag(weight) B, K)``, its bound raised by the tolerance of the eigensolver.

        Works on the rows of B that count: one solve with K for each step of a Lanczos iteration.

        Parameters
        ----------
        trace : sparse array (k, n)
            B.
        weight : array (k,)
            Weights >= 0; rows of weight zero are dropped.
        near : float, optional
            Of no use here.
        """
        part = counting_rows(trace, weight)
        count = part.shape[0]
        if count == 0:
            return Mode(0.0, 0.0)
        if count <= _DENSE:
            flexibility = part @ self.solve(part.T.toarray())
            top = float(np.linalg.eigvalsh(0.5 * (flexibility + flexibility.T))[-1])
            return Mode(top, top * (1.0 + 1e-12))
        operator = spla.LinearOperator(
            (count, count), matvec=lambda x: part @ self.solve(part.T @ x.ravel()), dtype=float
        )
        top = spla.eigsh(
            operator, k=1, which="LA", tol=_EIGEN_TOLERANCE, v0=start_vector(count), ncv=12, return_eigenvectors=False
        )[0]
        return Mode(float(top), float(top * (1.0 + _EIGEN_TOLERANCE)))
