"""The march through time: the loop of time integration, its ends and its checkpoints."""

from __future__ import annotations

import time as clock
from collections.abc import Generator
from contextlib import nullcontext
from dataclasses import replace
from typing import Any

from hemivar.basics.arguments import expect
from hemivar.basics.deadline import Budget, OutOfTime, limited
from hemivar.basics.generators import result_of
from hemivar.basics.known_keywords import showing_options
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.errors import FileError, HemivarError, MethodError, ProblemError
from hemivar.evolution.discrete import DiscreteEvolution, discretize_evolution
from hemivar.evolution.evolution_problem import Evolution
from hemivar.evolution.history import History
from hemivar.evolution.march_state import Checkpoint
from hemivar.evolution.plan import March, refuse_plan
from hemivar.evolution.running import Backend, StepEvent, TimeLoop
from hemivar.evolution.step_laws import refuse_compliant, refuse_unaveraged
from hemivar.systems.workspace import Workspace

#: Seconds that the state at the start may take in any case: a march without it has no history.
_BEGIN = 1.0

__all__ = ["Backend", "March", "StepEvent", "march", "marching", "refuse_plan"]


@showing_options(March)
def march(
    evolution: Evolution | DiscreteEvolution | ManufacturedProblem,
    until: float | None = None,
    *,
    workspace: Workspace | None = None,
    **options: Any,
) -> History:
    """Integrate a contact problem in time.

    Parameters
    ----------
    evolution : Evolution, DiscreteEvolution, or ManufacturedProblem of an evolution
    until : float, optional
        Time at which it ends; the last load step by default.
    workspace : Workspace, optional
        Keeps factors and levels for other runs of the same body.
    **options

    Returns
    -------
    History
        Always; ``history.ended`` says whether it reached its end.

    Raises
    ------
    ProblemError
        The evolution cannot be computed as stated. What is found out later, such as a load that is no number from some
        time on, ends the march there: ``history.ended`` is ``"refused"``, and the last of its messages says why.
    MethodError
        The time limit is over before the state at the start is known.
    FileError
        The checkpoint is that of another evolution.

    Examples
    --------
    >>> import hemivar as hv
    >>> block = hv.ContactProblem(
    ...     hv.rectangle((1.0, 1.0), 4), hv.Material.young(10.0, 0.3), {"bottom": hv.Contact(hv.Compliance(20.0))},
    ...     {"left": "roller", "right": "roller"}, tractions={"top": ("0", "-t")})
    >>> history = hv.march(hv.Evolution(block), until=1.0, step=0.25)
    >>> len(history.frames), round(float(history.frames[-1].displacement.min()), 3)
    (5, -0.124)
    """
    end = _end(evolution) if until is None else until
    return result_of(marching(evolution, March(end, **options), workspace=workspace))


def _end(evolution: object) -> float:
    """The end of the last load step."""
    stated = evolution.evolution if isinstance(evolution, DiscreteEvolution) else evolution
    if not isinstance(stated, Evolution) or not stated.steps:
        raise ProblemError("until is missing; give the time of the end")
    return float(len(stated.steps))


def marching(
    evolution: Evolution | DiscreteEvolution | ManufacturedProblem,
    plan: March,
    *,
    workspace: Workspace | None = None,
    tools: Backend | None = None,
) -> Generator[StepEvent, bool | None, History]:
    """:func:`march` step by step: yields every step, ends after it if it is sent True, returns the history.

    Factors and levels are kept in the workspace; ``tools`` are those of another engine.
    """
    remedy = "give an Evolution(problem, ...); a contact problem becomes one by hemivar.Evolution(problem)"
    evolution = expect(evolution, Evolution | DiscreteEvolution, "what to march", remedy)
    stated = evolution.evolution if isinstance(evolution, DiscreteEvolution) else evolution
    plan = plan.of(stated)
    refuse_plan(stated, plan)
    budget = Budget(plan.max_time)
    discrete = discretize_evolution(evolution) if isinstance(evolution, Evolution) else evolution
    if plan.scheme.is_impact_law:
        refuse_compliant(discrete, plan.scheme)
    if plan.scheme.averages_laws:
        refuse_unaveraged(discrete, plan.scheme)
    loop = TimeLoop(discrete, plan, workspace, Backend() if tools is None else tools)
    # Within a step only a process by itself looks at the clock: others would leave it at other places.
    hurried = discrete.vectors.alone
    try:
        with limited(Budget(max(plan.max_time, _BEGIN))) if hurried else nullcontext():
            loop.begin()
    except OutOfTime:
        raise MethodError(
            f"the time limit of {plan.max_time:g} s was over before the state at the start was known; give more time, "
            "or a smaller problem"
        ) from None
    kept, written = plan.checkpoint, clock.perf_counter()
    assert kept is None or isinstance(kept, Checkpoint)
    ended, unkept = "finished", ""
    while loop.state.time < plan.until:
        try:
            with limited(budget) if hurried else nullcontext():
                taken, happened, stop = loop.attempt()
        except KeyboardInterrupt:
            ended = "interrupted"
            break
        except OutOfTime:
            ended = "max_time"
            break
        except HemivarError as error:  # what was computed until then is not given up
            if len(loop.rows) == 1 or not _of_all(error, discrete):
                raise
            loop.note(str(error))
            ended = "refused"
            break
        if taken is None:
            ended = happened[0]
            break
        event = loop.accept(taken, happened)
        interrupt = yield replace(event, unkept=unkept) if unkept else event
        late = kept is not None and clock.perf_counter() - written >= 60.0 * kept.minutes
        # What the clock says differs between processes: the largest holds for all.
        interrupt, due, late = discrete.vectors.largest(float(bool(interrupt)), budget.due(), float(late)).tolist()
        if late and kept is not None:
            unkept = _keep(kept, loop)
            written = clock.perf_counter()
        if stop or interrupt or due:
            ended = f"event: {happened[-1]}" if stop else "interrupted" if interrupt else "max_time"
            break
    return loop.history(ended, "" if kept is None else _keep(kept, loop))


def _keep(kept: Checkpoint, loop: TimeLoop) -> str:
    """Write a checkpoint; if it cannot be written, the march is worth more than that: returns why."""
    try:
        kept.write(loop.march_state(), loop.identity)
    except FileError as error:
        if not _of_all(error, loop.discrete):
            raise
        return str(error)
    return ""


def _of_all(error: HemivarError, discrete: DiscreteEvolution) -> bool:
    """Whether all processes have this error, so that they can go on together."""
    return discrete.vectors.alone or getattr(error, "shared", False)
