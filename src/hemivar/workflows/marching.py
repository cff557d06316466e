"""Compute an evolution, telling of every step."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from hemivar.errors import ProblemError
from hemivar.evolution import (
    SCHEMES,
    AdaptiveStep,
    Checkpoint,
    Evolution,
    FixedStep,
    History,
    ImplicitEuler,
    March,
    Save,
    Scheme,
    SelectionRule,
    StepEvent,
    StepSizeController,
    marching,
)
from hemivar.evolution.discrete import DiscreteEvolution, discretize_evolution
from hemivar.evolution.march import Backend, refuse_plan
from hemivar.solvers import Controls, Solver
from hemivar.workflows.events import Notice, WarningEvent, Work

if TYPE_CHECKING:
    from hemivar.files.problem_file import ProblemFile

__all__ = ["MarchSettings", "ProgressEvent", "ReadyEvent", "evolution_of", "march", "plan_of"]


@dataclass(frozen=True, eq=False)
class ReadyEvent(Notice):
    """The evolution is discretised, and the first step begins.

    Attributes
    ----------
    discrete : DiscreteEvolution
    """

    discrete: DiscreteEvolution


@dataclass(frozen=True, eq=False)
class ProgressEvent(Notice):
    """A step was taken.

    Attributes
    ----------
    stepped : Stepped
    spent : float
        Seconds since the first step began.
    left : float
        Seconds that the rest will take if it goes on like this; nan after the first step of a march that goes on.
    """

    stepped: StepEvent
    spent: float
    left: float


@dataclass(frozen=True, eq=False)
class MarchSettings:
    """What goes before the tables ``[time]`` and ``[output]`` of a problem file; None where they hold.

    Attributes
    ----------
    until, step, every : float or None
    rtol : float or None
        Of the error of a step, for steps of adaptive length.
    scheme : Scheme or None
    jump : Jump or None
    checkpoint : Path or None
    minutes : float or None
        Least time between two checkpoints.
    resume : bool
    max_time : float
        Seconds.
    method : Solver, str or None
    controls : Controls
        Of every step.
    """

    until: float | None = None
    step: float | None = None
    rtol: float | None = None
    every: float | None = None
    scheme: Scheme | None = None
    jump: SelectionRule | None = None
    checkpoint: Path | None = None
    minutes: float | None = None
    resume: bool = False
    max_time: float = math.inf
    method: Solver | str | None = None
    controls: Controls = field(default_factory=Controls)


def evolution_of(stated: ProblemFile) -> Evolution:
    """The evolution that a problem file states; without a table ``[time]`` the body has no inertia and starts at rest.

    Parameters
    ----------
    stated : ProblemFile

    Returns
    -------
    Evolution

    Raises
    ------
    ProblemError
    """
    time, problem = stated.time, stated.problem
    if time is None:
        return Evolution(problem)
    return Evolution(
        problem,
        inertia=time.inertia,
        displacement=time.displacement,
        velocity=time.velocity,
        heat=stated.heat,
    )


def plan_of(stated: ProblemFile, settings: MarchSettings) -> March:
    """How the evolution of a problem file is computed.

    Parameters
    ----------
    stated : ProblemFile
    settings : MarchSettings
        What goes before the file.

    Returns
    -------
    March

    Raises
    ------
    ProblemError
        A static file and no end or step; an option out of its range; ``resume`` without a checkpoint.
    """
    time, output = stated.time, stated.output
    if time is None and (settings.until is None or (settings.step is None and settings.rtol is None)):
        raise ProblemError(
            f"{stated.name}: it says nothing of time; add a table [time] with until and step, or give --until and "
            "--step"
        )
    until = settings.until
    if until is None:
        assert time is not None
        until = time.until
    kept = None if output is None else output.checkpoint
    file, minutes = settings.checkpoint, settings.minutes
    if kept is not None:
        file = Path(kept.file) if file is None else file
        minutes = kept.minutes if minutes is None else minutes
    checkpoint = None
    if file is not None:
        checkpoint = Checkpoint(file) if minutes is None else Checkpoint(file, minutes)
    if settings.resume and checkpoint is None:
        raise ProblemError("--resume needs a checkpoint; name it by --checkpoint FILE, or in the table [output]")
    every = settings.every
    probes: Mapping[str, object] = {}
    if output is not None:
        every = output.every if every is None else every
        probes = dict(output.probes)
    jump = settings.jump
    if jump is None:
        jump = SelectionRule.LOCAL if time is None or time.jump is None else SelectionRule(time.jump)
    return March(
        until=until,
        scheme=_scheme(stated, settings),
        step=_stepping(stated, settings),
        save=Save(every=every, probes=probes),
        stops=() if time is None else time.stops,
        jump=jump,
        method=settings.method,
        controls=settings.controls,
        max_time=settings.max_time,
        checkpoint=checkpoint,
        resume=settings.resume,
    )


def _scheme(stated: ProblemFile, settings: MarchSettings) -> Scheme:
    if settings.scheme is not None:
        return settings.scheme
    if stated.time is None or stated.time.scheme is None:
        return ImplicitEuler()
    given = stated.time.scheme
    return replace(SCHEMES[given.name], **given.parameters)  # type: ignore[type-var]


def _stepping(stated: ProblemFile, settings: MarchSettings) -> StepSizeController | None:
    given = None if stated.time is None else stated.time.step
    if settings.rtol is not None:
        return AdaptiveStep(settings.rtol, first_step=settings.step)
    if settings.step is not None:
        return FixedStep(settings.step)
    if given is None or isinstance(given, int | float):
        return None if given is None else FixedStep(given)
    return AdaptiveStep(given.rtol, first_step=given.first, least=given.min, most=given.max)


def march(evolution: Evolution | DiscreteEvolution, plan: March, tools: Backend | None = None) -> Work[History]:
    """Compute an evolution, with the tools of another engine if some are given.

    Yields :class:`WarningEvent` for what its problem warns of, :class:`ReadyEvent`, and :class:`ProgressEvent` after
    every step; ends after a step if it is sent True or interrupted there.

    Parameters
    ----------
    evolution : Evolution or DiscreteEvolution
    plan : March
        Until when, by which scheme and steps.
    tools : Tools, optional
        Of another engine.

    Yields
    ------
    Event
        What happens; the generator returns a :class:`History`.

    Raises
    ------
    ProblemError, FileError
        As :func:`hemivar.march`.
    """
    refuse_plan(evolution if isinstance(evolution, Evolution) else evolution.evolution, plan)
    discrete = discretize_evolution(evolution) if isinstance(evolution, Evolution) else evolution
    for warning in discrete.problem.notes:
        yield WarningEvent(warning)
    yield ReadyEvent(discrete)
    work = marching(discrete, plan, tools=tools)
    began = clock.perf_counter()
    first: tuple[float, float] | None = None
    try:
        stepped = next(work)
        while True:
            spent = clock.perf_counter() - began
            if first is None:
                first = spent, stepped.done
            gone = stepped.done - first[1]
            left = (spent - first[0]) * (1.0 - stepped.done) / gone if gone > 0.0 else math.nan
            try:
                told = yield ProgressEvent(stepped, spent, left)
            except KeyboardInterrupt:
                told = True
            stepped = work.send(told)
    except StopIteration as end:
        history: History = end.value
        return history
