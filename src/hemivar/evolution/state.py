"""The state of an evolution at one time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from hemivar.basics.codec import COMPUTED
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.evolution.energy_balance import EnergyBalance

if TYPE_CHECKING:
    from hemivar.evolution.heat_balance import ThermalState

__all__ = ["ContactForce", "Kinematics", "LastStep", "Rates", "TimeState"]


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
    #: Contact forces that are told of this moment, where they are not the multiplier at this time.
    shown: ContactForce | None = None

    @property
    def contact_force(self) -> ContactForce:
        """Contact forces that are told of this moment: those of its displacements, else the last that are known."""
        return ContactForce(self.time, self.multiplier) if self.shown is None else self.shown

    @property
    def last_length(self) -> float | None:
        """Length of the last step, where the next one goes on from it."""
        return None if self.history is None else self.history.step

    @property
    def rates(self) -> tuple[Rates | None, Rates | None]:
        """Mean rates of body and contact points in the last step, where they are known."""
        return (None, None) if self.history is None else (self.history.body, self.history.local)
