"""A march that is going on: the next step, what happens in it, and what is told of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.deadline import OutOfTime, check_time
from hemivar.basics.disk import try_output
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution.control import Control, ControlledStepper
from hemivar.evolution.data_in_time import kinks_in_time
from hemivar.evolution.descent import regularising_viscosity
from hemivar.evolution.digest import identity
from hemivar.evolution.discrete import DiscreteEvolution, ExternalData
from hemivar.evolution.evolution_problem import Mass
from hemivar.evolution.history import Frame, History, Row
from hemivar.evolution.initial import apply_impulse, initial_state
from hemivar.evolution.initial_equilibrium import (
    gap_jump,
    has_instantaneous_part,
    instantaneous_equilibrium,
    longest_without_swing,
    with_own_balance,
    with_ramped_work,
)
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.march_events import OnEvent
from hemivar.evolution.march_state import Checkpoint, MarchState, misfit
from hemivar.evolution.margin import Margins, crosses_energy_barrier, step_error
from hemivar.evolution.plan import March
from hemivar.evolution.save import Frames, contact_forces, healing, large_deformation, probed
from hemivar.evolution.schemes import Scheme
from hemivar.evolution.state import TimeState
from hemivar.evolution.step_end import energies
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.evolution.steps import StepSizeState
from hemivar.evolution.thermal_stepper import stepper_of
from hemivar.evolution.time_error import TimeBound, bound_in_time
from hemivar.mechanics.foundation import Contact
from hemivar.solvers import Controls, Solver, Status
from hemivar.solvers.solve import method_for
from hemivar.systems.workspace import Workspace

__all__ = ["Backend", "StepEvent", "TimeLoop"]

#: How near an event is found, as a part of the step in which it happens, and evaluations for it at most.
_NEAR = 1e-6
_TRIALS = 60
#: The shortest first step, as a part of the latest time: more than rounding.
_RESOLVED = 1e-12
#: Part of the length of others below which a step that fails is too short.
_SHORT = 1e-4
#: Length of a step above which, and the inverse of that below which, numbers of schemes over- or underflow.
_LONGEST = 1e100
#: What a message begins with where glue is elastic.
_HEALS = "the glue heals"
#: What a message begins with where steps are less exact than was asked for.
_MISSED = "the tolerance of steps was missed"
#: And where viscosity that was put in slows the body down, by more than a few steps and this part of the whole time.
_LAGS = "the body lags behind"
#: And where a rigid obstacle jumps into the body.
_SINKS = "an obstacle jumps into the body"
_FEW, _LATE = 5.0, 0.01
#: How a march ends in which the scheme made more than this part of the energy that was given.
_MADE, _MOST_MADE = "energy made", 0.5
#: Columns of the sums of errors of steps: in the energy norm, and at the contact points.
_SUMMED = ("error_sum", "contact_error_sum")
#: Ends of a solve that are none of the step.
_BROKEN = "broken"
_OUTSIDE = (Status.INTERRUPTED, Status.MAX_TIME, Status.OUT_OF_MEMORY)
#: How near to a stop what acts is looked at for jumps, as a part of the time before it or of the first step.
_BESIDE = 1e-9
#: Part of displacements by which a stated initial one may differ from the equilibrium that is found.
_MOVED = 1e-6


@dataclass(frozen=True, eq=False)
class StepEvent:
    """A step of a march that was taken, for whoever watches.

    Attributes
    ----------
    row : Row
    frame : Frame or None
        If one was saved.
    state : TimeState
    done : float
        Part of the whole time that is behind.
    happened : tuple of str
        Events at its end.
    earlier : tuple of (int, Frame)
        With the first step only: what was saved before it, the initial state at least, with the numbers of its steps.
    unkept : str
        Why the last checkpoint that was due could not be written; empty if it was.
    """

    row: Row
    frame: Frame | None
    state: TimeState
    done: float
    happened: tuple[str, ...] = ()
    earlier: tuple[tuple[int, Frame], ...] = ()
    unkept: str = ""


@dataclass(frozen=True)
class Backend:
    """What a march works with: the parts that an engine on many processes has of its own."""

    #: Makes what takes steps of a discrete evolution, scheme, solver, controls, workspace, and the times at which what
    #: acts may jump.
    advance: Callable[
        [DiscreteEvolution, Scheme, Solver | None, Controls, Workspace | None, Mapping[float, float]], TimeStepper
    ] = stepper_of
    #: What tells margins, bounds of the error in time, and one evolution from another.
    margins: Callable[[TimeStepper], Margins] = Margins
    bound: Callable[[TimeStepper], TimeBound] = bound_in_time
    identity: Callable[..., str] = identity
    #: What measures displacements at points.
    probes: Callable[[DiscreteEvolution, Mapping[str, object]], Callable[[Array], dict[str, Array]]] = probed


@dataclass(frozen=True, eq=False)
class _Tried:
    """A step that was solved."""

    taken: StepResult
    #: At which it was taken.
    step_size: StepSizeState
    #: Relative, in the energy norm and at the contact points.
    errors: tuple[float, float]
    #: What comes next, if it stands; what to try in its place, if not.
    following: StepSizeState
    #: The shortest step that was tried in its place, and could not be solved; 0 if none was.
    unsolved: float = 0.0


class TimeLoop:
    """A march that is going on."""

    def __init__(self, discrete: DiscreteEvolution, plan: March, workspace: Workspace | None, tools: Backend) -> None:
        self.discrete, self.plan = discrete, plan
        self.start = discrete.evolution.start
        span = plan.until - self.start
        self.stepping = plan.stepping(span)
        self.step_size = self.stepping.first(span)
        least, step = _RESOLVED * max(abs(self.start), abs(plan.until)), self.step_size.step
        if step < least:
            raise ProblemError(
                f"the step is {step:g}, too short for times up to {plan.until:g} to be distinguished; take at least "
                f"{least:g}"
            )
        if not 1.0 / _LONGEST < step < _LONGEST:
            raise ProblemError(
                f"the step is {step:g}, whose square is beyond the range of numbers; state times in another unit"
            )
        self.probes = tools.probes(discrete, plan.save.probes)
        stops = {self.start: _BESIDE * step} | {
            stop: _BESIDE * (stop - self.start) for stop in plan.stops if stop > self.start
        }
        self.stops = frozenset(stops)
        method, controlled = method_for(plan.method, discrete.problem), isinstance(plan.control, Control)
        sides = {} if controlled else stops
        self.stepper = tools.advance(discrete, plan.scheme, method, plan.controls, workspace, sides)
        if isinstance(plan.control, Control):
            self.stepper = ControlledStepper.over(self.stepper, plan.control, plan.until)
        self.margins = tools.margins(self.stepper)
        self.bound = tools.bound(self.stepper)
        stated = discrete.evolution.problem, discrete.evolution.heat
        kinks, self.doubts = kinks_in_time(stated, self.start, plan.until)
        self.doubts += _rings(discrete, plan.scheme)
        if discrete.problem.idle is not None:
            self.doubts += (f"at t = {self.start:g} {discrete.problem.idle}",)
        self.ends = _ends(plan, self.start, () if controlled else kinks)
        self.instantaneous = has_instantaneous_part(discrete)
        self.no_equilibrium: StepResult | None = None
        self.identity = ""
        if plan.checkpoint is not None:
            if discrete.vectors.alone and isinstance(plan.checkpoint, Checkpoint):
                try_output(plan.checkpoint.file)  # before anything is computed in vain
            given = self.stepping, plan.stops, plan.save, plan.events, plan.jump, plan.control
            self.identity = tools.identity(self.stepper, *given)
        self.state: TimeState
        self.errors = (0.0, 0.0)  # of the last step, relative
        self.levels: dict[int, float] = {}
        self.reported = False
        self.beyond: tuple[str, ...] = ()

    def begin(self) -> None:
        """The initial state, or that of the checkpoint."""
        kept = self.plan.checkpoint
        march = None
        if self.plan.resume and isinstance(kept, Checkpoint):
            march = kept.read(self.identity)
            if march is not None:
                self._refuse_misfit(kept, march)
        if march is None:
            self.messages: list[str] = list(self.doubts)
            self.state = self._initial_equilibrium(initial_state(self.stepper, self.step_size.step))
            self.frames = Frames(self.plan.save, self.start)
            self.frames.offer(self.discrete, self.state)
            self.rows = [self._row(None)]
            self.events: list[tuple[float, str]] = []
            self.largest = self.farthest = 0.0
            self.origin = self.state.body.displacement
        else:
            self.state, self.step_size = march.state, march.pace
            self.largest, self.farthest, self.origin = march.largest, march.farthest, march.origin
            self.frames = Frames(self.plan.save, self.start, march.frames, march.frame_counters)
            self.rows, self.events, self.messages = list(march.rows), list(march.events), list(march.messages)
            self.bound.square, self.bound.straight = march.bound, march.straight
            if self.state.time > self.plan.until:
                self.beyond = (
                    f"the checkpoint is at t = {self.state.time:.10g}, beyond the end at {self.plan.until:.10g}: "
                    f"its content is returned; to end at the requested time, start without resume",
                )
        self.levels = self._levels(self.state, self.rows[-1].margin)

    def _refuse_misfit(self, kept: Checkpoint, march: MarchState) -> None:
        """Refuse what was read where it is no state of this evolution, on all processes."""
        self.state = initial_state(self.stepper, self.step_size.step)
        why = misfit(march, self.stepper, self.stepping, tuple(self._row(None).values))
        (wrong,) = self.discrete.vectors.largest(float(bool(why)))
        if wrong:
            raise kept.unfit(why or "the part of another process makes no sense")

    def attempt(self) -> tuple[StepResult | None, tuple[str, ...], bool]:
        """The next step that stands, the events at its end and whether one of them ends the march.

        Without a step, the reason in the place of the events.
        """
        goal = next(end for end in self.ends if end > self.state.time)
        begin = self._beginning(goal)
        if self.no_equilibrium is not None:
            why = self.no_equilibrium.status
            return None, (_BROKEN if why is Status.NOT_CARRIED else why.value,), True
        if isinstance(self.stepper, ControlledStepper) and self.stepper.broken(begin):
            self.note(f"broken at t = {begin.time:.10g}: the joint carries less than a hundredth of its largest load")
            return None, (_BROKEN,), True
        tried = self._tried(begin, goal)
        if isinstance(tried, Status):
            return None, (_BROKEN if tried is Status.NOT_CARRIED else tried.value,), True
        self.step_size, self.errors = tried.step_size, tried.errors
        if (
            self.plan.jump is SelectionRule.STOP
            and not self.stepper.stages.resists
            and self.margins.margin(tried.taken) <= 0.0
        ):
            where = f"at t = {tried.taken.state.time:g} a step may have several solutions"
            self.note(f"{where}; the run stops before it, as requested")
            return None, ("margin lost",), True
        self._tell_of_misses(tried)
        taken, happened, stop = self._located(tried.taken)
        if taken.step >= self.step_size.step * (1.0 - 1e-6):
            self.step_size = tried.following
        return taken, happened, stop

    def _beginning(self, goal: float) -> TimeState:
        """The state that the next step begins with: another than the last where what acts may have a kink or jump."""
        begin = self.state
        if begin.time not in self.ends and begin.index:
            return begin
        length, _ = self._fitted(begin.time, goal)
        begin = apply_impulse(self.stepper, self._equilibrium_after_jump(begin, length), length)
        return replace(begin, history=None) if self.plan.scheme.multistep else begin

    def _fitted(self, time: float, goal: float) -> tuple[float, float]:
        return _fitted(self.step_size.step, time, goal, self.discrete.evolution.start)

    def _tried(self, begin: TimeState, goal: float) -> _Tried | Status:
        """The first of ever shorter steps that can be solved and is exact enough; else why there is none."""
        rejected: _Tried | None = None  # solved, but not as exact as was asked for
        while True:
            length, reached = self._fitted(self.state.time, goal)
            taken = self.stepper.take(begin, length, reached, SelectionRule(self.plan.jump))
            if taken.status is Status.CONVERGED:
                stands, tried = self._judged(taken)
                if stands:
                    return tried
                rejected, self.step_size = tried, tried.following
                continue
            if taken.status is Status.MAX_TIME:
                check_time()  # of the march; else it is the time that one solve may take
            smaller = self._shorter(taken.status, length)
            if smaller is not None:
                self.step_size = smaller
            elif rejected is None or taken.status in _OUTSIDE:
                self._tell_of_failure(taken, length, reached)
                return taken.status
            else:  # none of those tried that are shorter can be solved
                return replace(rejected, following=rejected.step_size, unsolved=length)

    def _judged(self, taken: StepResult) -> tuple[bool, _Tried]:
        """Whether a step that is solved stands."""
        errors = self.errors
        if self.stepping.estimates:
            estimate = step_error(self.stepper, taken, self.origin, self._after_kink)
            self.largest, self.farthest = max(self.largest, estimate.size), max(self.farthest, estimate.displacement)
            errors = estimate.relative(self.largest, self.farthest)
        error = max(errors) if self.stepping.estimates else None
        stands, following = self.stepping.after(self.step_size, error, self.plan.scheme.order)
        return stands, _Tried(taken, self.step_size, errors, following)

    def _shorter(self, status: Status, length: float) -> StepSizeState | None:
        """What to try in place of a step that could not be solved."""
        if status in _OUTSIDE or status is Status.NOT_CARRIED:  # by what acts at its end, however short it is
            return None
        smaller = self.stepping.smaller(self.step_size)
        while smaller is not None and smaller.step >= length:  # as long a step was tried
            smaller = self.stepping.smaller(smaller)
        return smaller

    def _tell_of_failure(self, taken: StepResult, length: float, reached: float) -> None:
        """Say which step could not be solved, and why."""
        if taken.status is Status.INTERRUPTED:  # which is none of the evolution: it may be resumed
            return
        remedy, usual = taken.remedy, self.step_size.step
        if length < _SHORT * usual:
            remedy = (
                f"a step of {length:.3g} among others of {usual:.3g} is too short for the displacements to "
                f"determine the forces; move the stop or the kink of a load that causes it"
            )
        last = f"t = {self.state.time:.10g}"
        if taken.status is Status.NOT_CARRIED:
            self.note(
                f"broken at t = {reached:.10g}: no equilibrium is found from the one at {last} on. The load may exceed "
                "what the foundation can carry; for a closer time take shorter steps"
            )
            return
        self.note(f"the step from {last} to {reached:.10g} could not be solved: {remedy}")

    def _tell_of_misses(self, tried: _Tried) -> None:
        """Say that a step is not as exact as was asked for."""
        error = max(tried.errors) if self.stepping.estimates else None
        if not self.stepping.missed(error) or self._has_message(_MISSED):
            return
        why, remedy = "which cannot be shorter", "allow shorter steps or take"
        if tried.unsolved:
            why, remedy = f"and those tried that are shorter, down to {tried.unsolved:.3g}, cannot be solved", "take"
        self.note(
            f"{_MISSED} first in the step to t = {tried.taken.state.time:g}, {why}: its error is about {error:.2g} "
            f"of the whole; {remedy} a larger rtol. Where a load or a support jumps, name its time as a stop, and take "
            "implicit-euler"
        )

    def _initial_equilibrium(self, state: TimeState) -> TimeState:
        """The initial state: a body without mass is in equilibrium with what acts, and the balance begins so."""
        if not self.instantaneous:
            return state
        now = self.stepper.data_from(state).at(state.time)
        try:
            taken = self._equilibrium(state, self.step_size.step, now, now)
        except OutOfTime:  # the march ends at its first step
            return state
        if taken is None:
            return state
        stated, displacement = state.body.displacement, taken.state.body.displacement
        off, far = self.discrete.vectors.largest(
            float(np.abs(displacement - stated).max(initial=0.0)), float(np.abs(displacement).max(initial=0.0))
        ).tolist()
        if self.discrete.evolution.displacement is not None and off > _MOVED * far:
            self.note(
                "the initial displacement is not in equilibrium where the body has no mass; the run starts from "
                "the nearest equilibrium,"
                f" {off:.3g} away: leave it out, or give mass or viscosity"
            )
        return with_own_balance(taken.state)

    def _equilibrium_after_jump(self, state: TimeState, step: float) -> TimeState:
        """A state at which a load jumps, with a body without mass in the equilibrium that follows."""
        data = self.stepper.data_from(state)
        if not (self.instantaneous and data.jumps_at(state.time)):
            return state
        taken = self._equilibrium(state, step, data.before(state.time), data.after(state.time))
        return state if taken is None else taken.state

    def _equilibrium(self, state: TimeState, step: float, start: ExternalData, now: ExternalData) -> StepResult | None:
        """The equilibrium with what acts now; None, and no further step, if it is not found."""
        taken = instantaneous_equilibrium(self.stepper, state, step, SelectionRule(self.plan.jump), start, now)
        if taken.status is not Status.CONVERGED:
            self.no_equilibrium = taken
            if taken.status is not Status.INTERRUPTED:
                self.note(
                    f"the equilibrium at t = {state.time:.10g}, in which a body without mass starts or continues, "
                    f"could not be computed: {taken.remedy}"
                )
            return None
        taken, jumped = self._jumped(taken)
        if jumped:
            self._tell_of_jump(taken, self.margins.margin(taken))
        if taken.jumps or taken.state.ledger.jumps == state.ledger.jumps:
            taken = with_ramped_work(self.discrete, taken, start, now)
        return taken

    @property
    def _after_kink(self) -> bool:
        """Whether the next step is the first or the second after a stop or a kink."""
        return any(row.time in self.ends for row in self.rows[-2:])

    def accept(self, taken: StepResult, happened: tuple[str, ...]) -> StepEvent:
        """Book a step."""
        margin = self.margins.margin(taken)
        taken, jumped = self._jumped(taken)
        if jumped:
            self._tell_of_jump(taken, margin)
        if self.plan.jump is SelectionRule.VISCOUS and not self.stepper.stages.resists:
            self._tell_of_lag(taken)
        if not taken.before.index or taken.before.time in self.stops:
            longest = longest_without_swing(self.stepper, taken)
            if longest < taken.step:
                self.note(
                    f"from t = {taken.before.time:g} on displacements oscillate about the equilibrium, and so does "
                    f"the damage, because the viscosity relaxes within a step; take steps below {longest:.3g}, or "
                    f"implicit-euler"
                )
        jump, depth = gap_jump(self.stepper, taken)
        if jump and not self._has_message(_SINKS):
            self.note(
                f"{_SINKS} by {jump:.3g} in the step to t = {taken.state.time:g} and penetrates up to {depth:.3g}, "
                f"because {self.plan.scheme.name} acts on velocities; move the gap over some steps, or take "
                "implicit-euler"
            )
        healed = healing(self.discrete, taken.before, taken.state)
        if healed and not self._has_message(_HEALS):
            self.note(
                f"{_HEALS} on contact '{healed}' from t = {taken.before.time:g} on: beyond its strength it closes "
                f"along its opening curve; leave memory = () out"
            )
        self.bound.add(taken)
        self.state = taken.state
        self.rows.append(self._row(taken, margin, jumped))
        self.events += [(self.state.time, name) for name in happened]
        self.levels = self._levels(self.state, margin)
        last = self.state.time >= self.plan.until
        earlier = () if self.reported else self._earlier()
        self.reported = True
        frame = self.frames.offer(self.discrete, self.state, last=last or bool(happened))
        done = (self.state.time - self.start) / (self.plan.until - self.start)
        return StepEvent(self.rows[-1], frame, self.state, done, happened, earlier)

    def _tell_of_jump(self, taken: StepResult, margin: float) -> None:
        """Say that the body jumped from one equilibrium to another."""
        if self._has_message("the body jumped"):
            return
        when = taken.state.time if not taken.jumps else taken.before.time + taken.jumps[0].part * taken.step
        self.note(
            f"the body jumped at t = {when:.8g}: a step may have several solutions there (margin {margin:.3g}), "
            f"and no viscosity selects one; jump = '{self.plan.jump}' did"
        )
        if taken.stages[-1].rule.reach != 1.0:
            self.messages.append(
                f"the scheme {self.plan.scheme.name} ends a step as far beyond the equilibrium that it finds as it "
                "was before it: displacements oscillate after a jump; use implicit-euler or sdirk2"
            )

    def _tell_of_lag(self, taken: StepResult) -> None:
        """Say that a body lags behind what acts on it, for it is resisted as many steps long as the resistance says."""
        convexity_defect = max(self.stepper.stages.convexity_defect(stage) for stage in taken.stages)
        if convexity_defect < 0.0 or self._has_message(_LAGS):
            return
        steps = regularising_viscosity(convexity_defect)
        lag = steps * taken.step
        if steps > _FEW and lag > _LATE * (self.plan.until - self.start):
            self.note(
                f"{_LAGS} what acts on it by up to {lag:.3g}, {steps:.3g} steps, from t = {taken.before.time:g} on. "
                f"The artificial viscosity makes the step unique; its dissipation is reported under 'jumps'; "
                f"take shorter steps, or jump = 'arc-length'"
            )

    def _jumped(self, taken: StepResult) -> tuple[StepResult, bool]:
        """Whether the body jumped; with what it lost, beside what a law that changed took from what was stored."""
        known = taken.jumps or taken.state.control is not None or SelectionRule(self.plan.jump).follows
        if known or not crosses_energy_barrier(self.stepper, taken):
            return taken, bool(taken.jumps)
        before, ledger = taken.before, taken.state.ledger
        weakened = before.ledger.contact - energies(self.discrete, before, taken.stages[-1].law)["contact"]
        lost = max(ledger.numerical - before.ledger.numerical - weakened, 0.0)
        ledger = replace(ledger, numerical=ledger.numerical - lost, jumps=ledger.jumps + lost)
        return replace(taken, state=replace(taken.state, ledger=ledger)), True

    def _earlier(self) -> tuple[tuple[int, Frame], ...]:
        numbers = {row.time: number for number, row in enumerate(self.rows)}
        return tuple((numbers[frame.time], frame) for frame in self.frames.kept)

    def march_state(self) -> MarchState:
        """What a checkpoint keeps."""
        return MarchState(
            self.state,
            self.step_size,
            tuple(self.rows),
            tuple(self.frames.kept),
            self.frames.counters,
            tuple(self.events),
            tuple(self.messages),
            self.largest,
            self.farthest,
            self.origin,
            self.bound.square,
            self.bound.straight,
        )

    def note(self, message: str) -> None:
        """Say something in the end, once: a march that goes on may meet the same again."""
        if message not in self.messages:
            self.messages.append(message)

    def _has_message(self, beginning: str) -> bool:
        """Whether something that begins so is said already."""
        return any(message.startswith(beginning) for message in self.messages)

    def history(self, ended: str, unkept: str) -> History:
        """What there is."""
        if self.frames.kept[-1].time != self.state.time:
            self.frames.offer(self.discrete, self.state, last=True)
        made = self._energy_made()
        ended = _MADE if made and ended == "finished" and not self._steps_are_equilibria else ended
        strained = large_deformation(self.discrete, self.frames.kept)
        summed = tuple(self.rows[-1].values[name] for name in _SUMMED) if self.stepping.estimates else (0.0, 0.0)
        added = (_added(summed),) if self.stepping.adds_up(max(summed)) else ()
        return History(
            self.discrete,
            tuple(self.rows),
            tuple(self.frames.kept),
            self.state,
            ended,
            tuple(self.events),
            (*strained, *self.messages, *made, *added, *self.beyond),
            self.bound.now,
            unkept,
        )

    @property
    def _steps_are_equilibria(self) -> bool:
        """Whether each step ends in an equilibrium whatever its balance says: no velocity carries energy on."""
        return self.discrete.mass is None and self.plan.scheme.ends_at_equilibrium

    def _energy_made(self) -> tuple[str, ...]:
        """That the scheme made more than a part of the energy that was given, if so."""
        rows, start = [row.values for row in self.rows], self.state.ledger.start
        made = -min(row["numerical"] + row["jumps"] for row in rows)
        given = abs(start) + max(abs(row["work"]) + abs(row["moved"]) + abs(row.get("thermal", 0.0)) for row in rows)
        if made <= _MOST_MADE * given:
            return ()
        if self._steps_are_equilibria:
            return (
                f"the balance of energy misses {made:.3g}, where loads, supports and the initial state gave "
                f"{given:.3g}: a step that crosses the softening of a law knows its work at its end alone. The states "
                "are equilibria; take shorter steps for the work",
            )
        others = "sdirk2" if self.discrete.mass is None else "on a rigid obstacle moreau-jean or mass = 'redistributed'"
        return (
            f"the scheme {self.plan.scheme.name} made energy, {made:.3g} where loads, supports and the initial state "
            f"gave {given:.3g}: the motion is not physical. Take shorter steps or implicit-euler, or {others}",
        )

    # ---- events ----------------------------------------------------------------------------------------------

    def _levels(self, state: TimeState, margin: float) -> dict[int, float]:
        return {k: event.level(self.discrete, state, margin) for k, event in enumerate(self.plan.events)}

    def _located(self, taken: StepResult) -> tuple[StepResult, tuple[str, ...], bool]:
        """The step, ended where the first event happens."""
        if not self.plan.events:
            return taken, (), False

        def risen(trial: StepResult) -> list[int]:
            levels = self._levels(trial.state, self.margins.margin(trial))
            return [k for k, level in levels.items() if level > 0.0 and not self.levels[k] > 0.0]

        if not risen(taken):
            return taken, (), False
        low, high = 0.0, taken
        for _ in range(_TRIALS):
            if high.step - low <= _NEAR * taken.step:
                break
            middle = self.stepper.take(taken.before, 0.5 * (low + high.step), jump=SelectionRule(self.plan.jump))
            if middle.status is not Status.CONVERGED:
                break
            if risen(middle):
                high = middle
            else:
                low = middle.step
        happened = [self.plan.events[k] for k in risen(high)]
        names = tuple(getattr(event, "label", event.name) for event in happened)
        return high, names, any(event.then is OnEvent.STOP for event in happened)

    # ---- the table -------------------------------------------------------------------------------------------

    def _row(self, taken: StepResult | None, margin: float = math.nan, jumped: bool = False) -> Row:
        state = self.state
        values: dict[str, float] = contact_forces(self.discrete, state)
        for name, moved in self.probes(state.body.displacement).items():
            ends = ("u",) if moved.size == 1 else ("u_x", "u_y", "u_z")
            for end, value in zip(ends, moved, strict=False):
                values[f"{name}.{end}"] = float(value)
        values.update(state.ledger.record())
        values.update(self.stepper.extra_columns(state))
        if self.stepping.estimates:
            for name, error in zip(_SUMMED, (0.0, 0.0) if taken is None else self.errors, strict=True):
                values[name] = error if taken is None else self.rows[-1].values[name] + error
        values["time_error"] = math.sqrt(self.bound.square) if self.bound.norm else math.nan
        contacts = self.discrete.contacts.values()
        if any(isinstance(one, Contact) and one.friction.state_dependent for one in contacts):
            values["fallbacks"] = 0.0 if taken is None else float(sum(one.fallbacks for one in taken.solutions))
        if taken is None:
            return Row(state.time, 0.0, 0, 0.0, math.nan, math.nan, values)
        steps = sum(solution.steps for solution in taken.solutions)
        largest = self.margins.largest_step(taken)
        return Row(state.time, taken.step, steps, taken.residual, margin, largest, values, jumped)


def _added(summed: tuple[float, ...]) -> str:
    """That the tolerance of adaptive steps does not bound the error at the end, and what it may be."""
    energy, contact = (f"{100.0 * part:.2g} %" for part in summed)
    return (
        f"rtol bounds the error of one step; those of all steps add up to about {energy} in the energy norm and "
        f"{contact} of the displacements of contact points: halve rtol and compare, if this is too much"
    )


def _rings(discrete: DiscreteEvolution, scheme: Scheme) -> tuple[str, ...]:
    """That a scheme which is made for springs has a body hit something rigid, or nodes without mass swing, if so."""
    if not scheme.rings_on_rigid_obstacles:
        return ()
    ends, points = discrete.problem.law.penetrations, discrete.problem.contact_points > 0
    if discrete.mass is not None and discrete.evolution.mass is Mass.REDISTRIBUTED:
        (rule,) = scheme.rules(1.0)
        swing = (
            "contact nodes without mass are in equilibrium within a step; at its end they oscillate about it, also "
            "into an obstacle, in each step"
            f" {rule.reach - 1.0:.3g} times as far; take newmark or "
            "implicit-euler"
        )
        return (swing,) if points and rule.reach > 1.0 else ()
    rigid = points and bool((np.isfinite(ends.upper) & (ends.lower < ends.upper)).any())
    if not discrete.vectors.largest(float(rigid))[0]:
        return ()
    if discrete.mass is None:
        return (
            f"an obstacle is rigid: once the body touches it velocities of the scheme {scheme.name} oscillate, and "
            f"so does the dissipation; use sdirk2 or implicit-euler, or a compliant foundation",
        )
    return (
        f"an obstacle is rigid: where the body hits it the scheme {scheme.name} oscillates and may gain energy; "
        f"use moreau-jean or implicit-euler, mass = 'redistributed', or a compliant foundation",
    )


def _ends(plan: March, start: float, kinks: tuple[float, ...]) -> list[float]:
    """Where steps end exactly: stops as they were named, kinks that lie apart from them, and the end."""
    named = sorted({float(stop) for stop in plan.stops if start < stop < plan.until} | {float(plan.until)})
    near = 1e-9 * (plan.until - start)
    return sorted({*named, *(kink for kink in kinks if all(abs(kink - stop) > near for stop in named))})


def _fitted(step: float, time: float, goal: float, start: float) -> tuple[float, float]:
    """A step that meets a stop: its length and where it ends.

    Steps from the start on end at multiples of their length, not at a sum that gathers rounding: a run that was
    interrupted goes on at the same times.
    """
    rest = goal - time
    if rest <= step * (1.0 + 1e-6):
        return (rest if abs(rest - step) > 1e-9 * step else step), goal
    number = round((time + step - start) / step)
    even = start + number * step
    return step, even if abs(even - time - step) <= 1e-9 * step else time + step
