"""Branch and bound on boxes: interval bounds of second derivatives, and enclosed ranges, of several variables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.formula.expansion import _filled, _Jet, _through
from hemivar.formula.graph import Graph
from hemivar.formula.intervals import Pair, mended
from hemivar.formula.smooth import MOST_PARTS

__all__ = ["BoxVariable", "EnclosedRange", "enclosed_range", "second_derivatives"]

#: Part of the least and of the largest value by which the range may be wider than what was seen, as tests/formula ask.
_TIGHT = 5e-3


@dataclass(frozen=True, eq=False)
class BoxVariable:
    """A variable of an expression on k boxes, as a function of the p sides of the boxes."""

    value: Pair  # (k,)
    slope: Pair  # (p, k): first derivatives by the coordinates
    bend: Pair | None = None  # second ones, in the order of ``numpy.triu_indices(p)``


def second_derivatives(graph: Graph, node: int, variables: Mapping[str, BoxVariable]) -> Pair:
    """Bounds of the second derivatives of an expression by the coordinates of boxes, rounding included.

    Returned: in the order of ``numpy.triu_indices(p)``; infinite where nothing can be said, at kinks for instance.
    """
    first = next(iter(variables.values()))
    p, count = first.slope[0].shape
    jets = {name: _Jet(mended(*box.value), mended(*box.slope), box.bend) for name, box in variables.items()}
    with np.errstate(all="ignore"):
        jet = _through(graph, node, jets, p)
    low, high = _filled(jet.bend, p * (p + 1) // 2, count)
    return np.where(np.isnan(low), -np.inf, low), np.where(np.isnan(high), np.inf, high)


@dataclass(frozen=True)
class EnclosedRange:
    """What is known of the range of a function."""

    lower: float
    upper: float
    least: float
    largest: float
    least_at: tuple[float, ...]
    largest_at: tuple[float, ...]


def enclosed_range(
    bounds: Callable[[Array, Array], Pair], low: Array, high: Array, inside: Callable[[Array], BoolArray]
) -> EnclosedRange:
    """Enclose the range of a function over the part of a box that is inside something, by cutting the box.

    Shapes: ``low`` (d,), ``high`` (d,).
    """
    boxes = (low[None], high[None])
    waiting = (low[:0].reshape(0, low.size), low[:0].reshape(0, low.size), np.zeros(0), np.zeros(0))
    lower, upper = np.inf, -np.inf
    least, largest = np.inf, -np.inf
    least_at = largest_at = np.zeros(low.size)
    looked_at, tiny = 0, float(np.finfo(float).tiny)
    while True:
        near = np.clip(0.0, *boxes)
        keep = inside(near)
        boxes, near = (boxes[0][keep], boxes[1][keep]), near[keep]
        looked_at += len(near)
        middle = 0.5 * (boxes[0] + boxes[1])
        at = np.concatenate([near, middle[inside(middle)]])
        below, above = bounds(np.concatenate([at, boxes[0]]), np.concatenate([at, boxes[1]]))
        sure = np.isfinite(below) & np.isfinite(above)
        middles = 0.5 * (np.where(sure, below, 0.0) + np.where(sure, above, 0.0))
        values = np.where(sure, middles, np.nan)[: len(at)]
        if np.isfinite(values).any():
            i, k = int(np.nanargmin(values)), int(np.nanargmax(values))
            if values[i] < least:
                least, least_at = float(values[i]), at[i]
            if values[k] > largest:
                largest, largest_at = float(values[k]), at[k]
        first, last, below, above = (
            np.concatenate(pair) for pair in zip(waiting, (*boxes, below[len(at) :], above[len(at) :]), strict=True)
        )
        # how far bounds are from what was seen, relative: boxes with the widest are cut first
        wide = np.maximum((least - below) / max(abs(least), tiny), (above - largest) / max(abs(largest), tiny))
        wide = np.where(np.isnan(wide), np.inf, wide)
        open_ = wide > _TIGHT
        if looked_at > MOST_PARTS or not np.isfinite(least):
            open_[:] = False
        lower = min(lower, float(below[~open_].min(initial=np.inf)))
        upper = max(upper, float(above[~open_].max(initial=-np.inf)))
        if not open_.any():
            break
        first, last, below, above, wide = first[open_], last[open_], below[open_], above[open_], wide[open_]
        widest = float(wide[np.isfinite(wide)].max(initial=0.0))
        now = wide >= 0.3 * widest  # those that nothing is known of, too
        waiting = (first[~now], last[~now], below[~now], above[~now])
        first, last = first[now], last[now]
        side = np.argmax(last - first, axis=1)
        rows = np.arange(len(side))
        cut = 0.5 * (first[rows, side] + last[rows, side])
        first_end, last_start = last.copy(), first.copy()
        first_end[rows, side] = last_start[rows, side] = cut
        boxes = (np.concatenate([first, last_start]), np.concatenate([first_end, last]))
    places = (tuple(np.asarray(corner).tolist()) for corner in (least_at, largest_at))
    return EnclosedRange(lower, upper, least, largest, *places)
