"""A contact law near a displacement: the pieces that it is smooth on, looked up once for many questions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray

if TYPE_CHECKING:
    from hemivar.laws.contact_law import ContactLaw
    from hemivar.laws.superpotential import Interval, Superpotential

__all__ = ["Neighbourhood", "lengths", "polar"]


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """A law on the pieces on which the local displacements r lie.

    Attributes
    ----------
    law : ContactLaw
        Its bound depends on no state.
    r : array (m, c)
    """

    law: ContactLaw
    r: Array

    def clamp(self, end: Array) -> Array:
        """``end (m, c)``, cut back to the pieces."""
        out = end.copy()
        out[:, 0] = self._normal.cut(end[:, 0])
        if end.shape[1] > 1:
            along = self._tangential
            backwards = (np.einsum("mi,mi->m", self._polar[1], end[:, 1:]) <= 0.0) & (along.lower == 0.0)
            length, heading = polar(end[:, 1:])
            out[:, 1:] = np.where(backwards, 0.0, along.cut(length))[:, None] * heading
        return out

    def gradient(self, place: Array) -> Array:
        """Derivatives (m, c) of the parts that are smooth at ``place (m, c)`` on the pieces, zero at kinks."""
        out = np.empty(place.shape)
        out[:, 0] = self._normal.derivative(place[:, 0])
        if place.shape[1] > 1:
            length, heading = polar(place[:, 1:])
            out[:, 1:] = self._tangential.derivative(length)[:, None] * heading
        return out

    def nearest_multiplier(self, lam: Array) -> Array:
        """The element of dj(r) nearest to ``lam``, (m, c); outside its domain r counts as at the end of it."""
        out, interval = np.empty_like(lam), self._pressures
        out[:, 0] = np.clip(lam[:, 0], interval.lower, np.maximum(interval.lower, interval.upper))
        if lam.shape[1] > 1:
            (size, direction), interval = self._polar, self._frictions
            along = np.clip(np.einsum("mi,mi->m", direction, lam[:, 1:]), interval.lower, interval.upper)
            length, heading = polar(lam[:, 1:])
            rest = np.minimum(length, np.maximum(interval.upper, 0.0))
            moving = (size > 0.0)[:, None]
            out[:, 1:] = np.where(moving, along[:, None] * direction, rest[:, None] * heading)
        return out

    @cached_property
    def _polar(self) -> tuple[Array, Array]:
        return polar(self.r[:, 1:])

    @cached_property
    def _normal(self) -> _OnPiece:
        law = self.law.normal
        return _OnPiece(law, law.piece_of(self.r[:, 0]))

    @cached_property
    def _tangential(self) -> _OnPiece:
        law = self.law.tangential
        return _OnPiece(law, law.piece_of(self._polar[0]))

    @cached_property
    def _pressures(self) -> Interval:
        law = self.law.normal
        return law.subdifferential(np.clip(self.r[:, 0], law.domain.lower, law.domain.upper))

    @cached_property
    def _frictions(self) -> Interval:
        law = self.law.tangential
        return law.subdifferential(np.minimum(self._polar[0], law.domain.upper))


@dataclass(frozen=True, eq=False)
class _OnPiece:
    """A scalar law on one piece for each point."""

    law: Superpotential
    piece: IntArray

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        return self.law.piece_bounds(self.piece)

    @property
    def lower(self) -> Array:
        return self._ends[0]

    @cached_property
    def _kinks(self) -> tuple[BoolArray, BoolArray]:
        """Whether either end is a kink."""
        return self.law.at_kink(self._ends[0]), self.law.at_kink(self._ends[1])

    def cut(self, r: Array) -> Array:
        return np.clip(r, *self._ends)

    def derivative(self, r: Array) -> Array:
        """j' at places on the pieces, zero at kinks."""
        (low, high), (first, last) = self._ends, self._kinks
        kink = (first & (r == low)) | (last & (r == high))
        return np.where(kink, 0.0, self.law.piece_derivative(self.piece, r))


def lengths(x: Array) -> Array:
    """Length of each row."""
    return np.abs(x[:, 0]) if x.shape[1] == 1 else np.sqrt(np.einsum("mi,mi->m", x, x))


def polar(x: Array) -> tuple[Array, Array]:
    """Length and direction of each row; the direction of a zero row is zero."""
    size = lengths(x)
    return size, x / np.where(size > 0.0, size, 1.0)[:, None]
