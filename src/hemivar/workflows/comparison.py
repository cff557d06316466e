"""Solve one problem by several methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from hemivar.basics.arguments import expecting
from hemivar.basics.display import brief
from hemivar.basics.rows import Column, ResultRows
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError, ProblemError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.solvers import METHODS, Controls, Solution, Solver, Status
from hemivar.solvers.solve import solving, suited
from hemivar.systems import Workspace
from hemivar.workflows.events import Notice, Phase, Work

__all__ = ["Attempt", "CompareOptions", "Comparison", "Condensed", "compare", "energy_norm_difference"]

_REFERENCE, _REFERENCE_IF_LARGE = "newton", "multigrid"


@dataclass(frozen=True)
class CompareOptions:
    """What to compare.

    Parameters
    ----------
    methods : mapping of name to Solver
        All of ``hemivar.solvers.METHODS`` by default; the reference comes first, whether it is among them or not.
    controls : Controls
        Tolerances and limits of each method; a minute by default.
    """

    methods: Mapping[str, Solver] = field(default_factory=lambda: METHODS)
    controls: Controls = field(default_factory=lambda: Controls(max_time=60.0))


@dataclass(frozen=True, eq=False)
class Condensed(Notice):
    """The body was condensed onto its contact boundary for all methods, in so many seconds; None if it could not be,
    for the ``reason``.

    Attributes
    ----------
    seconds : float or None
        None if it could not be.
    reason : str
        Why it could not be.
    """

    seconds: float | None
    reason: str = ""


@dataclass(frozen=True, eq=False)
class Attempt(Notice):
    """One method.

    Attributes
    ----------
    name : str
    status : str
        How it ended: the value of a :class:`~hemivar.solvers.Status`, "refused" or "failed".
    note : str
        Why it was refused, failed, or what to do where it did not converge.
    solution : Solution or None
    seconds : float or None
        Time without what all methods share.
    difference : float or None
        Relative distance to the solution of the reference, in the energy norm.
    """

    name: str
    status: str
    note: str = ""
    solution: Solution | None = None
    seconds: float | None = None
    difference: float | None = None

    __repr__ = brief


@dataclass(frozen=True, eq=False)
class Comparison:
    """What :func:`compare` found.

    Attributes
    ----------
    problem : DiscreteProblem
    attempts : tuple of Attempt
        In the order in which they were made, the reference first.
    reference : Attempt or None
        The first one with a solution.
    interrupted : bool
        Whether the work was stopped from the keyboard.
    """

    problem: DiscreteProblem
    attempts: tuple[Attempt, ...]
    reference: Attempt | None
    interrupted: bool

    __repr__ = brief

    def rows(self) -> ResultRows:
        """A row for each method: how it ended, time, steps, evaluations, residual, energy and difference."""
        attempts, solutions = self.attempts, [one.solution for one in self.attempts]
        energies = [None if one is None else one.energy for one in solutions]
        columns = (
            Column("method", [one.name for one in attempts], "method"),
            Column("status", [one.status for one in attempts], "status"),
            Column("time (s)", [one.seconds for one in attempts], "seconds"),
            Column("steps", [None if one is None else one.steps for one in solutions], "steps"),
            Column("evaluations", [None if one is None else one.evaluations for one in solutions], "evaluations"),
            Column("residual", [None if one is None else one.residual.relative for one in solutions], "residual"),
            Column("energy", energies, "energy", unit="energy", cell="{:.10g}".format),
            Column("difference", [one.difference for one in attempts], "difference"),
            Column(None, [one.note for one in attempts], "note"),
        )
        return ResultRows(columns)


@expecting(options=CompareOptions)
def compare(problem: ProblemLike, options: CompareOptions | None = None) -> Work[Comparison]:
    """Solve a problem by several methods, the reference first: newton, or multigrid where no factorisation fits.

    Yields :class:`Condensed`, then for every method :class:`Phase`, its steps and :class:`Attempt`.  A method that is
    refused or fails is an attempt as well.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
    options : CompareOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`Comparison`.
    """
    options = CompareOptions() if options is None else options
    problem = as_discrete(problem, "compare")
    first, shared = _REFERENCE, None
    try:
        shared = Workspace()
        yield Condensed(shared.condensed(problem).seconds)
    except MethodError as error:
        first, shared = _REFERENCE_IF_LARGE, None
        yield Condensed(None, str(error))
    methods = {first: options.methods.get(first, METHODS[first]), **options.methods}
    attempts: list[Attempt] = []
    reference: Attempt | None = None
    interrupted = False
    try:
        for number, (name, solver) in enumerate(methods.items()):
            yield Phase(name, number, len(methods))
            tried = yield from attempt(name, solver, problem, options.controls, shared, reference)
            reference = tried if reference is None and tried.solution is not None else reference
            attempts.append(tried)
            yield tried
            interrupted = tried.status == Status.INTERRUPTED.value
            if interrupted:
                break
    except KeyboardInterrupt:  # between two solves, or before the first step of one
        interrupted = True
    return Comparison(problem, tuple(attempts), reference, interrupted)


def attempt(
    name: str,
    solver: Solver,
    problem: DiscreteProblem,
    controls: Controls,
    shared: Workspace | None,
    reference: Attempt | None,
) -> Work[Attempt]:
    """Try a method; a refusal or a failure is an outcome."""
    try:
        solution = yield from solving(problem, suited(solver, problem), controls, workspace=shared)
    except MethodError as error:
        return Attempt(name, "refused", str(error))
    except Exception as error:
        reason = " ".join(str(error).split()) or "no message"
        return Attempt(name, "failed", f"{type(error).__name__}: {reason}")
    note = "" if solution.status is Status.CONVERGED else solution.remedy
    seconds = sum(value for stage, value in solution.timings.items() if stage != "condense" or shared is None)
    other = solution if reference is None or reference.solution is None else reference.solution
    return Attempt(name, solution.status.value, note, solution, seconds, energy_norm_difference(solution, other))


@expecting(one=Solution, other=Solution)
def energy_norm_difference(one: Solution, other: Solution) -> float:
    """``|u - v|_K / |v|_K`` for two solutions of the same discrete problem (v the second one).

    Parameters
    ----------
    one : Solution
    other : Solution

    Returns
    -------
    float

    Raises
    ------
    ProblemError
        The solutions are of different problems.
    """
    if one.problem is not other.problem:
        raise ProblemError("the two solutions belong to different discrete problems; compare them by interpolation")
    K = other.problem.stiffness
    apart = one.unknowns - other.unknowns
    size = float(other.unknowns @ (K @ other.unknowns))
    return float(np.sqrt(max(float(apart @ (K @ apart)), 0.0) / size)) if size > 0.0 else float(np.abs(apart).max())
