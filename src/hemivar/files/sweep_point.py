"""The points of a sweep, each a line of JSON."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

from hemivar.basics.codec import decoded, encoded
from hemivar.discrete.point_kind import PointKind

__all__ = ["SweepPoint"]

_WITHOUT_ENERGY = {kind.value for kind in PointKind if not kind.has_energy}
_OF_SOLUTIONS = ("energies", "penetrations", "forces")


@dataclass(frozen=True)
class SweepPoint:
    """The solutions of a problem for one choice of its parameters.

    Attributes
    ----------
    place : tuple of int
        Which value of each parameter, from 0.
    margin : float
        The smallness margin ``1 - c``: positive where there is one solution; nan where it is not known.
    energies : tuple of float
        Of the solutions, increasing.
    kinds : tuple of str
        What kind of point each solution is; empty where it was not looked at.
    penetrations, forces : tuple of float
        Largest penetration and normal force of each solution.
    exhaustive : bool
        Whether there are no other solutions.
    note : str
        How far the search went; or why there is no result.
    failed : bool
        Whether the problem could not be stated or solved for these values.
    numbers : tuple of float
        Those of one solution that were asked for in place of all this; nan where there is none.
    """

    place: tuple[int, ...]
    margin: float = math.nan
    energies: tuple[float, ...] = ()
    kinds: tuple[str, ...] = ()
    penetrations: tuple[float, ...] = ()
    forces: tuple[float, ...] = ()
    exhaustive: bool = False
    note: str = ""
    failed: bool = False
    numbers: tuple[float, ...] = ()

    @property
    def count(self) -> int:
        """How many solutions were found."""
        return len(self.energies)

    @property
    def minima(self) -> int | None:
        """How many of them are local minimisers of the energy; None where the law has none."""
        if any(kind in _WITHOUT_ENERGY for kind in self.kinds):
            return None
        return sum(kind.endswith("minimiser") for kind in self.kinds)

    def line(self) -> str:
        """The point on one line of JSON; every bit of its numbers comes back."""
        return json.dumps(encoded(self, []), allow_nan=False)

    @staticmethod
    def of_line(text: str) -> SweepPoint:
        """The point of a line.

        Raises
        ------
        ValueError, KeyError, TypeError
            It is no such line.
        """
        data = json.loads(text)
        if isinstance(data, dict):
            data.setdefault("numbers", [])  # lines that were written before points had them
        point = decoded(SweepPoint, data, [])
        if any(index < 0 for index in point.place):
            raise ValueError("the place is not a list of whole numbers")
        if len({len(getattr(point, name)) for name in (*_OF_SOLUTIONS, "kinds")}) > 1:
            raise ValueError("solutions have energies, kinds, penetrations and forces")
        if not all(map(math.isfinite, point.energies)):
            raise ValueError("an energy is not finite")
        return point
