"""The record of a sweep: a line of JSON for each point, appended when it is done, so that work can go on from it."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path

from hemivar.basics import disk
from hemivar.errors import FileError

__all__ = ["SweepPoint", "SweepRecord"]

_FORMAT = 1
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

    @property
    def count(self) -> int:
        """How many solutions were found."""
        return len(self.energies)

    @property
    def minima(self) -> int:
        """How many of them are local minimisers of the energy."""
        return sum(kind.endswith("minimiser") for kind in self.kinds)

    def line(self) -> str:
        """The point on one line of JSON; every bit of its numbers comes back."""
        return json.dumps({one.name: _plain(getattr(self, one.name)) for one in fields(self)}, allow_nan=False)

    @staticmethod
    def of_line(text: str) -> SweepPoint:
        """The point of a line.

        Raises
        ------
        ValueError, KeyError, TypeError
            It is no such line.
        """
        data = json.loads(text)
        numbers = {name: tuple(float(value) for value in data[name]) for name in _OF_SOLUTIONS}
        return SweepPoint(
            tuple(int(one) for one in data["place"]),
            float(data["margin"]),
            kinds=tuple(str(one) for one in data["kinds"]),
            exhaustive=data["exhaustive"] is True,
            note=str(data["note"]),
            failed=data["failed"] is True,
            **numbers,
        )


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)  # JSON has no such numbers
    return value


class SweepRecord:
    """A file that holds the points of one sweep that are done.

    Parameters
    ----------
    path : str or Path
        Made if it is not there.
    digest : str
        Of the problem, its parameters and the options: the same work.
    keys : sequence of str
        The parameters.

    Attributes
    ----------
    done : dict of place to SweepPoint
        What was there already, and what was added.

    Raises
    ------
    FileError
        The file cannot be read or written, or it is not the record of this sweep.
    """

    def __init__(self, path: str | Path, digest: str, keys: Sequence[str]) -> None:
        self.path = Path(path)
        self.done: dict[tuple[int, ...], SweepPoint] = {}
        head = json.dumps({"hemivar-sweep": _FORMAT, "digest": digest, "parameters": list(keys)})
        if not os.path.lexists(self.path):
            disk.write_text(self.path, head + "\n")
            return
        text = disk.read_text(self.path, "record of a sweep")
        whole = text[: text.rfind("\n") + 1]
        first, *lines = whole.splitlines() or [""]
        if first != head:
            self._refuse(first)
        for number, line in enumerate(lines, start=2):
            try:
                point = SweepPoint.of_line(line)
            except (ValueError, KeyError, TypeError) as error:
                raise FileError(
                    f"{disk.shown(path)}, line {number}: this is no point of a sweep; remove the line, or the file"
                ) from error
            self.done[point.place] = point
        if whole != text:  # the process ended while it wrote the last line
            disk.write_text(self.path, whole)

    def _refuse(self, first: str) -> None:
        try:
            ours = "hemivar-sweep" in json.loads(first)
        except (ValueError, TypeError):
            ours = False
        what = "holds another sweep, or the problem has changed since" if ours else "is no record of a sweep"
        raise FileError(f"{disk.shown(self.path)}: the file {what}; name another file, or remove it")

    def add(self, point: SweepPoint) -> None:
        """Keep a point."""
        disk.append_line(self.path, point.line())
        self.done[point.place] = point

    def among(self, places: Iterable[tuple[int, ...]]) -> list[SweepPoint]:
        """The points at some places that are done, in that order."""
        return [self.done[place] for place in places if place in self.done]
