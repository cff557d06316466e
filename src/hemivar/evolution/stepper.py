"""A step: a pure function from one state to the next.

What is left of the balance of energy is the work of the forces that are out of balance on the way of the step, at most
the product of both norms. A step that counts as solved leaves at most ``rtol`` times the forces that act, rounding
aside; these are the norms of the load, of elastic, viscous and inertial forces, of branches and of the foundation, as
they are where the step ends. A residual that is measured against larger forces, which cancel, may be small and yet
allow more.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.arrays import norm
from hemivar.basics.deadline import check_time
from hemivar.basics.types import Array
from hemivar.discrete.residual import Residual
from hemivar.evolution.data_in_time import DataInTime, StatedData
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData, StepMatrices
from hemivar.evolution.jumps import DissipatedJump, SelectionRule
from hemivar.evolution.schemes import ImplicitEuler, Scheme
from hemivar.evolution.stage import Stage, StageState, discrete_stage, rounding_size, stage_state
from hemivar.evolution.stage_solver import StageSolver
from hemivar.evolution.state import EnergyBalance, Kinematics, TimeState
from hemivar.evolution.step_end import SolvedStage, end_of_step, with_products
from hemivar.evolution.step_laws import StepLaw, stage_law
from hemivar.evolution.step_operator import StepOperator, StepOperators, body_factors, step_operator
from hemivar.laws import VectorLaw
from hemivar.linear.threads import one_thread
from hemivar.linear.vectors import Vectors
from hemivar.solvers import Controls, Solution, Solver, Status
from hemivar.solvers.choice import choose
from hemivar.solvers.solve import suited
from hemivar.systems.workspace import Workspace

__all__ = ["StepResult", "TimeStepper", "allowed_work", "method_of", "rounding_of"]

#: Rounding of sums, in units of what is added up: of energies, and of forces where a step is solved as well as these
#: are known.
_ENERGIES, _FORCES = 64.0 * float(np.finfo(float).eps), 1024.0 * float(np.finfo(float).eps)
#: Rounds of a law that depends on the solution of its own step.
_ROUNDS = 60
#: Part of slips and multipliers that a round may still change where the law stands.
_STANDS = 1e-10
#: How far beyond what was found a guess goes at most, in parts of the way from the last round to this one.
AHEAD = 4.0
#: What is said where they do not settle.
_UNSETTLED = (
    "the internal variables of the contact points and the solution of the step do not converge. Near the limit "
    "load no step converges: give the body mass or viscosity, or prescribe a displacement instead of the load"
)


def rounding_of(ledger: EnergyBalance) -> float:
    """How far rounding may take the gap of a ledger, which is a sum of its entries."""
    return _ENERGIES * float(sum(map(abs, vars(ledger).values())))


def allowed_work(
    discrete: DiscreteEvolution,
    stage: Stage,
    reached: StageState,
    multiplier: Array,
    increment: Array,
    rtol: float,
) -> float:
    """Most work on a way (n + k,) of the forces that a solved stage may leave out of balance.

    ``multiplier`` is (m, c).
    """
    n = discrete.unknowns
    acting = norm(stage.load[:n]) + norm(discrete.problem.contact_force(multiplier))
    acting += sum(abs(force.factor) * norm(force.vector[:n]) for force in reached.forces.values())
    rounding = rounding_size(discrete, stage, reached.body, 0.0)
    return norm(increment[:n]) * (rtol * acting + _FORCES * (acting + rounding))


@dataclass(frozen=True, eq=False)
class StepResult:
    """A step that was taken."""

    before: TimeState
    state: TimeState
    step: float
    solutions: tuple[Solution, ...]
    stages: tuple[Stage, ...]
    #: Jumps on the way, where the path of equilibria was followed.
    jumps: tuple[DissipatedJump, ...] = ()
    #: The step of heat that belongs to it.
    heat: StepResult | None = None
    #: Where the status says too little: what happened, and what to try.
    advice: str = ""

    @property
    def remedy(self) -> str:
        """What happened in words, and what to try."""
        return self.advice or self.status.remedy

    @property
    def status(self) -> Status:
        """The first status that is not convergence, if there is one."""
        return next((s.status for s in self.solutions if s.status is not Status.CONVERGED), Status.CONVERGED)

    @property
    def residual(self) -> float:
        """Largest relative residual of the stages, and of heat."""
        own = max(solution.residual.relative for solution in self.solutions)
        return own if self.heat is None else max(own, self.heat.residual)


@dataclass(frozen=True, eq=False)
class TimeStepper:
    """Takes steps of an evolution.  What its parts keep only saves work."""

    discrete: DiscreteEvolution
    scheme: Scheme
    stages: StageSolver
    operators: StepOperators
    data: DataInTime

    @classmethod
    def of(
        cls,
        discrete: DiscreteEvolution,
        scheme: Scheme,
        solver: Solver | None,
        controls: Controls,
        workspace: Workspace | None = None,
        stops: Mapping[float, float] | None = None,
    ) -> TimeStepper:
        """What takes the steps of an evolution without heat."""
        bodies = StepMatrices(discrete)
        method = method_of(discrete) if solver is None else solver
        if method is not None and not discrete.linear:
            method = suited(method, discrete.problem)
        return cls(
            discrete,
            scheme,
            StageSolver(discrete, bodies, method, controls, Workspace.given(workspace)),
            StepOperators(discrete, bodies, scheme),
            StatedData(discrete, stops or {}),
        )

    @property
    def beside(self) -> TimeStepper | None:
        """What takes the steps of heat."""
        return None

    @property
    def controls(self) -> Controls:
        """Tolerances of steps."""
        return self.stages.controls

    def data_from(self, state: TimeState) -> DataInTime:
        """What acts on the body as it is seen from a state, whatever step was taken before."""
        return self.data

    def initialise(self, state: TimeState) -> TimeState:
        """The state at the beginning with all else that it holds beside the motion."""
        return state

    def extra_columns(self, state: TimeState) -> dict[str, float]:
        """What a row of the table says beside forces, probes and the balance of energy, by names of columns."""
        return {}

    def take(
        self, before: TimeState, step: float, end_time: float | None = None, jump: SelectionRule = SelectionRule.LOCAL
    ) -> StepResult:
        """One step; the state before it stays as it is."""
        end = before.time + step if end_time is None else end_time
        solver = self.stages.solver
        with one_thread(solver is not None and not solver.condenses):
            return self.take_under(self.data, before, step, end, jump)

    def take_under(
        self,
        data: DataInTime,
        before: TimeState,
        step: float,
        end_time: float,
        jump: SelectionRule = SelectionRule.LOCAL,
    ) -> StepResult:
        """One step under other data than those of the evolution; see :meth:`take`."""
        before = with_products(self.discrete, before)
        operators = self.operators.of(step, before.last_length)
        start, end = data.before(before.time), data.before(end_time)
        base = before
        solved: list[SolvedStage] = []
        if operators[0].rule.restitution is not None and end.offset is not start.offset:
            base = self._along(before, (end.offset - start.offset) / step)
        for operator in operators:
            at = end if operator.rule.at == 1.0 else data.at(before.time + operator.rule.at * step)
            solved.append(self._solved(self.stages, base, operator, at, end, start, jump))
            if solved[-1].solution.status is not Status.CONVERGED:
                break
            if len(operators) > 1:
                last = solved[-1]
                local = before.local.at_velocity(last.local.velocity)
                base = replace(before, body=before.body.at_velocity(last.body.velocity), local=local)
        taken = self._ended(before, solved, step, end_time, end)
        return self._balanced(taken, solved)

    def _ended(
        self, before: TimeState, solved: list[SolvedStage], step: float, time: float, end: ExternalData
    ) -> StepResult:
        state = end_of_step(self.discrete, before, solved, step, time, end, self.scheme.multistep)
        jumps = tuple(jump for one in solved for jump in one.jumps)
        last = solved[-1]
        open_ = last.solution.status is Status.NOT_CONTRACTING and last.stage.law.iterates
        return StepResult(
            before,
            state,
            step,
            tuple(one.solution for one in solved),
            tuple(one.stage for one in solved),
            jumps,
            advice=_UNSETTLED if open_ else "",
        )

    def _balanced(self, taken: StepResult, solved: list[SolvedStage]) -> StepResult:
        """A step, not solved if its balance of energy does not close to what the residual allows."""
        before, state, rtol = taken.before, taken.state, self.controls.rtol
        gap, work = (abs(getattr(state.ledger, name) - getattr(before.ledger, name)) for name in ("gap", "work"))
        least = max(rounding_of(state.ledger), rtol * work)  # no more than what is allowed
        if gap <= least or taken.status is not Status.CONVERGED or not self.discrete.vectors.alone:
            return taken
        allowed = 0.0
        for part in solved:
            increment = part.stage.rule.share * taken.step * part.body.velocity
            if len(solved) == 1:
                increment = state.body.displacement - before.body.displacement
            allowed += allowed_work(self.discrete, part.stage, part.reached, part.solution.multiplier, increment, rtol)
        if gap <= allowed:
            return taken
        off = replace(taken.solutions[-1], status=Status.INACCURATE)
        advice = (
            f"the energy balance does not close: {gap:.3g} is left where the residual allows {allowed:.3g}; far "
            f"larger forces cancel each other, for example where a part of the body has almost no mass"
        )
        if self.discrete.mass is not None:
            advice += "; take implicit-euler, or give it a mass like that of the other parts"
        return replace(taken, solutions=(*taken.solutions[:-1], off), advice=advice)

    def _along(self, before: TimeState, rate: Array) -> TimeState:
        """A state at which gaps begin to change at the rate (m, c) that they have in the whole step."""
        trace_of = self.discrete.problem.contact.trace_of(before.body.velocity[: self.discrete.unknowns])
        return replace(before, local=before.local.at_velocity(trace_of - rate))

    def at_once(
        self,
        before: TimeState,
        span: float,
        start: ExternalData,
        now: ExternalData,
        jump: SelectionRule = SelectionRule.LOCAL,
    ) -> StepResult:
        """A short step of implicit Euler, after which the time is what it was."""
        (rule,) = ImplicitEuler().rules(span)
        stages = self.stages
        if stages.resists or self.discrete.branches:
            stages = replace(stages, workspace=Workspace())  # its factors are given back
        before = with_products(self.discrete, before)
        operator = step_operator(self.discrete, stages.bodies, rule, span)
        solved = self._solved(stages, before, operator, now, now, start, jump)
        return self._ended(before, [solved], span, before.time, now)

    def stage_laws(self, before: TimeState, step: float) -> list[tuple[tuple[float, ...], VectorLaw]]:
        """For each stage of a step, not solved: what makes its body, see :meth:`StepMatrices.body`, and its law.

        The state before stands for what the stages would find.
        """
        laws = []
        guess = self.discrete.counted(before.local.displacement, before.local.displacement)
        data, timed = self.data_from(before), "law" in self.discrete.evolution.problem.time_dependent
        for rule in self.operators.rules(step, before.last_length):
            acting = data.at(before.time + (rule.at * step if timed else 0.0))
            law = stage_law(self.discrete, acting, before, rule, step, guess, before.multiplier)
            laws.append((body_factors(self.discrete, rule, step), law.law))
        return laws

    def _solved(
        self,
        stages: StageSolver,
        base: TimeState,
        operator: StepOperator,
        at: ExternalData,
        end: ExternalData,
        start: ExternalData,
        jump: SelectionRule,
    ) -> SolvedStage:
        """A stage, its law being that of its own solution."""
        discrete, vectors, rule = self.discrete, self.discrete.vectors, operator.rule
        before = base.local.displacement
        guess, multiplier = discrete.counted(before, before), base.multiplier
        initial: Solution | None = None
        last: _Round | None = None
        for _ in range(_ROUNDS + discrete.breakable):
            check_time()
            law = stage_law(discrete, at, base, rule, operator.step, guess, multiplier, operator.laws)
            stage = discrete_stage(discrete, stages.bodies, base, operator, at, end, start, law)
            size = stages.size(stage)
            solved = stages.solution(stage, initial, jump, size)
            solution, local = solved.solution, stage.local(solved.solution)
            point = stage.local_motion(local)
            own = _undamped(law, point, solution.multiplier)
            again = law.iterates and solution.status is Status.CONVERGED
            if not (again if vectors.alone else vectors.largest(float(again))[0]):
                break
            slid = discrete.counted(local, before)
            change, size, pressed, level = vectors.largest(
                float(np.abs(slid - guess).max(initial=0.0)),
                float(np.abs(local).max(initial=0.0)),
                float(np.abs(own - multiplier).max(initial=0.0)),
                float(np.abs(own).max(initial=0.0)),
            ).tolist()
            weighted = stage.problem.contact.weights[:, None] * (own - multiplier)
            left = solution.residual.total + solution.residual.rounding  # forces are not known better
            same = pressed <= _STANDS * level or float(vectors.norms(weighted)[0]) <= left
            if change <= _STANDS * size and same:
                break
            this = _Round(slid, own, slid - guess, own - multiplier)
            guess, multiplier = this.ahead(last, vectors, size, level)
            initial, last = solution, this
        else:
            solution = replace(solution, status=Status.NOT_CONTRACTING)
        off = solution.residual  # it is told against all that the tolerance was held against
        off = Residual(off.equilibrium, off.inclusion, off.scale + size, off.noise)
        rescaled = replace(solution, residual=off)
        reached = stage_state(discrete, stage, solution.unknowns) if solved.reached is None else solved.reached
        return SolvedStage(stage, rescaled, reached, point, own, solved.resistance, solved.jumps)


@dataclass(frozen=True, eq=False)
class _Round:
    """What a stage was found to be under the law of a guess, and by how much the guess missed it."""

    slid: Array  # (m, c)
    multiplier: Array  # (m, c)
    change: Array  # (m, c): of what has slid
    pressed: Array  # (m, c): of the multiplier

    def ahead(self, last: _Round | None, vectors: Vectors, size: float, level: float) -> tuple[Array, Array]:
        """The next guess: as far beyond what was found as the last two rounds say that the next ones lead.

        (Anderson's method with one round kept.)  Where the guess has not come nearer it is what was found.
        ``size, level``: what displacements and multipliers are held against.
        """
        if last is None or not size > 0.0 or not level > 0.0:
            return self.slid, self.multiplier
        now, before = (np.append(one.change / size, one.pressed / level) for one in (self, last))
        less = before - now
        along, square, left, was = vectors.total(
            float(less @ now), float(less @ less), float(now @ now), float(before @ before)
        ).tolist()
        share = along / square if left < was and square > 0.0 else 0.0
        if not 0.0 < share <= AHEAD:
            return self.slid, self.multiplier
        increment = self.slid - last.slid, self.multiplier - last.multiplier
        return self.slid + share * increment[0], self.multiplier + share * increment[1]


def method_of(discrete: DiscreteEvolution) -> Solver | None:
    """What suits the elastic body; None over ranks, whose engine has one."""
    return suited(choose(discrete.problem, many=True)[0], discrete.problem) if discrete.vectors.alone else None


def _undamped(law: StepLaw, point: Kinematics, multiplier: Array) -> Array:
    """The multiplier (m, c) without what laws of the rate of the penetration exert: that of laws and memories.

    Of the splits of the pressure between both the one nearest to the slope of the law of the rate.
    """
    own = multiplier
    for block in law.blocks:
        if block.damping is None:
            continue
        own = multiplier.copy() if own is multiplier else own
        rate, lam = point.velocity[block.index, 0], multiplier[block.index, 0]
        stored, felt = (
            block.undamped.pressures(point.displacement[block.index]),
            block.damping.subdifferential(rate),
        )
        slope = np.clip(block.damping.derivative(rate), felt.lower, felt.upper)
        own[block.index, 0] -= np.clip(slope, lam - stored.upper, lam - stored.lower)
    return own
