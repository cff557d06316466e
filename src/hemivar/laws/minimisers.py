"""Prox and local minimisers: of the local problem ``a/2 r^2 - b r + j(r)`` of a point, all of them and the lowest.

They follow from the pieces of a law alone; :class:`~hemivar.laws.Superpotential` hands them out as its own methods.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arrays import CACHED
from hemivar.basics.deadline import check_time
from hemivar.basics.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from hemivar.laws.superpotential import Superpotential

__all__ = [
    "FAR",
    "MANY",
    "convex_part",
    "golden_section",
    "knot_forces",
    "local_argmin",
    "local_minimisers",
    "nearest_pair",
    "piece_bounds",
    "stationary_point",
]

#: Distance, in units of the law, at which an unbounded piece is taken to have reached its limit: any value from 1e6 to
#: 1e10 gives the same constants in tests/laws.
FAR = 1e8
#: Knots from which on they are searched, and not gone through. At 40 knots of 5000 points searching finds minimisers
#: six times faster (0.6 ms for 3.8 ms) and distances to the graph three times slower (7.4 ms for 2.7 ms).
MANY = 40
#: Places on each side of zero at which a minimiser that no piece holds is looked for, each 7 per cent farther than the
#: one before; with a quarter of them tests/laws find the same.
_PLACES = 600
#: What rounding leaves of a force that is the sum of others.
_NO_FORCE = float(np.finfo(float).eps)


def piece_bounds(law: Superpotential, piece: IntArray) -> tuple[Array, Array]:
    """End points of each piece of a law, cut at the domain."""
    last = (law.searched or law.knots.shape[-1]) - 1
    low = np.where(piece > 0, law.place_of(np.maximum(piece - 1, 0)), -np.inf)
    high = np.where(piece <= last, law.place_of(np.minimum(piece, last)), np.inf)
    ends = law.domain
    return np.clip(low, ends.lower, ends.upper), np.clip(high, ends.lower, ends.upper)


def knot_forces(law: Superpotential, a: Array) -> tuple[Array, Array]:
    """The forces b at which ``a r + j'(r) = b`` on both sides of every knot, (..., K) each; +inf where it is unused.

    Where ``a r + j'(r)`` grows, the point of the graph comes to a knot at the first one and leaves it at the other:
    counting the forces that b exceeds sorts the points onto pieces and knots.
    """
    finite, (left, right) = np.isfinite(law.knots), law.knot_slopes()
    at = a[..., None] * np.where(finite, law.knots, 0.0)
    return np.where(finite, at + left, np.inf), np.where(finite, at + right, np.inf)


def nearest_pair(
    law: Superpotential, r: Array, lam: Array, tau: Array | float, at_least: float = -np.inf
) -> tuple[Array, Array]:
    """r, or the knot not below ``at_least`` that fits a pair better, and how far off it is; as ``graph_distance``."""
    r, lam, tau, _ = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (r, lam, tau)), np.empty(law.rows))
    shape: tuple[int, ...] = r.shape
    off: Array = np.array(law.distance(r, lam)).ravel()
    nearest, r, lam, tau = r.flatten(), r.ravel(), lam.ravel(), tau.ravel()

    def miss(rows: IntArray | slice, at: Array, left: Array, right: Array) -> Array:
        """How far off knots of some rows are, (k,) or several of each, (n, k)."""
        apart = np.maximum(np.minimum(left, right) - lam[rows], lam[rows] - np.maximum(left, right))
        fits = np.hypot((r[rows] - at) / tau[rows], np.maximum(apart, 0.0))
        return fits if at_least == -np.inf else np.where(at >= at_least, fits, np.inf)

    def take(rows: IntArray | slice, at: Array, misses: Array) -> None:
        better = misses < off[rows]
        if better.any():
            nearest[rows], off[rows] = np.where(better, at, nearest[rows]), np.where(better, misses, off[rows])

    if not law.searched:
        left, right = law.knot_slopes()
        for k in range(law.knots.shape[-1]):
            knot, *sides = (np.broadcast_to(x[:, k], shape).ravel() for x in (law.knots, left, right))
            take(slice(None), knot, miss(slice(None), knot, *sides))
        return nearest.reshape(shape), off.reshape(shape)
    behind, count = law.piece_of(r), law.searched
    for step in (-1, 1):  # from the nearest knots outwards until the next one is farther than the best
        first, going, done, width = behind - (step < 0), np.arange(r.size), 0, 4
        while going.size:
            check_time()
            number = first[going] + step * np.arange(done, done + width)[:, None]
            inside, flat = (number >= 0) & (number < count), np.clip(number, 0, count - 1).ravel()
            some = law if law.rows == 1 else law.take(np.tile(going, width))
            at, left, right = (x.reshape(number.shape) for x in (some.place_of(flat), *some.slopes_at(flat)))
            misses = np.where(inside, miss(going, at, left, right), np.inf)
            best = np.argmin(misses, axis=0)[None]
            take(going, *(np.take_along_axis(x, best, axis=0)[0] for x in (at, misses)))
            farther = np.abs(r[going] - at[-1]) / tau[going] >= off[going]
            going = going[inside[-1] & ~farther]
            done, width = done + width, int(min(2 * width, max(CACHED // max(going.size, 1), 1)))
    return nearest.reshape(shape), off.reshape(shape)


def local_minimisers(law: Superpotential, a: Array, b: Array) -> tuple[Array, Array]:
    """All local minimisers of the local problem; see :meth:`hemivar.laws.Superpotential.local_minimisers`."""
    a, b = np.broadcast_arrays(np.asarray(a, dtype=float), np.asarray(b, dtype=float))
    knots = law.knots
    count = knots.shape[-1]
    shape = np.broadcast_shapes(a.shape, knots.shape[:-1])
    a, b = np.broadcast_to(a, shape), np.broadcast_to(b, shape)
    finite = np.isfinite(knots)
    at = np.where(finite, knots, 0.0)
    psi_left, psi_right = (force - b[..., None] for force in knot_forces(law, a))
    points = np.empty((*shape, 2 * count + 1))
    energies = np.full((*shape, 2 * count + 1), np.inf)
    for i in range(count + 1):
        piece = np.full(shape, i, dtype=np.int64)
        low, high = piece_bounds(law, piece)
        start = psi_right[..., i - 1] if i > 0 else np.full(shape, -np.inf)
        end = psi_left[..., i] if i < count else np.full(shape, np.inf)
        inside = low < high  # not beyond the last knot, where knots are unused
        low, high, start, end = convex_part(law, piece, a, b, low, high, start, end)
        admissible = inside & (low < high) & (start < 0.0) & (end > 0.0)
        root, exists = law.stationary_point(piece, a, b, low, high, admissible)
        points[..., i] = np.where(exists, root, 0.0)
        with np.errstate(invalid="ignore", over="ignore"):
            energy = 0.5 * a * root**2 - b * root + law.piece_value(piece, root)
        energies[..., i] = np.where(exists, energy, np.inf)
    for i in range(count):
        valid = finite[..., i] & (psi_left[..., i] <= 0.0) & (psi_right[..., i] >= 0.0)
        t = np.broadcast_to(at[..., i], shape)
        for psi, side in ((psi_left[..., i], i), (psi_right[..., i], i + 1)):
            if np.any(flat := valid & (psi == 0.0)):  # stationary from this side: it must not bend down
                curvature = law.piece_curvature(np.full(shape, side, dtype=np.int64), t)
                valid = valid & ~(flat & (a + curvature < 0.0))
        points[..., count + 1 + i] = t
        energies[..., count + 1 + i] = np.where(valid, 0.5 * a * t**2 - b * t + law.value(t), np.inf)
    return points, energies


def convex_part(
    law: Superpotential, piece: IntArray, a: Array, b: Array, low: Array, high: Array, start: Array, end: Array
) -> tuple[Array, Array, Array, Array]:
    """The part of each piece on which ``a r - b + j'(r)`` increases, and its values at the ends.

    As j'' is monotone on a piece, this is the piece, or what lies on one side of a point, or nothing (then
    ``low == high``).  Straight pieces are left as they are: those that fall have no :func:`stationary_point`.
    """
    if law.straight:
        return low, high, start, end
    with np.errstate(all="ignore"):
        size = FAR * (1.0 + np.abs(b) / np.maximum(a, 1e-12))
        first = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0) - size)
        last = np.where(np.isfinite(high), high, np.where(np.isfinite(low), low, 0.0) + size)
        bends_first = a + law.piece_curvature(piece, first) < 0.0
        bends_last = a + law.piece_curvature(piece, last) < 0.0
        if not np.any(bends_first | bends_last):
            return low, high, start, end
        concave, convex = np.where(bends_first, first, last), np.where(bends_first, last, first)
        mixed = bends_first != bends_last
        for _ in range(1100):
            middle = 0.5 * (concave + convex)
            if np.all((middle == concave) | (middle == convex) | ~mixed):
                break
            bends = a + law.piece_curvature(piece, middle) < 0.0
            concave, convex = np.where(bends, middle, concave), np.where(bends, convex, middle)
        psi = a * convex - b + law.piece_derivative(piece, convex)
    from_left, from_right = mixed & bends_first, mixed & bends_last
    low, start = np.where(from_left, convex, low), np.where(from_left, psi, start)
    high, end = np.where(from_right, convex, high), np.where(from_right, psi, end)
    return low, np.where(bends_first & bends_last, low, high), start, end


def local_argmin(law: Superpotential, a: Array, b: Array) -> Array:
    """Global minimiser of ``a/2 r^2 - b r + j(r)``; nan where the energy has no minimum."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    return _bounded(law, a, b, _argmin_of_many(law, a, b) if law.searched else _argmin(law, a, b))


