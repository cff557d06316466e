"""A time step over ranks: the serial one, its stages solved and its margins found by all ranks together."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.deadline import OutOfTime
from hemivar.basics.types import Array
from hemivar.certificates import EnergyNorm
from hemivar.certificates.smallness import smallness
from hemivar.discrete.problem import DiscreteProblem
from hemivar.evolution import Scheme
from hemivar.evolution.data_in_time import StatedData
from hemivar.evolution.descent import DescentSolver, gradient_flow, slowed
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.margin import Margins
from hemivar.evolution.stage import Stage
from hemivar.evolution.stage_solver import StageSolution, StageSolver
from hemivar.evolution.step_operator import StepOperators
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.laws import VectorLaw
from hemivar.laws.vector_law import frozen_at
from hemivar.ranks.body_on_ranks import BodyOnRanks, body_of
from hemivar.ranks.certificate import CyclesOnRanks
from hemivar.ranks.evolution import EvolutionOnRanks, StepMatricesOnRanks
from hemivar.ranks.solve import Saved, solve_distributed
from hemivar.ranks.time_limit import TimeLimit
from hemivar.solvers import Controls, Solution, Solver
from hemivar.solvers.base import State
from hemivar.systems.body import Body
from hemivar.systems.workspace import Workspace

__all__ = ["MarginsOnRanks", "StageSolverOnRanks", "stepper_on_ranks"]


def stepper_on_ranks(
    discrete: DiscreteEvolution,
    scheme: Scheme,
    solver: Solver | None,
    controls: Controls,
    workspace: Workspace | None,
    stops: Mapping[float, float],
    *,
    alarm: TimeLimit,
) -> TimeStepper:
    """What takes steps whose stages are solved over ranks; see :meth:`hemivar.evolution.stepper.TimeStepper.of`."""
    assert isinstance(discrete, EvolutionOnRanks)
    bodies = StepMatricesOnRanks(discrete)
    stages = StageSolverOnRanks(discrete, bodies, solver, controls, Workspace.given(workspace), alarm=alarm)
    return TimeStepper(discrete, scheme, stages, StepOperators(discrete, bodies, scheme), StatedData(discrete, stops))


@dataclass(frozen=True, eq=False)
class StageSolverOnRanks(StageSolver):
    """Solves stages over ranks."""

    discrete: EvolutionOnRanks
    bodies: StepMatricesOnRanks
    alarm: TimeLimit = field(kw_only=True)  # ends a solve before it is done

    def constant(self, stage: Stage, law: VectorLaw) -> float:
        """The constant c of a stage, as :func:`certify_on_ranks` finds it; nan where the time did not suffice."""
        ranks, problem = self.discrete.ranks, stage.problem
        alphas = [np.asarray(alpha) for alpha in law.weak_convexity] if problem.contact_points else []
        (softest,) = ranks.largest(max((float(alpha.max(initial=0.0)) for alpha in alphas), default=0.0)).tolist()
        if softest in (0.0, math.inf):
            return float(softest)
        shape = problem.contact.weights.shape
        # Known again by the laws of all ranks: what one of them has seen may be another law on the next.
        own = hashlib.sha256(b"".join(np.broadcast_to(alpha, shape).tobytes() for alpha in alphas)).digest()

        def computed() -> float:
            by = CyclesOnRanks(_body_of(problem), self.alarm, examined=False)
            try:
                return smallness(problem.with_(law=law), factor=EnergyNorm(by), trace_constant=False).constant
            except OutOfTime:
                return math.nan
            finally:
                by.release()

        return stage.operator.constants.once(tuple(ranks.mpi.allgather(own)), computed)

    def convexity_defect(self, stage: Stage) -> float:
        if self.depends(stage.problem):
            return -1.0
        return self.constant(stage, stage.problem.law) - 1.0

    def depends(self, problem: DiscreteProblem) -> bool:
        """Whether a bound of the law depends on the solution, on any rank."""
        own = bool(problem.contact_points) and problem.law.state_dependent
        return bool(self.discrete.ranks.largest(float(own))[0])

    def solution(self, stage: Stage, initial: Solution | None, jump: SelectionRule, size: float) -> StageSolution:
        problem, controls = stage.problem, self.controls.within(self.controls.rtol * size)
        start = np.zeros(problem.unknowns) if initial is None else initial.unknowns
        convexity_defect = self.convexity_defect(stage)
        by = DescentSolverOnRanks(self.solver, self.workspace, self.controls, self.alarm)
        if not 0.0 <= convexity_defect < math.inf:
            return StageSolution(by.solved(problem, start, controls))
        slow = slowed(self.bodies, problem, convexity_defect)
        return StageSolution(gradient_flow(problem, slow, start, by, controls))


@dataclass(frozen=True, eq=False)
class DescentSolverOnRanks(DescentSolver):
    """How the problems of a descent are solved over ranks."""

    controls: Controls
    alarm: TimeLimit

    def solved(self, problem: DiscreteProblem, u: Array, controls: Controls) -> Solution:
        body = _body_of(problem)
        start = body.start(u)
        alarm = self.alarm.limited(min(self.controls.max_time, self.alarm.left))
        saved = Saved(State(start, body.multiplier(start)), ())
        return solve_distributed(body, self.solver, controls, resume=saved, alarm=alarm, problem=problem)

    def on_levels(self, problem: DiscreteProblem) -> Body | None:
        return _body_of(problem)


def _body_of(problem: DiscreteProblem) -> BodyOnRanks:
    """The body of a stage, under its load and with its law."""
    return body_of(problem).under(problem.load, problem.offset, problem.law)


class MarginsOnRanks(Margins):
    """Margins that all ranks find together."""

    def _of(self, stage: Stage, solution: Solution) -> float:
        convexity_defect, stages = self.stepper.stages.convexity_defect(stage), self.stepper.stages
        assert isinstance(stages, StageSolverOnRanks)
        return math.nan if stages.depends(stage.problem) else -convexity_defect

    def largest_step(self, taken: StepResult) -> float:
        """inf where the laws are convex, nan elsewhere."""
        problem = taken.stages[0].problem
        alphas = frozen_at(problem.law, -problem.offset).weak_convexity if problem.contact_points else ()
        softens = any(np.any(alpha) for alpha in alphas)
        return math.nan if self.stepper.discrete.vectors.largest(float(softens))[0] else math.inf
