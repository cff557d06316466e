"""Words of materials: what a plane model assumes, what one component is, what locks, how bounds were found."""

from __future__ import annotations

from enum import StrEnum

from hemivar.errors import ProblemError

__all__ = ["BoundsBy", "PlaneState", "ScalarKind", "StrainMeasure", "plane_state", "scalar_kind", "strain_measure"]


class PlaneState(StrEnum):
    """What a plane model assumes about the third direction.

    ``AXISYMMETRIC``: the mesh is half of a section of a body of revolution, x is the radius r >= 0 and y the axis z;
    nothing turns about it.
    """

    STRAIN = "strain"
    STRESS = "stress"
    AXISYMMETRIC = "axisymmetric"


def plane_state(value: object) -> PlaneState:
    """What a plane model assumes, by its word."""
    try:
        return PlaneState(value)  # type: ignore[arg-type]
    except ValueError as error:
        raise ProblemError(f"plane = {value!r}; choose 'strain', 'stress' or 'axisymmetric'") from error


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


def scalar_kind(value: object) -> ScalarKind:
    """What one component is, by its word."""
    try:
        return ScalarKind(value)  # type: ignore[arg-type]
    except ValueError:
        raise ProblemError(f"kind = {value!r}; choose 'membrane', 'antiplane' or 'heat'") from None


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


def strain_measure(value: object) -> StrainMeasure:
    """What a locking material limits, by its word."""
    try:
        return StrainMeasure(value)  # type: ignore[arg-type]
    except ValueError as error:
        raise ProblemError(f"measure = {value!r}; choose 'deviator' or 'strain'") from error
