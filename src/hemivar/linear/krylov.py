"""Conjugate gradients for the linear problems of a nonsmooth method: they may stop early, and may be indefinite."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hemivar.basics.types import Array
from hemivar.linear.vectors import WHOLE, Vectors

__all__ = ["Descent", "Matrix", "conjugate_gradients"]

_FLAT = 1e-12
#: By how much a residual is larger than what is enough, if the next one is still larger.
_FAR = 8.0


class Matrix(Protocol):
    """A sparse array, or anything else that vectors can be multiplied with."""

    def __matmul__(self, vector: Array, /) -> Array: ...


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
    A: Matrix,
    diagonal: Array,
    b: Array,
    precondition: Callable[[Array], Array],
    tolerance: float,
    limit: int,
    enough: Callable[[int, Array], Array] | None = None,
    vectors: Vectors = WHOLE,
    sparing: bool = False,
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
    enough : function, optional
        Called with the iteration and the iterate after a step; ends once the residual is smaller than the array it
        returns, in the 2-norm.
    vectors : Vectors
        How the parts of a vector are summed.
    sparing : bool
        Where the residual was larger by far than what is enough, that is not asked after the next step.
    """
    x = np.zeros_like(b)
    r = b.copy()
    p: Array | None = None
    rz, far = 1.0, False
    for iteration in range(1, limit + 1):
        z = precondition(r)
        now = float(vectors.total(float(r @ z))[0])
        if not now > 0.0:
            return Descent(x, r, iteration - 1)
        if p is None:
            p = z
        else:
            p *= now / rz
            p += z
        rz = now
        q = A @ p
        curvature, stiff = vectors.total(float(p @ q), float(np.vdot(p, diagonal * p))).tolist()
        if curvature <= _FLAT * stiff:
            return Descent(x, r, iteration, p if vectors.total(float(b @ p))[0] >= 0.0 else -p)
        length = rz / curvature
        x += length * p
        r -= length * q
        square = float(r @ r)
        if vectors.alone and math.sqrt(square) <= tolerance:  # else it is summed with what is enough, by all at once
            return Descent(x, r, iteration)
        off = np.zeros(0) if enough is None or far else enough(iteration, x)
        rest, wanted = np.sqrt(vectors.total(square, float(off @ off))).tolist()
        if rest <= tolerance or rest < wanted:
            return Descent(x, r, iteration)
        far = sparing and not far and iteration > 1 and rest > _FAR * wanted
    return Descent(x, r, limit)
