"""Time integration: compute an evolution, with an event for every step."""

from __future__ import annotations

import math
import time as clock
from dataclasses import dataclass, replace
from typing import Any

from hemivar.basics.arguments import expecting
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, History, March
from hemivar.evolution.discrete import DiscreteEvolution, discretize_evolution
from hemivar.evolution.march import Backend, marching, refuse_plan
from hemivar.evolution.running import StepEvent
from hemivar.files.problem_file import ProblemFile
from hemivar.workflows.events import Notice, WarningEvent, Work

__all__ = ["ProgressEvent", "ReadyEvent", "evolution_of", "march", "plan_of"]


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
    stepped : StepEvent
    spent : float
        Seconds since the first step began.
    left : float
        Seconds that the rest will take if it goes on like this; nan after the first step of a march that goes on.
    """

    stepped: StepEvent
    spent: float
    left: float


@expecting(stated=ProblemFile)
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
    time = stated.time
    if time is None:
        return Evolution(stated.problem)
    start = time.initial
    return Evolution(stated.problem, time.inertia, start.get("displacement"), start.get("velocity"), heat=stated.heat)


@expecting(stated=ProblemFile)
def plan_of(stated: ProblemFile, *, every: float | None = None, **given: Any) -> March:
    """How the evolution of a problem file is computed.

    Parameters
    ----------
    stated : ProblemFile
    every : float, optional
        Time between frames, in place of that of the file.
    **given
        Options of :class:`March`, which go before those of the file.

    Returns
    -------
    March

    Raises
    ------
    ProblemError
        A static file and no end or step; an option out of its range; ``resume`` without a checkpoint.
    """
    if stated.time is None and not {"until", "step"} <= given.keys():
        raise ProblemError(
            f"{stated.name}: it has no time; add a table [time] with until and step, or give --until and --step"
        )
    plan = March(**given) if stated.time is None else replace(stated.time.march, **given)
    return plan if every is None else replace(plan, save=replace(plan.save, every=every))


@expecting(evolution=Evolution | DiscreteEvolution, plan=March)
def march(evolution: Evolution | DiscreteEvolution, plan: March, tools: Backend | None = None) -> Work[History]:
    """Compute an evolution, with the tools of another engine if some are given.

    Yields :class:`WarningEvent` for what its problem warns of, :class:`ReadyEvent`, and :class:`ProgressEvent` after
    every step; ends after a step if it is sent True or interrupted there.

    Parameters
    ----------
    evolution : Evolution or DiscreteEvolution
    plan : March
        Until when, by which scheme and steps.
    tools : Backend, optional
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
                stop = yield ProgressEvent(stepped, spent, left)
            except KeyboardInterrupt:
                stop = True
            stepped = work.send(stop)
    except StopIteration as end:
        history: History = end.value
        return history
