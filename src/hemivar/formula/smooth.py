"""Functions of one variable without switches: derivatives, all their zeros, and guaranteed bounds.

Zeros are isolated and suprema enclosed by interval arithmetic on parts that are halved where they must be; the work is
bounded, and whoever asks learns when that bound was met.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.formula.enclosure import enclosed, tail, without_pole
from hemivar.formula.graph import Graph

__all__ = ["MOST_PARTS", "WIDE", "SmoothFormula", "Supremum", "graded", "inner_place", "parts_of", "supremum_of_pieces"]

#: How much farther than the reach zeros are found of functions that are linear.
WIDE = 1e6
#: Parts of an interval that are looked at for one question.
MOST_PARTS = 20_000
#: Nodes times parts for one question: 0.08 s of an AMD EPYC.
_MOST_WORK = 3e6
#: Bounds that are wider than those of one value by this factor at most are owed to rounding: any factor from 1.5 to 16
#: gives the same zeros in tests/formula and tests/laws.
_NOISE = 4.0
#: How often graded parts grow by 4: from 4^-27 = 6e-17 of an interval, its rounding, on.
_GRADES = 27
#: Parts that cost as much as the call itself: with 50 the work of tests/formula and tests/laws is bounded as well.
_OVERHEAD = 500
#: Zeros that are nearer to each other than this part of the reach count as one, and as none if no sign changes: any
#: value from 1e-12 to 1e-8 gives the same ones in tests/formula and tests/laws.
_RESOLVED = 1e-10
#: Accuracy to which a supremum is enclosed, relative: docs/laws.md promises it, and 1e-4 would not keep it.
_TIGHT = 1e-7


@dataclass(frozen=True)
class Supremum:
    """What is known about the supremum of a function over an interval."""

    bound: float  # it is at most this
    seen: float  # largest value that was met
    place: float  # where


@dataclass(frozen=True, eq=False)
class SmoothFormula:
    """A function of one variable without switches."""

    graph: Graph
    node: int  # an expression without abs, min, max and piecewise
    variable: str

    def __call__(self, r: Array) -> Array:
        """Values at ``r``, of its shape; not finite where the formula is not."""
        r = np.asarray(r, dtype=float)
        with np.errstate(all="ignore"):
            return np.broadcast_to(np.asarray(self.graph.value(self.node, {self.variable: r}), dtype=float), r.shape)

    def derivative(self) -> SmoothFormula:
        """The derivative, in symbols."""
        return SmoothFormula(self.graph, self.graph.derivative(self.node), self.variable)

    @property
    def constant(self) -> bool:
        """Whether the variable does not occur."""
        return self.graph.constant(self.node)

    def negative(self) -> SmoothFormula:
        """The function with the other sign."""
        return SmoothFormula(self.graph, self.graph.negative(self.node), self.variable)

    def __str__(self) -> str:
        return re.sub(r"(\d)\.0\b", r"\1", self.graph.text(self.node))

    def enclosed(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Bounds over intervals ``[low, high]``, arrays (k,); see :func:`hemivar.formula.enclosure.enclosed`."""
        return enclosed(self.graph, self.node, np.asarray(low, dtype=float), np.asarray(high, dtype=float))

    def without_pole(self, low: Array, high: Array) -> BoolArray:
        """Whether it is shown to be finite and continuous on intervals ``[low, high]``, arrays (k,)."""
        return without_pole(self.graph, self.node, {self.variable: (low, high)})

    def _continuous(self, low: Array, high: Array, below: Array, above: Array) -> BoolArray:
        """The same, told by finite bounds of the slope: only there its sign says that the function rises or falls."""
        shown = np.isfinite(below) & np.isfinite(above)
        if not shown.all():
            shown[~shown] = self.without_pole(low[~shown], high[~shown])
        return shown

    def zeros(self, reach: float) -> Array | None:
        """All zeros in ``[-reach, reach]`` (far beyond if the function is linear), increasing; None if too many.

        A function that is zero all over some interval has no zero there.
        """
        if self.constant:
            return np.zeros(0)
        slope = self.derivative()
        if slope.constant:
            at_zero, rate = float(self(np.zeros(1))[0]), float(slope(np.zeros(1))[0])
            zero = -at_zero / rate if rate != 0.0 and np.isfinite(rate) else np.inf
            return np.array([zero + 0.0] if abs(zero) <= WIDE * reach else [])
        inside, (rest, _) = self.isolated(np.array([-reach, 0.0]), np.array([0.0, reach]), 1e-3 * reach)
        return None if rest.size else inside

    def isolated(
        self, low: Array, high: Array, finest: float, most: float = _MOST_WORK
    ) -> tuple[Array, tuple[Array, Array]]:
        """All zeros in the intervals ``[low, high]``, arrays (k,), but for what is left when the work ends.

        Where the function is zero all over some interval, or differs from zero by rounding only, it has none.

        Shapes: ``low`` (k,), ``high`` (k,). Returned: ``zeros``: increasing; ``rest``: ends of the parts that may hold
        more.
        """
        slope = self.derivative()
        brackets: list[tuple[Array, Array]] = [(low[:0], high[:0])]
        unclear: list[tuple[Array, Array]] = [(low[:0], high[:0])]
        size = self.graph.size(self.node) + self.graph.size(slope.node)
        while low.size:
            self.graph.work += (low.size + _OVERHEAD) * size
            if low.size > MOST_PARTS or self.graph.work > most:
                break
            below, above = self.enclosed(low, high)
            here = (below <= 0.0) & (above >= 0.0)
            low, high, below, above = low[here], high[here], below[here], above[here]
            least, largest = slope.enclosed(low, high)
            monotone = (least > 0.0) | (largest < 0.0)
            monotone[monotone] = self._continuous(*(x[monotone] for x in (low, high, least, largest)))
            brackets.append((low[monotone], high[monotone]))
            going = ~monotone & ~self._rounding(low, high, below, above)
            low, high = low[going], high[going]
            small = high - low <= _RESOLVED * np.maximum(np.maximum(np.abs(low), np.abs(high)), finest)
            unclear.append((low[small], high[small]))
            low, high = low[~small], high[~small]
            middle = 0.5 * (low + high)
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
        zeros = [self.crossings(*_columns(brackets)), self._touching(*_columns(unclear), 1e3 * finest)]
        return np.unique(np.concatenate(zeros)) + 0.0, (low, high)

    def sign_changes(self, low: Array, high: Array) -> Array:
        """Zeros between places next to each other, ends and middles of parts, at which the sign is sure and differs."""
        if not low.size:
            return low
        places = np.unique(np.concatenate([low, 0.5 * (low + high), high]))
        least, most = self.enclosed(places, places)
        places = places[(least > 0.0) | (most < 0.0)]
        return self.crossings(places[:-1], places[1:])

    def _rounding(self, low: Array, high: Array, below: Array, above: Array) -> BoolArray:
        """Where bounds around zero are hardly wider than those of a single value."""
        middle = 0.5 * (low + high)
        least, most = self.enclosed(middle, middle)
        with np.errstate(invalid="ignore"):
            return (least <= 0.0) & (most >= 0.0) & (above - below <= _NOISE * (most - least)) & np.isfinite(above)

    def crossings(self, low: Array, high: Array) -> Array:
        """Ends of the intervals ``[low, high]``, arrays (k,), that are zeros, and a zero where their signs differ."""
        if not low.size:
            return low
        first, last = self(low), self(high)
        ends = np.concatenate([low[first == 0.0], high[last == 0.0]])
        changes = first * last < 0.0
        low, high, first = low[changes].copy(), high[changes].copy(), np.sign(first[changes])
        for _ in range(120):
            middle = 0.5 * (low + high)
            if np.all((middle == low) | (middle == high)):
                break
            same = np.sign(self(middle)) * first > 0.0
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        root = 0.5 * (low + high)
        short = np.array([float(f"{x:.12g}") for x in root.tolist()])
        return np.concatenate(
            [ends, np.where((np.abs(short - root) <= high - low) | (self(short) == 0.0), short, root)]
        )

    def _touching(self, low: Array, high: Array, reach: float) -> Array:
        """One place for every cluster of intervals that are too small to be divided further."""
        if not low.size:
            return low
        order = np.argsort(low)
        low, high = low[order], high[order]
        starts = np.concatenate([[True], low[1:] > high[:-1] + _RESOLVED * reach])
        first = low[starts]
        last = high[np.concatenate([np.flatnonzero(starts)[1:] - 1, [low.size - 1]])]
        narrow = last - first <= 1e-4 * reach
        first, last = first[narrow], last[narrow]
        crosses = self(first) * self(last) < 0.0
        middle = 0.5 * (first + last)
        middle = np.where((first <= 0.0) & (last >= 0.0), 0.0, middle)
        return np.concatenate([self.crossings(first[crosses], last[crosses]), middle[~crosses]])

    def supremum(self, low: Array, high: Array, reach: float, at_least: float, slack: float = 0.0) -> Supremum:
        """Enclose the larger of ``at_least`` and the supremum over the intervals ``[low, high]``, arrays (k,).

        Ends may be infinite.  Every part is enclosed by itself and by its middle and slope (mean value form); where the
        slope has one sign, by the end that it leads to; a part without end by how the function decays, too.  ``slack``
        is an absolute accuracy that is good enough.
        """
        slope = self.derivative()
        left, right = parts_of(np.asarray(low, dtype=float), np.asarray(high, dtype=float), reach)
        seen, highest = at_least, float(left[0]) if np.isfinite(left[0]) else 0.0
        done = at_least
        waiting = (np.zeros(0), np.zeros(0), np.zeros(0))
        size = self.graph.size(self.node) + self.graph.size(slope.node)
        while True:
            self.graph.work += (left.size + _OVERHEAD) * size
            middle = _middle(left, right)
            at = np.concatenate([np.where(np.isinf(x), middle, x) for x in (left, middle, right)])
            values = self(at)
            values = np.where(np.isfinite(values), values, -np.inf)
            if values.max(initial=-np.inf) > seen:
                seen, highest = float(values.max()), float(at[np.argmax(values)])
            upper = self._upper(slope, left, middle, right)
            for k in np.flatnonzero((np.isinf(left) | np.isinf(right)) & (upper > seen)):
                upper[k] = min(upper[k], tail(self.graph, self.node, float(left[k]), float(right[k])))
            left, right, upper = (np.concatenate(pair) for pair in zip(waiting, (left, right, upper), strict=True))
            open_ = upper > seen + _TIGHT * abs(seen) + slack
            done = max(done, float(upper[~open_].max(initial=-np.inf)))
            left, right, upper = left[open_], right[open_], upper[open_]
            if not left.size:
                return Supremum(max(done, seen), seen, highest)
            # the parts with the largest bounds first; the others may turn out not to matter
            top = float(upper.max())
            now = upper >= (top if top == np.inf else 1e-3 * top if top > 0.0 else -np.inf)
            waiting = (left[~now], right[~now], upper[~now])
            left, right, upper = left[now], right[now], upper[now]
            middle = inner_place(left, right, reach)
            small = np.maximum(1e-13 * np.maximum(np.abs(left), np.abs(right)), 1e-18 * reach)
            stuck = (middle <= left) | (middle >= right) | (np.abs(middle) > 1e9 * reach) | (right - left <= small)
            if left.size > MOST_PARTS or self.graph.work > _MOST_WORK:
                stuck[:] = True
                done = max(done, float(waiting[2].max(initial=-np.inf)))
                waiting = (np.zeros(0), np.zeros(0), np.zeros(0))
            if stuck.any():
                worst = int(np.argmax(np.where(stuck, upper, -np.inf)))
                if not np.isfinite(upper[worst]):
                    return Supremum(np.inf, seen, float(_middle(left, right)[worst]))
                done = max(done, float(upper[worst]))
                left, middle, right = left[~stuck], middle[~stuck], right[~stuck]
            left, right = np.concatenate([left, middle]), np.concatenate([middle, right])

    def _upper(self, slope: SmoothFormula, left: Array, middle: Array, right: Array) -> Array:
        """Upper bounds on the parts ``[left, right]``, arrays (k,)."""
        below, above = slope.enclosed(left, right)
        upper = self.enclosed(left, right)[1]
        with np.errstate(all="ignore"):
            points = np.concatenate([left, middle, right])
            at_left, at_middle, at_right = np.split(self.enclosed(points, points)[1], 3)
            form = at_middle + np.maximum(np.abs(below), np.abs(above)) * 0.5000001 * (right - left)
            upper = np.fmin(upper, np.where(np.isfinite(form), form, np.inf))
            rises, falls = (below >= 0.0) & np.isfinite(right), (above <= 0.0) & np.isfinite(left)
            monotone = rises | falls
            monotone[monotone] = self._continuous(*(x[monotone] for x in (left, right, below, above)))
            upper = np.where(rises & monotone, np.fmin(upper, at_right), upper)
            return np.where(falls & monotone, np.fmin(upper, at_left), upper)


