"""``hemivar solve --adaptive``: meshes refined until the error is known to be small."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hemivar.basics.rounding import rounded_up
from hemivar.cli.options import Exit, controls_of, method_named
from hemivar.cli.printing import console, print_head, print_summary, unread
from hemivar.cli.session import Session, naming_file
from hemivar.cli.solving import check_drawable, draw
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.adapt import AdaptiveSolution
    from hemivar.certificates import Certificate
    from hemivar.workflows import AdaptOptions, AdaptResult, Event

__all__ = ["AdaptRun", "AdaptView"]

_GIB = 2.0**30
#: Parts of the whole that are rounding.
_ROUNDING = 1e-12


class AdaptView:
    """Shows an adaptive solve: a row for each mesh, unless ``quiet``."""

    def __init__(self, quiet: bool = False) -> None:
        self.quiet = quiet

    def __call__(self, event: Event) -> bool:
        """Show an event; returns whether to stop."""
        from hemivar.workflows import Refined

        if not isinstance(event, Refined) or self.quiet:
            return False
        level = event.level
        distance, goal = level.distance, level.goal
        if event.number == 0:
            head = (
                f"\n{'mesh':>6}  {'unknowns':>9}  {'error':>9}  {'misfit':>9}  {'contact':>9}  {'loads':>9}  {'c':>6}"
            )
            more = "" if goal is None else f"  {'interval':>9}  {'estimate':>9}"
            print(f"{head}{more}  {'seconds':>8}", flush=True)
        parts = (distance.parts.misfit, distance.parts.contact, distance.parts.oscillation)
        shares = "".join(f"  {_percent(distance.over_norm(part)):>9}" for part in parts)
        bound = ("" if distance.guaranteed else "~") + _percent(distance.relative)
        more = "" if goal is None else f"  {_percent(goal.relative):>9}  {'~' + _percent(goal.estimated):>9}"
        line = f"{event.number + 1:>6}  {level.unknowns:>9}  {bound:>9}{shares}  {distance.constant:>6.3g}"
        print(f"{line}{more}  {level.seconds:>8.3g}", flush=True)
        return unread()


class AdaptRun:
    """An adaptive solve of a problem file: its options, and what it writes.

    Parameters
    ----------
    path : Path
        The problem file.
    outputs : mapping of option to Path or None
    method : str or None
    asked : mapping
        ``adaptive`` (the tolerance), ``rtol``, ``goal``,
        ``max_unknowns``, ``max_time``, ``max_memory`` (GiB), ``max_steps``, ``given`` (of
        ``--set``), ``colour``; None where not given.

    Raises
    ------
    ProblemError
    """

    def __init__(
        self, path: Path, outputs: Mapping[str, Path | None], method: str | None, asked: Mapping[str, Any]
    ) -> None:
        _check(asked)
        self.colour: str | None = asked.get("colour")
        named = None if method is None else method_named(method)
        self.session = session = Session(
            path, outputs, asked["rtol"], asked["max_time"], asked["max_steps"], given=asked.get("given")
        )
        stated = session.stated
        check_drawable(stated, outputs["--plot-contact"])
        from hemivar.workflows import AdaptOptions

        if stated.problem.kind:
            raise ProblemError(
                f"{stated.name}: --adaptive is for elastic bodies, and this is a scalar problem; leave it out"
            )
        self.problem = stated.problem
        most = asked["max_memory"]
        given: dict[str, Any] = {name: asked[name] for name in ("goal", "max_unknowns", "max_time")}
        given["rtol"] = asked["adaptive"]
        given["max_memory"] = None if most is None else most * _GIB
        given["method"] = named or session.method
        self.options: AdaptOptions = AdaptOptions(
            **{name: value for name, value in given.items() if value is not None},
            controls=controls_of(stated, asked["rtol"], max_steps=asked["max_steps"]),
        )

    def solve(self, quiet: bool) -> int:
        """Solve, print and write what was asked for."""
        from hemivar.workflows import adapt, result_of

        session, writer = self.session, self.session.writer
        print_head(session.stated, session.discrete())
        try:
            result = result_of(adapt(self.problem, self.options), AdaptView(quiet))
        except ProblemError as error:
            raise naming_file(error, session.stated.name) from error
        found = result.adaptive
        try:
            if result.complaint and not result.interrupted:
                writer.failed.append(f"the solution could not be certified: {result.complaint}")
            self._print(result)
        finally:
            self._write(found, result.certificate)
            writer.tell()
            writer.complain()
        return self._ended(result)

    def _print(self, result: AdaptResult) -> None:
        """What was found on the last mesh, and how it ended."""
        found = result.adaptive
        print_summary(console(), found.solution, result.certificate, self.session.stated.units)
        if result.certificate is None:
            from hemivar.certificates.continuous.exact_certificate import statement_of

            print("\n".join(statement_of(found.distance).lines()))
        if found.goal is not None:
            label = "goal"
            for line in found.goal.lines():
                print(f"{label:<18}{line}")
                label = ""
            for reason in found.goal.reasons:
                print(f"{'':<18}because {reason}")
        order = f", bound of order {found.rate:.2g} in the unknowns" if math.isfinite(found.rate) else ""
        print(f"adaptive          {found.ended} after {len(found.levels)} meshes{order}")
        print(f"{'':<18}{found.remedy}", flush=True)

    def _write(self, found: AdaptiveSolution, certificate: Certificate | None) -> None:
        """Write what was asked for, data before pictures."""
        from hemivar.files import write_json, write_vtu
        from hemivar.report import adaptive_table, plot_adaptive, plot_meshes, save

        session, writer, outputs = self.session, self.session.writer, self.session.outputs
        more = {"adaptive": found.record()}
        title = session.title
        writer.write("--csv", outputs["--csv"], lambda path: adaptive_table(found).write_csv(path))
        writer.write("--json", outputs["--json"], lambda path: write_json(found.solution, path, certificate, more))
        cells = {"indicator": found.levels[-1].indicator}
        writer.write("--vtu", outputs["--vtu"], lambda path: write_vtu(found.solution, path, cells))
        figures = {"--plot-error": plot_adaptive, "--plot-meshes": plot_meshes}
        for option, figure in figures.items():
            writer.write(
                option,
                outputs[option],
                lambda path, figure=figure: save(figure(found, title=title, certificate=certificate), path),  # type: ignore[misc]
                picture=True,
            )
        draw(session, found.solution, certificate, self.colour)

    def _ended(self, result: AdaptResult) -> int:
        """The exit code; says on standard error what was not reached."""
        from hemivar.adapt import AdaptiveEnd

        writer, found = self.session.writer, result.adaptive
        if result.interrupted:
            return writer.ended(Exit.INTERRUPTED)
        if found.ended in (AdaptiveEnd.REACHED, AdaptiveEnd.ESTIMATED):
            return writer.ended(Exit.CONVERGED)
        sys.stdout.flush()
        last = found.levels[-1]
        what = "distance" if last.goal is None else last.goal.goal.name
        size = f"{what} within {_percent(last.relative)}" if math.isfinite(last.relative) else f"{what} not bounded"
        sys.stderr.write(
            f"hemivar: not reached: {found.ended} with {last.unknowns} unknowns, {size}, asked for "
            f"{_percent(found.rtol)}: {found.remedy}\n"
        )
        return writer.ended(Exit.NOT_CONVERGED)


def _check(asked: Mapping[str, Any]) -> None:
    """Refuse options that make no sense, whatever the file says."""
    tolerance = asked["adaptive"]
    if not 0.0 < tolerance < 1.0:
        raise ProblemError(f"--adaptive is {tolerance:g}; it must be a positive number below 1, such as 0.02")
    for option, value, unit in (
        ("--max-unknowns", asked["max_unknowns"], "whole number"),
        ("--max-memory", asked["max_memory"], "number of GiB"),
    ):
        if value is not None and not value > 0:
            raise ProblemError(f"{option} is {value:g}; it must be a positive {unit}")


def _percent(ratio: float) -> str:
    if not math.isfinite(ratio):
        return "-"
    return f"{rounded_up(100.0 * ratio) if ratio > _ROUNDING else '0'} %"
