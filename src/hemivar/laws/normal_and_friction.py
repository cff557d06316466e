"""What laws with a normal law and friction beside it have in common, whichever way the friction may point."""

from __future__ import annotations

from dataclasses import replace
from typing import Self

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.friction.friction_law import Friction
from hemivar.laws.neighbourhood import lengths
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.vector_law import VectorLaw

__all__ = ["NormalAndFriction"]


class NormalAndFriction(VectorLaw):
    """A dataclass with the fields ``normal`` and ``friction``: a part of the penetration plus one of the slip."""

    normal: Superpotential
    friction: Friction

    @property
    def name(self) -> str:  # type: ignore[override]
        """Name of the normal law, used in messages."""
        return self.normal.name

    def at(self, points: Array | None) -> Self:
        return replace(self, normal=self.normal.at(points), friction=self.friction.at(points))  # type: ignore[type-var]

    def take(self, index: IntArray) -> Self:
        return replace(self, normal=self.normal.take(index), friction=self.friction.take(index))  # type: ignore[type-var]

    # ---- the bound --------------------------------------------------------------------------------------

    @property
    def state_dependent(self) -> bool:
        return self.friction.state_dependent

    def frozen(self, r: Array, lam: Array) -> Self:
        if not self.state_dependent:
            return self
        r, lam = np.asarray(r, dtype=float), np.asarray(lam, dtype=float)
        return replace(self, friction=self.friction.frozen(r[:, 0], lam[:, 0]))  # type: ignore[type-var]

    def frozen_at(self, r: Array) -> Self:
        if not self.state_dependent:
            return self
        lam = np.zeros(r.shape)
        interval = self._pressures(r)
        lam[:, 0] = np.clip(0.0, interval.lower, interval.upper)
        return self.frozen(r, lam)

    def _pressures(self, r: Array) -> Interval:
        """The pressures of the normal law at r, cut at the ends of its domain."""
        ends = self.normal.domain
        return self.normal.subdifferential(np.clip(r[:, 0], ends.lower, ends.upper))

    @property
    def lipschitz(self) -> Array:
        bound = self.friction.bound
        return bound.lipschitz if isinstance(bound, StateBound) else np.zeros(1)

    @property
    def lipschitz_sampled(self) -> bool:
        bound = self.friction.bound
        if not isinstance(bound, StateBound):
            return False
        rises = np.any((bound.lipschitz > 0.0) & (bound.lipschitz < np.inf))
        return bound.lipschitz_sampled or (bool(rises) and self.friction.profile.growth_sampled)

    def resistance(self, r: Array, lam: Array) -> Array:
        return self.friction.frozen(r[:, 0], lam[:, 0]).bounds

    @property
    def rubs(self) -> BoolArray:
        return np.asarray(self.state_dependent or self.friction.bounds > 0.0)

    # ---- what is known of the parts ---------------------------------------------------------------------

    @property
    def by_differences(self) -> bool:
        return self.normal.by_differences or self.friction.profile.by_differences

    def derivative_error(self, r: Array) -> Array:
        normal = np.broadcast_to(self.normal.derivative_error(r[:, 0]), r.shape[:1])
        if r.shape[1] == 1 or not self.friction.profile.by_differences:
            return normal
        return np.hypot(normal, self.friction.radial.derivative_error(lengths(r[:, 1:])))

    @property
    def alpha_reach(self) -> tuple[float, float]:
        return self.normal.alpha_reach, self.friction.profile.alpha_reach

    @property
    def constants_sampled(self) -> bool:
        return self.normal.constants_sampled or self.friction.profile.constants_sampled

    @property
    def softens(self) -> bool:
        normal, profile = self.normal.weak_convexity, self.friction.profile.weak_convexity
        return bool((normal > 0.0).any() or (profile > 0.0).any())

    @property
    def penetrations(self) -> Interval:
        return self.normal.domain

    @property
    def penetration_knots(self) -> Array:
        return self.normal.knots

    def admissible(self, r: Array) -> Array:
        out = np.array(r, dtype=float)
        domain = self.normal.domain
        out[:, 0] = np.clip(out[:, 0], domain.lower, domain.upper)
        if out.shape[1] > 1:
            limit = np.broadcast_to(self.friction.profile.domain.upper, (len(out),))
            size = lengths(out[:, 1:])
            outside = size > limit
            out[outside, 1:] *= (limit[outside] / size[outside])[:, None]
        return out

    def at_normal_kink(self, r: Array) -> BoolArray:
        return self.normal.at_kink(r[:, 0])

    def pulls(self, r: Array) -> BoolArray:
        return np.asarray(self._pressures(r).lower < 0.0)

    def past_peak(self, r: Array, pull: Array, near: float, slack: float) -> BoolArray:
        return self.normal.past_peak(r[:, 0], pull, near, slack)

    def debonding(self, r: Array) -> dict[str, Array]:
        return self.normal.debonding(r[:, 0])
