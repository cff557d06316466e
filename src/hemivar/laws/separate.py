"""A contact law of one or two components as one scalar law for each of them, laid out in tables.

Newton's method in time asks the same laws the same questions thousands of times.  With ``p = a r + lam``, a above the
weak convexity of the law, the line of a point meets the graph of its law once, and p sorts the points onto pieces and
kinks; on a straight piece all else is read from a table.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.minimisers import knot_forces, place_inside
from hemivar.laws.superpotential import Superpotential

__all__ = ["GraphPosition", "RadialLaw", "SeparateLaw"]


@dataclass(frozen=True, eq=False)
class GraphPosition:
    """Pairs on the graphs of the laws; arrays (m, c).

    Attributes
    ----------
    place : array
        Displacement.
    held : bool array
        Whether it is that of a kink.
    multiplier : array
        The derivative at ``place``; at a kink what is left of p there.
    curvature : array
        The second derivative at ``place``, zero at kinks; a matrix (m, c, c) for each point where components belong
        together.
    moved : bool
        Whether a place is neither a kink nor the displacement that was given.
    pushed : array or None
        What a force along the normal adds to the multiplier of each tangential component of its point, (m, c), where
        the normal component is held and a bound follows its force.
    """

    place: Array
    held: BoolArray
    multiplier: Array
    curvature: Array
    moved: bool = False
    pushed: Array | None = None


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

    @classmethod
    def of(cls, law: Superpotential, column: int, lower: Array, upper: Array) -> Self:
        start = np.where(np.isfinite(lower), lower, np.where(np.isfinite(upper), upper, np.nan))
        with np.errstate(invalid="ignore", over="ignore"):
            lines = [law.piece_line(np.full(len(end), i), end) for i, end in enumerate(start)]
        tangent, bend = (np.array([np.broadcast_to(line[k], start.shape[1:]) for line in lines]) for k in range(2))
        return cls(law, column, lower, upper, start, tangent, bend)

    def times(self, factor: Array) -> Self:
        """The law times a factor (m,)."""
        return replace(self, law=self.law.scaled(factor), tangent=factor * self.tangent, bend=factor * self.bend)


@dataclass(frozen=True, eq=False)
class SeparateLaw:
    """Scalar laws of all components, and the stiffness a that sorts them.

    The components of the points follow one another, ``N = m c``; a law has K knots at most, and 2 K + 1 states: pieces
    (even) and kinks (odd) in turn.

    Attributes
    ----------
    law : ContactLaw
    shape : (m, c)
    stiffness : array (N,)
        a.
    bounds : array (2 K, N)
        p from which on a component is in the next state.
    knots, low, high : arrays (K, N)
        Knots and the ends of the subdifferentials there.
    anchor, base, slope : arrays (2 K + 1, N)
        The lines ``base + slope (r - anchor)`` of straight pieces; the anchor of a kink is the kink.
    domain : arrays (N,)
        Ends of the domains.
    """

    law: ContactLaw
    shape: tuple[int, int]
    stiffness: Array
    bounds: Array
    knots: Array
    low: Array
    high: Array
    anchor: Array
    base: Array
    slope: Array
    domain: tuple[Array, Array]
    curved: tuple[_Curved, ...]
    _number: IntArray = field(repr=False)

    @classmethod
    def of(cls, law: ContactLaw, stiffness: Array, components: int) -> Self | None:
        """The tables of a law; None where a point has three components, or there are too many knots for tables.

        Parameters
        ----------
        law : ContactLaw
            With resolved parameters; its bound depends on no state.
        stiffness : array (m, 2)
            Of the normal and of the tangential part, larger than the weak convexity of the law.
        components : int
            Of a contact point.
        """
        if components > 2 or law.state_dependent:
            return None
        laws = law.scalar_laws(components)
        if any(one.searched for one in laws):
            return None
        m, count = len(stiffness), max(one.knots.shape[-1] for one in laws)
        shape = (m, components)
        knots, left, right = (np.full((count, *shape), fill) for fill in (np.inf, 0.0, 0.0))
        first, last = np.full((2, count, *shape), np.inf)
        anchor, base, slope = (np.zeros((2 * count + 1, *shape)) for _ in range(3))
        lower, upper = np.empty(shape), np.empty(shape)
        curved = []
        for c, one in enumerate(laws):
            own = one.knots.shape[-1]
            knots[:own, :, c] = one.knots.T
            below, above = one.knot_slopes()
            left[:own, :, c], right[:own, :, c] = below.T, above.T
            first[:own, :, c], last[:own, :, c] = (force.T for force in knot_forces(one, stiffness[:, c]))
            ends = one.domain
            lower[:, c], upper[:, c] = ends.lower, ends.upper
            if not one.straight:
                places = np.clip(knots[:own, :, c], ends.lower, ends.upper)
                start, end = (np.broadcast_to(end, (1, m)) for end in (ends.lower, ends.upper))
                curved.append(_Curved.of(one, c, np.concatenate([start, places]), np.concatenate([places, end])))
                continue
            finite = np.isfinite(knots[:own, :, c])
            at = np.where(finite, knots[:own, :, c], 0.0)
            for i in range(own + 1):
                near = at[max(i - 1, 0)]
                piece = np.full(m, i)
                anchor[2 * i, :, c] = near
                base[2 * i, :, c] = one.piece_derivative(piece, near)
                slope[2 * i, :, c] = one.piece_curvature(piece, near)
        anchor[1::2] = np.where(np.isfinite(knots), knots, 0.0)
        n = m * components
        return cls(
            law,
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
            np.arange(n),
        )

    def times(self, factor: Array) -> Self:
        """The tables with the laws of all tangential components times a factor (m,), at least 0."""
        by = np.ones(self.shape)
        by[:, 1:] = factor[:, None]
        flat, at = by.ravel(), self.stiffness * self.anchor[1::2]
        low, high = flat * self.low, flat * self.high
        first, last = (np.where(np.isfinite(self.knots), at + end, np.inf) for end in (low, high))
        curved = tuple(one.times(factor) if one.column else one for one in self.curved)
        return replace(
            self,
            bounds=_bounds(first, last),
            low=low,
            high=high,
            base=flat * self.base,
            slope=flat * self.slope,
            curved=curved,
        )

    @cached_property
    def _straight(self) -> BoolArray:
        """Which components (N,) have laws that are straight on their pieces."""
        found = np.ones(self.shape, dtype=bool)
        found[:, [one.column for one in self.curved]] = False
        return found.ravel()

    def onto(self, p: Array, r: Array, exact: bool = False) -> GraphPosition:
        """Where the law is to be linearised next: the kink that p lies at, else r on the piece that p lies on.

        Parameters
        ----------
        p, r : arrays (m, c)
            ``a r + lam`` and r of pairs near the graph.
        exact : bool
            On straight pieces not r, but the place of the graph where p is what was given.
        """
        flat, line = p.ravel(), r.ravel()
        state = np.add.reduce(flat > self.bounds, axis=0)
        index = state * self._number.size + self._number
        at = self.anchor.take(index)
        held = (state & 1).astype(bool)
        slope = self.slope.take(index)
        base = self.base.take(index)
        if exact:
            line = np.where(self._straight, at + (flat - base - self.stiffness * at) / (self.stiffness + slope), line)
        place = np.where(held, at, line)
        lam = np.where(held, flat - self.stiffness * at, base + slope * (line - at))
        moved = False
        for one in self.curved:
            moved |= self._bend(one, state, held, p, place, lam, slope)
        shape = self.shape
        return GraphPosition(place.reshape(shape), held.reshape(shape), lam.reshape(shape), slope.reshape(shape), moved)

    def _bend(
        self, one: _Curved, state: IntArray, held: BoolArray, p: Array, place: Array, lam: Array, slope: Array
    ) -> bool:
        """Fill in place what a law that is not straight says; whether a place had to be moved onto its piece."""
        m, c = self.shape
        own = slice(one.column, None, c)
        piece, still, at = state[own] >> 1, held[own], place[own]
        row = np.minimum(piece, len(one.lower) - 1) * m + self._number[:m]
        lower, upper = one.lower.take(row), one.upper.take(row)
        there = still | ((at > lower) & (at < upper))
        moved = not there.all()
        if moved:
            at = np.where(there, at, self._on_piece(one, row, p[:, one.column], at, lower, upper))
            place[own] = at
        tangent, bend = one.law.piece_line(piece, at)
        lam[own] = np.where(still, lam[own], tangent)
        slope[own] = np.where(still, 0.0, bend)
        return moved

    def _on_piece(self, one: _Curved, row: IntArray, p: Array, r: Array, lower: Array, upper: Array) -> Array:
        """What :meth:`Superpotential.place_on_piece` says of points whose pieces are known and do not hold r."""
        a, line = self.stiffness[one.column :: self.shape[1]], (one.tangent.take(row), one.bend.take(row))
        return place_inside(a, p, r, (lower, upper), one.start.take(row), line)

    def _derivative(self, r: Array) -> Array:
        """j' (N,) at r (N,), inside the domain; at a knot that of the piece to its left."""
        piece = np.add.reduce(r > self.knots, axis=0)
        index = 2 * self._number.size * piece + self._number
        found = self.base.take(index) + self.slope.take(index) * (r - self.anchor.take(index))
        c = self.shape[1]
        for one in self.curved:
            own = slice(one.column, None, c)
            found[own] = one.law.piece_derivative(piece[own], r[own])
        return np.asarray(found)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """Distance (m, c) of each component of a pair to the graph of its law, in units of ``lam``.

        Parameters
        ----------
        r, lam : arrays (m, c)
        tau : array (m, c)
            Compliance, as in :meth:`hemivar.laws.ContactLaw.graph_distance`.
        """
        line, force = r.ravel(), lam.ravel()
        ends = self.domain
        with np.errstate(all="ignore"):
            off = np.abs(force - self._derivative(line))
            off = np.where((line < ends[0]) | (line > ends[1]), np.inf, off)
            beside = np.maximum(np.maximum(self.low - force, force - self.high), 0.0)
            apart = np.hypot((line - self.knots) / tau.ravel(), beside)
        return np.asarray(np.minimum(off, apart.min(axis=0))).reshape(self.shape)

    def least_multiplier(self, r: Array) -> Array:
        """The element (m, c) of the subdifferential at r (m, c), in the domain, that is nearest to zero."""
        line = r.ravel()
        found = self._derivative(line)
        for knot, low, high in zip(self.knots, self.low, self.high, strict=True):
            here = line == knot
            if here.any():
                found = np.where(here, np.minimum(np.maximum(low, 0.0), high), found)
        return found.reshape(self.shape)


