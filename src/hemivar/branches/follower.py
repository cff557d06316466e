"""Arc-length continuation of equilibria: predictor and corrector; from corner to corner where the path is straight."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
import scipy.linalg as la
from scipy.optimize import brentq

from hemivar.basics.arrays import COUNTS
from hemivar.basics.deadline import Budget, OutOfTime, check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.generators import result_of
from hemivar.basics.last_used import Recent
from hemivar.basics.types import AnyArray, Array, BoolArray
from hemivar.branches.path import PathEnd
from hemivar.systems.chain import Chain
from hemivar.systems.curves import ROUNDING, Curves

__all__ = ["Follower", "Following", "PathEvent", "PathProgress", "Track", "trace"]


@dataclass(frozen=True, eq=False)
class PathEvent:
    """What fixes a point of the path: ``border`` times (theta, t) has its value there, of the load or of a corner."""

    border: Array  # (n + 1,)
    segment: AnyArray

    @property
    def of_load(self) -> bool:
        """Whether the load has its value there."""
        return bool(self.border[-1] != 0.0)


@dataclass(frozen=True)
class PathProgress:
    """A point of a path was reached.

    Attributes
    ----------
    points : int
        On this side of the start, with it.
    load_factor : float
    """

    points: int
    load_factor: float


@dataclass(eq=False)
class TrackPoint:
    """A point of a path."""

    t: float
    theta: Array
    event: PathEvent | None = None
    fold: bool = False


@dataclass(frozen=True, eq=False)
class Stretch:
    """What lies between a point and the next; ``negative`` counts the directions in which the energy falls."""

    segment: AnyArray
    negative: int
    curved: bool

    @property
    def stable(self) -> bool:
        """Whether its points are local minimisers."""
        return self.negative == 0


@dataclass(eq=False)
class Track:
    """Points of a path, and the stretches between them."""

    points: list[TrackPoint]
    stretches: list[Stretch]
    ended: PathEnd = PathEnd.MAX_POINTS

    @property
    def load_factors(self) -> Array:
        """Load factors of the points; a path through rest has met it up to rounding, which is zero here."""
        t = np.array([point.t for point in self.points])
        return np.where(np.abs(t) <= 1e-14 * np.abs(t).max(initial=0.0), 0.0, t)

    def reversed(self) -> Track:
        return Track(self.points[::-1], self.stretches[::-1])

    def joined(self, other: Track) -> Track:
        """This track followed by one that starts where it ends."""
        return Track(self.points + other.points[1:], self.stretches + other.stretches, other.ended)


#: Part of a step by which two changes of stability may differ and be one, and by which an end of the step is left to
#: see what holds beside it. Changes are found to 1e-13 of a step; 1e-5 and 1e-7 give the same paths in tests/branches.
_SAME = 1e-6

#: Changes of stability that one step is searched for. A step turns by 18 degrees at most; four are enough in
#: tests/branches.
_CHANGES = 8

#: Cosine of the angle by which a path turns in one step at most: a step is halved until it does. 0.9 and 0.98 give the
#: same folds in tests/branches.
_TURNED = 0.95

#: Change of the load, relative to the motion, below which the body slides on. 1e-2 and 1e-4 give the same paths in
#: tests/branches.
_STILL = 1e-3

#: How many times longer steps may be where the body slides on, as a part of what it has slid. It saves points only:
#: 5 and 40 give the same paths in tests/branches.
_ON_THE_SPOT = 20.0

#: A number that tells by its sign on which side of a change a point of a segment lies, by theta, segment, t and border.
Measure: TypeAlias = Callable[[Array, AnyArray, float, Array], float]

#: A number that an equilibrium has: of local displacements and multipliers (m, d).
Quantity: TypeAlias = Callable[[Array, Array], float]

#: A path at work.
Following: TypeAlias = Generator[PathProgress, bool | None, Track]


@dataclass(eq=False)
class Follower:
    """Follows the zeros of ``F(theta, t)``, the load being ``force0 + t force1``, from ``low`` to ``high``.

    The path ends where a quantity of ``until`` changes its sign.  ``ties`` says afterwards whether several components
    met an event at once, ``stopped`` why it gave up, if it did.
    """

    chain: Chain
    force0: Array
    force1: Array
    low: float
    high: float
    max_points: int
    largest_step: float
    budget: Budget = field(default_factory=lambda: Budget(np.inf))
    until: tuple[Quantity, ...] = ()
    ties: bool = False
    stopped: PathEnd | None = None

    def body_at(self, theta: Array, t: float) -> tuple[Curves, Array, Array]:
        """The curves of the body as it is at a place, the force on it (n,), and the rate of the force with the load."""
        return self.chain, self.force0 + t * self.force1, self.force1

    def negative(self, theta: Array, segment: AnyArray, t: float) -> int:
        """Number of directions in which the energy falls."""
        return self.body_at(theta, t)[0].negative(theta, segment)

    def _falling(self, theta: Array, segment: AnyArray, t: float) -> int:
        """That at an end of a step, where the next one begins."""
        key = theta.tobytes(), segment.tobytes(), t
        return self._counted.once(key, lambda: self.negative(theta, segment, t))

    @cached_property
    def _counted(self) -> Recent[tuple[bytes, bytes, float], int]:
        return Recent(1)

    @cached_property
    def load_unit(self) -> float:
        """Length that stands for a load factor of 1 in the arc length."""
        return self.chain.length / (self.high - self.low)

    def running(self, theta: Array, segment: AnyArray, t: float, sign: float) -> Following:
        """From an equilibrium, first in the direction in which t has this sign; an interruption leaves the points."""
        track = Track([TrackPoint(t, theta)], [])
        try:
            if not self.stopped:
                yield from self.extend(track, theta, segment, t, sign)
        except KeyboardInterrupt:
            self.stopped = PathEnd.INTERRUPTED
        except OutOfTime:
            self.stopped = PathEnd.MAX_TIME
        if self.stopped:
            del track.stretches[len(track.points) - 1 :]  # one whose end was not reached
            track.ended = self.stopped
        return track

    def extend(
        self, track: Track, theta: Array, segment: AnyArray, t: float, sign: float
    ) -> Generator[PathProgress, bool | None, None]:
        """Append points to a track that holds the first one."""
        chain = self.chain
        border = np.zeros(chain.size + 1)
        border[-1] = sign
        tangent = self.tangent(theta, segment, t, border)
        turn, smooth, origin = sign, False, theta
        step = self.largest_step * chain.length
        while len(track.points) < self.max_points:
            check_time()
            self.budget.check()
            if tangent is None:
                track.ended = PathEnd.NOT_UNIQUE
                break
            if tangent[-1] * turn < 0.0:
                track.points[-1].fold = True
            turn = float(np.sign(tangent[-1])) or turn
            new, curved = self.advance(theta, segment, t, tangent, step)
            if isinstance(new, PathEnd):
                track.ended = new
                break
            made = _Step(self, theta, segment, t, tangent, new, smooth)
            reached = self.reached(made)
            if reached is not None:
                new, made = reached, replace(made, new=reached)
            for cut in self.cuts(made) if curved else self.whole(made):
                track.stretches.append(Stretch(made.inner, cut.negative, curved))
                track.points.append(cut.point)
                turn = -turn if cut.point.fold else turn
            theta, t = new.theta, new.t
            if (yield PathProgress(len(track.points), t)):
                raise KeyboardInterrupt
            if reached is not None:
                track.ended = PathEnd.UNTIL
                break
            if new.event is not None and new.event.of_load:
                track.ended = PathEnd.UPPER_END if t >= self.high else PathEnd.LOWER_END
                break
            if new.event is None:
                largest = self.largest_step * max(chain.length, float(np.abs(theta - origin).max()))
                largest *= _ON_THE_SPOT if self.still(tangent) else 1.0
                step = min(largest, 1.5 * new.length if new.easy else new.length)
            segment, smooth = new.segment, new.event is None
            tangent = self.heading(new.border) if smooth else self.tangent(theta, segment, t, new.border)

    def heading(self, unit: Array) -> Array:
        """A tangent (n + 1,) whose load is given as a length."""
        return np.append(unit[:-1], unit[-1] / self.load_unit)

    def still(self, tangent: Array) -> bool:
        """Whether the load hardly changes: the body slides on."""
        return abs(float(tangent[-1])) * self.load_unit < _STILL * float(np.abs(tangent[:-1]).max())

    def reached(self, step: _Step) -> FollowedPoint | None:
        """The first point of a step at which a quantity of ``until`` is zero, if there is one."""
        zeros = [self.zero_of(quantity, step) for quantity in self.until]
        return min((point for point in zeros if point is not None), key=lambda point: point.length, default=None)

    def zero_of(self, quantity: Quantity, step: _Step) -> FollowedPoint | None:
        """The point of a step at which a quantity is zero; None where it keeps its sign."""
        chain, new, inner, far = self.chain, step.new, step.inner, step.length
        ends = [quantity(*chain.local(theta, step.segment)) for theta in (step.theta, new.theta)]
        if ends[0] == 0.0 or ends[0] * ends[1] > 0.0:
            return None

        def point_at(length: float) -> tuple[Array, float]:
            return step.at(length) or (new.theta, new.t)

        def value(length: float) -> float:
            return quantity(*chain.local(point_at(length)[0], inner))

        length = far if ends[1] == 0.0 or value(0.0) * value(far) >= 0.0 else brentq(value, 0.0, far, xtol=1e-15 * far)
        return FollowedPoint(*point_at(length), inner, step.border, length=length)

    def advance(
        self, theta: Array, segment: AnyArray, t: float, v: Array, length: float
    ) -> tuple[FollowedPoint | PathEnd, bool]:
        """The next point along a tangent, and whether the path to it is curved."""
        if self.chain.pick(self.chain.affine, segment).all():
            return self.straight_step(theta, segment, t, v), False
        return self.curved_step(theta, segment, t, v, length), True

    def tangent(self, theta: Array, segment: AnyArray, t: float, border: Array) -> Array | None:
        """Unit tangent (dtheta, dt) on which ``border`` is positive."""
        n = self.chain.size
        chain, force, rate = self.body_at(theta, t)
        _, J = chain.balance(theta, segment, force)
        bordered = _Bordered.of(J, chain.moving(theta, segment), -rate / self.load_unit, border)
        try:
            v, off = bordered.solve(np.zeros(n), 1.0)
            good = off < 1e-6
        except np.linalg.LinAlgError:
            good = False
        if not good:
            _, values, rows = np.linalg.svd(np.hstack([J, -rate[:, None] / self.load_unit]))
            if n > 0 and values[-1] <= 1e-12 * values[0]:
                return None
            v = rows[-1] * (1.0 if rows[-1] @ border >= 0.0 else -1.0)
        v = v / np.linalg.norm(v)
        v[-1] /= self.load_unit
        moved = np.abs(v[:-1])
        v[:-1][moved < 1e-12 * moved.max(initial=0.0)] = 0.0
        # A load that changes by less than the rounding of the forces does not change: the body moves freely. At however
        # few points the load acts, it takes up the rounding of all forces together.
        if np.abs(rate * v[-1]).sum() < ROUNDING * bordered.work(moved):
            v[-1] = 0.0
        return np.asarray(v)

    def room(self, theta: Array, segment: AnyArray, t: float, v: Array) -> tuple[Array, float]:
        """How far each component can go along ``v`` on its segment, and the load in its range."""
        chain = self.chain
        low, high = chain.pick(chain.start, segment), chain.pick(chain.end, segment)
        rates = v[:-1]
        with np.errstate(divide="ignore", invalid="ignore"):
            far = np.where(rates > 0.0, (high - theta) / rates, np.where(rates < 0.0, (low - theta) / rates, np.inf))
        far = np.maximum(far, 0.0)
        bound = self.high if v[-1] > 0.0 else self.low
        load = max((bound - t) / v[-1], 0.0) if v[-1] != 0.0 else np.inf
        return far, float(load)

    def straight_step(self, theta: Array, segment: AnyArray, t: float, v: Array) -> FollowedPoint | PathEnd:
        """To the end of a straight stretch, or why there is no such point."""
        chain = self.chain
        far, load = self.room(theta, segment, t, v)
        i = int(np.argmin(far))
        if load <= far[i] * (1.0 + 1e-12) and np.isfinite(load):
            goal = self.high if v[-1] > 0.0 else self.low
            point = self.solve(theta + load * v[:-1], segment, goal, self.load_border, goal)
            return PathEnd.NOT_CORRECTED if point is None else self.at_load(*point, segment)
        if not np.isfinite(far[i]):
            return PathEnd.UNBOUNDED
        if np.count_nonzero(far <= far[i] + 1e-9 * chain.length) > 1:
            self.ties = True
        forward = bool(v[i] > 0.0)
        goal = float((chain.end if forward else chain.start)[i, segment[i]])
        point = self.solve(theta + far[i] * v[:-1], segment, t + far[i] * v[-1], self.component_border(i), goal)
        return PathEnd.NOT_CORRECTED if point is None else self.at_end(*point, segment, i, forward)

    @cached_property
    def load_border(self) -> Array:
        """The normal (n + 1,) of points at one load."""
        return self.component_border(-1)

    def component_border(self, i: int) -> Array:
        """The normal (n + 1,) of points at which a component has one value."""
        border = np.zeros(self.chain.size + 1)
        border[i] = 1.0
        return border

    def at_load(self, theta: Array, t: float, segment: AnyArray) -> FollowedPoint:
        """A point at an end of the load factors."""
        return FollowedPoint(theta, t, segment, self.load_border, PathEvent(self.load_border, segment))

    def at_end(self, theta: Array, t: float, segment: AnyArray, i: int, forward: bool) -> FollowedPoint:
        """A point at which a component leaves its segment."""
        beyond, border = segment.copy(), self.component_border(i)
        beyond[i] += 1 if forward else -1
        return FollowedPoint(theta, t, beyond, border if forward else -border, PathEvent(border, segment))

    def curved_step(
        self, theta: Array, segment: AnyArray, t: float, v: Array, length: float
    ) -> FollowedPoint | PathEnd:
        """A step of at most ``length`` in the arc length, to an event if there is one on the way."""
        chain = self.chain
        for _ in range(40):
            far, load = self.room(theta, segment, t, v)
            room = 1.05 * float(min(far.min(), load))  # a little too far, so that the event lies on the way
            reach = min(length, room) if room > 1e-12 * chain.length else length
            arrived = self.arc(theta, segment, t, v, reach)
            if arrived is None:
                length = 0.5 * reach
                continue
            new, new_t, steps = arrived
            low, high = chain.pick(chain.start, segment), chain.pick(chain.end, segment)
            slack = 1e-13 * chain.length
            outside = (new > high - slack) | (new < low + slack)
            # components that start at an end and move away from it are not at an event
            outside &= np.where(v[:-1] > 0.0, new > high - slack, new < low + slack) | (new > high) | (new < low)
            over = not self.low < new_t < self.high
            if not outside.any() and not over:
                unit = self.onward(theta, t, v, new, segment, new_t)
                if unit is not None:
                    return FollowedPoint(new, new_t, segment, unit, length=reach, easy=steps <= 4)
                length = 0.5 * reach
                continue
            event = self.event(theta, t, new, new_t, segment, low, high, outside, over)
            if event is not None:
                return event
            length = 0.5 * reach
        return PathEnd.NOT_CORRECTED

    def onward(self, theta: Array, t: float, v: Array, new: Array, segment: AnyArray, new_t: float) -> Array | None:
        """The tangent (n + 1,) at the end of a step along v, the load as a length; None where the path turns too far.

        Neither the tangent nor the chord may: a step that leads elsewhere would leave out what lies between.
        """
        old, chord = (
            np.append(step, load * self.load_unit) for step, load in ((v[:-1], v[-1]), (new - theta, new_t - t))
        )
        tangent = self.tangent(new, segment, new_t, old)
        if tangent is None:
            return None
        unit = np.append(tangent[:-1], tangent[-1] * self.load_unit)
        directions = np.stack([unit, chord])
        turned = (directions @ old < _TURNED * np.linalg.norm(old) * np.linalg.norm(directions, axis=1)).any()
        return None if turned and np.linalg.norm(chord) > 1e-9 * self.chain.length else unit

    def event(
        self,
        theta: Array,
        t: float,
        new: Array,
        new_t: float,
        segment: AnyArray,
        low: Array,
        high: Array,
        outside: BoolArray,
        over: bool,
    ) -> FollowedPoint | None:
        """The first end of a segment, or of the load factors, between two points."""
        best: tuple[float, int | None, float] = (np.inf, None, 0.0)
        for i in np.flatnonzero(outside):
            goal = float(high[i] if new[i] > theta[i] else low[i])
            part = (goal - theta[i]) / (new[i] - theta[i]) if new[i] != theta[i] else 0.0
            best = min(best, (part, int(i), goal), key=lambda item: item[0])
        if over:
            goal = self.high if new_t >= self.high else self.low
            part = (goal - t) / (new_t - t) if new_t != t else 0.0
            best = min(best, (part, None, goal), key=lambda item: item[0])
        part, component, goal = best
        border = self.load_border if component is None else self.component_border(component)
        point = self.solve(theta + part * (new - theta), segment, t + part * (new_t - t), border, goal)
        if point is None:
            return None
        tolerance = 1e-9 * self.chain.length
        if not self.chain.inside(point[0], segment, tolerance).all():
            return None
        if component is None:
            return self.at_load(*point, segment)
        if not self.low - 1e-12 <= point[1] <= self.high + 1e-12:
            return None
        return self.at_end(*point, segment, component, bool(new[component] > theta[component]))

    def arc(
        self, theta: Array, segment: AnyArray, t: float, v: Array, length: float
    ) -> tuple[Array, float, int] | None:
        """The point of the path at this distance along the tangent, and the steps to it."""
        unit = np.append(v[:-1], v[-1] * self.load_unit)
        unit /= np.linalg.norm(unit)
        return self.newton(theta + length * v[:-1], t + length * v[-1], unit, segment, steps=11)

    def solve(
        self, theta: Array, segment: AnyArray, t: float, border: Array, goal: float
    ) -> tuple[Array, float] | None:
        """The point of the path where ``border`` times (theta, t) is ``goal``: of theta alone, or of the load."""
        point = self.newton(*_onto(theta, t, border, goal), border, segment, steps=30)
        return None if point is None else _onto(point[0], point[1], border, goal)

    def at_the_load(self, theta: Array, segment: AnyArray, t: float) -> Array | None:
        """The point of the path near a place at which the load is t."""
        point = self.solve(theta, segment, t, self.load_border, t)
        return None if point is None else point[0]

    @property
    def force_size(self) -> float:
        """Largest entry of the load, or of the part that grows."""
        return float(np.abs(self.force0 + self.force1).max()) or float(np.abs(self.force1).max())

    def newton(
        self, theta: Array, t: float, border: Array, segment: AnyArray, steps: int
    ) -> tuple[Array, float, int] | None:
        """Newton's method on the plane through a point that is normal to ``border``; and the number of its steps."""
        last = np.inf
        for step in range(1, steps + 1):
            with np.errstate(over="ignore", invalid="ignore"):  # far beyond the ends of a segment, where it is lost
                chain, force, rate = self.body_at(theta, t)
                F, J = chain.balance(theta, segment, force)
            bordered = _Bordered.of(J, chain.moving(theta, segment), -rate / self.load_unit, border)
            try:
                change, _ = bordered.solve(-F, 0.0)
            except np.linalg.LinAlgError:
                return None
            if not np.isfinite(change).all():
                return None
            before, theta, t = theta, theta + change[:-1], float(t + change[-1] / self.load_unit)
            size = float(np.abs(change).max()) / max(self.chain.length, float(np.abs(theta).max()))
            # Corrections that no longer shrink are the rounding of the law.
            if size <= 1e-14 or (size <= 1e-9 and size >= 0.5 * last):
                return theta, t, step
            if size <= COUNTS and chain.rounds(F, before, segment, force):
                return theta, t, step
            last = size
        return None

    def whole(self, step: _Step) -> list[_Cut]:
        """A straight step: the Hessian is the same all along."""
        return [_Cut(np.inf, step.new.on_track, self.negative(*step.middle))]

    def cuts(self, step: _Step) -> list[_Cut]:
        """A curved step, cut where the load turns and where directions in which the energy falls come or go."""
        fold = self.change(step, self.rising, step.rates)
        count, after = (self._falling(*end) for end in step.ends)
        inner = [] if fold is None else [_Cut(fold[0], TrackPoint(fold[2], fold[1], fold=True))]
        counts = [(0.0, count)]
        if fold is not None and count != after and self._counts_beside(step, fold[0]) == [count, after]:
            counts.append((fold[0], after))
        while counts[-1][1] != after and len(counts) <= _CHANGES:
            change = self.change(step, self.same_count(counts[-1][1]), (1.0, -1.0), counts[-1][0])
            beyond = None if change is None else step.at(change[0] * (1.0 + _SAME))
            if change is None or beyond is None:
                break
            counts.append((change[0], self.negative(beyond[0], step.inner, beyond[1])))
            if fold is None or abs(change[0] - fold[0]) > _SAME * max(change[0], fold[0]):
                inner.append(_Cut(change[0], TrackPoint(change[2], change[1])))
        last = after if inner else max(count, after)
        steps = sorted(inner, key=lambda cut: cut.length)
        known = [replace(cut, negative=_count_before(counts, cut.length)) for cut in steps]
        return [*known, _Cut(np.inf, step.new.on_track, last)]

    def _counts_beside(self, step: _Step, length: float) -> list[int]:
        """Falling directions a little before a distance of a step, and a little beyond it."""
        points = [step.at(length * (1.0 + part)) for part in (-_SAME, _SAME)]
        return [self.negative(point[0], step.inner, point[1]) for point in points if point is not None]

    def rising(self, theta: Array, segment: AnyArray, t: float, border: Array) -> float:
        """The rate of the load along the path, nan where it has no tangent."""
        tangent = self.tangent(theta, segment, t, border)
        return np.nan if tangent is None else float(tangent[-1])

    def same_count(self, count: int) -> Measure:
        """1 where the energy falls in so many directions, else -1."""
        return lambda theta, segment, t, border: 1.0 if self.negative(theta, segment, t) == count else -1.0

    def change(
        self, step: _Step, measure: Measure, ends: tuple[float, float], begin: float = 0.0
    ) -> tuple[float, Array, float] | None:
        """Where a measure changes its sign beyond a distance of a curved step: distance, point, load.

        At both ends it is ``ends``.
        """
        a, b = begin, step.length
        fa, fb = ends
        if not fa * fb < 0.0:
            return None
        change: tuple[float, Array, float] | None = None
        for k in range(100):
            length = (a * fb - b * fa) / (fb - fa) if k % 3 < 2 else 0.5 * (a + b)
            point = step.at(length)
            if point is None:
                break
            change = length, *point
            f = measure(point[0], step.inner, point[1], step.border)
            if not abs(f) > 0.0 or abs(b - a) <= 1e-13 * abs(step.length):
                break
            if f * fa > 0.0:
                a, fa = length, f
            else:
                b, fb = length, f
        return change


