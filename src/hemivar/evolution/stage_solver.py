"""How a stage is solved, and whether it has one solution only."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arrays import norm
from hemivar.basics.types import Array
from hemivar.branches import find_solutions
from hemivar.certificates.smallness import smallness
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.residual import Residual
from hemivar.errors import MethodError
from hemivar.evolution.descent import TIGHT, downhill, slowed
from hemivar.evolution.discrete import DiscreteEvolution, StepMatrices
from hemivar.evolution.jump_paths import JumpPaths
from hemivar.evolution.jumps import DissipatedJump, SelectionRule
from hemivar.evolution.prediction import predicted_contact
from hemivar.evolution.stage import Stage, StageState, extrapolated_multiplier, out_of_balance_force, stage_state
from hemivar.laws import VectorLaw
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
from hemivar.solvers.newton_on_graph import ForceResidual, active_set_newton
from hemivar.systems.body_on_levels import set_up
from hemivar.systems.workspace import Workspace

__all__ = ["StageSolution", "StageSolver"]

#: Part of the tolerance of a step that cycles of multigrid leave, and that a linear body in the place of another does.
_SHARE, _AIM = 0.9, 0.1
#: Part of the size of what is added up by which rounding may be taken for half of a tolerance.
_ROUNDING = 16.0 * float(np.finfo(float).eps)
#: Ends that a tolerance below what the arithmetic allows may have.
_UNSETTLED = (Status.INACCURATE, Status.MAX_STEPS, Status.STALLED, Status.CYCLING)
#: Part of load and contact forces to which the forces of a short step must be known.
_KNOWN = 1e-5
#: Part of load and contact forces that rounding of displacements may make for a residual to tell something.
_TELLS = 1e-3
#: Part of the elastic forces up to which such rounding does nothing.
_NOTHING = 1e-6
#: Steps of a method after which it is clear that rounding keeps it from its tolerance.
_FEW = 30
#: Contact components up to which small matrices are dense ones.
_DENSE = 4000


@dataclass(frozen=True, eq=False)
class StageSolution:
    """What solves a stage."""

    solution: Solution
    #: Against which it was found, in units of the stiffness.
    resistance: float = 0.0
    #: Jumps on the way, where the path of equilibria was followed.
    leaps: tuple[DissipatedJump, ...] = ()
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
        load = stage.load if stage.held else stage.load[: stage.problem.unknowns]
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
        if not any(alpha.any() for alpha in problem.law.weak_convexity_at(-problem.offset)):
            return -1.0
        law = problem.law
        return self.constant(stage, law.frozen_at(-problem.offset) if law.state_dependent else law) - 1.0

    def constant(self, stage: Stage, law: VectorLaw) -> float:
        """The constant c of a stage with a law that depends on no state, ``1 - c`` being its margin.

        Of a body that is condensed anyway it is the largest eigenvalue of a small matrix.
        """
        alphas = law.weak_convexity
        if not any(alpha.any() for alpha in alphas):
            return 0.0

        def found() -> float:
            if self.condenses(stage.problem):
                return self.workspace.condensed(stage.problem, many=True).body.softening(*alphas)
            posed = stage.problem if law is stage.problem.law else stage.problem.with_(law=law)
            return smallness(posed, trace_constant=False, workspace=self.workspace).constant

        return stage.operator.constants.once(tuple(np.asarray(alpha).tobytes() for alpha in alphas), found)

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
            self._condense(stage.problem)
            paths = JumpPaths(self.bodies, self.workspace)
            followed = paths.follow(stage, convexity_defect, jump, self.solver, controls)
            return StageSolution(followed.solution, leaps=followed.leaps)
        found = self._sought(stage, initial, jump, controls)
        if found.solution.status in _UNSETTLED and controls.rtol > 0.0:
            # In so short a step forces may not be known to the tolerance, for displacements are not; flows of heat that
            # the rounding of temperatures hides change none.
            known = _rounding(stage)
            if _hides(known, controls) or (self.discrete.stores and known > controls.atol):
                found = self._sought(stage, initial, jump, controls.within(known))
            elif controls.atol == 0.0:  # nothing acts yet that they could be held against, as before a jump
                again = self._sought(stage, initial, jump, controls.within(known / TIGHT))
                found = again if again.solution.residual.relative <= _KNOWN else found
        if found.solution.status is Status.CONVERGED and _untold(self.discrete, stage, controls):
            return replace(found, solution=replace(found.solution, status=Status.INACCURATE), reached=None)
        return found

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
            found = find_solutions(problem, workspace=self.workspace)
            if found.solutions:
                return StageSolution(min(found.solutions, key=lambda solution: solution.energy))
        at_rest = self._at_rest(problem)
        if at_rest is not None:
            return at_rest
        slow = slowed(self.bodies, problem, convexity_defect)
        if jump is SelectionRule.VISCOUS and not self.resists:
            if slow.contact is not None:
                raise MethodError(
                    "jump = 'viscous' takes a viscosity of the body, and the supports alone do not hold this one; take "
                    "jump = 'local' or 'arc-length'"
                )
            crept = solve(slow.problem, self.solver, controls, initial=start, workspace=self.workspace)
            return StageSolution(crept, slow.resistance)
        return StageSolution(downhill(problem, slow, start, self.solver, controls, self.workspace))

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
        if (
            initial is not None
            or not inert
            or not isinstance(method, NonsmoothMultigrid)
            or method.refuse(stage.problem) is not None
        ):
            return start, method
        expected = predicted_contact(stage, set_up(stage.problem, self.workspace))
        return (start, method) if expected is None else (expected, replace(method, settled=True))

    def _nearby(self, stage: Stage, initial: Solution | None, controls: Controls) -> StageSolution | None:
        """The one solution of a stage, if a few of Newton's equations lead to it from what is expected."""
        if not self.condenses(stage.problem):
            return None
        base, reached = stage.before, None
        system = self.workspace.condensed(stage.problem, many=True)
        if initial is None:
            span = stage.rule.at * stage.step
            r = base.local.displacement + span * base.local.velocity - stage.origin
            lam = extrapolated_multiplier(base, span)
        else:
            r, lam = initial.local, initial.multiplier
        enough = controls.atol / _ROUNDING

        def left(unknowns: Array) -> ForceResidual:
            nonlocal reached
            reached = stage_state(self.discrete, stage, unknowns)
            return out_of_balance_force(self.discrete, stage, reached, enough)

        found = active_set_newton(system, r, lam, controls, stage.operator.newton, left if stage.held else None)
        if found is None:
            return None
        return StageSolution(found, reached=reached if reached and reached.unknowns is found.unknowns else None)


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
    size = norm(sums * stage.place[:n]) + float(sums.max(initial=0.0)) * norm(stage.offset)
    return 0.5 * float(np.finfo(float).eps) * size


