"""The curve of equilibria over the load: from corner to corner where it is straight, else by arc length."""

from __future__ import annotations

import itertools
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from hemivar.basics.deadline import Budget, OutOfTime, check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.generators import result_of
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.branches.chain import Chain
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
            new = self.curved_step(theta, segment, t, tangent, step) if curved else None
            if curved and new is None:
                track.ended = PathEnd.NOT_CORRECTED
                break
            if new is None:
                new = self.straight_step(theta, segment, t, tangent)
            if new is None:
                track.ended = PathEnd.UNBOUNDED
                break
            fold = self.fold_between(theta, segment, t, tangent, new) if curved else None
            if fold is not None:
                track.stretches.append(Stretch(segment, chain.stable(0.5 * (theta + fold[0]), segment), curved))
                track.points.append(TrackPoint(fold[1], fold[0], fold=True))
                theta, turn = fold[0], -turn
            fixed = new.component is not None or new.limit
            track.stretches.append(Stretch(segment, chain.stable(0.5 * (theta + new.theta), segment), curved))
            track.points.append(TrackPoint(new.t, new.theta, PathEvent(new.component, segment) if fixed else None))
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
        v[np.abs(v) < 1e-14 * np.abs(v).max()] = 0.0
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

    def straight_step(self, theta: Array, segment: IntArray, t: float, v: Array) -> _Point | None:
        """To the end of a straight stretch."""
        chain = self.chain
        far, load = self.room(theta, segment, t, v)
        i = int(np.argmin(far))
        if load <= far[i] * (1.0 + 1e-12) and np.isfinite(load):
            goal = self.high if v[-1] > 0.0 else self.low
            found = self.solve(theta + load * v[:-1], segment, goal, None, goal)
            return None if found is None else _Point(*found, None, False, limit=True)
        if not np.isfinite(far[i]):
            return None
        if np.count_nonzero(far <= far[i] + 1e-9 * chain.length) > 1:
            self.ties = True
        forward = bool(v[i] > 0.0)
        goal = float((chain.end if forward else chain.start)[i, segment[i]])
        found = self.solve(theta + far[i] * v[:-1], segment, t + far[i] * v[-1], i, goal)
        return None if found is None else _Point(*found, i, forward)

    def curved_step(self, theta: Array, segment: IntArray, t: float, v: Array, length: float) -> _Point | None:
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
        return None

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
        """The point of the path at this distance along the tangent."""
        n = self.chain.size
        new, new_t = theta + length * v[:-1], t + length * v[-1]
        unit = np.append(v[:-1], v[-1] * self.load_unit)
        unit /= np.linalg.norm(unit)
        change: Array | None = None
        for step in range(1, 12):
            change = self.bordered(new, segment, new_t, unit, 0.0)
            if change is None:
                return None
            new, new_t = new + change[:n], new_t + change[n] / self.load_unit
            if not np.isfinite(new).all():
                return None
            if np.abs(change).max() <= 1e-14 * max(self.chain.length, float(np.abs(new).max())):
                return new, new_t, step
        good = change is not None and np.abs(change).max() <= 1e-11 * self.chain.length
        return (new, new_t, step) if good else None

    def bordered(self, theta: Array, segment: IntArray, t: float, border: Array, rhs: float) -> Array | None:
        """Newton's step in (theta, t load_unit) with one more row."""
        n = self.chain.size
        F, J = self.chain.balance(theta, segment, self.force(t))
        matrix = np.zeros((n + 1, n + 1))
        matrix[:n, :n] = J
        matrix[:n, n] = -self.force1 / self.load_unit
        matrix[n] = border * np.abs(J).max()
        try:
            return np.asarray(np.linalg.solve(matrix, np.append(-F, rhs * np.abs(J).max())))
        except np.linalg.LinAlgError:
            return None

    def solve(
        self, theta: Array, segment: IntArray, t: float, component: int | None, goal: float
    ) -> tuple[Array, float] | None:
        """The point of the path where a component (or the load, if None) has the value ``goal``."""
        n = self.chain.size
        border = np.zeros(n + 1)
        border[n if component is None else component] = 1.0
        last = np.inf
        for _ in range(30):
            off = (goal - t) * self.load_unit if component is None else goal - theta[component]
            change = self.bordered(theta, segment, t, border, off)
            if change is None or not np.isfinite(change).all():
                return None
            theta, t = theta + change[:n], t + change[n] / self.load_unit
            size = float(np.abs(change).max()) / max(self.chain.length, float(np.abs(theta).max()))
            # Corrections that no longer shrink are the rounding of an ill-conditioned system.
            if size <= 1e-14 or (size <= 1e-9 and size >= 0.5 * last):
                break
            last = size
        else:
            return None
        if component is None:
            t = goal
        else:
            theta[component] = goal
        return theta, float(t)

    def fold_between(
        self, theta: Array, segment: IntArray, t: float, v: Array, new: _Point
    ) -> tuple[Array, float] | None:
        """The point between the two where the load turns, if there is one."""
        border = np.append(v[:-1], v[-1] * self.load_unit)
        end = self.tangent(new.theta, segment, border)
        if end is None or end[-1] * v[-1] >= 0.0:
            return None
        unit = border / np.linalg.norm(border)
        far = float(np.append(new.theta - theta, (new.t - t) * self.load_unit) @ unit)
        a, fa, b, fb = 0.0, float(v[-1]), far, float(end[-1])
        point: tuple[Array, float] | None = None
        for k in range(100):
            length = (a * fb - b * fa) / (fb - fa) if k % 3 < 2 else 0.5 * (a + b)
            found = self.arc(theta, segment, t, v, length)
            if found is None:
                return point
            point = found[0], found[1]
            tangent = self.tangent(found[0], segment, border)
            if tangent is None:
                return point
            f = float(tangent[-1])
            if f == 0.0 or abs(b - a) <= 1e-13 * abs(far):
                break
            if f * fa > 0.0:
                a, fa = length, f
            else:
                b, fb = length, f
        return point


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
