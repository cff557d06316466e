"""Solve, bound, mark, refine: until the distance to the exact solution is what was asked for.

Every mesh is one of :meth:`hemivar.Mesh.refined_where`, and its problem an ordinary one, started from the solution on
the mesh before.  Cells are marked by Doerfler's rule: the fewest that hold a share of the sum of

    eta_T^2 + |xi - zeta|_F^2 / Lambda + G_F,

what a cell and its contact facets add to the bound (:mod:`hemivar.adapt.exact_distance`).
"""

from __future__ import annotations

import math
import time
from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np

from hemivar.adapt.exact_distance import ExactDistance, exact_distance
from hemivar.adapt.trace_bounds import TraceBounds, discrete_trace_bounds, guaranteed_trace_bounds
from hemivar.basics.arguments import expect, number
from hemivar.basics.generators import result_of
from hemivar.basics.types import Array, BoolArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.fem.transfer import interpolate
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers import Controls, Solution, Solver, Status, solve
from hemivar.systems.workspace import Workspace

__all__ = ["AdaptiveLevel", "AdaptiveSolution", "solve_adaptive", "solving_adaptive"]

#: Cells of the first mesh that is refined where it is asked to, at least: coarser ones are refined everywhere.
_FEW = {2: 32, 3: 48}


@dataclass(frozen=True, eq=False)
class AdaptiveLevel:
    """One mesh of an adaptive solve.

    Attributes
    ----------
    solution : Solution
    distance : ExactDistance
        To every solution of the continuous problem.
    indicator : array, shape (M,)
        What each cell adds to the square of the bound, in units of energy.
    seconds : float
        Since the beginning.
    """

    solution: Solution
    distance: ExactDistance
    indicator: Array
    seconds: float

    @property
    def problem(self) -> DiscreteProblem:
        """The problem on this mesh."""
        return self.solution.problem

    @property
    def unknowns(self) -> int:
        """Number of unknowns n."""
        return self.solution.problem.unknowns


