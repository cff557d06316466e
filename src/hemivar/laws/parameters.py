"""Law parameters: numbers, one number per contact point, or functions of x."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arrays import real_array
from hemivar.basics.types import Array, Parameter
from hemivar.errors import ProblemError

__all__ = ["evaluate"]


def evaluate(parameter: Parameter, points: Array | None, what: str, minimum: float | None = None) -> Array:
    """The values of a parameter at the contact points, checked.

    Parameters
    ----------
    parameter : number, array (m,) or function x (m, d) -> (m,)
    points : array (m, d) or None
        Contact points; without them functions are refused.
    what : str
        Name used in messages, such as ``"q_max of law 'survey'"``.
    minimum : float, optional
        Smallest value allowed.

    Returns
    -------
    array of shape (1,) or (m,)

    Raises
    ------
    ProblemError
        Wrong shape, not a number, nan or infinite, or below ``minimum``.
    """
    if callable(parameter):
        if points is None:
            raise ProblemError(f"{what} is a function of x: evaluate the law with law.at(points) first")
        values: ArrayLike = parameter(points)
    else:
        values = parameter
    result = np.atleast_1d(real_array(values, what, finite=False))
    if result.ndim != 1 or (points is not None and result.size not in (1, len(points))):
        expected = "a number" if points is None else f"a number or {len(points)} numbers, one for each contact point"
        raise ProblemError(f"{what} has shape {result.shape}; give {expected}")
    bad = ~np.isfinite(result)
    if bad.any():
        raise ProblemError(f"{what} is {result[bad][0]}{_where(bad, points)}; give a finite number")
    if minimum is not None and (result < minimum).any():
        bad = result < minimum
        raise ProblemError(f"{what} is {result[bad][0]:g}{_where(bad, points)}; it must be at least {minimum:g}")
    return result


def _where(bad: np.ndarray, points: Array | None) -> str:
    if points is None or bad.size != len(points):
        return ""
    return f" at x = {np.array2string(points[np.argmax(bad)], precision=6)}"
