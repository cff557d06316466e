"""``hemivar sweep``: the solutions of a problem over one or more of its parameters."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from hemivar.basics.disk import shown
from hemivar.cli.options import (
    Checkpoint,
    Csv,
    Exit,
    Jobs,
    Latex,
    MaxSolutions,
    MaxTime,
    ProblemPath,
    Rtol,
    Seed,
    Starts,
    check_limits,
    controls_of,
)
from hemivar.cli.outputs import kept_file, one_line, tell_kept
from hemivar.cli.printing import StageView, console, print_table
from hemivar.cli.session import Session
from hemivar.errors import ProblemError

__all__ = ["sweep"]

_SHOWN = 40


def sweep(
    problem: ProblemPath,
    given: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="KEY=LOW:HIGH:COUNT",
            help="Set a range of a value of the file (:log for logarithmic steps), or one value KEY=VALUE.",
        ),
    ] = None,
    jobs: Jobs = 1,
    checkpoint: Checkpoint = None,
    csv: Csv = None,
    latex: Latex = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw margin and number of solutions (.png, .svg or .pdf).")
    ] = None,
    label: Annotated[
        list[str] | None, typer.Option(metavar="TEXT", help="Name of a parameter in the picture, with its unit.")
    ] = None,
    starts: Starts = 40,
    max_solutions: MaxSolutions = 100,
    seed: Seed = 0,
    rtol: Rtol = None,
    max_time: MaxTime = None,
) -> int:
    """Count the solutions, and compute the margin, over ranges of parameters; goes on where it was interrupted.

    Exit code 0 if every point has a result.
    """
    from hemivar.files.changes import Change
    from hemivar.report.tables import sweep_table
    from hemivar.workflows import SolutionsOptions, SweepAxis, SweepOptions, read_axis, result_of, sweeping
    from hemivar.workflows.sweep import sweep_digest

    check_limits(rtol, max_time)
    read = [read_axis(text) for text in given or ()]
    axes = [one for one in read if isinstance(one, SweepAxis)]
    changes = tuple(one for one in read if isinstance(one, Change))
    if not axes:
        raise ProblemError("sweep: give a range with --set, as in --set contact.bottom.normal.q_max=0:1:21")
    if plot is not None and len(axes) > 2:
        raise ProblemError(f"--plot draws one or two parameters, and {len(axes)} have ranges; leave it out")
    if len(label or ()) > len(axes):
        raise ProblemError(
            f"--label is there {len(label or ())} times, and {len(axes)} parameters have a range; give one for each"
        )
    outputs = {"--csv": csv, "--latex": latex, "--plot": plot}
    fixed = [text for text, one in zip(given or (), read, strict=True) if isinstance(one, Change)]

    def at(place: int) -> Session:
        values = [f"{axis.key}={axis.values[place]!r}" for axis in axes]
        return Session(problem, {**outputs, "--checkpoint": checkpoint}, rtol, max_time, given=[*fixed, *values])

    # the file is read before any work, so that what is wrong with it, or with a key, is said; one end of the ranges may
    # make no sense
    try:
        session = at(0)
    except ProblemError as error:
        try:
            session = at(-1)
        except ProblemError:
            raise error from None
    stated, writer = session.stated, session.writer
    search = SolutionsOptions(starts, max_solutions, seed, controls_of(stated, rtol, max_time))
    options = SweepOptions(search, jobs, None, changes, must_keep=checkpoint is not None)
    if checkpoint is None:
        checkpoint = kept_file(problem, "sweep", sweep_digest(problem, axes, options), outputs, writer)
    points = math.prod(len(axis.values) for axis in axes)
    terminal = console()
    print(one_line(stated.problem.title) or shown(stated.name))
    for change in changes:
        print(f"set               {shown(change)}")
    print(f"parameters        {', '.join(f'{axis.key} ({len(axis.values)})' for axis in axes)}: {points} points")
    with StageView(terminal) as view:
        found = result_of(sweeping(problem, axes, replace(options, checkpoint=checkpoint)), view)
    table = sweep_table(found, units=stated.units)
    if len(table.rows) <= _SHOWN:
        print_table(terminal, table, keys=len(found.axes))
    else:
        print(f"                  {len(table.rows)} points are done; --csv writes their table")
    failed = [point for point in found.points if point.failed]
    if failed:
        print(f"without result    {len(failed)} point{'s' if len(failed) > 1 else ''}; the first: {failed[0].note}")
    writer.write("--csv", csv, table.write_csv)
    writer.write("--latex", latex, sweep_table(found, stated.problem.title, units=stated.units).write_latex)

    def draw(file: Path) -> None:
        from hemivar.report.saving import save
        from hemivar.report.sweep_figures import plot_sweep

        save(plot_sweep(found, labels=label or (), title=session.title), file)

    if found.points:
        writer.write("--plot", plot, draw, picture=True)
    writer.tell()
    tell_kept(checkpoint, found.unkept)
    if found.interrupted:
        print(f"interrupted: {len(found.points)} of {points} points are done; run the same command to continue")
        return writer.ended(Exit.INTERRUPTED)
    return writer.ended(Exit.NOT_CONVERGED if failed else Exit.CONVERGED)
