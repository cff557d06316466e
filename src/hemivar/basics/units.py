"""Units for labels; nothing is converted."""

from __future__ import annotations

from dataclasses import dataclass, fields

from hemivar.basics.arguments import quoted
from hemivar.errors import ProblemError

__all__ = ["UNITS_REMEDY", "Units"]

#: What to give where units are asked for.
UNITS_REMEDY = "give hemivar.report.Units(length='mm', stress='MPa')"

#: Characters of a unit.
_LONGEST = 16


@dataclass(frozen=True)
class Units:
    """Units for the labels of pictures and tables; empty where none is to be written.

    The numbers stay as they are: that they fit together (N, mm, MPa, mJ for instance) is up to who states them.

    Attributes
    ----------
    time, length, force, stress, energy : str
        At most 16 printable characters each, without a dollar sign.

    Raises
    ------
    ProblemError
        A unit is no such text.
    """

    time: str = ""
    length: str = ""
    force: str = ""
    stress: str = ""
    energy: str = ""

    def __post_init__(self) -> None:
        for one in fields(self):
            unit = getattr(self, one.name)
            if not isinstance(unit, str) or len(unit) > _LONGEST or not unit.isprintable() or "$" in unit:
                raise ProblemError(
                    f"the unit of {one.name} is {quoted(unit)}; give a short text, such as 'mm', without '$'"
                )

    def head(self, name: str, quantity: str) -> str:
        """The heading of a column, with the unit of its quantity if one is given: ``"energy (mJ)"``."""
        unit = getattr(self, quantity) if quantity else ""
        return f"{name} ({unit})" if unit else name

    def record(self) -> dict[str, str]:
        """The units that are given, by quantity."""
        return {one.name: unit for one in fields(self) if (unit := getattr(self, one.name))}
