"""``hemivar solve``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.basics.disk import noting_files_read
from hemivar.cli.options import (
    Exit,
    MaxSteps,
    MaxTime,
    ProblemPath,
    Rtol,
    check_limits,
    controls_of,
    method_named,
    suggest,
)
from hemivar.cli.outputs import check_outputs, keep_off
from hemivar.cli.session import Session
from hemivar.cli.show import SolveView, console, print_head, print_step, print_summary
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.certify import Certificate
    from hemivar.files.problem_file import ProblemFile
    from hemivar.solvers import Controls, Progress, Solution

__all__ = ["solve"]

_ENGINES = ("scipy", "petsc")


def solve(
    problem: ProblemPath,
    method: Annotated[
        str | None, typer.Option(metavar="NAME", help="Method, see 'hemivar methods' (by predicted cost).")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the results.")] = None,
    vtu: Annotated[Path | None, typer.Option(metavar="FILE.vtu", help="Write the fields, for ParaView.")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the deformed body (.png, .svg or .pdf).")
    ] = None,
    plot_contact: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw pressure, friction and slip on the contact boundary.")
    ] = None,
    render: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw a body in 3D shaded, by PyVista.")
    ] = None,
    rtol: Rtol = None,
    max_time: MaxTime = None,
    max_steps: MaxSteps = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No line for each step.")] = False,
    warm_start: Annotated[
        bool, typer.Option("--warm-start", help="Solve on coarser meshes first, each starting the next.")
    ] = False,
    engine: Annotated[
        str, typer.Option(metavar="NAME", help="'scipy', or 'petsc' for all ranks of mpirun.")
    ] = _ENGINES[0],
    checkpoint: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Keep the iterate here after every step (engine petsc).")
    ] = None,
    restart: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Go on from a checkpoint (engine petsc).")
    ] = None,
) -> int:
    """Solve a contact problem."""
    limits = rtol, max_time, max_steps
    pictures = {"--plot": plot, "--plot-contact": plot_contact, "--render": render}
    if engine not in _ENGINES:
        raise ProblemError(f"--engine {engine}: it is not known{suggest(engine, _ENGINES)}")
    if engine == "petsc":
        outputs = {"--json": json, "--vtu": vtu, "--checkpoint": checkpoint}
        say = None if quiet else print_step
        return _on_ranks(problem, outputs, restart, limits, say, {"--method": method, **pictures})
    _refuse({"--checkpoint": checkpoint, "--restart": restart}, "petsc")
    named = None if method is None else method_named(method)
    session = Session(
        problem, {"--json": json, "--vtu": vtu, **pictures}, rtol=rtol, max_time=max_time, max_steps=max_steps
    )
    stated, writer = session.stated, session.writer
    _check_drawable(stated, plot_contact, render)
    controls = session.controls
    meshes = stated.coarser_meshes() if warm_start else []
    if warm_start and not meshes:
        raise ProblemError(
            f"{stated.name}: --warm-start needs coarser meshes; give even numbers of cells, or [mesh] refine"
        )
    *coarser, discrete = [session.discrete(mesh) for mesh in (*meshes, None)]
    print_head(stated, discrete)
    from hemivar.workflows import RunOptions, result_of, run

    view = SolveView(quiet)
    interrupted, certificate = False, None
    try:
        found = result_of(run(discrete, RunOptions(named or session.method, controls, coarser)), view)
        interrupted, certificate = found.interrupted, found.certificate
        if found.complaint and not found.interrupted:
            writer.failed.append(f"the solution could not be certified: {found.complaint}")
        print_summary(console(), found.solution, certificate)
    finally:  # whatever happens between, what was computed is written
        if view.solution is not None:
            _write(session, view.solution, certificate)
            writer.tell()
            writer.complain()
    return writer.ended(Exit.INTERRUPTED if interrupted else _exit_code(found.solution))


def _refuse(options: Mapping[str, object], engine: str) -> None:
    for option, value in options.items():
        if value is not None:
            raise ProblemError(f"{option} goes with --engine {engine}; leave one of the two out")


def _on_ranks(
    problem: Path,
    outputs: dict[str, Path | None],
    restart: Path | None,
    limits: tuple[float | None, float | None, int | None],
    say: Callable[[Progress], bool | None] | None,
    others: Mapping[str, object],
) -> int:
    """Solve by the engine of many ranks."""
    from hemivar.cli.on_ranks import run_on_ranks

    def check() -> None:
        _refuse(others, "scipy")
        check_outputs(outputs, problem)
        check_limits(*limits)

    def controls(stated: ProblemFile, say: Callable[[Progress], bool | None] | None) -> Controls:
        keep_off(outputs, inputs)
        return controls_of(stated, *limits, say)

    files = outputs["--json"], outputs["--vtu"], outputs["--checkpoint"]
    with noting_files_read() as inputs:
        return run_on_ranks(problem, check, controls, say, *files, restart)


def _check_drawable(stated: ProblemFile, plot_contact: Path | None, render: Path | None) -> None:
    """Refuse pictures that this problem has not."""
    if plot_contact is not None and not stated.problem.contact:
        raise ProblemError(f"{stated.name}: --plot-contact draws contact boundaries, and there is none; take --plot")
    if render is not None:
        from hemivar.report.scene import check_rendering

        try:
            check_rendering(stated.problem.mesh.dim)
        except ProblemError as error:
            raise ProblemError(f"--render: {error}") from None


def _write(session: Session, solution: Solution, certificate: Certificate | None) -> None:
    """Write what was asked for, data before pictures, and what may end the process last."""

    def json(path: Path) -> None:
        from hemivar.files import write_json

        write_json(solution, path, certificate)

    def vtu(path: Path) -> tuple[Path, Path | None]:
        from hemivar.files import write_vtu

        return write_vtu(solution, path)

    def plot(path: Path) -> None:
        from hemivar.report import plot_solution, save

        save(plot_solution(solution, scale="auto", title=session.title), path)

    def plot_contact(path: Path) -> None:
        from hemivar.report import plot_contact, save

        save(plot_contact(solution, title=session.title), path)

    def render(path: Path) -> None:
        from hemivar.report.scene import render_solution

        render_solution(solution, path, scale="auto", title=session.stated.problem.title or None)

    writer, outputs = session.writer, session.outputs
    writer.write("--json", outputs["--json"], json)
    writer.write("--vtu", outputs["--vtu"], vtu)
    writer.write("--plot", outputs["--plot"], plot, picture=True)
    writer.write("--plot-contact", outputs["--plot-contact"], plot_contact, picture=True)
    writer.write("--render", outputs["--render"], render, picture=True)


def _exit_code(solution: Solution) -> Exit:
    from hemivar.solvers import Status

    if solution.status is Status.CONVERGED:
        return Exit.CONVERGED
    sys.stdout.flush()
    sys.stderr.write(
        f"hemivar: not converged: {solution.status.value} after {solution.steps} steps, relative residual "
        f"{solution.residual.relative:.1e}: {solution.status.remedy}\n"
    )
    return Exit.NOT_CONVERGED
