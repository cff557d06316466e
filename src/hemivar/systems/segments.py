"""The graph of a scalar law cut into segments: smooth pieces, along which r moves, and kinks, where lambda does."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws import Superpotential
from hemivar.laws.scalar_graph import straightness

__all__ = ["Segments", "graph_segments", "joined_rows"]

_Scalar = TypeVar("_Scalar", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Segments:
    """Curves cut into segments: one row for each curve (n), one column for each segment (S), padded."""

    count: IntArray  # (n,): number of segments
    kink: BoolArray  # (n, S): whether lambda moves along the segment (else r)
    piece: IntArray  # (n, S): piece of the law, of a kink the one before it
    knot: Array  # (n, S): displacement at a kink
    direction: Array  # (n, S): +1, or -1 at a kink where the derivative jumps down
    start: Array  # (n, S): theta at the two ends (lengths), infinite at the outer ones
    end: Array
    origin: Array  # (n, S): theta at a finite point of the segment
    value: Array  # (n, S): r (piece) or lambda (kink) there
    low: Array  # (n, S): the ends: r (piece), lambda to the left and to the right (kink); may be infinite
    high: Array
    affine: BoolArray  # (n, S): whether lambda is affine in r on the segment

    @property
    def size(self) -> int:
        """Number n of curves."""
        return self.count.size

    @cached_property
    def combinations(self) -> float:
        """Number of combinations of segments."""
        return float(np.prod(self.count.astype(float)))

    @cached_property
    def _rows(self) -> IntArray:
        return np.arange(self.size)

    def pick(self, table: NDArray[_Scalar], segment: IntArray) -> NDArray[_Scalar]:
        """The entry of each row that belongs to its segment."""
        return np.asarray(table[self._rows, segment])

    def segment_of(self, theta: Array) -> IntArray:
        """The segment that holds each theta, ``(n,)`` or ``(k, n)``."""
        return np.asarray(np.minimum(np.sum(theta[..., None] > self.end, axis=-1), self.count - 1), dtype=np.int64)

    def inside(self, theta: Array, segment: IntArray, tolerance: float) -> BoolArray:
        """Whether each theta lies on its segment."""
        low, high = self.pick(self.start, segment), self.pick(self.end, segment)
        return np.asarray((theta >= low - tolerance) & (theta <= high + tolerance))


#: What stands in the columns beyond the last segment of a row.
_PADDING: dict[str, float | bool] = {
    "kink": False,
    "piece": 0,
    "knot": 0.0,
    "direction": 1.0,
    "start": np.inf,
    "end": np.inf,
    "origin": 0.0,
    "value": 0.0,
    "low": np.inf,
    "high": np.inf,
    "affine": True,
}


def graph_segments(law: Superpotential, m: int, point: IntArray, tau: Array) -> Segments:
    """The graphs of a law at some of its m contact points, ``point (n,)``.

    Neighbouring pieces with the same constant curvature are one segment, and a knot without a jump is none.
    ``tau (n,)``: the length that stands for a unit of the multiplier.
    """
    knots = np.broadcast_to(law.knots, (m, law.knots.shape[-1]))[point]
    left, right = (np.broadcast_to(slope, (m, slope.shape[-1]))[point] for slope in law.knot_slopes())
    lower, upper = (np.broadcast_to(end, (m,))[point] for end in (law.domain.lower, law.domain.upper))
    n, width = knots.shape
    rows = np.arange(n)
    finite = np.isfinite(knots)
    # Columns 2 k are the pieces, columns 2 k + 1 the knots that end them.
    shape = (n, 2 * width + 1)
    valid, affine = np.zeros(shape, dtype=bool), np.ones(shape, dtype=bool)
    low, high, bend = np.zeros(shape), np.zeros(shape), np.zeros(shape)
    last = np.full(n, -1)
    for k in range(width + 1):
        check_time()
        here = 2 * k
        low[:, here] = knots[:, k - 1] if k else -np.inf
        high[:, here] = np.where(finite[:, k], knots[:, k], np.inf) if k < width else np.inf
        bend[:, here], affine[:, here] = (part[point] for part in straightness(law, np.full(m, k)))
        there = finite[:, k - 1] if k else np.ones(n, dtype=bool)
        met = there & (high[:, here] > lower) & (low[:, here] < upper)
        same = (
            met
            & (last >= 0)
            & (last % 2 == 0)
            & affine[:, here]
            & affine[rows, last]
            & (bend[rows, last] == bend[:, here])
        )
        high[rows[same], last[same]] = high[same, here]
        valid[:, here] = met & ~same
        last = np.where(valid[:, here], here, last)
        if k == width:
            break
        with np.errstate(invalid="ignore"):
            size = np.maximum(np.abs(left[:, k]), np.abs(right[:, k]))
            smooth = np.isfinite(size) & (np.abs(right[:, k] - left[:, k]) <= 1e-14 * size)
        inside = finite[:, k] & (lower <= knots[:, k]) & (knots[:, k] <= upper)
        valid[:, here + 1] = inside & (left[:, k] != right[:, k]) & ~smooth
        low[:, here + 1], high[:, here + 1] = left[:, k], right[:, k]
        last = np.where(valid[:, here + 1], here + 1, last)
    kink = np.broadcast_to(np.arange(shape[1]) % 2 == 1, shape)
    begins, ends = np.isfinite(low), np.isfinite(high)
    with np.errstate(invalid="ignore"):
        length = np.abs(high - low) * np.where(kink, tau[:, None], 1.0)
    length = np.where(valid & begins, length, 0.0)
    theta = np.cumsum(length, axis=1)
    before = np.concatenate([np.zeros((n, 1)), theta[:, :-1]], axis=1)
    knot = np.zeros(shape)
    knot[:, 1::2] = np.where(finite, knots, 0.0)
    every = {
        "kink": kink,
        "piece": np.broadcast_to(np.arange(shape[1]) // 2, shape),
        "knot": knot,
        "direction": np.where(kink & ~(high > low), -1.0, 1.0),
        "start": np.where(begins, before, -np.inf),
        "end": np.where(begins, theta, np.where(ends, before, np.inf)),
        "origin": np.where(begins | ends, before, 0.0),
        "value": np.where(begins, low, np.where(ends, high, 0.0)),
        "low": low,
        "high": high,
        "affine": affine,
    }
    count = valid.sum(axis=1)
    order = np.argsort(~valid, axis=1, kind="stable")[:, : max(int(count.max(initial=1)), 1)]
    beyond = np.arange(order.shape[1]) >= count[:, None]
    taken = {name: np.take_along_axis(table, order, axis=1) for name, table in every.items()}
    return Segments(count, **{name: np.where(beyond, _PADDING[name], table) for name, table in taken.items()})


def joined_rows(parts: list[Segments], order: list[IntArray]) -> Segments:
    """Rows of several tables in one: row i of a part becomes row ``order[part][i]``."""
    width = max(part.kink.shape[1] for part in parts)
    position = np.argsort(np.concatenate(order))

    def wide(table: NDArray[_Scalar], fill: float | bool) -> NDArray[_Scalar]:
        return np.pad(table, ((0, 0), (0, width - table.shape[1])), constant_values=fill)

    tables = {
        item.name: np.concatenate([wide(getattr(part, item.name), _PADDING[item.name]) for part in parts])[position]
        for item in fields(Segments)
        if item.name != "count"
    }
    return Segments(np.concatenate([part.count for part in parts])[position], **tables)
