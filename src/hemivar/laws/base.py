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
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hemivar._typing import Array, BoolArray, IntArray

__all__ = ["Interval", "Superpotential"]


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


class Superpotential(ABC):
    """A scalar law j, one for each contact point.

    Pieces are numbered 0..K: piece ``i`` lies between knot ``i - 1`` and knot ``i`` (the first and the last one
    are unbounded, or outside the domain).  Outside ``[lower, upper]`` the value is +inf.
    """

    #: Short name used in messages, files and tables.
    name: str = "law"

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

    # ---- what follows --------------------------------------------------------------------------------

    def piece_of(self, r: Array) -> IntArray:
        """Index of the piece that holds each ``r``; at a knot, the piece to its left."""
        r = np.asarray(r, dtype=float)
        return np.asarray(np.sum(r[..., None] > self.knots, axis=-1), dtype=np.int64)

    def piece_bounds(self, piece: IntArray) -> tuple[Array, Array]:
        """End points of each piece, cut at the domain."""
        piece = np.asarray(piece)
        knots = self.knots
        padded = np.concatenate(
            [np.full((*knots.shape[:-1], 1), -np.inf), knots, np.full((*knots.shape[:-1], 1), np.inf)],
            axis=-1,
        )
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
        return np.asarray(np.any((r[..., None] == self.knots) & self.kinks(), axis=-1))

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
        left, right = self.knot_slopes()
        knots = self.knots
        for i in range(knots.shape[-1]):
            low, high = np.minimum(left[..., i], right[..., i]), np.maximum(left[..., i], right[..., i])
            off = np.maximum(np.maximum(low - lam, lam - high), 0.0)
            best = np.minimum(best, np.hypot((r - knots[..., i]) / tau, off))
        return best

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
            admissible = (low < high) & (start < 0.0) & (end > 0.0)
            root, found = self._stationary_point(piece, a, b, low, high, admissible)
            points[..., i] = np.where(found, root, 0.0)
            with np.errstate(invalid="ignore", over="ignore"):
                energy = 0.5 * a * root**2 - b * root + self.piece_value(piece, root)
            energies[..., i] = np.where(found, energy, np.inf)
        for i in range(count):
            valid = finite[..., i] & (psi_left[..., i] <= 0.0) & (psi_right[..., i] >= 0.0)
            t = np.broadcast_to(at[..., i], shape)
            points[..., count + 1 + i] = t
            energies[..., count + 1 + i] = np.where(valid, 0.5 * a * t**2 - b * t + self.value(t), np.inf)
        return points, energies

    def local_argmin(self, a: Array, b: Array) -> Array:
        """Global minimiser of ``a/2 r^2 - b r + j(r)``; nan where the energy has no minimum."""
        if self._convex:
            return self._convex_argmin(np.asarray(a, dtype=float), np.asarray(b, dtype=float))
        points, energies = self.local_minimisers(a, b)
        best = np.argmin(energies, axis=-1)[..., None]
        r = np.take_along_axis(points, best, axis=-1)[..., 0]
        lowest = np.take_along_axis(energies, best, axis=-1)[..., 0]
        return np.where(np.isfinite(lowest), r, np.nan)

    @cached_property
    def _convex(self) -> bool:
        return bool((self.weak_convexity == 0.0).all())

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
                end = anchor + sign * step
                for _ in range(200):
                    open_end = endless & admissible & ~(sign * psi(end) > 0.0)
                    if not open_end.any():
                        break
                    end = np.where(open_end, anchor + 4.0 * (end - anchor), end)
                admissible &= ~(endless & ~np.isfinite(end))
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
