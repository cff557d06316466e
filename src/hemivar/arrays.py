"""The one check of arrays that users give, and the one norm."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hemivar._typing import Array
from hemivar.errors import ProblemError

__all__ = ["norm", "real_array"]


def real_array(value: ArrayLike, name: str, ndim: int | None = None, *, finite: bool = True) -> Array:
    """An array of floats made of what a user gave.

    Parameters
    ----------
    value : array_like
    name : str
        What the array is, for messages.
    ndim : int, optional
        Number of axes it must have.
    finite : bool
        Whether nan and infinity are refused.

    Raises
    ------
    ProblemError
        If it is no array of real numbers (complex numbers lose half of themselves as floats, and are refused even
        where their imaginary part is zero), has other axes, or a number is not finite; the first such entry is named.
    """
    try:
        given = np.asarray(value)
    except ValueError as error:
        raise ProblemError(f"{name} is no array of numbers: {error}") from error
    if given.dtype.kind == "c" or (given.dtype == object and any(isinstance(v, complex) for v in given.ravel())):
        raise ProblemError(f"{name} is complex; give real numbers (take .real if the imaginary part is meant to go)")
    try:
        array = np.asarray(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"{name} is no array of numbers: {error}") from error
    if ndim is not None and array.ndim != ndim:
        raise ProblemError(f"{name} has shape {array.shape}; it must have {ndim} axis{'' if ndim == 1 else 'es'}")
    if finite and not np.isfinite(array).all():
        place = np.unravel_index(int(np.flatnonzero(~np.isfinite(array).ravel())[0]), array.shape)
        where = f"[{', '.join(map(str, place))}]" if place else ""
        raise ProblemError(f"{name}{where} = {array[place]}; every number must be finite")
    return array


def norm(vector: ArrayLike) -> float:
    """Euclidean norm of all entries, without overflow or underflow on the way; inf or nan only if an entry is.

    It is ``s |x / s|`` with ``s`` the power of two next to the largest entry, so that nothing is rounded twice.
    """
    x = np.asarray(vector, dtype=float).ravel()
    largest = float(np.abs(x).max(initial=0.0))
    if largest == 0.0 or not np.isfinite(largest):
        return largest
    exponent = int(np.frexp(largest)[1])
    if -400 < exponent < 400:
        return float(np.sqrt(x @ x))
    with np.errstate(over="ignore", under="ignore"):
        scaled = np.ldexp(x, -exponent)
        return float(np.ldexp(np.sqrt(scaled @ scaled), exponent))
