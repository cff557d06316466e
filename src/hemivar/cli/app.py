"""The command ``hemivar``: a thin skin over the library.

Everything but the command line itself is imported inside the commands, so that ``hemivar --help`` is quick.
"""

from __future__ import annotations

import contextlib
import difflib
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hemivar import __version__
from hemivar.basics.disk import noting_files_read, shown, write_text
from hemivar.cli.outputs import Writer, check_folder, check_outputs, internal_error, keep_off, one_line
from hemivar.cli.terminal import Stream, guarded_streams, quiet_logging, quiet_warnings, signals_as_interrupts
from hemivar.errors import HemivarError, ProblemError

if TYPE_CHECKING:
    from rich.console import Console

    from hemivar.certify import Certificate
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.files.problem_file import ProblemFile
    from hemivar.mesh.mesh import Mesh
    from hemivar.report.tables import Table
    from hemivar.solvers import Controls, Progress, Solution, Solver

__all__ = ["app", "main"]

_CONVERGED, _NOT_CONVERGED, _BAD_INPUT, _INTERNAL, _INTERRUPTED = 0, 1, 2, 70, 130
_LARGEST_RTOL = 1e-2
_LARGEST_FACTOR = 1e100
_MOST_STARTS = 1_000_000
_MOST_STEPS = 10**9
_REFERENCE, _REFERENCE_IF_LARGE = "newton", "multigrid"
_COMPARE_SECONDS = 60.0
_ENGINES = ("scipy", "petsc")

app = typer.Typer(
    name="hemivar",
    help="Solve contact problems of elastic bodies with foundations given by superpotentials.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 converged, 1 not converged, 2 bad input or a file that cannot be written, 130 interrupted.",
)

_ProblemPath = Annotated[Path, typer.Argument(metavar="PROBLEM.toml", help="The problem file.")]
_Rtol = Annotated[
    float | None, typer.Option(metavar="X", help="Tolerance of the residual, relative to the load (1e-9).")
]
_MaxTime = Annotated[float | None, typer.Option(metavar="S", help="Limit of each stage in seconds (none).")]
_MaxSteps = Annotated[int | None, typer.Option(metavar="N", help="Limit of steps (set by the method).")]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments; those of the process by default.

    Returns
    -------
    int
        0 converged (or done), 1 not converged, 2 bad input or a file that could not be written (one line on stderr),
        70 an error that should not occur, 130 interrupted (Ctrl-C, SIGTERM, SIGHUP, nobody reads standard output).
    """
    arguments = None if argv is None else list(argv)
    if argv is None:
        os.environ["MPLBACKEND"] = "agg"  # figures go to files; a backend that does not exist would stop them
    with guarded_streams() as (out, _), quiet_warnings(), signals_as_interrupts():
        code = _guarded(arguments, out)
        out.flush()
        if out.failed is not None and not out.reader_left:
            reason = getattr(out.failed, "strerror", None) or out.failed
            complaint = _complain(f"standard output cannot be written ({reason})")
            code = complaint if code == _CONVERGED else code
        if code == _INTERRUPTED:
            _leave(code)
        return code


def _guarded(arguments: list[str] | None, out: Stream) -> int:
    """Run the command; whatever it raises becomes an exit code and one line."""
    try:
        result = app(args=arguments, prog_name="hemivar", standalone_mode=False)
        code = result if isinstance(result, int) else _CONVERGED
    except HemivarError as error:
        return _complain(str(error))
    except (KeyboardInterrupt, typer.Abort):
        code = _INTERRUPTED
    except typer.Exit as stop:
        code = stop.exit_code
    except MemoryError:
        return _complain("not enough memory for this problem; take --method multigrid, or fewer cells")
    except OSError as error:
        return _complain(f"{error.filename or 'a file'}: {error.strerror or error}; check path and disk")
    except Exception as error:
        if hasattr(error, "format_message"):
            usage = error.format_message()
            usage = usage.rstrip(".") + (" " if usage.endswith("?") else "; ")
            return _complain(f"{usage}see 'hemivar --help'")
        return _complain(internal_error(error), _INTERNAL)
    if code == _INTERRUPTED:
        why = ": standard output is no longer read" if out.reader_left else ""
        sys.stderr.write(f"hemivar: interrupted{why}\n")
    return code


def _leave(code: int) -> None:
    """End the process at once if a factorisation that was interrupted still runs; otherwise do nothing."""
    factorisation = sys.modules.get("hemivar.linear.factorisation")
    if factorisation is not None and factorisation.abandoned_work():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _complain(message: str, code: int = _BAD_INPUT) -> int:
    sys.stdout.flush()
    sys.stderr.write(f"hemivar: error: {one_line(message)}\n")
    return code


def _ended(writer: Writer, code: int) -> int:
    """The exit code after the files were written: complaints about them come last, and stand before success."""
    if writer.complain() and code != _INTERRUPTED:
        return _BAD_INPUT
    return _INTERRUPTED if writer.interrupted else code


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"hemivar {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options of the command itself."""


