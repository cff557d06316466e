"""Antiderivatives of smooth formulas: adaptive Gauss quadrature, parts halved until two rules agree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.formula.smooth import MOST_PARTS, SmoothFormula

__all__ = ["Primitive"]

_FINE, _COARSE = (np.polynomial.legendre.leggauss(count) for count in (16, 10))
#: How often a part is halved at most, to 1e-12 of it, and what rounding leaves between two rules, relative to the size
#: of the function: about a rounding for each of ten nodes.
_HALVINGS, _ROUNDING = 40, 2e-15
#: Parts of an interval at first, which grow by 4 from both of its ends: what is narrow there is seen at its own size.
_GRADES = 4.0 ** np.arange(-15.0, 0.0)
_CUTS = np.concatenate([_GRADES, [0.5], 1.0 - _GRADES[::-1]])


@dataclass(frozen=True, eq=False)
class Primitive:
    """The integral of a function from one of some places on, ``sums[k] + int_{ends[k]}^r slope``.

    Beyond the places it is integrated over parts that double, and is as exact as the function is smooth there.
    """

    slope: SmoothFormula
    ends: Array  # (k + 1,): increasing
    sums: Array  # (k + 1,): the integral at these places

    @classmethod
    def over(cls, slope: SmoothFormula, places: Array) -> Primitive:
        """The integral from the place nearest to zero on; what is narrow of the function lies at the places."""
        start = places[np.argmin(np.abs(places))]
        cuts = places[:-1, None] + np.diff(places)[:, None] * _CUTS
        every = np.unique(np.concatenate([places, cuts.ravel()]))
        low, high = every[:-1], every[1:]
        bend, kept = slope.derivative(), []
        for halving in range(_HALVINGS):
            fine = _gauss(slope, low, high, _FINE)
            with np.errstate(invalid="ignore"):  # where both are infinite, far out
                apart = np.abs(fine - _gauss(slope, low, high, _COARSE))
            size = _gauss(slope, low, high, _FINE, absolute=True)
            of_bend = _gauss(bend, low, high, _FINE, absolute=True)
            more = halving < _HALVINGS - 1 and low.size < MOST_PARTS
            with np.errstate(under="ignore"):
                spread = np.maximum(np.abs(low), np.abs(high)) * of_bend
                rough = ~(apart <= _ROUNDING * (size + spread)) & more
            kept.append(low[~rough])
            if not rough.any():
                break
            middle = 0.5 * (low[rough] + high[rough])
            low, high = np.concatenate([low[rough], middle]), np.concatenate([middle, high[rough]])
        ends = np.append(np.sort(np.concatenate(kept)), places[-1])
        parts, anchor = _gauss(slope, ends[:-1], ends[1:], _FINE), int(np.searchsorted(ends, start))
        left, right = -np.cumsum(parts[:anchor][::-1])[::-1], np.cumsum(parts[anchor:])
        return cls(slope, ends, np.concatenate([left, [0.0], right]))

    def through(self, r: float, value: float) -> Primitive:
        """The integral that has this value at a place."""
        return Primitive(self.slope, self.ends, self.sums + (value - float(self(np.array([r]))[0])))

    def __call__(self, r: Array) -> Array:
        """Values at ``r``, of its shape."""
        r = np.asarray(r, dtype=float)
        flat = r.ravel()
        part = np.clip(np.searchsorted(self.ends, flat, side="right") - 1, 0, self.ends.size - 1)
        start, value = self.ends[part], self.sums[part]
        step = max(float(self.ends[-1] - self.ends[0]), np.finfo(float).tiny)
        while True:
            stop = np.clip(flat, start - step, start + step)
            value = value + _gauss(self.slope, start, stop, _FINE)
            if not (np.isfinite(flat) & (stop != flat)).any():
                return value.reshape(r.shape)
            start, step = stop, 2.0 * step


def _gauss(
    slope: SmoothFormula, low: Array, high: Array, rule: tuple[Array, Array], *, absolute: bool = False
) -> Array:
    """The integrals over intervals, arrays (k,), of a function or of its size."""
    places, weights = rule
    half, middle = 0.5 * (high - low), 0.5 * (high + low)
    values = slope(middle[:, None] + half[:, None] * places)
    with np.errstate(all="ignore"):
        return np.asarray(half * ((np.abs(values) if absolute else values) @ weights))