@dataclass(frozen=True, eq=False)
class AdaptiveSolution:
    """Solutions on finer and finer meshes, with their distances to the exact one.

    Attributes
    ----------
    levels : tuple of AdaptiveLevel
        From the first mesh to the last.
    rtol : float
        The relative distance that was asked for.
    ended : str
        ``"reached"``, or why it was not: ``"max_unknowns"``, ``"max_time"``, ``"no bound"``, ``"stopped"``, or the
        status of a solve that did not converge.
    """

    levels: tuple[AdaptiveLevel, ...]
    rtol: float
    ended: str

    @property
    def solution(self) -> Solution:
        """That on the last mesh."""
        return self.levels[-1].solution

    @property
    def distance(self) -> ExactDistance:
        """Of the last solution."""
        return self.levels[-1].distance

    @property
    def reached(self) -> bool:
        """Whether the distance is what was asked for."""
        return self.ended == "reached"

    @property
    def rate(self) -> float:
        """Order of the bound in the number of unknowns, by a fit over the second half of the meshes; nan for one."""
        last = self.levels[len(self.levels) // 2 :]
        n = np.log([level.unknowns for level in last])
        bound = np.array([level.distance.distance for level in last])
        if len(last) < 2 or not np.isfinite(bound).all() or not bound.all():
            return math.nan
        return float(-np.polyfit(n, np.log(bound), 1)[0])

    def rows(self) -> list[dict[str, float]]:
        """A row for each mesh: unknowns, energy, relative bound and its parts (in units of ``|u|_a``), c, seconds."""
        return [
            {
                "unknowns": level.unknowns,
                "cells": len(level.distance.cells),
                "energy": level.solution.energy,
                "relative_bound": level.distance.relative,
                **{
                    name: getattr(level.distance.parts, name) / level.distance.energy_norm
                    for name in ("misfit", "contact", "oscillation", "algebraic")
                },
                "c": level.distance.constant,
                "seconds": level.seconds,
            }
            for level in self.levels
        ]

    def __repr__(self) -> str:
        last = self.levels[-1]
        kind = "bound" if last.distance.guaranteed else "estimate"
        return (
            f"AdaptiveSolution({self.ended} after {len(self.levels)} meshes, {last.unknowns} unknowns, relative {kind} "
            f"of the distance {last.distance.relative:.3g}, asked for {self.rtol:g})"
        )


def solve_adaptive(problem: ContactProblem, *, rtol: float = 0.01, **options: object) -> AdaptiveSolution:
    """Refine the mesh where it is needed until a solution is known to be near to the exact one.

    Parameters
    ----------
    problem : ContactProblem
        With linear elements, or quadratic ones in the plane, on the mesh to begin with.
    rtol : float
        Relative distance in the energy norm to the exact solution, ``|u - u_h|_a <= rtol |u_h|_a``.
    **options
        Those of :func:`solving_adaptive`.

    Returns
    -------
    AdaptiveSolution
        Always; ``ended`` says whether the distance was reached.

    Raises
    ------
    ProblemError
        Elements are quadratic in space, or no distance to an exact solution is known for the problem.
    """
    return result_of(solving_adaptive(problem, rtol=rtol, **options))  # type: ignore[arg-type]


def solving_adaptive(
    problem: ContactProblem,
    *,
    rtol: float = 0.01,
    share: float = 0.5,
    max_unknowns: int = 300_000,
    max_time: float = math.inf,
    solver: Solver | None = None,
    controls: Controls | None = None,
) -> Generator[AdaptiveLevel, bool | None, AdaptiveSolution]:
    """:func:`solve_adaptive` mesh by mesh: yields each, ends after it if it is sent True.

    Parameters
    ----------
    problem : ContactProblem
    rtol : float
    share : float
        Part of the sum of the indicators that the marked cells hold.
    max_unknowns : int
        No finer mesh is made beyond.
    max_time : float
        Seconds; the mesh at hand is finished.
    solver : Solver, optional
        For every mesh; chosen by its size by default.
    controls : Controls, optional
    """
    began = time.perf_counter()
    remedy = "give a ContactProblem; hemivar.read_problem(path) reads one from a file"
    expect(problem, ContactProblem, "what to solve adaptively", remedy)
    for name, value, least in (("rtol", rtol, 0.0), ("share", share, 0.0), ("max_time", max_time, 0.0)):
        if not number(value, name, "give a positive number") > least:
            raise ProblemError(f"{name} = {value}; give a positive number")
    if share > 1.0:
        raise ProblemError(f"share = {share}; the marked cells hold a part of the whole: give a number up to 1")
    if problem.order != 1 and problem.mesh.dim != 2:
        raise ProblemError("distances to the exact solution are bounded for linear elements in space; take order = 1")
    while problem.mesh.number_of_cells < _FEW[problem.mesh.dim]:
        problem = replace(problem, mesh=problem.mesh.refined())
    levels: list[AdaptiveLevel] = []
    constants: TraceBounds | None = None
    while True:
        discrete, workspace = discretize(problem), Workspace()
        if constants is None:
            constants = _constants(problem, discrete, workspace)
        initial = None if not levels else _started(levels[-1].solution, discrete)
        solution = solve(discrete, solver, controls, initial=initial, workspace=workspace)
        distance = exact_distance(problem, solution.displacement, constants)
        seconds = time.perf_counter() - began
        levels.append(AdaptiveLevel(solution, distance, _indicator(distance, constants), seconds))
        told = yield levels[-1]
        ended = _ended(levels[-1], rtol, told, max_unknowns, max_time)
        if ended is not None:
            return AdaptiveSolution(tuple(levels), rtol, ended)
        problem = replace(problem, mesh=problem.mesh.refined_where(_marked(levels[-1].indicator, share)))


def _ended(level: AdaptiveLevel, rtol: float, told: bool | None, max_unknowns: int, max_time: float) -> str | None:
    """Why this mesh is the last, if it is."""
    if level.solution.status is not Status.CONVERGED:
        return str(level.solution.status.value)
    if level.distance.relative <= rtol:
        return "reached"
    if told:
        return "stopped"
    if not math.isfinite(level.distance.distance):
        return "no bound"
    if level.seconds > max_time:
        return "max_time"
    return "max_unknowns" if level.unknowns > max_unknowns else None


def _constants(problem: ContactProblem, discrete: DiscreteProblem, workspace: Workspace) -> TraceBounds:
    """Guaranteed constants of the contact boundary; where there are none those of the discrete problem."""
    known = discrete_trace_bounds(discrete, workspace)
    if not problem.contact:
        return replace(known, guaranteed=True)
    if known.both == 0.0:
        return known
    try:
        return guaranteed_trace_bounds(discrete, workspace)
    except ProblemError as error:
        return replace(known, source=f"{known.source} ({error})")


def _started(solution: Solution, finer: DiscreteProblem) -> Array:
    """Unknowns of the displacement on the mesh before."""
    before, after = solution.problem.field, finer.field
    assert before is not None
    assert after is not None
    return after.restrict(interpolate(before, solution.displacement, after))


def _indicator(distance: ExactDistance, constants: TraceBounds) -> Array:
    """What each cell adds, (M,)."""
    found = distance.cells.copy()
    table = distance.stress.data.table
    if len(distance.facets) and 0.0 < constants.both < np.inf:
        owner = table.owners[table.numbers(distance.facets), 0]
        np.add.at(found, owner, distance.facet_contact / constants.both + distance.facet_gap)
    return found


def _marked(indicator: Array, share: float) -> BoolArray:
    """The fewest cells that hold a share of the sum."""
    order = np.argsort(-indicator, kind="stable")
    held = np.cumsum(indicator[order])
    count = int(np.searchsorted(held, share * held[-1])) + 1
    marked = np.zeros(len(indicator), dtype=bool)
    marked[order[:count]] = True
    return marked
