"""Rate-and-state friction (Dieterich-Ruina): a coefficient by the slip rate and the age of the contacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.types import Array, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.friction import ABSOLUTE_VALUE, Friction
from hemivar.laws.memory.contact_memory import LocalStep, Memory, MemoryState, kept, slide
from hemivar.laws.named import LawKind, named
from hemivar.laws.parameters import LENGTH, parameter, positive
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.vector_law import VectorLaw, splits

__all__ = ["RateAndState", "RateStateProfile"]

#: Largest exponent of the regularised law: exp overflows at 709, and friction differs only at rates below exp(-600).
_MOST = 600.0


@dataclass(frozen=True, eq=False)
class RateStateProfile(Superpotential):
    """The profile ``direct asinh(V exp(exponent))``, V = rate |d|, of the slip increment d; smooth and convex."""

    direct: Array
    exponent: Array
    rate: float
    name: str = "rate-and-state"
    examined: ClassVar[bool] = True  # type: ignore[misc]

    @property
    def knots(self) -> Array:
        return np.zeros((max(self.direct.size, self.exponent.size), 1))

    def _scaled_rate(self, r: Array) -> tuple[Array, Array]:
        """V and the logarithm of V exp(exponent)."""
        speed = self.rate * np.abs(np.asarray(r, dtype=float))
        with np.errstate(divide="ignore"):
            return speed, np.log(speed) + self.exponent

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        speed, z = self._scaled_rate(r)
        small, large = np.exp(np.minimum(z, 0.0)), np.exp(-np.maximum(z, 0.0))
        less = np.where(z > 0.0, 1.0 / (large + np.hypot(1.0, large)), small / (1.0 + np.hypot(1.0, small)))
        return np.asarray(self.direct * speed * (_asinh(z) - less) / self.rate)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return np.asarray(np.sign(r) * self.direct * _asinh(self._scaled_rate(r)[1]))

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        speed, _ = self._scaled_rate(r)
        return np.asarray(self.direct * self.rate / np.hypot(speed, np.exp(-self.exponent)))

    @property
    def weak_convexity(self) -> Array:
        return np.zeros(self.knots.shape[0])

    @property
    def growth(self) -> tuple[Array, Array]:
        """From the tangent at the rate at which the law begins to grow slowly."""
        slope = self.direct * self.rate * np.exp(self.exponent) / np.sqrt(2.0)
        return self.direct * np.arcsinh(1.0) + 0.0 * self.exponent, slope

    def recession(self, sign: Array) -> Array:
        rows = np.broadcast_shapes(np.shape(sign), self.direct.shape, self.exponent.shape)
        return np.broadcast_to(np.where(np.asarray(sign) == 0.0, 0.0, np.inf), rows)

    def asymptotic_curvature(self, sign: float) -> Array:
        return np.zeros(self.knots.shape[0])

    def piece_formula(self, piece: int) -> str:
        return f"{float(self.direct[0]):.6g} asinh({self.rate:.6g} r exp({float(self.exponent[0]):.6g}))"


def _asinh(z: Array) -> Array:
    """asinh(exp(z)), without overflow."""
    far = z + np.log1p(np.sqrt(1.0 + np.exp(-2.0 * np.maximum(z, 0.0))))
    return np.where(z > 0.0, far, np.arcsinh(np.exp(np.minimum(z, 0.0))))


@named(
    LawKind.MEMORY,
    "rate-and-state",
    "friction of rate and state with the ageing law, times the bound of Tresca's friction",
    "mu = direct asinh(V/(2 rate) exp((reference + evolution ln(rate theta/length))/direct)), "
    "theta' = 1 - V theta/length",
)
@dataclass(frozen=True, eq=False)
class RateAndState(Memory):
    """Rate-and-state friction of Dieterich and Ruina with the ageing law.

    The coefficient is ``mu = direct asinh(V/(2 V0) exp((reference + evolution ln(V0 theta/length))/direct))``, which is
    ``reference + direct ln(V/V0) + evolution ln(V0 theta/length)`` where it slips, and the age theta of the contacts
    obeys ``theta' = 1 - V theta/length``.  The friction is mu times the bound of the friction law, which must be
    Tresca's: ``Tresca(sigma)`` for a given normal pressure, ``Tresca(CoulombBound(1.0))`` for that of the contact.

    A step has theta frozen at its end; with the slip rate V of the last iterate it is integrated exactly, and iterated.
    With theta frozen the law is convex.  The state is ``age``, theta.

    Parameters
    ----------
    direct, evolution : Parameter
        a > 0 and b.
    length : Parameter
        Slip over which contacts are renewed, > 0.
    reference : Parameter
        Coefficient of steady slip at the rate V0.
    rate : Parameter
        V0 > 0.
    age : Parameter
        theta at the beginning, > 0 (time).
    """

    direct: Parameter = field(metadata=positive("effect of the rate", "1"))
    evolution: Parameter = field(metadata=parameter("effect of the age", "1"))
    length: Parameter = field(metadata=positive("slip that renews contacts", LENGTH))
    reference: Parameter = field(metadata=parameter("coefficient of steady slip at the rate of the reference", "1"))
    rate: Parameter = field(metadata=positive("rate of the reference", "length/time"))
    age: Parameter = field(metadata=positive("age at the beginning", "time"))
    name: ClassVar[str] = "rate-and-state"
    iterates: ClassVar[bool] = True  # type: ignore[misc]
    takes_friction = True

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(age=np.broadcast_to(self.values()["age"], (len(r),)))

    def aged(self, age: Array, slid: Array, tau: float) -> Array:
        """theta after a step of length tau in which the slip has grown evenly by ``slid (m,)``."""
        x = slid / self.values()["length"]
        mean = np.where(x > 0.0, -np.expm1(-x) / np.where(x > 0.0, x, 1.0), 1.0)
        return np.asarray(age * np.exp(-x) + tau * mean)

    def coefficient(self, age: Array, speed: Array) -> Array:
        """mu at slip rates ``speed (m,)``."""
        v = self.values()
        with np.errstate(divide="ignore"):
            return np.asarray(v["direct"] * _asinh(np.log(speed) + self._exponent(age)))

    def _exponent(self, age: Array) -> Array:
        v = self.values()
        psi = v["reference"] + v["evolution"] * (np.log(v["rate"]) + np.log(age) - np.log(v["length"]))
        return np.asarray(np.clip(psi / v["direct"] - np.log(2.0 * v["rate"]), -_MOST, _MOST))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        if parts.friction.profile is not ABSOLUTE_VALUE or not splits(law):
            raise ProblemError(
                f"rate-and-state friction makes its own profile, but the friction law is '{parts.friction.name}'; give "
                f"Tresca(bound), whose bound is the normal pressure, or Tresca(CoulombBound(1.0))"
            )
        age = self.aged(state["age"], step.sliding, step.tau)
        profile = RateStateProfile(self.values()["direct"], self._exponent(age), step.rate)
        return parts.with_parts(friction=Friction(parts.friction.bound, profile))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return kept(age=self.aged(state["age"], slide(r[:, 1:]), step.tau))