# ---- commands --------------------------------------------------------------------------------------------


@app.command("solve")
def _solve(
    problem: _ProblemPath,
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
    rtol: _Rtol = None,
    max_time: _MaxTime = None,
    max_steps: _MaxSteps = None,
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
    outputs = {"--json": json, "--vtu": vtu, "--plot": plot, "--plot-contact": plot_contact, "--render": render}
    if engine not in _ENGINES:
        raise ProblemError(f"--engine {engine}: it is not known{_suggest(engine, _ENGINES)}")
    if engine == "petsc":
        from hemivar.cli.on_ranks import run_on_ranks

        def check() -> None:
            others = {"--method": method, "--plot": plot, "--plot-contact": plot_contact, "--render": render}
            for option, value in others.items():
                if value is not None:
                    raise ProblemError(f"{option} goes with --engine scipy; leave one of the two out")
            check_outputs({**files, "--checkpoint": checkpoint}, problem)
            _check_limits(rtol, max_time, max_steps)

        def limits(stated: ProblemFile, say: Callable[[Progress], bool | None] | None) -> Controls:
            keep_off({**files, "--checkpoint": checkpoint}, inputs)
            return _controls(stated, rtol, max_time, max_steps, say)

        files = {"--json": json, "--vtu": vtu}
        tell: Any = None if quiet else _StepPrinter()
        with noting_files_read() as inputs:
            return run_on_ranks(problem, check, limits, tell, json, vtu, checkpoint, restart)
    for option, value in {"--checkpoint": checkpoint, "--restart": restart}.items():
        if value is not None:
            raise ProblemError(f"{option} goes with --engine petsc; leave one of the two out")
    check_outputs(outputs, problem)
    _check_limits(rtol, max_time, max_steps)
    named = None if method is None else _method(method)
    stated, writer = _read(problem, outputs)
    _check_drawable(stated, outputs)
    console = _console()
    trace = None if quiet else _StepPrinter()
    controls = _controls(stated, rtol, max_time, max_steps, trace)
    meshes = stated.coarser_meshes() if warm_start else []
    if warm_start and not meshes:
        raise ProblemError(
            f"{stated.name}: --warm-start needs coarser meshes; give even numbers of cells, or [mesh] refine"
        )
    discrete = [_discretize(stated, mesh) for mesh in (*meshes, None)]
    _print_head(stated, discrete[-1])
    solver, why = _chosen(stated, discrete[-1], named)
    _print_method(solver, why)
    solution = _solve_levels(discrete, solver, controls, trace)
    certificate: Certificate | None = None
    try:
        certificate = _certificate(solution, controls, writer)
        _print_summary(console, solution, certificate)
    finally:  # whatever happens between, what was computed is written
        _write(writer, solution, stated, outputs, certificate)
        writer.tell()
        writer.complain()
    return _ended(writer, _exit_code(solution))


@app.command("certify")
def _certify(
    problem: _ProblemPath,
    solution: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Solution to certify, .json or .vtu (solve first).")
    ] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the certificate.")] = None,
    rtol: Annotated[
        float, typer.Option(metavar="X", help="Residual, relative to the load, up to which it is a solution.")
    ] = 1e-8,
    max_time: _MaxTime = None,
) -> int:
    """Certify a solution: residuals, uniqueness, a guaranteed error bound, what kind of point it is.

    Exit code 0 if the residual is below the tolerance, 1 if not.
    """
    from hemivar.cli.certify import check_solution_file, run_certify

    outputs = {"--json": json}
    check_outputs(outputs, problem)
    check_solution_file(solution)
    _check_limits(rtol, max_time, None)
    stated, writer = _read(problem, outputs, *([] if solution is None else [solution]))
    discrete = _discretize(stated, None)
    _print_head(stated, discrete)
    controls = _controls(stated, None, max_time, None, None)

    def solve() -> Solution:
        solver, why = _chosen(stated, discrete, None)
        _print_method(solver, why)
        return _solve_levels([discrete], solver, controls, None)

    fulfilled = run_certify(stated.name, discrete, solution, json, rtol, solve, writer, controls.max_time)
    return _ended(writer, _CONVERGED if fulfilled else _NOT_CONVERGED)


