"""The equation of a path on the graphs of all contact laws: one row for each number along them."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
import scipy.linalg as la

from hemivar.basics.arrays import COUNTS
from hemivar.basics.types import AnyArray, Array, BoolArray
from hemivar.systems.condensed import CondensedProblem

__all__ = ["ROUNDING", "Curves", "negative_eigenvalues"]

#: Relative rounding that a zero of F may carry.
ROUNDING = 64.0 * float(np.finfo(float).eps)


class Curves(ABC):
    """Pairs ``r(theta), lambda(theta)`` on the graphs of the laws, and ``F(theta, t) = A r + W lambda - g(t)``.

    A place on the graphs is ``theta (n,)`` with ``segment``, which tells the pieces where theta is at the end of one.
    """

    system: CondensedProblem

    @property
    @abstractmethod
    def size(self) -> int:
        """Number n of components of theta."""

    @property
    @abstractmethod
    def length(self) -> float:
        """A typical displacement."""

    @property
    @abstractmethod
    def weights(self) -> Array:
        """Weight of each part that may let go alone, as in :meth:`falls_beside`."""

    @abstractmethod
    def load_of(self, system: CondensedProblem) -> Array:
        """g of the body under some load, (n,)."""

    @abstractmethod
    def balance(self, theta: Array, segment: AnyArray, force: Array) -> tuple[Array, Array]:
        """F and dF/dtheta."""

    @abstractmethod
    def out_of_balance(self, theta: Array, segment: AnyArray, force: Array) -> Array:
        """F alone."""

    def moving(self, theta: Array, segment: AnyArray) -> BoolArray:
        """Components (n,) that move the body: the columns of dF/dtheta of all others are zero but on the diagonal."""
        return np.ones(self.size, dtype=bool)

    @abstractmethod
    def forces(self, theta: Array, segment: AnyArray, force: Array) -> Array:
        """Sum of the sizes of all forces on each component, (n,): F is their difference."""

    @abstractmethod
    def inside(self, theta: Array, segment: AnyArray, tolerance: float) -> BoolArray:
        """Whether each theta lies on its segment."""

    @abstractmethod
    def between(self, segment: AnyArray) -> AnyArray:
        """What tells the pieces of places on the way from one with this segment to the next."""

    @abstractmethod
    def nearest(self, r: Array, lam: Array) -> tuple[Array, AnyArray]:
        """The place nearest to ``(r, lam)``, both (m, d)."""

    @abstractmethod
    def local(self, theta: Array, segment: AnyArray) -> tuple[Array, Array]:
        """Local displacement and multiplier (m, d) of all components."""

    def every_local(self, theta: list[Array], segments: list[AnyArray]) -> tuple[Array, Array]:
        """That of several places, (k, m, d) each."""
        pairs = [self.local(*pair) for pair in zip(theta, segments, strict=True)]
        return np.array([r for r, _ in pairs]), np.array([lam for _, lam in pairs])

    @abstractmethod
    def negative(self, theta: Array, segment: AnyArray) -> int:
        """Number of directions in which the energy falls (to second order)."""

    @abstractmethod
    def falls_beside(self, theta: Array, segment: AnyArray) -> Array:
        """By how much the law of each part falls, over the stiffness of the body with all others held."""

    def rounds(self, F: Array, theta: Array, segment: AnyArray, force: Array) -> bool:
        """Whether rounding explains all of F, as it is left by a solver: measured by the largest force."""
        largest = self.forces(theta, segment, force).max(initial=0.0)
        return bool(np.abs(F).max(initial=0.0) <= ROUNDING * largest)

    def correct(self, theta: Array, segment: AnyArray, force: Array) -> Array | None:
        """Newton's method for F = 0 with the segments given; None where it fails.

        Where steps do not become smaller than rounding forces must: slender bodies beside gaps are known no better.
        """
        for _ in range(30):
            F, J = self.balance(theta, segment, force)
            try:
                step = np.linalg.solve(J, -F)
            except np.linalg.LinAlgError:
                return None
            exact = self.rounds(F, theta, segment, force)
            theta = theta + step
            if not np.isfinite(theta).all():
                return None
            size = np.abs(step).max(initial=0.0) / max(float(np.abs(theta).max(initial=0.0)), self.length)
            if size <= (COUNTS if exact else 1e-14):
                return theta
        F, _ = self.balance(theta, segment, force)
        return theta if self.rounds(F, theta, segment, force) else None


def negative_eigenvalues(matrix: Array) -> int:
    """Number of negative eigenvalues of a symmetric matrix, at least 1 where it is not positive definite."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        _, pivots, _ = la.ldl(matrix)
        return max(_negative_pivots(pivots), 1)
    return 0


def _negative_pivots(pivots: Array) -> int:
    """Of a block diagonal matrix: by Sylvester's law as many as the matrix has negative eigenvalues."""
    diagonal, beside = np.diagonal(pivots), np.diagonal(pivots, -1)
    pairs = np.flatnonzero(beside)  # blocks of two have one eigenvalue of either sign
    single = np.ones(diagonal.size, dtype=bool)
    single[pairs], single[pairs + 1] = False, False
    return int((diagonal[single] < 0.0).sum()) + pairs.size
