"""The state of an evolution at one time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from hemivar.basics.codec import COMPUTED
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array

__all__ = [
    "ContactForce",
    "EnergyBalance",
    "HeatBalance",
    "Kinematics",
    "LastStep",
    "LoadControl",
    "Rates",
    "ThermalState",
    "TimeState",
]


@dataclass(frozen=True)
class EnergyBalance:
    """Energies of a state, and work and losses up to it.

    ``work + moved + thermal = (elastic + branches + contact + kinetic) - (the same at the start) + viscous +
    branch_loss + friction + damping + memory + numerical + jumps + gap``.
    """

    #: Work of the loads.
    work: float = 0.0
    #: Work of moved supports and foundations.
    moved: float = 0.0
    #: Energy stored in the body, in the branches of its material, by the foundation; kinetic energy.
    elastic: float = 0.0
    branches: float = 0.0
    contact: float = 0.0
    kinetic: float = 0.0
    #: Their sum at the beginning.
    start: float = 0.0
    #: Dissipated by the viscosity of the body and by the branches of its material.
    viscous: float = 0.0
    branch_loss: float = 0.0
    #: Dissipated by friction and by laws of the rate along the normal.
    friction: float = 0.0
    damping: float = 0.0
    #: Dissipated by what contact points remember: broken bonds, worn material.
    memory: float = 0.0
    #: What the scheme takes; negative where it gives. Work is counted by the forces of stages, to first order where
    #: these do not lie in the middle of a step: this is no measure of accuracy.
    numerical: float = 0.0
    #: What is lost where the body jumps from one equilibrium to another.
    jumps: float = 0.0
    #: What is left: the work of the solver's residual.
    gap: float = 0.0
    #: Work of thermal stress; a column of evolutions with heat only.
    thermal: float = 0.0

    @property
    def stored(self) -> float:
        """All energy that can come back."""
        return self.elastic + self.branches + self.contact + self.kinetic

    @property
    def lost(self) -> float:
        """All that cannot."""
        return (
            self.viscous + self.branch_loss + self.friction + self.damping + self.memory + self.numerical + self.jumps
        )

    def closed(self) -> EnergyBalance:
        """The ledger with its gap computed from all else."""
        values = dict(vars(self))
        values["gap"] = self.work + self.moved + self.thermal - (self.stored - self.start) - self.lost
        return EnergyBalance(**values)

    def record(self) -> dict[str, float]:
        """Numbers by name."""
        return {name: value for name, value in vars(self).items() if name not in ("start", "thermal")}


@dataclass(frozen=True, eq=False)
class Kinematics(PickleMixin):
    """A displacement with its rate and its acceleration; arrays of one shape."""

    displacement: Array
    velocity: Array
    acceleration: Array
    #: ``K u`` (of a body that is not linear its elastic forces), ``C v`` and ``M v`` where they are known; to the last
    #: bit what the product would be.
    stiffness_force: Array | None = field(default=None, kw_only=True, metadata=COMPUTED)  # (n + k,)
    viscous_force: Array | None = field(default=None, kw_only=True, metadata=COMPUTED)  # (n + k,)
    momentum: Array | None = field(default=None, kw_only=True, metadata=COMPUTED)  # (n + k,)

    @classmethod
    def at_rest(cls, displacement: Array) -> Kinematics:
        """A displacement that does not change."""
        return cls(displacement, np.zeros_like(displacement), np.zeros_like(displacement))

    def at_velocity(self, velocity: Array) -> Kinematics:
        """The same at another velocity."""
        return Kinematics(self.displacement, velocity, self.acceleration, stiffness_force=self.stiffness_force)


@dataclass(frozen=True, eq=False)
class Rates(PickleMixin):
    """Mean rates of a displacement and of its velocity over a step; arrays of one shape."""

    velocity: Array
    acceleration: Array


@dataclass(frozen=True, eq=False)
class LastStep(PickleMixin):
    """What the last step did, which the next one goes on from."""

    step: float
    #: ``K (u - u_before)`` where the velocity is the mean one of the step: ``step K v``.
    force: Array | None  # (n,)
    #: Change of the multiplier; zero where it foretells nothing.
    multiplier: Array  # (m, c)
    #: Mean rates of unknowns and prescribed displacements (n + k,) and at the contact points (m, c); of schemes with
    #: several steps.
    body: Rates | None = None
    local: Rates | None = None


@dataclass(frozen=True, eq=False)
class ContactForce(PickleMixin):
    """Contact forces with the time that they belong to."""

    time: float
    #: Force per area of the body on the foundation: pressure (column 0), and minus the friction.
    multiplier: Array  # (m, c)


@dataclass(frozen=True, eq=False)
class LoadControl(PickleMixin):
    """What a march whose load factor is unknown knows of it."""

    factor: float
    #: Energy that a unit of time dissipates.
    pace: float
    #: Largest distance of the load factor from the start so far.
    largest: float
    #: The most that glue carried so far.
    carried: float
    #: In the last step: its length, change of the load factor, what was dissipated, and changes of slip and multiplier.
    step: float
    moved: float
    spent: float
    slid: Array  # (m, c)
    pressed: Array  # (m, c)


@dataclass(frozen=True, eq=False)
class TimeState(PickleMixin):
    """All that the future of an evolution depends on.  A step is a function from one state to the next."""

    time: float
    #: Steps taken so far.
    index: int
    #: Of unknowns and prescribed displacements, (n + k,).
    body: Kinematics
    #: Of penetration and slip of the contact points relative to their foundation, (m, c).
    local: Kinematics
    #: Force per area of the body on the foundation at the last stage: pressure (column 0), and minus the friction.
    multiplier: Array  # (m, c)
    #: Displacement that each branch of the material remembers.
    branches: tuple[Array, ...] = ()  # (n + k,)
    #: States of the memories of contact boundaries, by their names: arrays by name.
    memory: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    #: Energies, and all work and losses so far.
    ledger: EnergyBalance = field(default_factory=EnergyBalance)
    #: Temperatures and the balance of heat, of a body with heat.
    heat: ThermalState | None = None
    #: None where the next step begins anew: at the start, and where velocities jump.
    history: LastStep | None = None
    #: Contact forces that are reported for this state, where they are not the multiplier at this time.
    shown: ContactForce | None = None
    #: Of a march whose load factor is unknown, from its first step on.
    control: LoadControl | None = None

    @property
    def contact_force(self) -> ContactForce:
        """Contact forces that are reported of this state: those of its displacements, else the last that are known."""
        return ContactForce(self.time, self.multiplier) if self.shown is None else self.shown

    @property
    def last_length(self) -> float | None:
        """Length of the last step, where the next one goes on from it."""
        return None if self.history is None else self.history.step

    @property
    def rates(self) -> tuple[Rates | None, Rates | None]:
        """Mean rates of body and contact points in the last step, where they are known."""
        return (None, None) if self.history is None else (self.history.body, self.history.local)


@dataclass(frozen=True)
class HeatBalance:
    """Heat in the body, and what came into it until then.

    ``content = content at the start + source + supports + contact + friction + deformation + gap``.
    """

    #: ``int capacity th``.
    content: float = 0.0
    #: That at the beginning.
    start: float = 0.0
    #: Of sources and fluxes.
    source: float = 0.0
    #: Through boundaries of prescribed temperature.
    supports: float = 0.0
    #: Through boundaries that exchange heat; negative where the body loses it.
    contact: float = 0.0
    #: The part of what friction dissipates that the body takes.
    friction: float = 0.0
    #: ``-int T0 beta : eps(u')``.
    deformation: float = 0.0
    #: What is left: the solver's residual.
    gap: float = 0.0

    def closed(self) -> HeatBalance:
        """The book with its gap computed from all else."""
        came = self.source + self.supports + self.contact + self.friction + self.deformation
        return replace(self, gap=self.content - self.start - came)

    def record(self) -> dict[str, float]:
        """Numbers by the names of columns."""
        return {f"heat.{one.name}": getattr(self, one.name) for one in fields(self) if one.name != "start"}


@dataclass(frozen=True, eq=False)
class ThermalState(PickleMixin):
    """The heat of a body at one time."""

    #: Temperatures, of the evolution of heat alone.
    state: TimeState
    book: HeatBalance
    #: How many times motion and heat were computed in the last step.
    rounds: int = 0
    #: What the last round left of the change of the one before; 0 where one was enough.
    contraction: float = 0.0
