"""The graph of a scalar law (its subdifferential): pieces and knots in turn, and where a pair lies on it.

Part 2 i of a graph is its piece i, and part 2 i + 1 the knot that ends it.  By the displacement :func:`part_of` finds
the part, by the force :func:`~hemivar.laws.minimisers.knot_forces` does.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.minimisers import piece_bounds
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.vector_law import Sides

__all__ = [
    "ENDLESS",
    "is_continuous",
    "is_straight",
    "kink_within",
    "local_minimiser",
    "one_sided",
    "part_of",
    "past_peak",
    "prox_slope",
    "radial_sides",
    "steepest",
    "straightness",
]

#: How far out, in units of the knots, an endless piece is looked at: any value from 10 to 1e6 gives the same answers in
#: tests/laws/transformed and of charts.
ENDLESS = 1e3

#: Parts of a way at which a law is looked at.
_SAMPLED = 10.0 ** np.arange(-12.0, 0.1, 0.5)


def is_continuous(law: Superpotential) -> bool:
    """Whether the derivative of a superpotential is defined everywhere and jumps nowhere."""
    ends, (left, right) = law.domain, law.knot_slopes()
    if np.isfinite(ends.lower).any() or np.isfinite(ends.upper).any():
        return False
    return not (np.abs(right - left) > ROUNDED * np.maximum(np.abs(left), np.abs(right))).any()


def kink_within(law: Superpotential, r: Array, near: float) -> Array:
    """The kink nearest to each ``r (m,)`` if it is not farther than ``near``, else nan."""
    best, kink = np.full(r.shape, near), np.full(r.shape, np.nan)
    count, after = law.searched or law.knots.shape[-1], law.piece_of(r)
    for knot in (after - 1, after):  # knots nearer to each other than that cannot be told apart anyway
        inside = np.clip(knot, 0, count - 1)
        there = law.place_of(inside)
        off = np.abs(r - there)
        left, right = law.slopes_at(inside)
        better = (left != right) & (off <= best)
        best, kink = np.where(better, off, best), np.where(better, there, kink)
    return kink


def past_peak(
    law: Superpotential, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0
) -> BoolArray:
    """Whether a law pulls less than at some smaller opening, or its pull -j' falls there, (m,).

    What it pulls at smaller openings is looked at in knots; openings are negative penetrations.  With ``pull (m,)``, it
    pulls with that where ``r`` may lie on a jump; ``near`` and ``slack`` are rounding of ``r``, and of the pull.
    """
    bound, largest_at = law.domain, _pulls(law)
    own = np.clip(np.asarray(r, dtype=float), bound.lower, bound.upper)
    inside = np.clip(own + near, bound.lower, bound.upper)
    piece = law.piece_of(inside)
    rows = np.broadcast_to(largest_at, (len(inside), largest_at.shape[-1]))
    slope, curvature = law.piece_line(piece, inside)
    largest = np.maximum(np.take_along_axis(rows, piece[:, None], axis=1)[:, 0], -slope)
    pull = -law.derivative(own) if pull is None else pull
    with np.errstate(over="ignore", invalid="ignore"):
        weaker = (largest > slack) & (pull < largest * (1.0 - 1e-9) - slack)
        falls = (pull > slack) & (-curvature * np.abs(own) > np.maximum(slack, 1e-9 * pull))
        return np.asarray(weaker | falls)


def _pulls(law: Superpotential) -> Array:
    """The largest pull at each knot and all greater ones, ``(m or 1, K + 1)``; -inf beyond the last."""
    sides = [np.where(np.isfinite(side) & np.isfinite(law.knots), -side, -np.inf) for side in law.knot_slopes()]
    ends = np.full((*law.knots.shape[:-1], 1), -np.inf)
    at_knots = np.concatenate([np.maximum(*sides), ends], axis=-1)
    return np.maximum.accumulate(at_knots[..., ::-1], axis=-1)[..., ::-1]


def prox_slope(law: Superpotential, x: Array, tau: Array) -> Array:
    """Derivative of the prox in ``x``: 0 at a kink, ``1/(1 + tau j'')`` elsewhere."""
    r = law.prox(x, tau)
    return np.where(law.at_kink(r), 0.0, 1.0 / (1.0 + tau * law.curvature(r)))


def part_of(law: Superpotential, r: Array) -> IntArray:
    """The part of the graph that holds each ``r (m,)``, pieces and knots counted in turn."""
    piece = law.piece_of(r)
    return np.asarray(2 * piece + (piece_bounds(law, piece)[1] == r))


def straightness(law: Superpotential, piece: IntArray) -> tuple[Array, BoolArray]:
    """j'' on one piece (m,) for each point, and whether it is the same all along it: j'' is monotone there."""
    low, high = piece_bounds(law, piece)
    near = np.where(np.isfinite(low), low, np.where(np.isfinite(high), high, 0.0))
    size = np.where(np.isfinite(high), -1.0, 1.0) * (1.0 + np.abs(near))
    with np.errstate(all="ignore"):
        width = np.where(np.isfinite(high - low), high - low, size)
        end = np.where(np.isfinite(high - low), high, near + ENDLESS * size)
        places = (near, near + 0.41 * width, end)
        curvatures = np.array([np.broadcast_to(law.piece_curvature(piece, at), piece.shape) for at in places])
        return curvatures[1], np.asarray(np.ptp(curvatures, axis=0) <= 1e-13 * np.abs(curvatures).max(axis=0))


def is_straight(law: Superpotential) -> bool:
    """Whether j' is straight on every piece."""
    pieces = (np.full(law.rows, number) for number in range(law.knots.shape[-1] + 1))
    return law.straight or all(bool(straightness(law, piece)[1].all()) for piece in pieces)


