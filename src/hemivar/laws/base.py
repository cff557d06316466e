"""The interface of a superpotential and everything that follows from its pieces.

A superpotential is a scalar function j(r), smooth between *knots*.  A law supplies its knots and, on every
piece between two knots, its derivative and curvature; the Clarke subdifferential, the proximal map, the global
minimiser of the local problem and the distance to the graph are derived here, exactly, for convex and for
nonmonotone laws alike.

All methods are vectorised over contact points: arguments have shape ``(m,)`` (or any shape that broadcasts
with it), parameters are numbers or arrays of shape ``(m,)``.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.description import LawDescription, LawKink

__all__ = ["Interval", "Superpotential"]

#: Distance, in units of the law, at which an unbounded piece is taken to have reached its limit.
_FAR = 1e8
#: Knots from which on they are many.
_MANY = 40
#: Points times knots that are looked at at once.
_AT_ONCE = 1 << 18


@dataclass(frozen=True)
class Interval:
    """Closed intervals ``[lower, upper]``, one for each contact point; bounds may be infinite."""

    lower: Array
    upper: Array

    def distance(self, x: Array) -> Array:
        """Distance of each ``x`` to its interval."""
        return np.maximum(np.maximum(self.lower - x, x - self.upper), 0.0)

    def contains(self, x: Array, tolerance: float = 0.0) -> BoolArray:
        """Whether each ``x`` lies in its interval, up to ``tolerance``."""
        return self.distance(x) <= tolerance


class Superpotential(Portable, ABC):
    """A scalar law j, one for each contact point.

    Pieces are numbered 0..K: piece ``i`` lies between knot ``i - 1`` and knot ``i`` (the first and the last one
    are unbounded, or outside the domain).  Outside ``[lower, upper]`` the value is +inf.

    On every piece the curvature j'' must be monotone (or constant); where it turns round, put a knot, which need
    not be a kink.  Then ``a r - b + j'(r)`` bends at most once on a piece, and all local minimisers are found.
    """

    #: Short name used in messages, files and tables.
    name: str = "law"

    #: Whether alpha or the growth constants come from sampling, so that they may be too small.
    constants_sampled: bool = False

    #: Whether the library made it from a law that has been looked at, so that its shape is not looked at again.
    examined: bool = False

    @property
    def stated(self) -> Mapping[str, object] | None:
        """The law by its name and parameters, ``{"law": "survey", "q_max": 0.3}``; None if it has no such name.

        Names are those of :mod:`hemivar.laws.registry`. A table from a file has its path under ``file``; one that was
        given as numbers has its two columns under ``rows``.
        """
        return None

    @property
    def alpha_sampled(self) -> bool:
        """Whether alpha comes from sampling."""
        return self.constants_sampled

    @property
    def growth_sampled(self) -> bool:
        """Whether the growth constants come from sampling."""
        return self.constants_sampled

    # ---- what a law supplies -------------------------------------------------------------------------

    @property
    @abstractmethod
    def knots(self) -> Array:
        """Knots in increasing order, shape ``(m or 1, K)`` with K >= 1; unused trailing entries are +inf."""

    @property
    @abstractmethod
    def domain(self) -> Interval:
        """Where j is finite; bounds of shape ``(m or 1,)``, each of them infinite or a knot."""

    @abstractmethod
    def piece_value(self, piece: IntArray, r: Array) -> Array:
        """The formula of j that belongs to each ``piece``, at ``r``; j(0) = 0 where 0 is in the domain."""

    @abstractmethod
    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        """The formula of j' that belongs to each ``piece``, at ``r``."""

    @abstractmethod
    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        """The formula of j'' that belongs to each ``piece``, at ``r``."""

    @property
    @abstractmethod
    def weak_convexity(self) -> Array:
        """Smallest alpha >= 0 with j + alpha/2 r^2 convex, shape ``(m or 1,)``; inf at downward jumps."""

    @property
    @abstractmethod
    def growth(self) -> tuple[Array, Array]:
        """Constants ``(c0, c1)`` of |dj(r)| <= c0 + c1 |r|, infinite where there are none."""

    @abstractmethod
    def at(self, points: Array | None) -> Superpotential:
        """The law with every parameter evaluated at ``points (m, d)``."""

    @abstractmethod
    def scaled(self, factor: Array | float) -> Superpotential:
        """The law ``factor * j``, with one factor >= 0 for each contact point."""

    @abstractmethod
    def take(self, index: IntArray) -> Superpotential:
        """The law at some of the contact points."""

    @abstractmethod
    def recession(self, sign: Array) -> Array:
        """Growth rate lim j(t s)/t, t -> inf, in each direction ``s``; may be +inf."""

    def asymptotic_curvature(self, sign: float) -> Array:
        """lim 2 j(t s)/t^2, t -> inf, for ``s = +1`` or ``-1``, shape (m or 1,); +inf where j ends or grows faster.

        Zero unless the recession is infinite; then, unless a law knows better, measured far away.
        """
        rate = np.atleast_1d(self.recession(np.array([sign])))
        bound = self.domain
        ends = np.isfinite(bound.upper if sign > 0.0 else bound.lower)
        if np.all(np.isfinite(rate)):
            return np.where(ends, np.inf, 0.0)
        far = np.full(self.knots.shape[0], sign * _FAR)
        with np.errstate(all="ignore"):
            measured = 2.0 * self.value(far) / far**2
            further = self.value(10.0 * far) * 0.02 / far**2
        measured = np.where(np.isnan(measured), rate, measured)
        superlinear = np.abs(further) > 2.0 * np.abs(measured) + 1e-6
        measured = np.where(superlinear & np.isfinite(measured), np.copysign(np.inf, measured), measured)
        return np.where(ends, np.inf, np.where(np.isfinite(rate), 0.0, measured))

    def piece_formula(self, piece: int) -> str:
        """The derivative j' on a piece as text, for a law with parameters of one contact point; may be empty."""
        return ""

    # ---- many knots, the same at every point: they are searched, not gone through ---------------------------

    @property
    def _shared(self) -> Array | None:
        """The knots (K,) if there are many, the same at all points; places among them are found by bisection."""
        knots = self.knots
        return knots[0] if knots.shape[0] == 1 and knots.shape[-1] > _MANY else None

    @property
    def _many(self) -> bool:
        return self._shared is not None

    def _slopes_at(self, knot: IntArray) -> tuple[Array, Array]:
        """Derivatives to the left and to the right of one knot for each point, (m,); only if all points share them."""
        left, right = self.knot_slopes()
        return left[0].take(knot), right[0].take(knot)

    # ---- what follows --------------------------------------------------------------------------------

    def piece_of(self, r: Array) -> IntArray:
        """Index of the piece that holds each ``r``; at a knot, the piece to its left."""
        r = np.asarray(r, dtype=float)
        shared = self._shared
        if shared is not None:
            return np.asarray(np.searchsorted(shared, r, side="left"), dtype=np.int64)
        return np.asarray(np.sum(r[..., None] > self.knots, axis=-1), dtype=np.int64)

    def piece_bounds(self, piece: IntArray) -> tuple[Array, Array]:
        """End points of each piece, cut at the domain."""
        piece = np.asarray(piece)
        shared = self._shared
        if shared is not None:
            last = shared.size - 1
            low = np.where(piece > 0, shared.take(np.maximum(piece - 1, 0)), -np.inf)
            high = np.where(piece <= last, shared.take(np.minimum(piece, last)), np.inf)
            ends = self.domain
            return np.clip(low, ends.lower, ends.upper), np.clip(high, ends.lower, ends.upper)
        knots = self.knots
        padded = np.concatenate(
            [np.full((*knots.shape[:-1], 1), -np.inf), knots, np.full((*knots.shape[:-1], 1), np.inf)],
            axis=-1,
        )
        if piece.ndim and padded.shape[:-1] == (1,):
            low, high = padded[0].take(piece), padded[0].take(piece + 1)
        else:
            padded = np.broadcast_to(padded, (*np.broadcast_shapes(piece.shape, padded.shape[:-1]), padded.shape[-1]))
            index = np.broadcast_to(piece, padded.shape[:-1])[..., None]
            low = np.take_along_axis(padded, index, axis=-1)[..., 0]
            high = np.take_along_axis(padded, index + 1, axis=-1)[..., 0]
        bound = self.domain
        return np.clip(low, bound.lower, bound.upper), np.clip(high, bound.lower, bound.upper)

    def knot_slopes(self) -> tuple[Array, Array]:
        """Derivatives to the left and to the right of each knot, ``(m or 1, K)`` each; -inf, +inf at domain ends."""
        knots = self.knots
        index = np.broadcast_to(np.arange(knots.shape[-1]), knots.shape)
        finite = np.isfinite(knots)
        at = np.where(finite, knots, 0.0)
        left = np.empty(knots.shape)
        right = np.empty(knots.shape)
        for i in range(knots.shape[-1]):
            left[..., i] = self.piece_derivative(index[..., i], at[..., i])
            right[..., i] = self.piece_derivative(index[..., i] + 1, at[..., i])
        bound = self.domain
        left = np.where(knots <= bound.lower[..., None], -np.inf, left)
        right = np.where(knots >= bound.upper[..., None], np.inf, right)
        return np.where(finite, left, 0.0), np.where(finite, right, 0.0)

    def kinks(self) -> BoolArray:
        """Which knots are kinks (the derivative jumps there), shape ``(m or 1, K)``."""
        left, right = self.knot_slopes()
        with np.errstate(invalid="ignore"):
            return np.asarray((left != right) & np.isfinite(self.knots))

    def value(self, r: Array) -> Array:
        """j(r); +inf outside the domain."""
        r = np.asarray(r, dtype=float)
        bound = self.domain
        inside = np.clip(r, bound.lower, bound.upper)
        value = self.piece_value(self.piece_of(inside), inside)
        return np.where((r < bound.lower) | (r > bound.upper), np.inf, value)

    def at_kink(self, r: Array) -> BoolArray:
        """Whether each ``r`` sits exactly on a kink, so that j has no derivative there."""
        r = np.asarray(r, dtype=float)
        shared = self._shared
        if shared is not None:
            near = np.minimum(np.searchsorted(shared, r, side="left"), shared.size - 1)
            left, right = self._slopes_at(near)
            return np.asarray((shared.take(near) == r) & np.isfinite(r) & (left != right))
        return np.asarray(np.any((r[..., None] == self.knots) & self.kinks(), axis=-1))

    def kink_within(self, r: Array, near: float) -> Array:
        """The kink nearest to each ``r (m,)`` if it is not farther than ``near``, else nan."""
        shared = self._shared
        if shared is None:
            off = np.where(self.kinks(), np.abs(r[:, None] - self.knots), np.inf)
            at = np.argmin(off, axis=1)
            knots = np.broadcast_to(self.knots, off.shape)
            rows = np.arange(r.size)
            return np.where(off[rows, at] <= near, knots[rows, at], np.nan)
        best, place = np.full(r.shape, near), np.full(r.shape, np.nan)
        after = np.searchsorted(shared, r, side="left")
        for knot in (after - 1, after):  # knots nearer to each other than that cannot be told apart anyway
            inside = np.clip(knot, 0, shared.size - 1)
            off = np.abs(r - shared[inside])
            left, right = self._slopes_at(inside)
            better = (left != right) & (off <= best)
            best, place = np.where(better, off, best), np.where(better, shared[inside], place)
        return place

    def derivative(self, r: Array) -> Array:
        """j'(r); at a kink, the one-sided derivative from the left."""
        r = np.asarray(r, dtype=float)
        return self.piece_derivative(self.piece_of(r), r)

    def curvature(self, r: Array) -> Array:
        """j''(r) of the piece that holds ``r``."""
        r = np.asarray(r, dtype=float)
        return self.piece_curvature(self.piece_of(r), r)

    def subdifferential(self, r: Array) -> Interval:
        """Clarke subdifferential dj(r), an interval for each point (empty, ``[inf, -inf]``, outside the domain)."""
        r = np.asarray(r, dtype=float)
        slope = self.derivative(r)
        shared = self._shared
        if shared is not None:
            near = np.minimum(np.searchsorted(shared, r, side="left"), shared.size - 1)
            here = (shared.take(near) == r) & np.isfinite(r)
            left, right = self._slopes_at(near)
            low, high = np.where(here, np.minimum(left, right), slope), np.where(here, np.maximum(left, right), slope)
            ends = self.domain
            outside = (r < ends.lower) | (r > ends.upper)
            return Interval(np.where(outside, np.inf, low), np.where(outside, -np.inf, high))
        left, right = self.knot_slopes()
        knots = self.knots
        at_knot = np.any(r[..., None] == knots, axis=-1)
        low, high = np.where(at_knot, np.inf, slope), np.where(at_knot, -np.inf, slope)
        for i in range(knots.shape[-1]):
            here = r == knots[..., i]
            low = np.where(here, np.minimum(low, np.minimum(left[..., i], right[..., i])), low)
            high = np.where(here, np.maximum(high, np.maximum(left[..., i], right[..., i])), high)
        bound = self.domain
        outside = (r < bound.lower) | (r > bound.upper)
        return Interval(np.where(outside, np.inf, low), np.where(outside, -np.inf, high))

    def distance(self, r: Array, lam: Array) -> Array:
        """Distance of the multiplier ``lam`` to dj(r); inf outside the domain."""
        return self.subdifferential(r).distance(np.asarray(lam, dtype=float))

    def graph_distance(self, r: Array, lam: Array, tau: Array | float) -> Array:
        """How far ``(r, lam)`` is from a pair that satisfies the law exactly, in units of ``lam``.

        The smallest over r' in {r, knots} of ``hypot(r - r', tau * dist(lam, dj(r'))) / tau``, an upper bound of
        the distance to the graph of dj in the norm in which ``tau`` makes displacement and multiplier alike.  It is
        a backward error: zero exactly on the graph, and small when r misses a kink by rounding only.
        """
        r = np.asarray(r, dtype=float)
        lam = np.asarray(lam, dtype=float)
        tau = np.asarray(tau, dtype=float)
        best = self.distance(r, lam)
        shared = self._shared
        if shared is not None:
            return self._nearest_of_many(shared, r, lam, tau, best)
        left, right = self.knot_slopes()
        knots = self.knots
        for i in range(knots.shape[-1]):
            low, high = np.minimum(left[..., i], right[..., i]), np.maximum(left[..., i], right[..., i])
            off = np.maximum(np.maximum(low - lam, lam - high), 0.0)
            best = np.minimum(best, np.hypot((r - knots[..., i]) / tau, off))
        return best

    def _nearest_of_many(self, shared: Array, r: Array, lam: Array, tau: Array, best: Array) -> Array:
        """:meth:`graph_distance`, from the knots nearest to r outwards until the next one is farther than the best."""
        r, lam, tau, best = np.broadcast_arrays(r, lam, tau, best)
        out, place = best.ravel().copy(), np.searchsorted(shared, r.ravel(), side="left")
        r, lam, tau = r.ravel(), lam.ravel(), tau.ravel()
        rows = None if self.knots.shape[0] == 1 else np.arange(r.size)
        for step in (-1, 1):
            first = place - 1 if step < 0 else place
            open_, done, width = np.arange(r.size), 0, 4
            while True:
                knot = first[open_, None] + step * np.arange(done, done + width)
                valid = (knot >= 0) & (knot < shared.size)
                knot = np.clip(knot, 0, shared.size - 1)
                law = self if rows is None else self.take(np.repeat(rows[open_], width))
                left, right = (s.reshape(knot.shape) for s in law._slopes_at(knot.ravel()))
                off = np.maximum(
                    np.maximum(np.minimum(left, right) - lam[open_, None], 0.0),
                    lam[open_, None] - np.maximum(left, right),
                )
                apart = (r[open_, None] - shared[knot]) / tau[open_, None]
                found = np.where(valid, np.hypot(apart, off), np.inf).min(axis=1)
                out[open_] = np.minimum(out[open_], found)
                going = valid[:, -1] & (np.abs(apart[:, -1]) < out[open_])
                open_ = open_[going]
                if not open_.size:
                    break
                done += width
                width = int(min(2 * width, max(_AT_ONCE // open_.size, 1)))
        return out.reshape(best.shape)

    def local_minimisers(self, a: Array, b: Array) -> tuple[Array, Array]:
        """All local minimisers of ``a/2 r^2 - b r + j(r)``.

        Parameters
        ----------
        a, b : arrays (m,)
            Curvature ``a >= 0`` and force of the local problem.

        Returns
        -------
        points, energies : arrays (m, 2K + 1)
            Candidates (interior of each piece, then each knot) and their energies, +inf where a candidate is not
            a local minimiser.
        """
        a, b = np.broadcast_arrays(np.asarray(a, dtype=float), np.asarray(b, dtype=float))
        knots = self.knots
        count = knots.shape[-1]
        shape = np.broadcast_shapes(a.shape, knots.shape[:-1])
        a, b = np.broadcast_to(a, shape), np.broadcast_to(b, shape)
        finite = np.isfinite(knots)
        at = np.where(finite, knots, 0.0)
        left, right = self.knot_slopes()
        residual = a[..., None] * at - b[..., None]
        psi_left = np.where(finite, residual + left, np.inf)
        psi_right = np.where(finite, residual + right, np.inf)
        points = np.empty((*shape, 2 * count + 1))
        energies = np.full((*shape, 2 * count + 1), np.inf)
        for i in range(count + 1):
            piece = np.full(shape, i, dtype=np.int64)
            low, high = self.piece_bounds(piece)
            start = psi_right[..., i - 1] if i > 0 else np.full(shape, -np.inf)
            end = psi_left[..., i] if i < count else np.full(shape, np.inf)
            low, high, start, end = self._convex_part(piece, a, b, low, high, start, end)
            admissible = (low < high) & (start < 0.0) & (end > 0.0)
            root, found = self._stationary_point(piece, a, b, low, high, admissible)
            points[..., i] = np.where(found, root, 0.0)
            with np.errstate(invalid="ignore", over="ignore"):
                energy = 0.5 * a * root**2 - b * root + self.piece_value(piece, root)
            energies[..., i] = np.where(found, energy, np.inf)
        for i in range(count):
            valid = finite[..., i] & (psi_left[..., i] <= 0.0) & (psi_right[..., i] >= 0.0)
            t = np.broadcast_to(at[..., i], shape)
            for psi, side in ((psi_left[..., i], i), (psi_right[..., i], i + 1)):
                if np.any(flat := valid & (psi == 0.0)):  # stationary from this side: it must not bend down
                    curvature = self.piece_curvature(np.full(shape, side, dtype=np.int64), t)
                    valid = valid & ~(flat & (a + curvature < 0.0))
            points[..., count + 1 + i] = t
            energies[..., count + 1 + i] = np.where(valid, 0.5 * a * t**2 - b * t + self.value(t), np.inf)
        return points, energies

    def _convex_part(
        self, piece: IntArray, a: Array, b: Array, low: Array, high: Array, start: Array, end: Array
    ) -> tuple[Array, Array, Array, Array]:
        """The part of each piece on which ``a r - b + j'(r)`` increases, and its values at the ends.

        As j'' is monotone on a piece, this is the piece, or what lies on one side of a point, or nothing (then
        ``low == high``).
        """
        with np.errstate(all="ignore"):
            size = _FAR * (1.0 + np.abs(b) / np.maximum(a, 1e-12))
            first = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0) - size)
            last = np.where(np.isfinite(high), high, np.where(np.isfinite(low), low, 0.0) + size)
            bends_first = a + self.piece_curvature(piece, first) < 0.0
            bends_last = a + self.piece_curvature(piece, last) < 0.0
            if not np.any(bends_first | bends_last):
                return low, high, start, end
            concave, convex = np.where(bends_first, first, last), np.where(bends_first, last, first)
            mixed = bends_first != bends_last
            for _ in range(1100):
                middle = 0.5 * (concave + convex)
                if np.all((middle == concave) | (middle == convex) | ~mixed):
                    break
                bends = a + self.piece_curvature(piece, middle) < 0.0
                concave, convex = np.where(bends, middle, concave), np.where(bends, convex, middle)
            psi = a * convex - b + self.piece_derivative(piece, convex)
        from_left, from_right = mixed & bends_first, mixed & bends_last
        low, start = np.where(from_left, convex, low), np.where(from_left, psi, start)
        high, end = np.where(from_right, convex, high), np.where(from_right, psi, end)
        return low, np.where(bends_first & bends_last, low, high), start, end

    def local_argmin(self, a: Array, b: Array) -> Array:
        """Global minimiser of ``a/2 r^2 - b r + j(r)``; nan where the energy has no minimum."""
        if self._many:
            return self._argmin_of_many(np.asarray(a, dtype=float), np.asarray(b, dtype=float))
        if self._convex:
            return self._convex_argmin(np.asarray(a, dtype=float), np.asarray(b, dtype=float))
        points, energies = self.local_minimisers(a, b)
        best = np.argmin(energies, axis=-1)[..., None]
        r = np.take_along_axis(points, best, axis=-1)[..., 0]
        lowest = np.take_along_axis(energies, best, axis=-1)[..., 0]
        return np.where(np.isfinite(lowest), r, np.nan)

    def coercive_against(self, a: Array | float) -> BoolArray:
        """Whether ``a/2 r^2 - b r + j(r)`` is bounded below for every b, given the curvature ``a >= 0`` (m,).

        With ``a = inf`` it always is; a law that answers with False at some point needs a stiffer body.
        """
        a = np.asarray(a, dtype=float)
        outward = np.minimum(self.asymptotic_curvature(1.0), self.asymptotic_curvature(-1.0))
        return np.asarray(a + outward > 0.0)

    def describe(self, point: int = 0) -> LawDescription:
        """Formula, kinks and constants of the law at one contact point."""
        law = self.take(np.array([point]))
        knots = law.knots[0]
        left, right = (side[0] for side in law.knot_slopes())
        places = [i for i in range(knots.size) if np.isfinite(knots[i])]
        kinks = tuple(LawKink(float(knots[i]), float(left[i]), float(right[i])) for i in places if left[i] != right[i])
        lower, upper = float(law.domain.lower.ravel()[0]), float(law.domain.upper.ravel()[0])
        alpha = float(law.weak_convexity[0])
        falls = tuple(kink.place for kink in kinks if kink.jump < 0.0)
        pieces: list[tuple[str, float, float]] = []
        steepest, where = 0.0, None
        for i in range(len(places) + 1):
            piece = np.array([i])
            low, high = (float(end[0]) for end in law.piece_bounds(piece))
            if low >= high:
                continue
            for r in (low, high):
                with np.errstate(all="ignore"):
                    curvature = float(law.piece_curvature(piece, np.array([np.clip(r, -_FAR, _FAR)]))[0])
                if curvature < steepest:
                    steepest, where = curvature, (low if np.isfinite(low) else high) if not np.isfinite(r) else r
            formula = law.piece_formula(i)
            if formula and pieces and pieces[-1][0] == formula and left[i - 1] == right[i - 1]:
                pieces[-1] = (formula, pieces[-1][1], high)
            elif formula:
                pieces.append((formula, low, high))
        c0, c1 = (float(np.atleast_1d(c)[0]) for c in law.growth)
        rates = [float(np.atleast_1d(law.recession(np.array([sign])))[0]) for sign in (-1.0, 1.0)]
        rates = [rate + 0.0 for rate in rates]
        outward = min(float(np.atleast_1d(law.asymptotic_curvature(sign))[0]) for sign in (-1.0, 1.0))
        return LawDescription(
            name=law.name,
            pieces=tuple(_piece_line(*piece) for piece in pieces),
            domain=(lower, upper),
            knots=tuple(float(knots[i]) for i in places),
            kinks=kinks,
            alpha=alpha,
            alpha_places=falls if falls else () if where is None else (float(where),),
            c0=c0,
            c1=c1,
            recession=(rates[0], rates[1]),
            coercive_above=max(0.0, -outward),
            alpha_sampled=law.alpha_sampled,
            growth_sampled=law.growth_sampled,
        )

    @cached_property
    def _convex(self) -> bool:
        return bool((self.weak_convexity == 0.0).all())

    def _argmin_of_many(self, a: Array, b: Array) -> Array:
        """The minimiser where all points share many knots: by bisection where a exceeds alpha, else piece by piece."""
        a, b = np.broadcast_arrays(a, b)
        shape, a, b = a.shape, a.ravel(), b.ravel()
        out = np.empty(a.size)
        monotone = np.broadcast_to((a > self.weak_convexity) | (self.weak_convexity == 0.0), a.shape)
        rows = np.arange(a.size)
        for index in (rows[monotone], rows[~monotone]):
            if not index.size:
                continue
            law = self if self.knots.shape[0] == 1 else self.take(index)
            if monotone[index[0]]:
                out[index] = law._bisected(a[index], b[index])
                continue
            size = max(1, _AT_ONCE // law.knots.shape[-1])
            for start in range(0, index.size, size):
                some = index[start : start + size]
                part = self if self.knots.shape[0] == 1 else self.take(some)
                out[some] = part._lowest_of_many(a[some], b[some])
        return out.reshape(shape)

    def _bisected(self, a: Array, b: Array) -> Array:
        """The minimiser where ``a r + j'(r)`` grows: the number of knots passed, by bisection."""
        knots = self._shared
        assert knots is not None
        count = knots.size
        found = []
        for side in (1, 0):  # knots with b above the right slope; knots with b not below the left one
            low, high = np.full(a.shape, -1), np.full(a.shape, count)
            while np.any(high - low > 1):
                middle = np.clip((low + high) // 2, 0, count - 1)
                force = a * np.where(np.isfinite(knots[middle]), knots[middle], np.inf) + self._slopes_at(middle)[side]
                passed = (b > force) if side else (b >= force)
                passed = passed & (high - low > 1)
                low, high = np.where(passed, middle, low), np.where(passed | (high - low <= 1), high, middle)
            found.append(low + 1)
        piece, reached = found
        held = piece < reached
        lower, upper = self.piece_bounds(piece)
        inside, ok = self._stationary_point(piece, a, b, lower, upper, ~held & (lower < upper))
        at_knot = knots[np.minimum(piece, count - 1)]
        return np.where(held, at_knot, np.where(ok, inside, np.nan))

    def _lowest_of_many(self, a: Array, b: Array) -> Array:
        """The lowest of all local minimisers: every piece and knot that can hold one, for all points at once."""
        knots = self._shared
        assert knots is not None
        m = a.size
        left, right = self.knot_slopes()
        finite = np.isfinite(knots)
        at = a[:, None] * np.where(finite, knots, 0.0)
        below, above = np.where(finite, at + left, np.inf), np.where(finite, at + right, np.inf)  # forces at the knots
        passed, ahead = b[:, None] > above, b[:, None] < below
        candidate = np.ones((m, knots.size + 1), dtype=bool)
        if self._straight:
            candidate[:, 1:] = passed
            candidate[:, :-1] &= ahead
        row, piece = np.nonzero(candidate)
        start = np.where(piece > 0, above[row, np.maximum(piece - 1, 0)] - b[row], -np.inf)
        end = np.where(piece < knots.size, below[row, np.minimum(piece, knots.size - 1)] - b[row], np.inf)
        law = self if self.knots.shape[0] == 1 else self.take(row)
        low, high = law.piece_bounds(piece)
        low, high, first, last = law._convex_part(piece, a[row], b[row], low, high, start, end)
        keep = (low < high) & (first < 0.0) & (last > 0.0)
        law = law if law.knots.shape[0] == 1 else law.take(np.flatnonzero(keep))
        row, piece, low, high = row[keep], piece[keep], low[keep], high[keep]
        root, found = law._stationary_point(piece, a[row], b[row], low, high, np.ones(row.size, dtype=bool))
        with np.errstate(invalid="ignore", over="ignore"):
            energy = 0.5 * a[row] * root**2 - b[row] * root + law.piece_value(piece, root)
        places, rows, energies = [root], [row], [np.where(found, energy, np.inf)]
        row, knot = np.nonzero(~(passed | ahead) & finite)
        law = self if self.knots.shape[0] == 1 else self.take(row)
        t = knots[knot]
        valid = np.ones(row.size, dtype=bool)
        for force, side in ((below[row, knot], knot), (above[row, knot], knot + 1)):
            valid &= ~((force == b[row]) & (a[row] + law.piece_curvature(side, t) < 0.0))
        places.append(t)
        rows.append(row)
        energies.append(np.where(valid, 0.5 * a[row] * t**2 - b[row] * t + law.value(t), np.inf))
        place, row, energy = np.concatenate(places), np.concatenate(rows), np.concatenate(energies)
        order = np.lexsort((energy, row))
        place, row, energy = place[order], row[order], energy[order]
        out = np.full(m, np.nan)
        first_of_row = np.concatenate([[True], row[1:] != row[:-1]]) if row.size else np.zeros(0, dtype=bool)
        chosen = first_of_row & np.isfinite(energy)
        out[row[chosen]] = place[chosen]
        return out

    @property
    def _straight(self) -> bool:
        """Whether j' is straight on every piece."""
        return False

    def _convex_argmin(self, a: Array, b: Array) -> Array:
        """The minimiser for a convex law: the force b grows with it, so counting the knots passed finds its piece."""
        knots = self.knots
        finite = np.isfinite(knots)
        at_knots = a[..., None] * np.where(finite, knots, 0.0)
        low, high = self.knot_slopes()
        passed = np.sum((b[..., None] > at_knots + high) & finite, axis=-1)
        held = passed < np.sum((b[..., None] >= at_knots + low) & finite, axis=-1)
        a, b = np.broadcast_to(a, passed.shape), np.broadcast_to(b, passed.shape)
        lower, upper = self.piece_bounds(passed)
        inside, found = self._stationary_point(passed, a, b, lower, upper, ~held & (lower < upper))
        table = np.broadcast_to(knots, (*passed.shape, knots.shape[-1]))
        at_knot = np.take_along_axis(table, np.minimum(passed, knots.shape[-1] - 1)[..., None], axis=-1)[..., 0]
        return np.where(held, at_knot, np.where(found, inside, np.nan))

    def prox(self, x: Array, tau: Array | float) -> Array:
        """Proximal map: the global minimiser of ``j(r) + (r - x)^2/(2 tau)``."""
        x = np.asarray(x, dtype=float)
        return self.local_argmin(np.broadcast_to(1.0 / np.asarray(tau, dtype=float), x.shape), x / tau)

    def prox_slope(self, x: Array, tau: Array | float) -> Array:
        """Derivative of :meth:`prox` in ``x``: 0 at a kink, ``1/(1 + tau j'')`` elsewhere."""
        r = self.prox(x, tau)
        slope = 1.0 / (1.0 + np.asarray(tau, dtype=float) * self.curvature(r))
        return np.where(self.at_kink(r), 0.0, slope)

    def _stationary_point(
        self, piece: IntArray, a: Array, b: Array, low: Array, high: Array, admissible: BoolArray
    ) -> tuple[Array, BoolArray]:
        """Zero of ``a r - b + j'(r)`` inside each piece, where it changes sign from minus to plus.

        Safeguarded Newton iteration: every step stays inside a bracket that at least halves in two steps.
        """
        shape = np.broadcast_shapes(a.shape, low.shape)
        step = np.maximum(np.maximum(np.abs(b), 1e-300) / np.maximum(a, 1e-300), 1e-300)
        low = np.broadcast_to(low, shape).copy()
        high = np.broadcast_to(high, shape).copy()
        admissible = np.broadcast_to(admissible, shape).copy()
        step = np.where(np.isfinite(step), step, 1.0)

        def psi(r: Array) -> Array:
            return a * r - b + self.piece_derivative(piece, r)

        anchor_low = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0))
        anchor_high = np.where(np.isfinite(high), high, np.where(np.isfinite(low), low, 0.0))
        with np.errstate(over="ignore", invalid="ignore"):
            for endless, anchor, sign in (
                (~np.isfinite(low), anchor_high, -1.0),
                (~np.isfinite(high), anchor_low, 1.0),
            ):
                at_anchor = np.abs(psi(anchor)) / np.maximum(a, 1e-300)
                end = anchor + sign * np.maximum(step, np.where(np.isfinite(at_anchor), at_anchor, 0.0))
                end = np.where(end == anchor, anchor + sign * np.maximum(np.abs(anchor), 1e-300) * 1e-15, end)
                for _ in range(200):
                    open_end = endless & admissible & ~(sign * psi(end) > 0.0)
                    if not open_end.any():
                        break
                    end = np.where(open_end, anchor + 4.0 * (end - anchor), end)
                admissible &= ~(endless & (open_end | ~np.isfinite(end)))
                if sign < 0:
                    low = np.where(endless, end, low)
                else:
                    high = np.where(endless, end, high)
            low = np.where(admissible, low, 0.0)
            high = np.where(admissible, high, 0.0)
            r = 0.5 * (low + high)
            for _ in range(200):
                f = psi(r)
                low = np.where(f < 0.0, r, low)
                high = np.where(f > 0.0, r, high)
                slope = a + self.piece_curvature(piece, r)
                newton = r - f / np.where(slope > 0.0, slope, 1.0)
                inside = (slope > 0.0) & (newton > low) & (newton < high)
                new = np.where(f == 0.0, r, np.where(inside, newton, 0.5 * (low + high)))
                done = np.abs(new - r) <= 4e-16 * np.maximum(np.abs(new), np.abs(r))
                r = new
                if np.all(done | ~admissible):
                    break
        return r, admissible & np.isfinite(r)


def _piece_line(formula: str, low: float, high: float) -> str:
    ends = (f"{low:.6g} < " if np.isfinite(low) else "", f" < {high:.6g}" if np.isfinite(high) else "")
    return f"j'(r) = {formula}" + (f"   for {ends[0]}r{ends[1]}" if any(ends) else "")
