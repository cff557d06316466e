"""All solutions of a problem, and the path of its equilibria while the load grows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from hemivar.branches import Path, SolutionSet, find_solutions, follow_path
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem import LoadLine
from hemivar.fem.posed import posed
from hemivar.mechanics import ContactProblem
from hemivar.solvers import Controls
from hemivar.workflows.events import Found, Warned, Work

__all__ = ["PathOptions", "SolutionsOptions", "path", "solutions"]


@dataclass(frozen=True)
class SolutionsOptions:
    """How far to search; see :func:`hemivar.find_solutions`."""

    starts: int = 40
    max_solutions: int = 100
    seed: int = 0
    controls: Controls = field(default_factory=Controls)


@dataclass(frozen=True)
class PathOptions:
    """How far to follow; see :func:`hemivar.follow_path`."""

    load_factor: tuple[float, float] = (0.0, 1.0)
    max_points: int = 2000
    max_time: float = math.inf


def solutions(problem: DiscreteProblem | ContactProblem, options: SolutionsOptions | None = None) -> Work[SolutionSet]:
    """All solutions that can be found.

    Yields :class:`Warned`, and when the search is over :class:`Found` for every solution, by their energy.  An
    interruption ends the search with what was found.

    Raises
    ------
    ProblemError
        As :func:`hemivar.find_solutions`.
    """
    options = SolutionsOptions() if options is None else options
    problem = posed(problem, "solutions")
    for warning in problem.warnings:
        yield Warned(warning)
    found = find_solutions(
        problem,
        starts=options.starts,
        max_solutions=options.max_solutions,
        seed=options.seed,
        controls=options.controls,
    )
    for solution in found:
        yield Found(solution)
    return found


def path(problem: DiscreteProblem | ContactProblem, options: PathOptions | None = None) -> Work[Path]:
    """The equilibria while all loads grow, with the prescribed displacements if a statement is given.

    Yields :class:`Warned`.  An interruption ends the path where it is.

    Raises
    ------
    ProblemError, MethodError
        As :func:`hemivar.follow_path`.
    """
    options = PathOptions() if options is None else options
    line = LoadLine.of(problem) if isinstance(problem, ContactProblem) else LoadLine(posed(problem, "path"))
    for warning in line.loaded.warnings:
        yield Warned(warning)
    return follow_path(
        line.loaded,
        options.load_factor,
        unloaded=line.unloaded,
        max_points=options.max_points,
        max_time=options.max_time,
    )