@dataclass(frozen=True, eq=False)
class RadialLaw:
    """The same for points of three components: the normal one, and the length of the tangential ones.

    Attributes
    ----------
    law : ContactLaw
    lengths : SeparateLaw
        Of the normal component and the length of the slip.
    stiffness : array (m, 3)
    """

    law: ContactLaw
    lengths: SeparateLaw
    stiffness: Array

    @classmethod
    def of(cls, law: ContactLaw, stiffness: Array) -> Self | None:
        """The tables of a law, see :meth:`SeparateLaw.of`."""
        lengths = SeparateLaw.of(law, stiffness, 2)
        return None if lengths is None else cls(law, lengths, np.repeat(stiffness, [1, 2], axis=1))

    @property
    def domain(self) -> tuple[Array, Array]:
        """Ends of the domains (3 m,) of all components; slips have none that are looked at."""
        m = len(self.stiffness)
        first, last = np.full((m, 3), -np.inf), np.full((m, 3), np.inf)
        for ends, own in ((first, self.lengths.domain[0]), (last, self.lengths.domain[1])):
            ends[:, 0] = own[::2]
        return first.ravel(), last.ravel()

    def times(self, factor: Array) -> Self:
        """As :meth:`SeparateLaw.times`."""
        return replace(self, lengths=self.lengths.times(factor))

    def onto(self, p: Array, r: Array, exact: bool = False) -> GraphPosition:
        """As :meth:`SeparateLaw.onto`."""
        pull, size = _lengths(p), _lengths(r)
        on = self.lengths.onto(pull, size, exact)
        still, length, moved = on.held[:, 1], on.place[:, 1], on.moved
        begins = ~still & (length == 0.0)
        if begins.any():  # it slips from now on, as far as the law is as straight as it begins
            force = pull[:, 1] - on.multiplier[:, 1]
            stiffness = self.lengths.stiffness[1::2] + on.curvature[:, 1]
            length, moved = np.where(begins, np.maximum(force, 0.0) / stiffness, length), True
        own, towards = _directions(r, size[:, 1]), _directions(p, pull[:, 1])
        stays = (length == size[:, 1]) & ~still & (length > 0.0)
        heading = towards if exact else np.where(stays[:, None], own, towards)
        place, held = np.empty(r.shape), np.empty(r.shape, dtype=bool)
        place[:, 0], place[:, 1:] = on.place[:, 0], length[:, None] * heading
        held[:, 0], held[:, 1:] = on.held[:, 0], still[:, None]
        slope, bend = np.where(still, 0.0, on.multiplier[:, 1]), on.curvature[:, 1]
        lam = np.where(held, p - self.stiffness * place, 0.0)
        lam[:, 0] = on.multiplier[:, 0]
        lam[:, 1:] += slope[:, None] * heading
        across = np.where(length > 0.0, slope / np.where(length > 0.0, length, 1.0), bend)
        across = np.where(still, 0.0, across)
        curvature = np.zeros((*r.shape, 3))
        curvature[:, 0, 0] = on.curvature[:, 0]
        block = ((bend - across)[:, None] * heading)[:, :, None] * heading[:, None, :]
        block[:, [0, 1], [0, 1]] += across[:, None]
        curvature[:, 1:, 1:] = block
        return GraphPosition(place, held, lam, curvature, moved)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """Distance (m, 1) of each pair to the graph, as :meth:`hemivar.laws.ContactLaw.graph_distance`."""
        size = _lengths(r)
        direction = _directions(r, size[:, 1])
        force = lam.copy()[:, :2]
        force[:, 1] = np.einsum("mi,mi->m", direction, lam[:, 1:])
        found = self.lengths.graph_distance(size, force, tau[:, :2])
        across = np.hypot(*(lam[:, 1:] - force[:, 1:] * direction).T)
        moving = np.where(size[:, 1] > 0.0, np.hypot(found[:, 1], across), np.inf)
        pull = np.hypot(lam[:, 1], lam[:, 2])
        resting = np.hypot(size[:, 1] / tau[:, 1], self.law.tangential.distance(np.zeros_like(pull), pull))
        return np.hypot(found[:, 0], np.minimum(moving, resting))[:, None]

    def least_multiplier(self, r: Array) -> Array:
        """As :meth:`SeparateLaw.least_multiplier`."""
        size = _lengths(r)
        least = self.lengths.least_multiplier(size)
        found = _directions(r, size[:, 1]) * least[:, 1:]
        return np.concatenate([least[:, :1], np.where(size[:, 1:] > 0.0, found, 0.0)], axis=1)


def _bounds(first: Array, last: Array) -> Array:
    """Forces (2 K, ...) from which on a component is in the next part: it comes to a knot at one, and leaves it."""
    bounds = np.empty((2 * len(first), *first.shape[1:]))
    with np.errstate(under="ignore"):  # the number below zero
        bounds[::2] = np.where(first == last, last, np.nextafter(first, -np.inf))
    bounds[1::2] = last
    return bounds


def _lengths(x: Array) -> Array:
    """The normal component and the length of the others, (m, 2)."""
    found = np.empty((len(x), 2))
    found[:, 0] = x[:, 0]
    np.hypot(x[:, 1], x[:, 2], out=found[:, 1])
    return found


def _directions(x: Array, size: Array) -> Array:
    """Direction (m, 2) of the tangential components, the first axis where they are zero."""
    found = x[:, 1:] / np.where(size > 0.0, size, 1.0)[:, None]
    if not size.all():
        found[size == 0.0] = (1.0, 0.0)
    return found
