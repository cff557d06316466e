"""A step over ranks: the serial one, its stages solved and its margins found by all ranks together."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.engines.petsc.body_on_ranks import BodyOnRanks
from hemivar.engines.petsc.certificate import _margin
from hemivar.engines.petsc.discrete_on_ranks import body_of
from hemivar.engines.petsc.evolution import EvolutionOnRanks, StepMatricesOnRanks
from hemivar.engines.petsc.preconditioner import Multigrid
from hemivar.engines.petsc.solve import Saved, solved_on_ranks
from hemivar.engines.petsc.time_limit import Alarm
from hemivar.evolution import Scheme, SelectionRule
from hemivar.evolution.data_in_time import StatedData
from hemivar.evolution.descent import (
    MAX_FLOW_STEPS,
    TIGHT,
    Backoff,
    leads_on,
    minimiser_on_pieces,
    regularising_viscosity,
)
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.margin import Margins
from hemivar.evolution.stage import Stage
from hemivar.evolution.stage_solver import StageSolution, StageSolver
from hemivar.evolution.step_operator import StepOperators
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.laws import VectorLaw
from hemivar.solvers import Controls, FixedPoint, NonsmoothMultigrid, Solution, Solver, Status
from hemivar.solvers.base import State
from hemivar.solvers.status import STOPPED
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
    alarm: Alarm,
) -> TimeStepper:
    """What takes steps whose stages are solved over ranks; see :meth:`hemivar.evolution.stepper.TimeStepper.of`."""
    assert isinstance(discrete, EvolutionOnRanks)
    bodies = StepMatricesOnRanks(discrete)
    stages = StageSolverOnRanks(discrete, bodies, solver, controls, Workspace.given(workspace), alarm=alarm)
    return TimeStepper(discrete, scheme, stages, StepOperators(discrete, bodies, scheme), StatedData(discrete, stops))


@dataclass(frozen=True, eq=False)
class StageSolverOnRanks(StageSolver):
    """Solves stages over ranks.

    Parameters
    ----------
    alarm : Alarm
        Ends a solve before it is done.
    """

    discrete: EvolutionOnRanks
    bodies: StepMatricesOnRanks
    alarm: Alarm = field(kw_only=True)

    def constant(self, stage: Stage, law: VectorLaw) -> float:
        """The largest eigenvalue c of ``(B'W diag(alpha) B, K)`` as :func:`certify_on_ranks` finds it; nan if not."""
        ranks, problem = self.discrete.ranks, stage.problem
        alphas = [np.asarray(alpha) for alpha in law.weak_convexity] if problem.contact_points else []
        (softest,) = ranks.largest(max((float(alpha.max(initial=0.0)) for alpha in alphas), default=0.0)).tolist()
        if softest in (0.0, math.inf):
            return float(softest)
        shape = problem.contact.weights.shape
        # Known again by the laws of all ranks: what one of them has seen may be another law on the next.
        own = hashlib.sha256(b"".join(np.broadcast_to(alpha, shape).tobytes() for alpha in alphas)).digest()

        def found() -> float:
            body = _body_of(problem)
            cycle = Multigrid(body)
            cycle.build(np.zeros(body.unknown.size, dtype=bool), np.zeros((*body.active.shape, body.dim)))
            margin = _margin(body, cycle, self.alarm) if body.supported else None
            cycle.release()
            return math.nan if margin is None else margin.constant

        return stage.operator.constants.once(tuple(ranks.mpi.allgather(own)), found)

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
        body = _body_of(problem)
        start = body.start(None if initial is None else initial.unknowns)
        convexity_defect = self.convexity_defect(stage)
        if not 0.0 <= convexity_defect < math.inf:
            return StageSolution(self._solved(problem, body, start, controls))
        return StageSolution(self._downhill(problem, body, regularising_viscosity(convexity_defect), start, controls))

    def _solved(self, problem: DiscreteProblem, body: BodyOnRanks, start: Array, controls: Controls) -> Solution:
        saved = Saved(State(start, body.multiplier(start)), ())
        alarm = self.alarm.limited(min(self.controls.max_time, self.alarm.left))
        return solved_on_ranks(problem, body, self.solver, controls, alarm, saved)

    def _downhill(
        self, problem: DiscreteProblem, body: BodyOnRanks, resistance: float, u: Array, controls: Controls
    ) -> Solution:
        """Downhill from a place without a leap: steps against a resistance that leaves each of them one solution."""
        ranks, law = self.discrete.ranks, body.law
        tight = replace(controls, rtol=TIGHT * controls.rtol, atol=TIGHT * controls.atol)
        slow = self.bodies.slow(body, resistance)
        looks = Backoff()
        for _ in range(MAX_FLOW_STEPS):
            before, here = body.local(u), body.load + resistance * body.multiply(u)
            solution = self._solved(problem, slow.under(here, body.offset, law), u, tight)
            u = solution.unknowns
            off, onward = body.residual(u, solution.multiplier), leads_on(solution, controls)
            solution = replace(solution, residual=off)
            if off.below(controls.atol, controls.rtol) and solution.status not in STOPPED:
                return replace(solution, status=Status.CONVERGED)
            if not onward:
                return solution
            after = body.local(u)
            softens = float((np.linalg.eigvalsh(law.linearise(after).hessian) < 0.0).any())
            leaves = float(not np.array_equal(law.clamp(before, after), after))
            softening, leaving = ranks.largest(softens, leaves).tolist()
            if softening:
                if looks.due(not leaving):
                    found = self._bottom(problem, body, u, controls)
                    if found is not None:
                        return found
                continue
            if leaving:
                continue
            # On pieces where all laws harden there is no barrier: straight to the bottom, if it lies there.
            there = self._solved(problem, body, u, controls)
            reached = body.local(there.unknowns)
            if not ranks.largest(float(not np.array_equal(law.clamp(after, reached), reached)))[0]:
                return there
        return replace(solution, status=Status.STALLED)

    def _bottom(self, problem: DiscreteProblem, body: BodyOnRanks, u: Array, controls: Controls) -> Solution | None:
        """The bottom of the pieces on which a place lies, if laws that soften leave the body stable there."""
        inner = self.solver.inner if isinstance(self.solver, FixedPoint) else self.solver
        method = inner if isinstance(inner, NonsmoothMultigrid) else NonsmoothMultigrid()
        found = minimiser_on_pieces(method, body, u, controls)
        if found is None:
            return None
        x, multiplier, off = found
        return Solution(problem, x, multiplier, Status.CONVERGED, off, "petsc", 1)


def _body_of(problem: DiscreteProblem) -> BodyOnRanks:
    """The body of a stage, under its load and with its law."""
    return body_of(problem).under(problem.load, problem.offset, problem.law)


class MarginsOnRanks(Margins):
    """Margins that all ranks find together."""

    def _of(self, stage: Stage, solution: Solution) -> float:
        convexity_defect, stages = self.advance.stages.convexity_defect(stage), self.advance.stages
        assert isinstance(stages, StageSolverOnRanks)
        return math.nan if stages.depends(stage.problem) else -convexity_defect

    def largest_step(self, taken: StepResult) -> float:
        """inf where the laws are convex, nan elsewhere."""
        problem = taken.stages[0].problem
        alphas = problem.law.frozen_at(-problem.offset).weak_convexity if problem.contact_points else ()
        softens = any(np.any(alpha) for alpha in alphas)
        return math.nan if self.advance.discrete.vectors.largest(float(softens))[0] else math.inf
