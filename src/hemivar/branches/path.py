"""Path following: the equilibria of a body while its load grows, through folds."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hemivar.basics.arguments import expect, number, whole_number
from hemivar.basics.deadline import Budget, OutOfTime, check_time, limited
from hemivar.basics.display import Displayed
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.branches.chain import Chain, chain_of
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError, ProblemError
from hemivar.fem import LoadLine
from hemivar.fem.posed import posed
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers import Controls, LoadStepping, Solution, Status, solve
from hemivar.systems import CondensedProblem, condense
from hemivar.systems.workspace import Workspace

__all__ = ["Fold", "Jump", "Path", "follow_path", "trace"]

_INTERRUPTED = "interrupted"
_OUT_OF_TIME = "the time limit was reached"


@dataclass(frozen=True)
class Fold:
    """A point where the load turns.

    Attributes
    ----------
    load_factor : float
    index : int
        Number of the point on the path.
    """

    load_factor: float
    index: int


@dataclass(frozen=True, eq=False)
class Jump:
    """Where the body leaves a branch when the load is prescribed.

    Attributes
    ----------
    load_factor : float
    index : int
        Number of the point on the path from which it jumps.
    loading : bool
        Whether it happens while the load grows (else while it falls).
    local : array (m, d) or None
        Local displacement on the stable branch of this path that is met at the same load; None if there is none.
    """

    load_factor: float
    index: int
    loading: bool
    local: Array | None


@dataclass(frozen=True, eq=False)
class Path(Portable, Displayed):
    """Equilibria in the order in which they are met.

    Attributes
    ----------
    line : LoadLine
        The problem at each load factor.
    load_factor : array (k,)
    local, multiplier : arrays (k, m, d)
        Local displacement r, and pressure and friction.
    energy : array (k,)
        E(u) at the load of the point.
    stable : bool array (k - 1,)
        Whether the equilibria between a point and the next are local minimisers.
    curved : bool array (k - 1,)
        Whether the path between them is curved; otherwise r is exactly linear there.
    folds : tuple of Fold
    jumps : tuple of Jump
    ended : str
        Why the path ends where it does.
    perturbed : bool
        Whether several components met an event at once, so that the load was perturbed by 1e-9 of itself to order them;
        the path is then one of several that meet.
    """

    line: LoadLine
    load_factor: Array
    local: Array
    multiplier: Array
    energy: Array
    stable: BoolArray
    curved: BoolArray
    folds: tuple[Fold, ...]
    jumps: tuple[Jump, ...]
    ended: str
    perturbed: bool = False

    @property
    def reached_end(self) -> bool:
        """Whether the path was followed until it left the range of load factors."""
        return "end of the load factors" in self.ended

    @property
    def interrupted(self) -> bool:
        """Whether it was stopped from the keyboard; the points until then are here."""
        return self.ended == _INTERRUPTED

    def __len__(self) -> int:
        return self.load_factor.size

    @property
    def problem(self) -> DiscreteProblem:
        """The problem at load factor 1."""
        return self.line.loaded

    @cached_property
    def max_penetration(self) -> Array:
        """Largest penetration, (k,)."""
        return np.asarray(self.local[:, :, 0].max(axis=1, initial=-np.inf))

    @cached_property
    def normal_force(self) -> Array:
        """Resultant of the pressure, (k,)."""
        return np.asarray(self.multiplier[:, :, 0] @ self.problem.weights)

    @cached_property
    def friction_force(self) -> Array:
        """Resultant of the friction, (k, d - 1)."""
        return np.asarray(np.einsum("m,kmc->kc", self.problem.weights, self.multiplier[:, :, 1:]))

    def at(self, load_factor: float) -> list[tuple[Array, bool]]:
        """Local displacements (m, d) where the path crosses a load, in order, and whether they are stable.

        Interpolated linearly: exact where the path is not curved.
        """
        found: list[tuple[Array, bool]] = []
        t = self.load_factor
        for i in range(len(self) - 1):
            first = i == 0 or t[i] != load_factor
            between = (t[i] - load_factor) * (t[i + 1] - load_factor) <= 0.0 and t[i] != t[i + 1]
            if between and first:
                part = (load_factor - t[i]) / (t[i + 1] - t[i])
                found.append((self.local[i] + part * (self.local[i + 1] - self.local[i]), bool(self.stable[i])))
        return found


def follow_path(
    problem: DiscreteProblem | ContactProblem,
    load_factor: tuple[float, float] = (0.0, 1.0),
    *,
    unloaded: DiscreteProblem | None = None,
    start: Solution | Array | None = None,
    max_points: int = 2000,
    largest_step: float = 0.02,
    max_time: float = np.inf,
    condensed: CondensedProblem | None = None,
) -> Path:
    """Follow the equilibria from the lower load factor, through folds, until the range is left.

    The graph of the law is taken as a curve with a parameter of its own, so that kinks and jumps are corners of the
    path like all others.  Where all laws are piecewise quadratic the path is a polygon, and it is followed exactly,
    from one corner to the next; on curved pieces by predictor and corrector in the arc length.

    Parameters
    ----------
    problem : DiscreteProblem
        The problem at load factor 1, in one or two dimensions.
    load_factor : (float, float)
        Range; the path starts at the first one.
    unloaded : DiscreteProblem, optional
        The problem at load factor 0; by default ``problem`` with its load taken away (see :class:`LoadLine`).
    start : Solution or array (n,), optional
        Equilibrium near the lower end; by default load stepping from the unloaded body.
    max_points : int
        Limit of points.
    largest_step : float
        Largest step on curved pieces, relative to the range and to a typical displacement.
    max_time : float
        Limit in seconds; the path then ends where it is, and says so.
    condensed : CondensedProblem, optional
        The condensation of ``problem``.

    Raises
    ------
    MethodError
        The slip is a vector (3D), or a bound depends on the solution.
    ProblemError
        The range is empty, or no equilibrium was found at its lower end.
    """
    problem = posed(problem, "follow_path")
    if unloaded is not None:
        expect(unloaded, DiscreteProblem, "the unloaded problem", "discretise it first, hemivar.discretize(problem)")
    if condensed is not None:
        expect(condensed, CondensedProblem, "the condensation", "pass what hemivar.condense(problem) returns")
    try:
        low, high = (number(end, "a load factor") for end in load_factor)
    except (TypeError, ValueError) as error:
        if isinstance(error, ProblemError):
            raise
        raise ProblemError("the load factors are no pair; give a range such as (0.0, 1.0)") from None
    whole_number(max_points, "max_points", 2)
    number(largest_step, "largest_step")
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise ProblemError(f"the load factors are {low:g} and {high:g}; give a finite range, the lower one first")
    if not largest_step > 0.0:
        raise ProblemError(f"largest_step is {largest_step}; it must be positive")
    if problem.contact_points == 0:
        raise ProblemError("a path needs contact points; without contact the solution is proportional to the load")
    if problem.law.state_dependent:
        raise MethodError("path following needs a friction bound that does not depend on the solution")
    budget = Budget(max_time)
    line = LoadLine(problem, unloaded)
    system = condense(problem) if condensed is None else condensed
    chain: Chain = chain_of(system)
    if chain.size == 0:
        raise ProblemError("the supports hold every contact point, so that no path starts; free some of them")
    # A little above the lower end all components are on definite sides of their kinks, which they may not be at rest.
    first = low + 1e-4 * (high - low)
    at_start = line.at(first)
    guess = start.unknowns if isinstance(start, Solution) else start
    begun = solve(
        at_start,
        LoadStepping(steps=10 if low > 0.0 else 1) if guess is None else LoadStepping(steps=1).inner,
        Controls(rtol=1e-11, max_time=budget.left),
        initial=guess,
        workspace=Workspace.holding(system),
    )
    if begun.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    force0 = chain_force(system, chain, line, 0.0)
    force1 = chain_force(system, chain, line, 1.0) - force0
    theta, segment = chain.nearest(begun.local, begun.multiplier)
    perturbation = np.zeros(chain.size)
    follower: _Follower | None = None
    for attempt in range(2):
        follower = _Follower(chain, force0 + perturbation, force1, low, high, max_points, largest_step)
        corrected = chain.correct(theta, segment, follower.force(first))
        if corrected is None or not chain.inside(corrected, segment, 1e-7 * chain.length).all():
            raise ProblemError(
                f"no equilibrium was found at load factor {first:g} ({begun.status.value}); give another start"
            )
        with limited(budget):
            back = follower.run(corrected, segment, first, -1.0)
            forth = follower.run(corrected, segment, first, 1.0)
        if not follower.ties or attempt or follower.stopped:
            break
        size = float(np.abs(force0 + force1).max()) or float(np.abs(force1).max())
        perturbation = 1e-9 * size * np.cos(1.0 + np.arange(chain.size) ** 1.7)
    assert follower is not None
    turned = back.reversed().joined(forth)
    if follower.stopped == _INTERRUPTED and not turned.segment:
        raise KeyboardInterrupt
    if follower.stopped and not turned.segment:
        raise ProblemError(f"the time limit of {max_time:g} s was reached before the path left its first point")
    if perturbation.any():
        _unperturb(turned, _Follower(chain, force0, force1, low, high, max_points, largest_step))
    return _assemble(line, chain, turned, follower, bool(perturbation.any()))


def trace(
    chain: Chain, force: Array, rate: Array, theta: Array, segment: IntArray, low: float, high: float, points: int = 200
) -> list[tuple[Array, IntArray]]:
    """Equilibria at the load ``force`` that lie on the path through one of them, with loads ``force + t rate``.

    The path is followed from ``t = 0`` in both directions until t leaves ``[low, high]``.
    """
    found: list[tuple[Array, IntArray]] = []
    for sign in (1.0, -1.0):
        follower = _Follower(chain, force, rate, low, high, points, 0.05)
        track = follower.run(theta, segment, 0.0, sign)
        if follower.stopped == _INTERRUPTED:
            raise KeyboardInterrupt
        check_time()
        t = np.array(track.t)
        for i in range(len(t) - 1):
            if t[i] * t[i + 1] < 0.0:
                part = -t[i] / (t[i + 1] - t[i])
                found.append((track.theta[i] + part * (track.theta[i + 1] - track.theta[i]), track.segment[i]))
            elif t[i + 1] == 0.0:
                found.append((track.theta[i + 1], track.segment[i]))
    return found


def chain_force(system: CondensedProblem, chain: Chain, line: LoadLine, factor: float) -> Array:
    """g on the free components at a load factor."""
    return np.asarray(system.for_problem(line.at(factor)).force[system.free])


@dataclass(frozen=True, eq=False)
class _Event:
    """What fixes a point of the path: a component at the end of its segment, or the load (None)."""

    component: int | None
    segment: IntArray


@dataclass(eq=False)
class _Track:
    """Points of a path; ``segment[i]``, ``stable[i]`` belong to the stretch from point i to point i + 1."""

    t: list[float] = field(default_factory=list)
    theta: list[Array] = field(default_factory=list)
    segment: list[IntArray] = field(default_factory=list)
    stable: list[bool] = field(default_factory=list)
    curved: list[bool] = field(default_factory=list)
    fold: list[bool] = field(default_factory=list)
    event: list[_Event | None] = field(default_factory=list)
    ended: str = ""

    def reversed(self) -> _Track:
        return _Track(
            self.t[::-1],
            self.theta[::-1],
            self.segment[::-1],
            self.stable[::-1],
            self.curved[::-1],
            self.fold[::-1],
            self.event[::-1],
        )

    def cut(self) -> None:
        """Drop what belongs to a point that is not complete."""
        whole = (len(self.segment), len(self.stable), len(self.curved))
        count = min(len(self.t), len(self.theta), len(self.fold), len(self.event), *(1 + n for n in whole))
        for points in (self.t, self.theta, self.fold, self.event):
            del points[count:]
        for stretches in (self.segment, self.stable, self.curved):
            del stretches[count - 1 :]

    def joined(self, other: _Track) -> _Track:
        """This track followed by one that starts where it ends."""
        return _Track(
            self.t + other.t[1:],
            self.theta + other.theta[1:],
            self.segment + other.segment,
            self.stable + other.stable,
            self.curved + other.curved,
            self.fold + other.fold[1:],
            self.event + other.event[1:],
            other.ended,
        )


@dataclass(eq=False)
class _Follower:
    chain: Chain
    force0: Array
    force1: Array
    low: float
    high: float
    max_points: int
    largest_step: float
    ties: bool = False
    stopped: str = ""

    def force(self, t: float) -> Array:
        return self.force0 + t * self.force1

    @cached_property
    def load_unit(self) -> float:
        """Length that stands for a load factor of 1 in the arc length."""
        return self.chain.length / (self.high - self.low)

    def run(self, theta: Array, segment: IntArray, t: float, sign: float) -> _Track:
        """From an equilibrium, first in the direction in which t has this sign; an interruption leaves the points."""
        track = _Track([t], [theta], [], [], [], [False], [None])
        try:
            if not self.stopped:
                self.extend(track, theta, segment, t, sign)
        except KeyboardInterrupt:
            self.stopped = _INTERRUPTED
        except OutOfTime:
            self.stopped = _OUT_OF_TIME
        if self.stopped:
            track.cut()
            track.ended = self.stopped
        return track

    def extend(self, track: _Track, theta: Array, segment: IntArray, t: float, sign: float) -> None:
        """Append points to a track that holds the first one."""
        chain = self.chain
        border = np.zeros(chain.size + 1)
        border[-1] = sign
        tangent = self.tangent(theta, segment, border)
        turn = sign
        step = self.largest_step * chain.length
        while len(track.t) < self.max_points:
            check_time()
            if tangent is None:
                track.ended = "the path is not unique beyond this point"
                break
            curved = not bool(chain.pick(chain.affine, segment).all())
            if tangent[-1] * turn < 0.0:
                track.fold[-1] = True
            turn = float(np.sign(tangent[-1])) or turn
            new = self.curved_step(theta, segment, t, tangent, step) if curved else None
            if curved and new is None:
                track.ended = "the corrector did not converge"
                break
            if new is None:
                new = self.straight_step(theta, segment, t, tangent)
            if new is None:
                track.ended = "the branch goes on for ever at this load"
                break
            track.segment.append(segment)
            track.stable.append(chain.stable(0.5 * (theta + new.theta), segment))
            track.curved.append(curved)
            fold = self.fold_between(theta, segment, t, tangent, new) if curved else None
            if fold is not None:
                track.stable[-1] = chain.stable(0.5 * (theta + fold[0]), segment)
                track.t.append(fold[1])
                track.theta.append(fold[0])
                track.fold.append(True)
                track.event.append(None)
                track.segment.append(segment)
                track.stable.append(chain.stable(0.5 * (fold[0] + new.theta), segment))
                track.curved.append(True)
                turn = -turn
            theta, t = new.theta, new.t
            track.t.append(t)
            track.theta.append(theta)
            track.fold.append(False)
            fixed = new.component is not None or new.limit
            track.event.append(_Event(new.component, segment) if fixed else None)
            if new.component is None and new.limit:
                end = "upper" if t >= self.high else "lower"
                track.ended = f"the {end} end of the load factors was reached"
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
        else:
            track.ended = f"the limit of {self.max_points} points was reached"

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


def _unperturb(track: _Track, follower: _Follower) -> None:
    """Move the corners of a path that was followed for a perturbed load to where they are for the load itself."""
    for i, event in enumerate(track.event):
        if event is None:
            continue
        goal = track.t[i] if event.component is None else float(track.theta[i][event.component])
        found = follower.solve(track.theta[i], event.segment, track.t[i], event.component, goal)
        if found is not None and np.abs(found[0] - track.theta[i]).max() <= 1e-6 * follower.chain.length:
            track.theta[i], track.t[i] = found


def _assemble(line: LoadLine, chain: Chain, track: _Track, follower: _Follower, perturbed: bool) -> Path:
    system = chain.system
    t = np.array(track.t)
    segments = [track.segment[max(i - 1, 0)] for i in range(t.size)] if track.segment else []
    if not segments:
        raise ProblemError("the path ends where it begins; give another start or range")
    pairs = [chain.local(theta, segment) for theta, segment in zip(track.theta, segments, strict=True)]
    local, multiplier = np.array([p[0] for p in pairs]), np.array([p[1] for p in pairs])
    # The constant part of the energy is quadratic in the load factor, force and held displacements are linear.
    systems = [system.for_problem(line.at(factor)) for factor in (0.0, 0.5, 1.0)]
    constants = [s.constant for s in systems]
    curve = np.polyfit([0.0, 0.5, 1.0], constants, 2)
    energy = np.empty(t.size)
    held = ~system.active
    for i, factor in enumerate(t):
        fixed = (1.0 - factor) * systems[0].fixed + factor * systems[2].fixed
        local[i][held] = fixed[held]
        x = local[i].ravel()
        force = (1.0 - factor) * systems[0].force + factor * systems[2].force
        answer = float(system.weights @ system.law.value(local[i]))
        energy[i] = 0.5 * x @ (system.matrix @ x) - force @ x + answer + np.polyval(curve, factor)
    folds = tuple(Fold(float(t[i]), i) for i in range(1, t.size - 1) if track.fold[i])
    return Path(
        line=line,
        load_factor=t,
        local=local,
        multiplier=multiplier,
        energy=energy,
        stable=np.array(track.stable, dtype=bool),
        curved=np.array(track.curved, dtype=bool),
        folds=folds,
        jumps=_jumps(t, local, track.stable),
        ended=track.ended,
        perturbed=perturbed,
    )


def _jumps(t: Array, local: Array, stable: list[bool]) -> tuple[Jump, ...]:
    """Where stability is lost while the load goes up, or down, and where the next stable stretch at that load is."""
    jumps: list[Jump] = []
    for i in range(1, t.size - 1):
        if stable[i - 1] == stable[i]:
            continue
        onward = stable[i - 1]  # the stable stretch comes before the point: the body arrives along the path
        # Points that met several events at once lie on top of each other: look back to one at another load.
        arrival = np.arange(i - 1, -1, -1) if onward else np.arange(i + 1, t.size)
        elsewhere = arrival[np.abs(t[arrival] - t[i]) > 1e-9 * (1.0 + abs(t[i]))]
        if elsewhere.size == 0:
            continue
        loading = bool(t[i] > t[elsewhere[0]])
        stretches = range(i + 1, t.size - 1) if onward else range(i - 2, -1, -1)
        landing: Array | None = None
        for k in stretches:
            if stable[k] and (t[k] - t[i]) * (t[k + 1] - t[i]) <= 0.0 and t[k] != t[k + 1]:
                part = (t[i] - t[k]) / (t[k + 1] - t[k])
                landing = local[k] + part * (local[k + 1] - local[k])
                break
        jumps.append(Jump(float(t[i]), i, loading, landing))
    return tuple(jumps)
