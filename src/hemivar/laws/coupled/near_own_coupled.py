"""A law of one's own that couples, on the sides of its kinks on which displacements lie."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray
from hemivar.laws.neighbourhood import polar

if TYPE_CHECKING:
    from hemivar.laws.coupled.own_coupled import OwnCoupledLaw

__all__ = ["NearOwnCoupled"]


@dataclass(frozen=True, eq=False)
class NearOwnCoupled:
    """A law on the side of r = 0 on which r lies, and at rest or on the move."""

    law: OwnCoupledLaw
    r: Array

    @cached_property
    def _side(self) -> Array:
        """-1 in opening and 1 in penetration; r = 0 counts as penetration where it is a kink: there is contact."""
        shut = self.r[:, 0] >= 0.0 if self.law.hooked else self.r[:, 0] > 0.0
        return np.where(shut, 1.0, -1.0)

    @cached_property
    def _rests(self) -> BoolArray:
        return np.asarray(~self.r[:, 1:].any(axis=1) & self.law.resting)

    def clamp(self, end: Array) -> Array:
        out = end.copy()
        if self.law.hooked:
            out[:, 0] = np.where(self._side > 0.0, np.maximum(out[:, 0], 0.0), np.minimum(out[:, 0], 0.0))
        if self.law.rigid:
            out[:, 0] = np.minimum(out[:, 0], 0.0)
        if self.law.resting:
            backwards = np.einsum("mi,mi->m", self.r[:, 1:], end[:, 1:]) <= 0.0
            out[backwards, 1:] = 0.0
        return out

    def gradient(self, place: Array) -> Array:
        law = self.law
        normal, size, heading = law.split(place)
        by_r, by_s = law.slopes_at(np.minimum(normal, 0.0) if law.rigid else normal, size, self._side)
        kink = (normal >= 0.0) if law.rigid else (normal == 0.0) & law.kinked
        return np.concatenate([np.where(kink, 0.0, by_r)[:, None], by_s[:, None] * heading], axis=1)

    def nearest_multiplier(self, lam: Array) -> Array:
        law = self.law
        normal, size, heading = law.split(law.admissible(self.r))
        side = np.where(normal > 0.0, 1.0, -1.0)
        by_r, by_s = law.slopes_at(normal, size, side)
        out = np.concatenate([by_r[:, None], by_s[:, None] * heading], axis=1)
        hook = law.at_normal_kink(np.concatenate([normal[:, None], self.r[:, 1:]], axis=1))
        if hook.any():
            above = np.inf if law.rigid else law.slopes_at(normal, size, np.ones(len(normal)))[0]
            out[:, 0] = np.where(hook, np.clip(lam[:, 0], by_r, np.maximum(by_r, above)), by_r)
        if lam.shape[1] > 1:
            pull, along = polar(lam[:, 1:])
            rest = np.minimum(pull, np.maximum(by_s, 0.0))[:, None] * along
            out[:, 1:] = np.where(self._rests[:, None], rest, out[:, 1:])
        return out
