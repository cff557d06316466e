"""Jumps along the path of equilibria: where they are within a step, and where they lead.

The load, the supports and the gaps of a step go straight from where they were, ``s = 0``, to where they will be,
``s = 1``.  The equilibria over s are a curve with an arc length of its own (a parametrised solution: Mielke, Rossi,
Savare, 10.1051/cocv/2010054; arXiv:2204.05860).  While its equilibria are minimisers of the energy the body follows
it.  Where they cease to be, at a fold or a bifurcation, s would have to fall for the body to stay in equilibrium,
but time does not: the load waits, and the body leaves the curve for the next minimiser under this load.  Energy is a
function of the place alone, so that what is lost is the difference of the energies at both ends, however the body gets
from one to the other; where it ends, the way decides:

* ``arc-length``: down the gradient of the energy in the norm of K, which is what a viscosity that vanishes leaves.
* ``dynamic``: by inertia from rest, ``M u'' + dE(u) = 0``, so that it may swing beyond the next minimiser into
  another one, until it rests.  The first swing is computed by the midpoint rule, which takes no energy but what the
  steps do not resolve, after a push of a thousandth of the way downhill; from where it turns round implicit Euler
  takes it, with steps that do so at once,
  for the elastic body itself has no loss.  Where a second swing could still leave the well this is a choice.

The curve that goes on beyond the fold, through equilibria that are no minimisers, is no solution in time; it is what
:func:`hemivar.follow_path` shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.branches.chain import Chain, chain_of
from hemivar.branches.follower import Follower, Track, TrackPoint
from hemivar.branches.path import PathEnd
from hemivar.certificates.smallness import smallness
from hemivar.discrete.operator_family import Composition, OperatorFamily
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError
from hemivar.evolution.descent import bottom, downhill, slowed
from hemivar.evolution.discrete import DiscreteEvolution, StepMatrices
from hemivar.evolution.jumps import DissipatedJump, SelectionRule
from hemivar.evolution.stage import Stage
from hemivar.fem.hierarchy import family_of
from hemivar.fem.load_line import LoadLine
from hemivar.solvers import Controls, Solution, Solver, Status, solve
from hemivar.systems.workspace import Workspace

__all__ = ["JumpPaths", "PathResult"]

#: How far beyond the end of a branch the load goes to leave it, as parts of the step: the first that is felt.
_BEYOND = (1e-8, 1e-7, 1e-6, 1e-5, 1e-4)
#: Ends of branches in one step, and points of the path between two, at most.
_ENDS = 200
_POINTS = 5000
#: Components of contact points up to which paths are followed: every corner of one is a dense solve.
_LARGEST = 1500
#: A change of place that counts as a jump, as a part of a typical displacement.
_JUMPS = 1e-4
#: Parts of the distance that a step of the first swing goes at most, and at least if it may grow.
_FAR, _NEAR = 1.0 / 20.0, 1.0 / 80.0
#: Part of the way downhill by which a body at rest in an equilibrium is pushed out of it.
_PUSH = 1e-3
#: Kinetic energy, as a part of its largest, at which the body rests.
_RESTS = 1e-3
#: Steps of a transient at most.
_STEPS = 20_000
#: Shortest step of a transient, and the one that takes the energy: powers of one half of the time in which it moves.
_FINEST, _LOSING = 48, 1


@dataclass(frozen=True, eq=False)
class PathResult:
    """Where a step ends that was followed along its path.

    Attributes
    ----------
    solution : Solution
    leaps : tuple of DissipatedJump
    """

    solution: Solution
    leaps: tuple[DissipatedJump, ...] = ()


@dataclass(frozen=True, eq=False)
class JumpPaths:
    """Follows the equilibria of steps of an elastic body.

    Parameters
    ----------
    discrete : DiscreteEvolution
    bodies : StepMatrices
    workspace : Workspace
    transient : Workspace
        For the bodies of transients, which come and go.
    """

    discrete: DiscreteEvolution
    bodies: StepMatrices
    workspace: Workspace
    transient: Workspace

    def follow(
        self, stage: Stage, convexity_defect: float, jump: SelectionRule, solver: Solver | None, controls: Controls
    ) -> PathResult:
        """The solution of a stage, at the end of the path from the moment before it.

        Parameters
        ----------
        stage : Stage
        convexity_defect : float
            c - 1 of its problem.
        jump : SelectionRule
        solver : Solver or None
        controls : Controls

        Raises
        ------
        MethodError
            The slip is a vector (3D), or there are too many contact points.
        """
        problem, before = stage.problem, stage.before
        system = self.workspace.condensed(problem)
        if system.free.size > _LARGEST:
            raise MethodError(
                f"jump = '{jump}' follows paths of equilibria, for up to {_LARGEST} unknowns of contact points; here "
                f"are {system.free.size}; take jump = 'local'"
            )
        chain: Chain = chain_of(system)
        # Under a part of the load, what is left of the balance is measured by the whole.
        whole = controls.rtol * float(np.linalg.norm(problem.load))
        fall = _GradientFlow(
            self, chain, convexity_defect, jump, solver, replace(controls, atol=max(controls.atol, whole))
        )
        start = before.local.displacement - stage.origin
        theta, segment = chain.nearest(start, before.multiplier)
        place, pressed = chain.local(theta, segment)
        line = LoadLine(problem, problem.with_(load=problem.contact_force(pressed), offset=-place))
        slope = chain.force - chain.out_of_balance(theta, segment, np.zeros(chain.size))
        leaps: list[DissipatedJump] = []
        part = 0.0
        for _ in range(_ENDS):
            force = chain.out_of_balance(theta, segment, part * slope)  # so that the start is an equilibrium
            part, theta, segment, done = _branch(chain, force, slope, theta, segment, part)
            r, _ = chain.local(theta, segment)
            if done or part >= 1.0 - _BEYOND[-1]:
                return _ended(fall, problem, system.unknowns(r), leaps, (theta, segment) if done else None)
            for beyond in (*_BEYOND, 1.0 - part):
                here = line.at(part + beyond)
                u = system.for_problem(here).unknowns(r)
                landed = fall.fall(here, u)
                if landed.status not in (Status.STALLED, Status.INACCURATE):
                    break
            part += beyond
            if landed.status is not Status.CONVERGED:
                return PathResult(landed, tuple(leaps))
            leaps += fall.leap(part, here, u, landed)
            if part >= 1.0:
                return PathResult(landed, tuple(leaps))
            theta, segment = chain.nearest(landed.local, landed.multiplier)
        return _ended(fall, problem, landed.unknowns, leaps)

    @cached_property
    def family(self) -> OperatorFamily:
        """The matrices of the body, with its mass."""
        return replace(self.discrete.family, mass=family_of(self.discrete.problem, True).mass)

    @property
    def mass(self) -> sp.csr_array:
        """Mass of a body with density."""
        assert self.family.mass is not None
        return self.family.mass.inner


def _ended(
    fall: _GradientFlow,
    problem: DiscreteProblem,
    u: Array,
    leaps: list[DissipatedJump],
    place: tuple[Array, IntArray] | None = None,
) -> PathResult:
    """The end of a step, maybe at a known place on the graph of the law."""
    at = None if place is None else bottom(fall.chain, problem, *place, fall.controls, fall.paths.workspace)
    if at is not None:
        return PathResult(at, tuple(leaps))
    solution = fall.down(problem, u)
    return PathResult(solution, (*leaps, *fall.leap(1.0, problem, u, solution)))


def _branch(
    chain: Chain, force: Array, slope: Array, theta: Array, segment: IntArray, part: float
) -> tuple[float, Array, IntArray, bool]:
    """Along minimisers as far as they go: the load there, the point, and whether it is the end of the step."""
    follower = Follower(chain, force, slope, part, 1.0, _POINTS, 0.02)
    track = Track([TrackPoint(part, theta)], [])
    for _ in follower.extend(track, theta, segment, part, 1.0):
        point, last = track.points[-1], track.stretches[-1]
        if not last.stable or point.t < track.points[-2].t:
            break
    good = 0
    for (one, other), stretch in zip(zip(track.points, track.points[1:], strict=False), track.stretches, strict=True):
        if not stretch.stable or other.t < one.t:
            break
        good += 1
    if not good:
        return part, theta, segment, False
    end, own = track.points[good], track.stretches[good - 1].segment
    whole = good == len(track.stretches) and track.ended is PathEnd.UPPER_END
    return end.t, end.theta, own, whole


@dataclass(eq=False)
class _GradientFlow:
    """From a place to the next minimiser under the same load."""

    paths: JumpPaths
    chain: Chain
    convexity_defect: float
    jump: SelectionRule
    solver: Solver | None
    controls: Controls

    def down(self, problem: DiscreteProblem, u: Array) -> Solution:
        """Down the gradient in the norm of K."""
        slow = slowed(self.paths.bodies, problem, self.convexity_defect)
        return downhill(problem, slow, u, self.solver, self.controls, self.paths.workspace, self.chain)

    def leap(self, part: float, problem: DiscreteProblem, u: Array, landed: Solution) -> list[DissipatedJump]:
        """The jump from a place to where it led, if it was one."""
        before, after = problem.local(u), landed.local
        # Near rest all displacements are small: what typically moves is what a jump is held against.
        size = max(float(np.abs(before).max(initial=0.0)), float(np.abs(after).max(initial=0.0)), self.chain.length)
        if not np.abs(after - before).max(initial=0.0) > _JUMPS * size:
            return []
        return [DissipatedJump(part, problem.energy(u) - problem.energy(landed.unknowns))]

    def fall(self, problem: DiscreteProblem, u: Array) -> Solution:
        """To where the choice leads."""
        there = self.down(problem, u)
        if self.jump is not SelectionRule.DYNAMIC or there.status is not Status.CONVERGED:
            return there
        K, way = problem.stiffness, there.unknowns - u
        size = _norm(K, way)
        if not self.leap(1.0, problem, u, there):
            return there
        return self._swung(problem, u + _PUSH * way, size, size / _norm(self.paths.mass, way))

    def _swung(self, problem: DiscreteProblem, u: Array, size: float, rate: float) -> Solution:
        """By inertia, from rest; the way is about ``size`` in the energy norm, the motion about as fast as ``rate``."""
        K, M = problem.stiffness, self.paths.mass
        swing, start = _Transient(self.paths, problem, rate), u
        rung = swing.unique(6)
        v, turned, largest, time = np.zeros_like(u), False, 0.0, 0.0
        late: list[tuple[float, float]] = []
        for _ in range(_STEPS):
            step = swing.step(rung)
            solution = solve(
                swing.posed(rung, u, v), self.solver, self.controls, initial=u, workspace=self.paths.transient
            )
            if solution.status is not Status.CONVERGED:
                return replace(solution, problem=problem)
            moved = solution.unknowns - u
            far = _norm(K, moved)
            if not turned and far > _FAR * size and rung < _FINEST:
                rung += 1
                continue
            if turned:
                u, v, time = solution.unknowns, moved / step, time + step
            else:  # beyond the middle of a step, as the midpoint rule goes
                u, v, time = u + 2.0 * moved, 2.0 * moved / step - v, time + 2.0 * step
            kinetic = 0.5 * _norm(M, v) ** 2
            largest = max(largest, kinetic)
            if not turned:
                away = u - start  # it turns where it is as far away as it comes
                turned = float(v @ (M @ away)) < 0.0 and _norm(K, away) > _FAR * size
                if turned:
                    rung = swing.unique(_LOSING)
                elif far < _NEAR * size and swing.unique(rung - 1) == rung - 1:
                    rung -= 1
                continue
            late = [(t, e) for t, e in late if t > time - 4.0 / rate] + [(time, kinetic)]
            if time - late[0][0] > 3.0 / rate and max(e for _, e in late) < _RESTS * largest:
                return self.down(problem, u)
        return replace(solution, problem=problem, status=Status.STALLED)


def _norm(matrix: sp.csr_array, x: Array) -> float:
    return float(np.sqrt(max(float(x @ (matrix @ x)), 0.0)))


class _Transient:
    """Steps of implicit Euler of a body with mass under a load that stays, ``2^-rung / rate`` long."""

    def __init__(self, paths: JumpPaths, problem: DiscreteProblem, rate: float) -> None:
        self.paths, self.problem, self.rate = paths, problem, rate
        self._made: dict[int, DiscreteProblem] = {}
        self._alone: dict[int, bool] = {}

    def step(self, rung: int) -> float:
        """Its length."""
        return float(0.5**rung / self.rate)

    def heavy(self, rung: int) -> DiscreteProblem:
        """The problem with the stiffness ``K + M/step^2``."""
        if rung not in self._made:
            parts = self.problem.model.parts
            assert isinstance(parts, Composition)
            heavy = replace(parts, family=self.paths.family, inertia=self.step(rung) ** -2)
            self._made[rung] = replace(self.problem, model=heavy.model(True), law_known=True)
        return self._made[rung]

    def posed(self, rung: int, u: Array, v: Array) -> DiscreteProblem:
        """A step from a place and a velocity."""
        step = self.step(rung)
        load = self.problem.load + self.paths.mass @ (u / step + v) / step
        return self.heavy(rung).with_(load=load)

    def unique(self, rung: int) -> int:
        """The rung, or the first above it, at which a step has one solution."""
        while rung < _FINEST:
            if rung not in self._alone:
                known = smallness(self.heavy(rung), trace_constant=False, workspace=self.paths.transient)
                self._alone[rung] = known.margin > 0.0
            if self._alone[rung]:
                break
            rung += 1
        return rung
