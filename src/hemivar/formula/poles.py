"""Poles of formulas: places where a part divides by zero, or has no value, found or excluded by intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.formula.smooth import SmoothFormula, inner_place, parts_of

__all__ = ["Pole", "pole_of_pieces"]

#: Parts that are looked at for one question, and at once.
_MOST_PARTS, _AT_ONCE = 20_000, 256
#: A part that is not wider than this part of its distance to zero, or of the reach, is one place.
_NARROW, _NARROWEST = 1e-13, 1e-18
#: Parts nearer than this to the end of a piece, relative to their distance to zero and the reach, touch it.
_TOUCHES = 4.0
#: Places nearer to zero than this part of the reach lie at zero; farther than this many reaches nothing is looked at.
_ZERO, _FARTHEST = 1e-15, 1e9


@dataclass(frozen=True)
class Pole:
    """A place at which a formula is not shown to be continuous.

    Attributes
    ----------
    place : float
    sure : bool
        Whether it was narrowed down to rounding; False where the work ended before.
    """

    place: float
    sure: bool

    def words(self, variable: str) -> str:
        """What a message says after the name of the formula."""
        nearer = f", or a reach below {abs(self.place):.6g}" if self.place else ""
        return (
            f"has a pole, or no value, at {variable} = {self.place:.6g}: a part of it divides by zero there, or leaves "
            f"its domain; give a formula without it{nearer}"
        )


def pole_of_pieces(branches: Sequence[SmoothFormula], ends: Array, reach: float) -> Pole | None:
    """A place inside the pieces of a function at which it is not shown to be continuous; None if there is none.

    The ends of the pieces are left out: what the function does there its values and bounds tell.

    Parameters
    ----------
    branches : sequence of SmoothFormula (k,)
        Of one graph: the function on each piece.
    ends : array (k + 1,)
        Ends of the pieces; the outer ones may be infinite.
    reach : float
    """
    doubt = None
    for node in dict.fromkeys(branch.node for branch in branches):
        here = np.array([i for i, branch in enumerate(branches) if branch.node == node])
        found = _pole(branches[here[0]], ends[here], ends[here + 1], reach)
        if found is not None and found.sure:
            return found
        doubt = doubt or found
    return doubt


def _pole(smooth: SmoothFormula, low: Array, high: Array, reach: float) -> Pole | None:
    """As :func:`pole_of_pieces`, for one function on the intervals ``[low, high]``, arrays (k,)."""
    corners = np.concatenate([low, high])
    left, right = parts_of(low, high, reach)
    nearest_last = np.argsort(-_distance(left, right), kind="stable")
    left, right = left[nearest_last], right[nearest_last]
    found, looked_at = None, 0
    while left.size:
        left, first = left[:-_AT_ONCE], left[-_AT_ONCE:]
        right, last = right[:-_AT_ONCE], right[-_AT_ONCE:]
        open_ = ~smooth.without_pole(first, last)
        first, last = first[open_], last[open_]
        looked_at += first.size
        narrow = np.maximum(_NARROW * _distance(first, last), _NARROWEST * reach)
        middle = inner_place(first, last, reach)
        small = (last - first <= narrow) | (middle <= first) | (middle >= last)
        inside = middle[small & (np.abs(middle[:, None] - corners).min(axis=1) > _TOUCHES * narrow)]
        if inside.size:
            place = float(inside[np.argmin(np.abs(inside))])
            found = Pole(place if abs(place) > _ZERO * reach else 0.0, True)
        elif looked_at > _MOST_PARTS or (np.abs(middle) > _FARTHEST * reach).any():
            return found or Pole(float(middle[0]), False)
        first, middle, last = first[~small], middle[~small], last[~small]
        left, right = np.concatenate([left, first, middle]), np.concatenate([right, middle, last])
        if found is not None:  # one that is nearer to zero may be left
            nearer = _distance(left, right) < abs(found.place)
            left, right = left[nearer], right[nearer]
    return found


def _distance(low: Array, high: Array) -> Array:
    """From zero to the intervals ``[low, high]``."""
    return np.maximum(np.maximum(low, -high), 0.0)
