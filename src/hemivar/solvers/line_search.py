"""Line search: the bottom of the energy along a direction, straight across pieces of laws or stopped at their ends.

Along a direction the energy is smooth between the lengths at which contact points meet the knots of their laws, convex
or not.  Where laws are quadratic in between, these lengths are sorted, and slope and curvature are summed up from one
to the next: all bottoms are known.  Elsewhere the slope is looked at: lengths grow from the first knot on until the
energy rises, and the bottom is then closed in between the knots that lie there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array
from hemivar.laws.crossings import Crossings
from hemivar.laws.scalar_graph import ENDLESS
from hemivar.laws.vector_law import is_convex
from hemivar.systems.contact_moves import Search
from hemivar.systems.contact_system import ContactSystem
from hemivar.systems.newton_equation import LinearisedPoint

__all__ = ["ARMIJO", "ENERGY_ROUNDING", "Bottom", "LineEnd", "SearchLine", "bottom_of_pieces", "energy_scale"]

#: What rounding makes of the energy along a line, relative to its parts.
_ROUNDED = 1e-15
#: Part of what the slope promises from which a step is good enough (Armijo 1966).
ARMIJO = 0.1
#: What rounding makes of an energy over a step, relative to its parts.
ENERGY_ROUNDING = 1e-14
#: Part of a length by which one is beside a knot.
_BESIDE = 1e-10
#: The most looks that close a bottom in.
_LOOKS = 100
#: Part of the slope at the beginning that is none at a bottom.
_LEVEL = 1e-3
#: How far, in units of the length that is asked for, the energy is said to fall without end.
_ENDLESS = 2.0**50


@dataclass(frozen=True, eq=False)
class LineEnd:
    """The end of a search along a line."""

    x: Array  # (m, d) or (n,)
    force: Array  # of the shape of x: load minus elastic force there
    energy_change: float  # change of the energy, at most zero
    tries: int = 0  # evaluations of the energy
    endless: bool = False  # whether the energy falls without end along the line


@dataclass(frozen=True)
class Bottom:
    """Length at which the energy is lowest along a line, 0 where it is at the beginning, and whether it falls without
    end."""

    length: float
    endless: bool = False


@dataclass(frozen=True, eq=False)
class SearchLine:
    """A direction from a point, along which the energy costs no more than a look at the contact points."""

    system: ContactSystem
    at: LinearisedPoint  # where it begins
    direction: Array  # of the shape of a point
    bent: Array  # of the shape of a point: elastic force that a unit of the direction takes away
    along: Array  # (m, d): its local displacements
    slope: float  # work of the force along the direction d
    square: float  # its energy ``d'K d``
    value: Array  # (m,): j at the beginning
    rounding: float  # what the arithmetic alone makes of the energy
    search: Search = Search.GLOBAL  # whether the lowest bottom is looked for, or the first one

    @staticmethod
    def of(
        system: ContactSystem,
        at: LinearisedPoint,
        direction: Array,
        bent: Array,
        search: Search = Search.GLOBAL,
    ) -> SearchLine:
        """The line from a point; ``bent`` is the elastic force that the direction takes away."""
        value, force, flat = system.law.value(at.r), at.force.ravel(), direction.ravel()
        slope, square, size = system.vectors.total(
            float(force @ flat),
            float(flat @ bent.ravel()),
            float(np.abs(force) @ np.abs(at.x.ravel())) + float(system.weights @ np.abs(value)),
        ).tolist()
        along, rounding = system.at_contact(direction), _ROUNDED * (abs(slope) + size)
        return SearchLine(system, at, direction, bent, along, slope, max(square, 0.0), value, rounding, search)

    # ---- where to go ------------------------------------------------------------------------------------

    def lowest(self, convex: bool = True, trusted: bool = False) -> LineEnd:
        """The end of Newton's step: whole where that gains what it promises, else at the lowest bottom.

        ``convex``: whether Newton's matrix was definite: then a whole step that stays on its pieces ends at their
        bottom; ``trusted``: a whole step that gains less than the rounding of the energy is taken on trust.
        """
        cut = self.cut(1.0)
        ends, straight = [self._look(1.0, cut)], self.straight(cut)
        if not straight and self.search is Search.GLOBAL:
            ends.append(self._look(1.0, self.across(1.0)))
        gained = min(end[0] for end in ends)
        if straight and convex and trusted and gained <= self.rounding:
            return self._end(1.0, cut, min(gained, 0.0), 1)
        if convex and self._promised <= self.rounding:
            # No energy tells the places apart: slopes do.
            length = self._closed_in(self._slope_cut, self._first, 1.0).length
            return self._end(length, self.cut(length), min(self.energy_change(length, self.cut(length)), 0.0), 2)
        if convex and gained <= -ARMIJO * self._promised:
            return self._best(ends)
        return self._best([*ends, *(end for end, _ in self._bottoms(1.0, cut_until=1.0, straight=straight))])

    def bottom(self, unit: float) -> LineEnd:
        """The bottom along the direction, however far it is; lengths are about ``unit`` where there is no knot.

        Where the energy falls without end, a point far beyond the knots.
        """
        bottoms = self._bottoms(unit)
        best = self._best([end for end, _ in bottoms])
        return replace(best, endless=any(endless for _, endless in bottoms))

    def _bottoms(
        self, unit: float, cut_until: float = math.inf, straight: bool = False
    ) -> list[tuple[tuple[float, float, Array], bool]]:
        """The bottom straight across the pieces, and, unless all of it is straight, that of the way that stops at their
        ends; and whether the energy falls without end there."""
        low, knots = self._bottom_across(unit)
        length, endless = self._within(low, unit)
        bottoms = [(self._look(length, self.across(length, knots)), endless)]
        if not straight:
            length, endless = self._within(self._closed_in(self._slope_cut, min(self._first, unit), cut_until), unit)
            bottoms.append((self._look(length, self.cut(length)), endless))
        return bottoms

    def _within(self, low: Bottom, unit: float) -> tuple[float, bool]:
        """The length of a bottom, or one far beyond the knots; and whether the energy falls without end."""
        far = low.length >= max(_ENDLESS * unit, self._aim)
        return (self._aim if far or (low.endless and low.length == 0.0) else low.length), far or low.endless

    @cached_property
    def _promised(self) -> float:
        """What the quadratic pieces on which the line begins let a whole step of Newton's equation gain."""
        law = float(self.system.weights @ np.einsum("mi,mi->m", self.at.multiplier, self.along))
        return 0.5 * max(self.slope - float(self.system.vectors.total(law)[0]), 0.0)

    def _best(self, ends: list[tuple[float, float, Array]]) -> LineEnd:
        gained, length, candidate = min(ends, key=lambda end: end[0])
        if gained < 0.0:
            return self._end(length, candidate, gained, len(ends))
        return LineEnd(self.at.x, self.at.force, 0.0, len(ends))

    def _look(self, length: float, candidate: Array) -> tuple[float, float, Array]:
        return self.energy_change(length, candidate), length, candidate

    # ---- straight across the pieces -----------------------------------------------------------------------

    def _bottom_across(self, unit: float = 1.0) -> tuple[Bottom, Crossings | None]:
        """Where the straight line is lowest, and the knots on it where they are known."""
        system, first = self.system, self.search is Search.DOWNHILL
        knots = system.law.crossings(self.at.r, self.along) if system.vectors.alone else None
        if knots is not None:
            return bottom_of_pieces(knots, system.weights, self.slope, self.square, is_convex(system.law), first), knots
        return self._closed_in(self._slope_across, min(self._first, unit), math.inf), None

    def across(self, length: float, knots: Crossings | None = None) -> Array:
        """Local displacements (m, d) after a step, whatever pieces they come to; those that meet a knot are on it."""
        r = np.where(self.system.active, self.at.r + length * self.along, self.system.fixed)
        if knots is not None:
            met = np.abs(knots.length - length) <= ROUNDED * length
            r[knots.point[met], knots.component[met]] = knots.place[met]
            return r
        exits, ends = self._exits
        return np.where(np.abs(exits - length) <= ROUNDED * length, ends, r)

    def _slope_across(self, length: float) -> float:
        """Derivative of the energy along the line; inf outside of the domain of the laws."""
        system, r = self.system, self.across(length)
        line, outside = system.law.linearise(r), float(not np.isfinite(system.law.value(r)).all())
        law = float(system.weights @ np.einsum("mi,mi->m", line.gradient, self.along))
        own, out = system.vectors.total(law, outside).tolist()
        return math.inf if out else length * self.square - self.slope + own

    # ---- stopped at the ends of the pieces ------------------------------------------------------------------

    def cut(self, length: float) -> Array:
        """Local displacements (m, d) after a step, cut back to the pieces on which they began."""
        far = np.where(self.system.active, self.at.r + length * self.along, self.system.fixed)
        return self.at.clamp(far)

    def _slope_cut(self, length: float) -> float:
        """Derivative of the energy along the way on which points stop at the ends of their pieces."""
        system, r, along = self.system, self.cut(length), self.along
        extra = self._aside(length, r)
        stopped = np.abs(extra) > ROUNDED * (np.abs(r) + np.abs(length * along))
        direction = np.where(stopped, 0.0, along)
        contact = self._pull(length) + system.couple(extra)
        law = system.weights @ np.einsum("mi,mi->m", system.law.linearise(r).gradient, direction)
        own = float(np.vdot(extra, self._at_contact[0])) + float(np.vdot(contact, direction - along)) + float(law)
        return length * self.square - self.slope + float(system.vectors.total(own)[0])

    @cached_property
    def _exits(self) -> tuple[Array, Array]:
        """Lengths (m, d) at which components leave their pieces, inf where they stay, and where these end."""
        r, along = self.at.r, self.along
        ends, aimed = self.cut(self._aim), r + self._aim * along
        left = np.abs(aimed - ends) > 1e-14 * (np.abs(aimed) + np.abs(r))
        lengths = np.abs(ends - r) / np.where(left, np.abs(along), 1.0)
        return np.where(left & self.at.moving & (along != 0.0), lengths, np.inf), ends

    @cached_property
    def _aim(self) -> float:
        """A length that leads far beyond the knots, at least 1."""
        sizes = (np.abs(values).max(initial=0.0) for values in (self.at.r, self.along))
        far, largest = self.system.vectors.largest(*sizes).tolist()
        return max(1.0, ENDLESS * (far or 1.0) / largest) if largest > 0.0 else 1.0

    @cached_property
    def _first(self) -> float:
        """Length at which the first component leaves its piece, at most 1."""
        exits = self._exits[0]
        inside = exits[exits > 0.0]
        return self.system.vectors.lowest(float(inside.min(initial=1.0)))[0]

    # ---- the energy -----------------------------------------------------------------------------------------

    def energy_change(self, length: float, candidate: Array) -> float:
        """Change of the energy, free of the cancellation of two large energies, and no lower than rounding lets it be.

        Along a motion that hardly deforms the body its forces are rounding, the larger the further it leads.
        """
        system, extra = self.system, self._aside(length, candidate)
        reach, own = np.abs(extra) + length * np.abs(self.along), 0.0
        if extra.any() or not system.vectors.alone:
            own = float(np.vdot(extra, self._pull(length) + 0.5 * system.couple(extra)))
        own += float(system.weights @ (system.law.value(candidate) - self.value))
        with np.errstate(over="ignore"):  # where nothing ends a motion
            own += _ROUNDED * float(np.vdot(system.diagonal, reach**2))
        alone = 0.5 * length**2 * self.square - length * self.slope
        return alone + float(system.vectors.total(own)[0])

    @cached_property
    def _at_contact(self) -> tuple[Array, Array]:
        """What a unit of the direction takes away from the forces of the contact points, and these, (m, d) each."""
        return self.system.at_contact(self.bent), self.system.at_contact(self.at.force)

    def _pull(self, length: float) -> Array:
        """Forces (m, d) on the contact points that a step leaves, with the sign of what the body takes up."""
        bent, force = self._at_contact
        return length * bent - force

    def _aside(self, length: float, candidate: Array) -> Array:
        """How far (m, d) from the straight line local displacements are; exactly zero on it."""
        return np.where(self.system.active, candidate - (self.at.r + length * self.along), 0.0)

    def straight(self, candidate: Array) -> bool:
        """Whether a whole step leads to the candidate, as far as the digits of the local displacements tell."""
        off = self._aside(1.0, candidate)
        sizes = [np.abs(values).max(initial=0.0) for values in (off, self.along, self.at.r)]
        missed, step, size = self.system.vectors.largest(*sizes).tolist()
        return bool(missed <= 1e-10 * step + 4.0 * np.finfo(float).eps * size)

    def end(self, length: float, candidate: Array) -> tuple[Array, Array]:
        """The point after a step with these local displacements, and the force there."""
        system = self.system
        far = self.at.x + length * self.direction
        near = system.moved(far, candidate)
        return near, self.at.force - length * self.bent - system.multiply_contact(near - far)

    def _end(self, length: float, candidate: Array, gained: float, tries: int) -> LineEnd:
        return LineEnd(*self.end(length, candidate), gained, tries)

    # ---- bottoms by slopes ------------------------------------------------------------------------------------

    def _closed_in(self, slope: Callable[[float], float], first: float, most: float) -> Bottom:
        """The first bottom that is seen where lengths grow from ``first`` on, up to ``most``."""
        behind = max(first, 2.0**-60) * (1.0 + 2.0 * _BESIDE)
        low, high, at_low = 0.0, min(behind, most), -2.0 * self._promised
        for _ in range(60):
            at_high = slope(high)
            if at_high >= 0.0:
                return Bottom(self._between(slope, low, high, at_low, at_high))
            if high >= most:
                return Bottom(most)
            low, high, at_low = high, min(4.0 * high, most), at_high
        return Bottom(0.0, endless=True)

    def _between(
        self, slope: Callable[[float], float], low: float, high: float, at_low: float, at_high: float
    ) -> float:
        """Where the slope turns positive: at the knots in between by bisection, then by secants."""
        level = _LEVEL * abs(at_low)
        for _ in range(_LOOKS):
            knot = self._middle_exit(low, high)
            if knot is None:
                break
            above, below = knot * (1.0 + _BESIDE), knot * (1.0 - _BESIDE)
            if (at_middle := slope(above)) < 0.0:
                low, at_low = above, at_middle
            elif (at_middle := slope(below)) < 0.0:
                return knot
            else:
                high, at_high = below, at_middle
        middle = low
        for _ in range(_LOOKS):
            part = at_low / (at_low - at_high) if 0.0 < at_high - at_low < math.inf else 0.5
            middle = low + min(max(part, 1e-3), 1.0 - 1e-3) * (high - low)
            at_middle = slope(middle)
            if abs(at_middle) <= level or high - low <= _BESIDE * high:
                break
            if at_middle < 0.0:
                low, at_low = middle, at_middle
            else:
                high, at_high = middle, at_middle
        return middle

    def _middle_exit(self, low: float, high: float) -> float | None:
        """An exit about in the middle of those between two lengths; None where there is none."""
        exits = self._exits[0]
        inside = exits[(exits * (1.0 - _BESIDE) > low) & (exits * (1.0 + _BESIDE) < high)]
        vectors = self.system.vectors
        (count,) = vectors.total(float(inside.size)).tolist()
        if not count:
            return None
        middle = float(np.partition(inside, inside.size // 2)[inside.size // 2]) if inside.size else math.inf
        return vectors.lowest(middle)[0]


def bottom_of_pieces(knots: Crossings, weights: Array, work: float, square: float, convex: bool, first: bool) -> Bottom:
    """The bottom of ``-t work + t^2/2 square + sum_i weights_i j_i(r_i + t way_i)`` over t > 0.

    ``knots``: of the law; ``weights (m,)``; ``convex``: whether the law is: then its curvature is not negative,
    whatever rounding makes of sums; ``first``: take the first bottom, not the lowest.
    """
    order = np.argsort(knots.length, kind="stable")
    jump, share = knots.jump[order], weights[knots.point[order]]
    walls = np.flatnonzero(np.isposinf(jump))
    order, wall = (order[: walls[0] + 1], True) if walls.size else (order, False)
    share, jump = share[: order.size], jump[: order.size] * share[: order.size]
    at = np.concatenate([[0.0], knots.length[order]])
    bend = float(weights @ knots.bend) + np.concatenate([[0.0], np.cumsum(share * knots.change[order])])
    curvature = square + (np.maximum(bend, 0.0) if convex else bend)
    width, begin = np.diff(at), min(float(weights @ knots.slope) - work, 0.0)
    risen, jumped = np.cumsum(curvature[:-1] * width), np.cumsum(jump)
    before = begin + risen + np.concatenate([[0.0], jumped[:-1]])[: risen.size]
    after = np.concatenate([[begin], begin + risen + jumped])
    energy = np.concatenate([[0.0], np.cumsum((after[:-1] + 0.5 * curvature[:-1] * width) * width)])
    last = after[-1] if curvature[-1] == 0.0 else math.copysign(math.inf, curvature[-1])
    endless = last < 0.0 and not wall
    inside = np.flatnonzero((after < 0.0) & (np.append(before, last) > 0.0))
    further = -after[inside] / curvature[inside]
    on_knot = 1 + np.flatnonzero((before <= 0.0) & (after[1:] >= 0.0))
    lengths = np.concatenate([at[inside] + further, at[on_knot]])
    lows = np.concatenate([energy[inside] + 0.5 * after[inside] * further, energy[on_knot]])
    lengths, lows = lengths[lows < 0.0], lows[lows < 0.0]
    if not lengths.size:
        return Bottom(0.0, endless)
    best = np.argmin(lengths if first else lows)
    return Bottom(float(lengths[best]), endless and not first)


def energy_scale(system: ContactSystem, x: Array, value: Array) -> float:
    """What changes of the energy are compared with at a point, where j is ``value (m,)``."""
    own = float(np.abs(system.load) @ np.abs(x.ravel())) + float(system.weights @ np.abs(value))
    return float(system.vectors.total(own)[0])
