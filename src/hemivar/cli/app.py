"""The command ``hemivar``: a thin skin over the library; its table, and the commands beside the work.

Everything but the command line itself is imported inside the commands, so that ``hemivar --help`` is quick.
"""

from __future__ import annotations

import itertools
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from hemivar import __version__
from hemivar.basics.disk import shown, write_text
from hemivar.basics.user_code import stands_at
from hemivar.cli import options as opt
from hemivar.cli.command import Command, Done, function_of
from hemivar.cli.comparison import CertifyCommand, CompareCommand, SurveyCommand
from hemivar.cli.equilibria import BracketCommand, PathCommand, SolutionsCommand
from hemivar.cli.law_study import LawsCommand, MaterialsCommand
from hemivar.cli.march_results import AnimateCommand, HistoryCommand
from hemivar.cli.march_run import MarchCommand
from hemivar.cli.options import Exit, option
from hemivar.cli.outputs import check_outputs, internal_error, one_line
from hemivar.cli.solving import SolveCommand
from hemivar.cli.study import IdentifyCommand, StepsCommand, StudyCommand, SweepCommand
from hemivar.cli.terminal import Stream, guarded_streams, interrupted, quiet_warnings, signals_as_interrupts
from hemivar.errors import HemivarError, ProblemError

__all__ = ["COMMANDS", "app", "main"]

app = typer.Typer(
    name="hemivar",
    help="Solve contact problems of elastic bodies whose contact laws derive from superpotentials.",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit codes: 0 converged, 1 not converged, 2 bad input or a file that cannot be written, 130 interrupted.",
)


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
            code = complaint if code == Exit.CONVERGED else code
        if code == Exit.INTERRUPTED:
            _leave(code)
        return int(code)


def _guarded(arguments: list[str] | None, out: Stream) -> int:
    """Run the command; whatever it raises becomes an exit code and one line."""
    try:
        _refuse_spelt_numbers(sys.argv[1:] if arguments is None else arguments)
        result = app(args=arguments, prog_name="hemivar", standalone_mode=False)
        code = result if isinstance(result, int) else Exit.CONVERGED
    except HemivarError as error:
        return _complain(str(error))
    except (KeyboardInterrupt, typer.Abort):
        code = Exit.INTERRUPTED
    except typer.Exit as stop:
        code = stop.exit_code
    except MemoryError:
        return _complain("not enough memory for this problem; take --method multigrid, or fewer cells")
    except OSError as error:
        return _complain(f"{error.filename or 'a file'}: {error.strerror or error}; check path and disk")
    except Exception as error:
        if isinstance(error, ImportError) and interrupted():
            sys.stderr.write("hemivar: interrupted\n")
            return Exit.INTERRUPTED
        gone = _REMOVED.get(str(getattr(error, "option_name", "")))
        if gone is not None:
            return _complain(gone)
        if hasattr(error, "format_message"):
            usage = error.format_message()
            usage = usage.rstrip(".") + (" " if usage.endswith("?") else "; ")
            return _complain(f"{usage}see 'hemivar --help'")
        if line := stands_at(error):
            return _complain(f"{line}: {type(error).__name__}: {error}; correct this code")
        return _complain(internal_error(error), Exit.INTERNAL)
    if code == Exit.INTERRUPTED:
        why = ": standard output is no longer read" if out.reader_left else ""
        sys.stderr.write(f"hemivar: interrupted{why}\n")
    return code


def _refuse_spelt_numbers(arguments: Sequence[str]) -> None:
    """Refuse values of options that Python alone takes for numbers: 1_5 for 15."""
    for name, following in itertools.pairwise([*arguments, ""]):
        option, given, value = name.partition("=")
        value = value if given else following
        if option.startswith("--") and re.fullmatch(r"[+-]?[0-9][0-9_.]*_[0-9_.]*(?:[eE][+-]?[0-9_]+)?", value):
            raise ProblemError(f"{option} is '{value}', which is not a number; write it in decimal digits")


