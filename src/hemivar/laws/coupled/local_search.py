"""Local problems in penetration r and slip length s >= 0: projected Newton steps with an Armijo line search.

Minimise ``E = a_n/2 r^2 + a_t/2 s^2 - c r - b s + f(r, s)`` with b >= 0.  On either side of r = 0 and for s > 0 f is
smooth.  Each step goes along the Newton direction, of a matrix whose negative curvatures are turned round, is cut at
r = 0 where the derivative jumps there and at s = 0, and is halved until the energy falls.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, BoolArray, IntArray

__all__ = ["SearchedPotential", "descend"]

#: Part of the predicted fall that a step must reach, and roundings in an energy.
_ARMIJO, _ROUNDING = 1e-4, 64.0 * float(np.finfo(float).eps)


class SearchedPotential(Protocol):
    """What the search asks of a law: arrays of one shape; ``side`` is that of r = 0, -1 or 1."""

    @property
    def kinked(self) -> bool: ...
    @property
    def rigid(self) -> bool: ...
    def potential_at(self, r: Array, s: Array) -> Array: ...
    def slopes_at(self, r: Array, s: Array, side: Array) -> tuple[Array, Array]: ...
    def bends_at(self, r: Array, s: Array, side: Array) -> tuple[Array, Array, Array]: ...


@dataclass(frozen=True, eq=False)
class _Problems:
    law: SearchedPotential
    a: Array
    b: Array

    def take(self, rows: IntArray) -> _Problems:
        return _Problems(self.law, self.a[rows], self.b[rows])

    def energy(self, x: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.asarray((0.5 * self.a * x**2 - self.b * x).sum(axis=1) + self.law.potential_at(x[:, 0], x[:, 1]))

    def slope(self, x: Array, side: Array) -> Array:
        with np.errstate(all="ignore"):
            return self.a * x - self.b + np.stack(self.law.slopes_at(x[:, 0], x[:, 1], side), axis=1)

    def state(self, x: Array) -> tuple[Array, Array, BoolArray]:
        """Gradient (k, 2) with zeros where nothing moves, side of r = 0, and what is fixed, (k, 2)."""
        side = np.where(x[:, 0] > 0.0, 1.0, -1.0)
        g = self.slope(x, side)
        fixed = np.zeros(g.shape, dtype=bool)
        at = np.flatnonzero(x[:, 0] == 0.0)
        if at.size and (self.law.kinked or self.law.rigid):
            below = g[at, 0]
            above = np.full(at.size, np.inf) if self.law.rigid else self.take(at).slope(x[at], np.ones(at.size))[:, 0]
            up, down = above < 0.0, below > 0.0
            side[at] = np.where(up, 1.0, -1.0)
            g[at, 0] = np.where(up, above, np.where(down, below, 0.0))
            fixed[at, 0] = ~up & ~down
        elif at.size:
            side[at] = np.where(g[at, 0] < 0.0, 1.0, -1.0)
        fixed[:, 1] = (x[:, 1] == 0.0) & (g[:, 1] >= 0.0)
        return np.where(fixed, 0.0, g), side, fixed

    def direction(self, x: Array, g: Array, side: Array, fixed: BoolArray) -> Array:
        with np.errstate(all="ignore"):
            rr, rs, ss = self.law.bends_at(x[:, 0], x[:, 1], side)
            matrix = np.empty((len(x), 2, 2))
            matrix[:, 0, 0], matrix[:, 1, 1] = rr + self.a[:, 0], ss + self.a[:, 1]
            matrix[:, 0, 1] = matrix[:, 1, 0] = np.where(fixed.any(axis=1), 0.0, rs)
        matrix = np.where(np.isfinite(matrix), matrix, 0.0)
        # scaled to the diagonal, so that units of neither variable matter
        size = np.sqrt(np.maximum(np.abs(np.einsum("kii->ki", matrix)), ROUNDED * np.abs(self.a) + 1e-300))
        values, vectors = np.linalg.eigh(matrix / (size[:, :, None] * size[:, None, :]))
        values = np.maximum(np.abs(values), ROUNDED * np.abs(values).max(axis=1, keepdims=True) + 1e-300)
        along = np.einsum("kij,ki->kj", vectors, g / size) / values
        return np.where(fixed, 0.0, -np.einsum("kij,kj->ki", vectors, along) / size)


def _moved(law: SearchedPotential, x: Array, step: Array) -> Array:
    """``x + step``, cut at s = 0, and at r = 0 where the law is rigid or its derivative jumps there."""
    new = x + step
    if law.rigid:
        new[:, 0] = np.minimum(new[:, 0], 0.0)
    elif law.kinked:
        new[:, 0] = np.where(x[:, 0] * new[:, 0] < 0.0, 0.0, new[:, 0])
    new[:, 1] = np.maximum(new[:, 1], 0.0)
    return new


def descend(law: SearchedPotential, a: Array, b: Array, x: Array) -> Array:
    """Where the way downhill from ``x (k, 2)`` ends: a stationary point (k, 2) whose energy is not higher.

    Stiffnesses ``a (k, 2)`` of r and s, > 0, and forces ``b (k, 2)``, that of s at least 0.
    """
    x = np.array(x, dtype=float)
    going = np.arange(len(x))
    for _ in range(100):
        if not going.size:
            break
        some, here = _Problems(law, a[going], b[going]), x[going]
        g, side, fixed = some.state(here)
        parts = np.abs(some.a * here) + np.abs(some.b)
        left = np.flatnonzero((np.abs(g) > 4.0 * np.finfo(float).eps * parts.max(axis=1, keepdims=True)).any(axis=1))
        some, here, g, going = some.take(left), here[left], g[left], going[left]
        new, moved = _searched(some, here, g, some.direction(here, g, side[left], fixed[left]))
        x[going] = new
        going = going[moved]
    return x


def _searched(some: _Problems, x: Array, g: Array, direction: Array) -> tuple[Array, BoolArray]:
    """The first of the steps 1, 1/2, 1/4, ... that lowers the energy enough; whether there is one."""
    old = some.energy(x)
    size = np.abs(0.5 * some.a * x**2).sum(axis=1) + np.abs(some.b * x).sum(axis=1) + np.abs(old)
    new, taken = x.copy(), np.zeros(len(x), dtype=bool)
    open_ = np.arange(len(x))
    part = 1.0
    for halving in range(40):
        left = some.take(open_)
        at = _moved(some.law, x[open_], part * direction[open_])
        fall = (g[open_] * (at - x[open_])).sum(axis=1)
        energy = left.energy(at)
        good = energy <= old[open_] + _ARMIJO * fall
        near = ~good & (-fall <= _ROUNDING * size[open_]) & (energy <= old[open_] + _ROUNDING * size[open_])
        if near.any():  # energies do not tell any more: the gradient does
            rows = np.flatnonzero(near)
            after = left.take(rows).state(at[rows])[0]
            good[rows] = np.abs(after).max(axis=1) <= 0.9 * np.abs(g[open_[rows]]).max(axis=1)
        good &= np.isfinite(energy) & (at != x[open_]).any(axis=1)
        new[open_[good]] = at[good]
        taken[open_[good]] = True
        open_ = open_[~good & ~(near & (halving > 1))]  # halving what energies do not tell helps no more
        if not open_.size:
            break
        part *= 0.5
    return new, taken
