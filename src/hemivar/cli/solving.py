"""``hemivar solve``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.cli.options import (
    ENGINES,
    Checkpoint,
    Colour,
    Csv,
    EngineName,
    Exact,
    Exit,
    Given,
    Json,
    MaxSteps,
    MaxTime,
    MethodName,
    ProblemPath,
    Quiet,
    Resume,
    Rtol,
    Tolerance,
    Verbose,
    check_colour,
    check_engine,
    check_limits,
    check_load_factors,
    method_named,
)
from hemivar.cli.outputs import check_outputs
from hemivar.cli.printing import SolveView, console, print_head, print_not_converged, print_summary
from hemivar.cli.session import Session
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.certificates import Certificate
    from hemivar.files.problem_file import ProblemFile
    from hemivar.solvers import Solution

__all__ = ["check_drawable", "draw", "solve"]


def solve(
    problem: ProblemPath,
    method: MethodName = None,
    json: Json = None,
    vtu: Annotated[Path | None, typer.Option(metavar="FILE.vtu", help="Write the fields, for ParaView.")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the deformed body (.png, .svg or .pdf).")
    ] = None,
    plot_contact: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw pressure, friction and slip on the contact boundary.")
    ] = None,
    colour: Colour = None,
    rtol: Rtol = None,
    max_time: MaxTime = None,
    max_steps: MaxSteps = None,
    load_factor: Annotated[
        float | None,
        typer.Option("--load-factor", metavar="X", help="Factor of loads and prescribed displacements."),
    ] = None,
    quiet: Quiet = False,
    verbose: Verbose = False,
    warm_start: Annotated[
        bool, typer.Option("--warm-start", help="Solve on coarser meshes first, each starting the next.")
    ] = False,
    engine: EngineName = ENGINES[0],
    checkpoint: Checkpoint = None,
    resume: Resume = False,
    exact: Exact = None,
    adaptive: Tolerance = None,
    goal: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Refine for this quantity: contact.bottom.force, support.left.force ..."),
    ] = None,
    max_unknowns: Annotated[
        int | None, typer.Option(metavar="N", help="Limit of unknowns of adaptive meshes (300000).")
    ] = None,
    max_memory: Annotated[
        float | None, typer.Option(metavar="GIB", help="Limit of memory of adaptive meshes (what is free).")
    ] = None,
    csv: Csv = None,
    plot_error: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the error against the unknowns (adaptive).")
    ] = None,
    plot_meshes: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the meshes, coarse to fine (adaptive).")
    ] = None,
    given: Given = None,
) -> int:
    """Solve a contact problem."""
    limits = rtol, max_time, max_steps
    pictures = {"--plot": plot, "--plot-contact": plot_contact}
    check_engine(engine)
    check_colour(colour, {"--plot": plot})
    check_load_factors(*(() if load_factor is None else (load_factor,)))
    own = {"--csv": csv, "--plot-error": plot_error, "--plot-meshes": plot_meshes}
    if adaptive is not None:
        _refuse({"--checkpoint": checkpoint, "--resume": resume or None}, "petsc")
        if warm_start or load_factor is not None or engine != ENGINES[0]:
            other = "--warm-start" if warm_start else f"--engine {engine}" if load_factor is None else "--load-factor"
            raise ProblemError(f"--adaptive and {other} exclude one another; leave one of the two out")
        from hemivar.cli.adapting import AdaptRun

        asked: dict[str, object] = {
            "adaptive": adaptive,
            "rtol": rtol,
            "goal": goal,
            "max_unknowns": max_unknowns,
            "max_time": max_time,
        }
        asked |= {"max_memory": max_memory, "max_steps": max_steps, "given": given, "colour": colour}
        run_adaptive = AdaptRun(problem, {"--json": json, "--vtu": vtu, **own, **pictures}, method, asked)
        return run_adaptive.solve(quiet)
    for option, value in {"--goal": goal, "--max-unknowns": max_unknowns, "--max-memory": max_memory, **own}.items():
        if value is not None:
            raise ProblemError(f"{option} goes with --adaptive; give both, or leave it out")
    if engine == "petsc":
        outputs = {"--json": json, "--vtu": vtu, "--checkpoint": checkpoint}
        from hemivar.cli.on_ranks import run_on_ranks

        def check() -> None:
            _refuse({"--method": method, "--exact": exact or None, "--load-factor": load_factor, **pictures}, "scipy")
            check_outputs(outputs, problem)
            check_limits(*limits)
            if resume and checkpoint is None:
                raise ProblemError("--resume needs a checkpoint; name it by --checkpoint FILE")

        return run_on_ranks(problem, outputs, resume, limits, check, quiet, given)
    _refuse({"--checkpoint": checkpoint, "--resume": resume or None}, "petsc")
    named = None if method is None else method_named(method)
    session = Session(problem, {"--json": json, "--vtu": vtu, **pictures}, *limits, given=given)
    stated, writer = session.stated, session.writer
    check_drawable(stated, plot_contact, colour)
    controls = session.controls
    meshes = stated.coarser_meshes() if warm_start else []
    if warm_start and not meshes:
        raise ProblemError(
            f"{stated.name}: --warm-start needs coarser meshes; give even numbers of cells, or [mesh] refine"
        )
    *coarser, discrete = [session.discrete(mesh, load_factor) for mesh in (*meshes, None)]
    print_head(stated, discrete)
    from hemivar.solvers import Status
    from hemivar.workflows import RunOptions, result_of, run

    view = SolveView(quiet, verbose)
    interrupted, certificate = False, None
    try:
        found = result_of(run(discrete, RunOptions(named or session.method, controls, coarser, bool(exact))), view)
        interrupted, certificate = found.interrupted, found.certificate
        if found.complaint and not found.interrupted:
            writer.failed.append(f"the solution could not be certified: {found.complaint}")
        print_summary(console(), found.solution, certificate, stated.units)
    finally:  # whatever happens between, what was computed is written
        if view.solution is not None:
            _write(session, view.solution, certificate, colour)
            writer.tell()
            writer.complain()
    if interrupted:
        return writer.ended(Exit.INTERRUPTED)
    if found.solution.status is not Status.CONVERGED:
        print_not_converged(found.solution)
        return writer.ended(Exit.NOT_CONVERGED)
    return writer.ended(Exit.CONVERGED)


def _refuse(options: Mapping[str, object], engine: str) -> None:
    for option, value in options.items():
        if value is not None:
            raise ProblemError(f"{option} goes with --engine {engine}; leave one of the two out")


def check_drawable(stated: ProblemFile, plot_contact: Path | None, colour: str | None = None) -> None:
    """Refuse pictures that this problem has not."""
    if plot_contact is not None and not (stated.problem.contact or getattr(stated.problem, "areas", {})):
        raise ProblemError(f"{stated.name}: --plot-contact draws contact boundaries, and there is none; take --plot")

    scalar = stated.problem.kind is not None
    if scalar and plot_contact is not None and stated.problem.mesh.dim == 3:
        raise ProblemError(f"{stated.name}: --plot-contact draws contact of one component in the plane; take --vtu")
    if scalar and colour is not None:
        raise ProblemError(
            f"{stated.name}: --colour is of elastic bodies, and a scalar problem has its own; leave it out"
        )


def _write(session: Session, solution: Solution, certificate: Certificate | None, colour: str | None) -> None:
    """Write what was asked for, data before pictures, and what may end the process last."""
    from hemivar import files

    writer, outputs = session.writer, session.outputs
    units = {"units": writer.units} if writer.units else None
    writer.write("--json", outputs["--json"], lambda path: files.write_json(solution, path, certificate, units))
    writer.write("--vtu", outputs["--vtu"], lambda path: files.write_vtu(solution, path))
    draw(session, solution, certificate, colour)


def draw(session: Session, solution: Solution, certificate: Certificate | None, colour: str | None) -> None:
    """Draw the pictures of a solution that were asked for, with a line each that tells what was certified."""
    writer, outputs, title = session.writer, session.outputs, session.title
    if not any(outputs[option] for option in ("--plot", "--plot-contact")):
        return
    from hemivar.report import BodyColour, plot_contact, plot_solution, save

    shade, units = None if colour is None else BodyColour(colour), session.stated.units

    pictures: dict[str, Callable[[Path], object]] = {
        "--plot": lambda path: save(
            plot_solution(
                solution,
                scale="auto",
                title=title,
                colour=shade,
                certificate=certificate,
                unit=units.length,
                stress_unit=units.stress,
            ),
            path,
        ),
        "--plot-contact": lambda path: save(
            plot_contact(solution, title=title, certificate=certificate, unit=units.length, stress_unit=units.stress),
            path,
        ),
    }
    for option, task in pictures.items():
        writer.write(option, outputs[option], task, picture=True)
