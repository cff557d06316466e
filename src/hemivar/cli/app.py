"""The command ``hemivar``: a thin skin over the library.

Everything but the command line itself is imported inside the commands, so that ``hemivar --help`` is quick.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from hemivar import __version__
from hemivar.cli.aside import DoctorCommand, MethodsCommand, NewCommand, StudioCommand
from hemivar.cli.command import Command, function_of
from hemivar.cli.comparison import CertifyCommand, CompareCommand, SurveyCommand
from hemivar.cli.equilibria import BracketCommand, PathCommand, SolutionsCommand
from hemivar.cli.identifying import IdentifyCommand
from hemivar.cli.law_study import LawsCommand, MaterialsCommand
from hemivar.cli.march_results import AnimateCommand, HistoryCommand
from hemivar.cli.march_run import MarchCommand
from hemivar.cli.options import Exit
from hemivar.cli.outputs import internal_error, one_line
from hemivar.cli.solving import SolveCommand
from hemivar.cli.study import StudyCommand, SweepCommand
from hemivar.cli.terminal import Stream, guarded_streams, quiet_warnings, signals_as_interrupts
from hemivar.errors import HemivarError

__all__ = ["COMMANDS", "app", "main"]

app = typer.Typer(
    name="hemivar",
    help="Solve contact problems of elastic bodies with foundations given by superpotentials.",
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
        gone = _REMOVED.get(str(getattr(error, "option_name", "")))
        if gone is not None:
            return _complain(gone)
        if hasattr(error, "format_message"):
            usage = error.format_message()
            usage = usage.rstrip(".") + (" " if usage.endswith("?") else "; ")
            return _complain(f"{usage}see 'hemivar --help'")
        return _complain(internal_error(error), Exit.INTERNAL)
    if code == Exit.INTERRUPTED:
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


def _complain(message: str, code: int = Exit.BAD_INPUT) -> int:
    sys.stdout.flush()
    sys.stderr.write(f"hemivar: error: {one_line(message)}\n")
    return code


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"hemivar {__version__}")
        raise typer.Exit


#: Options that there were, and what to use.
_REMOVED = {"--render": "--render was removed; draw a body in 3D by --plot, or write --vtu for ParaView"}

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
    """Solve contact problems of elastic bodies with foundations given by superpotentials."""
    if context.invoked_subcommand is None:
        print(_FIRST.format(version=__version__))


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
