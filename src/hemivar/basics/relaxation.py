"""Exponential relaxation towards a limit: integrals of its square, exact however short the time is."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array

__all__ = ["squares_of_relaxation"]

#: Up to here a series is summed, in the place of what would cancel; what so many terms leave out is below 0.1^18.
_SHORT, _TERMS = 0.1, 18


def squares_of_relaxation(ratio: Array | float) -> tuple[Array, Array, Array]:
    """Integrals of ``e^-2s``, ``e^-s (1 - e^-s)`` and ``(1 - e^-s)^2`` over s from 0 to ``ratio``.

    With ``e = 1 - e^-ratio`` they are ``e - e^2/2``, ``e^2/2`` and ``ratio - e - e^2/2 = e^3/3 + e^4/4 + ...``.
    """
    x = np.asarray(ratio, dtype=float)
    e = -np.expm1(-x)
    short = np.minimum(e, _SHORT)
    series = short**3 * sum(short**k / (k + 3.0) for k in range(_TERMS))
    return e - 0.5 * e**2, 0.5 * e**2, np.where(e < _SHORT, series, x - e - 0.5 * e**2)
