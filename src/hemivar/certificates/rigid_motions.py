"""Which rigid motions take a minimiser of a convex energy to another one.

Let the law be convex and u a minimiser. Along the way to another minimiser the energy is constant, and convex in each
of its parts, so that the difference z deforms nothing: ``a(z, z) = 0``. As the loads balance the multipliers on rigid
motions,

    E(u + z) - E(u) = sum_j w_j [ j(r_j + B_j z) - j(r_j) - lambda_j . B_j z ],      each term >= 0,

the minimisers are u + z with ``lambda_j`` in ``dj(r_j + B_j z)`` at every contact point: a polyhedron of rigid motions.
It is z = 0 alone exactly if the cone of its directions at 0 is. Along the normal, and in each principal direction of
the friction, a way is barred where the multiplier lies inside of its interval, and where the law is curved.  So the
cone is ``{z : no barred way is gone}``, and a linear programme in a handful of unknowns decides whether it is zero.

What is near to an end of its interval counts as not barred: uniqueness is claimed where it does not hang on rounding.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.arrays import COUNTS
from hemivar.basics.types import Array, BoolArray
from hemivar.certificates.bound import Point
from hemivar.certificates.linear_bodies import below
from hemivar.discrete.free_motion import describe
from hemivar.discrete.held_at_rest import geometric_slack
from hemivar.discrete.recession import Coercivity, RecessionFunction, decide
from hemivar.laws.sides import Sides
from hemivar.systems.free_unknowns import free_unknowns

__all__ = ["motion_left"]

#: Curvature of a law that bars the way, over the stiffness that the body has at the contact point.
_CURVED = 1e-7
#: The same for friction: slips many times larger than what it does to the body have a direction that is not known well.
_TURNED = 1e-3
_NONE = np.zeros(0, dtype=bool)


def motion_left(point: Point, tolerance: float) -> str | None:
    """The rigid motion by which other minimisers of a convex energy may differ from this one, in words.

    Empty if there is none, so that the minimiser is the only one; None where the motions of the body are not known.
    The pair is a minimiser up to a ``tolerance`` relative to the load.
    """
    problem = point.problem
    if not problem.vectors.alone:
        return None
    free = free_unknowns(below(problem))
    if free is None or problem.field is None:
        return None
    m, d = problem.contact_points, problem.contact.components
    local = np.asarray(problem.contact.trace @ free).reshape(m, d, free.shape[1])
    near = max(COUNTS, 10.0 * tolerance)
    slack = max(near, geometric_slack(problem.contact.points, problem.contact.weights))
    barred = _barred(point, near) if m else []
    for group in problem.model.free_motions.groups:
        rows = [np.einsum("kc,kca->ka", sides.axis, local[sides.point][:, :, group.columns]) for sides, _, _ in barred]
        count = group.columns.stop - group.columns.start
        up, down = (np.where(np.concatenate([_NONE, *(one[i] for one in barred)]), np.inf, 0.0) for i in (1, 2))
        every, slips = np.concatenate([np.zeros((0, count)), *rows]), np.zeros((0, 2, count))
        growth = decide(RecessionFunction(np.zeros(count), 0.0, every, up, down, slips, np.zeros(0), slack))
        if growth.verdict is Coercivity.HELD:
            continue
        if growth.direction is None:
            return None
        moved = group.coefficients @ growth.direction
        return describe(moved[int(np.argmax(np.linalg.norm(moved, axis=1)))])
    return ""


def _barred(point: Point, near: float) -> list[tuple[Sides, BoolArray, BoolArray]]:
    """Directions of contact points, and whether the way along them and against them costs energy."""
    problem, tau = point.problem, point.compliance
    slack = max(near * float(np.abs(point.lam).max(initial=0.0)), float(np.finfo(float).tiny))
    r = problem.local(point.u)
    law = point.law(r, point.lam)
    r = np.where(point.active, law.fitted(r, point.lam, tau), 0.0)
    still = np.linalg.norm(r[:, 1:], axis=1) <= near * float(np.abs(r).max(initial=0.0))
    r[still, 1:] = 0.0
    normal, *others = law.sides(r, point.lam, point.active, tau, slack)
    barred = [(normal, *_ways(normal, tau[normal.point, 0], slack, _CURVED))]
    for sides in others:
        up, down = _ways(sides, tau[sides.point, 1], slack, _TURNED)
        barred.append((sides, up & down, up & down))  # at rest an axis does not tell which way is barred
    return barred


def _ways(sides: Sides, tau: Array, slack: float, curved: float) -> tuple[BoolArray, BoolArray]:
    with np.errstate(invalid="ignore"):
        up = (sides.above - sides.multiplier > slack) | (sides.curvature_above * tau > curved)
        down = (sides.multiplier - sides.below > slack) | (sides.curvature_below * tau > curved)
    return np.asarray(up), np.asarray(down)
