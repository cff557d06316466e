"""``hemivar study``: a problem on meshes that are halved, its errors and their orders."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.basics.disk import shown
from hemivar.cli.options import (
    Checkpoint,
    Csv,
    Exact,
    Exit,
    Given,
    Jobs,
    Json,
    Latex,
    MaxSteps,
    MaxTime,
    MethodName,
    ProblemPath,
    Rtol,
    method_named,
)
from hemivar.cli.outputs import kept_file, one_line, tell_kept
from hemivar.cli.printing import StageView, console, print_table
from hemivar.cli.session import Session, naming_file
from hemivar.errors import FileError, HemivarError, ProblemError

if TYPE_CHECKING:
    from hemivar.basics.types import Record
    from hemivar.workflows import Study
    from hemivar.workflows.study import StudyLevel

__all__ = ["study"]


def study(
    problem: ProblemPath,
    refine: Annotated[int, typer.Option(metavar="N", help="Number of refinements, each halving the mesh.")] = 3,
    coarser: Annotated[int, typer.Option(metavar="N", min=0, help="Number of coarser meshes to begin with.")] = 0,
    known: Annotated[
        list[str] | None,
        typer.Option(metavar="FORMULA", help="Known solution in x and y, once for each component (the finest mesh)."),
    ] = None,
    exact: Exact = None,
    method: MethodName = None,
    jobs: Jobs = 1,
    checkpoint: Checkpoint = None,
    csv: Csv = None,
    latex: Latex = None,
    json: Json = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the errors over h (.png, .svg or .pdf).")
    ] = None,
    rtol: Rtol = None,
    max_time: MaxTime = None,
    max_steps: MaxSteps = None,
    given: Given = None,
) -> int:
    """Solve on meshes that are halved; errors, and observed orders; goes on where it was interrupted.

    Exit code 0 if every solve converged.
    """
    from hemivar.report.loglog import plot_study
    from hemivar.report.tables import study_table
    from hemivar.workflows import StudyOptions, result_of, studying
    from hemivar.workflows.study import study_digest

    outputs = {"--csv": csv, "--latex": latex, "--json": json, "--plot": plot}
    session = Session(problem, {**outputs, "--checkpoint": checkpoint}, rtol, max_time, max_steps, given=given)
    stated, writer = session.stated, session.writer
    solver = session.method if method is None else method_named(method)
    meshes = [*stated.coarser_meshes(), stated.problem.mesh]
    if coarser >= len(meshes):
        raise ProblemError(
            f"--coarser is {coarser}, and {stated.name} describes {len(meshes) - 1} coarser meshes; give even numbers "
            "of cells, or [mesh] refine"
        )
    first = stated.problem.on(meshes[-1 - coarser])
    options = StudyOptions(
        refine, known or None, solver, session.controls, jobs, must_keep=checkpoint is not None, exact=bool(exact)
    )
    if checkpoint is None:
        checkpoint = kept_file(problem, "study", study_digest(first, options), outputs, writer)
    options = replace(options, checkpoint=checkpoint)
    terminal = console()
    print(one_line(stated.problem.title) or shown(stated.name))
    for change in stated.changes:
        print(f"set               {shown(change)}")
    try:
        with StageView(terminal) as view:
            found = result_of(studying(first, options), view)
    except FileError:
        raise
    except HemivarError as error:
        raise naming_file(error, stated.name) from error
    units = stated.units
    table = study_table(found, units=units)
    print()
    print_table(terminal, study_table(found, brief=True, units=units))
    _print_orders(found)
    _print_bounds(found)
    writer.write("--csv", csv, table.write_csv)
    writer.write("--latex", latex, study_table(found, stated.problem.title, units=units).write_latex)
    writer.write_record(json, _record(found, stated.name))

    def draw(file: Path) -> None:
        from hemivar.report.saving import save

        save(plot_study(found, title=session.title, unit=stated.units.length), file)

    if found.quantities:
        writer.write("--plot", plot, draw, picture=True)
    writer.tell()
    tell_kept(checkpoint, found.unkept)
    if found.interrupted:
        print(f"interrupted: {len(found.levels)} of {refine + 1} meshes are done; run the same command to continue")
        return writer.ended(Exit.INTERRUPTED)
    done = found.converged and len(found.levels) == refine + 1
    return writer.ended(Exit.CONVERGED if done else Exit.NOT_CONVERGED)


def _print_orders(found: Study) -> None:
    """Print what the errors are of, and the fitted orders."""
    print(f"reference         {found.reference}")
    for name in found.quantities:
        order = found.orders[name]
        told = "too few meshes for an order" if math.isnan(order) else f"order {order:.2f}"
        finest = [value for value in found.relative(name) if not math.isnan(value)]
        print(f"{name:<18}{told}" + (f", relative error {finest[-1]:.3g}" if finest else ""))


def _print_bounds(found: Study) -> None:
    """Print the bound on the finest mesh, or why there is none."""
    level = found.levels[-1]
    if math.isnan(level.bound):
        return
    if math.isfinite(level.bound):
        norm = found.norms["energy"]
        relative = f", relative {level.bound / norm:.3g}" if norm > 0.0 else ""
        print(f"{found.kind_of_bound:<18}{level.bound:.3g} in the energy norm on the finest mesh{relative}")
        if level.conditions:
            print(f"                  if {' and '.join(level.conditions)}")
        return
    print("guaranteed bound  none on the finest mesh")
    for reason in level.unbounded:
        print(f"                  because {reason}")


def _bound_record(level: StudyLevel) -> Record:
    """The bound as plain numbers and strings; nothing where none was asked for."""
    if math.isnan(level.bound):
        return {}
    if level.conditions:
        return {"conditional_bound": level.bound, "conditions": list(level.conditions)}
    return {"guaranteed_bound": level.bound if math.isfinite(level.bound) else None}


def _record(found: Study, name: str) -> Record:
    """A study as plain numbers and lists."""

    def plain(value: float) -> float | None:
        return float(value) if math.isfinite(value) else None

    levels = [
        {
            "h": level.size,
            "unknowns": level.solution.problem.unknowns,
            "status": level.solution.status.value,
            "errors": {quantity: plain(getattr(level, quantity)) for quantity in found.quantities},
            "orders": {quantity: plain(found.steps(quantity)[number]) for quantity in found.quantities},
            **_bound_record(level),
            "energy": plain(level.solution.energy),
            "normal_force": plain(level.solution.normal_force) if level.solution.problem.contact_points else None,
        }
        for number, level in enumerate(found.levels)
    ]
    return {
        "problem": name,
        "reference": found.reference,
        "norms": {quantity: plain(found.norms[quantity]) for quantity in found.quantities},
        "orders": {quantity: plain(found.orders[quantity]) for quantity in found.quantities},
        "interrupted": found.interrupted,
        "meshes": levels,
    }
