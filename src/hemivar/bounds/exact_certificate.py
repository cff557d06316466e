"""The distance to the exact solution as a certificate states it: never an error, but a bound or why there is none."""

from __future__ import annotations

import math
import time
from dataclasses import replace

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.hypotheses import body_shape
from hemivar.bounds.lower_bounds import lower_bounds
from hemivar.bounds.scalar_distance import scalar_distance, scalar_trace_bound
from hemivar.bounds.stated_distance import DistanceToExact
from hemivar.bounds.trace_bounds import body_constants
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import MethodError, ProblemError
from hemivar.fem.discretize import discretize
from hemivar.fem.stress_stiffness import refuse_stiffening
from hemivar.laws.vector_law import frozen_at
from hemivar.mechanics.material import Material
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace

__all__ = ["distance_to_exact", "statement_of", "trace_bound"]


def distance_to_exact(
    problem: DiscreteProblem, unknowns: Array, *, max_time: float = math.inf, workspace: Workspace | None = None
) -> DistanceToExact:
    """What is known of the distance of unknowns (n,) to every solution of the continuous problem that was stated.

    What cannot be bounded is no error: the answer says why.

    Parameters
    ----------
    problem : DiscreteProblem
        From :func:`hemivar.discretize`.
    unknowns : array, shape (n,)
    max_time : float
        Seconds; nothing is begun after them, and what has begun is finished.
    workspace : Workspace, optional
        Keeps the trace constants of the body, and what bounds need of its mesh and material.

    Returns
    -------
    DistanceToExact
    """
    began = time.perf_counter()

    def nothing(reason: str) -> DistanceToExact:
        return DistanceToExact.none(reason, time.perf_counter() - began)

    stated = problem.origin
    if problem.field is None or stated is None:
        return nothing("the problem was made of arrays, and no continuous one is known to which it belongs")
    if max_time <= 0.0:
        return nothing("the time limit was reached")
    try:
        refuse_stiffening(stated, "a bound of the distance to the exact solution")
        if not _is_stated(problem, stated, unknowns):
            return nothing("load, gap, law or stiffness are not those of the stated problem")
        if stated.kind:
            return scalar_distance(stated, problem.field.full(unknowns))
        own = None if workspace is None else Workspace.given(workspace)
        constants = body_constants(problem, Workspace() if own is None else own)
        if time.perf_counter() - began > max_time:
            return nothing("the time limit was reached")
        distance = exact_distance(stated, problem.field.full(unknowns), constants, workspace=own)
    except (ProblemError, MethodError) as error:
        return nothing(str(error))
    except MemoryError:
        return nothing("the memory did not suffice")
    except (np.linalg.LinAlgError, ArithmeticError, RuntimeError) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        return nothing(f"the numbers of the problem are beyond what its computation bears ({reason})")
    return statement_of(distance, time.perf_counter() - began)


def statement_of(distance: ExactDistance, seconds: float = 0.0) -> DistanceToExact:
    """A distance as a certificate states it."""
    parts = distance.parts
    return DistanceToExact(
        bound=distance.distance,
        relative=distance.relative,
        guaranteed=distance.guaranteed and math.isfinite(distance.distance),
        reasons=distance.reasons,
        conditions=distance.conditions if math.isfinite(distance.distance) else (),
        unique=distance.unique and math.isfinite(distance.distance),
        unseen=distance.unseen if math.isfinite(distance.distance) else "",
        loose=distance.loose if math.isfinite(distance.distance) else "",
        misfit=parts.misfit,
        contact=parts.contact,
        oscillation=parts.oscillation,
        algebraic=parts.algebraic,
        correction=parts.correction,
        gap=parts.gap,
        constant=distance.constant,
        seconds=seconds,
        above=distance.above,
        geometry=body_shape(distance.stress.data.table.mesh),
    )


def _is_stated(problem: DiscreteProblem, stated: ContactProblem, u: Array) -> bool:
    """Whether a discrete problem is that of its statement, and not one that was made of it."""
    own = discretize(stated, check_coercivity=False)
    if own.unknowns != problem.unknowns or own.contact_points != problem.contact_points:
        return False
    pairs = [(own.offset, problem.offset), (own.load, problem.load)]
    pairs.append((own.bulk.gradient(u), problem.bulk.gradient(u)))
    r = own.local(u)
    size = float(np.abs(r).max(initial=0.0))
    for factor in (1.0, 0.5, 2.0):  # laws are told apart by what they allow
        at = own.law.admissible(factor * r + (factor - 1.0) * size)
        laws = (frozen_at(own.law, at), frozen_at(problem.law, at))
        pairs.append((laws[0].nearest_multiplier(at, at), laws[1].nearest_multiplier(at, at)))
    for one, other in pairs:
        if one.shape != other.shape or np.abs(one - other).max(initial=0.0) > SAME * np.abs(one).max(initial=0.0):
            return False
    return True


def trace_bound(statement: ContactProblem, norm: Material, workspace: Workspace | None = None) -> float | None:
    """Upper bound of the c_gamma of the body of a statement, in the norm that is the energy of a material; or None."""
    try:
        if statement.kind:
            return scalar_trace_bound(statement)
        bounds = lower_bounds(replace(statement, material=norm), workspace=workspace)
    except (ProblemError, MemoryError, np.linalg.LinAlgError, RuntimeError):  # ARPACK raises the last
        return None
    return float(bounds.both.lower**-0.5)
