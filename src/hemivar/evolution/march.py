"""The march through time."""

from __future__ import annotations

import time as clock
from collections.abc import Generator
from typing import Any

from hemivar.basics.arguments import expect
from hemivar.basics.deadline import Budget
from hemivar.basics.generators import result_of
from hemivar.basics.known_statement import KnownStatement
from hemivar.evolution.discrete import DiscreteEvolution, discretize_evolution
from hemivar.evolution.evolution_problem import Evolution
from hemivar.evolution.history import History
from hemivar.evolution.march_state import Checkpoint
from hemivar.evolution.plan import March, refuse_plan
from hemivar.evolution.running import Run, Stepped, Tools
from hemivar.evolution.schemes import Midpoint, MoreauJean
from hemivar.evolution.step_laws import refuse_compliant, refuse_unaveraged
from hemivar.systems.workspace import Workspace

__all__ = ["March", "Stepped", "Tools", "march", "marching", "refuse_plan"]


def march(
    evolution: Evolution | DiscreteEvolution | KnownStatement,
    until: float,
    *,
    workspace: Workspace | None = None,
    **options: Any,
) -> History:
    """Compute an evolution.

    Parameters
    ----------
    evolution : Evolution, DiscreteEvolution, or KnownStatement of an evolution
    until : float
        Time at which it ends.
    workspace : Workspace, optional
    **options
        Those of :class:`March`: ``scheme, step, save, stops, events, jump, solver, controls, max_time, checkpoint,
        resume``.

    Returns
    -------
    History
        Always; ``history.ended`` says whether it reached its end.

    Raises
    ------
    ProblemError
        The evolution cannot be computed as stated.
    FileError
        The checkpoint is that of another evolution.
    """
    return result_of(marching(evolution, March(until, **options), workspace=workspace))


def marching(
    evolution: Evolution | DiscreteEvolution | KnownStatement,
    plan: March,
    *,
    workspace: Workspace | None = None,
    tools: Tools | None = None,
) -> Generator[Stepped, bool | None, History]:
    """:func:`march` step by step: yields every step, ends after it if it is sent True, returns the history.

    Parameters
    ----------
    evolution : Evolution, DiscreteEvolution, or KnownStatement of an evolution
    plan : March
        Until when, by which scheme and steps.
    workspace : Workspace, optional
        Where factors and levels are kept.
    tools : Tools, optional
        Of another engine.

    Yields
    ------
    Stepped
        Every step; the generator returns a :class:`History`.
    """
    remedy = "give an Evolution(problem, ...); a contact problem becomes one by hemivar.Evolution(problem)"
    evolution = expect(evolution, Evolution | DiscreteEvolution, "what to march", remedy)
    stated = evolution.evolution if isinstance(evolution, DiscreteEvolution) else evolution
    refuse_plan(stated, plan)
    began = clock.perf_counter()
    discrete = discretize_evolution(evolution) if isinstance(evolution, Evolution) else evolution
    if isinstance(plan.scheme, MoreauJean):
        refuse_compliant(discrete, plan.scheme)
    if isinstance(plan.scheme, Midpoint) and plan.scheme.conserving:
        refuse_unaveraged(discrete, plan.scheme)
    run = Run(discrete, plan, workspace, Tools() if tools is None else tools)
    run.begin()
    kept = plan.checkpoint
    assert kept is None or isinstance(kept, Checkpoint)
    budget, written = Budget(plan.max_time - (clock.perf_counter() - began)), clock.perf_counter()
    ended = "finished"
    while run.moment.time < plan.until:
        try:
            taken, happened, stop = run.step()
        except KeyboardInterrupt:
            ended = "interrupted"
            break
        if taken is None:
            ended = happened[0]
            break
        told = yield run.accept(taken, happened)
        late = kept is not None and clock.perf_counter() - written >= 60.0 * kept.minutes
        # What the clock says differs between processes: the largest holds for all.
        told, due, late = discrete.vectors.largest(float(bool(told)), budget.due(), float(late)).tolist()
        if late and kept is not None:
            kept.write(run.state(), run.identity)
            written = clock.perf_counter()
        if stop or told or due:
            ended = f"event: {happened[-1]}" if stop else "interrupted" if told else "max_time"
            break
    if kept is not None:
        kept.write(run.state(), run.identity)
    return run.history(ended)
