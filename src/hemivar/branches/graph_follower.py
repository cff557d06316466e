"""Continuation in Minty's chart: from corner to corner where laws are straight, else by arc length; through corners."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.branches.follower import FollowedPoint, Follower, PathEvent
from hemivar.branches.graph_chart import BESIDE, FREE, STRAIGHT, Corner, GraphChart
from hemivar.branches.path import SAME_LOAD, PathEnd
from hemivar.systems.curves import ROUNDING

__all__ = ["GraphFollower", "OutOfChartError"]

#: Sine of the angle by which a graph turns in a curved step at most; it is halved with the step where that fails. 0.1
#: and 0.3 give the same paths in tests/branches; at 0.4 one in test_nonlinear_follower.py leaves at the wrong end.
_CURVED = 0.2
#: Halves of a long increment at which corners are looked for: 2^-8 of it is the shortest. 4 and 16 give the same paths
#: in tests/branches.
_HALVES = 8
#: Part of the length on which it is seen whether the path is straight. 1e-2 and 1e-4 give the same paths in
#: tests/branches.
_PROBE = 1e-3
#: How far corners are looked for, in lengths, where the load has ceased to change; 1e5 and 1e7 give the same paths in
#: tests/branches.
_FAR = 1e6
#: Rounds in which a curved corner is located, each by a corrector. Six are enough in tests/branches.
_ROUNDS = 12
#: Distance from a corner, relative to the length, that is none: ten times the rounding of theta. 1e-10 and 1e-12 give
#: the same paths in tests/branches.
_ON = 1e-11
#: Directions that are tried where several contact points meet a corner together. All, one alone, and all but one come
#: first, so that 30 are enough in tests/branches; of k points there are 2^k - 1.
_DIRECTIONS = 300


class OutOfChartError(Exception):
    """The law falls faster at a pair ``r, lam`` than the chart allows."""

    def __init__(self, pair: tuple[Array, Array]) -> None:
        super().__init__()
        self.pair = pair


@dataclass(eq=False)
class GraphFollower(Follower):
    """Follows ``F(theta, t) = 0`` in Minty's chart, see :class:`Follower`."""

    chain: GraphChart  # type: ignore[assignment]

    def advance(
        self, theta: Array, segment: Array, t: float, v: Array, length: float
    ) -> tuple[FollowedPoint | PathEnd, bool]:
        self.check_chart(theta)
        end = self.straight(theta, segment, t, v)
        if end is None and self.slides_away(theta, segment, v):
            end = PathEnd.UNBOUNDED
        return (self.curved_step(theta, segment, t, v, length), True) if end is None else (end, False)

    def slides_away(self, theta: Array, side: Array, v: Array) -> bool:
        """Whether the load has ceased to change, and no corner lies ahead; what is left of it falls like 1/slip."""
        chain, moves = self.chain, max(float(np.abs(v[:-1]).max()), 1e-300)
        gone = max(float(np.abs(theta).max()), _PROBE * chain.length)
        if abs(float(v[-1])) * gone > SAME_LOAD * (self.high - self.low) * moves:
            return False
        return chain.leaves(theta, side, _FAR * chain.length / moves * v[:-1], _CURVED, _HALVES) is None

    def check_chart(self, theta: Array) -> None:
        """Raise :class:`OutOfChartError` where the law falls too fast."""
        if not self.chain.covers(theta):
            raise OutOfChartError(self.chain.local(theta, self.chain.here))

    def load_room(self, t: float, v: Array) -> float:
        """How far the load is in its range along ``v``."""
        bound = self.high if v[-1] > 0.0 else self.low
        return max((bound - t) / float(v[-1]), 0.0) if v[-1] != 0.0 else np.inf

    def not_before(self, part: float, other: float, increment: Array) -> bool:
        """Whether a part of a way is another one, up to the width of a corner, or beyond it."""
        return part >= other - 0.1 * BESIDE * self.chain.length / max(float(np.abs(increment).max()), 1e-300)

    def straight(self, theta: Array, side: Array, t: float, v: Array) -> FollowedPoint | PathEnd | None:
        """To the end of a straight stretch; None where it is curved."""
        chain, load = self.chain, self.load_room(t, v)
        probe = _PROBE * chain.length / max(float(np.abs(v[:-1]).max()), 1e-300)
        if not chain.straight(theta, side, min(probe, load) * v[:-1]):
            return None
        reach = load if np.isfinite(load) else probe / _PROBE * _FAR
        corner = chain.leaves(theta, side, reach * v[:-1], STRAIGHT, _HALVES)
        if corner is None and not np.isfinite(load):
            return PathEnd.UNBOUNDED
        if corner is None or self.not_before(corner.part * reach, load, v[:-1]):
            goal = self.high if v[-1] > 0.0 else self.low
            point = self.solve(theta + load * v[:-1], chain.here, goal, self.load_border, goal)
            return PathEnd.NOT_CORRECTED if point is None else self.at_load(*point, chain.here)
        return None if corner.bends else self.corner(theta, side, t, reach * v, corner)

    def curved_step(self, theta: Array, segment: Array, t: float, v: Array, length: float) -> FollowedPoint | PathEnd:
        chain, slack = self.chain, _CURVED
        for _ in range(60):
            load = self.load_room(t, v)
            reach = min(length, 1.05 * load) if load > 1e-12 * chain.length else length
            corner = chain.leaves(theta, segment, reach * v[:-1], slack)
            if corner is not None and not corner.bends and not self.not_before(corner.part * reach, load, v[:-1]):
                point = self.corner(theta, segment, t, reach * v, corner)
            else:
                reach = reach if corner is None or not corner.bends else corner.part * reach
                point = self.smooth(theta, segment, t, v, reach, slack)
                if point is None and load <= reach:  # beyond the end there may be no equilibrium, or too many
                    goal = self.high if v[-1] > 0.0 else self.low
                    point = self.end_of_load(theta, segment, load * v[:-1], goal, slack, t, v)
            if point is not None:
                return point
            length, slack = 0.5 * reach, 0.5 * slack
        return PathEnd.NOT_CORRECTED

    def smooth(self, theta: Array, side: Array, t: float, v: Array, reach: float, slack: float) -> FollowedPoint | None:
        """A step to a point on the same pieces, to the end of the load, or to a corner that was met on the way."""
        chain = self.chain
        arrived = self.arc(theta, chain.here, t, v, reach)
        if arrived is None:
            return None
        increment, new_t, steps = arrived[0] - theta, *arrived[1:]
        met, new = chain.leaves(theta, side, increment, 2.0 * slack), theta + increment
        over = not self.low < new_t < self.high
        goal = self.high if new_t >= self.high else self.low
        part = (goal - t) / (new_t - t) if over and new_t != t else np.inf
        if met is not None and not self.not_before(met.part, part, increment):
            return None if met.bends else self.corner(theta, side, t, np.append(increment, new_t - t), met)
        if over:
            return self.end_of_load(theta, side, part * increment, goal, slack, t, v)
        unit = self.onward(theta, t, v, new, chain.here, new_t)
        return None if unit is None else FollowedPoint(new, new_t, chain.here, unit, length=reach, easy=steps <= 4)

    def end_of_load(
        self, theta: Array, side: Array, increment: Array, goal: float, slack: float, t: float, v: Array | None = None
    ) -> FollowedPoint | None:
        """The point near the end of a way at which the load is ``goal``; None where the path does not lead there.

        A path along the tangent v does not turn on the way; where the load leaves the body free there is no tangent.
        """
        chain, start = self.chain, theta + increment
        point = self.solve(start, chain.here, goal, self.load_border, goal)
        ended = None if point is None else point[0]
        if ended is None or not _beside(ended - start, increment, chain.length):
            ended = self.nearest_balanced(start, goal)
        elif v is not None and self.onward(theta, t, v, ended, chain.here, goal) is None:
            return None
        if ended is None or not _beside(ended - start, increment, chain.length):
            return None
        met = chain.leaves(theta, side, ended - theta, 2.0 * slack)
        if met is not None and not self.not_before(met.part, 1.0, ended - theta):
            return None
        back = min(BESIDE * chain.length / max(float(np.abs(ended - theta).max()), 1e-300), 0.5)
        return self.at_load(ended, goal, back * (theta - ended))  # a corner may lie there

    def nearest_balanced(self, theta: Array, t: float) -> Array | None:
        """The equilibrium nearest to a place, where a load leaves the body free: glue has just broken everywhere."""
        for _ in range(_ROUNDS):
            chain, force, _ = self.body_at(theta, t)
            F, J = chain.balance(theta, self.chain.here, force)
            if chain.rounds(F, theta, self.chain.here, force):
                return theta
            theta = theta - np.linalg.lstsq(J, F, rcond=FREE)[0]
        return None

    # ---- corners ----------------------------------------------------------------------------------------

    def corner(self, theta: Array, side: Array, t: float, increment: Array, met: Corner) -> FollowedPoint | None:
        """The point of the path at a corner that a straight way meets; None where the path does not go there."""
        chain, j = self.chain, int(met.point[0])
        normal = met.normal[0]
        border = np.append(chain.normals_of(met)[0], 0.0)
        start = theta + met.part * increment[:-1]
        goal, reach = float(border[:-1] @ start), 1e-6 * chain.length
        at, load = start, t + met.part * float(increment[-1])
        for _ in range(_ROUNDS):
            point = self.solve(at, chain.here, load, border, goal)
            if point is None:
                return None
            moved = float(np.abs(point[0] - at).max())
            at, load = point
            reach = max(reach, min(10.0 * moved, 0.1 * chain.length))
            own = at.reshape(chain.system.shape)[j]
            off = chain.crossing(j, own, normal, reach)
            if off is None:
                return None
            if abs(off) <= _ON * chain.length + 4e-16 * float(np.abs(own).max()):
                break
            goal += off
        else:
            return None
        if not self.low - 1e-12 <= load <= self.high + 1e-12:
            return None
        if not _beside(at - start, increment[:-1], chain.length):
            return None  # it is where the path meets this corner elsewhere
        arriving = self.onward(theta, t, increment, at, chain.side_of(met, np.zeros(met.point.size, dtype=bool)), load)
        if arriving is None:
            return None
        passed = at - theta
        size = float(np.abs(passed).max())
        if size > 1e3 * BESIDE * chain.length:
            earlier = chain.leaves(theta, side, (1.0 - 1e2 * BESIDE * chain.length / size) * passed, 2.0 * _CURVED)
            if earlier is not None and not earlier.bends and earlier.point[0] != j:
                return self.corner(theta, side, t, np.append(passed, load - t), earlier)
        bound = self.high if increment[-1] > 0.0 else self.low
        if increment[-1] != 0.0 and self.not_before(1.0 + (load - bound) / float(increment[-1]), 1.0, increment[:-1]):
            return self.end_of_load(theta, side, at - theta, bound, _CURVED, t)
        ahead = self.beyond(at, side, load, increment, border, met)
        return None if ahead is None else replace(ahead, rate=float(arriving[-1]))

    def beyond(
        self, theta: Array, side: Array, t: float, increment: Array, border: Array, met: Corner
    ) -> FollowedPoint | None:
        """A corner with the pieces on which the path goes on."""
        chain = self.chain
        together = chain.passing(theta, increment[:-1])
        if not np.isin(met.point[0], together.point):
            together = met
        every = np.ones(together.point.size, dtype=bool)
        event = PathEvent(border, chain.side_of(together, ~every))
        normals = chain.normals_of(together)
        if every.size == 1:
            return FollowedPoint(theta, t, chain.side_of(together, every), np.append(normals[0], 0.0), event)
        for chosen in _choices(every.size):
            beyond = chain.side_of(together, chosen)
            border = np.append(normals.sum(axis=0), 0.0)
            v = self.tangent(theta, beyond, t, border)
            if v is None:
                continue
            rates = np.where(chosen, 1.0, -1.0) * (normals @ v[:-1])
            slack = ROUNDING * float(np.abs(v[:-1]).max())
            for sign in (1.0, -1.0):
                if (sign * rates >= -slack).all():
                    heading = sign * np.append(v[:-1], v[-1] * self.load_unit)
                    return FollowedPoint(theta, t, beyond, heading, event)
        self.ties = True
        return None


def _beside(missed: Array, increment: Array, length: float) -> bool:
    """Whether what a way missed is small beside it, so that it leads there."""
    return bool(np.abs(missed).max() <= 0.5 * np.abs(increment).max() + BESIDE * length)


def _choices(size: int) -> Iterator[BoolArray]:
    """Which of several points pass a corner: all, one alone, all but one, then two and so on; at least one."""
    counts = dict.fromkeys(count for k in range(size) for count in (size - k, 1 + k))
    subsets = (chosen for count in counts for chosen in itertools.combinations(range(size), count))
    for chosen in itertools.islice(subsets, _DIRECTIONS):
        passing = np.zeros(size, dtype=bool)
        passing[list(chosen)] = True
        yield passing