@app.command("solutions")
def _solutions(
    problem: _ProblemPath,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the solutions.")] = None,
    starts: Annotated[int, typer.Option(metavar="N", min=0, max=_MOST_STARTS, help="Random starts of each kind.")] = 40,
    max_solutions: Annotated[int, typer.Option(metavar="N", min=1, help="Stop after so many.")] = 100,
    seed: Annotated[int, typer.Option(metavar="N", min=0, help="Seed of the random starts.")] = 0,
    rtol: _Rtol = None,
    max_time: _MaxTime = None,
) -> int:
    """Find all solutions of a problem, with their energies and kinds; says how far it searched.

    Exit code 0 if at least one was found.
    """
    from hemivar.cli.solutions import run_solutions, solutions_table

    outputs = {"--json": json}
    check_outputs(outputs, problem)
    _check_limits(rtol, max_time, None)
    stated, writer = _read(problem, outputs)
    discrete = _discretize(stated, None)
    _print_head(stated, discrete)
    controls = _controls(stated, rtol, max_time, None, None)
    found = run_solutions(
        stated.name, discrete, controls, json, writer, starts=starts, max_solutions=max_solutions, seed=seed
    )  # fmt: skip
    print(f"solutions         {len(found)}; {'no others exist' if found.exhaustive else 'there may be others'}")
    print(f"searched          {found.searched}")
    if len(found):
        _print_table(_console(), solutions_table(found))
    writer.tell()
    code = _CONVERGED if len(found) else _NOT_CONVERGED
    return _ended(writer, _INTERRUPTED if found.interrupted else code)


@app.command("path")
def _path(
    problem: _ProblemPath,
    load_factor: Annotated[
        tuple[float, float], typer.Option(metavar="LOW HIGH", help="Range of the factor of all loads.")
    ] = (0.0, 1.0),
    quantity: Annotated[
        str, typer.Option(metavar="NAME", help="What is drawn over the load: max-penetration, normal-force, ...")
    ] = "max-penetration",
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the path.")] = None,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the path (.png, .svg or .pdf).")] = None,
    max_points: Annotated[int, typer.Option(metavar="N", min=2, max=_MOST_STEPS, help="Limit of points.")] = 2000,
    max_time: _MaxTime = None,
) -> int:
    """Follow the equilibria while the load grows, through folds: stable and unstable branches, folds, jumps.

    Exit code 0 if the path reaches an end of the range.
    """
    from hemivar.cli.path import run_path
    from hemivar.fem import LoadLine
    from hemivar.report.path_diagrams import QUANTITIES

    outputs = {"--json": json, "--plot": plot}
    check_outputs(outputs, problem)
    for factor in load_factor:
        if not abs(factor) <= _LARGEST_FACTOR:
            raise ProblemError(f"--load-factor is {factor:g}; its size must be at most {_LARGEST_FACTOR:g}")
    if quantity not in QUANTITIES:
        raise ProblemError(f"quantity '{quantity}' is not known{_suggest(quantity, list(QUANTITIES))}")
    _check_limits(None, max_time, None)
    stated, writer = _read(problem, outputs)
    discrete = _discretize(stated, None)
    _print_head(stated, discrete)
    limit = _controls(stated, None, max_time, None, None).max_time
    line = LoadLine.of(stated.problem)
    path = run_path(
        stated.problem, line, load_factor, json, plot, writer, quantity=quantity, max_points=max_points, max_time=limit
    )
    writer.tell()
    code = _CONVERGED if path.reached_end else _NOT_CONVERGED
    return _ended(writer, _INTERRUPTED if path.interrupted else code)


