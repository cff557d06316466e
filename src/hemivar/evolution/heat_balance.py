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

    Attributes
    ----------
    content : float
        ``int capacity th``.
    start : float
        That at the beginning.
    source : float
        Of sources and fluxes.
    supports : float
        Through boundaries of prescribed temperature.
    contact : float
        Through boundaries that exchange heat; negative where the body loses it.
    friction : float
        The part of what friction dissipates that the body takes.
    deformation : float
        ``-int T0 beta : eps(u')``.
    gap : float
        What is left: the solver's residual.
    """

    content: float = 0.0
    start: float = 0.0
    source: float = 0.0
    supports: float = 0.0
    contact: float = 0.0
    friction: float = 0.0
    deformation: float = 0.0
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
    """The heat of a body at one time.

    Attributes
    ----------
    moment : TimeState
        Temperatures, of the evolution of heat alone.
    book : HeatBalance
    rounds : int
        How many times motion and heat were computed in the last step.
    contraction : float
        What the last round left of the change of the one before; 0 where one was enough.
    """

    moment: TimeState
    book: HeatBalance
    rounds: int = 0
    contraction: float = 0.0
