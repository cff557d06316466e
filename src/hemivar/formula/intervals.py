"""Interval arithmetic: bounds of an operation from bounds of its arguments, rounding included.

An interval is a pair of arrays (k,), its lower and upper ends, each of which may be infinite.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from hemivar.basics.types import Array

__all__ = ["ENCLOSED", "Pair", "mended", "power"]

#: Relative error that every operation may add. Against extended precision NumPy's elementary functions and powers were
#: off by 1.8e-16 at most, at 400 000 places each.
_ROUNDING = 1e-15

#: Lower and upper ends.
Pair = tuple[Array, Array]


def mended(low: Array, high: Array) -> Pair:
    """Rounded outwards, and the whole line where there is no number."""
    below, above = low - _ROUNDING * np.abs(low), high + _ROUNDING * np.abs(high)
    if np.isnan(below).any() or np.isnan(above).any():  # also of the infinite
        below = np.where(np.isnan(low), -np.inf, low - _ROUNDING * np.abs(np.where(np.isinf(low), 0.0, low)))
        above = np.where(np.isnan(high), np.inf, high + _ROUNDING * np.abs(np.where(np.isinf(high), 0.0, high)))
    return below, above


def _product(x: Pair, y: Pair) -> Pair:
    with np.errstate(all="ignore"):
        corners = [a * b for a in x for b in y]
        low = np.minimum(np.minimum(corners[0], corners[1]), np.minimum(corners[2], corners[3]))
        if np.isnan(low).any():  # zero times infinity is zero: the factor is no number but a bound
            corners = [np.where((a == 0.0) | (b == 0.0), 0.0, a * b) for a in x for b in y]
            low = np.minimum.reduce(corners)
    return low, np.maximum(np.maximum(corners[0], corners[1]), np.maximum(corners[2], corners[3]))


def _inverse(x: Pair) -> Pair:
    low, high = x
    crosses = (low < 0.0) & (high > 0.0)
    below = np.where(crosses | (high == 0.0), -np.inf, 1.0 / np.where(high == 0.0, 1.0, high))
    above = np.where(crosses | (low == 0.0), np.inf, 1.0 / np.where(low == 0.0, 1.0, low))
    return below, above


def _whole_power(x: Pair, n: int) -> Pair:
    low, high = x
    a, b = low ** float(n), high ** float(n)
    if n % 2:
        return a, b
    return np.where((low <= 0.0) & (high >= 0.0), 0.0, np.minimum(a, b)), np.maximum(a, b)


def power(x: Pair, y: Pair, exponent: float | None) -> Pair:
    """Bounds of ``x^y``; ``exponent`` is y where it is one number."""
    if exponent is not None and exponent == round(exponent) and abs(exponent) < 1e9:
        n = int(exponent)
        return _whole_power(x, n) if n >= 0 else _inverse(mended(*_whole_power(x, -n)))
    if exponent is not None:
        low, high = x
        ends = (low**exponent, high**exponent) if exponent > 0.0 else (high**exponent, low**exponent)
        return np.where(low < 0.0, -np.inf, ends[0]), np.where(low < 0.0, np.inf, ends[1])
    low, high = _exp(mended(*_product(mended(*_log(x)), y)))
    return np.where(x[0] < 0.0, -np.inf, low), np.where(x[0] < 0.0, np.inf, high)


def _exp(x: Pair) -> Pair:
    return np.exp(x[0]), np.maximum(
        np.exp(x[1]), np.finfo(float).tiny
    )  # never zero: what is multiplied may be infinite


def _log(x: Pair) -> Pair:
    low, high = x
    return np.where(low > 0.0, np.log(np.where(low > 0.0, low, 1.0)), -np.inf), np.where(
        high > 0.0, np.log(np.where(high > 0.0, high, 1.0)), np.inf
    )


def _sqrt(x: Pair) -> Pair:
    low, high = x
    bad = low < 0.0
    root = np.sqrt(np.maximum(high, 0.0))
    return np.where(bad, -np.inf, np.sqrt(np.maximum(low, 0.0))), np.where(bad, np.inf, root)


def _absolute(x: Pair) -> Pair:
    low, high = x
    return np.maximum(np.maximum(low, -high), 0.0), np.maximum(np.abs(low), np.abs(high))


def _wave(x: Pair, function: np.ufunc, top: float) -> Pair:
    """A sine whose maxima are at ``top + 2 pi k``."""
    low, high = x
    margin = 1e-14 * (1.0 + np.maximum(np.abs(low), np.abs(high)))
    first, last = low - margin, high + margin
    wild = ~(last - first < 2.0 * np.pi) | ~(margin < 0.1)
    turn = 2.0 * np.pi
    holds_top = np.floor((last - top) / turn) >= np.ceil((first - top) / turn)
    holds_bottom = np.floor((last - top - np.pi) / turn) >= np.ceil((first - top - np.pi) / turn)
    a, b = function(np.where(wild, 0.0, low)), function(np.where(wild, 0.0, high))
    lower = np.where(wild | holds_bottom, -1.0, np.minimum(a, b))
    upper = np.where(wild | holds_top, 1.0, np.maximum(a, b))
    return lower, upper


def _tangent(x: Pair) -> Pair:
    low, high = x
    margin = 1e-14 * (1.0 + np.maximum(np.abs(low), np.abs(high)))
    same = np.floor((low - margin) / np.pi + 0.5) == np.floor((high + margin) / np.pi + 0.5)
    same &= margin < 0.1
    return np.where(same, np.tan(np.where(same, low, 0.0)), -np.inf), np.where(
        same, np.tan(np.where(same, high, 0.0)), np.inf
    )


def _hull(*parts: Pair) -> Pair:
    """What contains all values of piecewise (condition, value, ..., last)."""
    values = [parts[k] for k in range(len(parts)) if k % 2 or k == len(parts) - 1]
    return np.minimum.reduce([v[0] for v in values]), np.maximum.reduce([v[1] for v in values])


def _undecided(*parts: Pair) -> Pair:
    shape = parts[0][0].shape if parts else ()
    return np.zeros(shape), np.ones(shape)


#: Bounds of the operations of :class:`hemivar.formula.graph.Graph`, but powers.
ENCLOSED: Mapping[str, Callable[..., Pair]] = {
    "+": lambda x, y: (x[0] + y[0], x[1] + y[1]),
    "-": lambda x, y: (x[0] - y[1], x[1] - y[0]),
    "*": _product,
    "/": lambda x, y: _product(x, mended(*_inverse(y))),
    "neg": lambda x: (-x[1], -x[0]),
    "sin": lambda x: _wave(x, np.sin, 0.5 * np.pi),
    "cos": lambda x: _wave(x, np.cos, 0.0),
    "tan": _tangent,
    "tanh": lambda x: (np.tanh(x[0]), np.tanh(x[1])),
    "exp": _exp,
    "log": _log,
    "sqrt": _sqrt,
    "abs": _absolute,
    "min": lambda x, y: (np.minimum(x[0], y[0]), np.minimum(x[1], y[1])),
    "max": lambda x, y: (np.maximum(x[0], y[0]), np.maximum(x[1], y[1])),
    "piecewise": _hull,
    "true": _undecided,
    "and": _undecided,
    **dict.fromkeys(("<", "<=", ">", ">="), _undecided),
}
