"""Friction that has slipped before: what is left of a law of the slip when its sum is s already."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.exact_table import MANY, count_knots, filled, merged, pick, table, table_of
from hemivar.laws.transformed.transformed_law import LawOfOne, by_parts, falls_between, numbers, row

__all__ = ["SlippedLaw", "homogeneous", "slipped"]


def homogeneous(profile: Superpotential) -> bool:
    """Whether a friction profile is a multiple of the size of the slip, so that it sees no rate and no sum."""
    found = table_of(profile)
    if found is None:
        return False
    free = np.isneginf(found.lower).all() and np.isposinf(found.upper).all()
    return bool(free and not found.slopes.any() and not ((found.jumps != 0.0) & (found.knots != 0.0)).any())


def slipped(profile: Superpotential, total: Array | float) -> Superpotential:
    """The profile ``H(s + |d|) - H(s)`` of the next slip d, after slips that sum up to s = ``total``.

    H is the profile; where it weakens, it does so with the slip sum, and does not recover when the slip turns round.
    Its alpha is the largest fall of h = H' beyond s.

    Parameters
    ----------
    profile : Superpotential
        Even, as friction profiles are; with resolved parameters.
    total : number or array (m,)
        s >= 0.

    Returns
    -------
    Superpotential
    """
    known = numbers(total, f"the slip sum of friction law '{profile.name}'", least=0.0)
    stacked = by_parts(profile, lambda part, index: slipped(part, row(known, index)))
    if stacked is not None:
        return stacked
    if (known == 0.0).all() or homogeneous(profile):
        return profile
    total = np.minimum(known, profile.domain.upper)
    base = table_of(profile)
    if base is None or (base.knots.shape[-1] > MANY and total.size > 1):
        return SlippedLaw(profile, total)
    return _slipped_table(base, total, profile.name)


def _ahead(knots: Array, total: Array) -> Array:
    """The knots beyond the sum, counted from it: (m, n), +inf where unused."""
    rows = max(knots.shape[0], total.size)
    knots = np.broadcast_to(knots, (rows, knots.shape[-1]))
    gap = knots - total[:, None]
    return merged(np.where((knots > total[:, None]) & (gap > 0.0), gap, np.inf))


def _slipped_table(base: PiecewiseQuadratic, total: Array, name: str) -> PiecewiseQuadratic:
    ahead = _ahead(base.knots, total)
    rows, used = len(ahead), np.isfinite(ahead)
    ahead = filled(np.concatenate([np.zeros((rows, 1)), ahead], axis=-1))  # from the sum itself on
    passed = count_knots(base.knots, np.broadcast_to(total[:, None], (rows, 1)), including=True)
    number = np.concatenate([passed, passed + np.cumsum(used, axis=-1)], axis=-1)
    slopes, anchor = pick(base.slopes, number), np.maximum(number - 1, 0)
    side = np.where(number == 0, pick(base._left, anchor), pick(base._right, anchor))
    along = side + slopes * (total[:, None] + ahead - pick(base.breakpoints, anchor))
    first, ahead, along, own = along[:, :1], ahead[:, 1:], along[:, 1:], anchor[:, 1:]
    below, above = np.where(used, pick(base._left, own), along), np.where(used, pick(base._right, own), along)
    upper = np.broadcast_to(np.asarray(base.upper) - total, (rows,))
    return table(
        np.concatenate([-ahead[:, ::-1], np.zeros((rows, 1)), ahead], axis=-1),
        np.concatenate([slopes[:, ::-1], slopes], axis=-1),
        np.concatenate([-above[:, ::-1], -first, below], axis=-1),
        np.concatenate([-below[:, ::-1], first, above], axis=-1),
        (-upper, upper),
        name,
    )


@dataclass(frozen=True, eq=False)
class SlippedLaw(LawOfOne):
    """``H(s + |d|) - H(s)`` of any profile H; see :func:`slipped`."""

    base: Superpotential
    total: Array

    @cached_property
    def knots(self) -> Array:  # type: ignore[override]
        ahead = _ahead(self.base.knots, self.total)
        behind = np.where(np.isfinite(ahead), -ahead, np.inf)
        return merged(np.concatenate([behind, np.zeros((len(ahead), 1)), ahead], axis=-1))

    @property
    def domain(self) -> Interval:
        upper = np.broadcast_to(self.base.domain.upper - self.total, (len(self.knots),))
        return Interval(-upper, upper)

    @cached_property
    def _map(self) -> tuple[IntArray, Array]:
        """The piece of the profile that each piece is a part of, and the direction of the slip on it."""
        knots = self.knots
        rows = len(knots)
        start = np.concatenate([np.full((rows, 1), -np.inf), knots], axis=-1)
        end = np.concatenate([knots, np.full((rows, 1), np.inf)], axis=-1)
        backwards = end <= 0.0
        near = np.where(backwards, -end, start)  # the end that has slipped less
        count = self.base.knots.shape[-1]
        ahead = _ahead(self.base.knots, self.total)
        passed = count_knots(self.base.knots, np.broadcast_to(self.total[:, None], (rows, 1)), including=True)
        number = passed + count_knots(ahead, np.where(np.isfinite(near), near, 0.0), including=True)
        number = np.where(np.isfinite(near), number, count)
        return np.minimum(number, count), np.where(backwards, -1.0, 1.0)

    def _at(self, piece: IntArray, r: Array) -> tuple[IntArray, Array, Array]:
        piece = np.asarray(piece)
        own, sign = pick(self._map[0], piece), pick(self._map[1], piece)
        return own, self.total + np.maximum(sign * np.asarray(r), 0.0), sign

    @cached_property
    def _start(self) -> Array:
        return self.base.value(np.broadcast_to(self.total, (len(self.knots),)))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        own, s, _ = self._at(piece, r)
        return self.base.piece_value(own, s) - self._start

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        own, s, sign = self._at(piece, r)
        return sign * self.base.piece_derivative(own, s)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        own, s, _ = self._at(piece, r)
        return self.base.piece_curvature(own, s)

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        left, right = super().knot_slopes()
        base_left, base_right = self.base.knot_slopes()
        own, _ = self._map
        for i in range(self.knots.shape[-1]):
            ahead = (self.knots[:, i] > 0.0) & np.isfinite(self.knots[:, i])
            at = np.maximum(own[:, i + 1] - 1, 0)
            left[:, i] = np.where(ahead, pick(base_left, at), left[:, i])
            right[:, i] = np.where(ahead, pick(base_right, at), right[:, i])
            behind = self.knots[:, i] < 0.0
            at = np.maximum(own[:, i] - 1, 0)
            left[:, i] = np.where(behind, -pick(base_right, at), left[:, i])
            right[:, i] = np.where(behind, -pick(base_left, at), right[:, i])
        return left, right

    def knot_slopes(self) -> tuple[Array, Array]:
        return self._slopes

    def piece_formula(self, piece: int) -> str:
        own, sign = self._map
        text = self.base.piece_formula(int(own[0, piece]))
        s = f"{float(self.total[0]):.6g}"
        if not text:
            return ""
        return f"({text}) at {s} + r" if sign[0, piece] > 0.0 else f"-({text}) at {s} - r"

    @cached_property
    def weak_convexity(self) -> Array:  # type: ignore[override]
        left, right = self._slopes
        upper = self.domain.upper[..., None]
        inner = (self.knots > -upper) & (self.knots < upper)
        worst = np.zeros(len(self.knots))
        own, sign = self._map
        for i in range(self.knots.shape[-1] + 1):
            low, high = (np.broadcast_to(end, worst.shape) for end in self.piece_bounds(np.full(worst.shape, i)))
            ahead = sign[:, i] > 0.0
            falls = falls_between(self.base, own[:, i], self.total + low, self.total + high)
            worst = np.maximum(worst, np.where(ahead & (low < high), falls, 0.0))
        return np.where(np.any(inner & (right < left), axis=-1), np.inf, worst)

    @property
    def growth(self) -> tuple[Array, Array]:
        c0, c1 = self.base.growth
        with np.errstate(invalid="ignore"):
            return np.where(np.isfinite(c1), c0 + c1 * self.total, np.inf), c1 + 0.0 * self.total

    def recession(self, sign: Array) -> Array:
        return np.asarray(self.base.recession(np.abs(sign)) + 0.0 * self.total)

    def asymptotic_curvature(self, sign: float) -> Array:
        return self.base.asymptotic_curvature(1.0) + 0.0 * self.total
