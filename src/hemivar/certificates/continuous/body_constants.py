"""The best trace constants of a body that can be had: guaranteed ones, else those of the discrete problem."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hemivar.certificates.continuous.trace_bounds import TraceBounds, discrete_trace_bounds, guaranteed_trace_bounds
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace

__all__ = ["body_constants"]


def body_constants(problem: DiscreteProblem, workspace: Workspace) -> TraceBounds:
    """Guaranteed constants of the contact boundary; where there are none those of the discrete problem, and why.

    Parameters
    ----------
    problem : DiscreteProblem
        From :func:`hemivar.discretize` of a body.
    workspace : Workspace
        Keeps them.

    Returns
    -------
    TraceBounds
    """
    stated = problem.origin
    known = discrete_trace_bounds(problem, workspace)
    if isinstance(stated, ContactProblem) and not stated.contact:
        return replace(known, guaranteed=True)
    if known.both == 0.0:
        return known
    try:
        return guaranteed_trace_bounds(problem, workspace)
    except (ProblemError, np.linalg.LinAlgError, RuntimeError) as error:  # ARPACK raises the last
        return replace(known, source=f"{known.source} ({error})")
