"""The contact points of a solution as the columns of a table, and as CSV."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from hemivar.basics.disk import open_new, whole_file
from hemivar.basics.types import Array
from hemivar.files.record import boundary_names, prepared, state_names
from hemivar.solvers import Solution

__all__ = ["contact_columns", "write_csv"]

_AXES = "xyz"


def contact_columns(solution: Solution) -> dict[str, list[Any]]:
    """The contact points of a solution as columns of a table.

    ``boundary, x, y, (z,) normal_x, ..., weight, gap, penetration, slip, pressure, friction, state``; in 3D slip and
    friction have two columns each, ``slip_1, slip_2``. Columns that the problem does not know are left out.
    """
    problem = solution.problem
    columns: dict[str, list[Any]] = {}
    names = boundary_names(problem)
    if names is not None:
        columns["boundary"] = names
    if problem.points is not None:
        columns |= {_AXES[k]: column.tolist() for k, column in enumerate(problem.points.T)}
    if problem.frames is not None:
        columns |= {f"normal_{_AXES[k]}": column.tolist() for k, column in enumerate(problem.frames[:, 0].T)}
    columns["weight"] = problem.weights.tolist()
    columns["gap"] = problem.gap.tolist()
    columns["penetration"] = solution.penetration.tolist()
    columns |= _numbered("slip", solution.slip)
    columns["pressure"] = solution.pressure.tolist()
    columns |= _numbered("friction", solution.friction)
    columns["state"] = state_names(solution)
    return columns


def _numbered(name: str, values: Array) -> dict[str, list[Any]]:
    if values.shape[1] == 1:
        return {name: values[:, 0].tolist()}
    return {f"{name}_{k + 1}": column.tolist() for k, column in enumerate(values.T)}


def write_csv(solution: Solution, path: str | Path) -> Path:
    """Write one line for each contact point, columns as in :func:`contact_columns`; returns the path."""
    path = prepared(path, ".csv")
    columns = contact_columns(solution)
    _write_rows(path, list(columns), zip(*columns.values(), strict=True))
    return path


def _write_rows(path: Path, header: list[str], rows: Iterable[Iterable[Any]]) -> None:
    with whole_file(path) as name, open_new(name) as stream:
        writer = csv.writer(stream)
        writer.writerow(header)
        writer.writerows(rows)
