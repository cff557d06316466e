"""The law of an affine argument: of a rate, of a place half a step ahead, behind a moving gap or a worn surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed.exact_table import MANY, separated, table_of
from hemivar.laws.transformed.transformed_law import LawOfOne, by_parts, check_law, numbers, row

__all__ = ["AffineLaw", "affine"]


def affine(law: Superpotential, theta: Array | float, c: Array | float = 0.0) -> Superpotential:
    """The law ``j(theta r + c)/theta``, whose derivative is ``j'(theta r + c)``.

    With a rate ``v = a r + c`` it makes of a law of v one of r: ``affine(law, a, -a r_n)``.  Its alpha is theta times
    that of the law.  The constant is chosen so that it is zero at r = 0, as for every law.

    Parameters
    ----------
    law : Superpotential
        With resolved parameters.
    theta : number or array (m,)
        > 0.
    c : number or array (m,)
        Any.

    Returns
    -------
    Superpotential

    Raises
    ------
    ProblemError
        theta is not positive, or a number is not finite.
    """
    check_law(law)
    theta = numbers(theta, f"the factor of the argument of law '{law.name}'", above=0.0)
    c = numbers(c, f"the shift of the argument of law '{law.name}'")
    return _affine(law, theta, c)


def _affine(law: Superpotential, theta: Array, c: Array) -> Superpotential:
    if (theta == 1.0).all() and (c == 0.0).all():
        return law
    stacked = by_parts(law, lambda part, index: _affine(part, row(theta, index), row(c, index)))
    if stacked is not None:
        return stacked
    if isinstance(law, AffineLaw):
        return _affine(law.base, law.theta * theta, law.theta * c + law.c)
    base = table_of(law)
    if base is None or (base.knots.shape[-1] > MANY and max(theta.size, c.size) > 1):
        return AffineLaw(law, theta, c)
    factor, shift = theta[:, None], c[:, None]
    knots = (base.knots - shift) / factor
    ends = (np.asarray(base.lower) - c) / theta, (np.asarray(base.upper) - c) / theta
    if np.any((knots[:, 1:] <= knots[:, :-1]) & np.isfinite(knots[:, 1:])):
        if np.isfinite(ends).any():  # rounding has closed a piece: then the law itself is asked
            return AffineLaw(law, theta, c)
        knots = separated(knots)
    return PiecewiseQuadratic.with_sides(knots, factor * base.slopes, base._left, base._right, ends, law.name)


@dataclass(frozen=True, eq=False)
class AffineLaw(LawOfOne):
    """The law ``j(theta r + c)/theta`` of any law; every question is handed on to it."""

    base: Superpotential
    theta: Array
    c: Array

    @property
    def _rows(self) -> int:
        return int(np.broadcast_shapes(self.theta.shape, self.c.shape, self.base.knots.shape[:1])[0])

    def _outer(self, s: Array) -> Array:
        """The place r that belongs to each argument."""
        return np.asarray((s - self.c) / self.theta)

    def _inner(self, r: Array) -> Array:
        """The argument theta r + c, and the knot itself where r is the place of one."""
        r = np.asarray(r, dtype=float)
        s = np.asarray(self.theta * r + self.c)
        shared = self.base.shared_knots
        if shared is not None:
            near = np.searchsorted(shared, s, side="left")
            columns = [shared[np.clip(near + k, 0, shared.size - 1)] for k in (-1, 0, 1)]
        else:
            knots = self.base.knots
            columns = [knots[..., k] for k in range(knots.shape[-1])]
        for knot in columns:
            s = np.where((self._outer(knot) == r) & np.isfinite(knot), knot, s)
        return s

    @cached_property
    def _at_zero(self) -> Array:
        bound = self.base.domain
        return self.base.value(np.clip(np.broadcast_to(self.c, (self._rows,)), bound.lower, bound.upper))

    @cached_property
    def _knots(self) -> Array:
        knots = (self.base.knots - self.c[:, None]) / self.theta[:, None]
        return np.broadcast_to(knots, (self._rows, knots.shape[-1]))

    @property
    def knots(self) -> Array:
        return self._knots

    @property
    def shared_knots(self) -> Array | None:
        one = self.theta.size == 1 and self.c.size == 1 and self.base.shared_knots is not None
        return self._knots[0] if one else None

    def slopes_at(self, knot: IntArray) -> tuple[Array, Array]:
        return self.base.slopes_at(knot)

    @property
    def straight(self) -> bool:
        return self.base.straight

    @property
    def domain(self) -> Interval:
        return self._domain

    @cached_property
    def _domain(self) -> Interval:
        bound = self.base.domain
        rows = (self._rows,)
        return Interval(
            np.broadcast_to(self._outer(bound.lower), rows), np.broadcast_to(self._outer(bound.upper), rows)
        )

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return (self.base.piece_value(piece, self.theta * r + self.c) - self._at_zero) / self.theta

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self.base.piece_derivative(piece, self.theta * r + self.c)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self.theta * self.base.piece_curvature(piece, self.theta * r + self.c)

    def piece_line(self, piece: IntArray, r: Array) -> tuple[Array, Array]:
        slope, bend = self.base.piece_line(piece, self.theta * r + self.c)
        return slope, self.theta * bend

    def piece_of(self, r: Array) -> IntArray:
        return self.base.piece_of(self._inner(r))

    def piece_bounds(self, piece: IntArray) -> tuple[Array, Array]:
        low, high = self.base.piece_bounds(piece)
        return self._outer(low), self._outer(high)

    def knot_slopes(self) -> tuple[Array, Array]:
        return self._slopes

    @cached_property
    def _slopes(self) -> tuple[Array, Array]:
        left, right = self.base.knot_slopes()
        return np.broadcast_to(left, self._knots.shape), np.broadcast_to(right, self._knots.shape)

    def kinks(self) -> BoolArray:
        return np.broadcast_to(self.base.kinks(), self._knots.shape)

    def at_kink(self, r: Array) -> BoolArray:
        return self.base.at_kink(self._inner(r))

    def subdifferential(self, r: Array) -> Interval:
        return self.base.subdifferential(self._inner(r))

    def graph_distance(self, r: Array, lam: Array, tau: Array | float) -> Array:
        return self.base.graph_distance(self._inner(r), lam, np.asarray(tau) * self.theta)

    def derivative_error(self, r: Array) -> Array:
        return self.base.derivative_error(self._inner(r))

    def piece_formula(self, piece: int) -> str:
        text = self.base.piece_formula(piece)
        return text and f"({text}) at {float(self.theta[0]):.6g} r {float(self.c[0]):+.6g}"

    @property
    def weak_convexity(self) -> Array:
        return self.theta * self.base.weak_convexity

    @property
    def growth(self) -> tuple[Array, Array]:
        c0, c1 = self.base.growth
        with np.errstate(invalid="ignore"):
            return np.where(np.isfinite(c1), c0 + c1 * np.abs(self.c), np.inf), c1 * self.theta

    def recession(self, sign: Array) -> Array:
        return np.asarray(self.base.recession(sign) + np.zeros(self.theta.shape))

    def asymptotic_curvature(self, sign: float) -> Array:
        return self.theta * self.base.asymptotic_curvature(sign)

    # ---- the local problem in the argument of the law: a/theta s^2/2 - (b + a c/theta) s + j(s), over theta -----

    def _local(self, a: Array, b: Array) -> tuple[Array, Array]:
        a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
        return a / self.theta, b + a * self.c / self.theta

    def local_argmin(self, a: Array, b: Array) -> Array:
        return self._outer(self.base.local_argmin(*self._local(a, b)))

    def local_minimisers(self, a: Array, b: Array) -> tuple[Array, Array]:
        points, energies = self.base.local_minimisers(*self._local(a, b))
        a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
        moved = self.c * (0.5 * a * self.c / self.theta + b) / self.theta - self._at_zero / self.theta
        theta, c = self.theta[:, None], self.c[:, None]
        return (points - c) / theta, energies / theta + moved[..., None]

    def stationary_point(
        self, piece: IntArray, a: Array, b: Array, low: Array, high: Array, admissible: BoolArray
    ) -> tuple[Array, BoolArray]:
        low, high = self.theta * low + self.c, self.theta * high + self.c
        s, found = self.base.stationary_point(piece, *self._local(a, b), low, high, admissible)
        return self._outer(s), found
