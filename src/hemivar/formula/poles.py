"""Poles of formulas, where a part divides by zero or has no value: isolated or excluded by interval bisection."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, BoolArray
from hemivar.formula.enclosure import without_pole
from hemivar.formula.graph import Graph
from hemivar.formula.smooth import MOST_PARTS, WIDE, SmoothFormula, inner_place, parts_of

__all__ = ["NARROW", "NARROWEST", "Pole", "pole_in_box", "pole_of_pieces", "pole_words"]

#: Parts, and boxes, that are looked at at once: few, so that one is soon small.
_AT_ONCE, _BOXES = 256, 16
#: A part that is not wider than this part of its distance to zero, 450 roundings, or of the reach, is one place.
NARROW, NARROWEST = 1e-13, 1e-18
#: Parts that are no farther from the end of a piece than so many of these widths touch it: any number from 1 to 16
#: finds the same poles in tests/formula and tests/laws.
_TOUCHES = 4.0


@dataclass(frozen=True)
class Pole:
    """A place at which a formula is not shown to be continuous."""

    place: float
    sure: bool  # whether it was narrowed down to rounding

    def words(self, variable: str, limit: str = "") -> str:
        """What a message says after the name of the formula; ``limit`` is what may be smaller, if anything may.

        A law has values however far a body moves, so that it must be continued before the place.
        """
        before = f"{variable} {'<' if self.place > 0.0 else '>'} {0.98 * self.place:.4g}"
        line = f", or continue it by its tangent: piecewise((FORMULA, {before}), (LINE, True))"
        nearer = f", or {limit} below {abs(self.place):.6g}" if limit else line
        return pole_words({variable: self.place}) + (nearer if self.place else "")


def pole_words(at: Mapping[str, float]) -> str:
    """What a message says after the name of a formula that has a pole at a place."""
    where = ", ".join(f"{name} = {value:.6g}" for name, value in at.items())
    return (
        f"has a pole, or no value, at {where}: a part of it divides by zero there, or leaves its domain; give a "
        "formula without it"
    )


def pole_of_pieces(branches: Sequence[SmoothFormula], ends: Array, reach: float) -> Pole | None:
    """A place inside the pieces of a function at which it is not shown to be continuous; None if there is none.

    At the ends of the pieces it is only asked whether the values are finite, at the outer ones nothing.

    Shapes: ``branches`` (k,), ``ends`` (k + 1,).
    """
    doubt = None
    for i, end in enumerate(ends[1:-1].tolist()):
        if not np.isfinite([branch(np.array(end)) for branch in branches[i : i + 2]]).all():
            return Pole(end, True)
    for node in dict.fromkeys(branch.node for branch in branches):
        here = np.array([i for i, branch in enumerate(branches) if branch.node == node])
        pole = _pole(branches[here[0]], ends[here], ends[here + 1], reach)
        if pole is not None and pole.sure:
            return pole
        doubt = doubt or pole
    return doubt


def _pole(smooth: SmoothFormula, low: Array, high: Array, reach: float) -> Pole | None:
    """As :func:`pole_of_pieces`, for one function on the intervals ``[low, high]``, arrays (k,)."""
    corners = np.concatenate([low, high])
    left, right = parts_of(low, high, reach)
    nearest_last = np.argsort(-_distance(left, right), kind="stable")
    left, right = left[nearest_last], right[nearest_last]
    pole, looked_at = None, 0
    while left.size:
        left, first = left[:-_AT_ONCE], left[-_AT_ONCE:]
        right, last = right[:-_AT_ONCE], right[-_AT_ONCE:]
        open_ = ~smooth.without_pole(first, last)
        first, last = first[open_], last[open_]
        looked_at += first.size
        narrow = np.maximum(NARROW * _distance(first, last), NARROWEST * reach)
        middle = inner_place(first, last, reach)
        small = (last - first <= narrow) | (middle <= first) | (middle >= last)
        inside = middle[small & (np.abs(middle[:, None] - corners).min(axis=1) > _TOUCHES * narrow)]
        if inside.size:
            nearest = float(inside[np.argmin(np.abs(inside))])
            pole = Pole(nearest if abs(nearest) > ROUNDED * reach else 0.0, True)
        elif looked_at > MOST_PARTS or (np.abs(middle) > WIDE * reach).any():
            return pole or Pole(float(middle[0]), False)
        first, middle, last = first[~small], middle[~small], last[~small]
        left, right = np.concatenate([left, first, middle]), np.concatenate([right, middle, last])
        if pole is not None:  # one that is nearer to zero may be left
            nearer = _distance(left, right) < abs(pole.place)
            left, right = left[nearer], right[nearer]
    return pole


def _distance(low: Array, high: Array) -> Array:
    """From zero to the intervals ``[low, high]``."""
    return np.maximum(np.maximum(low, -high), 0.0)


def pole_in_box(
    graph: Graph, node: int, sides: Mapping[str, tuple[float, float]], inside: Callable[[Array], BoolArray]
) -> dict[str, float] | None:
    """A place in a box at which an expression of several variables has a pole or no value; None if none was found."""
    names, ends = list(sides), np.array(list(sides.values()))
    left, right = ends[None, :, 0], ends[None, :, 1]
    narrow = NARROW * (ends[:, 1] - ends[:, 0])
    looked_at = 0
    while left.size and looked_at <= MOST_PARTS:
        left, first = left[:-_BOXES], left[-_BOXES:]
        right, last = right[:-_BOXES], right[-_BOXES:]
        boxes = dict(zip(names, zip(first.T, last.T, strict=True), strict=True))
        open_ = inside(np.clip(0.0, first, last)) & ~without_pole(graph, node, boxes)
        first, last = first[open_], last[open_]
        looked_at += len(boxes[names[0]][0])
        small = ((last - first) <= narrow).all(axis=1)
        for low, high in zip(first[small], last[small], strict=True):
            if _in_all_branches(graph, node, names, low, high):
                middle = 0.5 * (low + high)
                at = np.where(np.abs(middle) > 10.0 * narrow, middle, 0.0)
                return dict(zip(names, at.tolist(), strict=True))
        first, last = first[~small], last[~small]
        rows, side = np.arange(len(first)), np.argmax((last - first) / narrow, axis=1)
        cut = 0.5 * (first[rows, side] + last[rows, side])
        first_end, last_start = last.copy(), first.copy()
        first_end[rows, side] = last_start[rows, side] = cut
        left, right = np.concatenate([left, first, last_start]), np.concatenate([right, first_end, last])
    return None


def _in_all_branches(graph: Graph, node: int, names: Sequence[str], low: Array, high: Array) -> bool:
    """Whether every branch that holds in a corner of a box has a pole in it: else it may lie where another holds."""
    corners = np.array(np.meshgrid(*np.column_stack([low, high]), indexing="ij")).reshape(len(names), -1)
    branches = np.unique(graph.branches_at(node, dict(zip(names, corners, strict=True)))).tolist()
    boxes = {name: (low[i : i + 1], high[i : i + 1]) for i, name in enumerate(names)}
    return not any(without_pole(graph, branch, boxes)[0] for branch in branches)