def _bounded(law: Superpotential, a: Array, b: Array, r: Array) -> Array:
    """The minimisers r, and where none was found although the energy is bounded below, the lowest of many places.

    So it is where the curvature turns round inside a piece, such as that of a wave far beyond the reach of its law.
    """
    lost = np.isnan(r)
    if not lost.any() or not (lost := lost & law.coercive_against(a)).any():
        return r
    a, b = (np.broadcast_to(x, r.shape)[lost] for x in (a, b))
    part = law.take(np.flatnonzero(lost)) if law.rows > 1 else law
    knots = np.where(np.isfinite(part.knots), np.abs(part.knots), 0.0).max(axis=-1)
    size = np.maximum(knots, np.abs(b) / np.where(a > 0.0, a, np.inf))
    size = np.where(size > 0.0, size, 1.0)
    steps = np.geomspace(1e-12, 1e6, _PLACES)
    places = size * np.concatenate([-steps[::-1], [0.0], steps])[:, None]

    def energy(at: Array) -> Array:
        with np.errstate(all="ignore"):
            energies = 0.5 * a * at**2 - b * at + part.value(at)
        return np.where(np.isnan(energies), np.inf, energies)

    best = np.argmin([energy(at) for at in places], axis=0)
    rows = np.arange(best.size)
    low, high = (places[np.clip(best + side, 0, len(places) - 1), rows] for side in (-1, 1))
    out = r.copy()
    out[lost] = golden_section(energy, low, high)
    return out


