"""Jumps along the path of equilibria: where they are within a step, and where they lead.

The load, the supports and the gaps of a step go straight from where they were, ``s = 0``, to where they will be,
``s = 1``.  The equilibria over s are a curve with an arc length of its own (a parametrised solution: Mielke, Rossi,
Savare, 10.1051/cocv/2010054; arXiv:2204.05860).  While its equilibria are minimisers of the energy the body follows
it.  Where they cease to be, at a fold or a bifurcation, s would have to fall for the body to stay in equilibrium,
but time does not: the load waits, and the body leaves the curve for the next minimiser under this load.  Energy is a
function of the place alone, so that what is lost is the difference of the energies at both ends.  The body goes down
the gradient of the energy in the norm of K, which is what a viscosity that vanishes leaves.

The curve that goes on beyond the fold, through equilibria that are no minimisers, is no solution in time; it is what
:func:`hemivar.follow_path` shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.branches.chain import Chain, chain_of
from hemivar.branches.follower import Follower, Track, TrackPoint
from hemivar.branches.path import PathEnd
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError
from hemivar.evolution.descent import bottom, downhill, slowed
from hemivar.evolution.discrete import StepMatrices
from hemivar.evolution.jumps import DissipatedJump, SelectionRule
from hemivar.evolution.stage import Stage
from hemivar.fem.load_line import LoadLine
from hemivar.solvers import Controls, Solution, Solver, Status
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


@dataclass(frozen=True, eq=False)
class PathResult:
    """Where a step ends that was followed along its path."""

    solution: Solution
    leaps: tuple[DissipatedJump, ...] = ()


@dataclass(frozen=True, eq=False)
class JumpPaths:
    """Follows the equilibria of steps of an elastic body."""

    bodies: StepMatrices
    workspace: Workspace

    def follow(
        self, stage: Stage, convexity_defect: float, jump: SelectionRule, solver: Solver | None, controls: Controls
    ) -> PathResult:
        """The solution of a stage, at the end of the path from the moment before it."""
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
                landed = fall.down(here, u)
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
