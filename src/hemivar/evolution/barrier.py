"""Energy barriers: negative curvature of an energy on the segment between two displacements.

The energy is a sum over the body and the contact points.  Along the way each point bends as its law does, which is
looked at between even places and the knots that the point passes: stiff glue softens and lets go between two of the
others.  While an equilibrium is stable and the body follows it the sum never bends downwards; between two equilibria
that are no neighbours there is a part of the way on which it does.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.arrays import CACHED, COUNTS, ROUNDED, SOLVED
from hemivar.basics.types import Array
from hemivar.discrete.problem import DiscreteProblem
from hemivar.laws import VectorLaw
from hemivar.linear.vectors import WHOLE, Vectors
from hemivar.solvers import Solution

__all__ = ["PARTS", "along", "bends_downwards", "path_bends_downwards", "second_derivatives"]

#: Even parts of the way in which the energy is looked at.
PARTS = 70
#: Contact points that are looked at together: each has PARTS second derivatives, of 9 numbers in space.
_BLOCK = CACHED // 512


def path_bends_downwards(problem: DiscreteProblem, solution: Solution, start: Array | None = None) -> bool:
    """Whether the energy bends downwards on the way to a solution, beyond rounding; see :func:`along`."""
    bends, size = along(problem, solution, start)
    return bool((bends < -ROUNDED * size).any())


def along(problem: DiscreteProblem, solution: Solution, start: Array | None = None) -> tuple[Array, float]:
    """Second derivatives of the energy on the way from unknowns zero to a solution, and their size.

    ``start (m, c)`` are the local displacements at its beginning: other ones than those of unknowns zero where gaps
    move meanwhile. A bound that depends on the state is the one of the solution.
    """
    increment, bulk, law = solution.unknowns, problem.bulk, problem.law.frozen(solution.local, solution.multiplier)
    if getattr(bulk, "lower", None) is bulk:  # it is linear
        body = np.full(PARTS, float(increment @ bulk.gradient(increment)))
    else:
        slopes = [float(increment @ bulk.gradient(part * increment)) for part in np.linspace(0.0, 1.0, PARTS + 1)]
        body = PARTS * np.diff(slopes)
    start = -problem.offset if start is None else start
    return second_derivatives(law, problem.contact.weights, start, solution.local, body, problem.vectors)


def bends_downwards(
    law: VectorLaw, weights: Array, start: Array, end: Array, body: Array, vectors: Vectors = WHOLE
) -> bool:
    """Whether an energy bends downwards between local displacements (m, c); see :func:`second_derivatives`."""
    bends, size = second_derivatives(law, weights, start, end, body, vectors)
    return bool((bends < -ROUNDED * size).any())


def second_derivatives(
    law: VectorLaw, weights: Array, start: Array, end: Array, body: Array, vectors: Vectors = WHOLE
) -> tuple[Array, float]:
    """Second derivatives of an energy along a straight way, one after another, and their size.

    ``start, end (m, c)`` are local displacements, ``weights (m,)`` those of the contact points, ``body (PARTS,)`` is
    the second derivative of the energy of the body in each of the even parts.  Where a law drops it is minus infinity.
    """
    even = np.linspace(0.0, 1.0, PARTS + 1)
    if not vectors.alone:  # points of other processes pass their knots elsewhere
        bends, drops = _of_points(law, weights, start, end, np.broadcast_to(even, (len(start), even.size)))
        own = bends.sum(axis=0)
        whole, sizes = (vectors.total(*values) for values in (body + own, np.abs(body) + np.abs(own)))
        falls = bool(vectors.largest(float(drops))[0])
        return np.where(falls, -np.inf, whole), float(sizes.max())
    places = _places(law, start, end, even)
    bends, drops = _of_points(law, weights, start, end, places)
    change = [np.diff(one, axis=1, prepend=0.0, append=0.0).ravel() for one in (body[None, :], bends)]
    at = np.concatenate([even, places.ravel()])
    order = np.argsort(at, kind="stable")
    summed = np.cumsum(np.concatenate(change)[order])[:-1][np.diff(at[order]) > ROUNDED]
    size = float(np.abs(body).max() + np.abs(bends).max(axis=1).sum())
    return np.where(drops, -np.inf, summed), size


def _places(law: VectorLaw, start: Array, end: Array, even: Array) -> Array:
    """The even places, and those at which a point passes a knot of its law, in order, (m, k)."""
    knots = law.kinks_along(start, end, np.zeros(start.shape))
    knots = np.where((knots > 0.0) & (knots < 1.0), knots, 0.0)
    return np.sort(np.concatenate([np.broadcast_to(even, (len(start), even.size)), knots], axis=1), axis=1)


def _of_points(law: VectorLaw, weights: Array, start: Array, end: Array, places: Array) -> tuple[Array, bool]:
    """The second derivative (m, k) of each point between places (m, k + 1), and whether the first one drops."""
    middle, width, increment = 0.5 * (places[:, 1:] + places[:, :-1]), np.diff(places, axis=1), end - start
    if not middle.size:
        return np.zeros(middle.shape), False
    if len(start) > _BLOCK:
        blocks = np.array_split(np.arange(len(start)), -(-len(start) // _BLOCK))
        parts = [_of_points(law.take(i), weights[i], start[i], end[i], places[i]) for i in blocks]
        return np.concatenate([one for one, _ in parts]), any(drops for _, drops in parts)
    point = np.repeat(np.arange(len(start)), middle.shape[1])
    along = increment[point]
    r, ends = start[point] + middle.reshape(-1, 1) * along, law.penetrations
    low, high = (np.broadcast_to(side, len(start))[point] for side in (ends.lower, ends.upper))
    inside, rounding = np.clip(r[:, 0], low, high), SOLVED * max(np.abs(start).max(), np.abs(end).max())
    r[:, 0] = np.where(np.abs(inside - r[:, 0]) <= rounding, inside, r[:, 0])
    line = law.take(point).linearise(r)
    bends = weights[:, None] * np.einsum("mi,mij,mj->m", along, line.hessian, along).reshape(middle.shape)
    if all(bool(np.isfinite(alpha).all()) for alpha in law.weak_convexity):
        return bends, False
    slopes = weights[:, None] * np.einsum("mi,mi->m", along, line.gradient).reshape(middle.shape)
    risen = 0.5 * bends * width
    jumps = np.diff(slopes, axis=1) - risen[:, 1:] - risen[:, :-1]
    return bends, bool((jumps < -COUNTS * np.abs(slopes).max()).any())