def graded(low: Array, high: Array) -> tuple[Array, Array]:
    """The intervals ``[low, high]``, arrays (k,), in parts that grow with the distance to zero and to their ends."""
    if low.size > 20:  # many are narrow themselves
        return low, high
    left, right = [low[:0]], [high[:0]]
    for a, b in zip(low.tolist(), high.tolist(), strict=True):
        steps = (b - a) * 4.0 ** np.arange(-_GRADES, 0.0)
        size = max(abs(a), abs(b)) * 4.0 ** np.arange(-_GRADES, 0.0)
        cuts = np.concatenate([[a, b, 0.0], a + steps, b - steps, size, -size])
        cuts = np.unique(cuts[(cuts >= a) & (cuts <= b)])
        left.append(cuts[:-1])
        right.append(cuts[1:])
    return np.concatenate(left), np.concatenate(right)


def _middle(left: Array, right: Array) -> Array:
    """The middle, or the finite end."""
    with np.errstate(invalid="ignore"):
        return np.where(
            np.isinf(left), np.where(np.isinf(right), 0.0, right), np.where(np.isinf(right), left, 0.5 * (left + right))
        )


def inner_place(left: Array, right: Array, reach: float) -> Array:
    """A place inside of the intervals ``[left, right]``, arrays (k,), of which one end may be infinite."""
    middle = _middle(left, right)
    return np.where(np.isinf(left), 2.0 * right - reach, np.where(np.isinf(right), 2.0 * left + reach, middle))


