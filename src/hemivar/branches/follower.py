"""The curve of equilibria over the load: from corner to corner where it is straight, else by arc length."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from hemivar.basics.deadline import Budget, OutOfTime, check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.generators import result_of
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.branches.chain import CORRECTION, ROUNDING, Chain
from hemivar.branches.path import PathEnd

__all__ = ["Follower", "Following", "PathEvent", "PathProgress", "Track", "trace"]


@dataclass(frozen=True, eq=False)
class PathEvent:
    """What fixes a point of the path: a component at the end of its segment, or the load (None)."""

    component: int | None
    segment: IntArray


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
    """What lies between a point and the next."""

    segment: IntArray
    stable: bool
    curved: bool


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


#: A number that tells by its sign on which side of a change a point of a segment lies; it also takes the border.
Measure: TypeAlias = Callable[[Array, IntArray, Array], float]

#: A path at work.
Following: TypeAlias = Generator[PathProgress, bool | None, Track]


@dataclass(eq=False)
class Follower:
    """Follows the zeros of ``F(theta, t)``, the load being ``force0 + t force1``, from ``low`` to ``high``.

    ``ties`` says afterwards whether several components met an event at once, ``stopped`` why it gave up, if it did.
    """

    chain: Chain
    force0: Array
    force1: Array
    low: float
    high: float
    max_points: int
    largest_step: float
    budget: Budget = field(default_factory=lambda: Budget(np.inf))
    ties: bool = False
    stopped: PathEnd | None = None

    def force(self, t: float) -> Array:
        return self.force0 + t * self.force1

    @cached_property
    def load_unit(self) -> float:
        """Length that stands for a load factor of 1 in the arc length."""
        return self.chain.length / (self.high - self.low)

    def running(self, theta: Array, segment: IntArray, t: float, sign: float) -> Following:
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
        self, track: Track, theta: Array, segment: IntArray, t: float, sign: float
    ) -> Generator[PathProgress, bool | None, None]:
        """Append points to a track that holds the first one."""
        chain = self.chain
        border = np.zeros(chain.size + 1)
        border[-1] = sign
        tangent = self.tangent(theta, segment, border)
        turn = sign
        step = self.largest_step * chain.length
        while len(track.points) < self.max_points:
            check_time()
            self.budget.check()
            if tangent is None:
                track.ended = PathEnd.NOT_UNIQUE
                break
            curved = not bool(chain.pick(chain.affine, segment).all())
            if tangent[-1] * turn < 0.0:
                track.points[-1].fold = True
            turn = float(np.sign(tangent[-1])) or turn
            if curved:
                new = self.curved_step(theta, segment, t, tangent, step)
            else:
                new = self.straight_step(theta, segment, t, tangent)
            if isinstance(new, PathEnd):
                track.ended = new
                break
            cuts = self.cuts(theta, segment, t, tangent, new) if curved else self.whole(theta, segment, new)
            for cut in cuts:
                track.stretches.append(Stretch(segment, cut.stable, curved))
                track.points.append(cut.point)
                turn = -turn if cut.point.fold else turn
            theta, t = new.theta, new.t
            if (yield PathProgress(len(track.points), t)):
                raise KeyboardInterrupt
            if new.component is None and new.limit:
                track.ended = PathEnd.UPPER_END if t >= self.high else PathEnd.LOWER_END
                break
            border = np.zeros(chain.size + 1)
            if new.component is not None:
                move = 1 if new.forward else -1
                segment = segment.copy()
                segment[new.component] += move
                border[new.component] = move
            else:
                border[:] = new.tangent
                step = min(self.largest_step * chain.length, 1.5 * new.length if new.easy else new.length)
            tangent = self.tangent(theta, segment, border)

    def tangent(self, theta: Array, segment: IntArray, border: Array) -> Array | None:
        """Unit tangent (dtheta, dt) on which ``border`` is positive."""
        n = self.chain.size
        _, J = self.chain.balance(theta, segment, self.force0)
        scale = np.abs(J).max() or 1.0
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = J / scale
        matrix[:n, n] = -self.force1 / scale / self.load_unit
        matrix[n] = border
        rhs = np.zeros(n + 1)
        rhs[n] = 1.0
        try:
            v = np.linalg.solve(matrix, rhs)
            good = np.isfinite(v).all() and np.abs(matrix @ v - rhs).max() < 1e-6
        except np.linalg.LinAlgError:
            good = False
        if not good:
            _, values, rows = np.linalg.svd(matrix[:n])
            if n > 0 and values[-1] <= 1e-12 * values[0]:
                return None
            v = rows[-1] * (1.0 if rows[-1] @ border >= 0.0 else -1.0)
        v = v / np.linalg.norm(v)
        v[-1] /= self.load_unit
        moved = np.abs(v[:-1])
        v[:-1][moved < 1e-12 * moved.max(initial=0.0)] = 0.0
        # A load that changes by less than the rounding of the forces does not change: the body moves freely. At however
        # few points the load acts, it takes up the rounding of all forces together.
        if np.abs(self.force1 * v[-1]).sum() < ROUNDING * (np.abs(J) @ moved).sum():
            v[-1] = 0.0
        return np.asarray(v)

    def room(self, theta: Array, segment: IntArray, t: float, v: Array) -> tuple[Array, float]:
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

    def straight_step(self, theta: Array, segment: IntArray, t: float, v: Array) -> _Point | PathEnd:
        """To the end of a straight stretch, or why there is no such point."""
        chain = self.chain
        far, load = self.room(theta, segment, t, v)
        i = int(np.argmin(far))
        if load <= far[i] * (1.0 + 1e-12) and np.isfinite(load):
            goal = self.high if v[-1] > 0.0 else self.low
            found = self.solve(theta + load * v[:-1], segment, goal, None, goal)
            return PathEnd.NOT_CORRECTED if found is None else _Point(*found, None, False, limit=True)
        if not np.isfinite(far[i]):
            return PathEnd.UNBOUNDED
        if np.count_nonzero(far <= far[i] + 1e-9 * chain.length) > 1:
            self.ties = True
        forward = bool(v[i] > 0.0)
        goal = float((chain.end if forward else chain.start)[i, segment[i]])
        found = self.solve(theta + far[i] * v[:-1], segment, t + far[i] * v[-1], i, goal)
        return PathEnd.NOT_CORRECTED if found is None else _Point(*found, i, forward)

    def curved_step(self, theta: Array, segment: IntArray, t: float, v: Array, length: float) -> _Point | PathEnd:
        """A step of at most ``length`` in the arc length, to an event if there is one on the way."""
        chain = self.chain
        for _ in range(40):
            far, load = self.room(theta, segment, t, v)
            room = 1.05 * float(min(far.min(), load))  # a little too far, so that the event lies on the way
            reach = min(length, room) if room > 1e-12 * chain.length else length
            found = self.arc(theta, segment, t, v, reach)
            if found is None:
                length = 0.5 * reach
                continue
            new, new_t, steps = found
            low, high = chain.pick(chain.start, segment), chain.pick(chain.end, segment)
            slack = 1e-13 * chain.length
            outside = (new > high - slack) | (new < low + slack)
            # components that start at an end and move away from it are not at an event
            outside &= np.where(v[:-1] > 0.0, new > high - slack, new < low + slack) | (new > high) | (new < low)
            over = not self.low < new_t < self.high
            if not outside.any() and not over:
                border = np.append(v[:-1], v[-1] * self.load_unit)
                tangent = self.tangent(new, segment, border)
                if tangent is None:
                    length = 0.5 * reach
                    continue
                unit = np.append(tangent[:-1], tangent[-1] * self.load_unit)
                old = border / np.linalg.norm(border)
                if unit @ old < 0.95 and reach > 1e-9 * chain.length:
                    length = 0.5 * reach
                    continue
                return _Point(new, new_t, None, False, tangent=unit, length=reach, easy=steps <= 4)
            event = self.event(theta, t, new, new_t, segment, low, high, outside, over)
            if event is not None:
                return event
            length = 0.5 * reach
        return PathEnd.NOT_CORRECTED

    def event(
        self,
        theta: Array,
        t: float,
        new: Array,
        new_t: float,
        segment: IntArray,
        low: Array,
        high: Array,
        outside: BoolArray,
        over: bool,
    ) -> _Point | None:
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
        found = self.solve(theta + part * (new - theta), segment, t + part * (new_t - t), component, goal)
        if found is None:
            return None
        tolerance = 1e-9 * self.chain.length
        if not self.chain.inside(found[0], segment, tolerance).all():
            return None
        if component is None:
            return _Point(*found, None, False, limit=True)
        if not self.low - 1e-12 <= found[1] <= self.high + 1e-12:
            return None
        return _Point(*found, component, bool(new[component] > theta[component]))

    def arc(
        self, theta: Array, segment: IntArray, t: float, v: Array, length: float
    ) -> tuple[Array, float, int] | None:
        """The point of the path at this distance along the tangent, and the steps to it."""
        unit = np.append(v[:-1], v[-1] * self.load_unit)
        unit /= np.linalg.norm(unit)
        return self.newton(theta + length * v[:-1], segment, t + length * v[-1], unit, steps=11)

    def solve(
        self, theta: Array, segment: IntArray, t: float, component: int | None, goal: float
    ) -> tuple[Array, float] | None:
        """The point of the path where a component (or the load, if None) has the value ``goal``."""
        border = np.zeros(self.chain.size + 1)
        border[-1 if component is None else component] = 1.0
        start = theta.copy()
        if component is not None:
            start[component] = goal
        found = self.newton(start, segment, goal if component is None else t, border, steps=30)
        if found is None:
            return None
        theta, t, _ = found
        if component is None:
            return theta, goal
        theta[component] = goal
        return theta, t

    def newton(
        self, theta: Array, segment: IntArray, t: float, border: Array, steps: int
    ) -> tuple[Array, float, int] | None:
        """Newton's method on the plane through a point that is normal to ``border``; and the number of its steps."""
        last = np.inf
        for step in range(1, steps + 1):
            with np.errstate(over="ignore", invalid="ignore"):  # far beyond the ends of a segment, where it is lost
                F, J = self.chain.balance(theta, segment, self.force(t))
            change = self.bordered(F, J, border)
            if change is None or not np.isfinite(change).all():
                return None
            exact = self.chain.rounds(F, theta, segment, self.force(t))
            theta, t = theta + change[:-1], float(t + change[-1] / self.load_unit)
            size = float(np.abs(change).max()) / max(self.chain.length, float(np.abs(theta).max()))
            # Corrections that no longer shrink are the rounding of the law.
            if size <= (CORRECTION if exact else 1e-14) or (size <= 1e-9 and size >= 0.5 * last):
                return theta, t, step
            last = size
        return None

    def bordered(self, F: Array, J: Array, border: Array) -> Array | None:
        """Newton's step in (theta, t load_unit), normal to ``border``."""
        n = self.chain.size
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = J
        matrix[:n, n] = -self.force1 / self.load_unit
        matrix[n] = border * np.abs(J).max()
        try:
            return np.asarray(np.linalg.solve(matrix, np.append(-F, 0.0)))
        except np.linalg.LinAlgError:
            return None

    def whole(self, theta: Array, segment: IntArray, new: _Point) -> list[_Cut]:
        """A straight step: the Hessian is the same all along."""
        return [_Cut(np.inf, new.on_track(segment), self.chain.stable(0.5 * (theta + new.theta), segment))]

    def cuts(self, theta: Array, segment: IntArray, t: float, v: Array, new: _Point) -> list[_Cut]:
        """A curved step, cut where the load turns and where stability changes."""
        fold = self.change(theta, segment, t, v, new, self.rising)
        found = self.change(theta, segment, t, v, new, self.steady)
        before, after = (self.chain.stable(point, segment) for point in _within(theta, new.theta))
        inner = [] if fold is None else [_Cut(fold[0], TrackPoint(fold[2], fold[1], fold=True))]
        if found is not None and (fold is None or abs(found[0] - fold[0]) > 1e-6 * max(found[0], fold[0])):
            inner.append(_Cut(found[0], TrackPoint(found[2], found[1])))
        where, after = (inner[-1].length, after) if inner else (0.0, before and after)
        steps = [*sorted(inner, key=lambda cut: cut.length), _Cut(np.inf, new.on_track(segment))]
        return [replace(cut, stable=before if cut.length <= where else after) for cut in steps]

    def rising(self, theta: Array, segment: IntArray, border: Array) -> float:
        """The rate of the load along the path, nan where it has no tangent."""
        tangent = self.tangent(theta, segment, border)
        return np.nan if tangent is None else float(tangent[-1])

    def steady(self, theta: Array, segment: IntArray, border: Array) -> float:
        """1 where the point is stable, else -1."""
        return 1.0 if self.chain.stable(theta, segment) else -1.0

    def change(
        self, theta: Array, segment: IntArray, t: float, v: Array, new: _Point, measure: Measure
    ) -> tuple[float, Array, float] | None:
        """Where a measure changes its sign between two points of a curved path: distance, point, load."""
        border = np.append(v[:-1], v[-1] * self.load_unit)
        far = float(np.append(new.theta - theta, (new.t - t) * self.load_unit) @ border / np.linalg.norm(border))
        a, b = 0.0, far
        fa, fb = (measure(point, segment, border) for point in _within(theta, new.theta))
        if not fa * fb < 0.0:
            return None
        place: tuple[float, Array, float] | None = None
        for k in range(100):
            length = (a * fb - b * fa) / (fb - fa) if k % 3 < 2 else 0.5 * (a + b)
            found = self.arc(theta, segment, t, v, length)
            if found is None:
                break
            place = length, found[0], found[1]
            f = measure(found[0], segment, border)
            if not abs(f) > 0.0 or abs(b - a) <= 1e-13 * abs(far):
                break
            if f * fa > 0.0:
                a, fa = length, f
            else:
                b, fb = length, f
        return place


