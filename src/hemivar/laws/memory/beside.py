"""Memories in parallel with a law: a bond that fades, a foundation that remembers its penetration, a damper."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.relaxation import squares_of_relaxation
from hemivar.basics.types import Array, BoolArray, IntArray, Parameter
from hemivar.errors import ProblemError
from hemivar.laws.memory.contact_memory import Energy, LocalStep, Memory, MemoryState, energy_of, kept
from hemivar.laws.named import LawKind, named
from hemivar.laws.normal_and_friction import damped
from hemivar.laws.parameters import LINE, RATE, parameter, positive
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed import affine, bonded, pushing
from hemivar.laws.vector_law import VectorLaw

__all__ = ["Bonding", "DampedContact", "PenetrationMemory"]


@named(
    LawKind.MEMORY,
    "bonding",
    "a bond beside the law, which acts in opening and fades where it is stretched",
    "j(r) + stiffness beta^2 w^2/2, viscosity beta' = min(energy - stiffness beta w^2, 0)",
)
@dataclass(frozen=True, eq=False)
class Bonding(Memory):
    """A bond beside the law, which acts in opening and fades where it is stretched; see :func:`hemivar.laws.bonded`.

    Stored is ``stiffness beta^2 w^2/2``; lost is ``energy`` times the fall of beta, and what the viscosity takes.  A
    bond that is broken does not heal.  The state is ``bond``, beta, 1 at the beginning.

    Parameters
    ----------
    stiffness : Parameter
        >= 0 (force per area and length).
    energy : Parameter
        Energy per area beneath which nothing breaks, >= 0.
    viscosity : Parameter
        > 0 (energy per area, times time).
    """

    stiffness: Parameter = field(metadata=parameter("stiffness of the bond", RATE, least=0.0))
    energy: Parameter = field(metadata=parameter("energy below which nothing breaks", LINE, least=0.0))
    viscosity: Parameter = field(metadata=positive("viscosity of the bond", "force/length time"))
    name: ClassVar[str] = "bonding"
    of_state = True

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(bond=np.ones(len(r)))

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        v, parts = self.values(), self.parts_of(law)
        made = bonded(parts.normal, v["stiffness"], v["energy"], v["viscosity"], state["bond"], step.tau)
        return parts.with_parts(made)

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        v, beta = self.values(), state["bond"]
        driving = step.tau * v["stiffness"] * np.minimum(r[:, 0], 0.0) ** 2 / v["viscosity"]
        return kept(bond=np.minimum(beta, (beta + step.tau * v["energy"] / v["viscosity"]) / (1.0 + driving)))

    def past_peak(self, law: VectorLaw, state: MemoryState) -> BoolArray:
        """Where the bond has faded."""
        return np.asarray(state["bond"] < 1.0)

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        opening = np.minimum(r[:, 0], 0.0)
        return energy_of(law, inner)(r) + 0.5 * self.values()["stiffness"] * (state["bond"] * opening) ** 2

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        v, fall = self.values(), old["bond"] - new["bond"]
        return np.asarray(v["energy"] * fall + v["viscosity"] * fall**2 / step.tau)


@named(
    LawKind.MEMORY,
    "penetration-memory",
    "a foundation that remembers its penetration: it relaxes or hardens",
    "stiffness int exp(-(t - s)/time) r(s) ds beside j'",
)
@dataclass(frozen=True, eq=False)
class PenetrationMemory(Memory):
    """Memory of the penetration: the pressure has the part ``int stiffness exp(-(t - s)/time) r(s) ds`` beside the law.

    The integral q obeys ``q' = r - q/time``; within a step r is taken as linear, for which the recursion is exact, so
    that the law of the step has a constant and a linear term beside j.  With a positive stiffness the foundation
    hardens the longer it is pressed, and gives back more than it has taken: its loss,
    ``-stiffness int h^2``, h = r - q/time, is negative.  With a negative one it relaxes, and its loss is positive.
    The state is ``integral``, q, and ``last``, r at the end of the step.

    Parameters
    ----------
    stiffness : Parameter
        b, of either sign (force per area and length, per time).
    time : Parameter
        > 0.
    """

    stiffness: Parameter = field(metadata=parameter("stiffness of the Maxwell branch", f"{RATE}/time"))
    time: Parameter = field(metadata=positive("relaxation time", "time"))
    name: ClassVar[str] = "penetration-memory"

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept(integral=np.zeros(len(r)), last=r[:, 0])

    def _recursion(self, step: LocalStep) -> tuple[Array, Array, Array, Array, Array]:
        """b, T, and the weights of q_n, r_n and r in the integral at the end of the step."""
        v = self.values()
        time = v["time"]
        ratio = step.tau / time
        lost = -np.expm1(-ratio)
        # 1 - (1 - e^-x)/x without cancellation for small x
        mean = np.where(ratio > 1e-3, 1.0 - lost / ratio, ratio * (0.5 - ratio * (1.0 / 6.0 - ratio / 24.0)))
        return v["stiffness"], time, np.exp(-ratio), time * (lost - mean), time * mean

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        b, _, keep, first, last = self._recursion(step)
        force = b * (keep * state["integral"] + first * step.before[:, 0])
        slope = np.broadcast_to(b * last, force.shape)[:, None]
        return damped(self.parts_of(law), _spring(slope, force))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        _, _, keep, first, last = self._recursion(step)
        q = keep * state["integral"] + first * step.before[:, 0] + last * r[:, 0]
        return kept(integral=q, last=r[:, 0])

    def stored(self, law: VectorLaw, state: MemoryState, r: Array, inner: Energy | None = None) -> Array:
        v = self.values()
        branch = r[:, 0] - state["integral"] / v["time"]
        own = 0.5 * v["stiffness"] * v["time"] * (r[:, 0] - branch) * (r[:, 0] + branch)
        return np.asarray(energy_of(law, inner)(r) + own)

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """``-b int h^2``, exact for r linear in the step: h goes exponentially towards time times the rate of r."""
        v = self.values()
        b, time, tau = v["stiffness"], v["time"], step.tau
        start = step.before[:, 0] - old["integral"] / time
        limit = time * (r[:, 0] - step.before[:, 0]) / tau
        kept, mixed, gone = squares_of_relaxation(tau / time)
        return np.asarray(-b * time * (kept * start**2 + 2.0 * mixed * start * limit + gone * limit**2))


def _spring(slope: Array, force: Array) -> Superpotential:
    zero = np.zeros((len(force), 1))
    force, ends = force[:, None], (-np.inf, np.inf)
    return PiecewiseQuadratic.with_sides(zero, np.repeat(slope, 2, axis=-1), force, force, ends, "memory")


@dataclass(frozen=True, eq=False)
class DampedContact(Memory):
    """A damper of the foundation that cannot pull: pressure ``max(0, j'(r) + psi'(r'))`` while r > 0, none beside.

    Damping stated as such acts on every rate, in contact or not, and holds a body back that leaves; this one lets it go
    when springs and dashpot together would pull.  There is no state.

    Parameters
    ----------
    damping : Superpotential
        psi, a monotone law of the rate of the penetration; ``table_law`` or ``PiecewiseQuadratic`` for a dashpot that
        resists in both directions.
    """

    damping: Superpotential
    name: ClassVar[str] = "damped-contact"

    def __post_init__(self) -> None:
        if not isinstance(self.damping, Superpotential):
            raise ProblemError(f"the damping must be a superpotential of the rate, not {described(self.damping)}")

    def at(self, points: Array | None) -> DampedContact:
        return DampedContact(self.damping.at(points))

    def take(self, index: IntArray) -> DampedContact:
        return DampedContact(self.damping.take(index))

    def start(self, law: VectorLaw, r: Array) -> MemoryState:
        return kept()

    def law(self, law: VectorLaw, state: MemoryState, step: LocalStep) -> VectorLaw:
        parts = self.parts_of(law)
        return parts.with_parts(pushing(parts.normal, affine(self.damping, step.rate, step.shift)))

    def advance(self, law: VectorLaw, state: MemoryState, step: LocalStep, r: Array, lam: Array) -> MemoryState:
        return state

    def dissipated(
        self, law: VectorLaw, old: MemoryState, new: MemoryState, step: LocalStep, r: Array, lam: Array
    ) -> Array:
        """The work of what the law does not give; when the damper is cut off, springs that relax by themselves lose."""
        increment, there = r[:, 0] - step.before[:, 0], r.copy()
        there[:, 0] = step.before[:, 0] + step.at * increment
        bound = law.pressures(there)
        return np.asarray((lam[:, 0] - np.clip(lam[:, 0], bound.lower, bound.upper)) * increment)
