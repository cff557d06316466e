"""A contact law in the compiled kernels: value, derivatives, local minimiser and residual at all points in one call.

The kernels read straight pieces from tables, and know the formulas of two friction profiles.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from ctypes import c_int64, c_void_p
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Self

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.kernels import kernels
from hemivar.kernels.library import Kernels
from hemivar.laws.minimisers import piece_bounds

if TYPE_CHECKING:
    from hemivar.laws.superpotential import Superpotential

__all__ = ["CompiledLaw", "LaidOut", "lay_out"]


class _Scalar(ctypes.Structure):
    """``ScalarLaw`` of laws.hpp."""

    _fields_ = [
        *((name, c_int64) for name in ("rows", "knots", "formula", "factors", "length")),
        *((name, c_void_p) for name in ("numbers", "factor")),
    ]


class _Point(ctypes.Structure):
    """``PointLaw`` of laws.hpp."""

    _fields_ = [("normal", _Scalar), ("slip", _Scalar)]


@dataclass(frozen=True, eq=False)
class LaidOut:
    """A scalar law as the kernels read it, see laws.hpp."""

    numbers: Array  # (m or 1, length)
    factor: Array  # by which it is multiplied, (m or 1,)
    knots: int
    formula: int
    largest: float  # of the numbers that are finite

    def times(self, factor: Array) -> Self:
        """The law times another factor (m or 1,)."""
        return replace(self, factor=np.atleast_1d(factor * self.factor))

    @property
    def fits(self) -> bool:
        """Whether no number overflows."""
        return bool(math.isfinite(self.largest * float(self.factor.max(initial=0.0))))

    def given(self, library: Kernels) -> _Scalar:
        """What the kernels are given; the arrays stay here."""
        rows, length = self.numbers.shape
        at = (library.address(self.numbers), library.address(self.factor))
        return _Scalar(rows, self.knots, self.formula, self.factor.size, length, *at)


def lay_out(law: Superpotential, formula: tuple[int, Array] | None = None) -> LaidOut | None:
    """The numbers of a law with resolved parameters; None where the kernels do not know it.

    They know straight pieces, and a ``formula`` on both sides of 0: its number and parameters (m or 1, k).
    """
    rows = law.rows
    if law.searched or not rows or not (law.straight or formula):
        return None
    domain, (left, right), knots = law.domain, law.knot_slopes(), law.knots
    alpha = law.weak_convexity if law.convex or law.proof("alpha").sure else np.inf
    parts = [
        *(np.broadcast_to(end, (rows,))[:, None] for end in (domain.lower, domain.upper, alpha)),
        np.stack([np.broadcast_to(part, knots.shape) for part in (knots, left, right)], axis=-1).reshape(rows, -1),
    ]
    number, parameters = formula or (0, np.concatenate(_pieces(law), axis=1))
    numbers = np.concatenate([*parts, np.broadcast_to(parameters, (rows, parameters.shape[1]))], axis=1)
    numbers = np.require(numbers, float, ["C", "A"])
    largest = float(np.abs(numbers).max(initial=0.0, where=np.isfinite(numbers)))
    return LaidOut(numbers, np.ones(1), knots.shape[1], number, largest)


def _pieces(law: Superpotential) -> list[Array]:
    """Six numbers (m, 6) of each straight piece: its anchor with slope and bend, its place nearest to the origin with
    slope and energy."""
    pieces, rows = [], law.rows
    knots = np.where(np.isfinite(law.knots), law.knots, 0.0)
    for i in range(knots.shape[-1] + 1):
        piece, anchor = np.full(rows, i, dtype=np.int64), knots[:, max(i - 1, 0)]
        low, high = piece_bounds(law, piece)
        nearest = np.clip(np.zeros(rows), low, high)
        nearest = np.where(np.isfinite(nearest), nearest, anchor)  # beyond the last knot that is used
        slope, bend = law.piece_line(piece, anchor)
        numbers = (anchor, slope, bend, nearest, law.piece_derivative(piece, nearest), law.piece_value(piece, nearest))
        pieces.append(np.stack([np.broadcast_to(number, (rows,)) for number in numbers], axis=1))
    return pieces


class CompiledLaw:
    """A normal law and friction in the compiled kernels; arrays of displacements and multipliers are (m, c)."""

    def __init__(self, library: Kernels, normal: LaidOut, slip: LaidOut) -> None:
        self._call, self._address = library.call, library.address
        self._parts = (normal, slip)
        self._law = _Point(normal.given(library), slip.given(library))
        self._at = ctypes.addressof(self._law)
        sizes = {part.numbers.shape[0] for part in self._parts} | {part.factor.size for part in self._parts}
        self._points = max(sizes)
        if sizes - {1, self._points}:
            raise ValueError(f"the parts of a law are for {sorted(sizes)} contact points")

    def __reduce__(self) -> str:
        raise TypeError("compiled laws belong to this process")

    @classmethod
    def of(cls, normal: Superpotential, slip: Superpotential, bounds: Array) -> Self | None:
        """A normal law, and friction by its profile and bounds; None where no kernels are there or know such laws."""
        library = kernels()
        profile = None if library is None else slip.laid_out
        own = None if profile is None else normal.laid_out
        if library is None or profile is None or own is None:
            return None
        friction = profile.times(bounds)
        return cls(library, own, friction) if own.fits and friction.fits else None

    def value(self, r: Array) -> Array:
        """As :meth:`hemivar.laws.ContactLaw.value`; so are the others."""
        r, out = self._given(r), np.empty(len(r))
        self._call.hv_law_value(self._at, *r.shape, self._address(r), self._address(out))
        return out

    def linearise(self, r: Array) -> tuple[BoolArray, Array, Array]:
        """Smooth parts, gradient and second derivatives."""
        r, (m, c) = self._given(r), r.shape
        parts = np.empty((m, 2), dtype=bool), np.empty((m, c)), np.empty((m, c, c))
        self._call.hv_law_linearise(self._at, m, c, self._address(r), *map(self._address, parts))
        return parts

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        """The multiplier of the law nearest to another."""
        return self._of_two(self._call.hv_law_nearest, r, lam)

    def clamp(self, start: Array, end: Array) -> Array:
        """Places cut back to the pieces of others."""
        return self._of_two(self._call.hv_law_clamp, start, end)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """Distances of pairs to the graph."""
        r = self._given(r)
        lam, tau, out = self._given(lam, r.shape), self._given(tau, (len(r), 2)), np.empty(len(r))
        at = (self._address(array) for array in (r, lam, tau, out))
        self._call.hv_law_distance(self._at, *r.shape, *at)
        return out

    def local_argmin(self, a: Array, b: Array) -> Array | None:
        """Minimisers of local problems; None where a law bends more than a, or a point has none."""
        b = self._given(b)
        a, out = self._given(a, (len(b), 2)), np.empty(b.shape)
        at = (self._address(array) for array in (a, b, out))
        return None if self._call.hv_law_minimise(self._at, *b.shape, *at) else out

    def _of_two(self, function: Callable[..., object], first: Array, second: Array) -> Array:
        first, second, out = self._given(first), self._given(second, first.shape), np.empty(first.shape)
        function(self._at, *first.shape, *(self._address(array) for array in (first, second, out)))
        return out

    def _given(self, x: Array, shape: tuple[int, ...] | None = None) -> Array:
        """An array as the kernels read it."""
        array = np.require(x if shape in (None, x.shape) else np.broadcast_to(x, shape), float, ["C", "A"])
        if array.ndim != 2 or self._points not in (1, len(array)):
            raise ValueError(f"a law of {self._points} contact points is asked with an array of shape {array.shape}")
        return array
