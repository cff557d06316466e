"""The options of a march (scheme, step, method, ends), and what does not fit an evolution."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from hemivar.basics.arguments import expect, number, quoted, suggest
from hemivar.basics.disk import path_of
from hemivar.basics.known_keywords import known_fields
from hemivar.basics.stated import Form, stated
from hemivar.errors import ProblemError
from hemivar.evolution.control import Control, control_of, refuse_control
from hemivar.evolution.evolution_problem import Evolution, Mass
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.march_events import Event
from hemivar.evolution.march_state import Checkpoint
from hemivar.evolution.save import Save
from hemivar.evolution.schemes import ImplicitEuler, Scheme
from hemivar.evolution.schemes.by_name import SCHEME_ENTRIES, SCHEMES
from hemivar.evolution.steps import FixedStep, StepSizeController
from hemivar.solvers import Controls, Solver
from hemivar.solvers.methods import as_method

__all__ = ["March", "refuse_plan"]

_SCHEMES = ", ".join(f'`"{name}"`{"" if one.takes_mass else " (without inertia)"}' for name, one in SCHEMES.items())
_WITH_PARAMETERS = ", ".join(
    f'`{{ name = "{name}", {", ".join(f"{key} = {value}".lower() for key, value in entry.example.items())} }}`'
    for name, entry in SCHEME_ENTRIES.items()
    if entry.example
)


@known_fields
@dataclass(frozen=True, eq=False)
class March:
    """How an evolution is computed.

    Parameters
    ----------
    until : float
        Time at which it ends.
    scheme : Scheme or str
        :class:`ImplicitEuler` by default, or a name, as in a problem file.
    step : float or StepSizeController, optional
        A length, :class:`FixedStep` or :class:`AdaptiveStep`; a hundredth of the whole by default.
    save : Save
    stops : sequence of float
        Times at which a step ends exactly, such as kinks of loads that are functions in Python; those of formulas
        (``min``, ``max``, ``abs`` of the time) are found by themselves.
    events : sequence of Event
        A step ends where one happens.
    jump : SelectionRule or str
        What happens where a step may have several solutions and nothing viscous chooses one.
    control : str or mapping, optional
        ``"dissipation"`` or ``{"opening": boundary}``: the load factor is unknown, and falls where the joint carries
        less. What acts is that of the time ``t`` = load factor.
    method : Solver or str, optional
        Of the steps, or its name as in :func:`hemivar.solve`; chosen by their size by default.
    controls : Controls
        Of every step.
    max_time : float
        Seconds; what there is by then is returned.
    checkpoint : Checkpoint or path, optional
        A file from which the march can go on.
    resume : bool
        Go on from the checkpoint; where there is none, begin.

    Raises
    ------
    ProblemError
        An option is of the wrong kind or out of its range.
    """

    until: float = field(metadata=stated(Form.NUMBER, "the end of time", above=0.0, left_out="must be there"))
    scheme: Scheme = field(
        default_factory=ImplicitEuler,
        metadata=stated(
            Form.OWN,
            f"{_SCHEMES}; with parameters {_WITH_PARAMETERS}",
            left_out=f'`"{ImplicitEuler.name}"`',
        ),
    )
    step: StepSizeController | float | None = field(
        default=None,
        metadata=stated(
            Form.OWN,
            "length of all steps, or `{ rtol = 1e-3, first = 1e-3, min = 1e-6, max = 0.05 }`: lengths that follow a "
            "relative tolerance of the error, of which only `rtol` must be given",
            left_out="a hundredth of the whole",
        ),
    )
    save: Save = field(default_factory=Save)
    stops: Sequence[float] = field(
        default=(),
        metadata=stated(
            Form.OWN,
            "times at which a step ends exactly: jumps of loads, kinks of formulas that depend on the place as well; "
            "kinks where what `min`, `max` or `abs` compare depends on t alone are met anyway",
        ),
    )
    events: Sequence[Event] = ()
    jump: SelectionRule | str = field(
        default=SelectionRule.LOCAL,
        metadata=stated(
            Form.TEXT,
            "what happens where a step has several solutions and there is no viscosity: "
            + ", ".join(f'`"{rule}"`' for rule in SelectionRule),
            choices=tuple(SelectionRule),
        ),
    )
    control: Control | str | Mapping[str, str] | None = field(
        default=None,
        metadata=stated(
            Form.OWN,
            '`"dissipation"` or `{ opening = "boundary" }`: the load factor, which `t` is in loads, is an answer of '
            "every step, and may fall",
            left_out="the loads follow the time",
        ),
    )
    method: Solver | str | None = None
    controls: Controls = field(default_factory=Controls)
    max_time: float = math.inf
    checkpoint: Checkpoint | str | Path | None = None
    resume: bool = False

    def __post_init__(self) -> None:
        number(self.until, "until", "give the time at which it ends")
        object.__setattr__(self, "scheme", _scheme_of(self.scheme))
        if self.step is not None and not isinstance(self.step, StepSizeController):
            object.__setattr__(self, "step", FixedStep(number(self.step, "the step", "give a time > 0")))
        expect(self.save, Save, "save", "give Save(every=...)")
        some: Iterable[Event] = expect(self.events, Iterable, "events", "give a list of them, such as [Touch()]")
        events = tuple(some)
        for event in events:
            expect(event, Event, "an event", "give Touch(), Release() or the like")
        given: Iterable[float] = expect(self.stops, Iterable, "stops", "give a list of times, such as (0.5,)")
        stops = tuple(number(stop, "a stop", "give times") for stop in given)
        object.__setattr__(self, "stops", stops)
        object.__setattr__(self, "events", events)
        try:
            if not isinstance(self.jump, str):  # of which arrays are compared with every word
                raise ValueError
            object.__setattr__(self, "jump", SelectionRule(self.jump))
        except ValueError:
            gone = " was removed: march with inertia" if isinstance(self.jump, str) and self.jump == "dynamic" else ""
            raise ProblemError(f"jump = {quoted(self.jump)}{gone}; choose one of {', '.join(SelectionRule)}") from None
        object.__setattr__(self, "control", control_of(self.control))
        as_method(self.method)
        expect(self.controls, Controls, "controls", "pass Controls(rtol=...)")
        if not number(self.max_time, "max_time", "give seconds") >= 0.0:
            raise ProblemError(f"max_time = {self.max_time:g}; give seconds >= 0")
        if self.checkpoint is not None and not isinstance(self.checkpoint, Checkpoint):
            object.__setattr__(self, "checkpoint", Checkpoint(path_of(self.checkpoint)))
        if expect(self.resume, bool, "resume", "give True or False") and self.checkpoint is None:
            raise ProblemError("resume needs a checkpoint; name its file, checkpoint='run.ckpt'")

    def of(self, stated: Evolution) -> March:
        """The plan for an evolution: one increment for each of its load steps where no length is given."""
        if not stated.steps:
            return self
        step = FixedStep(1.0) if self.step is None else self.step
        return replace(self, step=step, stops=(*self.stops, *map(float, range(2, len(stated.steps)))))

    def stepping(self, span: float) -> StepSizeController:
        """The control of steps of an evolution that lasts ``span``."""
        return FixedStep(span / 100.0) if self.step is None else self.step  # type: ignore[return-value]


def _scheme_of(scheme: object) -> Scheme:
    """A scheme given by its name or as an object."""
    if not isinstance(scheme, str):
        return expect(scheme, Scheme, "the scheme", f"give ImplicitEuler() or a name, such as '{ImplicitEuler.name}'")
    if scheme not in SCHEMES:
        raise ProblemError(f"there is no scheme {quoted(scheme)}{suggest(scheme, tuple(SCHEMES), 'schemes')}")
    return SCHEMES[scheme]


def refuse_plan(stated: Evolution, plan: March) -> None:
    """Refuse a way of computing an evolution that does not fit it."""
    scheme = plan.scheme
    if stated.steps and plan.until > len(stated.steps):
        raise ProblemError(f"there are {len(stated.steps)} load steps, and until is {plan.until:g}; leave until out")
    if stated.steps and not scheme.ends_at_equilibrium:
        raise ProblemError(
            f"load steps are static problems, and steps of the scheme {scheme.name} end in none; take "
            f"{ImplicitEuler.name}"
        )
    if stated.steps and isinstance(plan.control, Control):
        raise ProblemError("control finds the load, and load steps state it; leave one of the two out")
    span = plan.until - stated.start
    if not 0.0 < span < math.inf:
        raise ProblemError(
            f"the evolution starts at t = {stated.start:g} and is to end at {plan.until:g}; let it end later"
        )
    if scheme.needs_mass and not stated.inertia:
        raise ProblemError(
            f"the scheme {scheme.name} is one for bodies with mass; take inertia=True with a density, or the scheme "
            f"{ImplicitEuler.name} or sdirk2"
        )
    if stated.inertia and not scheme.takes_mass:
        raise ProblemError(
            f"the scheme {scheme.name} is one for bodies without mass; take {ImplicitEuler.name} or generalized-alpha"
        )
    if scheme.is_impact_law and stated.mass is Mass.REDISTRIBUTED:
        raise ProblemError(
            f"{scheme.name} needs velocities at the contact points, which redistributed mass leaves undetermined; take "
            "mass = 'consistent', or the scheme newmark"
        )
    if stated.heat is not None and len(scheme.rules(1.0)) > 1:
        raise ProblemError(
            f"the scheme {scheme.name} has several stages, over which heat and motion are not coupled here; take "
            f"{ImplicitEuler.name} or midpoint"
        )
    if not stated.linear:
        _refuse_nonlinear(plan)
    plan.stepping(span).first(span)
    if isinstance(plan.control, Control):
        refuse_control(stated, plan.control, scheme, plan.stepping(span), SelectionRule(plan.jump))
    if SelectionRule(plan.jump).follows:
        _refuse_path(stated, plan)


def _refuse_nonlinear(plan: March) -> None:
    """Refuse what is made for linear bodies alone."""
    if plan.scheme.averages_laws:
        raise ProblemError(
            "conserving = true is for linear bodies; leave it out: the midpoint rule remains of second order, and its "
            "energy error is reported as 'numerical'"
        )
    if SelectionRule(plan.jump) in (SelectionRule.ARC_LENGTH, SelectionRule.GLOBAL):
        raise ProblemError(
            f"jump = '{plan.jump}' is made for linear bodies, and the material is not linear; take jump = 'local' or "
            "'viscous'"
        )


def _refuse_path(stated: Evolution, plan: March) -> None:
    """Refuse to follow paths of equilibria where there are none."""
    if stated.resists:
        return
    if not plan.scheme.ends_at_equilibrium:
        raise ProblemError(
            f"jump = '{plan.jump}' follows equilibria at the ends of steps, which the scheme {plan.scheme.name} does "
            f"not have; take {ImplicitEuler.name}"
        )
