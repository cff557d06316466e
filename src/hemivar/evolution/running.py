"""A march that is going on: step acceptance, events, the table, and messages."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from hemivar.basics.arrays import LARGEST, ROUNDED, SAME
from hemivar.basics.deadline import check_time
from hemivar.basics.disk import try_output
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import findings
from hemivar.evolution.control import Control, ControlledStepper
from hemivar.evolution.data_in_time import kinks_in_time
from hemivar.evolution.digest import identity
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.findings import Finding
from hemivar.evolution.history import Frame, History, Row
from hemivar.evolution.initial import apply_impulse, initial_state
from hemivar.evolution.initial_equilibrium import has_instantaneous_part, settled
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.march_events import OnEvent
from hemivar.evolution.march_state import Checkpoint, MarchState, misfit
from hemivar.evolution.margin import Margins, step_error, with_jump_loss
from hemivar.evolution.plan import March
from hemivar.evolution.save import Frames, contact_forces, large_deformation, probed
from hemivar.evolution.schemes import Scheme
from hemivar.evolution.state import TimeState
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.evolution.steps import StepSizeState, fitted_step, step_ends
from hemivar.evolution.thermal_stepper import stepper_of
from hemivar.evolution.time_error import TimeBound, bound_in_time
from hemivar.mechanics.foundation import Contact
from hemivar.solvers import Controls, Solver, Status
from hemivar.solvers.solve import method_for
from hemivar.systems.workspace import Workspace

__all__ = ["Backend", "StepEvent", "TimeLoop"]

#: How near an event is found, as a part of the step in which it happens: 20 bisections.
_NEAR = 1e-6
#: How a march ends in which the scheme made more than half of the energy that was given.
_MADE = "energy made"
#: Columns of the sums of errors of steps: in the energy norm, and at the contact points.
_SUMMED = ("error_sum", "contact_error_sum")
#: Ends of a solve that are none of the step.
_BROKEN = "broken"
_OUTSIDE = (Status.INTERRUPTED, Status.MAX_TIME, Status.OUT_OF_MEMORY)


@dataclass(frozen=True, eq=False)
class StepEvent:
    """A step of a march that was taken, for whoever watches."""

    row: Row
    #: If one was saved.
    frame: Frame | None
    state: TimeState
    #: Part of the whole time that is behind.
    done: float
    #: Events at its end.
    happened: tuple[str, ...] = ()
    #: With the first step only: what was saved before it, the initial state at least, with the numbers of its steps.
    earlier: tuple[tuple[int, Frame], ...] = ()
    #: Why the last checkpoint that was due could not be written; empty if it was.
    unkept: str = ""


@dataclass(frozen=True)
class Backend:
    """What a march works with: the parts that an engine on many processes has of its own."""

    #: Makes what takes steps of a discrete evolution, scheme, solver, controls, workspace, and the times at which what
    #: acts may jump.
    stepper: Callable[
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
        least, step = ROUNDED * max(abs(self.start), abs(plan.until)), self.step_size.step
        if step < least:
            raise ProblemError(
                f"the step is {step:g}, too short for times up to {plan.until:g} to be distinguished; take at least "
                f"{least:g}"
            )
        if not 1.0 / LARGEST < step < LARGEST:
            raise ProblemError(
                f"the step is {step:g}, whose square is beyond the range of numbers; state times in another unit"
            )
        self.probes = tools.probes(discrete, plan.save.probes)
        stops = {self.start: SAME * step} | {
            stop: SAME * (stop - self.start) for stop in plan.stops if stop > self.start
        }
        self.stops = frozenset(stops)
        method, controlled = method_for(plan.method, discrete.problem), isinstance(plan.control, Control)
        sides = {} if controlled else stops
        self.stepper = tools.stepper(discrete, plan.scheme, method, plan.controls, workspace, sides)
        if isinstance(plan.control, Control):
            self.stepper = ControlledStepper.over(self.stepper, plan.control, plan.until)
        self.margins = tools.margins(self.stepper)
        self.bound = tools.bound(self.stepper)
        stated = discrete.evolution.problem, discrete.evolution.heat
        kinks, self.doubts = kinks_in_time(stated, self.start, plan.until)
        self.doubts += findings.doubts_of_scheme(discrete, plan.scheme)
        if discrete.problem.idle is not None:
            self.doubts += (f"at t = {self.start:g} {discrete.problem.idle}",)
        self.ends = step_ends(plan.stops, plan.until, self.start, () if controlled else kinks)
        self.instantaneous = has_instantaneous_part(discrete)
        self.no_equilibrium: StepResult | None = None
        self.first: StepResult | None = None  # of load steps
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
            self.state = self._settled(
                initial_state(self.stepper, self.step_size.step), self.step_size.step, initial=True
            )
            self.frames = Frames(self.plan.save, self.start)
            self.frames.offer(self.discrete, self.state)
            self.rows = [self._first_row()]
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
        error = max(tried.errors) if self.stepping.estimates else None
        if self.stepping.missed(error):
            self.note(findings.tolerance_missed(tried.taken.state.time, max(tried.errors), tried.unsolved))
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
        begin = apply_impulse(self.stepper, self._settled(begin, length), length)
        return replace(begin, history=None) if self.plan.scheme.multistep else begin

    def _fitted(self, time: float, goal: float) -> tuple[float, float]:
        return fitted_step(self.step_size.step, time, goal, self.discrete.evolution.start)

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
                self.note(*findings.unsolved(taken, self.state.time, length, reached, self.step_size.step))
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

    def _settled(self, state: TimeState, step: float, initial: bool = False) -> TimeState:
        """The state with a body without mass in the equilibrium that it begins in, or that follows a jump of a load."""
        if not self.instantaneous:
            return state
        state, taken, said = settled(self.stepper, self.plan, self.margins, state, step, initial)
        if taken is not None and taken.status is not Status.CONVERGED:
            self.no_equilibrium = taken
        elif initial and self.discrete.evolution.steps:
            self.first = taken
        self.note(*said)
        return state

    @property
    def _after_kink(self) -> bool:
        """Whether the next step is the first or the second after a stop or a kink."""
        return any(row.time in self.ends for row in self.rows[-2:])

    def accept(self, taken: StepResult, happened: tuple[str, ...]) -> StepEvent:
        """Book a step."""
        margin = self.margins.margin(taken)
        taken, jumped = with_jump_loss(self.stepper, taken, SelectionRule(self.plan.jump))
        at_stop = not taken.before.index or taken.before.time in self.stops
        self.note(*findings.of_step(self.stepper, self.plan, taken, margin, jumped, at_stop))
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

    def note(self, *found: Finding | str) -> None:
        """Say what was found in the end, once: a march that goes on may meet the same again."""
        for one in found:
            beginning, rest = (one, "") if isinstance(one, str) else one
            if not any(message.startswith(beginning) for message in self.messages):
                self.messages.append(beginning + rest)

    def history(self, ended: str, unkept: str) -> History:
        """What there is."""
        if self.frames.kept[-1].time != self.state.time:
            self.frames.offer(self.discrete, self.state, last=True)
        rows, inert = [row.values for row in self.rows], self.discrete.mass is not None
        made = findings.energy_made(self.plan.scheme, rows, self.state.ledger.start, inert)
        moves = inert or not self.plan.scheme.ends_at_equilibrium  # the velocity carries energy on
        ended = _MADE if made and ended == "finished" and moves else ended
        strained = large_deformation(self.discrete, self.frames.kept)
        summed = tuple(self.rows[-1].values[name] for name in _SUMMED) if self.stepping.estimates else (0.0, 0.0)
        added = (findings.errors_added(summed),) if self.stepping.adds_up(max(summed)) else ()
        return History(
            self.discrete,
            tuple(self.rows),
            tuple(self.frames.kept),
            self.state,
            ended,
            tuple(self.events),
            (*strained, *self.messages, *filter(None, [made]), *added, *self.beyond),
            self.bound.now,
            unkept,
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
        while high.step - low > _NEAR * taken.step:
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

    def _first_row(self) -> Row:
        """The row of the start, which is the first of load steps."""
        row, taken = self._row(None), self.first
        if taken is None:
            return row
        steps = sum(solution.steps for solution in taken.solutions)
        return replace(row, solver_steps=steps, residual=taken.residual, margin=self.margins.margin(taken))

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