def local_minimiser(law: Superpotential, a: Array, b: Array, r: Array) -> Array:
    """The local minimiser of ``a/2 r^2 - b r + j(r)`` that is reached from ``r (m,)`` downhill."""
    points, energies = law.local_minimisers(a, b)
    (here, left, right), slope, ends = law._knot_at(r), law.derivative(r), law.domain
    left = np.where(r < ends.lower, -np.inf, np.where(here, left, slope))
    right = np.where(r > ends.upper, np.inf, np.where(here, right, slope))
    rising, falling = a * r - b + left, a * r - b + right
    valid = np.isfinite(energies)
    # A minimiser that misses r by rounding is the one next to r.
    rounding = 1e-13 * (np.abs(r) + np.abs(b) / np.maximum(a, 1e-300))[..., None]
    after = np.where(valid & (points >= r[..., None] - rounding), points, np.inf).min(axis=-1)
    before = np.where(valid & (points <= r[..., None] + rounding), points, -np.inf).max(axis=-1)
    go_right, go_left = falling < 0.0, rising > 0.0
    lowest = np.where(go_right, -falling, 0.0) >= np.where(go_left, rising, 0.0)
    target = np.where(go_right & (lowest | ~go_left), after, np.where(go_left, before, r))
    if not np.isfinite(target).all():
        # A slope that is rounding of the law leads to no minimiser: r is next to one all the same.
        steep = np.maximum(np.where(go_right, -falling, 0.0), np.where(go_left, rising, 0.0))
        slopes = np.abs(np.concatenate([side.ravel() for side in law.knot_slopes()]))
        noise = ROUNDED * slopes.max(initial=0.0, where=np.isfinite(slopes))
        far = np.where(valid, np.abs(points - r[..., None]), np.inf)
        near = np.take_along_axis(points, far.argmin(axis=-1)[..., None], axis=-1)[..., 0]
        target = np.where(~np.isfinite(target) & (steep <= noise) & np.isfinite(far.min(axis=-1)), near, target)
    return np.where(np.isfinite(target), target, np.nan)


