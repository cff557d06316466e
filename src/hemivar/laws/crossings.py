"""Line-search breakpoints of a law: where its derivative bends along a direction, and where levels are met."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from hemivar.basics.types import Array, IntArray

if TYPE_CHECKING:
    from hemivar.laws.superpotential import Superpotential

__all__ = ["Crossings", "crossings", "length_places", "level_places"]


@dataclass(frozen=True, eq=False)
class Crossings:
    """``j(r + t d)`` in a direction d: its derivative is straight between the lengths t > 0 at which it meets knots."""

    slope: Array  # first derivative just behind t = 0, (m,)
    bend: Array  # second derivative there
    point: IntArray  # that meets a knot, (k,)
    component: IntArray  # of it that does
    length: Array  # where, ahead of t = 0; in no order
    place: Array  # the knot
    jump: Array  # of the first derivative up; +inf at an end of the domain
    change: Array  # of the second derivative

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Those of the components of a point, the first part being that of component 0, and so on."""
        slope, bend = sum(part.slope for part in parts), sum(part.bend for part in parts)
        named = [replace(part, component=part.component + c) for c, part in enumerate(parts)]
        names = ("point", "component", "length", "place", "jump", "change")
        together = {name: np.concatenate([getattr(part, name) for part in named]) for name in names}
        return replace(parts[0], slope=np.asarray(slope), bend=np.asarray(bend), **together)


def crossings(law: Superpotential, r: Array, direction: Array) -> Crossings:
    """The knots of a law with straight pieces ahead of ``r (m,)`` in directions (m,)."""
    knots, bends, (left, right) = law.knots, law._bends, law.knot_slopes()
    ahead, here = direction > 0.0, r[:, None]
    piece = np.where(ahead, (knots <= here).sum(axis=-1), (knots < here).sum(axis=-1))
    slope, bend = law.piece_line(piece, r)
    moves = np.where(ahead[:, None], knots > here, (knots < here) & (direction < 0.0)[:, None])
    point, knot = np.nonzero(moves & np.isfinite(knots))
    knots_met, left, right, first, last = (
        np.broadcast_to(table, (r.size, table.shape[-1]))[point, index]
        for table, index in ((knots, knot), (left, knot), (right, knot), (bends, knot), (bends, knot + 1))
    )
    speed = direction[point]
    return Crossings(
        slope=direction * slope,
        bend=direction**2 * bend,
        point=point,
        component=np.zeros(point.size, dtype=np.int64),
        length=(knots_met - r[point]) / speed,
        place=knots_met,
        jump=np.abs(speed) * (right - left),
        change=np.abs(speed) * speed * (last - first),
    )


def level_places(levels: Array, start: Array, end: Array, bend: Array) -> Array:
    """Where ``start + t (end - start) - t (1 - t) bend``, (m,) each, meets levels (m or 1, K): t, (m, 2 K).

    nan, or beyond 0 to 1, where it does not.
    """
    return _roots(bend[:, None], (end - start - bend)[:, None], start[:, None] - levels)


def length_places(levels: Array, start: Array, end: Array) -> Array:
    """Where the length of ``start + t (end - start)``, (m, c) each, meets levels >= 0, (m or 1, K): t, (m, 2 K).

    A length that does not come down to a level is least there.
    """
    d = end - start
    square, along, size = (np.einsum("mi,mi->m", a, b)[:, None] for a, b in ((d, d), (start, d), (start, start)))
    with np.errstate(all="ignore"):
        least = -along / square
        root = np.sqrt(np.maximum(least**2 - (size - levels**2) / square, 0.0))
        return np.concatenate([least - root, least + root], axis=1)


def _roots(a: Array, b: Array, c: Array) -> Array:
    """Where ``a t^2 + b t + c`` vanishes."""
    with np.errstate(all="ignore"):
        if not a.any():
            root = -c / b
            return np.concatenate([root, np.full_like(root, np.nan)], axis=1)
        q = -0.5 * (b + np.copysign(np.sqrt(b * b - 4.0 * a * c), b))
        return np.concatenate([q / a, c / q], axis=1)