@dataclass(frozen=True, eq=False)
class _Bordered:
    """The rows ``[J, column] x`` of a path and a border, factored: columns of J that are diagonal are eliminated."""

    moving: BoolArray  # (n,): which columns are not
    diagonal: Array  # (n - k,): of the others
    follow: Array  # (k + 1, n): the columns of all x that are solved for
    through: Array  # (n - k,): what the border asks of each row that is eliminated
    scale: float
    matrix: Array  # (k + 1, k + 1)

    @staticmethod
    def of(J: Array, moving: BoolArray, column: Array, border: Array) -> _Bordered:
        follow, diagonal = np.vstack([J.T[moving], column]), np.diagonal(J)[~moving]
        scale = (
            max(-follow[:-1].min(initial=0.0), follow[:-1].max(initial=0.0), np.abs(diagonal).max(initial=0.0)) or 1.0
        )
        through = border[:-1][~moving] / diagonal
        transposed = np.empty((len(follow), len(follow)))
        np.divide(follow[:, moving], scale, out=transposed[:, :-1])
        transposed[:, -1] = np.append(border[:-1][moving], border[-1]) - follow[:, ~moving] @ through
        return _Bordered(moving, diagonal, follow, through, scale, transposed.T)

    @cached_property
    def _factors(self) -> tuple[Array, Array]:
        factor, pivots, failed = la.lapack.dgetrf(self.matrix)
        if failed:
            raise np.linalg.LinAlgError
        return factor, pivots

    def solve(self, rhs: Array, goal: float) -> tuple[Array, float]:
        """x (n + 1,) at which the rows are ``rhs`` and the border times x is a goal; and how much of 1 that misses."""
        own, others = self.moving, ~self.moving
        right = np.append(rhs[own] / self.scale, goal - self.through @ rhs[others])
        inner = la.lapack.dgetrs(*self._factors, right)[0]
        x = np.empty(own.size + 1)
        x[:-1][own], x[-1] = inner[:-1], inner[-1]
        x[:-1][others] = (rhs[others] - inner @ self.follow[:, others]) / self.diagonal
        off = float(np.abs(self.matrix @ inner - right).max()) if np.isfinite(x).all() else np.inf
        return x, off

    def work(self, moved: Array) -> float:
        """The sum of the sizes of all forces of a motion (n,)."""
        columns = np.abs(self.follow[:-1]).sum(axis=1)
        return float(columns @ moved[self.moving] + np.abs(self.diagonal) @ moved[~self.moving])


