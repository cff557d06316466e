"""Words of materials: what a plane model assumes, what a locking material limits, how bounds were found."""

from __future__ import annotations

from enum import StrEnum

from hemivar.errors import ProblemError

__all__ = ["BoundsBy", "PlaneState", "StrainMeasure", "plane_state", "strain_measure"]


class PlaneState(StrEnum):
    """What a plane model assumes about the third direction."""

    STRAIN = "strain"
    STRESS = "stress"


def plane_state(value: object) -> PlaneState:
    """What a plane model assumes, by its word.

    Raises
    ------
    ProblemError
    """
    try:
        return PlaneState(value)  # type: ignore[arg-type]
    except ValueError as error:
        raise ProblemError(f"plane = {value!r}; choose 'strain' or 'stress'") from error


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
    """What a locking material limits, by its word.

    Raises
    ------
    ProblemError
    """
    try:
        return StrainMeasure(value)  # type: ignore[arg-type]
    except ValueError as error:
        raise ProblemError(f"measure = {value!r}; choose 'deviator' or 'strain'") from error
