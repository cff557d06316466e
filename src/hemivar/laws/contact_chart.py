"""Minty's parametrisation of the contact graph, in tables: the unknown p = a r + lam gives r, lam and derivatives.

Newton's method asks the same law the same question thousands of times: the pair at ``p = a r + lam``.  With a above the
weak convexity of the law p grows along its graph, and sorts the points onto pieces and kinks; on a straight piece all
else is read from a table.  In space the slip and its friction lie along the tangential part of p, and their lengths are
what is looked up.

Where the friction bound h depends on the state, the normal part of p gives penetration and pressure and with them h;
then p sorts the slips onto the pieces of ``h j_tau``.  A slip that moves has the friction ``h xi`` with ``xi`` in
dj_tau, so that it follows the normal part of p too: the derivative is not symmetric.  Where h = 0, as where the contact
pulls, nothing holds a point and dh = 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.minimisers import knot_forces
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.vector_law import Chart, OnGraph

__all__ = ["ContactChart", "GraphTables"]

#: A Newton step on a curved piece is the last one if it is no longer than this part of the place: what it misses is of
#: second order. Any value from 1e-10 to 1e-5 gives the same pairs in tests/laws.
_EXACT = 1e-7


@dataclass(frozen=True, eq=False)
class ContactChart(Chart):
    """The chart of a law that splits."""

    tables: GraphTables  # of both parts; of the penetration alone where a bound depends on the state
    slip: GraphTables | None = None  # of friction with the bound 1, there
    bound: StateBound | None = None  # on the friction, there
    apart: tuple[Superpotential, ...] = ()  # normal law and profile, there
    part: float = 1.0  # of such a bound that counts

    def at(self, p: Array, near: Array | None = None) -> OnGraph:
        pull = _lengths(p)
        size = None if near is None else _lengths(near)
        if self.slip is None or self.bound is None:
            return self._placed(p, pull, *self.tables.at(pull, size))
        first, second = (None, None) if size is None else (size[:, :1], size[:, 1:])
        normal = self.tables.at(pull[:, :1], first)
        penetration, pressure, moves = (x[:, 0] for x in normal)
        bound, slopes = self.bound.value(penetration, pressure), self.bound.slopes(penetration, pressure)
        slip = self.slip.times(self.part * bound).at(pull[:, 1:], second)
        both = [np.concatenate(pair, axis=1) for pair in zip(normal, slip, strict=True)]
        on = self._placed(p, pull, *both)
        follow(on.jacobian, on.multiplier, bound, slopes, self.stiffness[:, 0], moves)
        return on

    @staticmethod
    def _placed(p: Array, pull: Array, r: Array, lam: Array, yields: Array) -> OnGraph:
        """Pairs (m, c) from what the tables say of their lengths."""
        m, c = p.shape
        jacobian = np.zeros((m, c, c))
        if c < 3:
            jacobian.reshape(m, c * c)[:, :: c + 1] = yields
            return OnGraph(r, lam, jacobian)
        size, heading = pull[:, 1], _directions(p, pull[:, 1])
        across = np.where(size > 0.0, r[:, 1] / np.where(size > 0.0, size, 1.0), yields[:, 1])
        jacobian[:, 0, 0] = yields[:, 0]
        block = ((yields[:, 1] - across)[:, None] * heading)[:, :, None] * heading[:, None, :]
        block[:, [0, 1], [0, 1]] += across[:, None]
        jacobian[:, 1:, 1:] = block
        return OnGraph(_along(r, heading), _along(lam, heading), jacobian)

    @property
    def in_one(self) -> tuple[GraphTables, Array | None] | None:
        """Tables of both parts; where friction is bounded by multiples (m,) of the pressure, these and the bound 1.

        None where the bound depends on the state otherwise.
        """
        if self.slip is None or self.bound is None:
            return self.tables, None
        tables = GraphTables.of(self.apart, self.stiffness) if self.bound.proportional else None
        return (
            None
            if tables is None
            else (tables, self.part * np.broadcast_to(self.bound.per_pressure, len(tables.stiffness) // 2))
        )

    def _columns(self, r: Array, lam: Array) -> list[tuple[GraphTables, slice]]:
        """Tables under the bounds of pairs (m, c), with the columns that are theirs."""
        if self.slip is None or self.bound is None:
            return [(self.tables, slice(None))]
        bound = self.part * self.bound.value(r[:, 0], lam[:, 0])
        return [(self.tables, slice(1)), (self.slip.times(bound), slice(1, None))]

    def bounded(self, part: float) -> ContactChart | None:
        return None if self.slip is None else replace(self, part=part)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """As :meth:`hemivar.laws.ContactLaw.graph_distance`, of each component where there are one or two."""
        columns, c = self._columns(r, lam), r.shape[1]
        size, force = _lengths(r), lam
        if c > 2:
            direction, force = _directions(r, size[:, 1]), lam[:, :2].copy()
            force[:, 1] = np.einsum("mi,mi->m", direction, lam[:, 1:])
        parts = [tables.graph_distance(size[:, own], force[:, own], tau[:, :2][:, own]) for tables, own in columns]
        distances = np.concatenate(parts, axis=1)
        if c < 3:
            return distances
        across, pull = np.hypot(*(lam[:, 1:] - force[:, 1:] * direction).T), np.hypot(lam[:, 1], lam[:, 2])
        moving = np.where(size[:, 1] > 0.0, np.hypot(distances[:, 1], across), np.inf)
        tables, own = columns[-1]
        low, high = (end[:, -1] for end in tables.ends(np.zeros_like(size[:, own])))
        resting = np.hypot(size[:, 1] / tau[:, 1], np.maximum(np.maximum(low - pull, pull - high), 0.0))
        return np.hypot(distances[:, 0], np.minimum(moving, resting))[:, None]

    def least_multiplier(self, r: Array) -> Array:
        size = _lengths(r)
        least = np.concatenate(
            [tables.least(size[:, own]) for tables, own in self._columns(r, np.zeros_like(r))], axis=1
        )
        return least if r.shape[1] < 3 else _along(least, _directions(r, size[:, 1]))


def follow(jacobian: Array, lam: Array, bound: Array, slopes: tuple[Array, Array], a: Array, yields: Array) -> None:
    """Fill in how friction follows the normal part of p, where its ``bound (m,)`` depends on the state.

    Penetrations grow by ``yields`` with the normal part of p, and the bound by its ``slopes``.  A slip of constant p
    falls by the slope of the profile for each unit of the bound.
    """
    in_place, in_force = slopes
    rate = in_place * yields + in_force * (1.0 - a * yields)
    profile = lam[:, 1:] / np.where(bound > 0.0, bound, np.inf)[:, None]  # exact where it is 1
    jacobian[:, 1:, 0] = -rate[:, None] * np.einsum("mij,mj->mi", jacobian[:, 1:, 1:], profile)


@dataclass(frozen=True, eq=False)
class _Curved:
    """The law of one component that is not straight on its pieces, and its column."""

    law: Superpotential
    column: int
    lower: Array  # of each piece (K + 1, m)
    upper: Array
    start: Array  # its finite end, where points that come to it begin (K + 1, m), nan where it has none
    tangent: Array  # slope and curvature there
    bend: Array
    number: IntArray  # (m,)

    @classmethod
    def of(cls, law: Superpotential, column: int, lower: Array, upper: Array) -> Self:
        start = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper, np.nan))
        with np.errstate(invalid="ignore", over="ignore"):
            lines = [law.piece_line(np.full(len(end), i), end) for i, end in enumerate(start)]
        tangent, bend = (np.array([np.broadcast_to(line[k], start.shape[1:]) for line in lines]) for k in range(2))
        return cls(law, column, lower, upper, start, tangent, bend, np.arange(start.shape[1]))

    def times(self, factor: Array) -> Self:
        """The law times a factor (m,)."""
        return replace(self, law=self.law.scaled(factor), tangent=factor * self.tangent, bend=factor * self.bend)

    def at(
        self, piece: IntArray, still: BoolArray, a: Array, p: Array, near: Array | None
    ) -> tuple[Array, Array, Array]:
        """Place, multiplier and derivative by p (m,) where ``a r + j'(r) = p`` on the pieces of points not ``still``.

        With ``near`` on pieces as straight as they are there, where they hold that.
        """
        row = np.minimum(piece, len(self.lower) - 1) * piece.size + self.number
        low, high = self.lower.take(row), self.upper.take(row)
        steps = 100 if near is None else 1  # halving alone is through after 64
        if near is None:
            at = self._begin(row, a, p, low, high)
        elif (inside := still | ((near > low) & (near < high))).all():
            at = near
        else:
            at = np.where(inside, near, self._begin(row, a, p, low, high))
        for _ in range(steps):
            slope, bend = self.law.piece_line(piece, at)
            room = a + bend
            step = (p - a * at - slope) / room
            new = at + step
            if steps == 1 or (still | (np.abs(step) <= _EXACT * np.abs(at))).all():
                break
            rises = step * room > 0.0
            low, high = np.where(rises, at, low), np.where(rises, high, at)
            at = np.where((new >= low) & (new <= high), new, 0.5 * (low + high))
        return new, slope + bend * step, 1.0 / room

    def _begin(self, row: IntArray, a: Array, p: Array, low: Array, high: Array) -> Array:
        """Where pieces that go on as they begin at an end would hold p; else their middle, or a place inside."""
        end, slope, bend = self.start.take(row), self.tangent.take(row), self.bend.take(row)
        miss = p - a * end - slope
        first, middle, inside = end + miss / (a + bend), 0.5 * (low + high), end + miss / a
        first = np.where((first > low) & (first < high), first, np.where(np.isfinite(middle), middle, inside))
        return np.where(np.isfinite(first), first, p / a)


@dataclass(frozen=True, eq=False)
class GraphTables:
    """Scalar laws of all components, and the stiffness a that sorts them.

    The components of the points follow one another, ``N = m c``; a law has K knots at most, and 2 K + 1 states: pieces
    (even) and kinks (odd) in turn.  Straight pieces are lines ``base + slope (r - anchor)``; a kink is its anchor.
    """

    shape: tuple[int, int]
    stiffness: Array  # a, (N,)
    bounds: Array  # p from which on a component is in the next state, (2 K, N)
    knots: Array  # (K, N)
    low: Array  # end of the subdifferential there
    high: Array
    anchor: Array  # (2 K + 1, N)
    base: Array
    slope: Array
    domain: tuple[Array, Array]  # ends, (N,) each
    curved: tuple[_Curved, ...]
    falls: bool  # whether p does not grow along some straight piece
    _number: IntArray = field(repr=False)

    @classmethod
    def of(cls, laws: Sequence[Superpotential], stiffness: Array) -> Self | None:
        """The tables of the laws of one or two components, with a ``stiffness (m, 2)`` above their weak convexity.

        None where there are too many knots for tables.
        """
        if any(law.searched for law in laws):
            return None
        components = len(laws)
        m, count = len(stiffness), max(law.knots.shape[-1] for law in laws)
        shape = (m, components)
        knots, left, right = (np.full((count, *shape), fill) for fill in (np.inf, 0.0, 0.0))
        first, last = np.full((2, count, *shape), np.inf)
        anchor, base, slope = (np.zeros((2 * count + 1, *shape)) for _ in range(3))
        lower, upper = np.empty(shape), np.empty(shape)
        curved = []
        for c, law in enumerate(laws):
            own = law.knots.shape[-1]
            knots[:own, :, c] = law.knots.T
            below, above = law.knot_slopes()
            left[:own, :, c], right[:own, :, c] = below.T, above.T
            first[:own, :, c], last[:own, :, c] = (force.T for force in knot_forces(law, stiffness[:, c]))
            ends = law.domain
            lower[:, c], upper[:, c] = ends.lower, ends.upper
            if not law.straight:
                places = np.clip(knots[:own, :, c], ends.lower, ends.upper)
                start, end = (np.broadcast_to(end, (1, m)) for end in (ends.lower, ends.upper))
                curved.append(_Curved.of(law, c, np.concatenate([start, places]), np.concatenate([places, end])))
                continue
            finite = np.isfinite(knots[:own, :, c])
            at = np.where(finite, knots[:own, :, c], 0.0)
            for i in range(own + 1):
                near = at[max(i - 1, 0)]
                piece = np.full(m, i)
                anchor[2 * i, :, c] = near
                base[2 * i, :, c] = law.piece_derivative(piece, near)
                slope[2 * i, :, c] = law.piece_curvature(piece, near)
        anchor[1::2] = np.where(np.isfinite(knots), knots, 0.0)
        n = m * components
        return cls(
            shape,
            stiffness[:, :components].ravel(),
            _bounds(first, last).reshape(-1, n),
            knots.reshape(-1, n),
            np.minimum(left, right).reshape(-1, n),
            np.maximum(left, right).reshape(-1, n),
            anchor.reshape(-1, n),
            base.reshape(-1, n),
            slope.reshape(-1, n),
            (lower.ravel(), upper.ravel()),
            tuple(curved),
            bool((stiffness[:, :components] + slope <= 0.0).any()),
            np.arange(n),
        )

    def times(self, factor: Array) -> Self:
        """The tables of one component with its laws times a factor (m,), at least 0."""
        low, high = factor * self.low, factor * self.high
        at = self.stiffness * self.anchor[1::2]
        first, last = at + low, at + high
        unused = np.isposinf(self.knots)
        if unused.any():
            first[unused] = last[unused] = np.inf
        return replace(
            self,
            bounds=_bounds(first, last),
            low=low,
            high=high,
            base=factor * self.base,
            slope=factor * self.slope,
            curved=tuple(part.times(factor) for part in self.curved),
        )

    def at(self, p: Array, near: Array | None = None) -> tuple[Array, Array, Array]:
        """Places, multipliers and the derivatives of the places by p, (m, c) each, where ``a r + lam = p (m, c)``.

        With ``near (m, c)``, r itself, pieces that are not straight are taken as straight as they are there: what is
        missed is of second order, and nothing where ``near`` is the place.
        """
        flat, a = p.ravel(), self.stiffness
        state = np.add.reduce(flat > self.bounds, axis=0)
        index = state * self._number.size + self._number
        anchor, slope = self.anchor.take(index), self.slope.take(index)
        pull, base, room = flat - a * anchor, self.base.take(index), a + slope
        at_knot = (state & 1).astype(bool)
        with np.errstate(all="ignore"):
            yields = 1.0 / room
            off = (pull - base) * yields
            if near is not None and self.falls:  # along such a piece p tells no place
                off = np.where(room <= 0.0, near.ravel() - anchor, off)
            yields[at_knot] = off[at_knot] = 0.0
            r, lam = anchor + off, np.where(at_knot, pull, base + slope * off)
            for part in self.curved:
                own = slice(part.column, None, self.shape[1])
                stuck = at_knot[own]
                where = None if near is None else near[:, part.column]
                pair = part.at(state[own] >> 1, stuck, a[own], flat[own], where)
                for out, values in zip((r, lam, yields), pair, strict=True):
                    out[own] = np.where(stuck, out[own], values)
        return r.reshape(self.shape), lam.reshape(self.shape), yields.reshape(self.shape)

    def _derivative(self, r: Array) -> Array:
        """j' (N,) at r (N,), inside the domain; at a knot that of the piece to its left."""
        piece = np.add.reduce(r > self.knots, axis=0)
        index = 2 * self._number.size * piece + self._number
        slopes = self.base.take(index) + self.slope.take(index) * (r - self.anchor.take(index))
        c = self.shape[1]
        for part in self.curved:
            own = slice(part.column, None, c)
            slopes[own] = part.law.piece_derivative(piece[own], r[own])
        return np.asarray(slopes)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """Distance (m, c) of each component of a pair to the graph of its law, in units of ``lam``; ``tau (m, c)``."""
        line, force = r.ravel(), lam.ravel()
        ends = self.domain
        with np.errstate(all="ignore"):
            off = np.abs(force - self._derivative(line))
            off = np.where((line < ends[0]) | (line > ends[1]), np.inf, off)
            beside = np.maximum(np.maximum(self.low - force, force - self.high), 0.0)
            apart = np.hypot((line - self.knots) / tau.ravel(), beside)
        return np.asarray(np.minimum(off, apart.min(axis=0))).reshape(self.shape)

    def ends(self, r: Array) -> tuple[Array, Array]:
        """Ends (m, c) of the subdifferentials at r (m, c), in the domain."""
        line = r.ravel()
        low = high = self._derivative(line)
        for knot, first, last in zip(self.knots, self.low, self.high, strict=True):
            here = line == knot
            if here.any():
                low, high = np.where(here, first, low), np.where(here, last, high)
        return low.reshape(self.shape), high.reshape(self.shape)

    def least(self, r: Array) -> Array:
        """The element (m, c) of the subdifferential at r (m, c), in the domain, that is nearest to zero."""
        low, high = self.ends(r)
        return np.asarray(np.minimum(np.maximum(low, 0.0), high))


def _bounds(first: Array, last: Array) -> Array:
    """Forces (2 K, ...) from which on a component is in the next part: it comes to a knot at one, and leaves it."""
    bounds = np.empty((2 * len(first), *first.shape[1:]))
    with np.errstate(under="ignore"):  # the number below zero
        bounds[::2] = np.where(first == last, last, np.nextafter(first, -np.inf))
    bounds[1::2] = last
    return bounds


def _lengths(x: Array) -> Array:
    """The normal component and the length of the others, (m, 2); components (m, c) of their own where c < 3."""
    if x.shape[1] < 3:
        return x
    sizes = np.empty((len(x), 2))
    sizes[:, 0] = x[:, 0]
    np.hypot(x[:, 1], x[:, 2], out=sizes[:, 1])
    return sizes


def _directions(x: Array, size: Array) -> Array:
    """Direction (m, 2) of the tangential components, zero where they are."""
    return np.asarray(x[:, 1:] / np.where(size > 0.0, size, 1.0)[:, None])


def _along(x: Array, heading: Array) -> Array:
    """Components (m, 3) of the normal parts and lengths (m, 2)."""
    return np.concatenate([x[:, :1], x[:, 1:] * heading], axis=1)
