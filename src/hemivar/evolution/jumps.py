"""Selection of a solution where a rate-independent step may have several: local, viscous, energetic."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

__all__ = ["DissipatedJump", "SelectionRule"]


class SelectionRule(StrEnum):
    """Which equilibrium follows where the margin is lost in a body without viscosity and mass.

    They give different answers: a body that unloads slowly on a softening foundation jumps at different loads.
    """

    LOCAL = "local"
    """Downhill from where the body is without a leap over a barrier, until the energy falls no more."""
    VISCOUS = "viscous"
    """As if the body had the least viscosity that leaves every step one solution: a jump takes some steps."""
    ARC_LENGTH = "arc-length"
    """Along the path of equilibria, by its arc length and not by the load; where the path turns back the load waits,
    and the body goes downhill to the next equilibrium.  Neither the load of a jump nor its loss depend on the step."""
    GLOBAL = "global"
    """The lowest energy that can be found, wherever it is (energetic solutions)."""
    STOP = "stop"
    """The march ends."""

    @property
    def follows(self) -> bool:
        """Whether the path of equilibria is followed within a step."""
        return self is SelectionRule.ARC_LENGTH


@dataclass(frozen=True)
class DissipatedJump:
    """A jump within a step."""

    #: Where in the step, between 0 and 1.
    part: float
    #: Energy that is lost at once.
    lost: float
