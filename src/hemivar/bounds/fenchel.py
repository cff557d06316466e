"""The gap of Fenchel's inequality on contact facets, where a multiplier near to the force itself is taken.

With ``jh = j + alpha/2 |.|^2`` convex, ``y = zeta + alpha r`` and ``jh*`` its conjugate

    D = jh(r) + jh*(y) - y . r  >=  0,

zero where zeta is in dj(r). Of all zeta that with the least ``|xi - zeta|^2 / (2 a) + D`` is, by Moreau,

    zeta = xi + a (r - p),    p = argmin j(p) + (alpha + a)/2 |p|^2 - (xi + (alpha + a) r) . p,

a local problem that laws solve exactly, and ``D = jh(r) - jh(p) - y . (r - p)`` because y is in djh(p). For small a
zeta is xi, clipped to where the conjugate is finite; for large a it is the nearest element of dj(r).

Normal and tangential part of each facet may do either: keep an element of dj(r), or pay a gap.

Of laws that couple opening and slip both parts pay together, and the integral of D is bounded from above on parts of
facets, on which y is taken linear between values ``y_a`` in djh(p_a) at the corners, r being linear there:

    D <= sum_a t_a (jh(r_a) + jh*(y_a)) - y . r,    jh*(y_a) = y_a . p_a - jh(p_a),

because jh and jh* are convex, so that with d corners

    int D <= |part| [ mean_a D_a + sum_a (y_a - mean y) . (r_a - mean r) / (d + 1) ].

A quadratic trace lies between its control points; that of the middle counts as a third value of jh. No p need be exact,
and no integral is left to a rule; kinks that lie inside a part make it less sharp, and no less true.

The one-sided constant of a law at one point, for a multiplier zeta in dj(r), is the least ``alpha_u >= 0`` with

    (xi - zeta) (s - r) >= -alpha_u (s - r)^2     for all s and all xi in dj(s).

On a straight piece of j' the ratio ``-(xi - zeta) / (s - r)`` is monotone in s on each side of r, so its supremum is
among its values at the ends of pieces, its limits at r and its limits far away. It is never larger than the weak
convexity constant, which is taken where a piece is curved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, BoolArray
from hemivar.bounds.contact_traces import ContactTraces, PartRule, radial_parts
from hemivar.laws import ContactLaw, Superpotential, VectorLaw
from hemivar.laws.scalar_graph import is_straight
from hemivar.laws.vector_law import lengths

__all__ = [
    "FenchelGap",
    "exact_gap",
    "fenchel_gap",
    "following",
    "near_multiplier",
    "one_sided",
    "one_sided_constants",
]

#: Change of the force, over the largest, by which it is seen whether the multiplier follows.
_STEP = 1e-6
#: Part of the way into a part at which its corners take their multiplier, so that each side of a kink has its own.
_INSIDE = 1e-7
#: Roundings of energies that are subtracted.
_ROUNDED = 16.0 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class FenchelGap:
    """Contact facets with a multiplier that leaves dj(r) at a price."""

    #: a; inf where no multiplier leaves dj(r).
    weight: float
    #: zeta at the points, in local components.
    multiplier: Array  # (k, q, d)
    #: Integrals of the squares of ``xi - zeta``.
    normal: Array  # (k,)
    tangential: Array  # (k,)
    #: Integrals of D; of laws that couple, the normal one is that of both.
    normal_gap: Array  # (k,)
    tangential_gap: Array  # (k,)

    def only(
        self, paying: tuple[BoolArray, BoolArray], traces: ContactTraces, forces: Array, exact: Array
    ) -> FenchelGap:
        """The same with ``exact (k, q, d)``, which is in dj(r), but for the ``paying`` normal and tangential parts."""
        normal, tangential = paying
        if normal.all() and tangential.all():
            return self
        pays = np.column_stack([normal, *[tangential] * (forces.shape[-1] - 1)])[:, None]
        zeta = np.where(pays, self.multiplier, exact)
        square = traces.square(forces - zeta)
        gaps = (
            np.where(part, gap, 0.0) for part, gap in zip(paying, (self.normal_gap, self.tangential_gap), strict=True)
        )
        return FenchelGap(self.weight, zeta, *square, *gaps)


def fenchel_gap(traces: ContactTraces, forces: Array, weight: float, wide: Array | None = None) -> FenchelGap:
    """The gap of the multiplier nearest to forces in local components (k, q, d), at points of contact facets.

    Where penetrations may be off by as much as ``wide (k,)``, and the law is convex and splits, it is the largest one:
    D is convex in the penetration, and largest at one of both ends.
    """
    if traces.rule is not None:
        return _majorised(traces, traces.rule, forces, weight)
    law, shape = traces.law, traces.weights.shape
    assert isinstance(law, ContactLaw)
    r, (alpha, every) = traces.local.reshape(-1, forces.shape[-1]), _convexity(traces)
    p, near = near_multiplier(traces, forces, weight)
    zeta = near.reshape(r.shape)
    work = (zeta + every * r) * (r - p)
    known, size, length = traces.values, lengths(r[:, 1:]), lengths(p[:, 1:])
    normal = _fall(law.normal, alpha[:, 0], r[:, 0], p[:, 0], known[0]) - work[:, 0]
    for off in () if wide is None else (-wide, wide):
        end = law.admissible(np.column_stack([r[:, 0] + np.repeat(off, shape[1]), r[:, 1:]]))[:, 0]
        apart = _fall(law.normal, alpha[:, 0], end, p[:, 0]) - zeta[:, 0] * (end - p[:, 0])
        normal = np.maximum(normal, apart)
    tangential = _fall(law.tangential, alpha[:, 1], size, length, known[1]) - work[:, 1:].sum(axis=1)
    within = _within(law, p)
    normal, tangential = (np.where(one, part, np.inf) for one, part in zip(within.T, (normal, tangential), strict=True))
    gaps = (traces.integral(np.maximum(part, 0.0).reshape(shape)) for part in (normal, tangential))
    return FenchelGap(weight, near, *traces.square(forces - near), *gaps)


def near_multiplier(traces: ContactTraces, forces: Array, weight: float) -> tuple[Array, Array]:
    """p (k q, d) and the multiplier (k, q, d) nearest to forces (k, q, d), of a law that splits."""
    alpha, every = _convexity(traces)
    r, xi = (values.reshape(-1, forces.shape[-1]) for values in (traces.local, forces))
    p = traces.law.local_argmin(alpha + weight, xi + (every + weight) * r)
    return p, (xi + weight * (r - p)).reshape(forces.shape)


def exact_gap(traces: ContactTraces, forces: Array) -> FenchelGap:
    """That of the multipliers in dj(r) nearest to forces (k, q, d): none where the law splits.

    Where it couples, multipliers are in dj(r) at the corners of parts.
    """
    if traces.rule is not None:
        return _majorised(traces, traces.rule, forces, np.inf)
    zeta, none = traces.allowed(forces), np.zeros(len(forces))
    return FenchelGap(np.inf, zeta, *traces.square(forces - zeta), none, none)


def _majorised(traces: ContactTraces, rule: PartRule, forces: Array, weight: float) -> FenchelGap:
    """The gap of a multiplier that is linear with y on the parts of facets, from above."""
    k, q, c = forces.shape
    shape, d = (k, -1, len(rule.weights), c), rule.corners
    all_alpha = _convexity(traces)[1].reshape(shape)
    r, xi, alpha = traces.local.reshape(shape), forces.reshape(shape)[:, :, :d], all_alpha[:, :, :d]
    law = traces.law.take(np.arange(k * q).reshape(shape[:3])[:, :, :d].ravel())
    ends = r[:, :, :d]

    def flat(values: Array) -> Array:
        return np.ascontiguousarray(values).reshape(-1, c)

    p, target = flat(ends + _INSIDE * (ends.mean(axis=2, keepdims=True) - ends)), flat(xi)
    if weight < np.inf:
        p, target = _proximal(law, flat(ends), target, flat(alpha), weight)
    lam = law.nearest_multiplier(p, target)
    y = (lam + flat(alpha) * p).reshape(ends.shape)
    gaps = _fenchel(law, flat(alpha), flat(ends), p, flat(y)).reshape(ends.shape[:3])
    bound = gaps.mean(axis=2)
    bound += np.einsum("kpac,kpac->kp", y - y.mean(axis=2, keepdims=True), ends - ends.mean(axis=2, keepdims=True)) / (
        d + 1
    )
    if traces.data.order == 2:
        bound += _control(traces, rule, r, all_alpha, y)
    measures = traces.weights.reshape(shape[:3]).sum(axis=2)
    gap = np.where(measures > 0.0, np.maximum(bound, 0.0) * measures, 0.0).sum(axis=1)
    zeta = (np.einsum("na,kpac->kpnc", rule.points, y) - all_alpha * r).reshape(forces.shape)
    return FenchelGap(weight, zeta, *traces.square(forces - zeta), gap, np.zeros(k))


def _proximal(law: VectorLaw, r: Array, xi: Array, alpha: Array, weight: float) -> tuple[Array, Array]:
    """Where the multiplier of a weight is one of the law, and what it is nearly, (m, c) each."""
    p = law.admissible(law.local_argmin(alpha[:, [0, -1]] + weight, xi + (alpha + weight) * r))
    p = np.where(_within(law, p).all(axis=1, keepdims=True), p, r)
    return p, xi + (alpha + weight) * (r - p)


def _within(law: VectorLaw, p: Array) -> BoolArray:
    """Whether penetration and slip (m, c) are where alpha is proved, (m, 2); all of them where it is sampled."""
    sizes = np.column_stack([np.abs(p[:, 0]), lengths(p[:, 1:])])
    reach = law.proof("alpha").reach
    return np.asarray((sizes <= reach) | (min(reach) == 0.0))


def _fenchel(law: VectorLaw, alpha: Array, r: Array, p: Array, y: Array) -> Array:
    """``jh(r) - jh(p) - y . (r - p)``, raised by its rounding; (m,)."""
    fall = law.value(r) - law.value(p)
    bend = 0.5 * (alpha * (r - p) * (r + p)).sum(axis=1)
    work = (y * (r - p)).sum(axis=1)
    size = np.abs(law.value(r)) + np.abs(law.value(p)) + np.abs(bend) + np.abs(work)
    return np.where((r == p).all(axis=1), 0.0, np.maximum(fall + bend - work, 0.0) + _ROUNDED * size)


def _control(traces: ContactTraces, rule: PartRule, r: Array, alpha: Array, y: Array) -> Array:
    """What the bend of a quadratic trace adds on parts of edges, (k, p)."""
    ends, inner = r[:, :, :2], r[:, :, 2:]
    e = (inner.mean(axis=2) - ends.mean(axis=2)) / (2.0 * rule.points[2].prod())
    at = ends.mean(axis=2) + e
    law, count = traces.law.take(np.arange(r[..., 0].size).reshape(r.shape[:3])[:, :, 2].ravel()), r.shape[3]
    flat = at.reshape(-1, count)
    inside = law.admissible(flat)
    snapped = np.where(np.abs(inside - flat) <= 1e-11 * np.abs(r).max(initial=0.0), inside, flat).reshape(at.shape)

    def raised(values: Array) -> Array:
        whole = values.reshape(-1, count)
        energy = law.value(whole).reshape(values.shape[:2]) + 0.5 * (alpha[:, :, 2] * values**2).sum(axis=2)
        return np.asarray(energy)

    means = 0.5 * (raised(ends[:, :, 0]) + raised(ends[:, :, 1]))
    return np.asarray((raised(snapped) - means - (y.mean(axis=2) * e).sum(axis=2)) / 3.0)


def following(forces: Array, multiplier: Callable[[Array], Array]) -> Array:
    """The part (k, q, 2) of a small change of forces (k, q, d), normal and tangential, that a multiplier follows.

    The tangential one is that along the force, which is the least.
    """
    size = np.sqrt(np.einsum("fqi,fqi->fq", forces[..., 1:], forces[..., 1:]))[..., None]
    direction = np.ones(forces.shape)
    direction[..., 1:] = np.where(size > 0.0, forces[..., 1:] / np.where(size > 0.0, size, 1.0), direction[..., 1:])
    step = _STEP * float(np.abs(forces).max(initial=0.0))
    if step == 0.0:
        return np.zeros((*forces.shape[:2], 2))
    change = direction * (multiplier(forces + step * direction) - multiplier(forces - step * direction)) / (2.0 * step)
    return np.asarray(np.clip(np.stack([change[..., 0], change[..., 1:].sum(axis=2)], axis=2), 0.0, 1.0))


def _convexity(traces: ContactTraces) -> tuple[Array, Array]:
    """Weak convexity constants, of the normal and the tangential law (m, 2), and of all components (m, d)."""
    alpha = np.column_stack([np.broadcast_to(part, traces.weights.size) for part in traces.law.weak_convexity])
    alpha = np.where(np.isfinite(alpha), alpha, 0.0)
    return alpha, np.column_stack([alpha[:, :1], np.repeat(alpha[:, 1:], traces.local.shape[-1] - 1, axis=1)])


def _fall(law: Superpotential, alpha: Array, r: Array, p: Array, value: Array | None = None) -> Array:
    """``jh(r) - jh(p)``; ``value`` is j(r) where it is known."""
    known = law.value(r) if value is None else value
    return np.asarray(known - law.value(p) + 0.5 * alpha * (r - p) * (r + p))


def one_sided(law: Superpotential, r: Array, zeta: Array) -> Array:
    """The constants (m,) of a scalar law at points r (m,) with multipliers zeta (m,)."""
    convex = np.broadcast_to(law.weak_convexity, r.shape)
    if not convex.any():
        return np.zeros(r.shape)
    if not is_straight(law):
        return np.array(convex)
    knots = np.broadcast_to(law.knots, (len(r), law.knots.shape[-1]))
    left, right = (np.broadcast_to(side, knots.shape) for side in law.knot_slopes())
    real = np.isfinite(knots)
    slopes = np.where(real & np.isfinite(left), np.abs(left), 0.0)
    slack = ROUNDED * np.maximum(slopes.max(axis=1), np.abs(zeta))
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


def one_sided_constants(traces: ContactTraces, zeta: Array) -> tuple[Array, Array]:
    """The constants of the normal and of the tangential law at the points (k, q), for multipliers (k, q, d).

    That of a radial law in space is that of its profile along the line of the slip, for the ratio is monotone in the
    cosine of the angle between the two slips.  Of laws that couple the weak convexity constants are taken.
    """
    shape = traces.weights.shape
    if not isinstance(traces.law, ContactLaw):
        normal, tangential = (np.broadcast_to(part, traces.weights.size) for part in traces.law.weak_convexity)
        return normal.reshape(shape), tangential.reshape(shape)
    if not any(np.any(part) for part in traces.law.weak_convexity):
        return np.zeros(shape), np.zeros(shape)
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
    low = np.linalg.norm(middle, axis=1) - reach * (1.0 + ROUNDED)
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
            constants = one_sided(law, np.where(known, knot, 0.0), np.where(known, slope, 0.0))
            worst = np.maximum(worst, np.where(known, constants, 0.0).reshape(shape))
    return worst
