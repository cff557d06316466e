"""A step of a body and its heat: a staggered scheme, iterated with Anderson acceleration until both agree."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.anderson import Anderson
from hemivar.basics.types import Array
from hemivar.evolution.data_in_time import ChangedData, DataInTime
from hemivar.evolution.discrete import DiscreteEvolution, DiscreteHeat, ExternalData
from hemivar.evolution.initial import initial_state
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.schemes import ImplicitEuler, Midpoint, Scheme
from hemivar.evolution.state import EnergyBalance, HeatBalance, ThermalState, TimeState
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.solvers import Controls, Solver, Status
from hemivar.systems.workspace import Workspace

__all__ = ["ThermalStepper", "stepper_of"]

#: Rounds of motion and heat within a step.
_ROUNDS = 200
#: What to do where rounds do not meet.
_UNMET = (
    f"motion and heat have not converged after {_ROUNDS} iterations; use shorter steps or a larger rtol of Heat; a "
    f"conductance that "
    "jumps where contact opens (closed > 0) may leave no solution: let it grow with the pressure or the penetration"
)


def stepper_of(
    discrete: DiscreteEvolution,
    scheme: Scheme,
    solver: Solver | None,
    controls: Controls,
    workspace: Workspace | None = None,
    stops: Mapping[float, float] | None = None,
) -> TimeStepper:
    """What takes steps of an evolution, with or without heat; see :meth:`TimeStepper.of`."""
    plain, heat = TimeStepper.of(discrete, scheme, solver, controls, workspace, stops), discrete.heat
    if heat is None:
        return plain
    flow = TimeStepper.of(heat.conduction, ImplicitEuler() if scheme.order == 1 else Midpoint(), None, controls)
    initial_heat = initial_state(flow)
    first = heat.temperature(initial_heat.body.displacement)
    data = _under(heat, plain.data, _Course(discrete.evolution.start, 0.0, first, first))
    return ThermalStepper(discrete, scheme, plain.stages, plain.operators, data, heat, flow, initial_heat, plain.data)


@dataclass(frozen=True, eq=False)
class _Course:
    """Temperatures of a step: on a straight line between its ends."""

    start: float
    span: float
    before: Array
    after: Array

    def at(self, time: float) -> Array:
        part = (time - self.start) / self.span if self.span else 0.0
        return self.before + part * (self.after - self.before)


def _under(heat: DiscreteHeat, stated: DataInTime, course: _Course) -> DataInTime:
    """What acts on a body under temperatures that change."""
    if not heat.heat.stresses:
        return stated
    return ChangedData(stated, lambda acting, time: replace(acting, load=acting.load + heat.load(course.at(time))))


def _given(heat: DiscreteHeat, stated: DataInTime, power: Array, law_at: tuple[Array, Array, Array]) -> DataInTime:
    """What acts on heat, with what the motion gives it.

    Nodal power (nodes,), penetration and pressure (m,) of the contact points of the body, and the mean temperature of
    both sides (q,) of those of the heat.
    """
    conduction = heat.conduction
    more = np.concatenate([conduction.field.basis.T @ power, power[conduction.moved]])
    return ChangedData(
        stated, lambda acting, _: replace(acting, load=acting.load + more, law=heat.law(acting.law, *law_at))
    )


@dataclass(frozen=True, eq=False)
class ThermalStepper(TimeStepper):
    """Steps of a body with heat.

    In a round the body moves under the temperatures that are known, and heat flows by what the motion then gives:
    friction, deformation and contact.  Rounds follow until temperatures stand; all that rounds of the step changed is
    mixed after Anderson, so that a coupling that would not contract by itself does.  Where it does not, the step is not
    solved.
    """

    heat: DiscreteHeat
    #: Takes the steps of heat.
    flow: TimeStepper
    #: Of heat, at the start.
    initial_heat: TimeState
    #: What acts on the body but for thermal stress; ``data`` are those under the temperatures at the start.
    stated: DataInTime

    @property
    def beside(self) -> TimeStepper | None:
        return self.flow

    def data_from(self, state: TimeState) -> DataInTime:
        return _under(self.heat, self.stated, self._steady(state))

    def _steady(self, state: TimeState) -> _Course:
        """The temperatures of a state, as they are."""
        warm = self.initial_heat if state.heat is None else state.heat.state
        now = self.heat.temperature(warm.body.displacement)
        return _Course(state.time, 0.0, now, now)

    def initialise(self, state: TimeState) -> TimeState:
        content = self._content(self.initial_heat)
        return replace(state, heat=ThermalState(self.initial_heat, HeatBalance(content, content)))

    def take(
        self, before: TimeState, step: float, end_time: float | None = None, jump: SelectionRule = SelectionRule.LOCAL
    ) -> StepResult:
        assert before.heat is not None
        heat, warm = self.heat, before.heat.state
        reached = before.time + step if end_time is None else end_time
        known = heat.temperature(warm.body.displacement)
        last, ratio, mixing = 0.0, 0.0, Anderson()
        if heat.fed_back:
            guess = known + step * heat.conduction.full(warm.body.velocity)[:, 0] if before.index else known.copy()
        else:
            guess = heat.temperature(self._flowed(before, None, step, reached).state.body.displacement)
        for rounds in range(1, _ROUNDS + 1):
            course = _Course(before.time, reached - before.time, known, guess)
            taken = self.take_under(_under(heat, self.stated, course), before, step, reached, jump)
            if taken.status is not Status.CONVERGED:
                return taken
            flowed = self._flowed(before, taken, step, reached)
            if flowed.status is not Status.CONVERGED:
                return replace(taken, solutions=(*taken.solutions, *flowed.solutions))
            temperature = heat.temperature(flowed.state.body.displacement)
            change = temperature - guess
            size = float(np.abs(change).max(initial=0.0))
            strain = float(np.abs(temperature - heat.heat.stress_free).max(initial=0.0))
            ratio = size / last if last else 0.0
            # Whatever degrees are counted from; where changes that fall by less than half are rounding, no further.
            still = size <= heat.heat.rtol * float(np.abs(temperature).max(initial=0.0)) and ratio >= 0.5
            if size <= heat.heat.rtol * strain or still or not heat.heat.stresses:
                return self._accepted(before, taken, flowed, step, course, rounds, ratio)
            last, guess = size, mixing.after(guess, change)
        worst = replace(taken.solutions[-1], status=Status.NOT_CONTRACTING)
        return replace(taken, solutions=(*taken.solutions[:-1], worst), advice=_UNMET)

    def at_once(
        self,
        before: TimeState,
        span: float,
        start: ExternalData,
        now: ExternalData,
        jump: SelectionRule = SelectionRule.LOCAL,
    ) -> StepResult:
        taken = super().at_once(before, span, start, now, jump)
        return replace(taken, state=replace(taken.state, ledger=self._split(taken, self._steady(before), before.time)))

    def _flowed(self, before: TimeState, taken: StepResult | None, step: float, reached: float) -> StepResult:
        """The step of heat, with what a step of the body gives it."""
        assert before.heat is not None
        power = np.zeros(self.heat.conduction.field.basis.shape[0])
        if taken is not None:
            power += (self.heat.rubbed(self._rubbed(taken)) + self._deformed(taken)) / step
        met, warm = self._met(before, taken, step), before.heat.state
        known = self._mean_of_sides(warm)
        (rule,), mean = self.flow.scheme.rules(step), known
        for _ in range(_ROUNDS):
            data = _given(self.heat, self.flow.data, power, (*met, mean))
            flowed = self.flow.take_under(data, warm, step, reached)
            if flowed.status is not Status.CONVERGED or not self.heat.depends_on_temperature:
                return flowed
            after = known + rule.at * (self._mean_of_sides(flowed.state) - known)
            if np.abs(after - mean).max(initial=0.0) <= self.heat.heat.rtol * np.abs(after).max(initial=0.0):
                return flowed
            mean = after
        worst = replace(flowed.solutions[-1], status=Status.NOT_CONTRACTING)
        return replace(flowed, solutions=(*flowed.solutions[:-1], worst), advice=_UNMET)

    def _mean_of_sides(self, warm: TimeState) -> Array:
        """The mean temperature (q,) of both sides at the contact points of the heat."""
        nodes = self.heat.conduction.problem.contact.node
        return self.heat.temperature(warm.body.displacement)[nodes] - 0.5 * warm.local.displacement[:, 0]

    def _met(self, before: TimeState, taken: StepResult | None, step: float) -> tuple[Array, Array]:
        """Penetration and pressure (m,) at the stage of heat; pressures are known at the stages of the motion."""
        if taken is None:
            return before.local.displacement[:, 0], before.multiplier[:, 0]
        (flow,) = self.flow.scheme.rules(step)
        part, at = flow.at, taken.stages[0].rule.at
        increment = taken.state.local.displacement[:, 0] - before.local.displacement[:, 0]
        change = taken.state.multiplier[:, 0] - before.multiplier[:, 0]
        if part < 1.0:  # the last pressure is as much older than the step as its stage lies before the end
            change *= part + 1.0 - at if before.index else part / at
        return before.local.displacement[:, 0] + part * increment, before.multiplier[:, 0] + change

    def _rubbed(self, taken: StepResult) -> Array:
        """Heat (m,) that friction makes in a step at each contact point: what the ledger books."""
        slid = taken.state.local.displacement - taken.before.local.displacement
        weights = self.discrete.problem.contact.weights
        return np.asarray(weights * (taken.state.multiplier * slid)[:, 1:].sum(axis=1))

    def _deformed(self, taken: StepResult) -> Array:
        return self.heat.deformed(taken.state.body.displacement - taken.before.body.displacement)

    def _accepted(
        self, before: TimeState, taken: StepResult, flowed: StepResult, step: float, course: _Course, rounds: int,
        ratio: float,
    ) -> StepResult:  # fmt: skip
        assert before.heat is not None
        book = self._booked_heat(before.heat.book, taken, flowed, step)
        state = replace(
            taken.state,
            ledger=self._split(taken, course, before.time + taken.stages[0].rule.at * step),
            heat=ThermalState(flowed.state, book, rounds, ratio if math.isfinite(ratio) else 0.0),
        )
        return replace(taken, state=state, heat=flowed)

    def _split(self, taken: StepResult, course: _Course, time: float) -> EnergyBalance:
        """The ledger of a step, the work of thermal stress at a time apart from that of loads."""
        ledger, pulled = taken.state.ledger, 0.0
        if self.heat.heat.stresses:
            increment = taken.state.body.displacement - taken.before.body.displacement
            pulled = float(self.heat.load(course.at(time)) @ increment)
        thermal = taken.before.ledger.thermal + pulled
        return replace(ledger, work=ledger.work - pulled, thermal=thermal).closed()

    # ---- the balance of heat ---------------------------------------------------------------------------------

    def _content(self, state: TimeState) -> float:
        conduction = self.heat.conduction
        assert conduction.viscosity is not None
        return float(conduction.of_all @ conduction.viscosity.times(state.body.displacement))

    def _booked_heat(self, old: HeatBalance, taken: StepResult, flowed: StepResult, step: float) -> HeatBalance:
        conduction, stage = self.heat.conduction, flowed.stages[0]
        assert conduction.viscosity is not None
        n = conduction.unknowns
        rubbed, deformed = self.heat.rubbed(self._rubbed(taken)), self._deformed(taken)
        given = float(rubbed.sum() + deformed.sum())
        solution = flowed.solutions[0]
        temperature = stage.displacement(solution.unknowns)
        rate = stage.body_rates(temperature - flowed.before.body.displacement)[0]
        force = conduction.viscosity.times(rate) + conduction.stiffness.times(temperature) - stage.load
        out, crossing = self._given_off(solution.multiplier)
        return HeatBalance(
            content=self._content(flowed.state),
            start=old.start,
            source=old.source + step * float(conduction.of_all @ stage.load) - given,
            supports=old.supports + step * (float(force[n:].sum()) - crossing),
            contact=old.contact - step * out,
            friction=old.friction + float(rubbed.sum()),
            deformation=old.deformation + float(deformed.sum()),
        ).closed()

    def _given_off(self, flow: Array) -> tuple[float, float]:
        """Of a flow (m, c) at contact points: what leaves the bodies, and what joints take to prescribed temperatures.

        What crosses a joint leaves one body and enters the other; the second is what their free nodes lose by it.
        """
        conduction = self.heat.conduction
        contact = conduction.problem.contact
        if not contact.count:
            return 0.0, 0.0
        joint = np.isin(contact.boundary, [contact.names.index(name) for name in contact.pairs])[:, None]
        out = float((contact.weights[:, None] * np.where(joint, 0.0, flow)).sum())
        if not conduction.moved.size:
            return out, 0.0
        return out, float(conduction.of_all[: conduction.unknowns] @ contact.force(np.where(joint, flow, 0.0)))

    def extra_columns(self, state: TimeState) -> dict[str, float]:
        warm = state.heat
        assert warm is not None
        temperature = self.heat.temperature(warm.state.body.displacement)
        return {
            "temperature.least": float(temperature.min()),
            "temperature.greatest": float(temperature.max()),
            **warm.book.record(),
            "thermal": state.ledger.thermal,
            "rounds": float(warm.rounds),
            "contraction": warm.contraction,
        }
