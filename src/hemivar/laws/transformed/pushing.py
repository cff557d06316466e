"""Springs and dashpots that push only: a damper that cannot pull the body back when it leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.stacked import StackedLaw
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.exact_table import count_knots, merged, pick
from hemivar.laws.transformed.sums import plus
from hemivar.laws.transformed.transformed_law import TransformedLaw, by_parts

__all__ = ["PushingLaw", "pushing"]


def pushing(law: Superpotential, damping: Superpotential) -> Superpotential:
    """The law with damping in contact that cannot pull: ``max(0, j'(r) + psi'(r))`` for r > 0, and j' for r < 0.

    Parameters
    ----------
    law, damping : Superpotential
        Convex, with resolved parameters; of a rate, ``damping`` is first given its affine argument.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        One of them is not convex, or the law does not allow r > 0: a rigid foundation has no damper.
    """
    if isinstance(law, StackedLaw):
        made = by_parts(
            law, lambda part, index: pushing(part, damping.take(index) if len(damping.knots) > 1 else damping)
        )
        assert made is not None
        return made
    for one in (law, damping):
        if not one.convex:
            raise ProblemError(
                f"law '{one.name}' is not monotone (alpha = {one.weak_convexity.max():.4g}); damping that cannot pull "
                f"needs a monotone law, take it as damping without that"
            )
    if (law.domain.upper <= 0.0).any():
        raise ProblemError(
            f"law '{law.name}' allows no penetration, so that there is nothing to damp; take springs such as Compliance"
        )
    return PushingLaw(law, plus(law, damping))


@dataclass(frozen=True, eq=False)
class PushingLaw(TransformedLaw):
    """See :func:`pushing`; ``total`` is the sum of law and damping."""

    base: Superpotential
    total: Superpotential

    @property
    def name(self) -> str:  # type: ignore[override]
        """Names of law and damping."""
        return self.total.name

    @property
    def made_of(self) -> tuple[Superpotential, ...]:
        return self.base, self.total

    @cached_property
    def _rows(self) -> int:
        return int(max(self.base.knots.shape[0], self.total.knots.shape[0]))

    @cached_property
    def _first(self) -> Array:
        """The place r >= 0 from which on the sum pushes, (m,)."""
        zero = np.zeros(self._rows)
        passed = count_knots(self.total.knots, zero[:, None], including=True)[:, 0]
        pushes = self.total.piece_derivative(passed, zero) >= 0.0
        found = self.total.local_argmin(zero, zero)
        return np.where(pushes, 0.0, np.where(np.isnan(found), np.inf, np.maximum(found, 0.0)))

    @cached_property
    def _table(self) -> tuple[Array, IntArray, IntArray]:
        """Knots, the kind of every piece (0 the law, 1 nothing, 2 the sum), and its number there."""
        rows, first = self._rows, self._first[:, None]
        own = np.broadcast_to(self.base.knots, (rows, self.base.knots.shape[-1]))
        both = np.broadcast_to(self.total.knots, (rows, self.total.knots.shape[-1]))
        places = [np.where(own < 0.0, own, np.inf), np.zeros((rows, 1)), first, np.where(both > first, both, np.inf)]
        knots = merged(np.concatenate(places, axis=-1))
        start = np.concatenate([np.full((rows, 1), -np.inf), knots], axis=-1)
        kind = np.where(start < 0.0, 0, np.where(start < first, 1, 2))
        of_law = np.where(np.isneginf(start), 0, count_knots(self.base.knots, start, including=True))
        of_sum = count_knots(self.total.knots, start, including=True)
        end = self.total.knots.shape[-1]
        number = np.where(kind == 0, of_law, np.where(np.isfinite(start), of_sum, end))
        return knots, kind, np.asarray(number, dtype=np.int64)

    @property
    def knots(self) -> Array:
        return self._table[0]

    @property
    def domain(self) -> Interval:
        return self.total.domain

    def _evaluate(self, piece: IntArray, r: Array, what: str) -> Array:
        kind, number = (pick(part, np.asarray(piece)) for part in self._table[1:])
        law = getattr(self.base, what)(np.minimum(number, self.base.knots.shape[-1]), r)
        both = getattr(self.total, what)(np.minimum(number, self.total.knots.shape[-1]), r)
        return np.where(kind == 0, law, np.where(kind == 2, both, 0.0))

    @cached_property
    def _before(self) -> Array:
        """The value of the sum where it begins to push."""
        return self.total.value(np.where(np.isfinite(self._first), self._first, 0.0))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        kind = pick(self._table[1], np.asarray(piece))
        return self._evaluate(piece, r, "piece_value") - np.where(kind == 2, self._before, 0.0)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._evaluate(piece, r, "piece_derivative")

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._evaluate(piece, r, "piece_curvature")

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        left, right = super().knot_slopes()
        knots, first = self._table[0], self._first[:, None]
        joined = (knots == first) & (first > 0.0) & np.isfinite(knots)
        smooth = joined & ~self.total.at_kink(np.where(np.isfinite(self._first), self._first, 0.0))[:, None]
        right = np.where(smooth, 0.0, np.where(joined, np.maximum(right, 0.0), right))
        kind = self._table[1]
        for i in range(knots.shape[-1]):  # elsewhere there are kinks only where law and sum have them
            for which, law in enumerate((self.base, None, self.total)):
                if law is not None:
                    within = (kind[:, i] == which) & (kind[:, i + 1] == which) & np.isfinite(knots[:, i])
                    plain = within & ~law.at_kink(np.where(within, knots[:, i], 0.0))
                    right[:, i] = np.where(plain, left[:, i], right[:, i])
        return left, right

    def knot_slopes(self) -> tuple[Array, Array]:
        return self._slopes

    def piece_formula(self, piece: int) -> str:
        kind, number = int(self._table[1][0, piece]), int(self._table[2][0, piece])
        return "0" if kind == 1 else (self.base if kind == 0 else self.total).piece_formula(number)

    @property
    def weak_convexity(self) -> Array:
        left, right = self._slopes
        return np.where(np.any(right < left, axis=-1), np.inf, 0.0)

    @property
    def growth(self) -> tuple[Array, Array]:
        constants = self.base.growth, self.total.growth
        c0, c1 = (np.maximum(one, other) for one, other in zip(*constants, strict=True))
        return c0, c1

    def recession(self, sign: Array) -> Array:
        up = np.where(np.isfinite(self._first), self.total.recession(np.abs(sign)), 0.0)
        return np.where(np.asarray(sign) > 0.0, up, self.base.recession(sign))

    def asymptotic_curvature(self, sign: float) -> Array:
        if sign < 0.0:
            return self.base.asymptotic_curvature(sign)
        return np.where(np.isfinite(self._first), self.total.asymptotic_curvature(sign), 0.0)

    def take(self, index: IntArray) -> PushingLaw:
        return PushingLaw(*(law.take(index) if law.knots.shape[0] > 1 else law for law in self.made_of))
