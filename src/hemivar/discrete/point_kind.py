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
    """The energy rises in every direction."""
    SADDLE = "saddle"
    """The energy falls to both sides in some direction and rises in another."""
    MAXIMUM = "maximum"
    """The energy, as a function of the contact displacements alone, falls in every direction."""
    DIRECTIONALLY_STATIONARY = "directionally stationary"
    """The energy falls in no direction to first order; its curvature does not decide."""
    CLARKE_STATIONARY = "Clarke-stationary"
    """Stationary in the sense of Clarke only: at a downward jump the energy falls to one side to first order."""
    BOUND_FIXED_MINIMISER = "local minimiser with the friction bound held fixed"
    """There is no energy.  That of the friction bound at this point rises in every direction: no claim of stability."""
    BOUND_FIXED_SADDLE = "saddle with the friction bound held fixed"
    """A saddle of that energy."""
    BOUND_FIXED_MAXIMUM = "maximum with the friction bound held fixed"
    """A maximum of that energy."""
    BOUND_FIXED_DIRECTIONAL = "directionally stationary with the friction bound held fixed"
    """Directionally stationary for that energy."""
    BOUND_FIXED_CLARKE = "Clarke-stationary with the friction bound held fixed"
    """Clarke-stationary for that energy."""
    WITHOUT_ENERGY = "equilibrium of a law without an energy"
    """All tractions depend on the state, as on the mode of glue: there is no energy, and no kind of its points."""
    STATIONARY = "stationary"
    """The residual is below the tolerance; what kind of point it is was not looked at within the time limit."""
    NOT_STATIONARY = "not stationary"
    """Equilibrium or the law is not fulfilled to the tolerance."""

    @property
    def bound_fixed(self) -> PointKind:
        """The kind of a point where it is that of the energy with the friction bound of this point."""
        return _BOUND_FIXED.get(self, self)

    @property
    def has_energy(self) -> bool:
        """Whether the kind is one of points of an energy."""
        return self not in _BOUND_FIXED.values() and self not in (PointKind.UNIQUE_SOLUTION, PointKind.WITHOUT_ENERGY)


_BOUND_FIXED = {
    PointKind.LOCAL_MINIMISER: PointKind.BOUND_FIXED_MINIMISER,
    PointKind.SADDLE: PointKind.BOUND_FIXED_SADDLE,
    PointKind.MAXIMUM: PointKind.BOUND_FIXED_MAXIMUM,
    PointKind.DIRECTIONALLY_STATIONARY: PointKind.BOUND_FIXED_DIRECTIONAL,
    PointKind.CLARKE_STATIONARY: PointKind.BOUND_FIXED_CLARKE,
}
