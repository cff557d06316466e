"""``hemivar identify``: the parameters of a contact law from a measured curve."""

from __future__ import annotations

import math
import re
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from hemivar.basics.first_use import cached_property
from hemivar.cli import options as opt
from hemivar.cli.command import Done, OnProblem, watched
from hemivar.cli.options import check_limits, option, written
from hemivar.cli.outputs import Files
from hemivar.cli.printing import console, print_table, print_title
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.basics.types import Array
    from hemivar.identification import Fit, FitOptions, Parameter

__all__ = ["IdentifyCommand"]

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*(?P<key>.+?)\s*=\s*(?P<low>{_NUMBER})\s*:\s*(?P<high>{_NUMBER})\s*")


class IdentifyCommand(OnProblem):
    """Find the parameters of a contact law from a measured curve, with intervals and what the curve leaves open.

    Exit code 1 if a parameter is not identifiable.
    """

    data: Annotated[
        Path, option("The measured curve: a head with keys of the file and quantities, and rows.", of="CURVE.csv")
    ]
    law: Annotated[
        str | None, option("Fit every number of this normal law, around its value in the file.", of="NAME")
    ] = None
    contact: Annotated[str | None, option("The contact boundary of --law.", of="NAME")] = None
    fitted: Annotated[
        list[str] | None, option("A key of the file to fit, and its range.", "--fit", of="KEY=LOW:HIGH")
    ] = None
    given: opt.Given = None
    noise: Annotated[float | None, option("Standard deviation, relative to the largest value (estimated).", of="X")] = (
        None
    )
    confidence: Annotated[float, option("Confidence of the intervals.", of="X")] = 0.95
    starts: opt.Starts = 6
    seed: opt.Seed = 0
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None
    csv: opt.Csv = None
    latex: opt.Latex = None
    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw data, fit and intervals (.png, .svg or .pdf).")] = None

    @property
    def read(self) -> Path:
        return self.data

    @cached_property
    def options(self) -> FitOptions:
        """How to fit."""
        from hemivar.identification import FitOptions

        return FitOptions(self.starts, self.seed, self.confidence, self.noise)

    @cached_property
    def ranges(self) -> list[Parameter]:
        """What ``--fit`` names."""
        return [_read(text) for text in self.fitted or ()]

    def check(self) -> None:
        check_limits(self.rtol, self.max_time)
        _ = self.options
        if not self.ranges and self.law is None:
            raise ProblemError(
                "identify: say what to fit, by --law NAME or by --fit KEY=LOW:HIGH, once for each parameter"
            )

    def work(self) -> Done:
        from hemivar.files.changes import read_change
        from hemivar.report.identification_figure import fit_table, plot_fit
        from hemivar.workflows.identification import identifying, parameters_of_law

        changes, wanted, session = [read_change(text) for text in self.given or ()], self.ranges, self.session
        if self.law is not None:
            named = {one.key for one in wanted} | {one.key for one in changes}  # what is set stays as it is set
            of_law = parameters_of_law(self.problem, self.law, self.contact)
            wanted = [*(one for one in of_law if one.key not in named), *wanted]
        print_title(session.stated)
        print(f"fit               {', '.join(f'{one.key} ({one.low:.4g} to {one.high:.4g})' for one in wanted)}")
        work = identifying(self.problem, self.data, wanted, self.options, changes=changes, controls=session.controls)
        found = watched(work)
        print_table(console(), fit_table(found), keys=1)
        print(f"misfit            {found.misfit:.2%} of the largest measured value, {found.measurements.count} rows")
        estimated = " (estimated)" if self.noise is None else ""
        print(f"intervals         {found.confidence:.0%}, noise {found.noise:.2%}{estimated}")
        for message in found.messages:
            print(f"note              {message}")
        files: Files = {
            "--csv": fit_table(found).write_csv,
            "--latex": fit_table(found, session.stated.problem.title).write_latex,
            "--json": _record(found),
            "--plot": partial(plot_fit, found, title=session.title),
        }
        return Done(files, all(found.identified))


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
