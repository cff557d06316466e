"""Nullspace (rigid motions) of a stiffness where mesh and supports tell it, and whether contact points notice it."""

from __future__ import annotations

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError

__all__ = ["free_unknowns", "refuse_unseen"]


def free_unknowns(problem: DiscreteProblem) -> Array | None:
    """:attr:`hemivar.discrete.Model.free_unknowns` as (n, a) numbers; of a linear body."""
    _ = problem.linear
    unknowns = problem.model.free_unknowns
    return None if unknowns is None else np.asarray(unknowns.toarray())


def refuse_unseen(problem: DiscreteProblem) -> None:
    """Refuse a body that can move without deforming and without any contact point noticing it."""
    free = free_unknowns(problem)
    if free is None or not free.shape[1]:
        return
    seen = (
        np.linalg.qr(problem.contact.trace @ free, mode="r") if problem.contact_points else np.zeros((0, free.shape[1]))
    )
    if np.linalg.matrix_rank(seen, tol=SAME) < free.shape[1]:
        raise ProblemError(
            "the stiffness matrix is singular: a part of the body is free to move; add a support (hv.discretize "
            "names the part unless check_coercivity=False)"
        )
