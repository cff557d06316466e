"""The Moreau envelope: a law in series with a spring, as worn surfaces and creeping foundations act within a step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.deadline import check_time
from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.minimisers import MANY, piece_bounds
from hemivar.laws.parameters import common_rows
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.piecewise_law import pick
from hemivar.laws.superpotential import Interval, Superpotential, row
from hemivar.laws.transformed.transformed_law import (
    LawOfOne,
    by_parts,
    check_law,
    numbers,
    table_of,
)
from hemivar.laws.turns import falls_between

__all__ = ["EnvelopeLaw", "envelope"]


def envelope(law: Superpotential, compliance: Array | float) -> Superpotential:
    """The law in series with a compliance c: ``e(r) = min over s of j(s) + (r - s)^2/(2 c)``, p in dj(r - c p).

    Where ``c alpha < 1`` the minimiser is the only stationary point, s = prox(r), ``e'(r) = j'(s) = (r - s)/c``, and
    the pieces of e are the images ``s + c j'(s)`` of those of j, and of its kinks, springs of stiffness 1/c.
    On a piece on which alpha is the fall of j', that of e' is ``alpha/(1 - c alpha)``.  A rigid law becomes a spring.

    Parameters
    ----------
    law : Superpotential
        With resolved parameters.
    compliance : number or array (m,)
        c >= 0 (length per force per area); with zero the law stays what it is.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        A negative compliance, or ``c alpha >= 1``: the point would snap.
    """
    check_law(law)
    known = numbers(compliance, f"the compliance in series with law '{law.name}'", least=0.0)
    common_rows(f"law '{law.name}'", law.rows, known.size)
    stacked = by_parts(law, lambda part, index: envelope(part, row(known, index)))
    if stacked is not None:
        return stacked
    if (known == 0.0).all():
        return law
    alpha = law.weak_convexity
    with np.errstate(invalid="ignore"):
        product = np.where(known > 0.0, known * alpha, 0.0)
    if (product >= 1.0).any():
        i = int(np.argmax(product))
        c, worst = (float(np.broadcast_to(x, product.shape)[i]) for x in (known, alpha))
        raise ProblemError(
            f"law '{law.name}' is unstable in series with the compliance {c:.4g}: compliance times alpha = "
            f"{product[i]:.4g} >= 1; keep the compliance below {1.0 / worst:.4g}, with a shorter step"
        )
    if isinstance(law, EnvelopeLaw):  # springs in series are one spring
        return EnvelopeLaw(law.base, law.compliance + known)
    made = EnvelopeLaw(law, known)
    base = table_of(law)
    if base is None or (base.knots.shape[-1] > MANY and known.size > 1):
        return made
    knots, codes, below, above = made.images
    at_knot, own = codes % 2 == 1, codes // 2
    slopes = pick(base.slopes, np.minimum(own, base.slopes.shape[-1] - 1))
    wide = np.broadcast_to(known[:, None], slopes.shape)
    slopes = np.where(at_knot, 1.0 / np.where(at_knot, wide, 1.0), slopes / (1.0 + wide * slopes))
    domain = made.domain
    below, above = (np.where(np.isfinite(side), side, 0.0) for side in (below, above))  # at ends that stay rigid
    return PiecewiseQuadratic.with_sides(knots, slopes, below, above, (domain.lower, domain.upper), law.name)


@dataclass(frozen=True, eq=False)
class EnvelopeLaw(LawOfOne):
    """The Moreau envelope of any law; see :func:`envelope`."""

    base: Superpotential
    compliance: Array

    @cached_property
    def images(self) -> tuple[Array, IntArray, Array, Array]:
        """Knots (m, K), what every piece is (m, K + 1), and the derivative below and above every knot (m, K).

        A piece is the image of piece i of the law, 2 i, or of its knot i, 2 i + 1.
        """
        knots, (left, right) = self.base.knots, self.base.knot_slopes()
        rows, count = common_rows(f"law '{self.name}'", self.compliance.size, len(knots)), knots.shape[-1]
        knots, left, right = (np.broadcast_to(x, (rows, count)) for x in (knots, left, right))
        c = np.broadcast_to(self.compliance[:, None], (rows, count))
        bound = self.base.domain
        lower, upper = (
            np.broadcast_to(bound.lower[:, None], (rows, 1)),
            np.broadcast_to(bound.upper[:, None], (rows, 1)),
        )
        inside = np.isfinite(knots) & (knots >= lower) & (knots <= upper)
        rigid = c == 0.0  # here knots are what they were
        at = np.where(inside, knots, 0.0)
        with np.errstate(invalid="ignore"):
            low, high = np.where(rigid, at, at + c * left), np.where(rigid, at, at + c * right)
        first, last = inside & (np.isfinite(left) | rigid), inside & (np.isfinite(right) | rigid)
        apart = (high > low) | ~np.isfinite(high)
        last &= apart & (last | rigid)
        number = np.arange(count)
        places = np.stack([np.where(first, low, np.inf), np.where(last & ~rigid, high, np.inf)], axis=-1)
        code = np.stack(
            [np.where(apart & ~rigid, 2 * number + 1, 2 * number + 2), 2 * number + 2 + 0 * at.astype(int)], -1
        )
        below = np.stack([left, right], axis=-1)
        above = np.stack([np.where(apart & ~rigid, left, right), right], axis=-1)
        places, code, below, above = (x.reshape(rows, 2 * count) for x in (places, code, below, above))
        order = np.argsort(places, axis=-1, kind="stable")
        places, code, below, above = (np.take_along_axis(x, order, -1) for x in (places, code, below, above))
        for i in range(1, 2 * count):  # rounding may have made two equal: then the later one goes on
            again = (places[:, i] == places[:, i - 1]) & np.isfinite(places[:, i])
            places[again, i - 1], below[again, i] = np.inf, below[again, i - 1]
        order = np.argsort(places, axis=-1, kind="stable")
        places, code, below, above = (np.take_along_axis(x, order, -1) for x in (places, code, below, above))
        used = np.isfinite(places)
        width = max(1, int(used.sum(axis=-1).max()))
        start = np.where(np.isfinite(lower) & ~rigid[:, :1], 2 * np.argmax(knots == lower, axis=-1)[:, None] + 1, 0)
        codes = np.concatenate([start, code[:, :width]], axis=-1)
        empty = ~used[:, 0]  # one spring from end to end
        places = places[:, :width].copy()
        middle = pick(knots, codes[:, :1] // 2)[:, 0]
        places[empty, 0], codes[empty, 1] = middle[empty], codes[empty, 0]
        below, above = below[:, :width].copy(), above[:, :width].copy()
        below[empty, 0] = above[empty, 0] = 0.0
        return places, codes.astype(np.int64), below, above

    @property
    def knots(self) -> Array:
        return self.images[0]

    @property
    def domain(self) -> Interval:
        bound, shape = self.base.domain, (len(self.knots),)
        rigid = np.broadcast_to(self.compliance == 0.0, shape)
        return Interval(np.where(rigid, bound.lower, -np.inf), np.where(rigid, bound.upper, np.inf))

    def _place(self, piece: IntArray, r: Array) -> tuple[IntArray, Array, BoolArray]:
        """The piece of the law, the place s on it, and whether it is at a knot."""
        check_time()  # envelopes of laws that hold others take long
        code = pick(self.images[1], np.asarray(piece))
        at_knot, own = code % 2 == 1, code // 2
        r = np.broadcast_to(np.asarray(r, dtype=float), np.broadcast_shapes(np.shape(r), code.shape))
        own, at_knot = np.broadcast_to(own, r.shape), np.broadcast_to(at_knot, r.shape)
        at = pick(self.base.knots, np.minimum(own, self.base.knots.shape[-1] - 1))
        smooth = np.minimum(own, self.base.knots.shape[-1])
        c = np.broadcast_to(self.compliance, r.shape)
        soft = (c > 0.0) & ~at_knot
        a = 1.0 / np.where(c > 0.0, c, 1.0)
        low, high = piece_bounds(self.base, smooth)
        s, _ = self.base.stationary_point(smooth, a, a * r, low, high, soft & (low < high))
        s = np.where(soft, np.clip(s, low, high), r)
        return smooth, np.where(at_knot, at, s), at_knot

    def _raw(self, piece: IntArray, r: Array) -> Array:
        own, s, at_knot = self._place(piece, r)
        c = np.broadcast_to(self.compliance, s.shape)
        value = np.where(at_knot, self.base.value(np.where(at_knot, s, 0.0)), self.base.piece_value(own, s))
        return np.asarray(value + np.where(c > 0.0, (r - s) ** 2 / np.where(c > 0.0, 2.0 * c, 1.0), 0.0))

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        own, s, at_knot = self._place(piece, r)
        c = np.broadcast_to(self.compliance, s.shape)
        return np.where(at_knot, (r - s) / np.where(at_knot, c, 1.0), self.base.piece_derivative(own, s))

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        own, s, at_knot = self._place(piece, r)
        c = np.broadcast_to(self.compliance, s.shape)
        bent = self.base.piece_curvature(own, s)
        return np.where(at_knot, 1.0 / np.where(at_knot, c, 1.0), bent / (1.0 + c * bent))

    def _knot_sides(self) -> tuple[Array, Array]:
        knots, _, below, above = self.images
        used = np.isfinite(knots)
        return np.where(used, below, 0.0), np.where(used, above, 0.0)

    def piece_formula(self, piece: int) -> str:
        code = int(self.images[1][0, piece])
        c = float(self.compliance[0])
        if code % 2:
            return f"(r - {float(self.base.knots[0, code // 2]):.6g})/{c:.6g}"
        text = self.base.piece_formula(code // 2)
        return text and f"{text} at r - {c:.6g} j'"

    @cached_property
    def weak_convexity(self) -> Array:  # type: ignore[override]
        rows = len(self.knots)
        c = np.broadcast_to(self.compliance, (rows,))
        worst = np.zeros(rows)
        for i in range(self.base.knots.shape[-1] + 1):
            piece = np.full(rows, i, dtype=np.int64)
            low, high = (np.broadcast_to(end, (rows,)) for end in piece_bounds(self.base, piece))
            fall = np.maximum(falls_between(self.base, piece, low, high), 0.0)
            worst = np.maximum(worst, fall / (1.0 - c * fall))
        return np.where(c == 0.0, self.base.weak_convexity, worst)

    @property
    def growth(self) -> tuple[Array, Array]:
        zero = self.subdifferential(np.zeros(len(self.knots)))
        c = np.broadcast_to(self.compliance, (len(self.knots),))
        steepest = np.maximum(1.0 / np.where(c > 0.0, c, 1.0), self.weak_convexity)
        c0, c1 = self.base.growth
        at_zero = np.maximum(np.abs(zero.lower), np.abs(zero.upper))
        return np.where(c > 0.0, at_zero, c0), np.where(c > 0.0, steepest, c1)

    def recession(self, sign: Array) -> Array:
        return np.asarray(self.base.recession(sign) + 0.0 * self.compliance)

    def asymptotic_curvature(self, sign: float) -> Array:
        bent, c = np.broadcast_arrays(self.base.asymptotic_curvature(sign), self.compliance)
        soft = c > 0.0
        with np.errstate(invalid="ignore"):
            series = np.where(np.isposinf(bent), 1.0 / np.where(soft, c, 1.0), bent / (1.0 + c * bent))
        return np.where(soft, series, bent)

    def local_argmin(self, a: Array, b: Array) -> Array:
        """The minimiser, by that of the law: s minimises ``a' s^2/2 - b' s + j(s)``, a' = a/(1 + a c), b' alike."""
        a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
        softer = 1.0 + a * self.compliance
        return np.asarray((self.base.local_argmin(a / softer, b / softer) + self.compliance * b) / softer)

    def stationary_point(
        self, piece: IntArray, a: Array, b: Array, low: Array, high: Array, admissible: BoolArray
    ) -> tuple[Array, BoolArray]:
        """Found on the law itself: nested iterations would be slow."""
        a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
        ends = [
            np.where(np.isfinite(end), self._place(piece, np.where(np.isfinite(end), end, 0.0))[1], end)
            for end in (low, high)
        ]
        own, at, at_knot = self._place(piece, np.zeros(np.shape(ends[0])))
        softer = 1.0 + a * self.compliance
        go = np.asarray(admissible) & ~at_knot
        s, exists = self.base.stationary_point(own, a / softer, b / softer, ends[0], ends[1], go)
        r = (np.where(at_knot, at, s) + self.compliance * b) / softer
        return np.where(admissible, np.clip(r, low, high), 0.0), np.asarray(np.where(at_knot, admissible, exists))
