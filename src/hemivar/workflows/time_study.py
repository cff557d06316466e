"""Convergence in time: a march with halved steps, its errors, their orders, and the step that an accuracy needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import expect, expecting, whole_number
from hemivar.basics.generators import result_of
from hemivar.basics.rows import Column, ResultRows
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, FixedStep, History, March, Save
from hemivar.evolution.discrete import DiscreteEvolution, discretize_evolution
from hemivar.evolution.march import marching
from hemivar.fem.error_norms import KnownField, error_norms
from hemivar.mechanics import ContactProblem
from hemivar.workflows.convergence import QUANTITIES, Convergence, ErrorLevel
from hemivar.workflows.events import Phase, Work, until_interrupted

__all__ = ["TimeLevel", "TimeStudy", "TimeStudyOptions", "study_time"]

#: Times at which runs are compared, at most: of smooth evolutions more do not change the largest error.
_TIMES = 50
_Fields = Sequence[tuple[Array, Array | float]]


@dataclass(frozen=True)
class TimeStudyOptions:
    """How often to halve the step, and what to compare with.

    Parameters
    ----------
    refine : int
        How often the step is halved: ``refine + 1`` runs.
    known : KnownField or sequence of str, optional
        The known solution by formulas of x, y (and z) and t; the run with the shortest step by default.
    """

    refine: int = 3
    known: KnownField | Sequence[str] | None = None

    def __post_init__(self) -> None:
        if whole_number(self.refine, "refine", 1) > 12:
            raise ProblemError(f"refine is {self.refine}; give 12 halvings of the step at most")
        if self.known is not None and not isinstance(self.known, KnownField):
            known: Sequence[str] = expect(self.known, Sequence, "known", "give a formula for each component")  # type: ignore[type-abstract]
            object.__setattr__(self, "known", KnownField(known, timed=True))


@dataclass(frozen=True, eq=False, repr=False)
class TimeLevel(ErrorLevel):
    """One run: the step is its size, its errors are the largest at the times of the first run, as of :class:`Study`."""

    history: History

    @property
    def converged(self) -> bool:
        """Whether the run reached its end."""
        return self.history.finished


@dataclass(frozen=True, eq=False, repr=False)
class TimeStudy(Convergence):
    """What :func:`study_time` returns; ``size_for(1e-3)`` is the step for a relative error of 1e-3."""

    levels: tuple[TimeLevel, ...]
    each = "runs"
    measured_by = "time step"

    def rows(self, *, relative: bool = False) -> ResultRows:
        """A row for each run: step, steps, errors, orders from the run before, and the work of the solver."""
        runs = [level.history for level in self.levels]
        steps, solved = [len(run.steps) - 1 for run in runs], [int(run["solver_steps"].sum()) for run in runs]
        columns = [Column("step", self.sizes, "step", unit="time"), Column("steps", steps, "steps")]
        return ResultRows((*columns, *self.error_columns(relative), Column("solver steps", solved, "solver_steps")))


@expecting(evolution=Evolution, plan=March, options=TimeStudyOptions)
def study_time(evolution: Evolution, plan: March, options: TimeStudyOptions) -> Work[TimeStudy]:
    """March with steps that are halved, and measure errors and orders of convergence in time.

    Parameters
    ----------
    evolution : Evolution
    plan : March
        Until when, by which scheme, and the first step.
    options : TimeStudyOptions

    Yields
    ------
    Event
        :class:`Phase` and :class:`TimeLevel` for each run; the generator returns a :class:`TimeStudy`.

    Raises
    ------
    ProblemError
        A run does not reach its end, or runs have no times in common.
    """
    discrete, levels = discretize_evolution(evolution), list[TimeLevel]()
    if isinstance(options.known, KnownField):
        options.known.check(discrete.field.components)
    interrupted = yield from until_interrupted(_runs(discrete, plan, options.refine, levels))
    if not levels:
        raise KeyboardInterrupt
    return _measured(discrete, levels, options, interrupted)


def _runs(discrete: DiscreteEvolution, plan: March, refine: int, levels: list[TimeLevel]) -> Work[bool]:
    """All runs, put into the list when they are done; returns whether they were interrupted."""
    span = plan.until - discrete.evolution.start
    first = plan.stepping(span).first(span).step
    plan = replace(plan, save=Save(every=first * math.ceil(span / first / _TIMES)), checkpoint=None, resume=False)
    for number in range(refine + 1):
        step = first / 2**number
        yield Phase(f"step = {step:.4g}", number, refine + 1)
        level = TimeLevel(step, result_of(marching(discrete, replace(plan, step=FixedStep(step)))))
        if level.history.ended == "interrupted":
            return True
        if not level.converged:
            at = f"t = {level.history.state.time:g} ({level.history.ended})"
            raise ProblemError(f"the run with step {step:g} ended at {at}; take other steps, or march alone to see why")
        levels.append(level)
        if (yield level):
            return number < refine
    return False


def _measured(
    discrete: DiscreteEvolution, levels: list[TimeLevel], options: TimeStudyOptions, interrupted: bool
) -> TimeStudy:
    """The study, with the errors against the known solution, or the finest run."""
    size, known = discrete.field.components, options.known if isinstance(options.known, KnownField) else None
    kept = [level.history.frames for level in levels]
    times = np.array([frame.time for frame in kept[-1]])
    if any(len(own) != len(times) or np.abs([f.time for f in own] - times).max() > 1e-9 * times[-1] for own in kept):
        raise ProblemError("the runs have no times in common; give a step that divides the whole time")
    runs: list[_Fields] = [
        [(f.displacement.reshape(-1, size), f.multiplier[:, 0] if f.force_time == f.time else np.nan) for f in own]
        for own in kept
    ]
    reference = runs[-1] if known is None else [(known.values(discrete.field.nodes, t), np.nan) for t in times]
    for number, run in enumerate(runs):
        if run is not reference:
            energy, displacement, pressure = _largest(discrete, run, reference)
            levels[number] = replace(levels[number], energy=energy, displacement=displacement, pressure=pressure)
    norms = dict(zip(QUANTITIES, _largest(discrete, reference, [(0.0 * u, 0.0) for u, _ in reference]), strict=True))
    against = "finest run" if known is None else "exact solution"
    return TimeStudy(tuple(levels), MappingProxyType(norms), against, interrupted)


def _largest(discrete: DiscreteEvolution, run: _Fields, reference: _Fields) -> tuple[float, float, float]:
    """The largest norms of what lies between two runs: energy, displacement, and pressure where it is known."""
    stated = expect(
        discrete.evolution.problem, ContactProblem, "what is marched", "give an Evolution of a ContactProblem"
    )
    weights = discrete.problem.contact.weights
    apart = [(u - v, p - q + 0.0 * weights) for (u, p), (v, q) in zip(run, reference, strict=True)]
    norms = [error_norms(stated, u) for u, _ in apart]
    pressure = float(np.max([math.sqrt(float(weights @ p**2)) for _, p in apart])) if weights.size else math.nan
    return max(norm.energy for norm in norms), max(norm.mean_square for norm in norms), pressure
