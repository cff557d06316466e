"""Laws from tables of (r, derivative): any graph, with vertical jumps."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path

import numpy as np

from hemivar._typing import Array
from hemivar.disk import read_text
from hemivar.errors import FileError, ProblemError
from hemivar.laws.piecewise import PiecewiseQuadratic

__all__ = ["Extension", "check_points", "even_table", "read_columns", "read_law_table", "table_law"]


class Extension(StrEnum):
    """How the derivative of a tabulated law goes on beyond the ends of its table."""

    CONSTANT = "constant"
    """It keeps its last value."""
    LINEAR = "linear"
    """It keeps its last slope."""


def check_points(
    r: Sequence[float] | Array, derivative: Sequence[float] | Array, where: str, *, friction: bool = False
) -> tuple[Array, Array]:
    """The columns of a law table as arrays, checked; errors name the row, counted from 1."""
    try:
        x, y = np.asarray(r, dtype=float), np.asarray(derivative, dtype=float)
    except (TypeError, ValueError):
        raise ProblemError(f"{where}: not all entries are numbers; give two lists of numbers") from None
    if x.ndim != 1 or x.shape != y.shape:
        raise ProblemError(
            f"{where}: r has shape {x.shape} and the derivative {y.shape}; give two lists of equal length"
        )
    if x.size < 2:
        raise ProblemError(f"{where}: {x.size} row{'' if x.size == 1 else 's'}; a law table needs at least 2")
    for i in range(x.size):
        row = f"{where}, row {i + 1}"
        if not (np.isfinite(x[i]) and np.isfinite(y[i])):
            raise ProblemError(f"{row}: {x[i]:g}, {y[i]:g}; both must be finite numbers")
        if friction and x[i] < 0.0:
            raise ProblemError(
                f"{row}: r = {x[i]:g} is negative; a friction law is given for slips r >= 0 and is the same backwards"
            )
        if i and x[i] < x[i - 1]:
            raise ProblemError(f"{row}: r = {x[i]:g} comes after {x[i - 1]:g}; r must not fall (sort the rows)")
        if i > 1 and x[i] == x[i - 2]:
            raise ProblemError(f"{row}: r = {x[i]:g} a third time; two rows with the same r make a jump")
    return x, y


def table_law(
    r: Sequence[float] | Array,
    derivative: Sequence[float] | Array,
    *,
    extend: str = Extension.CONSTANT,
    friction: bool = False,
    name: str = "table",
    where: str = "law table",
) -> PiecewiseQuadratic:
    """The law whose derivative is linear between the points ``(r, derivative)``.

    Parameters
    ----------
    r : sequence of float (K,)
        Not falling; a repeated r is a jump of the derivative, upwards or downwards.
    derivative : sequence of float (K,)
        j' at these places (force per area). j is its integral with j(0) = 0.
    extend : {"constant", "linear"}
        How j' goes on beyond the ends.
    friction : bool
        The points are given for r >= 0 only, and j is even; j' at the first point is the resistance against the
        first slip.
    name, where : str
        Used in messages.

    Raises
    ------
    ProblemError
        Fewer than two rows, entries that are not numbers, falling r (with the row).
    """
    try:
        extend = Extension(extend)
    except ValueError:
        raise ProblemError(f"{where}: extend = '{extend}' is not known; write constant or linear") from None
    x, y = check_points(r, derivative, where, friction=friction)
    if friction:
        return even_table(x, y, extend=extend, name=name)
    knots = np.unique(x)
    left = y[np.searchsorted(x, knots, side="left")]
    right = y[np.searchsorted(x, knots, side="right") - 1]
    inner = (left[1:] - right[:-1]) / np.diff(knots)
    ends = inner[[0, -1]] if extend == Extension.LINEAR and inner.size else np.zeros(2)
    slopes = np.concatenate([ends[:1], inner, ends[1:]])
    return PiecewiseQuadratic(knots, slopes, right - left, start=float(left[0]), name=name)


def read_law_table(
    path: str | Path, *, extend: str = Extension.CONSTANT, friction: bool = False, name: str = "table"
) -> PiecewiseQuadratic:
    """Like :func:`table_law`, from a CSV file with the columns r and derivative; a line of names may come first.

    Raises
    ------
    ProblemError
        If the file cannot be read or is not such a table; the message names file and line.
    """
    r, derivative = read_columns(path)
    return table_law(r, derivative, extend=extend, friction=friction, name=name, where=str(path))


def read_columns(path: str | Path) -> tuple[Array, Array]:
    """The first two columns of a CSV file (commas, semicolons, tabs or blanks) as numbers.

    A first line that holds no number is a head; empty lines and lines that begin with # are skipped.
    """
    try:
        text = read_text(path, "law table")
    except FileError as error:
        raise ProblemError(f"{path}: {error}") from None
    columns: tuple[list[float], list[float]] = ([], [])
    first = True
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        separator = next((c for c in ";,\t" if c in line), None)
        cells = next(csv.reader([line], delimiter=separator)) if separator else line.split()
        numbers = [_float(cell) for cell in cells[:2]]
        if first and all(value is None for value in numbers):
            first = False
            continue
        first = False
        if len(cells) < 2 or None in numbers:
            raise ProblemError(f"{path}, line {number}: '{line.strip()[:40]}' is not two numbers, r and derivative")
        for column, value in zip(columns, numbers, strict=True):
            assert value is not None
            column.append(value)
    return np.array(columns[0]), np.array(columns[1])


def _float(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def even_table(slips: Array, values: Array, *, extend: str = "constant", name: str = "table") -> PiecewiseQuadratic:
    """The even law whose derivative for r >= 0 is linear between the points ``(slips, values)``.

    Parameters
    ----------
    slips, values : arrays (K,)
        Slips >= 0, not falling (a repeated one is a jump), and j' there; before the first and beyond the last one
        j' is constant. The value at r = 0+ is half the jump at zero: the resistance against the first slip.
    extend : {"constant", "linear"}
        How j' goes on beyond the last slip.
    """
    slips, values = np.asarray(slips, dtype=float), np.asarray(values, dtype=float)
    if slips[0] > 0.0:
        slips, values = np.concatenate([[0.0], slips]), np.concatenate([values[:1], values])
    if slips.size > 1 and slips[1] == 0.0:
        slips, values = slips[1:], values[1:]
    knots = np.unique(slips)
    first = np.searchsorted(slips, knots, side="left")
    last = np.searchsorted(slips, knots, side="right") - 1
    left, right = values[first], values[last]
    slopes = np.diff(knots)
    inner = (left[1:] - right[:-1]) / np.where(slopes > 0.0, slopes, 1.0)
    end = inner[-1] if extend == "linear" and inner.size else 0.0
    jumps = (right - left)[1:]
    return PiecewiseQuadratic(
        np.concatenate([-knots[:0:-1], knots]),
        np.concatenate([[end], inner[::-1], inner, [end]]),
        np.concatenate([jumps[::-1], [2.0 * right[0]], jumps]),
        start=-float(right[-1]),
        name=name,
    )
