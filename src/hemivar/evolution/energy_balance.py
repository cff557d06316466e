"""Where the work goes: an identity that every step books, closed to what the solver's residual allows."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["EnergyBalance"]


@dataclass(frozen=True)
class EnergyBalance:
    """Energies of a moment, and work and losses up to it.

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
