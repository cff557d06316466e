"""Solve, bound, mark, refine: until the distance to the exact solution is what was asked for.

Every mesh is one of :meth:`hemivar.Mesh.refined_where`, and its problem an ordinary one, started from the solution on
the mesh before.  Cells are marked by Doerfler's rule: the fewest that hold a share of the sum of

    eta_T^2 + |xi - zeta|_F^2 / Lambda + G_F,

what a cell and its contact facets add to the bound (:func:`hemivar.bounds.exact_distance`). With a
goal the share is one of what cells add to the error of that quantity (:mod:`hemivar.bounds.goal_values`) until the
estimate of it is as asked; from there on that of the bound, with which the guaranteed interval shrinks.
"""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from dataclasses import dataclass, field, replace

import numpy as np

from hemivar.basics.arguments import expect, number
from hemivar.basics.arrays import SAME
from hemivar.basics.display import ReprMixin, brief
from hemivar.basics.generators import result_of
from hemivar.basics.known_keywords import known_keywords, showing_options
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.basics.memory import available_bytes, size_in_words
from hemivar.basics.rounding import rounded_up
from hemivar.basics.rows import Column, ResultRows, plain
from hemivar.basics.types import Array, Record
from hemivar.bounds.adaptive_end import AdaptiveEnd
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.flat_cells import largest_share
from hemivar.bounds.goal_values import GoalValue, goal_value
from hemivar.bounds.goals import Goal, goal_named
from hemivar.bounds.joined_refinement import refined_alike
from hemivar.bounds.touching_bodies import refuse_touching
from hemivar.bounds.trace_bounds import TraceBounds, body_constants
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError, ProblemError
from hemivar.fem.discretize import discretize
from hemivar.fem.stress_stiffness import refuse_stiffening
from hemivar.fem.transfer import interpolate
from hemivar.mechanics.statement import ContactProblem, expect_body, refuse_areas
from hemivar.solvers import Controls, Solution, Solver, Status, solve
from hemivar.systems.workspace import Workspace

__all__ = ["AdaptOptions", "AdaptiveLevel", "AdaptiveSolution", "solve_adaptive", "solving_adaptive"]

#: Bytes for each cell at the peak of bounding the distance, measured and rounded upwards.
_BYTES = {2: 6e3, 3: 3e4}
#: Cells of the first mesh that is refined where it is asked to, at least: coarser ones are refined everywhere.
_FEW = {2: 32, 3: 48}
#: Ends by a limit.
_LIMITS = (AdaptiveEnd.MAX_UNKNOWNS, AdaptiveEnd.MAX_TIME, AdaptiveEnd.MAX_MEMORY)


@dataclass(frozen=True, eq=False)
class AdaptiveLevel:
    """One mesh of an adaptive solve.

    Attributes
    ----------
    solution : Solution
    distance : ExactDistance
        To every solution of the continuous problem.
    indicator : array, shape (M,)
        What each cell adds to the square of the bound, in units of energy; with a goal to its error, in its units.
    seconds : float
        Since the beginning.
    goal : GoalValue or None
        The quantity of interest.
    """

    solution: Solution
    distance: ExactDistance
    indicator: Array
    seconds: float
    goal: GoalValue | None = None

    __repr__ = brief

    @property
    def problem(self) -> DiscreteProblem:
        """The problem on this mesh."""
        return self.solution.problem

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return self.solution.problem.unknowns

    @property
    def guaranteed(self) -> bool:
        """Whether what is asked for is bounded on this mesh, and not estimated."""
        return self.distance.guaranteed if self.goal is None else self.goal.guaranteed

    @property
    def relative(self) -> float:
        """Relative bound of the distance; with a goal half its interval over its value."""
        return self.distance.relative if self.goal is None else self.goal.relative

    def estimated(self, rtol: float) -> bool:
        """Whether there is a goal and its estimate is within rtol, whatever is guaranteed."""
        return self.goal is not None and self.goal.estimated <= rtol

    def needed(self, rtol: float) -> float:
        """Unknowns from which on the interval of a goal is expected to be guaranteed within rtol; inf if it is none.

        It shrinks with the energy norm of the error: in d dimensions as the power -1/d of the unknowns.
        """
        if self.goal is None or not (self.goal.guaranteed and math.isfinite(self.goal.relative)):
            return math.inf
        return self.unknowns * max(self.goal.relative / rtol, 1.0) ** self.distance.stress.data.table.dim

    def row(self) -> dict[str, float]:
        """Numbers of the mesh, see :meth:`AdaptiveSolution.rows`."""
        distance, goal = self.distance, self.goal
        row = {
            "unknowns": self.unknowns,
            "cells": len(distance.cells),
            "energy": self.solution.energy,
            "relative_bound": distance.relative,
            "guaranteed": float(distance.guaranteed),
            **{
                name: distance.over_norm(getattr(distance.parts, name))
                for name in ("misfit", "contact", "oscillation", "algebraic")
            },
            "c": distance.constant,
        }
        if goal is not None:
            for number, label in enumerate(goal.goal.labels):
                for name in ("computed", "lower", "upper", "corrected", "spread"):
                    row[f"{name}_{label}"] = float(getattr(goal, name)[number])
        return {**row, "seconds": self.seconds}


