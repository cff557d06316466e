"""``hemivar march``: problems in time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hemivar.basics.disk import make_folder
from hemivar.cli.march_run import MarchOptions, MarchRun
from hemivar.cli.options import (
    ENGINES,
    Checkpoint,
    EngineName,
    Json,
    ProblemPath,
    Quiet,
    check_engine,
    each_field_an_option,
)

__all__ = ["march"]


@each_field_an_option
def march(
    problem: ProblemPath,
    options: MarchOptions,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR/NAME", help="Write NAME.pvd, NAME.csv and NAME.ckpt in a folder."),
    ] = None,
    fields: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the frames (.pvd), for ParaView.")] = None,
    table: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the table (.csv or .parquet).")] = None,
    json: Json = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the energy balance (.png, .svg or .pdf).")
    ] = None,
    animation: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a film (.gif or .mp4).")] = None,
    checkpoint: Checkpoint = None,
    quiet: Quiet = False,
    engine: EngineName = ENGINES[0],
) -> int:
    """Integrate a problem in time, with a uniqueness margin per step and an energy balance.

    Options override what the file says of time and output. Exit code 0 if the end of the time interval is
    reached. Ctrl-C ends the run after the current step, with everything written.
    """
    if output is not None:
        fields, table, checkpoint = (
            given or output.parent / f"{output.name}{suffix}"
            for given, suffix in ((fields, ".pvd"), (table, ".csv"), (checkpoint, ".ckpt"))
        )
    outputs = {"--fields": fields, "--table": table, "--json": json, "--plot": plot, "--animation": animation}
    check_engine(engine)

    def begin() -> None:
        options.check()
        if output is not None and output.parent != Path():
            make_folder(output.parent)

    if engine == "petsc":
        from hemivar.cli.march_on_ranks import march_file_on_ranks

        return march_file_on_ranks(problem, {**outputs, "--checkpoint": checkpoint}, options, quiet, begin)
    begin()
    return MarchRun(problem, outputs, checkpoint, options).march(quiet)
