"""Eigenvalues at the upper end of a pencil: locally optimal conjugate gradients in a small subspace."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.deadline import check_time
from hemivar.basics.types import Array, IntArray

__all__ = ["Mode", "Subspace", "counting_rows", "start_vector"]

#: Part of the distance between an eigenvalue and the value that it is compared with.
_APART = 0.1


@dataclass(frozen=True, eq=False)
class Mode:
    """An eigenvalue at the upper end of a pencil.

    Attributes
    ----------
    value : float
        What the vector attains, so that the eigenvalue is no smaller.
    bound : float
        What it is at most, up to the accuracy of the method.
    vector : array (n,) or None
        Of energy norm one; None where it is not kept.
    """

    value: float
    bound: float
    vector: Array | None = None


class Subspace:
    """Vectors near the upper end of ``(S' diag(sign) S, K)``, and the best in the space that they span.

    Parameters
    ----------
    A : sparse array (n, n)
        K, on one level.
    cycles : function
        ``C R`` for the columns of R (n, k); C is near to the inverse of K.
    S : sparse array (q, n)
    sign : array (q,)
    X : array (n, k)
        The vectors to start from.
    count : int
        How many are kept.
    held : int array, optional
        Unknowns at rest.
    """

    def __init__(
        self,
        A: sp.csr_array,
        cycles: Callable[[Array], Array],
        S: sp.csr_array,
        sign: Array,
        X: Array,
        count: int = 1,
        held: IntArray | None = None,
    ) -> None:
        self._A, self._cycles, self._S, self._sign, self._held = A, cycles, S, sign, held
        #: A vector of the span along which K is not positive, where one was met.
        self.negative: Array | None = None
        self._pick(X, self._A @ X, S @ X, count)

    def _pick(self, X: Array, KX: Array, SX: Array, count: int) -> Array:
        """Rayleigh-Ritz: the best vectors in the span, and their coefficients."""
        gram = X.T @ KX
        scale = 1.0 / np.sqrt(np.maximum(np.diagonal(gram), np.finfo(float).tiny))
        sizes, axes = np.linalg.eigh(scale[:, None] * gram * scale)
        kept = sizes > 1e-12 * sizes[-1]
        if sizes[0] < -1e-12 * sizes[-1]:
            self.negative = X @ (scale * axes[:, 0])
        root = scale[:, None] * axes[:, kept] / np.sqrt(sizes[kept])
        image = SX @ root
        values, vectors = np.linalg.eigh(image.T @ (self._sign[:, None] * image))
        mix = root @ vectors[:, ::-1][:, :count]
        self.values = values[::-1][:count]
        self.X, self._KX, self._SX = X @ mix, KX @ mix, SX @ mix
        return np.asarray(mix)

    def gap(self, known: float) -> float:
        """Half the distance between the first two values; what is known of it where there is one vector only."""
        return 0.5 * float(self.values[0] - self.values[1]) if self.values.size > 1 else known

    def improve(
        self,
        quality: float,
        limit: int,
        accuracy: float,
        gap: float = np.inf,
        near: float | None = None,
        floor: float = 0.0,
    ) -> float:
        """Steps of locally optimal conjugate gradients (Knyazev 2001); what the largest value may be short of.

        ``|g|_{K^-1}``, g the residual of the first vector, bounds its distance to an eigenvalue, and the square of it
        over the gap to the next one as well (Kato, Temple).  ``quality`` is the smallest eigenvalue of C K.
        """
        P = KP = SP = None
        for step in range(limit + 1):
            check_time()
            R = self._S.T @ (self._sign[:, None] * self._SX) - self._KX * self.values
            if self._held is not None:
                R[self._held] = 0.0
            Z = self._cycles(R)
            gap = self.gap(gap)
            top = float(self.values[0])
            off = np.sqrt(max(float(R[:, 0] @ Z[:, 0]), 0.0) / quality)
            added = float(off**2 / gap if off < gap < np.inf else off)
            fine = added <= accuracy * max(abs(top), floor)
            if near is not None and top < near:
                fine = fine and added <= _APART * (near - top)
            if fine or step == limit:
                break
            KZ, SZ = self._A @ Z, self._S @ Z
            X, KX, SX, count = self.X, self._KX, self._SX, self.X.shape[1]
            if P is None or KP is None or SP is None:
                mix = self._pick(np.hstack([X, Z]), np.hstack([KX, KZ]), np.hstack([SX, SZ]), count)
            else:
                mix = self._pick(np.hstack([X, Z, P]), np.hstack([KX, KZ, KP]), np.hstack([SX, SZ, SP]), count)
            old = mix[:count]
            P, KP, SP = self.X - X @ old, self._KX - KX @ old, self._SX - SX @ old
        return added


def counting_rows(trace: sp.csr_array, weight: Array) -> sp.csr_array:
    """Rows of B that count, times the roots of their weights."""
    rows = np.flatnonzero((weight > 0.0) & (np.diff(trace.indptr) > 0))
    return sp.csr_array(sp.diags_array(np.sqrt(weight[rows])) @ trace[rows])


def start_vector(n: int) -> Array:
    """A starting vector with every component present and most of it smooth."""
    return 1.0 + 0.3 * np.random.default_rng(11).standard_normal(n)
