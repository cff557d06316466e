"""A mixed-mode law on the pieces on which displacements lie, and the directions in which it bends there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.vector_law import Sides

if TYPE_CHECKING:
    from hemivar.laws.coupled.mixed_mode import MixedMode

__all__ = ["NearMixedMode", "principal_sides", "row_entries"]


@dataclass(frozen=True, eq=False)
class NearMixedMode:
    """A law on the pieces of rho on which r lies, and on its side of opening or penetration."""

    law: MixedMode
    r: Array

    @cached_property
    def _open(self) -> BoolArray:
        return np.asarray(self.r[:, 0] < 0.0)

    @cached_property
    def _rho(self) -> Array:
        return self.law.effective(self.r)

    @cached_property
    def piece(self) -> IntArray:
        """Piece of rho, (m,)."""
        return self.law.piece_of(self._rho)

    def secant(self, piece: IntArray) -> Array:
        """``Phi'/rho`` on given pieces, (m,)."""
        return self.law.curve_on(self._rho, piece)[0]

    def hessian(self, piece: IntArray) -> Array:
        """Second derivative (m, c, c) on given pieces, of the penetration as on its own piece."""
        law, r = self.law, self.r
        d, beta = r.shape[1], np.broadcast_to(law.beta, (len(r),))
        secant, slope = law.curve_on(self._rho, piece)
        metric = np.ones(r.shape)
        metric[:, 1:] = (beta**2)[:, None]
        along = np.where(self._rho > 0.0, 1.0, 0.0)[:, None] * metric * r
        along[:, 0] = np.where(self._open, along[:, 0], 0.0)
        along /= np.where(self._rho > 0.0, self._rho, 1.0)[:, None]
        hessian = (slope - secant)[:, None, None] * along[:, :, None] * along[:, None, :]
        hessian += (secant[:, None] * metric)[:, :, None] * np.eye(d)
        pushed = law.compression.curvature(np.maximum(r[:, 0], 0.0))
        hessian[:, 0, 0] = np.where(self._open, hessian[:, 0, 0], pushed)
        return hessian

    def clamp(self, end: Array) -> Array:
        out = end.copy()
        upper = self.law.compression.domain.upper
        out[:, 0] = np.where(self._open, np.minimum(out[:, 0], 0.0), np.clip(out[:, 0], 0.0, upper))
        knots = self.law.curve_knots
        zero, far = np.zeros((len(knots), 1)), np.full((len(knots), 1), np.inf)
        low, high = row_entries(np.concatenate([zero, knots], axis=1), self.piece), row_entries(
            np.concatenate([knots, far], axis=1), self.piece)  # fmt: skip
        rho = self.law.effective(out)
        cut = np.clip(rho, low, high)
        scale = np.where(cut == rho, 1.0, cut / np.where(rho > 0.0, rho, 1.0))
        out[:, 0] = np.where(self._open, out[:, 0] * scale, out[:, 0])
        out[:, 1:] *= scale[:, None]
        return np.where(((rho == 0.0) & (low > 0.0))[:, None], self.r, out)

    def gradient(self, place: Array) -> Array:
        law = self.law
        secant = law.curve_on(law.effective(place), self.piece)[0]
        out = secant[:, None] * place
        out[:, 1:] *= (law.beta**2)[:, None]
        inside = np.clip(place[:, 0], 0.0, law.compression.domain.upper)
        pushed = np.where(law.compression.at_kink(inside), 0.0, law.compression.derivative(inside))
        out[:, 0] = np.where(self._open, out[:, 0], pushed)
        return out

    def nearest_multiplier(self, lam: Array) -> Array:
        out = self.gradient(self.r)
        law = self.law.compression
        interval = law.subdifferential(np.clip(self.r[:, 0], 0.0, law.domain.upper))
        push = np.clip(lam[:, 0], interval.lower, np.maximum(interval.lower, interval.upper))
        out[:, 0] = np.where(self._open, out[:, 0], push)
        return out


def row_entries(table: Array, index: IntArray) -> Array:
    """One entry of each row, (m,); a table of one row is that of all."""
    if len(table) == 1:
        return np.asarray(table[0].take(index))
    return np.take_along_axis(table, index[:, None], axis=1)[:, 0]


def principal_sides(rows: IntArray, hessian: Array, active: BoolArray, jumps: BoolArray) -> list[Sides]:
    """Principal directions (k, c) of second derivatives between active components; weak ones where these jump."""
    d = hessian.shape[1]
    both = active[:, :, None] & active[:, None, :]
    apart = 10.0 * (1.0 + np.abs(hessian).max(axis=(1, 2)))
    masked = np.where(both, hessian, 0.0) + np.where(active, 0.0, apart[:, None])[:, :, None] * np.eye(d)
    values, vectors = np.linalg.eigh(masked)
    found = []
    for k in range(d):
        own = np.flatnonzero(k < active.sum(axis=1))  # those of held components are the last ones
        bend, none = values[own, k], np.zeros(own.size)
        higher = np.where(jumps[own], bend + apart[own], bend)
        found.append(Sides(rows[own], vectors[own, :, k], none, none, none, bend, higher))
    return found
