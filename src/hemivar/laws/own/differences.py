"""Derivatives of a function of which values alone are known: differences on steps that shrink, with their errors.

On every step h the polynomial through five values near r, all of them inside a piece, has two derivatives; those of
steps h and h/4 are extrapolated (Richardson, of order four).  The error of each level is the distance to the level
before, or what rounding of the values leaves, the larger: their last digit, or, where values that are closer to each
other are the same, the smallest difference that was met.  The level with the least error is taken at every place by
itself (Ridders, Advances in Engineering Software 4, 1982, 75), so that steps follow the width of the function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray

__all__ = ["Differences", "differences"]

#: Weights at -2, -1, 0, 1, 2 of the interpolating polynomial in powers of t.
_STENCIL = np.linalg.inv(np.vander(np.arange(-2.0, 3.0), increasing=True))
#: The first step, as a part of the length of the piece or of the distance to zero; steps, and what each is
#: shorter by.
_FIRST, _LEVELS, _SHORTER = 0.1, 13, 4.0
#: Levels that are enough for most places, and errors up to which they are: parts of what values differ by over a step.
_USUAL, _ENOUGH = range(1, 5), (2e-11, 1e-7)
#: Roundings in a value, and what noise in values becomes in the derivatives of the polynomial.
_ROUNDING = 2.0 * float(np.finfo(float).eps)
_NOISE = (3.0, 6.0)
#: The end of a piece is left out by at most this part of its scale, and of the step: it may belong to the next.
_BESIDE, _BESIDE_STEP = 1e-9, 1e-3


@dataclass(frozen=True, eq=False)
class Differences:
    """First and second derivatives, and estimates of their errors; arrays of one shape."""

    first: Array
    second: Array
    first_error: Array
    second_error: Array


def differences(
    function: Callable[[Array], Array], r: Array, low: float, high: float, scale: float, order: int
) -> Differences:
    """Derivatives of a function inside a piece from ``low`` to ``high``, exact for the ``order`` 1 or 2.

    The function has values (k,) at places (k,) and differs over the length ``scale``; places ``r`` outside of the piece
    are taken from the polynomial at its end.
    """
    shape, r = np.shape(r), np.ravel(np.asarray(r, dtype=float))
    found, error, enough = _on_levels(function, r, low, high, scale, _USUAL)
    rest = np.flatnonzero(~enough[order - 1])
    if rest.size:
        some = _on_levels(function, r[rest], low, high, scale, range(_LEVELS))
        found[:, rest], error[:, rest] = some[:2]
    return Differences(*(part.reshape(shape) for part in (*found, *error)))


def _on_levels(
    function: Callable[[Array], Array], r: Array, low: float, high: float, scale: float, levels: range
) -> tuple[Array, Array, BoolArray]:
    """Derivatives (2, k) at places (k,), their errors, and whether these are small, from steps of some levels."""
    longest = np.minimum(_FIRST * np.maximum(scale, np.abs(r)), 0.24 * (high - low))
    step = longest / _SHORTER ** np.array(levels)[:, None]
    margin = np.minimum(_BESIDE * scale, _BESIDE_STEP * step)
    centre = np.clip(r, low + 2.0 * step + margin, high - 2.0 * step - margin)
    places = centre + np.arange(-2.0, 3.0)[:, None, None] * step
    values = function(places.ravel()).reshape(places.shape)
    t, c = (r - centre) / step, np.tensordot(_STENCIL, values, axes=1)
    first = (c[1] + t * (2.0 * c[2] + t * (3.0 * c[3] + t * 4.0 * c[4]))) / step
    plain = np.stack([first, (2.0 * c[2] + t * (6.0 * c[3] + t * 12.0 * c[4])) / step**2])
    change = np.diff(plain, axis=1, prepend=plain[:, :1])
    found = plain + change / (_SHORTER**4 - 1.0)
    error = np.abs(np.diff(found, axis=1, prepend=np.inf))
    error[0] = np.maximum(error[0], step * np.abs(change[1]))  # what is narrower than the step bends the middle
    rise = np.ptp(values, axis=0)
    slope_seen = np.logical_or.accumulate(np.abs(found[0]) > 10.0 * error[0], axis=0)
    grainy = (rise == 0.0) & np.vstack([np.zeros((1, r.size), dtype=bool), slope_seen[:-1]])
    least = np.where(rise > 0.0, rise, np.inf).min(axis=0)
    grain = np.where(grainy.any(axis=0), least, 0.0)
    rounding = (np.maximum(_ROUNDING * (np.abs(values).max(axis=0) + np.abs(r * first)), grain)) / step
    error = np.maximum(error, np.stack([_NOISE[0] * rounding, _NOISE[1] * rounding / step]))
    # a small change may be luck where noise grows
    error[:, :-1] = np.maximum(error[:, :-1], error[:, 1:] / np.array([_SHORTER, _SHORTER**2])[:, None, None])
    best = np.argmin(error, axis=1)[:, None]
    derivatives, errors = (np.take_along_axis(part, best, axis=1)[:, 0] for part in (found, error))
    size = rise[0] / step[0]
    enough = errors <= np.stack([_ENOUGH[0] * size, _ENOUGH[1] * size / step[0]])
    return derivatives, errors, enough
