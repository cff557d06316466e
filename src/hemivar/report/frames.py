"""Values as tables of pandas: a row for each of their parts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.adapt import AdaptiveSolution
from hemivar.basics.pandas_frame import data_frame
from hemivar.basics.types import Record
from hemivar.branches import Path, SolutionSet
from hemivar.report.notebook import table_of
from hemivar.report.study_tables import study_table, sweep_table
from hemivar.report.tables import adaptive_table
from hemivar.workflows.study import Study
from hemivar.workflows.sweep import Sweep

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["frame_of"]


def frame_of(value: object) -> DataFrame:
    """A pandas DataFrame.

    A path has a row for each point, a set of solutions one for each solution, a study and an adaptive solve one for
    each mesh, a sweep one for each choice of parameters; anything else has rows of ``name`` and ``value``, as a
    notebook shows it.

    Raises
    ------
    ProblemError
        pandas is not installed.
    """
    for kind, (columns, instead) in _COLUMNS.items():
        if isinstance(value, kind):
            return data_frame(columns(value), instead)
    rows = table_of(value).rows
    return data_frame({"name": [row[0] for row in rows], "value": [row[1] for row in rows]}, "repr(value)")


def _path(path: Path) -> Record:
    friction = {f"friction_force_{k + 1}": values for k, values in enumerate(path.friction_force.T)}
    if len(friction) == 1:
        friction = {"friction_force": path.friction_force[:, 0]}
    return {
        "load_factor": path.load_factor,
        "energy": path.energy,
        "stable": np.append(path.stable, path.stable[-1:]),
        "max_penetration": path.max_penetration,
        "normal_force": path.normal_force,
        **friction,
    }


def _solutions(found: SolutionSet) -> Record:
    return {
        "kind": [None if one.kind is None else one.kind.value for one in found],
        "energy": [one.energy for one in found],
        "max_penetration": [float(one.penetration.max(initial=-np.inf)) for one in found],
        "normal_force": [one.normal_force for one in found],
        "contact": [one.contact_length for one in found],
        "status": [one.status.value for one in found],
        "residual": [one.residual.relative for one in found],
    }


def _columns(table: Callable[[Any], Any]) -> Callable[[Any], Record]:
    def columns(value: object) -> Record:
        found = table(value)
        cells = zip(*found.rows, strict=True) if found.rows else [()] * len(found.columns)
        return dict(zip(found.columns, map(list, cells), strict=True))

    return columns


_COLUMNS: Mapping[type, tuple[Callable[[Any], Record], str]] = {
    Path: (_path, "path.load_factor, path.energy, path.normal_force"),
    SolutionSet: (_solutions, "solutions.energies"),
    Study: (_columns(study_table), "hemivar.report.study_table(study)"),
    Sweep: (_columns(sweep_table), "hemivar.report.sweep_table(sweep)"),
    AdaptiveSolution: (_columns(adaptive_table), "found.rows()"),
}
