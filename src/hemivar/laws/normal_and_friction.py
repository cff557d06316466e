"""Base of contact laws that split into a normal law and friction, isotropic or not."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Self

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import MethodError, ProblemError
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.friction.friction_law import Friction, SlipMeasure, friction_in_increments
from hemivar.laws.friction.profiles import ABSOLUTE_VALUE
from hemivar.laws.glue import Glue
from hemivar.laws.proof import Constant, Proof, beside, worst
from hemivar.laws.scalar_graph import past_peak
from hemivar.laws.superpotential import Interval, Superpotential
from hemivar.laws.transformed import plus, secant
from hemivar.laws.transformed.algebra import secant_stiffness
from hemivar.laws.vector_law import VectorLaw, lengths, stores_slip

__all__ = ["NormalAndFriction", "damped", "with_friction"]


class NormalAndFriction(Glue):
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

    def with_parts(self, normal: Superpotential | None = None, friction: Friction | None = None) -> Self:
        """The law with another part; None leaves it as it is."""
        normal = self.normal if normal is None else normal
        return replace(self, normal=normal, friction=self.friction if friction is None else friction)  # type: ignore[type-var]

    # ---- in time ----------------------------------------------------------------------------------------

    @property
    def follows_slip(self) -> bool:
        return self.friction.of is SlipMeasure.SLIP

    def in_increments(self, rate: float) -> Self:
        friction = friction_in_increments(self.friction, rate)
        return self if friction is self.friction else self.with_parts(friction=friction)

    def at_rest(self) -> Self:
        if self.friction.profile.convex:
            return self
        profile = self.friction.profile
        static = profile.subdifferential(np.zeros(len(profile.knots))).upper
        return self.with_parts(friction=replace(self.friction, profile=ABSOLUTE_VALUE.scaled(static)))

    def stored_energy(self, r: Array) -> Array:
        return self.value(r) if stores_slip(self) else self.normal.value(r[:, 0])

    # ---- glue that remembers ----------------------------------------------------------------------------

    @property
    def remembers(self) -> bool:
        return self.normal.is_glue

    def damaged(self, known: Mapping[str, Array] | None, r: Array) -> dict[str, Array]:
        last = np.zeros(len(r)) if known is None else known["opening"]
        opening = np.minimum(np.maximum(last, -r[:, 0]), -self.normal.domain.lower)
        return {"opening": opening, "stiffness": secant_stiffness(self.normal, opening)}

    def unloading(self, known: Mapping[str, Array]) -> Self:
        return self.with_parts(secant(self.normal, known["opening"]))

    def unloading_energy(self, known: Mapping[str, Array], r: Array, of_law: Callable[[Array], Array]) -> Array:
        w = r[:, 0]
        along, shut = (w < 0.0) & (w >= -known["opening"]), r.copy()
        shut[along, 0] = 0.0
        return of_law(shut) + np.where(along, 0.5 * known["stiffness"] * w**2, 0.0)

    def spent_by(self, known: Mapping[str, Array]) -> Array:
        return np.asarray(self.normal.value(-known["opening"]) - 0.5 * known["stiffness"] * known["opening"] ** 2)

    def lost_by(self, known: Mapping[str, Array]) -> Array:
        lost = self.normal.debonding(-known["opening"])
        if "damage" not in lost or np.isnan(lost["damage"]).any():
            raise ProblemError(
                f"law '{self.normal.name}' has no damage on which friction could act; use Adhesive(...) or "
                "MixedMode(...)"
            )
        return lost["damage"]

    # ---- the bound --------------------------------------------------------------------------------------

    @property
    def state_dependent(self) -> bool:
        return self.friction.state_dependent

    def frozen(self, r: Array, lam: Array) -> Self:
        if not self.state_dependent:
            return self
        r, lam = np.asarray(r, dtype=float), np.asarray(lam, dtype=float)
        return replace(self, friction=self.friction.frozen(r[:, 0], lam[:, 0]))  # type: ignore[type-var]

    def pressures(self, r: Array) -> Interval:
        ends = self.normal.domain
        return self.normal.subdifferential(np.clip(r[:, 0], ends.lower, ends.upper))

    @property
    def lipschitz(self) -> Array:
        bound = self.friction.bound
        return bound.lipschitz if isinstance(bound, StateBound) else np.zeros(1)

    @property
    def steering(self) -> Array:
        rate, (steepest, growing) = self.lipschitz, self.friction.profile.growth
        steepest = np.where(growing > 0.0, np.inf, np.maximum(steepest, np.finfo(float).tiny))
        return np.where(rate > 0.0, np.where(rate > 0.0, rate, 1.0) * steepest, 0.0)

    def resistance(self, r: Array, lam: Array) -> Array:
        return self.friction.frozen(r[:, 0], lam[:, 0]).bounds

    @property
    def rubs(self) -> BoolArray:
        return np.asarray(self.state_dependent or self.friction.bounds > 0.0)

    # ---- what is known of the parts ---------------------------------------------------------------------

    def proof(self, constant: Constant) -> Proof:
        normal, profile, bound = self.normal, self.friction.profile, self.friction.bound
        if constant == "alpha":
            return beside(normal.proof("alpha"), profile.proof("alpha"))
        if constant == "growth":
            return worst([normal.proof("growth"), profile.proof("growth")])
        if not isinstance(bound, StateBound):
            return Proof()
        rises = np.any((bound.lipschitz > 0.0) & (bound.lipschitz < np.inf))
        return worst([bound.proof, profile.proof("growth")]) if rises else bound.proof

    @property
    def penetrations(self) -> Interval:
        return self.normal.domain

    @property
    def penetration_knots(self) -> Array:
        knots, bound = self.normal.knots, self.friction.bound
        if not isinstance(bound, StateBound) or bound.knots.shape[1] == 0:
            return knots
        rows = max(len(knots), len(bound.knots))
        both = [np.broadcast_to(table, (rows, table.shape[1])) for table in (knots, bound.knots)]
        return np.sort(np.concatenate(both, axis=1), axis=1)

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

    def past_peak(self, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0) -> BoolArray:
        return past_peak(self.normal, r[:, 0], pull, near, slack)

    def debonding(self, r: Array) -> dict[str, Array]:
        return self.normal.debonding(r[:, 0])


def with_friction(
    law: VectorLaw, what: str, why: str = "needs a normal law with friction beside it"
) -> NormalAndFriction:
    """The law as a normal law with friction, whichever way it may point; ``what`` asks for it in messages."""
    if not isinstance(law, NormalAndFriction):
        raise MethodError(f"{law.not_separable}, and {what} {why}")
    return law


def damped(law: VectorLaw, damping: Superpotential) -> VectorLaw:
    """The law with another one of the penetration in parallel; one that couples opening and slip is refused."""
    parts = with_friction(law, "damping of the normal rate", "is not known beside it; leave it out")
    return parts.with_parts(plus(parts.normal, damping))
