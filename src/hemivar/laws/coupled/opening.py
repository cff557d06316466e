"""The local problem of a mixed-mode law that opens: all its minimisers, from roots that are bracketed on each piece.

Minimise ``a_n/2 w^2 + a_t/2 |s|^2 - c w - b.s + Phi(rho)`` with ``rho^2 = w^2 + beta^2 |s|^2`` and c > 0.  The slip
lies along b; with ``m = Phi'(rho)/rho``

    w = c / (a_n + m),    s = b / (a_t + beta^2 m),

so that rho falls with m, and the energy at a given rho has one minimum.  On a piece ``Phi' = p + q rho`` a critical
point is a zero of ``u(m) = (m - q) rho(m) - p``, a minimum where u rises.  The derivative of u has the sign of
``c^2 A/(a + m)^3 + b^2 B/(b + m)^3``, which changes once, at a place known in closed form: on either side of it u is
monotone and its zero is bracketed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, IntArray

__all__ = ["OpeningProblem"]

#: Steps of Newton's method, at most: its iterates rise to the root; and of the bracketed one.
_SECULAR, _BRACKETED = 100, 120


@dataclass(frozen=True, eq=False)
class OpeningProblem:
    """Local problems in ``w`` and ``sigma = beta s``, so that ``rho^2 = w^2 + sigma^2``.

    Attributes
    ----------
    stiffness : array (n, 2)
        a_n and a_t/beta^2, at least 0.
    force : array (n, 2)
        c > 0 and |b|/beta.
    knots, tractions : arrays (n, K)
        rho at the ends of the pieces, and Phi' there; the last one is 0.
    slopes : array (n, K + 1)
        Phi'' on the pieces, the last one 0.
    """

    stiffness: Array
    force: Array
    knots: Array
    tractions: Array
    slopes: Array

    def rho(self, m: Array) -> Array:
        """rho of secants ``m (n, ...)``."""
        shape = (-1,) + (1,) * (m.ndim - 1)
        parts = []
        for a, c in zip(self.stiffness.T, self.force.T, strict=True):
            with np.errstate(divide="ignore", invalid="ignore"):
                part = c.reshape(shape) / (a.reshape(shape) + m)
            parts.append(np.where(c.reshape(shape) > 0.0, part, 0.0))
        return np.asarray(np.hypot(*parts))

    def places(self, m: Array) -> Array:
        """w and sigma (n, k, 2) of secants (n, k)."""
        with np.errstate(divide="ignore", invalid="ignore"):
            found = self.force[:, None, :] / (self.stiffness[:, None, :] + m[:, :, None])
        return np.where(self.force[:, None, :] > 0.0, found, 0.0)

    def secant(self, rho: Array) -> Array:
        """m >= 0 of ``rho (n, k)``; 0 where rho is beyond that of m = 0."""
        m, target = np.zeros(rho.shape), 1.0 / rho
        for _ in range(_SECULAR):
            now, w, s = self._both(m)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                # 1/rho(m) is concave: Newton's iterates from the left rise to the root
                slope = (w**2 / (self.stiffness[:, :1] + m) + s**2 / (self.stiffness[:, 1:] + m)) / now**3
                step = (target - 1.0 / now) / slope
            step = np.where(np.isfinite(now), np.maximum(np.nan_to_num(step), 0.0), self._scale)
            m = m + step
            if (step <= 4.0 * np.finfo(float).eps * m).all():
                break
        return np.where(self.rho(np.zeros(rho.shape)) > rho, m, 0.0)

    @property
    def _scale(self) -> Array:
        """A secant at which no component is loose, (n, 1)."""
        return np.asarray(1e-8 * (self.force.max(axis=1) / self.knots[:, -1])[:, None])

    def _both(self, m: Array) -> tuple[Array, Array, Array]:
        place = self.places(m)
        return np.hypot(place[..., 0], place[..., 1]), place[..., 0], place[..., 1]

    def minimisers(self) -> Array:
        """Secants (n, 2 K) of the local minimisers, nan where there is none: for every piece one or two places."""
        n, count = self.knots.shape
        ends = self.secant(self.knots)
        free = self.rho(np.zeros((n, 1)))
        reached = np.where(free > self.knots, self.knots, free)
        traction = np.where(free > self.knots, self.tractions, self._traction(reached))
        with np.errstate(invalid="ignore"):
            at = np.where(ends > 0.0, ends * reached, 0.0) - traction  # u at the ends of the pieces
        found = np.full((n, 2 * count), np.nan)
        found[:, 0] = np.where(at[:, 0] <= 0.0, self.slopes[:, 0], np.nan)  # on the first piece m = q
        found[:, -1] = np.where((free >= self.knots[:, -1:]).ravel(), 0.0, np.nan)  # it has let go
        if count == 1:
            return found
        low, high, q = ends[:, 1:], ends[:, :-1], self.slopes[:, 1:-1]
        p = self.tractions[:, :-1] - q * self.knots[:, :-1]
        turn = np.clip(np.nan_to_num(self._turn(q)), low, high)
        middle = (turn - q) * self.rho(turn) - p
        middle = np.where(turn <= low, at[:, 1:], np.where(turn >= high, at[:, :-1], middle))
        for k, (left, right, before, after) in enumerate(
            ((low, turn, at[:, 1:], middle), (turn, high, middle, at[:, :-1]))
        ):
            rows, piece = np.nonzero((left < right) & (before <= 0.0) & (after > 0.0))
            if rows.size:
                own = (part[rows, piece] for part in (left, right, q, p))
                found[rows, 2 * piece + 1 + k] = self._roots(rows, *own)
        return found

    def _traction(self, rho: Array) -> Array:
        """Phi' at ``rho (n, k)``, finite or not."""
        out = np.zeros(rho.shape)
        for i in range(self.knots.shape[1] - 1, -1, -1):
            start = self.knots[:, i - 1 : i] if i else 0.0
            base = self.tractions[:, i - 1 : i] if i else 0.0
            inside = rho <= self.knots[:, i : i + 1]
            out = np.where(inside, base + self.slopes[:, i : i + 1] * (np.where(inside, rho, 0.0) - start), out)
        return out

    def _turn(self, q: Array) -> Array:
        """Where u turns on pieces of these slopes (n, k); nan where it does not."""
        (a, b), (c, t) = self.stiffness.T[:, :, None], self.force.T[:, :, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = -(t**2) * (b + q) / (c**2 * (a + q))
            root = np.cbrt(ratio)
            return np.where(ratio > 0.0, (root * a - b) / (1.0 - root), np.nan)

    def _roots(self, rows: IntArray, low: Array, high: Array, q: Array, p: Array) -> Array:
        """The zeros of u between ``low`` and ``high``, where it rises, of some problems; (k,) all."""
        (a, b), (c, t) = self.stiffness[rows].T, self.force[rows].T

        def value(m: Array) -> tuple[Array, Array]:
            with np.errstate(divide="ignore", invalid="ignore"):
                slip = np.where(t > 0.0, t / (b + m), 0.0)
                now = np.hypot(c / (a + m), slip)
                rate = c**2 * (a + q) / (a + m) ** 3 + np.where(t > 0.0, slip**2 * (b + q) / (b + m), 0.0)
                return (m - q) * now - p, rate / now

        return _bracketed(value, low, high)


def _bracketed(value: Callable[[Array], tuple[Array, Array]], low: Array, high: Array) -> Array:
    """Zeros of rising functions between ``low`` and ``high`` by Newton's method, halved where it leaves the bracket."""
    low, high = low.copy(), high.copy()
    m = 0.5 * (low + high)
    for _ in range(_BRACKETED):
        u, rate = value(m)
        low, high = np.where(u <= 0.0, m, low), np.where(u <= 0.0, high, m)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = m - u / rate
        new = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        done = (np.abs(new - m) <= 2.0 * np.finfo(float).eps * np.abs(m)) | (u == 0.0)
        m = np.where(u == 0.0, m, new)
        if done.all():
            break
    return m
