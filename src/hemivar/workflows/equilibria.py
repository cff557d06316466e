"""All solutions of a problem, the path of its equilibria while the load grows, and the limit load."""

from __future__ import annotations

from hemivar.basics.arguments import expecting
from hemivar.branches import LoadBracket, Path, PathOptions, PathProgress, SearchProgress, SolutionSet, SolutionsOptions
from hemivar.branches.bracket import BracketOptions, bracketing
from hemivar.branches.follow import following
from hemivar.branches.solutions import finding
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.fem.growing import growing
from hemivar.solvers.load_stepping import Reached
from hemivar.workflows.events import FoundEvent, WarningEvent, Work

__all__ = [
    "BracketOptions",
    "PathOptions",
    "PathProgress",
    "Reached",
    "SearchProgress",
    "SolutionsOptions",
    "bracket",
    "path",
    "solutions",
]


@expecting(options=SolutionsOptions)
def solutions(problem: ProblemLike, options: SolutionsOptions | None = None) -> Work[SolutionSet]:
    """All solutions that can be found.

    Yields :class:`WarningEvent`, every start, and when the search is over :class:`FoundEvent` for every solution, by
    their energy.  An interruption ends the search with what was found.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
    options : SolutionsOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`SolutionSet`.

    Raises
    ------
    ProblemError
        As :func:`hemivar.find_solutions`.
    """
    options = SolutionsOptions() if options is None else options
    problem = as_discrete(problem, "solutions")
    for warning in problem.notes:
        yield WarningEvent(warning)
    result = yield from finding(problem, options)
    for solution in result:
        yield FoundEvent(solution)
    return result


@expecting(options=PathOptions)
def path(problem: ProblemLike, options: PathOptions | None = None) -> Work[Path]:
    """The equilibria while the loads grow, with the displacements that a statement prescribes.

    Yields :class:`WarningEvent`, and every point.  An interruption ends the path where it is.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
    options : PathOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`Path`.

    Raises
    ------
    ProblemError, MethodError
        As :func:`hemivar.follow_path`.
    """
    options = PathOptions() if options is None else options
    problem = growing(problem, "path", options.constant).loaded
    for warning in problem.notes:
        yield WarningEvent(warning)
    return (yield from following(problem, options))


@expecting(options=BracketOptions)
def bracket(problem: ProblemLike, options: BracketOptions | None = None) -> Work[LoadBracket]:
    """The load that a body carries, between two load factors.

    Yields every load factor, and :class:`WarningEvent` of the solution.  An interruption ends it with the bracket so
    far.

    Parameters
    ----------
    problem : DiscreteProblem or ContactProblem
    options : BracketOptions, optional

    Yields
    ------
    Event
        What happens; the generator returns a :class:`LoadBracket`.

    Raises
    ------
    ProblemError, MethodError
        As :func:`hemivar.branches.load_bracket`.
    """
    result = yield from bracketing(problem, BracketOptions() if options is None else options)
    for warning in result.solution.warnings:
        yield WarningEvent(warning)
    return result
