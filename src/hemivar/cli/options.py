"""Options that several commands share, and the checks of what they say."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from typer.models import OptionInfo

from hemivar.basics.arguments import suggest
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.files.problem_file import ProblemFile
    from hemivar.mechanics import ContactProblem
    from hemivar.solvers import Controls, Progress, Solver

__all__ = [
    "ENGINES",
    "MOST_JOBS",
    "MOST_STEPS",
    "WRITTEN",
    "AllowCode",
    "Checkpoint",
    "Colour",
    "Columns",
    "Constant",
    "Csv",
    "EngineName",
    "Exact",
    "Exit",
    "File",
    "Given",
    "Jobs",
    "Json",
    "Known",
    "Latex",
    "MaxSolutions",
    "MaxSteps",
    "MaxTime",
    "MethodName",
    "ProblemPath",
    "Quiet",
    "Refine",
    "Resume",
    "Rtol",
    "SchemeName",
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
    "columns_of",
    "controls_of",
    "method_named",
    "option",
    "written",
]

#: A residual of a hundredth of the load is no solution: forces are off by as much.
_LARGEST_RTOL = 1e-2
#: Squares of loads up to this one are below the largest number, 1.8e308.
_LARGEST_FACTOR = 1e100
#: Most processes that can be asked for.
MOST_JOBS = 256
#: Most steps and points that can be asked for.
MOST_STEPS = 10**9


def option(
    says: str, *names: str, of: str | None = None, least: float | None = None, most: float | None = None
) -> OptionInfo:
    """An option by its help and the form of its value; its name is that of the field if none is given."""
    made: OptionInfo = typer.Option(*names, metavar=of, help=says, min=least, max=most)
    return made


def written(says: str, of: str = "FILE") -> OptionInfo:
    """The option of a file that is written."""
    return option(says, of=of)


#: What tells that an option names a file to write.
WRITTEN = "written"
File = Annotated[Path | None, WRITTEN]
ProblemPath = Annotated[Path, typer.Argument(metavar="PROBLEM.toml", help="The problem file.")]
Refine = Annotated[int, option("Number of halvings of the mesh, or of the step.", of="N")]
Known = Annotated[
    list[str] | None,
    option("Known solution in x and y (steps: t), once for each component (the finest).", of="FORMULA"),
]
Rtol = Annotated[float | None, option("Tolerance of the residual, relative to the load (1e-9, certify 1e-8).", of="X")]
Tolerance = Annotated[
    float | None, option("Adapt the mesh or the time step to this relative error.", "--adaptive", of="X")
]
MaxTime = Annotated[float | None, option("Time limit of each stage, method or point, in seconds.", of="S")]
MaxSteps = Annotated[int | None, option("Limit of iterations (set by the method).", of="N")]
MethodName = Annotated[str | None, option("Method, see 'hemivar methods' (by predicted cost).", of="NAME")]
Exact = Annotated[bool | None, option("Bound the distance to the exact solution.", "--exact/--no-exact")]
Checkpoint = Annotated[File, written("Checkpoint file; study and sweep continue from it.")]
Resume = Annotated[bool, option("Continue from the checkpoint, if it exists.", "--resume")]
Jobs = Annotated[int, option("Number of processes that work at once.", of="N", least=1, most=MOST_JOBS)]
Json = Annotated[File, written("Write the results as JSON.", "FILE.json")]
Columns = Annotated[
    str | None,
    option("Columns, numbers of each solution: max-pressure,max-stress,support.bolt.force ...", of="A,B,..."),
]
Csv = Annotated[File, written("Write the table as CSV.", "FILE.csv")]
Latex = Annotated[File, written("Write the table for LaTeX.", "FILE.tex")]
Starts = Annotated[int, option("Random starts of each kind.", of="N", least=0, most=1_000_000)]
MaxSolutions = Annotated[int, option("Stop the search after this many solutions.", of="N", least=1)]
Seed = Annotated[int, option("Seed of the random starts.", of="N", least=0)]
Until = Annotated[float | None, option("End of the time interval.", of="T")]
StepLength = Annotated[float | None, option("Time step; the first one if steps are adapted.", "--step", of="T")]
SchemeName = Annotated[str | None, option("implicit-euler, generalized-alpha ...", of="NAME")]
UnitNames = Annotated[
    str | None, option("Units for the labels: of time, length, force, stress, energy.", of="T,L,F,S,E")
]
AllowCode = Annotated[
    list[str] | None,
    option("Allow laws of this module or file, which the problem file names as module:Class.", of="MODULE"),
]
Given = Annotated[
    list[str] | None, option("Set a value of the file, as in contact.bottom.gap=0.1.", "--set", of="KEY=VALUE")
]
Constant = Annotated[
    list[str] | None, option("A load that does not grow: body, or a boundary with a traction.", of="NAME")
]
Colour = Annotated[str | None, option("Colour of the body: stress, displacement, speed (film) or none.", of="NAME")]
Verbose = Annotated[bool, option("Print the predicted cost of the methods as well.", "--verbose", "-v")]
Quiet = Annotated[bool, option("Print only the summary.", "--quiet", "-q")]
#: Engines by the names of ``--engine``.
ENGINES = ("scipy", "petsc")
EngineName = Annotated[str, option("'scipy', or 'petsc' for all ranks of mpirun.", of="NAME")]


class Exit(IntEnum):
    """Exit codes of the command."""

    CONVERGED = 0
    NOT_CONVERGED = 1
    BAD_INPUT = 2
    INTERNAL = 70
    INTERRUPTED = 130


def check_engine(name: str) -> None:
    """Refuse an engine that there is not."""
    if name not in ENGINES:
        raise ProblemError(f"--engine {name}: it is not known{suggest(name, ENGINES)}")


def check_colour(name: str | None, pictures: Mapping[str, object]) -> None:
    """Refuse a colouring that there is not, or that no picture shows."""
    if name is None:
        return
    from hemivar.report.deformed import BodyColour

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
    """The method of a name, see :func:`hemivar.solvers.methods.method_named`."""
    from hemivar.solvers.methods import method_named as named

    return named(name)


def columns_of(names: str | None, problem: ContactProblem) -> tuple[str, ...]:
    """The numbers of ``--columns``, which the problem has."""
    from hemivar.solvers.numbers_by_name import check_quantity

    return tuple(check_quantity(name.strip(), problem) for name in names.split(",")) if names else ()
