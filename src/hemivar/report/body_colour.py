"""What colours a body in a figure."""

from __future__ import annotations

from enum import StrEnum

from hemivar.errors import ProblemError
from hemivar.report.style import with_unit

__all__ = ["BodyColour"]


class BodyColour(StrEnum):
    """What colours a body in a figure."""

    STRESS = "stress"
    """The von Mises stress."""
    DISPLACEMENT = "displacement"
    """The size of the displacement."""
    NONE = "none"
    """Nothing."""

    def label(self, unit: str, stress_unit: str) -> str:
        """What the scale of colours says."""
        return with_unit("von Mises stress", stress_unit) if self is BodyColour.STRESS else with_unit(self.value, unit)

    @classmethod
    def of(cls, given: BodyColour | str | None, usual: BodyColour) -> BodyColour:
        """What was asked for, or what is usual.

        Raises
        ------
        ProblemError
            There is no such colouring.
        """
        if given is None:
            return usual
        try:
            return cls(given)
        except ValueError as error:
            raise ProblemError(f"colour = {given!r}; choose one of {', '.join(cls)}") from error
