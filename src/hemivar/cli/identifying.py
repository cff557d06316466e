"""``hemivar identify``: the parameters of a contact law from a measured curve."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.basics.disk import shown
from hemivar.cli.options import Csv, Exit, Given, Json, Latex, MaxTime, ProblemPath, Rtol, Seed, Starts, check_limits
from hemivar.cli.outputs import one_line
from hemivar.cli.printing import StageView, console, print_table
from hemivar.cli.session import Session
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.basics.types import Array
    from hemivar.identification import Fit, Parameter

__all__ = ["identify"]

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*(?P<key>.+?)\s*=\s*(?P<low>{_NUMBER})\s*:\s*(?P<high>{_NUMBER})\s*")


def identify(
    problem: ProblemPath,
    data: Annotated[
        Path,
        typer.Option(
            metavar="CURVE.csv", help="The measured curve: a head with keys of the file and quantities, and rows."
        ),
    ],
    law: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="Fit every number of this normal law, around its value in the file."),
    ] = None,
    contact: Annotated[str | None, typer.Option(metavar="NAME", help="The contact boundary of --law.")] = None,
    fitted: Annotated[
        list[str] | None, typer.Option("--fit", metavar="KEY=LOW:HIGH", help="A key of the file to fit, and its range.")
    ] = None,
    given: Given = None,
    noise: Annotated[
        float | None, typer.Option(metavar="X", help="Standard deviation, relative to the largest value (estimated).")
    ] = None,
    confidence: Annotated[float, typer.Option(metavar="X", help="Confidence of the intervals.")] = 0.95,
    starts: Starts = 6,
    seed: Seed = 0,
    rtol: Rtol = None,
    max_time: MaxTime = None,
    csv: Csv = None,
    latex: Latex = None,
    json: Json = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw data, fit and intervals (.png, .svg or .pdf).")
    ] = None,
) -> int:
    """Find the parameters of a contact law from a measured curve, with intervals and what the curve leaves open.

    Exit code 1 if a parameter is not identifiable.
    """
    from hemivar.files.changes import read_change
    from hemivar.identification import FitOptions
    from hemivar.report.identification_figure import fit_table
    from hemivar.workflows import result_of
    from hemivar.workflows.identification import identifying, parameters_of_law

    check_limits(rtol, max_time)
    options = FitOptions(starts, seed, confidence, noise)
    outputs = {"--csv": csv, "--latex": latex, "--json": json, "--plot": plot}
    wanted = [_read(text) for text in fitted or ()]
    if law is None and not wanted:
        raise ProblemError("identify: say what to fit, by --law NAME or by --fit KEY=LOW:HIGH, once for each parameter")
    changes = [read_change(text) for text in given or ()]
    session = Session(problem, outputs, rtol, max_time, given=given, solution=data)
    if law is not None:
        named = {one.key for one in wanted} | {one.key for one in changes}  # what is set stays as it is set
        wanted = [*(one for one in parameters_of_law(problem, law, contact) if one.key not in named), *wanted]
    terminal = console()
    stated, writer = session.stated, session.writer
    print(one_line(stated.problem.title) or shown(stated.name))
    print(f"fit               {', '.join(f'{one.key} ({one.low:.4g} to {one.high:.4g})' for one in wanted)}")
    with StageView(terminal) as view:
        work = identifying(problem, data, wanted, options, changes=changes, controls=session.controls)
        found = result_of(work, view)
    print_table(terminal, fit_table(found), keys=1)
    print(f"misfit            {found.misfit:.2%} of the largest measured value, {found.measurements.count} rows")
    print(
        f"intervals         {found.confidence:.0%}, noise {found.noise:.2%}" + (" (estimated)" if noise is None else "")
    )
    for message in found.messages:
        print(f"note              {message}")
    writer.write("--csv", csv, fit_table(found).write_csv)
    writer.write("--latex", latex, fit_table(found, stated.problem.title).write_latex)
    writer.write_record(json, _record(found))

    def draw(file: Path) -> None:
        from hemivar.report.identification_figure import plot_fit
        from hemivar.report.saving import save

        save(plot_fit(found, title=session.title), file)

    writer.write("--plot", plot, draw, picture=True)
    writer.tell()
    return writer.ended(Exit.CONVERGED if all(found.identified) else Exit.NOT_CONVERGED)


def _read(text: str) -> Parameter:
    from hemivar.identification import Parameter

    found = _RANGE.fullmatch(text)
    if found is None:
        raise ProblemError(f"--fit {text}: give KEY=LOW:HIGH, as in contact.bottom.normal.strength=0.5:5")
    return Parameter(found["key"], float(found["low"]), float(found["high"]))


def _record(found: Fit) -> dict[str, object]:
    """All numbers of a fit, null where one is infinite or not known."""

    def numbers(values: Array) -> object:
        return _plain(values.tolist())

    return {
        "parameters": {
            one.key: {
                "value": float(found.values[place]), "interval": numbers(found.intervals[place]),
                "standard_error": numbers(found.standard_errors[place]), "certified": numbers(found.certified[place]),
                "identified": found.identified[place], "range": [one.low, one.high],
            }
            for place, one in enumerate(found.parameters)
        },
        "confidence": found.confidence, "noise": found.noise, "misfit": found.misfit,
        "singular_values": numbers(found.singular_values), "directions": numbers(found.directions),
        "inputs": {key: numbers(values) for key, values in found.measurements.inputs.items()},
        "measured": {key: numbers(values) for key, values in found.measurements.measured.items()},
        "predicted": dict(zip(found.measurements.measured, map(numbers, found.predicted.T), strict=True)),
        "messages": list(found.messages),
    }  # fmt: skip


def _plain(value: object) -> object:
    """Lists of numbers, null where one is not finite."""
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return value if isinstance(value, float) and math.isfinite(value) else None
