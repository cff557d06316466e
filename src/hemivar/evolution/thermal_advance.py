"""A step of a body and of its heat: computed in turns until they agree, each a static problem of its own."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.anderson import Anderson
from hemivar.basics.types import Array
from hemivar.evolution.advance import Advance, Taken
from hemivar.evolution.discrete import Acting, DiscreteEvolution
from hemivar.evolution.discrete_heat import DiscreteHeat
from hemivar.evolution.heat_book import HeatBook, Warmth
from hemivar.evolution.initial import initial_moment
from hemivar.evolution.jumps import Jump
from hemivar.evolution.ledger import Ledger
from hemivar.evolution.moment import Moment
from hemivar.evolution.schemes import ImplicitEuler, Midpoint, Scheme
from hemivar.solvers import Controls, Solver, Status
from hemivar.systems.workspace import Workspace

__all__ = ["ThermalAdvance", "advance_of"]

#: Rounds of motion and heat within a step.
_ROUNDS = 200
#: Part of the change of a round that the next one leaves at most where more than rounding changes.
_FALLS = 0.5
#: What to do where rounds do not meet.
_UNMET = (
    f"motion and heat do not meet in {_ROUNDS} rounds; take shorter steps or a larger rtol of Heat; a conductance that "
    "jumps where contact opens (closed > 0) may leave no solution: let it grow with the pressure or the penetration"
)


def advance_of(
    discrete: DiscreteEvolution,
    scheme: Scheme,
    solver: Solver | None,
    controls: Controls,
    workspace: Workspace | None = None,
) -> Advance:
    """What takes steps of an evolution, with or without heat."""
    kind = Advance if discrete.heat is None else ThermalAdvance
    return kind(discrete, scheme, solver, controls, workspace)


class _HeatAdvance(Advance):
    """Steps of heat, with what the motion gives it: fixed while a step is taken."""

    def __init__(self, heat: DiscreteHeat, scheme: Scheme, controls: Controls) -> None:
        super().__init__(heat.conduction, scheme, None, controls)
        self.coupled = heat
        self._given: tuple[Array, tuple[Array, Array]] | None = None

    def given(self, power: Array, law_at: tuple[Array, Array]) -> None:
        """Nodal power (nodes,), and penetration and pressure (m,) of the contact points of the body."""
        self._given = power, law_at

    def acting(self, time: float) -> Acting:
        base = super().acting(time)
        if self._given is None:
            return base
        power, law_at = self._given
        heat, discrete = self.coupled, self.discrete
        more = np.concatenate([discrete.field.basis.T @ power, power[discrete.moved]])
        return replace(base, load=base.load + more, law=heat.law(base.law, *law_at))


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


class ThermalAdvance(Advance):
    """Steps of a body with heat.

    In a round the body moves under the temperatures that are known, and heat flows by what the motion then gives:
    friction, deformation and contact.  Rounds follow until temperatures stand; all that rounds of the step changed is
    mixed after Anderson, so that a coupling that would not contract by itself does.  Where it does not, the step is not
    solved.
    """

    def __init__(
        self,
        discrete: DiscreteEvolution,
        scheme: Scheme,
        solver: Solver | None,
        controls: Controls,
        workspace: Workspace | None = None,
    ) -> None:
        super().__init__(discrete, scheme, solver, controls, workspace)
        assert discrete.heat is not None
        self.heat = discrete.heat
        flow = ImplicitEuler() if scheme.order == 1 else Midpoint()
        self.flow = _HeatAdvance(self.heat, flow, controls)
        self.beside = self.flow
        self._begun = initial_moment(self.flow)
        first = self.heat.temperature(self._begun.body.place)
        self._course = _Course(discrete.evolution.start, 0.0, first, first)

    def acting(self, time: float) -> Acting:
        base = super().acting(time)
        if not self.heat.heat.stresses:
            return base
        return replace(base, load=base.load + self.heat.load(self._course.at(time)))

    def acting_on(self, moment: Moment) -> Acting:
        assert moment.heat is not None
        now = self.heat.temperature(moment.heat.moment.body.place)
        self._course = _Course(moment.time, 0.0, now, now)
        return self.acting(moment.time)

    def started(self, moment: Moment) -> Moment:
        content = self._content(self._begun)
        return replace(moment, heat=Warmth(self._begun, HeatBook(content, content)))

    def take(self, before: Moment, step: float, end_time: float | None = None, jump: Jump = Jump.LOCAL) -> Taken:
        assert before.heat is not None
        heat, warm = self.heat, before.heat.moment
        reached = before.time + step if end_time is None else end_time
        known = heat.temperature(warm.body.place)
        last, ratio, mixing = 0.0, 0.0, Anderson()
        if heat.heat.fed_back:
            guess = known + step * heat.conduction.full(warm.body.velocity)[:, 0] if before.index else known.copy()
        else:
            guess = heat.temperature(self._flowed(before, None, step, reached).moment.body.place)
        for rounds in range(1, _ROUNDS + 1):
            self._course = _Course(before.time, reached - before.time, known, guess)
            taken = super().take(before, step, end_time, jump)
            if taken.status is not Status.CONVERGED:
                return taken
            flowed = self._flowed(before, taken, step, reached)
            if flowed.status is not Status.CONVERGED:
                return replace(taken, solutions=(*taken.solutions, *flowed.solutions))
            found = heat.temperature(flowed.moment.body.place)
            change = found - guess
            size = float(np.abs(change).max(initial=0.0))
            strain = float(np.abs(found - heat.heat.stress_free).max(initial=0.0))
            ratio = size / last if last else 0.0
            # Whatever degrees are counted from; where rounding of what is counted keeps from it, no further.
            still = size <= heat.heat.rtol * float(np.abs(found).max(initial=0.0)) and ratio >= _FALLS
            if size <= heat.heat.rtol * strain or still or not heat.heat.stresses:
                return self._accepted(before, taken, flowed, step, rounds, ratio)
            last, guess = size, mixing.after(guess, change)
        worst = replace(taken.solutions[-1], status=Status.NOT_CONTRACTING)
        return replace(taken, solutions=(*taken.solutions[:-1], worst), advice=_UNMET)

    def at_once(self, before: Moment, span: float, start: Acting, now: Acting, jump: Jump = Jump.LOCAL) -> Taken:
        taken = super().at_once(before, span, start, now, jump)
        return replace(taken, moment=replace(taken.moment, ledger=self._split(taken, before.time)))

    def _flowed(self, before: Moment, taken: Taken | None, step: float, reached: float) -> Taken:
        """The step of heat, with what a step of the body gives it."""
        assert before.heat is not None
        power = np.zeros(self.heat.conduction.field.basis.shape[0])
        if taken is not None:
            power += (self.heat.rubbed(self._rubbed(taken)) + self._deformed(taken)) / step
        self.flow.given(power, self._met(before, taken, step))
        return self.flow.take(before.heat.moment, step, reached)

    def _met(self, before: Moment, taken: Taken | None, step: float) -> tuple[Array, Array]:
        """Penetration and pressure (m,) at the stage of heat; pressures are known at the stages of the motion."""
        if taken is None:
            return before.local.place[:, 0], before.multiplier[:, 0]
        (flow,) = self.flow.scheme.rules(step)
        part, at = flow.at, taken.stages[0].rule.at
        way = taken.moment.local.place[:, 0] - before.local.place[:, 0]
        change = taken.moment.multiplier[:, 0] - before.multiplier[:, 0]
        if part < 1.0:  # the last pressure is as much older than the step as its stage lies before the end
            change *= part + 1.0 - at if before.index else part / at
        return before.local.place[:, 0] + part * way, before.multiplier[:, 0] + change

    def _rubbed(self, taken: Taken) -> Array:
        """Heat (m,) that friction makes in a step at each contact point: what the ledger books."""
        slid = taken.moment.local.place - taken.before.local.place
        weights = self.discrete.problem.contact.weights
        return np.asarray(weights * (taken.moment.multiplier * slid)[:, 1:].sum(axis=1))

    def _deformed(self, taken: Taken) -> Array:
        return self.heat.deformed(taken.moment.body.place - taken.before.body.place)

    def _accepted(self, before: Moment, taken: Taken, flowed: Taken, step: float, rounds: int, ratio: float) -> Taken:
        assert before.heat is not None
        book = self._booked_heat(before.heat.book, taken, flowed, step)
        moment = replace(
            taken.moment,
            ledger=self._split(taken, before.time + taken.stages[0].rule.at * step),
            heat=Warmth(flowed.moment, book, rounds, ratio if math.isfinite(ratio) else 0.0),
        )
        return replace(taken, moment=moment, heat=flowed)

    def _split(self, taken: Taken, time: float) -> Ledger:
        """The ledger of a step, the work of thermal stress at a time apart from that of loads."""
        ledger, pulled = taken.moment.ledger, 0.0
        if self.heat.heat.stresses:
            way = taken.moment.body.place - taken.before.body.place
            pulled = float(self.heat.load(self._course.at(time)) @ way)
        thermal = taken.before.ledger.thermal + pulled
        return replace(ledger, work=ledger.work - pulled, thermal=thermal).closed()

    # ---- the balance of heat ---------------------------------------------------------------------------------

    def _content(self, moment: Moment) -> float:
        conduction = self.heat.conduction
        assert conduction.viscosity is not None
        return float(conduction.viscosity.times(moment.body.place).sum())

    def _booked_heat(self, old: HeatBook, taken: Taken, flowed: Taken, step: float) -> HeatBook:
        conduction, stage = self.heat.conduction, flowed.stages[0]
        assert conduction.viscosity is not None
        n = conduction.unknowns
        rubbed, deformed = self.heat.rubbed(self._rubbed(taken)), self._deformed(taken)
        given = float(rubbed.sum() + deformed.sum())
        solution = flowed.solutions[0]
        place = stage.displacement(solution.unknowns)
        rate = stage.motion(place, flowed.before.body).velocity
        force = conduction.viscosity.times(rate) + conduction.stiffness.times(place) - stage.load
        contact = conduction.problem.contact
        out = float((contact.weights[:, None] * solution.multiplier).sum()) if contact.count else 0.0
        return HeatBook(
            content=self._content(flowed.moment),
            start=old.start,
            source=old.source + step * float(stage.load.sum()) - given,
            supports=old.supports + step * float(force[n:].sum()),
            contact=old.contact - step * out,
            friction=old.friction + float(rubbed.sum()),
            deformation=old.deformation + float(deformed.sum()),
        ).closed()

    def told(self, moment: Moment) -> dict[str, float]:
        warm = moment.heat
        assert warm is not None
        temperature = self.heat.temperature(warm.moment.body.place)
        return {
            "temperature.least": float(temperature.min()),
            "temperature.greatest": float(temperature.max()),
            **warm.book.record(),
            "thermal": moment.ledger.thermal,
            "rounds": float(warm.rounds),
            "contraction": warm.contraction,
        }