def _leave(code: int) -> None:
    """End the process at once if a factorisation that was interrupted still runs; otherwise do nothing."""
    superlu = sys.modules.get("hemivar.linear.superlu")
    if superlu is not None and superlu.abandoned_work():
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _complain(message: str, code: int = Exit.BAD_INPUT) -> int:
    sys.stdout.flush()
    sys.stderr.write(f"hemivar: error: {one_line(message)}\n")
    return code


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"hemivar {__version__}")
        raise typer.Exit


#: Options that there were, and what to use.
_REMOVED = {"--render": "--render was removed; use --plot to draw a body in 3D, or --vtu for ParaView"}

_FIRST = """hemivar {version}: contact problems of elastic bodies, solved and certified.

  hemivar new problem.toml                  a commented problem to begin with
  hemivar solve problem.toml --plot a.png   solve it and draw it
  hemivar certify problem.toml              is it unique, and how exact

All commands: hemivar --help.  What is installed: hemivar doctor."""


@app.callback(invoke_without_command=True)
def _root(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Solve contact problems of elastic bodies whose contact laws derive from superpotentials."""
    if context.invoked_subcommand is None:
        print(_FIRST.format(version=__version__))


class NewCommand(Command):
    """Write a problem file that solves as it is."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="The file to write.")] = Path("problem.toml")
    force: Annotated[bool, option("Overwrite the file if it exists.", "--force")] = False
    kind: Annotated[
        str, option("Example to begin with; see 'hemivar new --template list'.", "--template", of="NAME")
    ] = "sample"

    def work(self) -> Done:
        from hemivar.files.sample import TEMPLATES, template

        if self.kind == "list":
            for name, what in TEMPLATES.items():
                print(f"{name:<14}{what}")
            return Done()
        file, text = self.file, template(self.kind)
        if file.exists() and not file.is_dir() and not self.force:
            raise ProblemError(f"{file}: the file exists; name another one, or overwrite it with --force")
        check_outputs({"FILE": file})
        write_text(file, text.replace("FILE", shown(file), 1))
        command = "march" if "\n[time]" in text else "solve"
        print(f"written           {shown(file)}\nnow try           hemivar {command} {shown(file)} --plot figure.png")
        return Done()


class MethodsCommand(Command):
    """List the methods."""

    def work(self) -> Done:
        from dataclasses import fields, is_dataclass

        from hemivar.solvers import METHODS

        def first_line(thing: object) -> str:
            return (type(thing).__doc__ or "").strip().split("\n")[0]

        for name, solver in METHODS.items():
            print(f"{name}\n    {first_line(solver)}")
            for option_field in fields(solver):  # type: ignore[arg-type]
                inner = getattr(solver, option_field.name)
                if is_dataclass(inner):
                    print(f"    {first_line(inner)}")
        print("\nWhere no method is named, newton or multigrid is chosen by predicted cost and memory.")
        return Done()


class DoctorCommand(Command):
    """Show versions, optional parts, threads, and what is missing for what."""

    quick: Annotated[bool, option("Give each optional package 5 s, not 30.", "--quick")] = False

    def work(self) -> Done:
        from hemivar.basics.memory import size_in_words
        from hemivar.workflows import Phase, diagnose, result_of

        def show(event: Phase) -> None:
            if sys.stderr.isatty():
                sys.stderr.write(f"\r\x1b[K{event.name} ...")
                sys.stderr.flush()

        diagnosis = result_of(diagnose(limit=5.0 if self.quick else 30.0), show)
        if sys.stderr.isatty():
            sys.stderr.write("\r\x1b[K")
        memory = "" if diagnosis.memory is None else f", {size_in_words(diagnosis.memory)} of memory free"
        cores = f"{diagnosis.cores} core{'s' if diagnosis.cores != 1 else ''}"
        print(f"hemivar           {diagnosis.version}")
        print(f"Python            {diagnosis.python}")
        print(f"machine           {diagnosis.system}, {cores}{memory}")
        if diagnosis.kernels is None:
            print("kernels           pyamg, 1 thread (no compiler at installation, or HEMIVAR_KERNELS=none)")
        else:
            print(f"kernels           compiled, {diagnosis.kernels} thread{'s' if diagnosis.kernels != 1 else ''}")
        for library, count in diagnosis.threads:
            print(f"linear algebra    {library}, {count} thread{'s' if count != 1 else ''}")
        if diagnosis.seconds is not None:
            print(f"small problem     solved and certified in {diagnosis.seconds:.2g} s")
        print("\nneeded")
        for part in diagnosis.required:
            print(f"  {part.name:<16}{part.version or 'missing'}{_trouble(part.broken)}")
        print("\noptional")
        for part in diagnosis.optional:
            state = part.version or "not there"
            print(f"  {part.name:<16}{state}{_trouble(part.broken)}\n{'':18}for {part.serves}")
            if part.remedy:
                print(f"{'':18}{part.remedy}")
        if diagnosis.remarks:
            print("\nto do")
            for remark in diagnosis.remarks:
                print(f"  {remark}")
        else:
            print("\nnothing to do")
        return Done(reached=diagnosis.sound)


def _trouble(broken: str | None) -> str:
    return f"  (broken: {broken})" if broken else ""


class StudioCommand(Command):
    """Show a problem in the browser: sliders, laws, solutions, load path and certificate.

    The page is for this machine only. Ctrl-C ends it. Nothing is written to the problem file.
    """

    problem: Annotated[
        Path | None, typer.Argument(metavar="[PROBLEM.toml]", help="The problem file; an example if left out.")
    ] = None
    template: Annotated[str, option("Example to begin with; see 'hemivar new --template list'.", of="NAME")] = "survey"
    port: Annotated[int, option("Port; 0 takes a free one.", of="N", least=0, most=65535)] = 0
    token: Annotated[str | None, option("Secret part of the address; random if left out.", of="TEXT")] = None
    browser: Annotated[bool, option("Open the page in the browser.", "--browser/--no-browser")] = True
    allow_code: opt.AllowCode = None

    def work(self) -> Done:
        import webbrowser
        from dataclasses import replace

        from hemivar.files.problem_file import read_text
        from hemivar.files.sample import template
        from hemivar.studio.web_server import StudioPage, bind, refuse_missing, serve

        refuse_missing()
        if self.problem is None:
            text, folder, name = template(self.template), Path(), f"{self.template}.toml"
        else:
            text, folder, name = read_text(self.problem), self.problem.parent, self.problem.name
        page = StudioPage(text, folder, name, code=tuple(self.allow_code or ()))
        page = page if self.token is None else replace(page, token=self.token)
        with bind(self.port) as listening:
            page = replace(page, port=listening.getsockname()[1])

            def ready() -> None:
                print(f"studio            {page.address}\nend it with       Ctrl-C")
                sys.stdout.flush()
                if self.browser:
                    webbrowser.open_new_tab(page.address)

            serve(page, listening, ready)
        return Done()


COMMANDS: dict[str, type[Command]] = {
    "solve": SolveCommand,
    "certify": CertifyCommand,
    "solutions": SolutionsCommand,
    "path": PathCommand,
    "bracket": BracketCommand,
    "march": MarchCommand,
    "history": HistoryCommand,
    "animate": AnimateCommand,
    "compare": CompareCommand,
    "study": StudyCommand,
    "steps": StepsCommand,
    "sweep": SweepCommand,
    "identify": IdentifyCommand,
    "survey": SurveyCommand,
    "new": NewCommand,
    "laws": LawsCommand,
    "materials": MaterialsCommand,
    "methods": MethodsCommand,
    "doctor": DoctorCommand,
    "studio": StudioCommand,
}
for _name, _kind in COMMANDS.items():
    app.command(_name)(function_of(_kind))