@app.command("compare")
def _compare(
    problem: _ProblemPath,
    methods: Annotated[str | None, typer.Option(metavar="A,B,...", help="Methods to compare (all).")] = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE.json", help="Write the table.")] = None,
    csv: Annotated[Path | None, typer.Option(metavar="FILE.csv", help="Write the table.")] = None,
    rtol: _Rtol = None,
    max_time: Annotated[float | None, typer.Option(metavar="S", help="Limit of each method in seconds (60).")] = None,
    max_steps: _MaxSteps = None,
) -> int:
    """Solve a contact problem by several methods and compare them in one table.

    The reference is newton, or multigrid where no factorisation fits into the memory. Exit code 0 if it converged,
    whatever the others did.
    """
    from hemivar.errors import MethodError
    from hemivar.fem import discretize  # noqa: F401 - imported early, so that times are those of methods
    from hemivar.report.tables import Table
    from hemivar.solvers import METHODS
    from hemivar.systems import condense

    outputs = {"--json": json, "--csv": csv}
    check_outputs(outputs, problem)
    _check_limits(rtol, max_time, max_steps)
    names = list(METHODS) if methods is None else [name.strip() for name in methods.split(",")]
    solvers = {name: _method(name) for name in names}
    stated, writer = _read(problem, outputs)
    limit = max_time or stated.solver.max_time or _COMPARE_SECONDS
    controls = _controls(stated, rtol, limit, max_steps, None)
    discrete = _discretize(stated, None)
    _print_head(stated, discrete)
    first = _REFERENCE
    try:
        condensed = condense(discrete)
        print(f"condensation      {condensed.seconds:.3g} s, shared by all methods, not in the times below")
    except MethodError as error:
        condensed, first = None, _REFERENCE_IF_LARGE
        print(f"condensation      none: {error}")
    solvers = {first: _method(first), **solvers}
    print(f"limits            {limit:g} s for each method, relative residual {controls.rtol:.0e}\n")

    console = _console()
    runs: list[_Run] = []
    reference: _Run | None = None
    interrupted = False
    try:
        with _stages(console, len(solvers)) as say:
            for name, solver in solvers.items():
                say(name)
                run = _run(name, solver, discrete, controls, condensed, reference)
                if reference is None and run.solution is not None:
                    reference = run
                runs.append(run)
                interrupted = run.status == "interrupted"
                if interrupted:
                    break
    except KeyboardInterrupt:  # between two solves, or before the first step of one
        interrupted = True
    table = Table(_Run.columns, tuple(run.row for run in runs))
    _print_table(console, table)
    if reference is not None:
        print(f"difference: relative, in the energy norm, to {reference.name}")
    for run in runs:
        if run.note:
            print(f"{run.name}: {run.note}")
    writer.write("--csv", csv, table.write_csv)
    writer.write("--json", json, lambda path: _write_comparison(path, stated, discrete, runs, reference))
    if interrupted:
        return _ended(writer, _INTERRUPTED)
    if runs[0].status != "converged":
        sys.stderr.write(f"hemivar: the reference method {runs[0].name} did not converge: {one_line(runs[0].note)}\n")
        return _ended(writer, _NOT_CONVERGED)
    return _ended(writer, _CONVERGED)


@app.command("survey")
def _survey(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for figures, tables and report.html.")] = Path(
        "survey-output"
    ),
    max_n: Annotated[int, typer.Option(metavar="N", help="Finest mesh size is 1/N; a power of two.")] = 128,
    max_time: Annotated[float, typer.Option(metavar="S", help="Limit of each method on each mesh, in seconds.")] = 60.0,
) -> int:
    """Reproduce the survey's numerical section: its Figures 1 to 5 and its Table 1."""
    _check_limits(None, max_time, None)
    if not 8 <= max_n <= 1024 or max_n & (max_n - 1):
        raise ProblemError(f"--max-n is {max_n}; it must be a power of two, at least 8 and at most 1024")
    from hemivar.report.survey import FILES, run_survey

    check_folder(out, FILES)

    console = _console()
    figures, levels, references = 4, max_n.bit_length() - 1, 2
    with _stages(console, figures + levels + references) as say, quiet_logging():
        result = run_survey(out, max_n=max_n, method_time_limit=max_time, progress=say)
    if result.table1.rows:
        _print_table(console, result.table1)
    if result.orders:
        print("observed orders of convergence in the V-norm (reference, method)")
        for (reference, method), order in result.orders.items():
            print(f"    {order:5.2f}   {reference}, {method}")
    report = out / "report.html"
    others = len(result.files) - (report in result.files)
    print(f"\nwritten           {f'{shown(report)} and ' if report in result.files else ''}{others} other files")
    print(f"time              {result.seconds:.3g} s")
    if result.interrupted:
        print("interrupted: the report holds what was done until then")
    writer = Writer()
    writer.failed += result.failed
    return _ended(writer, _INTERRUPTED if result.interrupted else _CONVERGED)


