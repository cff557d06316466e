"""A law of opening and slip together with friction of a slip increment beside it: ``j(r) = base(r) + h |s - s_0|``.

The base has no direction of its own along the surface, so its slip points along the pull on it.  A local problem ``min
a/2 |r|^2 - b.r + j(r)`` then has one unknown: with ``y = m s`` the pull that friction leaves to the base, m between a
and a plus the stiffness of the base,

    s - s_0 = <|b - m s_0| - h>/m  along  b - m s_0,        |s| = the slip of the base under the pull m |s|.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.coupled.shifted import LawBeside
from hemivar.laws.vector_law import Linearisation, OnGraph, VectorLaw, lengths, polar, spread

__all__ = ["FrictionBeside"]

#: Part of a slip, and of a stiffness, that is rounding.
_ROUNDED = 4.0 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class FrictionBeside(LawBeside):
    """A coupled law with resolved parameters, and friction of at most ``bound`` of the slip from ``start`` on.

    The base depends on no state, and on the length of the slip alone.
    """

    base: VectorLaw
    bound: Array  # h >= 0, force per area, (m or 1,)
    start: Array  # s_0, from which the increment counts, (m or 1, c - 1 or 1)
    name: ClassVar[str] = "glue with friction"  # type: ignore[misc]

    @property
    def not_separable(self) -> str:
        return self.base.not_separable

    @property
    def beside(self) -> Array:
        return self.bound

    def take(self, index: IntArray) -> FrictionBeside:
        bound, start = (part if len(part) == 1 else part[index] for part in (self.bound, self.start))
        return FrictionBeside(self.base.take(index), bound, start)

    # ---- the friction -----------------------------------------------------------------------------------

    def _slid(self, r: Array) -> Array:
        """Slip increment (m, c - 1)."""
        return np.asarray(r[:, 1:] - self.start)

    def _most(self, r: Array) -> Array:
        """The bound at all points, (m,)."""
        return np.broadcast_to(self.bound, (len(r),))

    def _sticks(self, r: Array) -> BoolArray:
        """Points (m,) at which friction sticks."""
        return np.asarray((self._most(r) > 0.0) & ~self._slid(r).any(axis=1))

    def slide(self, r: Array) -> Array:
        """Friction (m, c) of points that slip; zero in the normal component, and where they stick."""
        out, (size, heading) = np.zeros(r.shape), polar(self._slid(r))
        out[:, 1:] = np.where(size > 0.0, self._most(r), 0.0)[:, None] * heading
        return out

    def _friction(self, r: Array, lam: Array) -> Array:
        """The part of a multiplier that is friction, (m, c)."""
        size, heading = polar(lam[:, 1:] - self.base.nearest_multiplier(r, lam)[:, 1:])
        out = self.slide(r)
        rest = np.minimum(size, self._most(r))[:, None] * heading
        out[:, 1:] = np.where(self._sticks(r)[:, None], rest, out[:, 1:])
        return out

    def _bend(self, r: Array) -> Array:
        """Second derivative (m, c, c) of the friction of points that slip."""
        m, c = r.shape
        size, heading = polar(self._slid(r))
        out = np.zeros((m, c, c))
        across = np.eye(c - 1) - heading[:, :, None] * heading[:, None, :]
        slope = np.where(size > 0.0, self._most(r) / np.where(size > 0.0, size, 1.0), 0.0)
        out[:, 1:, 1:] = slope[:, None, None] * across
        return out

    # ---- value and subdifferential ----------------------------------------------------------------------

    def value(self, r: Array) -> Array:
        rubbed = self._most(r) * (lengths(self._slid(r)) - lengths(np.broadcast_to(self.start, r[:, 1:].shape)))
        return np.asarray(self.base.value(r) + rubbed)

    def _at_start(self, r: Array) -> Array:
        """Points with their slip where it was, where there is friction, (m, c)."""
        out = r.copy()
        out[:, 1:] = np.where((self._most(r) > 0.0)[:, None], self.start, r[:, 1:])
        return out

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        friction = self._friction(r, lam)
        return np.asarray(self.base.nearest_multiplier(r, lam - friction) + friction)

    def clamp(self, start: Array, end: Array) -> Array:
        out = self.base.clamp(start, end)
        back = np.einsum("mi,mi->m", self._slid(start), self._slid(end)) <= 0.0
        return np.where(back[:, None], self._at_start(out), out)

    def linearise(self, r: Array) -> Linearisation:
        line, sticks = self.base.linearise(r), self._sticks(r)
        smooth = line.smooth.copy()
        smooth[:, 1] &= ~sticks
        gradient, hessian = line.gradient + self.slide(r), line.hessian + self._bend(r)
        gradient[sticks, 1:] = 0.0
        hessian[sticks, 1:, :] = hessian[sticks, :, 1:] = 0.0
        return Linearisation(smooth, gradient, hessian)

    # ---- the local problem ------------------------------------------------------------------------------

    def local_argmin(self, a: Array, b: Array) -> Array:
        left, sticks = self._solved(a, b)
        return self._stuck(self.base.local_argmin(a, left), sticks)

    def local_minimiser(self, a: Array, b: Array, r: Array) -> Array:
        left, sticks = self._solved(a, b)
        end = self._stuck(self.base.local_minimiser(a, left, r), sticks)
        return np.where((self._energy(a, b, end) <= self._energy(a, b, r))[:, None], end, r)

    def _stuck(self, r: Array, sticks: BoolArray) -> Array:
        r[:, 1:] = np.where(sticks[:, None], self.start, r[:, 1:])
        return r

    def _energy(self, a: Array, b: Array, r: Array) -> Array:
        return np.asarray((0.5 * spread(a, b.shape[1]) * r**2 - b * r).sum(axis=1) + self.value(r))

    def _solved(self, a: Array, b: Array) -> tuple[Array, BoolArray]:
        """What friction leaves of a force to the base, (m, c), and where it sticks, (m,)."""
        left, sticks = b.copy(), np.zeros(len(b), dtype=bool)
        rows = np.flatnonzero(self._most(b) > 0.0)
        if rows.size:
            problem = _Rubbed(self.take(rows) if len(b) > 1 else self, a[rows], b[rows])
            left[rows, 1:], sticks[rows] = problem.left(problem.secant())
        return left, sticks

    def on_graph(self, p: Array, a: Array) -> OnGraph:
        c = p.shape[1]
        left, sticks = self._solved(a, p)
        of_base = self.base.on_graph(left, a)
        r, P = self._stuck(of_base.r, sticks), of_base.jacobian
        moving = np.linalg.solve(np.eye(c) + P @ self._bend(r), P)
        stuck = P - P[:, :, 1:] @ np.linalg.pinv(P[:, 1:, 1:]) @ P[:, 1:, :]
        stuck[:, 1:, :] = stuck[:, :, 1:] = 0.0
        return OnGraph(r, p - spread(a, c) * r, np.where(sticks[:, None, None], stuck, moving))

    # ---- far away, and what is the base's -----------------------------------------------------------------

    def recession(self, direction: Array) -> Array:
        return np.asarray(self.base.recession(direction) + self.bound * lengths(direction[:, 1:]))

    def resistance(self, r: Array, lam: Array) -> Array:
        return np.asarray(self.base.resistance(r, lam) + self.bound)

    # ---- where a pair lies ------------------------------------------------------------------------------

    def kinks(self, r: Array) -> tuple[Array, Array]:
        normal, slip = self.base.kinks(r)
        return normal, np.where((self._most(r) > 0.0)[:, None], self.start, slip)


@dataclass(frozen=True, eq=False)
class _Rubbed:
    """Local problems of points with friction."""

    law: FrictionBeside
    a: Array
    b: Array

    def left(self, m: Array) -> tuple[Array, BoolArray]:
        """The pull (k, c - 1) that is left to the base if its secant is ``m (k,)``, and where friction sticks."""
        start = self.law.start
        size, heading = polar(self.b[:, 1:] - m[:, None] * start)
        beyond = np.maximum(size - self.law.bound, 0.0)
        return m[:, None] * start + beyond[:, None] * heading, np.asarray(beyond == 0.0)

    def _excess(self, m: Array) -> Array:
        """How much farther than the base goes under its pull the slip is, (k,), 0 by rounding; it falls with m."""
        pull, b = self.left(m)[0], self.b.copy()
        b[:, 1:] = pull
        slip = lengths(pull) / m
        excess = slip - lengths(self.law.base.local_argmin(self.a, b)[:, 1:])
        return np.where(np.abs(excess) <= _ROUNDED * slip, 0.0, excess)

    def secant(self) -> Array:
        """m, (k,): by the false position, in whose place every third step halves."""
        low = self.a[:, 1].copy()
        stiffness = np.abs(self.law.base.linearise(np.zeros(self.b.shape)).hessian[:, 1, 1])
        high = low + np.maximum(stiffness, low)
        above, below = self._excess(low), self._excess(high)
        for _ in range(60):
            if not (below > 0.0).any():
                break
            high = np.where(below > 0.0, 2.0 * high, high)
            below = self._excess(high)
        root = np.where(above == 0.0, low, high)
        open_: BoolArray = (above != 0.0) & (below != 0.0)
        for number in range(100):  # halving every third time, it is through before
            if not open_.any():
                break
            m = high + (high - low) * below / np.where(open_, above - below, 1.0)
            m = np.where((m > low) & (m < high) & (number % 3 < 2), m, np.sqrt(low * high))
            now = self._excess(m)
            root = np.where(open_, m, root)
            open_ &= (now != 0.0) & (high - low > _ROUNDED * high)
            low, above = np.where(now > 0.0, m, low), np.where(now > 0.0, now, above)
            high, below = np.where(now > 0.0, high, m), np.where(now > 0.0, below, now)
        return root
