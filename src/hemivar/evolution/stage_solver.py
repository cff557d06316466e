"""How a stage is solved: Newton, multigrid, gradient flow or paths of minimisers, by its uniqueness margin.

Jumps may be followed along the path of equilibria. The load, the supports and the gaps of a step go straight from where
they were, ``s = 0``, to where they will be, ``s = 1``. The equilibria over s are a curve with an arc length of its own
(a parametrised solution: Mielke, Rossi, Savare, 10.1051/cocv/2010054; arXiv:2204.05860). While its equilibria are
minimisers of the energy the body follows it. Where they cease to be, at a fold or a bifurcation, s would have to fall
for the body to stay in equilibrium, but time does not: the load waits, and the body leaves the curve for the next
minimiser under this load. Energy is a function of the place alone, so that what is lost is the difference of the
energies at both ends. The body goes down the gradient of the energy in the norm of K, which is what a viscosity that
vanishes leaves.

The curve that goes on beyond the fold, through equilibria that are no minimisers, is no solution in time; it is what
:func:`hemivar.follow_path` shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arrays import COUNTS, norm
from hemivar.basics.deadline import check_time
from hemivar.basics.defined_above import above
from hemivar.basics.types import Array, IntArray
from hemivar.certificates.smallness import smallness
from hemivar.discrete.bulk import Quadratic
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual
from hemivar.errors import MethodError, ProblemError
from hemivar.evolution.barrier import path_bends_downwards
from hemivar.evolution.descent import TIGHT, DescentSolver, Slowed, bottom, gradient_flow, slowed
from hemivar.evolution.discrete import DiscreteEvolution, StepMatrices
from hemivar.evolution.jumps import DissipatedJump, SelectionRule
from hemivar.evolution.stage import Stage, StageState, extrapolated_multiplier, out_of_balance_force, stage_state
from hemivar.evolution.walk import Walk
from hemivar.fem.load_line import LoadLine
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import frozen_at, weak_convexity_at
from hemivar.linear.definite import REPEATED
from hemivar.solvers import (
    Controls,
    NonsmoothMultigrid,
    NonsmoothNewton,
    ProximalNewton,
    SemismoothNewton,
    Solution,
    Solver,
    Status,
    solve,
)
from hemivar.solvers.load_stepping import LoadStepping
from hemivar.solvers.newton_on_graph import FEW_ROUNDS, ROUNDS, ForceResidual, active_set_newton, stands
from hemivar.solvers.status import STOPPED, check_interrupt
from hemivar.systems.body import Body
from hemivar.systems.body_on_levels import set_up
from hemivar.systems.chain import Chain, chain_of
from hemivar.systems.workspace import Workspace

if TYPE_CHECKING:
    from hemivar.branches.solutions import SolutionSet

__all__ = ["JumpPaths", "StageSolution", "StageSolver", "predicted_contact"]

#: How far beyond the end of a branch the load goes to leave it, as parts of the step: the first that is felt. The
#: tests of jumps pass with the last three alone.
_BEYOND = tuple(10.0**k for k in range(-8, -3))
#: Ends of branches in one step, at most.
_ENDS = 200
#: A displacement that counts as a jump, as a part of a typical one. Tests of jumps pass from 1e-7 to 1e-2.
_JUMPS = 1e-4
#: Part of the tolerance of a step that cycles of multigrid leave, which then meet it (tests pass with 0.5 as well), and
#: that a linear body in the place of another does, whose Newton's method is to converge as fast as without it.
_SHARE, _AIM = 0.9, 0.1
#: Part of the size of what is added up by which rounding may be taken for half of a tolerance.
_ROUNDING = 16.0 * float(np.finfo(float).eps)
#: Ends that a tolerance below what the arithmetic allows may have.
_UNSETTLED = (Status.INACCURATE, Status.MAX_STEPS, Status.STALLED, Status.CYCLING)
#: Part of load and contact forces to which the forces of a short step must be known.
_KNOWN = 1e-5
#: Part of load and contact forces that rounding of displacements may make for a residual to tell something.
#: The tests of jumps and walks pass with 0.1 as well.
_TELLS = 1e-3
#: Steps of a method after which it is clear that rounding keeps it from its tolerance. Tests of jumps pass with 300.
_FEW = 30
#: Contact components up to which small matrices are dense ones.
_DENSE = 4000


@dataclass(frozen=True, eq=False)
class JumpPaths:
    """Follows the equilibria of steps of an elastic body."""

    bodies: StepMatrices
    workspace: Workspace

    def follow(
        self, stage: Stage, convexity_defect: float, jump: SelectionRule, solver: Solver | None, controls: Controls
    ) -> StageSolution:
        """The solution of a stage, at the end of the path from the state before it."""
        problem, before = stage.problem, stage.before
        system = self.workspace.condensed(problem)
        if system.free.size > REPEATED:
            raise MethodError(
                f"jump = '{jump}' follows paths of equilibria, for up to {REPEATED} unknowns of contact points; here "
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
        local, pressed = chain.local(theta, segment)
        line = LoadLine(problem, problem.under(problem.contact_force(pressed), offset=-local))
        slope = chain.force - chain.out_of_balance(theta, segment, np.zeros(chain.size))
        jumps: list[DissipatedJump] = []
        part = 0.0
        for _ in range(_ENDS):
            force = chain.out_of_balance(theta, segment, part * slope)  # so that the start is an equilibrium
            part, theta, segment, done = above("stage_solver.follow_minimisers", f"jump = '{jump}'")(
                chain, force, slope, theta, segment, part
            )
            r, _ = chain.local(theta, segment)
            if done or part >= 1.0 - _BEYOND[-1]:
                return _ended(fall, problem, system.unknowns(r), jumps, (theta, segment) if done else None)
            for beyond in (*_BEYOND, 1.0 - part):
                here = line.at(part + beyond)
                u = system.for_problem(here).unknowns(r)
                landed = fall.down(here, u)
                if landed.status not in (Status.STALLED, Status.INACCURATE):
                    break
            part += beyond
            if landed.status is not Status.CONVERGED:
                return StageSolution(landed, jumps=tuple(jumps))
            jumps += fall.jumped(part, here, u, landed)
            if part >= 1.0:
                return StageSolution(landed, jumps=tuple(jumps))
            theta, segment = chain.nearest(landed.local, landed.multiplier)
        return _ended(fall, problem, landed.unknowns, jumps)


def _ended(
    fall: _GradientFlow,
    problem: DiscreteProblem,
    u: Array,
    jumps: list[DissipatedJump],
    on_graph: tuple[Array, IntArray] | None = None,
) -> StageSolution:
    """The end of a step, maybe at a known place on the graph of the law."""
    at = None if on_graph is None else bottom(fall.chain, problem, *on_graph, fall.controls, fall.paths.workspace)
    if at is not None:
        return StageSolution(at, jumps=tuple(jumps))
    solution = fall.down(problem, u)
    return StageSolution(solution, jumps=(*jumps, *fall.jumped(1.0, problem, u, solution)))


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
        by = DescentSolver(self.solver, self.paths.workspace)
        return gradient_flow(problem, slow, u, by, self.controls, self.chain)

    def jumped(self, part: float, problem: DiscreteProblem, u: Array, landed: Solution) -> list[DissipatedJump]:
        """The jump from a place to where it led, if it was one."""
        before, after = problem.local(u), landed.local
        # Near rest all displacements are small: what typically moves is what a jump is held against.
        size = max(float(np.abs(before).max(initial=0.0)), float(np.abs(after).max(initial=0.0)), self.chain.length)
        if not np.abs(after - before).max(initial=0.0) > _JUMPS * size:
            return []
        return [DissipatedJump(part, problem.energy(u) - problem.energy(landed.unknowns))]


def predicted_contact(stage: Stage, body: Body) -> Array | None:
    """Unknowns (n,) of a stage with its contact points where they will be if the body keeps its acceleration.

    There they settle on the graphs of their laws, each by itself; all other unknowns stay at the
    prediction of the stage, where nothing accelerates.  None where the acceleration tells nothing: in the first step,
    with laws of impact, and in schemes whose accelerations swing, which are all but those of backward differences.
    """
    rule, before = stage.rule, stage.before
    swings = not rule.ends or rule.rate.velocity or rule.rate.acceleration
    if not before.index or swings or rule.restitution is not None:
        return None
    increment = before.body.acceleration[: stage.problem.unknowns] / rule.acceleration.difference
    weights, stiffness, r = body.weights[:, None], body.diagonal, body.local(increment)
    force = body.spread(body.load[body.unknown] - body.pull(increment))
    pair = stiffness[:, [0, min(1, r.shape[1] - 1)]] / weights
    expected = body.law.on_graph((stiffness * r + force) / weights, pair).r
    if not np.isfinite(expected).all():
        return None
    return body.moved(np.zeros(increment.shape), np.where(body.active, expected, body.fixed))


@dataclass(frozen=True, eq=False)
class StageSolution:
    """What solves a stage."""

    solution: Solution
    #: Against which it was found, in units of the stiffness.
    resistance: float = 0.0
    #: Jumps on the way, where the path of equilibria was followed.
    jumps: tuple[DissipatedJump, ...] = ()
    #: Where its unknowns lead, if that was asked on the way.
    reached: StageState | None = None


@dataclass(frozen=True, eq=False)
class StageSolver:
    """Solves stages."""

    discrete: DiscreteEvolution
    bodies: StepMatrices
    solver: Solver | None
    controls: Controls
    workspace: Workspace

    @property
    def resists(self) -> bool:
        """Whether viscosity or a mass chooses among several solutions; branches, which yield at once, do not."""
        return self.discrete.mass is not None or self.discrete.viscosity is not None

    def size(self, stage: Stage) -> float:
        """Size of the forces that act on a stage: its load, and the contact forces before it."""
        contact, lam = self.discrete.problem.contact, stage.before.multiplier
        load = stage.load if stage.fixed_supports else stage.load[: stage.problem.unknowns]
        if self.discrete.vectors.alone:
            return norm(load) + norm(contact.pressed(contact.weights[:, None] * lam))
        return float(self.discrete.vectors.norms(load, contact.force(lam)).sum())

    def convexity_defect(self, stage: Stage) -> float:
        """``c - 1`` of a stage: how much stiffer the body must be to leave one solution; negative if it is.

        Bounds that depend on the solution are taken as they are before the step.
        """
        problem = stage.problem
        if not problem.contact_points:
            return -1.0
        if not any(alpha.any() for alpha in weak_convexity_at(problem.law, -problem.offset)):
            return -1.0
        law = problem.law
        return self.constant(stage, frozen_at(law, -problem.offset) if law.state_dependent else law) - 1.0

    def constant(self, stage: Stage, law: VectorLaw) -> float:
        """The constant c of a stage with a law that depends on no state, ``1 - c`` being its margin.

        Of a body that is condensed anyway it is the largest eigenvalue of a small matrix.
        """
        alphas = law.weak_convexity
        if not any(alpha.any() for alpha in alphas):
            return 0.0

        def computed() -> float:
            if self.condenses(stage.problem):
                return self.workspace.condensed(stage.problem, many=True).body.softening(*alphas)
            frozen = stage.problem if law is stage.problem.law else stage.problem.with_(law=law)
            return smallness(frozen, trace_constant=False, workspace=self.workspace).constant

        return stage.operator.constants.once(tuple(np.asarray(alpha).tobytes() for alpha in alphas), computed)

    def condenses(self, problem: DiscreteProblem) -> bool:
        """Whether stages are solved on the body condensed onto its contact points, by the default method."""
        method = SemismoothNewton if problem.law.state_dependent else NonsmoothNewton
        return (
            isinstance(self.solver, method)
            and self.solver.condenses
            and problem.contact_points > 0
            and problem.offset.size <= _DENSE
        )

    def solution(self, stage: Stage, initial: Solution | None, jump: SelectionRule, size: float) -> StageSolution:
        """The solution of a stage."""
        controls = self.controls.within(self.controls.rtol * size)
        if jump.follows and not self.resists and (convexity_defect := self.convexity_defect(stage)) >= 0.0:
            _refuse_without_energy(stage.problem, jump)
            at_rest = self._at_rest(stage.problem)
            if at_rest is not None:
                return at_rest
            self._condense(stage.problem)
            paths = JumpPaths(self.bodies, self.workspace)
            return paths.follow(stage, convexity_defect, jump, self.solver, controls)
        solved = self._sought(stage, initial, jump, controls)
        if solved.solution.status in _UNSETTLED and controls.rtol > 0.0:
            # In so short a step forces may not be known to the tolerance, for displacements are not; flows of heat that
            # the rounding of temperatures hides change none.
            known = _rounding(stage)
            if _hides(known, controls) or (self.discrete.stores and known > controls.atol):
                solved = self._sought(stage, initial, jump, controls.within(known))
            elif controls.atol == 0.0:  # nothing acts yet that they could be held against, as before a jump
                again = self._sought(stage, initial, jump, controls.within(known / TIGHT))
                solved = again if again.solution.residual.relative <= _KNOWN else solved
        if solved.solution.status is Status.CONVERGED and _indeterminate(self.discrete, stage, controls):
            return replace(solved, solution=replace(solved.solution, status=Status.INACCURATE), reached=None)
        return solved

    def _condense(self, problem: DiscreteProblem) -> None:
        """Condense a body as steps with one solution do: answers must not depend on which steps were taken before."""
        if self.condenses(problem):
            self.workspace.condensed(problem, many=True)

    def _sought(self, stage: Stage, initial: Solution | None, jump: SelectionRule, controls: Controls) -> StageSolution:
        """The solution of a stage to a tolerance."""
        problem, convexity_defect = stage.problem, self.convexity_defect(stage)
        if convexity_defect < 0.0:
            at_rest = self._at_rest(problem)
            near = self._nearby(stage, initial, controls) if at_rest is None else at_rest
            if near is not None:
                return near
            if _hides(_rounding(stage), controls):  # it is looked for again, to what is known
                controls = replace(controls, max_steps=min(controls.max_steps or _FEW, _FEW))
            method = _as_accurate(self.solver, controls)
            start, method = self._foreseen(stage, initial, method)
            return StageSolution(solve(problem, method, controls, initial=start, workspace=self.workspace))
        start = _start(stage, initial)
        self._condense(problem)
        if jump is SelectionRule.GLOBAL and not self.resists:
            _refuse_without_energy(problem, jump)
            minimisers: SolutionSet = above("stage_solver.find_solutions", "jump = 'global'")(
                problem, workspace=self.workspace
            )
            check_time()  # the lowest of a search that was cut short need not be the lowest
            if minimisers.solutions:
                return StageSolution(min(minimisers.solutions, key=lambda solution: solution.energy))
        at_rest = self._at_rest(problem)
        if at_rest is not None:
            return at_rest
        if jump is not SelectionRule.VISCOUS or self.resists:
            near = self._without_barrier(stage, start, controls)
            if near is not None:
                return near
        slow = slowed(self.bodies, problem, convexity_defect)
        if jump is SelectionRule.VISCOUS and not self.resists:
            if slow.contact is not None:
                raise MethodError(
                    "jump = 'viscous' takes a viscosity of the body, and the supports alone do not constrain this "
                    "one; use jump = 'local' or 'arc-length'"
                )
            crept = solve(slow.problem, self.solver, controls, initial=start, workspace=self.workspace)
            return StageSolution(crept, slow.resistance)
        walked = self._walked(stage, slow, start, controls) if self.condenses(problem) else None
        if walked is not None:
            return StageSolution(walked)
        return StageSolution(gradient_flow(problem, slow, start, DescentSolver(self.solver, self.workspace), controls))

    def _walked(self, stage: Stage, slow: Slowed, start: Array, controls: Controls) -> Solution | None:
        """Downhill from where the body is, on its contact points; None where such steps do not settle."""
        system = self.workspace.condensed(stage.problem, many=True)
        norm, most = slow.on_contact(system)
        return Walk(system, norm, most, controls).down(stage.problem.local(start), stage.before.multiplier)

    def _without_barrier(self, stage: Stage, start: Array, controls: Controls) -> StageSolution | None:
        """The solution that Newton's method finds from where the body is, if no barrier lies on the straight way there.

        It is a strict minimiser of the energy: the method goes on from any other.
        """
        alphas = weak_convexity_at(stage.problem.law, -stage.problem.offset)
        if not all(bool(np.isfinite(alpha).all()) for alpha in alphas):
            return None
        near = self._nearby(stage, None, controls, from_rest=True)
        if near is not None and self._follows(stage, near.solution):
            return near
        if not isinstance(stage.problem.bulk, Quadratic) or isinstance(self.solver, LoadStepping):
            return None
        method = None if self.solver is None else self.solver.local_descent()
        try:
            solution = solve(stage.problem, method, controls, initial=start, workspace=self.workspace)
        except ProblemError:  # an energy without a lower bound may have a local minimum
            return None
        check_interrupt(solution.status)
        if solution.status in STOPPED:
            return StageSolution(solution)
        if solution.status is Status.CONVERGED and not path_bends_downwards(stage.problem, solution, stage.start):
            return StageSolution(solution)
        return None

    def _follows(self, stage: Stage, solution: Solution) -> bool:
        """Whether a pair of the condensed body is a strict minimiser, with no barrier on the straight way there."""
        system = self.workspace.condensed(stage.problem, many=True)
        stable = stands(system, solution.local, solution.multiplier)
        return stable and not path_bends_downwards(stage.problem, solution, stage.start)

    def _at_rest(self, problem: DiscreteProblem) -> StageSolution | None:
        """The solution where the body is, if nothing acts there and the foundation does not push.

        No iteration would find so: it has nothing to hold a residual against.
        """
        if not self.discrete.vectors.alone or not problem.unmoved:
            return None
        unknowns, residual = np.zeros(problem.unknowns), Residual(0.0, 0.0, 0.0, 0.0)
        none = np.zeros_like(problem.offset)
        return StageSolution(Solution(problem, unknowns, none, Status.CONVERGED, residual, method="rest"))

    def _foreseen(self, stage: Stage, initial: Solution | None, method: Solver | None) -> tuple[Array, Solver | None]:
        """Where a method starts from, and how: multigrid with the contact points where they are expected."""
        inert, start = self.discrete.mass is not None, _start(stage, initial)
        if initial is not None or not inert or not isinstance(method, NonsmoothMultigrid | SemismoothNewton):
            return start, method
        if method.condenses or method.refuse(stage.problem) is not None:
            return start, method
        expected = predicted_contact(stage, set_up(stage.problem, self.workspace))
        return (start, method) if expected is None else (expected, replace(method, settled=True))

    def _nearby(
        self, stage: Stage, initial: Solution | None, controls: Controls, from_rest: bool = False
    ) -> StageSolution | None:
        """The one solution of a stage, if a few of Newton's equations lead to it from what is expected.

        Or, ``from_rest``, from where the body is.
        """
        if not self.condenses(stage.problem):
            return None
        base, reached = stage.before, None
        system = self.workspace.condensed(stage.problem, many=True)
        if initial is None:
            span = 0.0 if from_rest else stage.rule.at * stage.step
            r = base.local.displacement + span * base.local.velocity - stage.origin
            lam = extrapolated_multiplier(base, span)
        else:
            r, lam = initial.local, initial.multiplier
        enough = controls.atol / _ROUNDING

        def left(unknowns: Array) -> ForceResidual:
            nonlocal reached
            reached = stage_state(self.discrete, stage, unknowns)
            return out_of_balance_force(self.discrete, stage, reached, enough)

        known, rounds = left if stage.fixed_supports else None, FEW_ROUNDS if from_rest else ROUNDS
        solution = active_set_newton(system, r, lam, controls, stage.operator.newton, known, rounds)
        if solution is None:
            return None
        return StageSolution(solution, reached=reached if reached and reached.unknowns is solution.unknowns else None)


def _start(stage: Stage, initial: Solution | None) -> Array:
    """Unknowns (n,) that a method starts from."""
    return np.zeros(stage.problem.unknowns) if initial is None else initial.unknowns


def _refuse_without_energy(problem: DiscreteProblem, jump: SelectionRule) -> None:
    """Refuse choices among equilibria by their energy, or along paths of its minimisers, where there is none."""
    if problem.law.state_dependent:
        raise MethodError(
            f"jump = '{jump}' needs an energy, and there is none for a friction bound that depends on the solution "
            "(Coulomb); take jump = 'local', 'viscous' or 'stop'"
        )


def _rounding(stage: Stage) -> float:
    """Forces that displacements make which are known to half a unit in their last place."""
    sums, n = stage.problem.bulk.row_sums, stage.problem.unknowns
    size = norm(sums * stage.prediction[:n]) + float(sums.max(initial=0.0)) * norm(stage.offset)
    return 0.5 * float(np.finfo(float).eps) * size


def _indeterminate(discrete: DiscreteEvolution, stage: Stage, controls: Controls) -> bool:
    """Whether displacements do not tell the forces of so short a step: their rounding makes too much of them.

    A body that comes to rest is none of these: the rounding is next to nothing beside the elastic forces then.
    """
    sums, n = stage.problem.bulk.row_sums, stage.problem.unknowns
    made = 8.0 * float(np.finfo(float).eps) * norm(sums * stage.prediction[:n])
    if not (controls.rtol > 0.0 and 0.0 < controls.atol < controls.rtol * made / _TELLS):
        return False
    elastic = discrete.stiffness.row_sums
    return made > COUNTS * norm(elastic * stage.prediction[: elastic.size])


def _hides(known: float, controls: Controls) -> bool:
    """Whether forces are not known to the tolerance, and yet to enough of load and contact forces."""
    return controls.rtol > 0.0 and controls.atol < known <= _KNOWN * controls.atol / controls.rtol


def _as_accurate(solver: Solver | None, controls: Controls) -> Solver | None:
    """Multigrid whose cycles end where the tolerance of the step does, and not that of what is left of its load.

    And a method for bodies that are not linear which solves linear ones no further.
    """
    if isinstance(solver, ProximalNewton):
        return solver if solver.absolute else replace(solver, absolute=_AIM * controls.atol)
    if isinstance(solver, SemismoothNewton) and solver.tolerance is None:
        return replace(solver, tolerance=0.5 * controls.rtol, absolute=0.5 * controls.atol)
    if not isinstance(solver, NonsmoothMultigrid) or solver.tolerance is not None:
        return solver
    return replace(solver, tolerance=_SHARE * controls.rtol, absolute=_SHARE * controls.atol)