@app.command("new")
def _new(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")] = Path("problem.toml"),
    force: Annotated[bool, typer.Option("--force", help="Overwrite the file if it exists.")] = False,
) -> int:
    """Write a commented problem file that solves as it is."""
    from hemivar.files.sample import SAMPLE

    if file.exists() and not file.is_dir() and not force:
        raise ProblemError(f"{file}: the file exists; name another one, or overwrite it with --force")
    check_outputs({"FILE": file})
    write_text(file, SAMPLE.replace("FILE", shown(file), 1))
    print(f"written           {shown(file)}\nnow try           hemivar solve {shown(file)} --plot figure.png")
    return _CONVERGED


@app.command("laws")
def _laws(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Show this law only.")] = None,
    given: Annotated[
        list[str] | None, typer.Option("--set", metavar="P=V", help="Parameter of the law; repeat it for others.")
    ] = None,
    file: Annotated[Path | None, typer.Option(metavar="LAW.csv", help="Show a tabulated law.")] = None,
    formula: Annotated[str | None, typer.Option(metavar="TEXT", help="Show the law of this potential of r.")] = None,
    friction: Annotated[
        bool, typer.Option("--friction", help="A friction law: table or formula for r >= 0, or the one of two by NAME.")
    ] = False,
    reach: Annotated[float | None, typer.Option(metavar="X", help="Draw from -X to X (chosen).")] = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw graph and potential (.png, .svg or .pdf).")
    ] = None,
) -> int:
    """List the laws of foundations, or show one with its constants and graph."""
    from hemivar.cli.laws import list_laws, show_law

    check_outputs({"--plot": plot}, file)
    if name is None and file is None and formula is None:
        if given or friction or reach is not None or plot is not None:
            raise ProblemError("name a law, or give --file or --formula; 'hemivar laws' alone lists the laws")
        list_laws()
    else:
        writer = Writer()
        show_law(name, given or [], file, formula, friction, reach, plot, writer)
        return _ended(writer, _CONVERGED)
    return _CONVERGED


@app.command("methods")
def _methods() -> int:
    """List the methods."""
    from dataclasses import fields, is_dataclass

    from hemivar.solvers import METHODS

    def first_line(thing: Any) -> str:
        return (type(thing).__doc__ or "").strip().split("\n")[0]

    for name, solver in METHODS.items():
        print(f"{name}\n    {first_line(solver)}")
        for option in fields(solver):  # type: ignore[arg-type]
            inner = getattr(solver, option.name)
            if is_dataclass(inner):
                print(f"    {first_line(inner)}")
    print("\nWhere no method is named, newton or multigrid is chosen by predicted cost and memory.")
    return _CONVERGED


# ---- checks before anything is computed ------------------------------------------------------------------


def _check_drawable(stated: ProblemFile, outputs: Mapping[str, Path | None]) -> None:
    """Refuse pictures that this problem has not."""
    if outputs["--plot-contact"] is not None and not stated.problem.contact:
        raise ProblemError(f"{stated.name}: --plot-contact draws contact boundaries, and there is none; take --plot")
    if outputs["--render"] is not None:
        from hemivar.report.scene import check_rendering

        try:
            check_rendering(stated.problem.mesh.dim)
        except ProblemError as error:
            raise ProblemError(f"--render: {error}") from None


def _check_limits(rtol: float | None, max_time: float | None, max_steps: int | None) -> None:
    if rtol is not None and not 0.0 < rtol <= _LARGEST_RTOL:
        raise ProblemError(f"--rtol is {rtol:g}; it must be a positive number, at most {_LARGEST_RTOL:g}")
    if max_time is not None and not max_time > 0.0:
        raise ProblemError(f"--max-time is {max_time:g}; it must be a positive number of seconds")
    if max_steps is not None and not 1 <= max_steps <= _MOST_STEPS:
        raise ProblemError(f"--max-steps is {max_steps}; it must be at least 1 and at most {_MOST_STEPS}")


def _method(name: str) -> Solver:
    from hemivar.solvers import METHODS

    if name not in METHODS:
        raise ProblemError(f"method '{name}' is not known{_suggest(name, list(METHODS))}")
    return METHODS[name]


def _chosen(stated: ProblemFile, discrete: DiscreteProblem, named: Solver | None) -> tuple[Solver, str]:
    """The method of the command line, else of the file, else the one that costs least; why, in the last case."""
    from hemivar.solvers.choice import choose

    if named is not None:
        return named, ""
    if stated.solver.method is not None:
        return _method(stated.solver.method), ""
    return choose(discrete)


