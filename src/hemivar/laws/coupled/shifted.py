"""Laws of the slip beside a base law, and one of them: a slip that is counted from elsewhere, and a constant friction.

It is ``j(r) = base(r - c) + l.r``.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.proof import Constant, Proof, of_alpha
from hemivar.laws.superpotential import Interval
from hemivar.laws.vector_law import Linearisation, Sides, VectorLaw, lengths, spread

__all__ = ["LawBeside", "ShiftedLaw"]


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

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        return self.base.asymptotic_curvature(sign)

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        return self.base.weak_convexity

    def proof(self, constant: Constant) -> Proof:
        return self.base.proof(constant)

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

    def past_peak(self, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0) -> BoolArray:
        return self.base.past_peak(self.seen(r), pull, near, slack)

    def debonding(self, r: Array) -> dict[str, Array]:
        return self.base.debonding(self.seen(r))


@dataclass(frozen=True, eq=False)
class ShiftedLaw(LawBeside):
    """A law with resolved parameters, its slip counted from ``shift``, and a constant friction ``pull``."""

    base: ContactLaw  # its bound depends on no state
    shift: Array  # slip, (m or 1, c - 1 or 1)
    pull: Array  # multiplier, force per area
    name: ClassVar[str] = "shifted law"  # type: ignore[misc]

    @property
    def not_separable(self) -> str:
        return "the slip of this law is counted from a stored slip"

    def at(self, points: Array | None) -> ShiftedLaw:
        if points is not None and len(self.shift) not in (1, len(points)):
            raise ProblemError(
                f"the law of this step is for {len(self.shift)} contact points, and there are {len(points)}; take the "
                "mesh of the step before"
            )
        return self

    @property
    def beside(self) -> Array:
        return -lengths(self.pull)

    def take(self, index: IntArray) -> ShiftedLaw:
        shift, pull = (part if len(part) == 1 else part[index] for part in (self.shift, self.pull))
        return ShiftedLaw(self.base.take(index), shift, pull)

    def _whole(self, part: Array, r: Array) -> Array:
        """(m, c), zero in the normal component."""
        out = np.zeros(r.shape)
        out[:, 1:] = part
        return out

    def seen(self, r: Array) -> Array:
        return np.asarray(r - self._whole(self.shift, r))

    def without_pull(self, lam: Array) -> Array:
        """Multipliers as the base law sees them."""
        return np.asarray(lam - self._whole(self.pull, lam))

    def value(self, r: Array) -> Array:
        zero = self.base.value(self.seen(np.zeros(r.shape)))
        work = (self._whole(self.pull, r) * r).sum(axis=1)
        return np.asarray(self.base.value(self.seen(r)) - zero + work)

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        return self.base.graph_distance(self.seen(r), self.without_pull(lam), tau)

    def kinks_along(self, start: Array, end: Array, bend: Array) -> Array:
        return self.base.kinks_along(self.seen(start), self.seen(end), bend)

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        own = self.base.nearest_multiplier(self.seen(r), self.without_pull(lam))
        return np.asarray(own + self._whole(self.pull, lam))

    def clamp(self, start: Array, end: Array) -> Array:
        return self._back(self.base.clamp(self.seen(start), self.seen(end)))

    def linearise(self, r: Array) -> Linearisation:
        line = self.base.linearise(self.seen(r))
        pull = np.where(line.smooth[:, 1:], self._whole(self.pull, r), 0.0)
        return replace(line, gradient=line.gradient + pull)

    def local_argmin(self, a: Array, b: Array) -> Array:
        return self._back(self.base.local_argmin(a, self._force(a, b)))

    def local_minimiser(self, a: Array, b: Array, r: Array) -> Array:
        return self._back(self.base.local_minimiser(a, self._force(a, b), self.seen(r)))

    def _force(self, a: Array, b: Array) -> Array:
        return np.asarray(self.without_pull(b) - spread(a, b.shape[1]) * self._whole(self.shift, b))

    def _back(self, r: Array) -> Array:
        return np.asarray(r + self._whole(self.shift, r))

    def admissible(self, r: Array) -> Array:
        return self._back(self.base.admissible(self.seen(r)))

    def recession(self, direction: Array) -> Array:
        work = (self._whole(self.pull, direction) * direction).sum(axis=1)
        return np.asarray(self.base.recession(direction) + work)

    def proof(self, constant: Constant) -> Proof:
        known = self.base.proof(constant)
        if constant != "alpha" or known.sure:
            return known
        return replace(known, values=of_alpha(known.whole(), lambda part: self.weak_convexity[part]).values)

    def kinks(self, r: Array) -> tuple[Array, Array]:
        normal, slip = self.base.kinks(self.seen(r))
        return normal, np.asarray(slip + self.shift)

    def fitted(self, r: Array, lam: Array, tau: Array) -> Array:
        return self._back(self.base.fitted(self.seen(r), self.without_pull(lam), tau))

    def sides(self, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
        return self.base.sides(self.seen(r), self.without_pull(lam), active, tau, slack)

    def moves(self, r: Array, small: float) -> BoolArray:
        """Which points slip: those of whose slip the base law has a smaller slope than at rest."""
        size = lengths(self.seen(r)[:, 1:])
        bend = self.base.tangential.curvature(size)
        return np.asarray(bend < (1.0 - 1e-9) * self.base.tangential.curvature(np.zeros(len(r))))

    def resistance(self, r: Array, lam: Array) -> Array:
        """Whether a slip is resisted: infinite where the base law grows without bound."""
        slip = np.broadcast_to(self.base.rates[2], (len(r),))
        return np.where(slip > 0.0, slip, 0.0)
