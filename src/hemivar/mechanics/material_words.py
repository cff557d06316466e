"""Words of materials: what a plane model assumes, what one component is, what locks, how bounds were found."""

from __future__ import annotations

from enum import StrEnum

from hemivar.basics.arguments import one_of
from hemivar.basics.stated import kept
from hemivar.laws.parameters import word

__all__ = ["MEASURE", "PLANE", "PLANE_OF_ENERGY", "BoundsBy", "PlaneState", "ScalarKind", "StrainMeasure"]


class PlaneState(StrEnum):
    """What a plane model assumes about the third direction.

    ``AXISYMMETRIC``: the mesh is half of a section of a body of revolution, x is the radius r >= 0 and y the axis z;
    nothing turns about it.
    """

    STRAIN = "strain"
    STRESS = "stress"
    AXISYMMETRIC = "axisymmetric"


class ScalarKind(StrEnum):
    """What the one component of a problem is; names only, the equations are the same."""

    MEMBRANE = "membrane"
    ANTIPLANE = "antiplane"
    HEAT = "heat"

    @property
    def unknown(self) -> str:
        """What u is called."""
        return {"membrane": "deflection", "antiplane": "displacement", "heat": "temperature"}[self.value]

    @property
    def constant(self) -> str:
        """What the coefficient is called."""
        return {"membrane": "tension", "antiplane": "shear modulus", "heat": "conductivity"}[self.value]

    @property
    def flux(self) -> str:
        """What ``A grad u`` is called."""
        return {"membrane": "force", "antiplane": "shear stress", "heat": "heat flow"}[self.value]


class StrainMeasure(StrEnum):
    """What a locking material limits."""

    DEVIATOR = "deviator"
    STRAIN = "strain"


class BoundsBy(StrEnum):
    """How the bounds of the tangent of a material were found."""

    CLOSED_FORM = "closed form"
    INTERVALS = "intervals"
    SAMPLED = "sampled"

    @property
    def proved(self) -> bool:
        """Whether they hold at every strain up to :attr:`Material.reach`, and not only at those that were tried."""
        return self is not BoundsBy.SAMPLED


#: The metadata of the fields that are these words.
_ACROSS = "state across the plane: strain, stress or axisymmetric"
PLANE = word(_ACROSS, *PlaneState) | kept(one_of, PlaneState)
PLANE_OF_ENERGY = word(_ACROSS, PlaneState.STRAIN, PlaneState.STRESS)
MEASURE = word("what is limited: the size of the deviator or of the whole strain", *StrainMeasure) | kept(
    one_of, StrainMeasure
)
