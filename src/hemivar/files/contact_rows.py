"""The contact points of a solution as the columns of a table, and as CSV."""

from __future__ import annotations

from pathlib import Path

from hemivar.basics.csv_text import csv_text
from hemivar.basics.disk import write_text
from hemivar.basics.units import Units
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


#: What the columns are of, by their beginnings.
_OF = {
    **dict.fromkeys(("x", "y", "z", "gap", "penetration", "slip"), "length"),
    **dict.fromkeys(("pressure", "friction"), "stress"),
}


def write_csv(solution: Solution, path: str | Path, units: Units | None = None) -> Path:
    """Write one line for each contact point, columns as in :func:`contact_columns`; returns the path.

    Parameters
    ----------
    solution : Solution
    path : str or Path
        Name of the file.
    units : Units, optional
        Of length and stress, for the headings; numbers are not converted.

    Returns
    -------
    Path
    """
    path = prepared(path, ".csv")
    columns, units = contact_columns(solution), Units() if units is None else units
    heads = [units.head(name, _OF.get(name.partition("_")[0], "")) for name in columns]
    write_text(path, csv_text(heads, zip(*columns.values(), strict=True)))
    return path
