"""One-sided derivatives of a law at a displacement, in every direction: what decides whether it is a local minimum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from hemivar.laws.vector_law import VectorLaw

__all__ = ["Sides", "lengths", "most_resisted", "polar", "rest_forces", "sides_of"]

#: A multiplier along a slip that is larger than any of a law in common units, and whose square is still a number.
_LARGE = 1e30
#: Least step beside a displacement, so that its square is not zero.
_LEAST = 1e-150
#: Part of a curvature by which it jumps: any value from 1e-6 to 1e-2 gives the same sides in tests/laws.
_JUMPS = 1e-4
#: Directions and places at which is looked how much resists.
_TURNS, _ALONG = 9, np.concatenate([[1e-9], np.geomspace(1e-4, 1.0, 60)])
_ASIDE = np.sin(np.linspace(0.0, np.pi, _TURNS))
_UP = np.sin(np.linspace(0.5, -0.5, _TURNS) * np.pi)  # exactly 0 in the middle


@dataclass(frozen=True, eq=False)
class Sides(PickleMixin):
    """Directions of contact points in which a law is looked at, and its derivatives to both sides along them."""

    point: IntArray  # (k,)
    axis: Array  # (k, c), a unit vector of local components each
    multiplier: Array  # of the pair, along the axis, (k,)
    below: Array  # derivative against the axis, (k,)
    above: Array  # along the axis; the same where the law is smooth
    curvature_below: Array  # (k,)
    curvature_above: Array

    def where(self, chosen: BoolArray) -> Sides:
        """Some of them, ``chosen (k,)``."""
        return Sides(*(values[chosen] for values in vars(self).values()))


def sides_of(law: VectorLaw, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
    """:meth:`VectorLaw.sides` of a law that does not depend on the state: across a kink of the penetration, along every
    slip from rest, and in the principal directions of its second derivative where it is smooth."""
    c = r.shape[1]
    step = np.maximum(slack * tau.max(axis=1), np.maximum(ROUNDED * np.abs(r).max(axis=1), _LEAST))[:, None]
    unit, line = np.eye(c), law.linearise(r)
    smooth = np.repeat(line.smooth, [1, c - 1], axis=1)
    beside = [[law.linearise(law.admissible(r + sign * step * along)) for sign in (-1.0, 1.0)] for along in unit]
    index, ends = np.flatnonzero(active[:, 0] & ~smooth[:, 0]), law.pressures(r)
    before, after = beside[0]
    falls = before.smooth[:, 0] & after.smooth[:, 0] & (before.gradient[:, 0] > after.gradient[:, 0])
    below, above = (np.where(falls, *both)[index] for both in ((ends.upper, ends.lower), (ends.lower, ends.upper)))
    normal = (np.broadcast_to(unit[0], (index.size, c)), lam[index, 0], below, above)
    sides = [Sides(index, *normal, *(other.hessian[index, 0, 0] for other in beside[0]))]
    if (active & ~smooth)[:, 1:].any():
        force, most = rest_forces(law, r, np.where(active[:, 1:], lam[:, 1:], 0.0), active[:, 1:])
        rest, column = np.nonzero((active & ~smooth)[:, 1:])
        bend = np.stack([other.hessian for _, other in beside[1:]])[column, rest, column + 1, column + 1]
        sides.append(Sides(rest, unit[1:][column], force[rest], -most[rest], most[rest], bend, bend))
    free = active & smooth
    rows = np.flatnonzero(free.any(axis=1))
    hessians = [line.hessian]
    for other in (beside_r for both in beside for beside_r in both):  # but those at a kink that r is not at
        same: BoolArray = np.all(other.smooth | ~line.smooth, axis=1)
        hessians.append(np.where(same[:, None, None], other.hessian, line.hessian))
    return sides + _principal(rows, np.stack(hessians)[:, rows], free[rows]) if rows.size else sides


def rest_forces(law: VectorLaw, r: Array, pull: Array, active: BoolArray) -> tuple[Array, Array]:
    """How much of the resistance to a slip is used by ``pull (m, c - 1)``, and how much there is, (m,) each.

    Of components that are active, where the multipliers at rest fill a ball.
    """
    first = np.zeros(pull.shape)
    first[:, 0] = 1.0

    def end(heading: Array) -> Array:
        far = np.zeros(r.shape)
        far[:, 1:] = _LARGE * heading
        return law.nearest_multiplier(r, far)[:, 1:]

    middle = 0.5 * (end(first) + end(-first))
    used, heading = polar(np.where(active, pull - middle, 0.0))
    heading = np.where((used > 0.0)[:, None], heading, first)
    return used, ((end(heading) - middle) * heading).sum(axis=1)


def _principal(rows: IntArray, hessians: Array, free: BoolArray) -> list[Sides]:
    """Principal directions between ``free (k, c)`` components of the lowest of second derivatives (n, k, c, c).

    The first of them is that of the place, the others are those beside it; a direction is weak where they differ.
    """
    c, every = free.shape[1], np.arange(rows.size)
    masked = np.where(free[:, :, None] & free[:, None, :], hessians, 0.0)
    size = np.abs(masked).max(axis=(0, 2, 3))
    shift = np.where(free, 0.0, 10.0 * (1.0 + size)[:, None])[:, :, None] * np.eye(c)
    least = np.linalg.eigvalsh(masked + shift)[..., 0]
    lower = np.where(least < least[0] - _JUMPS * size, least, np.inf)
    values, vectors = np.linalg.eigh(masked[np.argmin(lower, axis=0), every] + shift)
    sides = []
    for k in range(c):
        own = np.flatnonzero(k < free.sum(axis=1))  # those of fixed components are the last ones
        direction, bend, none = vectors[own, :, k], values[own, k], np.zeros(own.size)
        high = np.einsum("ki,nkij,kj->nk", direction, masked[:, own], direction).max(axis=0)
        high = np.where(high - bend > _JUMPS * size[own], high, bend)
        sides.append(Sides(rows[own], direction, none, none, none, bend, high))
    return sides


def most_resisted(law: VectorLaw, rest: Array, size: float) -> tuple[Array, Array, Array]:
    """:meth:`VectorLaw.strongest` by samples: the largest slopes along ways of every direction from ``rest (m, c)``.

    Both parts are less where ways aslant meet less.
    """
    (m, c), count = rest.shape, _ALONG.size
    places = np.repeat(rest, count, axis=0)
    heading = polar(places[:, 1:])[1]
    if c > 1:
        heading[~heading.any(axis=1), 0] = 1.0
    law = law.take(np.repeat(np.arange(m), count))
    most = np.zeros((_TURNS, m))
    for i, (up, along) in enumerate(zip(_UP.tolist(), _ASIDE.tolist(), strict=True)):
        turn = np.column_stack([np.full(m * count, up), along * heading])
        far = np.column_stack([np.full(m * count, up and np.copysign(np.inf, up)), _LARGE * along * heading])
        with np.errstate(all="ignore"):
            slope = (law.nearest_multiplier(places + np.tile(size * _ALONG, m)[:, None] * turn, far) * turn).sum(axis=1)
            most[i] = np.maximum(np.nan_to_num(slope, posinf=np.inf).reshape(m, count).max(axis=1), 0.0)
    middle = _TURNS // 2
    up, slide, down = most[0], most[middle], most[-1]
    shares = []
    for ends, turns in ((up, range(middle + 1)), (down, range(middle, _TURNS))):
        share = np.ones(m)
        for i in turns if c > 1 else ():
            with np.errstate(invalid="ignore"):
                whole = np.where(np.isinf(ends), 0.0, ends * abs(_UP[i])) + slide * _ASIDE[i]
                share = np.minimum(share, np.where(whole > 0.0, most[i] / np.where(whole > 0.0, whole, 1.0), 1.0))
        shares.append(share)
    with np.errstate(invalid="ignore"):
        most_met = [
            np.where(np.isinf(ends), np.inf, ends * share) for ends, share in zip((up, down), shares, strict=True)
        ]
    return most_met[0], most_met[1], slide * np.minimum(*shares)


def lengths(x: Array) -> Array:
    """Length of each row."""
    return np.abs(x[:, 0]) if x.shape[1] == 1 else np.sqrt(np.einsum("mi,mi->m", x, x))


def polar(x: Array) -> tuple[Array, Array]:
    """Length and direction of each row; the direction of a zero row is zero."""
    size = lengths(x)
    return size, x / np.where(size > 0.0, size, 1.0)[:, None]
