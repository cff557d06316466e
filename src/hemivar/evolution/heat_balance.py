"""Where heat comes from and goes to: a balance that every step books."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

from hemivar.basics.portable import PickleMixin
from hemivar.evolution.state import TimeState

__all__ = ["HeatBalance", "ThermalState"]


@dataclass(frozen=True)
class HeatBalance:
    """Heat in the body, and what came into it up to a moment.

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
    moment: TimeState
    book: HeatBalance
    #: How many times motion and heat were computed in the last step.
    rounds: int = 0
    #: What the last round left of the change of the one before; 0 where one was enough.
    contraction: float = 0.0
