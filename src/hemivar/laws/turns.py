"""Extrema of the curvature of a sum of laws, and bounds of its weak convexity, from the curvatures of its terms.

The curvature of every term is monotone on a piece; that of the sum need not be where one rises and another one falls.
There the turning places are sought on a grid, and the steepest fall is enclosed: on a cell, each term is bounded by its
ends, and the cells in question are halved until the bound is met.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.minimisers import FAR, golden_section
from hemivar.laws.superpotential import Interval, Superpotential, taken

__all__ = ["falls_between", "steepest_fall", "turns"]

#: Places on a piece at which a turn is sought: with half of them bounds of alpha were off by 1.9 and by 6.8 per cent.
_PLACES = 240
#: How closely a bound of the steepest fall is to be met, as docs/laws.md says: one per cent.
_CLOSE = 1e-2


def falls_between(law: Superpotential, piece: IntArray, low: Array, high: Array) -> Array:
    """A bound of -j'' on part of each piece, from its ends: j'' is monotone there; -inf where the part is empty.

    At an infinite end towards which j'' falls, the weak convexity of the law bounds it.
    """
    near = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0))
    if law.straight:
        return np.where(low < high, -law.piece_curvature(piece, near), -np.inf)
    other = np.where(np.isfinite(low) & np.isfinite(high), high, near)
    with np.errstate(all="ignore"):
        ends = [-law.piece_curvature(piece, np.broadcast_to(end, piece.shape)) for end in (near, other)]
        bound = np.maximum(*ends)
        for endless, sign in ((~np.isfinite(low), -1.0), (~np.isfinite(high), 1.0)):
            if not (endless & (low < high)).any():
                continue
            far = -law.piece_curvature(piece, near + sign * FAR * np.maximum(np.abs(near), 1.0))
            bound = np.where(endless, np.maximum(bound, far), bound)
            steeper = ~(far <= ends[0] + 1e-9 * (np.abs(far) + np.abs(ends[0])))
            bound = np.where(endless & steeper, law.weak_convexity, bound)
    return np.where(low < high, bound, -np.inf)


def _curvature(terms: Sequence[Superpotential], pieces: Sequence[IntArray], r: Array) -> Array:
    with np.errstate(all="ignore"):
        return np.asarray(sum(term.piece_curvature(piece, r) for term, piece in zip(terms, pieces, strict=True)))


def _noise(law: Superpotential) -> float:
    """What a curvature may change by rounding, or by differences where it is computed so."""
    return 1e-12 if law.proof("alpha").sure else 1e-4


def _opposed(terms: Sequence[Superpotential], pieces: Sequence[IntArray], low: Array, high: Array) -> BoolArray:
    """Whether, on part of a piece, the curvature of one term rises while that of another one falls."""
    start, end = _within(low, high)
    up, down = np.zeros(low.shape, dtype=bool), np.zeros(low.shape, dtype=bool)
    for term, piece in zip(terms, pieces, strict=True):
        if term.straight:
            continue
        with np.errstate(all="ignore"):
            first, last = term.piece_curvature(piece, start), term.piece_curvature(piece, end)
            noise = _noise(term) * (np.abs(first) + np.abs(last))
            up |= last - first > noise
            down |= first - last > noise
    return np.asarray(up & down & (low < high))


def _length(low: Array, high: Array) -> Array:
    """A length with which to go out along an unbounded piece."""
    size = np.maximum(np.where(np.isfinite(low), np.abs(low), 0.0), np.where(np.isfinite(high), np.abs(high), 0.0))
    return np.where(size > 0.0, size, 1.0)


def _within(low: Array, high: Array) -> tuple[Array, Array]:
    """Finite ends of each part, far out where it has none."""
    size = 1e8 * _length(low, high)
    start = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0) - size)
    return start, np.where(np.isfinite(high), high, np.where(np.isfinite(low), low, 0.0) + size)


def _grid(low: Array, high: Array) -> Array:
    """Places (n, P) on each part, in increasing order, ends included; outwards ever wider where it is unbounded."""
    start, end = _within(low, high)
    even = np.linspace(0.0, 1.0, _PLACES + 1)
    near = np.concatenate([[0.0], np.geomspace(1e-16, 1.0, _PLACES)])
    width = (end - start)[:, None]
    inside = start[:, None] + width * even
    outwards, inwards = start[:, None] + width * near, end[:, None] - width * near[::-1]
    endless = (~np.isfinite(high))[:, None]
    backwards = (~np.isfinite(low))[:, None]
    return np.where(endless, outwards, np.where(backwards, inwards, inside))


def turns(terms: Sequence[Superpotential], knots: Array, maps: Sequence[IntArray], domain: Interval) -> Array | None:
    """Places (m, n) at which the curvature of the sum turns round within a piece, +inf if unused; None if nowhere."""
    if sum(not term.straight for term in terms) < 2:
        return None
    rows, count = knots.shape
    columns: list[Array] = []
    for i in range(count + 1):
        low = np.clip(knots[:, i - 1] if i else np.full(rows, -np.inf), domain.lower, domain.upper)
        high = np.clip(knots[:, i] if i < count else np.full(rows, np.inf), domain.lower, domain.upper)
        pieces = [own[:, i] for own in maps]
        mixed = np.flatnonzero(_opposed(terms, pieces, low, high))
        if not mixed.size:
            continue
        some = [taken(term, mixed) for term in terms]
        places = _turns_of(some, [piece[mixed] for piece in pieces], low[mixed], high[mixed])
        wide = np.full((rows, places.shape[-1]), np.inf)
        wide[mixed] = places
        columns.append(wide)
    return np.concatenate(columns, axis=-1) if columns else None


def _turns_of(terms: Sequence[Superpotential], pieces: Sequence[IntArray], low: Array, high: Array) -> Array:
    grid = _grid(low, high)
    values = np.stack([_curvature(terms, pieces, column) for column in grid.T], axis=-1)
    rise = np.diff(values, axis=-1)
    noise = max(_noise(term) for term in terms)
    rise = np.where(np.abs(rise) <= noise * np.abs(values).max(axis=-1, keepdims=True), 0.0, rise)
    places = np.full((low.size, 0), np.inf)
    for i in range(1, rise.shape[-1]):
        turned = rise[:, i - 1] * rise[:, i] < 0.0
        if turned.any():
            sign = np.sign(rise[:, i - 1])
            turn = _extremum(terms, pieces, grid[:, i - 1], grid[:, i + 1], sign)
            places = np.concatenate([places, np.where(turned, turn, np.inf)[:, None]], axis=-1)
    return places


def _extremum(
    terms: Sequence[Superpotential], pieces: Sequence[IntArray], low: Array, high: Array, sign: Array
) -> Array:
    """The largest (sign 1) or smallest (sign -1) curvature between two places."""
    return golden_section(lambda r: -sign * _curvature(terms, pieces, r), low, high)


def steepest_fall(terms: Sequence[Superpotential], pieces: Sequence[IntArray], low: Array, high: Array) -> Array:
    """A bound of -j'' of the sum on one part of a piece for each point, never too small; -inf where it is empty."""
    bound = _bounded(terms, pieces, low, high)
    if sum(not term.straight for term in terms) < 2:
        return bound
    mixed = np.flatnonzero(_opposed(terms, pieces, low, high) & (bound > 0.0))
    if mixed.size:
        some = [taken(term, mixed) for term in terms]
        closer = _enclosed(some, [piece[mixed] for piece in pieces], low[mixed], high[mixed])
        bound[mixed] = np.minimum(bound[mixed], closer)
    return bound


def _bounded(terms: Sequence[Superpotential], pieces: Sequence[IntArray], low: Array, high: Array) -> Array:
    falls = [falls_between(term, piece, low, high) for term, piece in zip(terms, pieces, strict=True)]
    return np.asarray(np.where(low < high, sum(np.where(low < high, fall, 0.0) for fall in falls), -np.inf))


def _enclosed(terms: Sequence[Superpotential], pieces: Sequence[IntArray], low: Array, high: Array) -> Array:
    """The steepest fall on a part on which terms are opposed, enclosed by halving the cells that may hold it."""
    grid = _grid(low, high)
    ends = np.concatenate([low[:, None], grid[:, 1:-1], high[:, None]], axis=-1)
    cells = [(ends[:, i], ends[:, i + 1]) for i in range(ends.shape[-1] - 1)]
    start = np.stack([cell[0] for cell in cells], axis=-1)
    end = np.stack([cell[1] for cell in cells], axis=-1)
    bound = np.stack([_bounded(terms, pieces, *cell) for cell in cells], axis=-1)
    rows = np.arange(low.size)
    met = np.max(np.stack([-_curvature(terms, pieces, column) for column in grid.T], axis=-1), axis=-1)
    for _ in range(60):
        worst = np.argmax(bound, axis=-1)
        first, last = start[rows, worst], end[rows, worst]
        size = np.abs(bound[rows, worst]) + np.abs(met)
        going = (bound[rows, worst] - met > _CLOSE * size) & (bound[rows, worst] > 0.0)
        going &= np.isfinite(first) & np.isfinite(last)
        if not going.any():
            break
        middle = 0.5 * (first + last)
        met = np.maximum(met, np.where(going, -_curvature(terms, pieces, middle), -np.inf))
        halves = [_bounded(terms, pieces, first, middle), _bounded(terms, pieces, middle, last)]
        end[rows, worst] = np.where(going, middle, last)
        bound[rows, worst] = np.where(going, halves[0], bound[rows, worst])
        start = np.concatenate([start, middle[:, None]], axis=-1)
        end = np.concatenate([end, last[:, None]], axis=-1)
        bound = np.concatenate([bound, np.where(going, halves[1], -np.inf)[:, None]], axis=-1)
    return np.asarray(bound.max(axis=-1))