def one_sided(law: Superpotential, r: Array, tau: Array, slack: float) -> tuple[Array, Array, Array, Array]:
    """Derivatives below and above ``r (m,)``, and curvatures there.

    r sits on a knot where it equals it, or where it is as near as ``slack`` is to nothing.

    The latter only at a knot where nothing but the curvature jumps: others were decided by the multiplier.
    """
    for before in (1, 0):
        at = np.clip(law.piece_of(r) - before, 0, (law.searched or law.knots.shape[-1]) - 1)
        knot, (left, right) = law.place_of(at), law.slopes_at(at)
        with np.errstate(invalid="ignore", under="ignore"):
            r = np.where((np.abs(r - knot) <= slack * tau) & (np.abs(right - left) <= slack), knot, r)
    (here, left, right), piece = law._knot_at(r), law.piece_of(r)
    slope = law.piece_derivative(piece, r)
    low, high = (np.array(np.broadcast_to(law.piece_curvature(i, r), r.shape)) for i in (piece, piece + here))
    return np.where(here, left, slope), np.where(here, right, slope), low, high


def steepest(law: Superpotential, rest: Array, sign: float, size: float) -> Array:
    """The largest derivative of j, against the motion, on the way from ``rest (m,)`` in one direction; (m,).

    At rest, at the knots, far away, and at places between them; +inf where the law ends.
    """
    m = rest.size
    far = rest + sign * size
    slopes = np.broadcast_to(law.recession(np.full(m, sign)), (m,)).astype(float)
    with np.errstate(all="ignore"):
        for part in (0.0, *_SAMPLED):
            at = rest + sign * part * size
            ends = law.domain
            inside = (at >= ends.lower) & (at <= ends.upper)
            slope = sign * law.derivative(np.clip(at, ends.lower, ends.upper))
            slopes = np.where(inside & (slope > slopes), slope, slopes)
        left, right = law.knot_slopes()
        knots, left, right = (np.broadcast_to(a, (m, law.knots.shape[-1])) for a in (law.knots, left, right))
        onward = np.isfinite(knots) & (sign * (knots - rest[:, None]) >= 0.0)
        steepest = np.where(onward, np.maximum(sign * left, sign * right), -np.inf).max(axis=1, initial=-np.inf)
    ends_before = np.isfinite(far) & ((far > law.domain.upper) if sign > 0.0 else (far < law.domain.lower))
    return np.where(ends_before, np.inf, np.maximum(slopes, steepest))


def radial_sides(law: Superpotential, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
    """:meth:`VectorLaw.sides` of the slip, where j is a scalar law of its length; arrays as there, ``tau (m,)``."""
    d, unit = r.shape[1], np.eye(r.shape[1])
    size = np.linalg.norm(r[:, 1:], axis=1)
    radial = one_sided(law, size, tau, slack)
    _, above, _, high = radial
    # at rest: every direction that is not held by a support, with the curvature of first slip
    force = np.linalg.norm(np.where(active[:, 1:], lam[:, 1:], 0.0), axis=1)
    rest, column = np.nonzero(active[:, 1:] & (size == 0.0)[:, None])
    still = Sides(rest, unit[1:][column], force[rest], -above[rest], above[rest], high[rest], high[rest])
    # on the move: outward, and in three dimensions across it
    moving = np.flatnonzero(size > 0.0)
    outward = np.zeros((moving.size, d))
    outward[:, 1:] = r[moving, 1:] / size[moving, None]
    along = np.einsum("ki,ki->k", outward, lam[moving])
    sides = [still, Sides(moving, outward, along, *(values[moving] for values in radial))]
    if d == 3:
        across = np.stack([np.zeros(moving.size), -outward[:, 2], outward[:, 1]], axis=1)
        turns = np.any((across != 0.0) & active[moving], axis=1)
        point, none, bend = moving[turns], np.zeros(int(turns.sum())), (along / size[moving])[turns]
        sides.append(Sides(point, across[turns], none, none, none, bend, bend))
    return sides
