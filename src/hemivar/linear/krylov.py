"""Krylov methods of a nonsmooth iteration: conjugate gradients (CG) that may stop early, and minimal residuals (GMRES).

Conjugate gradients may meet indefinite matrices; minimal residuals are for matrices that are not symmetric.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array
from hemivar.kernels import kernels
from hemivar.linear.vectors import WHOLE, Vectors

__all__ = ["Descent", "Matrix", "conjugate_gradients", "minimal_residuals"]

#: Entries from which compiled sums are worth their call.
_LONG = 4096
#: By how much a residual is larger than what is enough, if the next one is still larger; how often that may be trusted.
_FAR, _TRUSTED = 8.0, 3


class Matrix(Protocol):
    """A sparse array, or anything else that vectors can be multiplied with."""

    def __matmul__(self, vector: Array, /) -> Array: ...


@dataclass(frozen=True, eq=False)
class Descent:
    """What conjugate gradients found for ``A x = b``."""

    solution: Array  # (n,): the iterate; it lowers ``x'A x / 2 - b'x`` below zero
    residual: Array  # (n,): ``b - A x``, as the recursion has it
    iterations: int  # products with A
    # (n,): a direction p with ``p'A p <= 0`` (up to rounding: 1e-12 of that of the diagonal of A) and ``b'p >= 0``
    # where one was met; the iteration ends there
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
    flexible: bool = False,
) -> Descent:
    """Preconditioned conjugate gradients from zero (Hestenes-Stiefel; early ending as in Steihaug 1983).

    ``A (n, n)``: symmetric on the vectors that occur; ``diagonal (n,)``: its diagonal, positive; what curvature is
    compared with; ``b (n,)``; ``precondition``: a symmetric positive definite map of residuals (n,); ``tolerance``:
    ends once the 2-norm of the residual is no larger; ``limit``: most products with A; ``enough``: called with the
    iteration and the iterate after a step; ends once the residual is smaller than the array it returns, in the 2-norm;
    ``vectors``: how the parts of a vector are summed; ``sparing``: where the residual was larger by far than what is
    enough, that is not asked after the next steps; ``flexible``: the preconditioner may change a little from one step
    to the next (Notay 2000).
    """
    compiled = kernels() if vectors.alone and b.size >= _LONG else None
    x = np.zeros_like(b)
    r = b.copy()
    p: Array | None = None
    q = np.zeros(0)
    rz, length, far = 1.0, 0.0, 0
    for iteration in range(1, limit + 1):
        z = precondition(r)
        if compiled is None:
            now = float(vectors.total(float(r @ z))[0])
            crossed = float(vectors.total(float(z @ q))[0]) if flexible and p is not None else 0.0
        else:
            now, crossed = compiled.products(z, r, r if p is None else q)
        if not now > 0.0:
            return Descent(x, r, iteration - 1)
        factor = -length * crossed / rz if flexible else now / rz
        if p is None:
            p = np.array(z)
        elif compiled is None:
            p *= factor
            p += z
        else:
            compiled.turn(factor, z, p)
        rz = now
        q = A @ p
        if compiled is None:
            curvature, stiff = vectors.total(float(p @ q), float(np.vdot(p, diagonal * p))).tolist()
        else:
            curvature, stiff = compiled.curvature(p, q, diagonal)
        if curvature <= ROUNDED * stiff:
            return Descent(x, r, iteration, p if vectors.total(float(b @ p))[0] >= 0.0 else -p)
        length = rz / curvature
        if compiled is None:
            x += length * p
            r -= length * q
            square = float(r @ r)
        else:
            square = compiled.advance(length, p, q, x, r)
        if vectors.alone and math.sqrt(square) <= tolerance:  # else it is summed with what is enough, by all at once
            return Descent(x, r, iteration)
        asked = None if far else enough
        off = np.zeros(0) if asked is None else asked(iteration, x)
        rest, wanted = np.sqrt(vectors.total(square, float(off @ off))).tolist()
        if rest <= tolerance or rest < wanted:
            return Descent(x, r, iteration)
        far -= far > 0
        if asked is not None and sparing and iteration > 1:
            while far < _TRUSTED and rest > wanted * _FAR ** (far + 1):
                far += 1
    return Descent(x, r, limit)


def minimal_residuals(
    A: Callable[[Array], Array],
    b: Array,
    precondition: Callable[[Array], Array],
    tolerance: float,
    limit: int,
    due: Callable[[], float] | None = None,
    vectors: Vectors = WHOLE,
) -> tuple[Array, int]:
    """``A^-1 b`` by generalised minimal residuals from zero, preconditioned on the right (Saad and Schultz 1986).

    ``A``: times a vector (n,); it need not be symmetric; ``b (n,)``; ``precondition``: a linear map of vectors (n,);
    ``tolerance``: ends once the 2-norm of the residual is no larger; ``limit``: most products with A; memory for twice
    as many vectors is taken; ``due``: ends where it is not zero; ``vectors``: how the parts of a vector are summed.
    Returns the solution (n,).
    """
    size = float(vectors.norms(b)[0])
    x, R, rest = np.zeros_like(b), np.zeros((limit, limit)), [size]
    if not size > tolerance:
        return x, 0
    basis, images, turns, largest = np.empty((8, b.size)), list[Array](), list[tuple[float, float]](), 0.0
    np.divide(b, size, out=basis[0])
    for k in range(limit):
        images.append(precondition(basis[k]))
        w = A(images[k])
        column = np.zeros(k + 1)
        for _ in range(2):  # once more for what rounding leaves
            parts = vectors.total(*(basis[: k + 1] @ w).tolist())
            w = w - parts @ basis[: k + 1]
            column += parts
        below = float(vectors.norms(w)[0])
        largest = max(largest, below, float(np.abs(column).max()))
        turned = _turned(column.tolist(), turns)
        turns.append(_turn(turned[k], below))
        R[: k + 1, k] = *turned[:k], math.hypot(turned[k], below)
        rest[k:] = turns[k][0] * rest[k], -turns[k][1] * rest[k]
        late = 0.0 if due is None else float(vectors.largest(due())[0])
        if abs(rest[k + 1]) <= tolerance or late or not below > ROUNDED * largest:
            break
        if k + 1 == len(basis):
            basis = np.concatenate([basis, np.empty_like(basis)])
        np.divide(w, below, out=basis[k + 1])
    count = len(images)
    y = np.linalg.lstsq(R[:count, :count], np.array(rest[:count]), rcond=None)[0]
    for part, image in zip(y.tolist(), images, strict=True):
        x += part * image
    return x, len(images)


def _turn(first: float, second: float) -> tuple[float, float]:
    """Cosine and sine of the rotation that takes (first, second) to (length, 0)."""
    length = math.hypot(first, second)
    return (first / length, second / length) if length > 0.0 else (1.0, 0.0)


def _turned(column: list[float], turns: list[tuple[float, float]]) -> list[float]:
    """A column after the rotations of each two of its entries that follow one another."""
    for k, (cosine, sine) in enumerate(turns):
        first, second = column[k], column[k + 1]
        column[k], column[k + 1] = cosine * first + sine * second, cosine * second - sine * first
    return column
