"""What a law has of another one that it stands beside."""

from __future__ import annotations

from abc import abstractmethod
from typing import Self

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.laws.superpotential import Interval
from hemivar.laws.vector_law import VectorLaw

__all__ = ["LawBeside"]


class LawBeside(VectorLaw):
    """A law of the slip beside ``base``, of which it has the penetration and all that is known of its constants."""

    base: VectorLaw

    @property
    @abstractmethod
    def beside(self) -> Array:
        """What is added to the resistance to a slip, (m or 1,)."""

    def seen(self, r: Array) -> Array:
        """Displacements as the base sees them."""
        return r

    def at(self, points: Array | None) -> Self:
        return self

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        return self.base.asymptotic_curvature(sign)

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        return self.base.weak_convexity

    def weak_convexity_within(self, reach: tuple[float, ...]) -> tuple[Array, Array]:
        return self.base.weak_convexity_within(reach)

    @property
    def alpha_reach(self) -> tuple[float, float]:
        return self.base.alpha_reach

    @property
    def penetrations(self) -> Interval:
        return self.base.penetrations

    @property
    def penetration_knots(self) -> Array:
        return self.base.penetration_knots

    @property
    def rubs(self) -> BoolArray:
        return np.asarray(self.base.rubs | (self.beside != 0.0))

    @property
    def rates(self) -> tuple[Array, Array, Array]:
        up, down, slip = self.base.rates
        return up, down, np.asarray(slip + self.beside)

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        up, down, slip = self.base.strongest(self.seen(rest), size)
        return up, down, np.asarray(slip + self.beside)

    def at_normal_kink(self, r: Array) -> BoolArray:
        return self.base.at_normal_kink(self.seen(r))

    def pulls(self, r: Array) -> BoolArray:
        return self.base.pulls(self.seen(r))

    def past_peak(self, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0) -> BoolArray:
        return self.base.past_peak(self.seen(r), pull, near, slack)

    def debonding(self, r: Array) -> dict[str, Array]:
        return self.base.debonding(self.seen(r))
