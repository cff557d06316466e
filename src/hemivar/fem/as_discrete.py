"""Discrete problems where a function is given the statement of one."""

from __future__ import annotations

from hemivar.basics.arguments import described
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.discretize import discretize
from hemivar.fem.stress_stiffness import refuse_stiffening
from hemivar.mechanics.statement import ContactProblem

__all__ = ["ProblemLike", "as_discrete"]

#: What can be done with a body that the stress of its load stiffens, under the names of functions.
_STIFFENED = ("solve", "solve_nested", "run", "certify", "load_bracket")
#: What a discrete problem can be made of.
ProblemLike = DiscreteProblem | ContactProblem | ManufacturedProblem


def as_discrete(problem: ProblemLike, function: str) -> DiscreteProblem:
    """The problem, discretised if it is not yet."""
    given = ManufacturedProblem.of(problem)
    if function not in _STIFFENED:
        refuse_stiffening(given, function)
    if isinstance(given, DiscreteProblem):
        return given
    if isinstance(given, ContactProblem):
        return discretize(given)
    raise ProblemError(
        f"{function}: the problem is {described(given)}; give a ContactProblem, what hemivar.discretize makes of it, "
        "or what hemivar.read_problem reads from a file"
    )
