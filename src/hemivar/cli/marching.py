"""``hemivar march``: problems in time."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hemivar.basics.disk import make_folder
from hemivar.cli.march_run import MarchOptions, MarchRun
from hemivar.cli.options import ENGINES, EngineName, Given, MaxTime, ProblemPath, Quiet, Rtol, check_engine

__all__ = ["march"]


def march(
    problem: ProblemPath,
    until: Annotated[float | None, typer.Option(metavar="T", help="End of time.")] = None,
    step: Annotated[float | None, typer.Option(metavar="T", help="Length of the steps, or of the first.")] = None,
    adaptive: Annotated[
        float | None, typer.Option(metavar="X", help="Relative error of a step, whose length follows it.")
    ] = None,
    scheme: Annotated[str | None, typer.Option(metavar="NAME", help="implicit-euler, generalized-alpha ...")] = None,
    every: Annotated[float | None, typer.Option(metavar="T", help="Time between frames (200 frames at most).")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="DIR/NAME", help="NAME.pvd, NAME.csv and NAME.ckpt in a folder.")
    ] = None,
    fields: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the frames (.pvd or .xdmf).")] = None,
    table: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the table (.csv or .parquet).")] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write table, ledger and events.")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the ledger (.png, .svg or .pdf).")] = None,
    animation: Annotated[Path | None, typer.Option(metavar="FILE", help="Write a film (.gif or .mp4).")] = None,
    checkpoint: Annotated[Path | None, typer.Option(metavar="FILE", help="Keep the march here, to go on.")] = None,
    minutes: Annotated[float | None, typer.Option(metavar="X", help="Least time between checkpoints (10).")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint, if there is one.")] = False,
    jump: Annotated[
        str | None, typer.Option(metavar="NAME", help="Where a step may have several solutions: local, stop ...")
    ] = None,
    rtol: Rtol = None,
    max_time: MaxTime = None,
    quiet: Quiet = False,
    engine: EngineName = ENGINES[0],
    given: Given = None,
) -> int:
    """Compute a problem in time, each step with its margin, all energy booked.

    The tables 'time' and 'output' of the file hold where no option says otherwise. Exit code 0 if the end of time is
    reached; Ctrl-C ends after the step, with everything written.
    """
    if out is not None:
        fields, table, checkpoint = (
            given or out.parent / f"{out.name}{suffix}"
            for given, suffix in ((fields, ".pvd"), (table, ".csv"), (checkpoint, ".ckpt"))
        )
    outputs = {"--fields": fields, "--table": table, "--json": json, "--plot": plot, "--animation": animation}
    options = MarchOptions(
        until, step, adaptive, every, scheme, jump, minutes, resume, rtol, max_time, tuple(given or ())
    )
    check_engine(engine)

    def begin() -> None:
        options.check()
        if out is not None and out.parent != Path():
            make_folder(out.parent)

    if engine == "petsc":
        from hemivar.cli.march_on_ranks import march_file_on_ranks

        return march_file_on_ranks(problem, {**outputs, "--checkpoint": checkpoint}, options, quiet, begin)
    begin()
    return MarchRun(problem, outputs, checkpoint, options).march(quiet)