def golden_section(energy: Callable[[Array], Array], low: Array, high: Array) -> Array:
    """Where functions are least between ``low`` and ``high``, to rounding if they have one minimum there."""
    golden = 0.5 * (math.sqrt(5.0) - 1.0)
    for _ in range(60):
        first, second = high - golden * (high - low), low + golden * (high - low)
        lower = energy(first) <= energy(second)
        low, high = np.where(lower, low, first), np.where(lower, second, high)
    return np.asarray(0.5 * (low + high))


def _argmin(law: Superpotential, a: Array, b: Array) -> Array:
    """:func:`local_argmin` where the points do not share many knots; nan where no piece and no knot holds it."""
    # A constant that is sampled may be too small: then all pieces are looked at.
    if law.convex or ((a > law.weak_convexity).all() and law.proof("alpha").sure):
        return _argmin_of_growing(law, a, b)
    points, energies = law.local_minimisers(a, b)
    best = np.argmin(energies, axis=-1)[..., None]
    r = np.take_along_axis(points, best, axis=-1)[..., 0]
    lowest = np.take_along_axis(energies, best, axis=-1)[..., 0]
    return np.where(np.isfinite(lowest), r, np.nan)


def _argmin_of_many(law: Superpotential, a: Array, b: Array) -> Array:
    """The minimiser where all points share many knots: by bisection where a exceeds alpha, else piece by piece."""
    a, b = np.broadcast_arrays(a, b)
    shape, a, b = a.shape, a.ravel(), b.ravel()
    out = np.empty(a.size)
    monotone = np.broadcast_to((a > law.weak_convexity) | (law.weak_convexity == 0.0), a.shape)
    rows = np.arange(a.size)
    for index in (rows[monotone], rows[~monotone]):
        if not index.size:
            continue
        part = law if law.rows == 1 else law.take(index)
        if monotone[index[0]]:
            out[index] = _bisected(part, a[index], b[index])
            continue
        size = max(1, CACHED // law.searched)
        for start in range(0, index.size, size):
            some = index[start : start + size]
            part = law if law.rows == 1 else law.take(some)
            out[some] = _lowest_of_many(part, a[some], b[some])
    return out.reshape(shape)


def _bisected(law: Superpotential, a: Array, b: Array) -> Array:
    """The minimiser where ``a r + j'(r)`` grows: the number of knots passed, by bisection."""
    count = law.searched
    passed_knots = []
    for side in (1, 0):  # knots with b above the right slope; knots with b not below the left one
        low, high = np.full(a.shape, -1), np.full(a.shape, count)
        while np.any(high - low > 1):
            middle = np.clip((low + high) // 2, 0, count - 1)
            force = a * law.place_of(middle) + law.slopes_at(middle)[side]
            passed = (b > force) if side else (b >= force)
            passed = passed & (high - low > 1)
            low, high = np.where(passed, middle, low), np.where(passed | (high - low <= 1), high, middle)
        passed_knots.append(low + 1)
    piece, reached = passed_knots
    return _on_graph(law, a, b, piece, piece < reached)


def _lowest_of_many(law: Superpotential, a: Array, b: Array) -> Array:
    """The lowest of all local minimisers: every piece and knot that can hold one, for all points at once."""
    m, count = a.size, law.searched
    below, above = knot_forces(law, a)
    passed, ahead = b[:, None] > above, b[:, None] < below
    candidate = np.ones((m, count + 1), dtype=bool)
    if law.straight:
        candidate[:, 1:] = passed
        candidate[:, :-1] &= ahead
    row, piece = np.nonzero(candidate)
    start = np.where(piece > 0, above[row, np.maximum(piece - 1, 0)] - b[row], -np.inf)
    end = np.where(piece < count, below[row, np.minimum(piece, count - 1)] - b[row], np.inf)
    some = law if law.rows == 1 else law.take(row)
    low, high = piece_bounds(some, piece)
    low, high, first, last = convex_part(some, piece, a[row], b[row], low, high, start, end)
    keep = (low < high) & (first < 0.0) & (last > 0.0)
    some = some if some.rows == 1 else some.take(np.flatnonzero(keep))
    row, piece, low, high = row[keep], piece[keep], low[keep], high[keep]
    root, exists = some.stationary_point(piece, a[row], b[row], low, high, np.ones(row.size, dtype=bool))
    with np.errstate(invalid="ignore", over="ignore"):
        energy = 0.5 * a[row] * root**2 - b[row] * root + some.piece_value(piece, root)
    places, rows, energies = [root], [row], [np.where(exists, energy, np.inf)]
    row, knot = np.nonzero(~(passed | ahead))
    some = law if law.rows == 1 else law.take(row)
    t = some.place_of(knot)
    valid = np.ones(row.size, dtype=bool)
    for force, side in ((below[row, knot], knot), (above[row, knot], knot + 1)):
        valid &= ~((force == b[row]) & (a[row] + some.piece_curvature(side, t) < 0.0))
    places.append(t)
    rows.append(row)
    energies.append(np.where(valid, 0.5 * a[row] * t**2 - b[row] * t + some.value(t), np.inf))
    points, row, energy = np.concatenate(places), np.concatenate(rows), np.concatenate(energies)
    order = np.lexsort((energy, row))
    points, row, energy = points[order], row[order], energy[order]
    out = np.full(m, np.nan)
    first_of_row = np.concatenate([[True], row[1:] != row[:-1]]) if row.size else np.zeros(0, dtype=bool)
    chosen = first_of_row & np.isfinite(energy)
    out[row[chosen]] = points[chosen]
    return out


def _argmin_of_growing(law: Superpotential, a: Array, b: Array) -> Array:
    """The minimiser where ``a r + j'(r)`` grows."""
    piece, at_knot = _classified(law, a, b)
    return _on_graph(law, np.broadcast_to(a, piece.shape), np.broadcast_to(b, piece.shape), piece, at_knot)


def _on_graph(law: Superpotential, a: Array, b: Array, piece: IntArray, at_knot: BoolArray) -> Array:
    """Where ``a r + j'(r) = b``: at the knot that ends the piece, or on the piece."""
    lower, upper = piece_bounds(law, piece)
    inside, exists = law.stationary_point(piece, a, b, lower, upper, ~at_knot & (lower < upper))
    return np.where(at_knot, upper, np.where(exists, inside, np.nan))


def _classified(law: Superpotential, a: Array, b: Array) -> tuple[IntArray, BoolArray]:
    """The piece of the graph that ``a r + j'(r) = b`` lies on, and whether at the knot that ends it.

    Where ``a r + j'(r)`` grows, the force b grows with it, and the knots that it has passed tell the piece.
    """
    below, above = knot_forces(law, a)
    passed = np.sum(b[..., None] > above, axis=-1)
    return passed, passed < np.sum(b[..., None] >= below, axis=-1)


def stationary_point(
    law: Superpotential, piece: IntArray, a: Array, b: Array, low: Array, high: Array, admissible: BoolArray
) -> tuple[Array, BoolArray]:
    """Zero of ``a r - b + j'(r)`` inside each piece, where it changes sign from minus to plus.

    On a straight piece it is known; else by a safeguarded Newton iteration from the lower end: every step stays inside
    a bracket that at least halves in two steps.
    """
    if law.straight:
        at = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0))
        slope, bend = law.piece_line(piece, at)
        valid = admissible & (a + bend > 0.0)
        root = at + (b - a * at - slope) / np.where(valid, a + bend, 1.0)
        return np.clip(np.where(valid, root, 0.0), np.where(valid, low, 0.0), np.where(valid, high, 0.0)), valid
    shape = np.broadcast_shapes(a.shape, low.shape)
    admissible = np.broadcast_to(admissible, shape).copy()
    if not admissible.any():
        return np.zeros(shape), admissible
    low, high = np.broadcast_to(low, shape), np.broadcast_to(high, shape)

    def psi(r: Array) -> Array:
        return a * r - b + law.piece_derivative(piece, r)

    anchor_low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0))
    anchor_high = np.where(np.isfinite(high), high, np.where(np.isfinite(low), low, 0.0))
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        step = np.maximum(np.maximum(np.abs(b), 1e-300) / np.maximum(a, 1e-300), 1e-300)
        step = np.where(np.isfinite(step), step, 1.0)
        for endless, anchor, sign in (
            (~np.isfinite(low), anchor_high, -1.0),
            (~np.isfinite(high), anchor_low, 1.0),
        ):
            if not (endless & admissible).any():
                continue
            at_anchor = np.abs(psi(anchor)) / np.maximum(a, 1e-300)
            # Twice as far as a law that only pushes back lets it come: the zero itself may be no end.
            end = anchor + sign * 2.0 * np.maximum(step, np.where(np.isfinite(at_anchor), at_anchor, 0.0))
            end = np.where(end == anchor, anchor + sign * np.maximum(np.abs(anchor), 1e-300) * 1e-15, end)
            for _ in range(200):
                open_end = endless & admissible & ~(sign * psi(end) > 0.0)
                if not open_end.any():
                    break
                end = np.where(open_end, anchor + 4.0 * (end - anchor), end)
            for _ in range(200 if (a == 0.0).any() else 0):  # the first end has no measure but |b| / a
                nearer = anchor + (end - anchor) / 1024.0
                beyond = endless & admissible & (a == 0.0) & (nearer != anchor) & (sign * psi(nearer) > 0.0)
                if not beyond.any():
                    break
                end = np.where(beyond, nearer, end)
            admissible &= ~(endless & (open_end | ~np.isfinite(end)))
            if sign < 0:
                low = np.where(endless, end, low)
            else:
                high = np.where(endless, end, high)
        low = np.where(admissible, low, 0.0)
        high = np.where(admissible, high, 0.0)
        r = 0.5 * (low + high)
        slope = a + law.piece_curvature(piece, low)
        newton = low - psi(low) / np.where(slope > 0.0, slope, 1.0)  # most laws hardly bend beside the body
        r = np.where((slope > 0.0) & (newton > low) & (newton < high), newton, r)
        for _ in range(200):
            f = psi(r)
            low = np.where(f < 0.0, r, low)
            high = np.where(f > 0.0, r, high)
            slope = a + law.piece_curvature(piece, r)
            newton = r - f / np.where(slope > 0.0, slope, 1.0)
            # A step below rounding leads to r itself, which is an end of the bracket by now.
            inside = (slope > 0.0) & ((newton == r) | ((newton > low) & (newton < high)))
            new = np.where(f == 0.0, r, np.where(inside, newton, 0.5 * (low + high)))
            done = np.abs(new - r) <= 4e-16 * np.maximum(np.abs(new), np.abs(r))
            done |= np.abs(f) <= _NO_FORCE * (np.abs(a * r) + np.abs(b))
            r = new
            if np.all(done | ~admissible):
                break
    return r, admissible & np.isfinite(r)
