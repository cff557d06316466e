"""Conjugate gradients for the linear problems of a nonsmooth method: they may stop early, and may be indefinite."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array

__all__ = ["Descent", "conjugate_gradients"]

_FLAT = 1e-12


@dataclass(frozen=True, eq=False)
class Descent:
    """What conjugate gradients found for ``A x = b``.

    Attributes
    ----------
    solution : array (n,)
        The iterate; it lowers ``x'A x / 2 - b'x`` below zero.
    residual : array (n,)
        ``b - A x``, as the recursion has it.
    iterations : int
        Products with A.
    negative : array (n,) or None
        A direction p with ``p'A p <= 0`` (up to rounding: 1e-12 of that of the diagonal of A) and ``b'p >= 0`` where
        one was met; the iteration ends there.
    """

    solution: Array
    residual: Array
    iterations: int
    negative: Array | None = None


def conjugate_gradients(
    A: sp.csr_array,
    diagonal: Array,
    b: Array,
    precondition: Callable[[Array], Array],
    tolerance: float,
    limit: int,
    stop: Callable[[int, Array, Array], bool] | None = None,
) -> Descent:
    """Preconditioned conjugate gradients from zero (Hestenes-Stiefel; early ending as in Steihaug 1983).

    Parameters
    ----------
    A : sparse array (n, n)
        Symmetric on the vectors that occur.
    diagonal : array (n,)
        Its diagonal, positive; what curvature is compared with.
    b : array (n,)
    precondition : function
        A symmetric positive definite map of residuals (n,).
    tolerance : float
        Ends once the 2-norm of the residual is no larger.
    limit : int
        Most products with A.
    stop : function, optional
        Called with the iteration, the iterate and its residual after every step; True ends.
    """
    x = np.zeros_like(b)
    r = b.copy()
    p: Array | None = None
    rz = 1.0
    for iteration in range(1, limit + 1):
        z = precondition(r)
        now = float(r @ z)
        if not now > 0.0:
            return Descent(x, r, iteration - 1)
        if p is None:
            p = z
        else:
            p *= now / rz
            p += z
        rz = now
        q = A @ p
        curvature = float(p @ q)
        if curvature <= _FLAT * float(np.vdot(p, diagonal * p)):
            return Descent(x, r, iteration, p if float(b @ p) >= 0.0 else -p)
        length = rz / curvature
        x += length * p
        r -= length * q
        if float(np.linalg.norm(r)) <= tolerance or (stop is not None and stop(iteration, x, r)):
            return Descent(x, r, iteration)
    return Descent(x, r, limit)