@dataclass(frozen=True, eq=False)
class FollowedPoint:
    """The end of a step: the segments on which the path goes on, and the direction in which it does.

    ``event`` says what fixes the point, if not the length of the step; ``easy`` that the step may grow.  ``rate`` is
    that of the load, as a length, with which the path comes to an event; zero where it is not known.
    """

    theta: Array
    t: float
    segment: AnyArray
    border: Array  # (n + 1,)
    event: PathEvent | None = None
    length: float = np.inf
    easy: bool = True
    rate: float = 0.0

    @property
    def on_track(self) -> TrackPoint:
        """It as a point of the path."""
        return TrackPoint(self.t, self.theta, self.event)

    @property
    def reached_on(self) -> AnyArray:
        """The segments on which the step comes to it."""
        return self.segment if self.event is None else self.event.segment


#: theta (n,) with its segments and its load.
_State: TypeAlias = tuple[Array, AnyArray, float]


@dataclass(frozen=True, eq=False)
class _Step:
    """A step of the path: where it begins, the tangent there, where it ends, and whether it begins within pieces."""

    follower: Follower
    theta: Array
    segment: AnyArray
    t: float
    v: Array
    new: FollowedPoint
    smooth: bool

    @cached_property
    def border(self) -> Array:
        """The unit tangent (n + 1,), the load as a length."""
        unit = np.append(self.v[:-1], self.v[-1] * self.follower.load_unit)
        return np.asarray(unit / np.linalg.norm(unit))

    @cached_property
    def length(self) -> float:
        """How far the end lies along the tangent."""
        onward = np.append(self.new.theta - self.theta, (self.new.t - self.t) * self.follower.load_unit)
        return float(onward @ self.border)

    @cached_property
    def inner(self) -> AnyArray:
        """The segments of what lies between its ends."""
        return self.follower.chain.between(self.segment)

    @property
    def middle(self) -> _State:
        """The middle of the chord."""
        return 0.5 * (self.theta + self.new.theta), self.inner, 0.5 * (self.t + self.new.t)

    @cached_property
    def ends(self) -> tuple[_State, _State]:
        """Both ends on the segments that the step has there; a little within where they end there."""
        increment, load, new = self.new.theta - self.theta, self.new.t - self.t, self.new
        first, last = 0.0 if self.smooth else _SAME, 0.0 if new.event is None else _SAME
        begin = self.theta + first * increment, self.segment, self.t + first * load
        return begin, (new.theta - last * increment, new.reached_on, new.t - last * load)

    @cached_property
    def rates(self) -> tuple[float, float]:
        """The rate of the load at both ends: of their tangents; a little within where that is zero or not known."""
        (first, last), rising = self.ends, self.follower.rising
        end = (self.new.border[-1] if self.new.event is None else self.new.rate) / self.follower.load_unit
        return float(self.v[-1]) or rising(*first, self.border), float(end) or rising(*last, self.border)

    def at(self, length: float) -> tuple[Array, float] | None:
        """The point of the path at a distance along the tangent; it is sought near the chord, for the path may turn."""
        part = length / self.length
        theta = self.theta + part * (self.new.theta - self.theta)
        point = self.follower.newton(theta, self.t + part * (self.new.t - self.t), self.border, self.inner, steps=11)
        return None if point is None else point[:2]