@dataclass(frozen=True, eq=False)
class AdaptiveSolution(ReprMixin):
    """Solutions on finer and finer meshes, with their distances to the exact one.

    Attributes
    ----------
    levels : tuple of AdaptiveLevel
        From the first mesh to the last that was finished.
    rtol : float
        The relative distance that was asked for; with a goal its relative error.
    ended : AdaptiveEnd
        ``"reached"``, or how else it ended.
    note : str
        More about the end.
    """

    levels: tuple[AdaptiveLevel, ...]
    rtol: float
    ended: AdaptiveEnd
    note: str = ""

    @property
    def solution(self) -> Solution:
        """That on the last mesh."""
        return self.levels[-1].solution

    @property
    def distance(self) -> ExactDistance:
        """Of the last solution."""
        return self.levels[-1].distance

    @property
    def goal(self) -> GoalValue | None:
        """The quantity of interest on the last mesh."""
        return self.levels[-1].goal

    @property
    def reached(self) -> bool:
        """Whether what was asked for is guaranteed, up to rounding and the rules of integration."""
        return self.ended is AdaptiveEnd.REACHED

    @property
    def remedy(self) -> str:
        """What the end means, and what to try."""
        return f"{self.ended.remedy}{f' ({self.note})' if self.note else ''}"

    @property
    def rate(self) -> float:
        """Order of the bound in the number of unknowns, by a fit over the second half of the meshes; nan for one.

        With a goal that of the spread of its estimate."""
        last = self.levels[len(self.levels) // 2 :]
        n = np.log([level.unknowns for level in last])
        off = [level.distance.distance if level.goal is None else float(np.hypot.reduce(level.goal.spread))
               for level in last]  # fmt: skip
        bound = np.array(off)
        if len(last) < 2 or not np.isfinite(bound).all() or not bound.all():
            return math.nan
        return float(-np.polyfit(n, np.log(bound), 1)[0])

    def rows(self) -> ResultRows:
        """A row for each mesh: unknowns, energy, relative bound and its parts (in units of ``|u|_a``), c, seconds.

        With a goal also, for each component, its value, interval, corrected value and the spread of that.
        """
        rows = [level.row() for level in self.levels]
        return ResultRows(tuple(Column(name, [row[name] for row in rows], name) for name in rows[0]))

    def record(self) -> Record:
        """Plain numbers and strings for JSON: how it ended, every mesh and the goal; what is not finite is null."""
        return {
            "ended": self.ended.value,
            "remedy": self.remedy,
            "rtol": self.rtol,
            "guaranteed": self.levels[-1].guaranteed,
            "reasons": list(self.distance.reasons if self.goal is None else self.goal.reasons),
            "rate": plain(self.rate),
            "levels": plain(self.rows()[:]),
            "goal": None if self.goal is None else self.goal.record(),
        }

    def __repr__(self) -> str:
        last = self.levels[-1]
        kind = "bound" if last.distance.guaranteed else "estimate"
        what = "" if last.goal is None else f", {last.goal.goal} within {last.goal.relative:.3g}"
        return (
            f"AdaptiveSolution({self.ended} after {len(self.levels)} meshes, {last.unknowns} unknowns, relative {kind} "
            f"of the distance {last.distance.relative:.3g}{what}, asked for {self.rtol:g})"
        )


@dataclass(frozen=True)
class AdaptOptions:
    """How to solve adaptively; see :func:`solve_adaptive`.

    Parameters
    ----------
    rtol : float
        Relative distance in the energy norm to the exact solution, ``|u - u_h|_a <= rtol |u_h|_a``; with a goal its
        relative error.
    goal : Goal or str, optional
        A quantity of interest, such as ``"contact.bottom.force"`` (:func:`hemivar.bounds.goal_named`): cells are marked
        by what they add to its error, and it ends where the guaranteed interval of this quantity is within rtol of its
        size; with ``"estimated"`` where only the estimate is, and no mesh within the limits would make the interval so.
    share : float
        Part of the sum of the indicators that the marked cells hold.
    max_unknowns : int
        No finer mesh is made beyond.
    max_time : float
        Seconds; the current mesh is finished, and none is begun that would not be ready in time, as far as the one
        before tells.
    max_memory : float
        Bytes; no mesh is begun that is predicted to need more, or more than is free.
    method : Solver or str, optional
        For every mesh, or its name; chosen by its size by default.
    controls : Controls
        Of every solve.

    Raises
    ------
    ProblemError
        A number is not positive, or the share more than 1.
    """

    rtol: float = 0.01
    goal: Goal | str | None = None
    share: float = 0.5
    max_unknowns: int = 300_000
    max_time: float = math.inf
    max_memory: float = math.inf
    method: Solver | str | None = None
    controls: Controls = field(default_factory=Controls)

    def __post_init__(self) -> None:
        for name in ("rtol", "share", "max_time", "max_memory", "max_unknowns"):
            value = getattr(self, name)
            if not number(value, name, "give a positive number") > 0.0:
                raise ProblemError(f"{name} = {value}; give a positive number")
        if self.share > 1.0:
            raise ProblemError(f"share = {self.share}; give the share of the error in the marked cells, at most 1")


@known_keywords
@showing_options(AdaptOptions)
def solve_adaptive(problem: ContactProblem | ManufacturedProblem, **options: object) -> AdaptiveSolution:
    """Refine the mesh where it is needed until a solution is known to be near to the exact one.

    Parameters
    ----------
    problem : ContactProblem
        With linear elements, or quadratic ones in the plane, on the mesh to begin with.
    **options

    Returns
    -------
    AdaptiveSolution
        Always; ``ended`` says whether it was reached, ``remedy`` what to do where it was not.

    Raises
    ------
    ProblemError
        Elements are quadratic in space, no distance to an exact solution is known for the problem, or it has no such
        goal.
    """
    return result_of(solving_adaptive(problem, AdaptOptions(**options)))  # type: ignore[arg-type]


def solving_adaptive(
    problem: ContactProblem | ManufacturedProblem, options: AdaptOptions
) -> Generator[AdaptiveLevel, bool | None, AdaptiveSolution]:
    """:func:`solve_adaptive` mesh by mesh: yields each, ends after it if it is sent True.

    An interruption ends it with the meshes that were finished, if there are any.
    """
    began = time.perf_counter()
    rtol, (problem, wanted) = options.rtol, _checked(problem, options.goal)
    levels: list[AdaptiveLevel] = []
    constants: TraceBounds | None = None
    refused = ""
    while True:
        try:
            started = time.perf_counter()
            discrete, workspace = discretize(problem), Workspace()
            if constants is None:
                constants = body_constants(discrete, workspace)
                started = time.perf_counter()
            initial = None if not levels else _initial(levels[-1].solution, discrete)
            solution = solve(discrete, options.method, options.controls, initial=initial, workspace=workspace)
            workspace.forget()
            if levels and solution.status in (Status.INTERRUPTED, Status.OUT_OF_MEMORY):
                ended = AdaptiveEnd.of(solution.status)
                break
            distance = exact_distance(problem, solution.displacement, constants)
            value = None if wanted is None else goal_value(wanted, solution, distance, constants)
            indicator = distance.added(constants) if value is None else value.indicator
            now = time.perf_counter()
            levels.append(AdaptiveLevel(solution, distance, indicator, now - began, value))
            stop = yield levels[-1]
            last = _ended(levels[-1], rtol, stop, options.max_unknowns)
            if last is not None:
                ended = last
                break
            indicator = distance.added(constants) if levels[-1].estimated(rtol) else levels[-1].indicator
            mesh = refined_alike(problem, largest_share(indicator, options.share))
            grown = mesh.number_of_cells / problem.mesh.number_of_cells
            if time.perf_counter() - began + grown * (now - started) > options.max_time:
                ended = AdaptiveEnd.MAX_TIME
                break
            needed = _BYTES[mesh.dim] * mesh.number_of_cells * (1.0 if wanted is None else 2.0)
            if refused := _too_large(needed, options.max_memory):
                ended = AdaptiveEnd.MAX_MEMORY
                break
            problem = replace(problem, mesh=mesh)
        except KeyboardInterrupt:
            if not levels:
                raise
            ended = AdaptiveEnd.INTERRUPTED
            break
        except MemoryError:
            if not levels:
                raise
            ended, refused = AdaptiveEnd.MAX_MEMORY, "memory ran out on the next mesh"
            break
        except (MethodError, ProblemError, np.linalg.LinAlgError, ArithmeticError, RuntimeError) as error:
            if not levels:
                raise
            ended, refused = AdaptiveEnd.NO_BOUND, f"on the next mesh: {error}"
            break
    status = levels[-1].solution.status
    note = refused if status is Status.CONVERGED else f"{status.value}: {status.remedy}"
    if ended in _LIMITS and levels[-1].estimated(rtol):
        ended = AdaptiveEnd.ESTIMATED
    if ended is AdaptiveEnd.ESTIMATED and levels[-1].goal is not None:
        note = _interval(levels[-1], rtol)
    elif ended is AdaptiveEnd.ESTIMATED and levels[-1].distance.conditions:
        note = f"it is at most that if {' and '.join(levels[-1].distance.conditions)}"
    return AdaptiveSolution(tuple(levels), rtol, ended, note)


def _checked(
    problem: ContactProblem | ManufacturedProblem, goal: Goal | str | None
) -> tuple[ContactProblem, Goal | None]:
    """The problem on a mesh that is fine enough to begin with, and the goal."""
    remedy = "give a ContactProblem; hemivar.read_problem(path) reads one from a file"
    problem = expect_body(problem, "what to solve adaptively", remedy)
    refuse_areas(problem, "an adaptive solve")
    refuse_stiffening(problem, "an adaptive solve")
    if problem.order != 1 and problem.mesh.dim != 2:
        raise ProblemError(
            "in 3D the distance to the exact solution is bounded for linear elements only; use order = 1"
        )
    wanted = goal_named(problem, goal) if isinstance(goal, str) else goal
    if wanted is not None:
        remedy = "name it as in 'contact.bottom.force'"
        wanted = goal_named(problem, expect(wanted, Goal, "a goal", remedy).name)
        if problem.order != 1:
            raise ProblemError(
                "quantities of interest are bounded for linear elements only; use order = 1, or leave the goal out"
            )
        refuse_touching(problem)
        if not problem.material.linear:
            raise ProblemError(
                "quantities of interest are bounded for linear materials only; leave the goal out to bound the "
                "distance to the exact solution"
            )
    while problem.mesh.number_of_cells < _FEW[problem.mesh.dim]:
        problem = replace(problem, mesh=problem.mesh.refined())
    return problem, wanted


def _ended(level: AdaptiveLevel, rtol: float, stop: bool | None, max_unknowns: int) -> AdaptiveEnd | None:
    """Why this mesh is the last, if it is."""
    goal = level.goal
    if level.solution.status is not Status.CONVERGED:
        return AdaptiveEnd.of(level.solution.status)
    if level.relative <= rtol:
        return AdaptiveEnd.REACHED if level.guaranteed else AdaptiveEnd.ESTIMATED
    if level.estimated(rtol) and not level.needed(rtol) <= max_unknowns:
        return AdaptiveEnd.ESTIMATED
    if stop:
        return AdaptiveEnd.STOPPED
    if not math.isfinite(level.distance.distance) and goal is None:
        return AdaptiveEnd.NO_BOUND
    bound = level.distance
    if goal is None and bound.parts.algebraic > max(rtol * bound.energy_norm, SAME * bound.distance):
        return AdaptiveEnd.ALGEBRAIC
    return AdaptiveEnd.MAX_UNKNOWNS if level.unknowns > max_unknowns else None


def _interval(level: AdaptiveLevel, rtol: float) -> str:
    """How wide the guaranteed interval of a goal is that is only estimated to be as asked, and what would mend that."""
    if not math.isfinite(level.needed(rtol)):
        return "no interval is guaranteed, see the reasons"
    wide, asked = rounded_up(100.0 * level.relative, 2), f"{100.0 * rtol:.3g}"
    return (
        f"the guaranteed interval is within {wide} % of the value; within {asked} % takes about "
        f"{rounded_up(level.needed(rtol), 2)} unknowns: raise max_unknowns, "
        "max_time or max_memory, or take a larger rtol"
    )


def _too_large(needed: float, most: float) -> str:
    """What a mesh needs, in words, where that is too much; empty where it is not."""
    free = available_bytes()
    limit = min(most, math.inf if free is None else free)
    if needed <= limit:
        return ""
    return f"the next mesh needs about {size_in_words(needed)}, and {size_in_words(limit)} may be taken"


def _initial(solution: Solution, finer: DiscreteProblem) -> Array:
    """Unknowns of the displacement on the mesh before."""
    before, after = solution.problem.field, finer.field
    assert before is not None
    assert after is not None
    return after.restrict(interpolate(before, solution.displacement, after))
