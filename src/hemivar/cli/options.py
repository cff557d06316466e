"""Options that several commands share, and the checks of what they say."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import fields
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, get_type_hints

import typer

from hemivar.basics.arguments import suggest
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.files.problem_file import ProblemFile
    from hemivar.solvers import Controls, Progress, Solver

__all__ = [
    "ENGINES",
    "MOST_JOBS",
    "MOST_STEPS",
    "Checkpoint",
    "Colour",
    "Csv",
    "EngineName",
    "Exact",
    "Exit",
    "Given",
    "Jobs",
    "Json",
    "Latex",
    "MaxSolutions",
    "MaxSteps",
    "MaxTime",
    "MethodName",
    "ProblemPath",
    "Quiet",
    "Resume",
    "Rtol",
    "Seed",
    "Starts",
    "StepLength",
    "Tolerance",
    "UnitNames",
    "Until",
    "check_colour",
    "check_engine",
    "check_limits",
    "check_load_factors",
    "controls_of",
    "each_field_an_option",
    "method_named",
]

_LARGEST_RTOL = 1e-2
_LARGEST_FACTOR = 1e100
#: Most processes that can be asked for.
MOST_JOBS = 256
#: Most steps and points that can be asked for.
MOST_STEPS = 10**9

ProblemPath = Annotated[Path, typer.Argument(metavar="PROBLEM.toml", help="The problem file.")]
Rtol = Annotated[
    float | None,
    typer.Option("--rtol", metavar="X", help="Tolerance of the residual, relative to the load (1e-9, certify 1e-8)."),
]
Tolerance = Annotated[
    float | None,
    typer.Option("--adaptive", metavar="X", help="Adapt the mesh or the time step to this relative error."),
]
MaxTime = Annotated[
    float | None, typer.Option("--max-time", metavar="S", help="Time limit of each stage, method or point, in seconds.")
]
MaxSteps = Annotated[
    int | None, typer.Option("--max-steps", metavar="N", help="Limit of iterations (set by the method).")
]
MethodName = Annotated[
    str | None, typer.Option("--method", metavar="NAME", help="Method, see 'hemivar methods' (by predicted cost).")
]
Exact = Annotated[bool | None, typer.Option("--exact/--no-exact", help="Bound the distance to the exact solution.")]
Checkpoint = Annotated[
    Path | None, typer.Option("--checkpoint", metavar="FILE", help="Checkpoint file; study and sweep continue from it.")
]
Resume = Annotated[bool, typer.Option("--resume", help="Continue from the checkpoint, if it exists.")]
Jobs = Annotated[
    int, typer.Option("--jobs", metavar="N", min=1, max=MOST_JOBS, help="Number of processes that work at once.")
]
Json = Annotated[Path | None, typer.Option("--json", metavar="FILE.json", help="Write the results as JSON.")]
Csv = Annotated[Path | None, typer.Option("--csv", metavar="FILE.csv", help="Write the table as CSV.")]
Latex = Annotated[Path | None, typer.Option("--latex", metavar="FILE.tex", help="Write the table for LaTeX.")]
Starts = Annotated[int, typer.Option("--starts", metavar="N", min=0, max=1_000_000, help="Random starts of each kind.")]
MaxSolutions = Annotated[
    int, typer.Option("--max-solutions", metavar="N", min=1, help="Stop the search after this many solutions.")
]
Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Seed of the random starts.")]
Until = Annotated[float | None, typer.Option("--until", metavar="T", help="End of the time interval.")]
StepLength = Annotated[
    float | None, typer.Option("--step", metavar="T", help="Time step; the first one if steps are adapted.")
]
UnitNames = Annotated[
    str | None,
    typer.Option("--units", metavar="T,L,F,S,E", help="Units for the labels: of time, length, force, stress, energy."),
]
Given = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Set a value of the file, as in contact.bottom.gap=0.1."),
]
Colour = Annotated[
    str | None,
    typer.Option("--colour", metavar="NAME", help="Colour of the body: stress, displacement, speed (film) or none."),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print the predicted cost of the methods as well.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only the summary.")]
#: Engines by the names of ``--engine``.
ENGINES = ("scipy", "petsc")
EngineName = Annotated[
    str, typer.Option("--engine", metavar="NAME", help="'scipy', or 'petsc' for all ranks of mpirun.")
]


class Exit(IntEnum):
    """Exit codes of the command."""

    CONVERGED = 0
    NOT_CONVERGED = 1
    BAD_INPUT = 2
    INTERNAL = 70
    INTERRUPTED = 130


def each_field_an_option(command: Callable[..., int]) -> Callable[..., int]:
    """The command, whose argument ``options``, a dataclass of options, becomes an option for each of its fields."""
    signature = inspect.signature(command, eval_str=True)
    kind = signature.parameters["options"].annotation
    hints = get_type_hints(kind, include_extras=True)
    own = [
        inspect.Parameter(one.name, inspect.Parameter.KEYWORD_ONLY, default=one.default, annotation=hints[one.name])
        for one in fields(kind)
    ]
    others = [one.replace(kind=inspect.Parameter.KEYWORD_ONLY) for one in signature.parameters.values()]

    @functools.wraps(command)
    def spread(**arguments: object) -> int:
        return command(options=kind(**{one.name: arguments.pop(one.name) for one in own}), **arguments)

    spread.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[new for one in others for new in (own if one.name == "options" else (one,))]
    )
    return spread


def check_engine(name: str) -> None:
    """Refuse an engine that there is not."""
    if name not in ENGINES:
        raise ProblemError(f"--engine {name}: it is not known{suggest(name, ENGINES)}")


def check_colour(name: str | None, pictures: Mapping[str, object]) -> None:
    """Refuse a colouring that there is not, or that no picture shows."""
    if name is None:
        return
    from hemivar.report import BodyColour

    if name not in [*BodyColour]:
        raise ProblemError(f"--colour {name}: it is not known{suggest(name, [*BodyColour])}")
    if not any(pictures.values()):
        raise ProblemError(f"--colour goes with {' or '.join(pictures)}; give one of them, or leave it out")


def check_limits(rtol: float | None = None, max_time: float | None = None, max_steps: int | None = None) -> None:
    """Refuse limits that make no sense."""
    if rtol is not None and not 0.0 < rtol <= _LARGEST_RTOL:
        raise ProblemError(f"--rtol is {rtol:g}; it must be a positive number, at most {_LARGEST_RTOL:g}")
    if max_time is not None and not max_time > 0.0:
        raise ProblemError(f"--max-time is {max_time:g}; it must be a positive number of seconds")
    if max_steps is not None and not 1 <= max_steps <= MOST_STEPS:
        raise ProblemError(f"--max-steps is {max_steps}; it must be at least 1 and at most {MOST_STEPS}")


def check_load_factors(*factors: float) -> None:
    """Refuse factors of the load that make no sense."""
    for factor in factors:
        if not abs(factor) <= _LARGEST_FACTOR:
            raise ProblemError(f"--load-factor is {factor:g}; its size must be at most {_LARGEST_FACTOR:g}")


def controls_of(
    stated: ProblemFile,
    rtol: float | None = None,
    max_time: float | None = None,
    max_steps: int | None = None,
    callback: Callable[[Progress], bool | None] | None = None,
) -> Controls:
    """Limits from the command line, else from the file, else the defaults."""
    from hemivar.solvers import Controls

    given, standard = stated.solver, Controls()
    if rtol is None and given.rtol is not None and given.rtol > _LARGEST_RTOL:
        raise ProblemError(f"{stated.name}: [solver] rtol is {given.rtol:g}; it must be at most {_LARGEST_RTOL:g}")
    rtol = given.rtol if rtol is None else rtol
    max_time = given.max_time if max_time is None else max_time
    return Controls(
        rtol=standard.rtol if rtol is None else rtol,
        max_time=standard.max_time if max_time is None else max_time,
        max_steps=given.max_steps if max_steps is None else max_steps,
        callback=callback,
    )


def method_named(name: str) -> Solver:
    """The method of a name, see :func:`hemivar.solvers.method_named`."""
    from hemivar.solvers import method_named as named

    return named(name)