@dataclass(frozen=True, eq=False)
class _Point:
    theta: Array
    t: float
    component: int | None
    forward: bool
    limit: bool = False
    tangent: Array = field(default_factory=lambda: np.zeros(0))
    length: float = np.inf
    easy: bool = True

    def on_track(self, segment: IntArray) -> TrackPoint:
        """It as a point of the path."""
        fixed = self.component is not None or self.limit
        return TrackPoint(self.t, self.theta, PathEvent(self.component, segment) if fixed else None)


@dataclass(frozen=True, eq=False)
class _Cut:
    """A point of the path, its distance from the last corrected one, and whether all before it is stable."""

    length: float
    point: TrackPoint
    stable: bool = False


def _within(first: Array, last: Array) -> tuple[Array, Array]:
    """Two points of a chord a little within its ends, where other segments may begin."""
    little = 1e-6 * (last - first)
    return first + little, last - little


def trace(
    chain: Chain, force: Array, rate: Array, theta: Array, segment: IntArray, low: float, high: float, points: int = 200
) -> list[tuple[Array, IntArray]]:
    """Equilibria at the load ``force`` that lie on the path through one of them, with loads ``force + t rate``.

    The path is followed from ``t = 0`` in both directions until t leaves ``[low, high]``.
    """
    found: list[tuple[Array, IntArray]] = []
    for sign in (1.0, -1.0):
        follower = Follower(chain, force, rate, low, high, points, 0.05)
        track = result_of(follower.running(theta, segment, 0.0, sign))
        if follower.stopped is PathEnd.INTERRUPTED:
            raise KeyboardInterrupt
        check_time()
        for (one, other), stretch in zip(itertools.pairwise(track.points), track.stretches, strict=True):
            if one.t * other.t < 0.0:
                part = -one.t / (other.t - one.t)
                found.append((one.theta + part * (other.theta - one.theta), stretch.segment))
            elif other.t == 0.0:
                found.append((other.theta, stretch.segment))
    return found
