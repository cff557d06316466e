"""Whether two states lie on one branch of solutions: a solve from one of them leads to the other."""

from __future__ import annotations

import numpy as np

from hemivar.laws.vector_law import softens
from hemivar.solvers.controls import Controls
from hemivar.solvers.solution import Solution
from hemivar.solvers.solve import default_method, solve
from hemivar.systems.workspace import Workspace

__all__ = ["on_one_branch"]

#: Part of the largest displacement up to which two states are the same.
_SAME = 1e-5


def on_one_branch(one: Solution, other: Solution, workspace: Workspace, controls: Controls | None = None) -> bool:
    """Whether solutions for two neighbouring numbers of a statement lead downhill to each other.

    They do not where the state jumps between the two, either way.  Where no force can fall there is one branch; on
    meshes of different sizes nothing is known, and True is returned.
    """
    if not (softens(one.problem.law) or softens(other.problem.law)) or one.unknowns.shape != other.unknowns.shape:
        return True
    return _leads(one, other, workspace, controls) and _leads(other, one, workspace, controls)


def _leads(begin: Solution, end: Solution, workspace: Workspace, controls: Controls | None) -> bool:
    """Whether the way downhill from one state, under the load of the other, ends at the other."""
    method = default_method(end.problem, workspace).local_descent()
    reached = solve(end.problem, method, controls, initial=begin, workspace=workspace)
    missed = float(np.abs(reached.unknowns - end.unknowns).max(initial=0.0))
    return missed <= _SAME * float(np.abs(end.unknowns).max(initial=0.0))
