"""What kind of point a stationary point is for the energy, in one word for solutions and certificates."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["PointKind"]


class PointKind(StrEnum):
    """What a point is for the energy."""

    UNIQUE_MINIMISER = "unique minimiser"
    """The only solution there is, and the global minimiser of the energy."""
    GLOBAL_MINIMISER = "global minimiser"
    """The law is convex, so every stationary point is a global minimiser; there may be others with the same energy."""
    UNIQUE_SOLUTION = "unique solution"
    """The only solution of a problem whose friction bound depends on the solution, which has no energy."""
    LOCAL_MINIMISER = "local minimiser"
    """The energy (for a state-dependent bound, frozen here) rises in every direction."""
    SADDLE = "saddle"
    """The energy falls to both sides in some direction and rises in another."""
    MAXIMUM = "maximum"
    """The energy, as a function of the contact displacements alone, falls in every direction."""
    DIRECTIONALLY_STATIONARY = "directionally stationary"
    """The energy falls in no direction to first order; its curvature does not decide."""
    CLARKE_STATIONARY = "Clarke-stationary"
    """Stationary in the sense of Clarke only: at a downward jump the energy falls to one side to first order."""
    STATIONARY = "stationary"
    """The residual is below the tolerance; what kind of point it is was not looked at, for lack of time."""
    NOT_STATIONARY = "not stationary"
    """Equilibrium or the law is not fulfilled to the tolerance."""
