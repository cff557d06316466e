"""A law of a slip that is counted from elsewhere, with a constant friction beside it: ``j(r) = base(r - c) + l.r``."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.superpotential import Interval
from hemivar.laws.vector_law import Linearisation, Sides, VectorLaw, lengths, spread

__all__ = ["ShiftedLaw"]


@dataclass(frozen=True, eq=False)
class ShiftedLaw(VectorLaw):
    """A law with resolved parameters, its slip counted from ``shift``, and a constant friction ``pull``.

    Attributes
    ----------
    base : ContactLaw
        Its bound depends on no state.
    shift, pull : arrays (m or 1, c - 1 or 1)
        Slip (length) and multiplier (force per area).
    """

    base: ContactLaw
    shift: Array
    pull: Array
    name: ClassVar[str] = "shifted law"  # type: ignore[misc]

    @property
    def not_separable(self) -> str:
        return "the slip of this law is counted from a slip that it remembers"

    def at(self, points: Array | None) -> ShiftedLaw:
        if points is not None and len(self.shift) not in (1, len(points)):
            raise ProblemError(
                f"the law of this step is for {len(self.shift)} contact points, and there are {len(points)}; take the "
                "mesh of the step before"
            )
        return self

    def take(self, index: IntArray) -> ShiftedLaw:
        shift, pull = (part if len(part) == 1 else part[index] for part in (self.shift, self.pull))
        return ShiftedLaw(self.base.take(index), shift, pull)

    def _whole(self, part: Array, r: Array) -> Array:
        """(m, c), zero in the normal component."""
        out = np.zeros(r.shape)
        out[:, 1:] = part
        return out

    def from_shift(self, r: Array) -> Array:
        """Displacements as the base law sees them."""
        return np.asarray(r - self._whole(self.shift, r))

    def without_pull(self, lam: Array) -> Array:
        """Multipliers as the base law sees them."""
        return np.asarray(lam - self._whole(self.pull, lam))

    def value(self, r: Array) -> Array:
        zero = self.base.value(self.from_shift(np.zeros(r.shape)))
        work = (self._whole(self.pull, r) * r).sum(axis=1)
        return np.asarray(self.base.value(self.from_shift(r)) - zero + work)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        return self.base.graph_distance(self.from_shift(r), self.without_pull(lam), tau)

    def kinks_along(self, start: Array, end: Array, bend: Array) -> Array:
        return self.base.kinks_along(self.from_shift(start), self.from_shift(end), bend)

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        own = self.base.nearest_multiplier(self.from_shift(r), self.without_pull(lam))
        return np.asarray(own + self._whole(self.pull, lam))

    def clamp(self, start: Array, end: Array) -> Array:
        return self._back(self.base.clamp(self.from_shift(start), self.from_shift(end)))

    def linearise(self, r: Array) -> Linearisation:
        line = self.base.linearise(self.from_shift(r))
        pull = np.where(line.smooth[:, 1:], self._whole(self.pull, r), 0.0)
        return replace(line, gradient=line.gradient + pull)

    def local_argmin(self, a: Array, b: Array) -> Array:
        return self._back(self.base.local_argmin(a, self._force(a, b)))

    def downhill(self, a: Array, b: Array, r: Array) -> Array:
        return self._back(self.base.downhill(a, self._force(a, b), self.from_shift(r)))

    def _force(self, a: Array, b: Array) -> Array:
        return np.asarray(self.without_pull(b) - spread(a, b.shape[1]) * self._whole(self.shift, b))

    def _back(self, r: Array) -> Array:
        return np.asarray(r + self._whole(self.shift, r))

    def admissible(self, r: Array) -> Array:
        return self._back(self.base.admissible(self.from_shift(r)))

    def recession(self, direction: Array) -> Array:
        work = (self._whole(self.pull, direction) * direction).sum(axis=1)
        return np.asarray(self.base.recession(direction) + work)

    @property
    def rates(self) -> tuple[Array, Array, Array]:
        up, down, slip = self.base.rates
        return up, down, np.asarray(slip - np.linalg.norm(self.pull, axis=1))

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        up, down, slip = self.base.strongest(self.from_shift(rest), size)
        return up, down, np.asarray(slip - np.linalg.norm(self.pull, axis=1))

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        return self.base.asymptotic_curvature(sign)

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        return self.base.weak_convexity

    def weak_convexity_within(self, reach: tuple[float, ...]) -> tuple[Array, Array]:
        return self.base.weak_convexity if self.alpha_reach == (np.inf, np.inf) else (np.full(1, np.inf),) * 2

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
        return np.asarray(self.base.rubs | self.pull.any(axis=1))

    def snap_to_kinks(self, r: Array, near: float) -> Array:
        return self._back(self.base.snap_to_kinks(self.from_shift(r), near))

    def fitted(self, r: Array, lam: Array, tau: Array) -> Array:
        return self._back(self.base.fitted(self.from_shift(r), self.without_pull(lam), tau))

    def sides(self, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
        return self.base.sides(self.from_shift(r), self.without_pull(lam), active, tau, slack)

    def at_normal_kink(self, r: Array) -> BoolArray:
        return self.base.at_normal_kink(r)

    def moves(self, r: Array, small: float) -> BoolArray:
        """Which points slip: those of whose slip the base law has a smaller slope than at rest."""
        size = lengths(self.from_shift(r)[:, 1:])
        bend = self.base.tangential.curvature(size)
        return np.asarray(bend < (1.0 - 1e-9) * self.base.tangential.curvature(np.zeros(len(r))))

    def pulls(self, r: Array) -> BoolArray:
        return self.base.pulls(self.from_shift(r))

    def past_peak(self, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0) -> BoolArray:
        return self.base.past_peak(self.from_shift(r), pull, near, slack)

    def resistance(self, r: Array, lam: Array) -> Array:
        """Whether a slip is resisted: infinite where the base law grows without bound."""
        slip = np.broadcast_to(self.base.rates[2], (len(r),))
        return np.where(slip > 0.0, slip, 0.0)
