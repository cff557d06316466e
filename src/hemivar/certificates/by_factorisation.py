"""What an energy norm asks of its matrix K, by a factorisation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.linear.definite import indefinite, positive_pivots, rounding
from hemivar.linear.vectors import WHOLE, Vectors

__all__ = ["Factorised", "Mode", "start_vector"]

#: Relative accuracy asked of an eigenvalue; what is returned is raised by as much.
_EIGEN_TOLERANCE = 1e-8
#: Rows up to which an eigenproblem is solved as a dense one.
_DENSE = 24


@dataclass(frozen=True, eq=False)
class Mode:
    """An eigenvalue at the upper end of a pencil."""

    #: What the vector attains, so that the eigenvalue is no smaller; what it is at most, as far as the method knows.
    value: float
    bound: float
    #: (n,), of energy norm one; None where it is not kept.
    vector: Array | None = None


class Factorised:
    """A symmetric matrix K and its factors.

    K counts as definite if its pivots are positive and its smallest eigenvalue, scaled to a unit diagonal, is above
    what rounding makes of zero: a pivot alone may be a rounding error many times larger than that.  Where that is not
    shown, nothing else may be asked for but :meth:`multiply` and :attr:`indefinite`.  ``singular`` says that K is
    known to be singular, by the motions without deformation of its mesh.
    """

    factorised: ClassVar[bool] = True
    vectors: ClassVar[Vectors] = WHOLE

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

    def multiply(self, v: Array) -> Array:
        """``K v``."""
        return np.asarray(self.stiffness @ v)

    def dual(self, b: Array, guess: Array | None = None) -> tuple[Array, float]:
        """``K^-1 b`` (n,) and ``b'K^-1 b``; no guess is needed."""
        x = self.solve(b)
        return x, float(b @ x)

    def least(self, b: Array) -> float:
        """``b'K^-1 b``."""
        return self.dual(b)[1]

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

    def top(self, part: sp.csr_array, near: float | None = None) -> Mode:
        """The largest eigenvalue of ``(S'S, K)``, ``S`` (k, n); a solve with K for each step of a Lanczos iteration."""
        count = part.shape[0]
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


def start_vector(n: int) -> Array:
    """A starting vector with every component present and most of it smooth."""
    return 1.0 + 0.3 * np.random.default_rng(11).standard_normal(n)
