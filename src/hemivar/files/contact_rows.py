"""The contact points of a solution as the columns of a table, and as CSV."""

from __future__ import annotations

from pathlib import Path

from hemivar.basics.csv_text import csv_text
from hemivar.basics.disk import write_text
from hemivar.files.record import prepared
from hemivar.solvers import Solution
from hemivar.solvers.boundary_result import table_columns

__all__ = ["contact_columns", "write_csv"]


def contact_columns(solution: Solution) -> dict[str, list[float | str]]:
    """The contact points of a solution as columns of a table.

    ``boundary, x, y, (z,) normal_x, ..., weight, gap, penetration, slip, pressure, friction, state``; in 3D slip and
    friction have two columns each, ``slip_1, slip_2``. Columns that the problem does not know are left out.
    """
    columns = table_columns(solution.contact_table)
    return {name: values.tolist() for name, values in columns.items() if not name.startswith("force")}


def write_csv(solution: Solution, path: str | Path) -> Path:
    """Write one line for each contact point, columns as in :func:`contact_columns`; returns the path.

    Parameters
    ----------
    solution : Solution
    path : str or Path
        Name of the file.

    Returns
    -------
    Path
    """
    path = prepared(path, ".csv")
    columns = contact_columns(solution)
    write_text(path, csv_text(columns, zip(*columns.values(), strict=True)))
    return path
