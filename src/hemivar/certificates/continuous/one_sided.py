"""The one-sided constant of a law at one point: how far it is from monotone, seen from there alone.

For a multiplier zeta in dj(r) it is the least ``alpha_u >= 0`` with

    (xi - zeta) (s - r) >= -alpha_u (s - r)^2     for all s and all xi in dj(s).

On a straight piece of j' the ratio ``-(xi - zeta) / (s - r)`` is monotone in s on each side of r, so its supremum is
among its values at the ends of pieces, its limits at r and its limits far away. It is never larger than the weak
convexity constant, which is taken where a piece is curved.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.certificates.continuous.contact_traces import ContactTraces, radial_parts
from hemivar.laws import ContactLaw, Superpotential
from hemivar.laws.scalar_graph import straightness

__all__ = ["one_sided", "one_sided_constants"]

#: Part of the largest slope by which a multiplier may miss the end of its interval by rounding.
_ROUNDING = 1e-12


def one_sided(law: Superpotential, r: Array, zeta: Array) -> Array:
    """The constants (m,) of a scalar law at points r (m,) with multipliers zeta (m,)."""
    convex = np.broadcast_to(law.weak_convexity, r.shape)
    if not convex.any():
        return np.zeros(r.shape)
    if not _straight(law):
        return np.array(convex)
    knots = np.broadcast_to(law.knots, (len(r), law.knots.shape[-1]))
    left, right = (np.broadcast_to(side, knots.shape) for side in law.knot_slopes())
    real = np.isfinite(knots)
    slopes = np.where(real & np.isfinite(left), np.abs(left), 0.0)
    slack = _ROUNDING * np.maximum(slopes.max(axis=1), np.abs(zeta))
    worst = np.zeros(r.shape)
    apart = np.where(real, knots - r[:, None], np.inf)
    with np.errstate(all="ignore"):
        for side, sign in ((left, -1.0), (right, 1.0)):
            ratio = -(side - zeta[:, None]) / np.where(apart == 0.0, np.nan, apart)
            ratio = np.where(real & np.isfinite(side) & (apart != 0.0), ratio, -np.inf)
            worst = np.maximum(worst, ratio.max(axis=1, initial=-np.inf))
            # at r itself, from this side: a fall of j' below (above) zeta cannot be outweighed
            at = real & (apart == 0.0)
            falls = at & (sign * (side - zeta[:, None]) < -slack[:, None])
            worst = np.where(falls.any(axis=1), np.inf, worst)
    piece = law.piece_of(r)
    beside = (apart == 0.0).any(axis=1)
    for step in (0, 1):
        there = np.where(beside, piece + step, piece)
        worst = np.maximum(worst, -law.piece_curvature(there, r))
    for sign in (1.0, -1.0):
        far = np.broadcast_to(law.asymptotic_curvature(sign), r.shape)
        worst = np.maximum(worst, -np.where(np.isfinite(far), far, 0.0))
    return np.minimum(worst, convex)


def _straight(law: Superpotential) -> bool:
    """Whether j' is straight on every piece."""
    pieces = (np.full(law.rows, number) for number in range(law.knots.shape[-1] + 1))
    return law.straight or all(bool(straightness(law, piece)[1].all()) for piece in pieces)


def one_sided_constants(traces: ContactTraces, zeta: Array) -> tuple[Array, Array]:
    """The constants of the normal and of the tangential law at the points (k, q), for multipliers (k, q, d).

    That of a radial law in space is that of its profile along the line of the slip, for the ratio is monotone in the
    cosine of the angle between the two slips.  Of laws that couple the weak convexity constants are taken.
    """
    shape = traces.weights.shape
    if not isinstance(traces.law, ContactLaw):
        normal, tangential = (np.broadcast_to(part, traces.weights.size) for part in traces.law.weak_convexity)
        return normal.reshape(shape), tangential.reshape(shape)
    r, force = traces.local.reshape(-1, traces.local.shape[-1]), zeta.reshape(-1, zeta.shape[-1])
    normal = one_sided(traces.law.normal, r[:, 0], force[:, 0]).reshape(shape)
    size, along = radial_parts(r[:, 1:], force[:, 1:])
    tangential = one_sided(traces.law.tangential, size, along).reshape(shape)
    # knots that lie between points of the rule: the constant is largest beside them
    low, high = traces.local[..., 0].min(axis=1), traces.local[..., 0].max(axis=1)
    normal = np.maximum(normal, _beside_knots(traces.law.normal, low, high, shape))
    middle = traces.local[..., 1:].mean(axis=1)
    reach = np.linalg.norm(traces.local[..., 1:] - middle[:, None], axis=2).max(axis=1)
    high = size.reshape(shape).max(axis=1)
    low = np.linalg.norm(middle, axis=1) - reach * (1.0 + _ROUNDING)
    low = np.where(reach > 0.0, low, high)
    return normal, np.maximum(tangential, _beside_knots(traces.law.tangential, low, high, shape))


def _beside_knots(law: Superpotential, low: Array, high: Array, shape: tuple[int, ...]) -> Array:
    """The largest constants on both sides of knots between two displacements (k,) on each facet, shape (k, q).

    On one side of a knot zeta is the limit of j' from there.
    """
    worst = np.zeros(shape)
    if not np.broadcast_to(law.weak_convexity, (worst.size,)).any():
        return worst
    knots = np.broadcast_to(law.knots, (worst.size, law.knots.shape[-1]))
    sides = [np.broadcast_to(side, knots.shape) for side in law.knot_slopes()]
    below, above = np.repeat(low, shape[1]), np.repeat(high, shape[1])
    for number in range(knots.shape[1]):
        knot = knots[:, number]
        inside = (below < knot) & (knot < above)
        if not inside.any():
            continue
        for side in sides:
            slope = side[:, number]
            known = inside & np.isfinite(slope)
            found = one_sided(law, np.where(known, knot, 0.0), np.where(known, slope, 0.0))
            worst = np.maximum(worst, np.where(known, found, 0.0).reshape(shape))
    return worst
