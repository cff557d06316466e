"""A measured curve: what was set in each row, and what was measured there."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import expect, quoted
from hemivar.basics.arrays import real_array
from hemivar.basics.csv_text import cell_read, csv_rows, number_in
from hemivar.basics.disk import path_of, read_text, shown
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array
from hemivar.errors import FileError, ProblemError

__all__ = ["Measurements", "read_measurements"]

#: Columns whose names say that they were measured: goals, with a component.
_MEASURED = re.compile(r"(contact|support)\..+\.force\.[xyz]|boundary\..+\.displacement\.[xyz]")
#: Rows of a curve at most: each is a problem that is solved in every iteration of the fit.
_MOST_ROWS = 100_000
_COMMAS = "commas between columns, points in numbers"
_EXAMPLE = "as in 'supports.top.y' for what was set and 'support.top.force.y' for what was measured"


@dataclass(frozen=True, eq=False)
class Measurements(PickleMixin):
    """Rows of a measured curve, in the order in which they were measured.

    Parameters
    ----------
    inputs : mapping of str to array (n,)
        What was set: a key of the problem file, as ``supports.top.y``, or a name for a function of one's own.
    measured : mapping of str to array (n,)
        What was measured: a quantity with its component, as ``support.top.force.y``
        (:func:`hemivar.bounds.goal_named`).

    Raises
    ------
    ProblemError
        A column is missing, of another length, has a number that is not finite, or a measured one is constant.
    """

    inputs: Mapping[str, Array]
    measured: Mapping[str, Array]

    def __post_init__(self) -> None:
        for name in ("inputs", "measured"):
            expect(getattr(self, name), Mapping, name, "give a dict of columns by names")  # type: ignore[type-abstract]
        for kind, columns in (("set", self.inputs), ("measured", self.measured)):
            if not columns:
                raise ProblemError(f"the measurements have no column of values that were {kind}; name one, {_EXAMPLE}")
        arrays = {}
        for name in ("inputs", "measured"):
            given = {
                key: real_array(values, f"column '{key}'", 1, finite=False)
                for key, values in getattr(self, name).items()
            }
            arrays.update(given)
            object.__setattr__(self, name, MappingProxyType(given))
        rows = {key: values.size for key, values in arrays.items()}
        if len(set(rows.values())) != 1:
            sizes = ", ".join(f"'{key}' {count}" for key, count in rows.items())
            raise ProblemError(
                f"the columns of the measurements have different lengths: {sizes}; give one number a row"
            )
        for key, values in arrays.items():
            wrong = np.flatnonzero(~np.isfinite(values))
            if wrong.size:
                raise ProblemError(
                    f"column '{key}' of the measurements is {values[wrong[0]]} in row {wrong[0] + 1}; leave it out"
                )
        for key, values in self.measured.items():
            if self.count > 1 and np.ptp(values) == 0.0:
                raise ProblemError(
                    f"column '{key}' is {values[0]:g} in every row, which does not determine a law; measure where "
                    f"it changes"
                )

    @property
    def count(self) -> int:
        """Number of rows n."""
        return next(iter(self.inputs.values())).size

    @property
    def values(self) -> Array:
        """What was measured, (n, q), a column for each quantity."""
        return np.column_stack(list(self.measured.values()))

    @property
    def scales(self) -> Array:
        """Largest size of each measured quantity, (q,)."""
        return np.asarray(np.abs(self.values).max(axis=0))

    def row(self, number: int) -> dict[str, float]:
        """What was set in a row."""
        return {key: float(values[number]) for key, values in self.inputs.items()}

    def __repr__(self) -> str:
        return f"Measurements({self.count} rows of {', '.join(self.measured)} over {', '.join(self.inputs)})"


def read_measurements(path: str | Path) -> Measurements:
    """A measured curve from a CSV file with a head.

    The head names each column: a key of the problem file for what was set in each row, a quantity for what was
    measured, such as ``supports.top.y,support.top.force.y``.  Lines that begin with ``#`` are left out.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Measurements

    Raises
    ------
    FileError
        The file cannot be read, or is no such table.
    ProblemError
        As for :class:`Measurements`.
    """
    path = path_of(path)
    name = shown(path)
    text = read_text(path, "measurements")
    rows = [row for row in csv_rows(text, name) if not row[0].lstrip().startswith("#")]
    if rows and len(rows[0]) == 1 and any(separator in rows[0][0] for separator in ";\t"):
        raise FileError(f"{name}: the columns are not separated by commas; {_COMMAS}")
    if len(rows) < 2:
        raise FileError(f"{name}: a head and a row for each measurement are expected; name the columns {_EXAMPLE}")
    if len(rows) > _MOST_ROWS:
        raise FileError(f"{name}: {len(rows) - 1} rows are more than {_MOST_ROWS}; leave some out")
    head = [cell_read(cell.strip()) for cell in rows[0]]
    if all(_number(cell) is not None for cell in head):
        raise FileError(f"{name}: the first row holds numbers; put names of the columns there, {_EXAMPLE}")
    if len(set(head)) != len(head):
        raise FileError(f"{name}: two columns have one name; name each once, {_EXAMPLE}")
    columns = _columns(name, head, rows[1:])
    measured = {key: values for key, values in columns.items() if _MEASURED.fullmatch(key)}
    try:
        return Measurements({key: values for key, values in columns.items() if key not in measured}, measured)
    except ProblemError as error:
        raise ProblemError(f"{name}: {error}") from None


def _columns(name: str, head: Sequence[str], body: Sequence[Sequence[str]]) -> dict[str, Array]:
    for number, row in enumerate(body, start=1):
        if len(row) != len(head):
            raise FileError(
                f"{name}: row {number} has {len(row)} entries, the head {len(head)}; give one for each column: "
                f"{_COMMAS}"
            )
    columns = {}
    for column, key in enumerate(head):
        values = [_number(row[column]) for row in body]
        if None in values:
            first = values.index(None)
            raise FileError(
                f"{name}: column '{shown(key)}' has {quoted(shown(body[first][column]))} in row {first + 1}; give a "
                f"number: {_COMMAS}"
            )
        columns[key] = np.array(values, dtype=float)
    return columns


def _number(cell: str) -> float | None:
    try:
        return number_in(cell)
    except ValueError:
        return None