def parts_of(low: Array, high: Array, reach: float) -> tuple[Array, Array]:
    """The intervals, those without end cut in pieces that grow outwards."""
    steps = np.array([0.0, 0.1, 1.0, 10.0, 1e3, 1e5]) * reach
    finite = np.isfinite(high - low)
    left, right = [low[finite]], [high[finite]]
    for a, b in zip(low[~finite].tolist(), high[~finite].tolist(), strict=True):
        from_start = a + steps if np.isfinite(a) else steps
        to_end = b - steps[::-1] if np.isfinite(b) else -steps[::-1]
        inner = from_start if np.isfinite(a) else to_end if np.isfinite(b) else np.unique([*to_end, *from_start])
        cuts = np.unique([a, *inner.tolist(), b])
        left.append(cuts[:-1])
        right.append(cuts[1:])
    first, last = np.concatenate(left), np.concatenate(right)
    finite = np.isfinite(last - first)
    inner = graded(first[finite], last[finite])
    return np.concatenate([inner[0], first[~finite]]), np.concatenate([inner[1], last[~finite]])


def _columns(parts: list[tuple[Array, Array]]) -> tuple[Array, Array]:
    return np.concatenate([low for low, _ in parts]), np.concatenate([high for _, high in parts])


def supremum_of_pieces(
    branches: Sequence[SmoothFormula], ends: Array, reach: float, *, order: int, sign: float, slack: float = 0.0
) -> Supremum:
    """Enclose the larger of zero and the supremum of ``sign`` times a derivative over all pieces of a function.

    Shapes: ``branches`` (k,), ``ends`` (k + 1,).
    """
    largest = Supremum(0.0, 0.0, 0.0)
    branches[0].graph.work = 0.0
    for node in dict.fromkeys(branch.node for branch in branches):
        here = np.array([i for i, branch in enumerate(branches) if branch.node == node])
        smooth = branches[here[0]]
        for _ in range(order):
            smooth = smooth.derivative()
        smooth = smooth if sign > 0.0 else smooth.negative()
        own = smooth.supremum(ends[here], ends[here + 1], reach, largest.seen, slack)
        at = own.place if own.bound > largest.bound else largest.place
        largest = Supremum(max(own.bound, largest.bound), max(own.seen, largest.seen), at)
    return largest
