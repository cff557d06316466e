"""Nested iteration (warm start): the solution on one mesh is the first guess on the next."""

from __future__ import annotations

from collections.abc import Sequence

from hemivar.basics.arguments import described, expect
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.as_discrete import ProblemLike, as_discrete
from hemivar.fem.transfer import interpolate
from hemivar.mechanics.statement import ContactProblem
from hemivar.solvers.base import Solver
from hemivar.solvers.controls import Controls
from hemivar.solvers.solution import Solution
from hemivar.solvers.solve import solve
from hemivar.solvers.status import Status
from hemivar.systems.workspace import Workspace

__all__ = ["solve_nested", "transfer_solution"]


def transfer_solution(solution: Solution, problem: DiscreteProblem) -> Array:
    """The displacement of a solution as unknowns (n,) of a problem on another mesh of the same body.

    Parameters
    ----------
    solution : Solution
    problem : DiscreteProblem

    Returns
    -------
    array

    Raises
    ------
    ProblemError
        One of the two problems has no mesh.
    """
    expect(solution, Solution, "the solution", "pass what hemivar.solve returned")
    expect(problem, DiscreteProblem, "the problem", "discretise it first, hemivar.discretize(problem)")
    source, target = solution.problem.field, problem.field
    if source is None or target is None:
        raise ProblemError("only problems on meshes can pass on their solution; give the initial guess as unknowns")
    return target.restrict(interpolate(source, solution.displacement, target))


def solve_nested(
    problems: Sequence[ProblemLike],
    method: Solver | str | None = None,
    controls: Controls | None = None,
    *,
    rtol: float | None = None,
    workspace: Workspace | None = None,
) -> list[Solution]:
    """Solve on each mesh in turn, starting from the solution on the one before (survey, section 5.2).

    Parameters
    ----------
    problems : sequence of DiscreteProblem or ContactProblem
        From coarse to fine.
    method, controls, rtol
        As in :func:`solve`, for every mesh.
    workspace : Workspace, optional
        Where factors and levels are kept, for all meshes.

    Returns
    -------
    list of Solution
        One for each mesh; the last is the one wanted.  A solve that is interrupted or runs out of memory is the last.

    Raises
    ------
    ProblemError
        The problems are no list, or there is none.
    """
    if isinstance(problems, DiscreteProblem | ContactProblem | str) or not isinstance(problems, Sequence):
        raise ProblemError(f"the problems are {described(problems)}; give a list of them, from coarse to fine")
    if not problems:
        raise ProblemError("no problem to solve: give the discrete problems from coarse to fine")
    solutions: list[Solution] = []
    for problem in (as_discrete(given, "solve_nested") for given in problems):
        guess = transfer_solution(solutions[-1], problem) if solutions else None
        solutions.append(solve(problem, method, controls, rtol=rtol, initial=guess, workspace=workspace))
        if solutions[-1].status in (Status.INTERRUPTED, Status.OUT_OF_MEMORY):
            break
    return solutions
