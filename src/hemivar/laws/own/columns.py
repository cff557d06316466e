"""Reads two named columns of numbers from a CSV file: the graph of a law."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hemivar.basics.disk import read_text, shown
from hemivar.basics.types import Array
from hemivar.errors import ProblemError

__all__ = ["BOUND_COLUMNS", "LAW_COLUMNS", "read_columns"]

#: Names of the columns of a law: the first of each is the one to write, the others are understood too.
LAW_COLUMNS = (("r", "slip", "penetration"), ("derivative", "j'"))
#: Names of the columns of a friction bound.
BOUND_COLUMNS = (("s", "penetration"), ("bound", "h"))

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.ASCII | re.IGNORECASE)
_DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?", re.ASCII)


def read_columns(path: str | Path, names: tuple[Sequence[str], Sequence[str]] = LAW_COLUMNS) -> tuple[Array, Array]:
    """Two columns of a CSV file (commas, semicolons, tabs or blanks) as numbers.

    A first line without numbers names the columns, in any order and among others; without it there must be two.  Empty
    lines and lines that begin with # are skipped.

    Parameters
    ----------
    path : path
    names : pair of sequences of str
        Names of the first and of the second column, whatever their case.

    Raises
    ------
    ProblemError
        If the file cannot be read, or is not such a table: columns that are named otherwise, twice or not at all, rows
        of different lengths, decimal commas.  The message names file and line.
    """
    lines = [
        (number, line)
        for number, line in enumerate(read_text(path, "table").split("\n"), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        return np.zeros(0), np.zeros(0)
    separator = next((c for c in ";\t," if c in lines[0][1]), None)
    head = _cells(path, *lines[0], separator)
    pick, width = (0, 1), len(head)
    if not any(_NUMBER.fullmatch(cell) or _DECIMAL_COMMA.fullmatch(cell) for cell in head):
        pick = _named(path, lines[0][0], head, names)
        lines = lines[1:]
    elif width > 2:
        raise ProblemError(
            f"{shown(path)}, line {lines[0][0]}: there are {width} columns without names; write decimal points, not "
            f"commas, or name the columns in the first line, {names[0][0]} and {names[1][0]} among them"
        )
    columns: tuple[list[str], list[str]] = ([], [])
    for number, line in lines:
        cells = _cells(path, number, line, separator)
        wanted = [cells[k] for k in pick] if len(cells) == width > 1 else []
        if not wanted or not all(_NUMBER.fullmatch(cell) for cell in wanted):
            raise _refused(path, number, cells, wanted, width, names)
        for column, cell in zip(columns, wanted, strict=True):
            column.append(cell)
    return np.array(columns[0], dtype=float), np.array(columns[1], dtype=float)


def _cells(path: str | Path, number: int, line: str, separator: str | None) -> list[str]:
    """The cells of a line, without blanks around them."""
    if separator is None:
        return line.split()
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    except (csv.Error, StopIteration) as error:
        raise ProblemError(f"{shown(path)}, line {number}: this is not a line of a table: {error}") from None


def _named(
    path: str | Path, number: int, head: Sequence[str], names: tuple[Sequence[str], Sequence[str]]
) -> tuple[int, int]:
    """Which columns carry the names."""
    columns = []
    for known in names:
        here = [k for k, cell in enumerate(head) if cell.strip("\"' ").casefold() in {n.strip("'") for n in known}]
        if len(here) != 1:
            wrong = "there is no column" if not here else f"{len(here)} columns are"
            raise ProblemError(
                f"{shown(path)}, line {number}: {wrong} named {known[0]}; name the columns {names[0][0]} and "
                f"{names[1][0]}, in any order, or give two columns without names (the line has {len(head)})"
            )
        columns.append(here[0])
    return columns[0], columns[1]


def _refused(
    path: str | Path,
    number: int,
    cells: Sequence[str],
    wanted: Sequence[str],
    width: int,
    names: tuple[Sequence[str], Sequence[str]],
) -> ProblemError:
    """What is wrong with a line; of the line itself it repeats numbers only, for any file may be named as a table."""
    where = f"{shown(path)}, line {number}"
    if any(_DECIMAL_COMMA.fullmatch(cell) for cell in cells):
        return ProblemError(f"{where}: there are decimal commas; write decimal points")
    if not wanted and width > 1 and len(cells) != width:
        count = f"{len(cells)} column{'' if len(cells) == 1 else 's'}"
        return ProblemError(
            f"{where}: there {'is' if len(cells) == 1 else 'are'} {count} where the first line has {width}, not two "
            f"numbers, {names[0][0]} and {names[1][0]} (write decimal points, not commas)"
        )
    read = [cell for cell in cells if _NUMBER.fullmatch(cell)]
    seen = f" (found: {_short(' '.join(read))})" if read else ""
    return ProblemError(f"{where}: these are not two numbers, {names[0][0]} and {names[1][0]}{seen}")


def _short(text: str) -> str:
    return text if len(text) <= 40 else text[:37] + "..."