def _suggest(name: str, known: Sequence[str]) -> str:
    close = difflib.get_close_matches(name, known, n=1)
    guess = f"; did you mean '{close[0]}'?" if close else ""
    return f"{guess} (known: {', '.join(known)})"


# ---- work ------------------------------------------------------------------------------------------------


def _read(path: Path, outputs: Mapping[str, Path | None], *others: Path) -> tuple[ProblemFile, Writer]:
    """The problem, and a writer that keeps off its files and ``others``; outputs that fall on one are refused."""
    from hemivar.files.problem_file import read_problem_file

    with noting_files_read() as files:
        stated = read_problem_file(path)
    files += others
    keep_off(outputs, files)
    return stated, Writer(files)


def _discretize(stated: ProblemFile, mesh: Mesh | None) -> DiscreteProblem:
    """The discrete problem, on another mesh if one is given; errors name the file."""
    from hemivar.fem import discretize

    try:
        return discretize(stated.problem if mesh is None else stated.problem.on(mesh))
    except ProblemError as error:
        message = str(error)
        if not message.startswith(f"{stated.name}: "):
            table = "[supports] " if "support" in message else ""
            message = f"{stated.name}: {table}{message}"
        raise ProblemError(message) from error


def _controls(
    stated: ProblemFile,
    rtol: float | None,
    max_time: float | None,
    max_steps: int | None,
    callback: Callable[[Progress], bool | None] | None,
) -> Controls:
    """Limits from the command line, else from the file, else the defaults."""
    from hemivar.solvers import Controls

    given = stated.solver
    if rtol is None and given.rtol is not None and given.rtol > _LARGEST_RTOL:
        raise ProblemError(f"{stated.name}: [solver] rtol is {given.rtol:g}; it must be at most {_LARGEST_RTOL:g}")
    chosen: dict[str, Any] = {
        "rtol": rtol if rtol is not None else given.rtol,
        "max_time": max_time if max_time is not None else given.max_time,
        "max_steps": max_steps if max_steps is not None else given.max_steps,
    }
    return Controls(callback=callback, **{key: value for key, value in chosen.items() if value is not None})


def _solve_levels(
    discrete: list[DiscreteProblem], solver: Solver, controls: Controls, trace: _StepPrinter | None
) -> Solution:
    """Solve on every mesh in turn, each solution being the first guess on the next mesh."""
    from dataclasses import replace

    from hemivar.solvers import Status, solve, suited, transfer_solution

    solution: Solution | None = None
    for problem in discrete:
        if trace is not None:
            trace.head(problem if len(discrete) > 1 else None)
        try:
            guess = None if solution is None else transfer_solution(solution, problem)
            solution = solve(problem, suited(solver, problem), controls, initial=guess)
        except KeyboardInterrupt:
            if solution is None:
                raise
            solution = replace(solution, status=Status.INTERRUPTED)  # the finest mesh that there is
        if solution.status in (Status.INTERRUPTED, Status.OUT_OF_MEMORY):
            break
    assert solution is not None
    if solution.status is Status.INTERRUPTED:
        print("\ninterrupted       the best iterate follows; Ctrl-C again leaves its certificate out", flush=True)
    return solution


class _Run:
    """One method in a comparison."""

    columns = ("method", "status", "time (s)", "steps", "evaluations", "residual", "energy", "difference")

    def __init__(self, name: str, status: str, note: str = "", solution: Solution | None = None) -> None:
        self.name = name
        self.status = status
        self.note = note
        self.solution = solution
        self.seconds: float | None = None
        self.difference: float | None = None

    @property
    def row(self) -> tuple[Any, ...]:
        s = self.solution
        if s is None:
            return (self.name, self.status, *[None] * 6)
        return (
            self.name, self.status, self.seconds, s.steps, s.evaluations, s.residual.relative,
            f"{s.energy:.10g}", self.difference,
        )  # fmt: skip


def _run(
    name: str,
    solver: Solver,
    discrete: DiscreteProblem,
    controls: Controls,
    condensed: Any,
    reference: _Run | None,
) -> _Run:
    """Try a method; a refusal or a failure becomes a row of the table."""
    from hemivar.errors import MethodError
    from hemivar.report.tables import energy_norm_difference
    from hemivar.solvers import solve, suited
    from hemivar.systems import Workspace

    try:
        workspace = None if condensed is None else Workspace.holding(condensed)
        solution = solve(discrete, suited(solver, discrete), controls, workspace=workspace)
    except MethodError as error:
        return _Run(name, "refused", str(error))
    except Exception as error:
        reason = " ".join(str(error).split()) or "no message"
        return _Run(name, "failed", f"{type(error).__name__}: {reason}")
    status = solution.status.value
    run = _Run(name, status, "" if status == "converged" else solution.status.remedy, solution)
    run.seconds = sum(value for stage, value in solution.timings.items() if stage != "condense" or condensed is None)
    other = solution if reference is None else reference.solution
    assert other is not None
    run.difference = energy_norm_difference(solution, other)
    return run


