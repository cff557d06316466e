"""Discrete problems where a function is given the statement of one."""

from __future__ import annotations

from hemivar.basics.arguments import described
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.mechanics.scalar import Statement

__all__ = ["posed"]


def posed(problem: DiscreteProblem | Statement, function: str) -> DiscreteProblem:
    """The problem, discretised if it is not yet.

    Parameters
    ----------
    problem : DiscreteProblem, ContactProblem or ScalarProblem
    function : str
        Who asks, for messages.

    Raises
    ------
    ProblemError
        It is neither.
    """
    if isinstance(problem, DiscreteProblem):
        return problem
    if isinstance(problem, Statement):
        return discretize(problem)
    raise ProblemError(
        f"{function}: the problem is {described(problem)}; give a ContactProblem, what hemivar.discretize makes of it, "
        "or what hemivar.read_problem reads from a file"
    )