@dataclass(frozen=True, eq=False)
class _Cut:
    """A point of the path, its distance from the last corrected one, and the falling directions of all before it."""

    length: float
    point: TrackPoint
    negative: int = 0


def _count_before(counts: list[tuple[float, int]], length: float) -> int:
    """The count that holds up to a distance, where counts hold from distances on."""
    return next(count for begin, count in reversed(counts) if begin < length * (1.0 - 2.0 * _SAME) or begin == 0.0)


def _onto(theta: Array, t: float, border: Array, goal: float) -> tuple[Array, float]:
    """The nearest point with ``border`` times (theta, t) equal to ``goal``, exactly for one component or the load."""
    theta = theta.copy()
    part = np.flatnonzero(border[:-1])
    if border[-1] != 0.0:
        return theta, goal / float(border[-1])
    if part.size == 1:
        theta[part] = goal / border[part]
    else:
        theta += border[:-1] * ((goal - float(border[:-1] @ theta)) / float(border[:-1] @ border[:-1]))
    return theta, t


def trace(
    chain: Chain, force: Array, rate: Array, theta: Array, segment: AnyArray, low: float, high: float, points: int = 200
) -> list[tuple[Array, AnyArray]]:
    """Equilibria at the load ``force`` that lie on the path through one of them, with loads ``force + t rate``.

    The path is followed from ``t = 0`` in both directions until t leaves ``[low, high]``.
    """
    equilibria: list[tuple[Array, AnyArray]] = []
    for sign in (1.0, -1.0):
        follower = Follower(chain, force, rate, low, high, points, 0.05)
        track = result_of(follower.running(theta, segment, 0.0, sign))
        if follower.stopped is PathEnd.INTERRUPTED:
            raise KeyboardInterrupt
        check_time()
        for (before, after), stretch in zip(itertools.pairwise(track.points), track.stretches, strict=True):
            if before.t * after.t < 0.0:
                part = -before.t / (after.t - before.t)
                equilibria.append((before.theta + part * (after.theta - before.theta), stretch.segment))
            elif after.t == 0.0:
                equilibria.append((after.theta, stretch.segment))
    return equilibria