# ---- files -----------------------------------------------------------------------------------------------


def _certificate(solution: Solution, controls: Controls, writer: Writer) -> Certificate | None:
    """The certificate; a lack of memory for it is no lack of a solution, and one more complaint."""
    from hemivar.cli.certify import certificate_of

    try:
        return certificate_of(solution, controls.rtol, controls.max_time)
    except (HemivarError, MemoryError) as error:
        reason = "not enough memory" if isinstance(error, MemoryError) else str(error)
        writer.failed.append(f"the solution could not be certified: {reason}")
        return None


def _write(
    writer: Writer,
    solution: Solution,
    stated: ProblemFile,
    outputs: Mapping[str, Path | None],
    certificate: Certificate | None,
) -> None:
    """Write what was asked for, data before pictures, and what may end the process last."""
    title = stated.problem.title.replace("$", r"\$") or None

    def json(path: Path) -> None:
        from hemivar.files.results import write_json

        write_json(solution, path, certificate)

    def vtu(path: Path) -> tuple[Path, Path | None]:
        from hemivar.files.results import write_vtu

        return write_vtu(solution, path)

    def plot(path: Path) -> None:
        from hemivar.report import plot_solution, save

        save(plot_solution(solution, scale="auto", title=title), path)

    def plot_contact(path: Path) -> None:
        from hemivar.report import plot_contact, save

        save(plot_contact(solution, title=title), path)

    def render(path: Path) -> None:
        from hemivar.report.scene import render_solution

        render_solution(solution, path, scale="auto", title=stated.problem.title or None)

    writer.write("--json", outputs["--json"], json)
    writer.write("--vtu", outputs["--vtu"], vtu)
    writer.write("--plot", outputs["--plot"], plot, picture=True)
    writer.write("--plot-contact", outputs["--plot-contact"], plot_contact, picture=True)
    writer.write("--render", outputs["--render"], render, picture=True)


def _write_comparison(
    path: Path, stated: ProblemFile, discrete: DiscreteProblem, runs: list[_Run], reference: _Run | None
) -> None:
    import json

    def plain(value: Any) -> Any:
        return None if isinstance(value, float) and not math.isfinite(value) else value

    keys = ("method", "status", "seconds", "steps", "evaluations", "residual", "energy", "difference")
    records = []
    for run in runs:
        record = dict(zip(keys, (plain(cell) for cell in run.row), strict=True))
        record["energy"] = None if run.solution is None else plain(run.solution.energy)
        records.append({**record, "note": run.note})
    data = {
        "problem": stated.name,
        "title": stated.problem.title,
        "unknowns": discrete.unknowns,
        "contact_points": discrete.contact_points,
        "reference": None if reference is None else reference.name,
        "methods": records,
    }
    write_text(path, json.dumps(data, indent=1, allow_nan=False) + "\n")


# ---- what is printed -------------------------------------------------------------------------------------


def _console() -> Console:
    """A console without colours unless it is a terminal."""
    from rich.console import Console

    return Console(file=sys.stdout, highlight=False, markup=False, emoji=False)


def _print_table(console: Console, table: Table) -> None:
    """Print a table whole, also where it is wider than the terminal."""
    from rich import box

    shown = table.rich()
    shown.box = box.SIMPLE_HEAD
    for column in shown.columns:
        column.no_wrap = True
    whole = console.measure(shown, options=console.options.update(width=10_000)).maximum
    width = console.width
    console.width = max(width, whole)
    console.print(shown, crop=False)
    console.width = width


@contextlib.contextmanager
def _stages(console: Console, count: int) -> Iterator[Callable[[str], None]]:
    """A bar with the stage at work on a terminal; a line for each stage elsewhere."""
    if not console.is_terminal:

        def tell(stage: str) -> None:
            print(stage, flush=True)
            if _unread():
                raise KeyboardInterrupt

        yield tell
        return
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (BarColumn(), TimeElapsedColumn(), TextColumn("{task.description}", markup=False))
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=count)
        begun: list[str] = []

        def say(stage: str) -> None:
            bar.update(task, description=stage, completed=len(begun))
            begun.append(stage)

        yield say


