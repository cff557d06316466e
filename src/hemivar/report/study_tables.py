"""Studies of convergence and sweeps over parameters as tables."""

from __future__ import annotations

import math

import numpy as np

from hemivar.basics.units import Units
from hemivar.report.tables import Table
from hemivar.workflows.study import Study
from hemivar.workflows.sweep import Sweep

__all__ = ["study_table", "sweep_table"]


def study_table(
    study: Study, title: str = "", *, relative: bool = False, brief: bool = False, units: Units | None = None
) -> Table:
    """One line for each mesh: size, unknowns, errors with the order from the mesh before, energy, normal force, status.

    Where bounds were asked for, the column ``guaranteed bound`` has that of the error in the energy norm; it is empty
    where there is none, and called ``conditional bound`` where bounds hold on conditions only.

    Parameters
    ----------
    study : Study
    title : str, optional
    relative : bool
        Errors relative to the norms of the reference.
    brief : bool
        Without energy and force, and without the status where all solves converged.
    units : Units, optional
        Of length, force and energy, for the headings; numbers are not converted.

    Returns
    -------
    Table
    """
    names = study.quantities
    units = Units() if units is None else units
    columns = [units.head("h", "length"), "unknowns"]
    for name in names:
        columns += [name, "order"] if brief else [f"{name} error", f"{name} order"]
    bounds = study.bounds
    certified = bool((~np.isnan(bounds)).any())
    columns += [study.kind_of_bound] * certified
    columns += (
        ["status"] * (not study.converged)
        if brief
        else [
            units.head("energy", "energy"),
            units.head("normal force", "force"),
            "status",
        ]
    )
    errors = {name: study.relative(name) if relative else study.errors(name) for name in names}
    steps = {name: study.steps(name) for name in names}
    size = study.norms["energy"] if relative else 1.0
    rows = []
    for number, level in enumerate(study.levels):
        solution = level.solution
        row: list[object] = [level.size, solution.problem.unknowns]
        for name in names:
            error, order = float(errors[name][number]), float(steps[name][number])
            row += [None if math.isnan(error) else error, None if math.isnan(order) else round(order, 2)]
        if certified:
            bound = float(bounds[number] / size)
            row.append(bound if math.isfinite(bound) else None)
        force = float(solution.normal_force) if solution.problem.contact_points else None
        last: list[object] = [float(solution.energy), force, solution.status.value]
        rows.append((*row, *(last[2:] * (not study.converged) if brief else last)))
    return Table(tuple(columns), tuple(rows), title)


def sweep_table(sweep: Sweep, title: str = "", *, units: Units | None = None) -> Table:
    """One line for each point: parameters, number of solutions and of local minimisers, margin, the lowest solution.

    The column ``others`` says whether there may be solutions that were not found.

    Parameters
    ----------
    sweep : Sweep
    title : str, optional
    units : Units, optional
        Of length, force and energy, for the headings; numbers are not converted.

    Returns
    -------
    Table
    """
    units = Units() if units is None else units
    columns = (
        *(axis.key for axis in sweep.axes), "solutions", "minima", "others", "margin", units.head("energy", "energy"),
        units.head("penetration", "length"), units.head("force", "force"), "note",
    )  # fmt: skip
    rows = []
    for point in sweep.points:
        values = (one if isinstance(one, int | float | str) else str(one) for one in sweep.values(point))
        lowest = (point.energies[0], point.penetrations[0], point.forces[0]) if point.energies else (None, None, None)
        others = None if point.failed else "no" if point.exhaustive else "perhaps"
        margin = None if math.isnan(point.margin) else point.margin
        counts = (None, None) if point.failed else (point.count, point.minima)
        rows.append((*values, *counts, others, margin, *lowest, point.note if point.failed else ""))
    kept = [k for k, name in enumerate(columns) if name != "note" or any(row[k] for row in rows)]
    return Table(tuple(columns[k] for k in kept), tuple(tuple(row[k] for k in kept) for row in rows), title)