def _untold(discrete: DiscreteEvolution, stage: Stage, controls: Controls) -> bool:
    """Whether displacements do not tell the forces of so short a step: their rounding makes too much of them.

    A body that comes to rest is none of these: the rounding is next to nothing beside the elastic forces then.
    """
    sums, n = stage.problem.bulk.row_sums, stage.problem.unknowns
    made = 8.0 * float(np.finfo(float).eps) * norm(sums * stage.place[:n])
    if not (controls.rtol > 0.0 and 0.0 < controls.atol < controls.rtol * made / _TELLS):
        return False
    elastic = discrete.stiffness.row_sums
    return made > _NOTHING * norm(elastic * stage.place[: elastic.size])


def _hides(known: float, controls: Controls) -> bool:
    """Whether forces are not known to the tolerance, and yet to enough of load and contact forces."""
    return controls.rtol > 0.0 and controls.atol < known <= _KNOWN * controls.atol / controls.rtol


def _as_accurate(solver: Solver | None, controls: Controls) -> Solver | None:
    """Multigrid whose cycles end where the tolerance of the step does, and not that of what is left of its load.

    And a method for bodies that are not linear which solves linear ones no further.
    """
    if isinstance(solver, ProximalNewton):
        return solver if solver.absolute else replace(solver, absolute=_AIM * controls.atol)
    if not isinstance(solver, NonsmoothMultigrid) or solver.tolerance is not None:
        return solver
    return replace(solver, tolerance=_SHARE * controls.rtol, absolute=_SHARE * controls.atol)