class _StepPrinter:
    """Prints a line for each step of a solve."""

    def head(self, problem: DiscreteProblem | None) -> None:
        """Head of the columns, for each mesh of a warm start with its size."""
        level = ""
        if problem is not None and problem.field is not None:
            level = f"   mesh with h = {problem.field.mesh.size:.3g}, {problem.unknowns} unknowns"
        print(f"\n{'step':>6}  {'residual':>9}  {'energy':>18}  {'changed points':>14}{level}", flush=True)

    def __call__(self, now: Progress) -> bool:
        print(f"{now.step:>6}  {now.residual:>9.2e}  {now.energy:>18.10g}  {now.changed:>14}", flush=True)
        return _unread()


def _unread() -> bool:
    """Whether standard output has failed: nobody follows the work any more, and it ends as by Ctrl-C."""
    return isinstance(sys.stdout, Stream) and sys.stdout.failed is not None


def _print_head(stated: ProblemFile, discrete: DiscreteProblem) -> None:
    mesh = stated.problem.mesh
    kind = "triangles" if mesh.dim == 2 else "tetrahedra"
    order = "" if stated.problem.order == 1 else ", quadratic elements"
    size = f"{mesh.number_of_nodes} nodes, {mesh.number_of_cells} {kind}, h = {mesh.size:.4g}{order}"
    title = "".join(c if c.isprintable() else " " for c in stated.problem.title)
    print(title or shown(stated.name))
    print(f"mesh              {size}")
    print(f"unknowns          {discrete.unknowns}")
    for warning in discrete.warnings:
        print(f"warning           {warning}")
    where = f" on {', '.join(stated.problem.contact)}" if stated.problem.contact else ""
    print(f"contact points    {discrete.contact_points}{where}", flush=True)


def _print_method(solver: Solver, why: str) -> None:
    print(f"method            {solver.name}")
    if why:
        print(f"chosen            {why}", flush=True)


def _print_summary(console: Console, solution: Solution, certificate: Certificate | None) -> None:
    """Print what was found."""
    import numpy as np

    from hemivar.solvers import ContactState, Status

    good = solution.status is Status.CONVERGED
    console.print("\nstatus            ", end="")
    console.print(solution.status.value, style="bold green" if good else "bold red", end="")
    console.print(f" after {solution.steps} steps, relative residual {solution.residual.relative:.1e}")
    stages = ", ".join(f"{stage} {seconds:.3g} s" for stage, seconds in solution.timings.items())
    print(f"time              {stages}")
    print(f"energy            {solution.energy:.10g}")
    if solution.error_bound is not None:
        print(f"error bound       {solution.error_bound:.3g} (energy norm)")
    if not good:
        print(f"what to do        {solution.status.remedy}")
    for line in [] if certificate is None else certificate.lines():
        print(line)
    if solution.problem.contact_points == 0:
        return
    print(f"normal force      {solution.normal_force:.6g}")
    friction = solution.friction_force
    if friction.size == 1:
        print(f"friction force    {friction[0]:.6g}")
    elif friction.size:
        frames = solution.problem.frames
        assert frames is not None
        vector = np.einsum("m,mc,mcd->d", solution.problem.weights, solution.friction, frames[:, 1:])
        print(f"friction force    ({', '.join(f'{c:.6g}' for c in vector)})")
    what = "length" if solution.problem.dim == 2 else "area"
    total = float(solution.problem.weights.sum())
    print(f"contact {what:<10}{solution.contact_length:.6g} of {total:.6g}")
    counts = [f"{int(np.sum(solution.state == state))} {state.label}" for state in ContactState]
    print(f"contact points    {', '.join(counts)}")
    print(f"max penetration   {solution.penetration.max():.6g}")
    print(f"max pressure      {solution.pressure.max():.6g}")


def _exit_code(solution: Solution) -> int:
    from hemivar.solvers import Status

    if solution.status is Status.CONVERGED:
        return _CONVERGED
    if solution.status is Status.INTERRUPTED:
        return _INTERRUPTED
    sys.stdout.flush()
    sys.stderr.write(
        f"hemivar: not converged: {solution.status.value} after {solution.steps} steps, relative residual "
        f"{solution.residual.relative:.1e}: {solution.status.remedy}\n"
    )
    return _NOT_CONVERGED
