"""The local problem of mixed-mode glue that opens: all minimisers, by a scalar (secular) equation for the secant.

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

from hemivar.basics.types import Array, BoolArray, IntArray

__all__ = ["OpeningProblem", "rising_roots"]


@dataclass(frozen=True, eq=False)
class OpeningProblem:
    """Local problems in ``w`` and ``sigma = beta s``, so that ``rho^2 = w^2 + sigma^2``."""

    stiffness: Array  # a_n and a_t/beta^2, (n, 2)
    force: Array  # c > 0 and |b|/beta, (n, 2)
    knots: Array  # rho at the ends of the pieces, (n, K)
    tractions: Array  # Phi' there; the last one is 0
    slopes: Array  # Phi'' on the pieces, (n, K + 1), the last one 0

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
            opening = self.force[:, None, :] / (self.stiffness[:, None, :] + m[:, :, None])
        return np.where(self.force[:, None, :] > 0.0, opening, 0.0)

    def secant(self, rho: Array) -> Array:
        """m >= 0 of ``rho (n, k)``; 0 where rho is beyond that of m = 0."""
        m, target = np.zeros(rho.shape), 1.0 / rho
        for _ in range(100):
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
        opening = self.places(m)
        return np.hypot(opening[..., 0], opening[..., 1]), opening[..., 0], opening[..., 1]

    def take(self, rows: IntArray) -> OpeningProblem:
        """Some of the problems, each as often as it is named."""
        return OpeningProblem(
            *(part[rows] for part in (self.stiffness, self.force, self.knots, self.tractions, self.slopes))
        )

    @property
    def _pulled(self) -> BoolArray:
        """Whether the force does not lead beyond each knot, (n, K): u <= 0 at its secant, or there is less force."""
        free = self.rho(np.zeros((len(self.knots), 1)))
        return np.asarray((free <= self.knots) | (self.rho(self.tractions / self.knots) <= self.knots))

    def only(self) -> Array:
        """Secants (n,) of the minimisers where each problem has one: its knots say on which piece it lies."""
        pulled, knots = self._pulled, self.knots
        piece = np.where(pulled.any(axis=1), np.argmax(pulled, axis=1), knots.shape[1])
        m = np.where(piece == 0, self.slopes[:, 0], 0.0)  # with no force left beyond the last knot
        rows = np.flatnonzero((piece > 0) & (piece < knots.shape[1]))
        if rows.size:
            k, q = piece[rows], self.slopes[rows, piece[rows]]
            before, traction = knots[rows, k - 1], self.tractions[rows, k - 1]
            ends = self.tractions[rows, k] / knots[rows, k], traction / before  # u rises from the less to the larger
            m[rows] = self._roots(rows, np.minimum(*ends), np.maximum(*ends), q, traction - q * before)
        return m

    def minimisers(self) -> Array:
        """Secants (n, k) of the local minimisers, nan where a problem has fewer than others."""
        knots, free, pulled = self.knots, self.rho(np.zeros((len(self.knots), 1))), self._pulled
        first = np.where(pulled[:, 0], self.slopes[:, 0], np.nan)  # on the first piece m = q
        last = np.where((free >= knots[:, -1:]).ravel(), 0.0, np.nan)  # it has let go
        turn = self._turn(self.slopes[:, 1:-1])
        with np.errstate(invalid="ignore", divide="ignore"):
            size = self.rho(turn)
            inside = (turn > 0.0) & (knots[:, :-1] < size) & (size < knots[:, 1:])
        rows, piece = np.nonzero((knots[:, :-1] < free) & (inside | (pulled[:, 1:] & ~pulled[:, :-1])))
        secants = [(np.arange(len(knots)), first), (np.arange(len(knots)), last)]
        if rows.size:
            secants += self._between(rows, piece, np.where(inside, turn, np.nan)[rows, piece], pulled)
        return _in_rows(len(knots), secants)

    def _between(self, rows: IntArray, piece: IntArray, turn: Array, pulled: BoolArray) -> list[tuple[IntArray, Array]]:
        """Problems and secants of the minimisers on some pieces, on which u turns at ``turn``, or does not (nan)."""
        ends = self.take(rows).secant(np.stack([self.knots[rows, piece + 1], self.knots[rows, piece]], axis=1))
        low, high, q = ends[:, 0], ends[:, 1], self.slopes[rows, piece + 1]
        p = self.tractions[rows, piece] - q * self.knots[rows, piece]
        below, above = pulled[rows, piece + 1], pulled[rows, piece]
        turns = (low < turn) & (turn < high)
        turn = np.where(turns, turn, low)
        middle = np.where(turns, (turn - q) * self.take(rows).rho(turn) - p <= 0.0, below)
        secants = []
        for left, right, before, after in ((low, turn, below, middle), (turn, high, middle, above)):
            at = np.flatnonzero((left < right) & before & ~after)
            secants.append((rows[at], self._roots(rows[at], left[at], right[at], q[at], p[at])))
        return secants

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

        def value(m: Array) -> tuple[Array, Array, Array]:
            with np.errstate(divide="ignore", invalid="ignore"):
                slip = np.where(t > 0.0, t / (b + m), 0.0)
                now = np.hypot(c / (a + m), slip)
                rate = c**2 * (a + q) / (a + m) ** 3 + np.where(t > 0.0, slip**2 * (b + q) / (b + m), 0.0)
                pulled = (m - q) * now
                return pulled - p, rate / now, np.abs(pulled) + np.abs(p)

        return rising_roots(value, low, high)


def rising_roots(value: Callable[[Array], tuple[Array, Array, Array]], low: Array, high: Array) -> Array:
    """Zeros of functions that rise through them, by Newton's method, halved where it leaves ``low`` to ``high``.

    ``value`` gives each function, its derivative and the size of the parts that it is the difference of.
    """
    eps = np.finfo(float).eps
    m = 0.5 * (low + high)
    for _ in range(120):  # halving alone is through after 64
        u, rate, size = value(m)
        low, high = np.where(u <= 0.0, m, low), np.where(u <= 0.0, high, m)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = m - u / rate
        new = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        done = (np.abs(new - m) <= 2.0 * eps * np.abs(m)) | (np.abs(u) <= 4.0 * eps * size)
        m = np.where(u == 0.0, m, new)
        if done.all():
            break
    return m


def _in_rows(count: int, parts: list[tuple[IntArray, Array]]) -> Array:
    """Numbers by the rows that they belong to, (count, k), nan where a row has fewer."""
    rows, numbers = (np.concatenate(pair) for pair in zip(*parts, strict=True))
    order = np.argsort(rows, kind="stable")
    rows, numbers = rows[order], numbers[order]
    column = np.arange(rows.size) - np.searchsorted(rows, rows)
    out = np.full((count, int(column.max(initial=-1)) + 1), np.nan)
    out[rows, column] = numbers
    return out
