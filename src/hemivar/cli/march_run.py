"""A march of a problem file: its options, what it writes, how it ends."""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hemivar.basics.arguments import suggest
from hemivar.basics.disk import protecting
from hemivar.cli.march_view import Bar, MarchView, code_of, print_history
from hemivar.cli.options import Given, MaxTime, Resume, Rtol, StepLength, Tolerance, Until, check_limits
from hemivar.cli.outputs import Writer, check_outputs
from hemivar.cli.printing import print_head
from hemivar.cli.session import Session, naming_file
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.evolution import History, March
    from hemivar.evolution.discrete import DiscreteEvolution
    from hemivar.files.film import Film
    from hemivar.files.problem_file import ProblemFile
    from hemivar.files.series import Series
    from hemivar.solvers import Controls, Solver

__all__ = ["MarchOptions", "MarchRun", "check_tools", "stated_outputs", "write_film"]

#: Signals within so many seconds count as one.
_COALESCE = 2.0


@dataclass(frozen=True)
class MarchOptions:
    """Options of the command that go before the file; None where that holds."""

    until: Until = None
    step: StepLength = None
    adaptive: Tolerance = None
    scheme: Annotated[str | None, typer.Option(metavar="NAME", help="implicit-euler, generalized-alpha ...")] = None
    every: Annotated[float | None, typer.Option(metavar="T", help="Time between frames (200 frames at most).")] = None
    minutes: Annotated[float | None, typer.Option(metavar="X", help="Least time between checkpoints (10).")] = None
    resume: Resume = False
    jump: Annotated[
        str | None, typer.Option(metavar="NAME", help="Where a step may have several solutions: local, stop ...")
    ] = None
    rtol: Rtol = None
    max_time: MaxTime = None
    given: Given = None

    def check(self) -> None:
        """Refuse options that make no sense, whatever the file says.

        Raises
        ------
        ProblemError
        """
        from hemivar.evolution import SCHEMES, SelectionRule

        check_limits(self.rtol, self.max_time)
        for option, value in (("--step", self.step), ("--adaptive", self.adaptive), ("--every", self.every)):
            if value is not None and not 0.0 < value < math.inf:
                raise ProblemError(f"{option} is {value:g}; it must be a positive number")
        if self.until is not None and not math.isfinite(self.until):
            raise ProblemError(f"--until is {self.until:g}; it must be a finite time")
        if self.minutes is not None and not 0.0 <= self.minutes < math.inf:
            raise ProblemError(f"--minutes is {self.minutes:g}; it must be a number >= 0")
        jumps = [kind.value for kind in SelectionRule]
        for option, name, known in (("--scheme", self.scheme, list(SCHEMES)), ("--jump", self.jump, jumps)):
            if name is not None and name not in known:
                raise ProblemError(f"{option} {name}: it is not known{suggest(name, known)}")

    def plan(
        self, stated: ProblemFile, checkpoint: Path | None, controls: Controls, solver: Solver | None = None
    ) -> March:
        """How the evolution of a file is computed with these options.

        Raises
        ------
        ProblemError
            There is no checkpoint whose writing could wait, or to go on from.
        """
        from hemivar.evolution import SCHEMES, AdaptiveStep, Checkpoint
        from hemivar.workflows import plan_of

        if checkpoint is None and self.minutes is not None:
            raise ProblemError("--minutes goes with a checkpoint; name it by --checkpoint FILE")
        if checkpoint is None and self.resume:
            raise ProblemError("--resume needs a checkpoint; name it by --checkpoint FILE, or in the table [output]")
        kept = None if stated.time is None else stated.time.march.checkpoint
        minutes = kept.minutes if self.minutes is None and isinstance(kept, Checkpoint) else self.minutes
        given = {
            "until": self.until,
            "step": self.step if self.adaptive is None else AdaptiveStep(self.adaptive, first_step=self.step),
            "scheme": None if self.scheme is None else SCHEMES[self.scheme],
            "jump": self.jump,
            "max_time": self.max_time,
            "method": solver,
        }
        return plan_of(
            stated,
            every=self.every,
            checkpoint=checkpoint if checkpoint is None or minutes is None else Checkpoint(checkpoint, minutes),
            resume=self.resume,
            controls=controls,
            **{name: value for name, value in given.items() if value is not None},
        )


def stated_outputs(stated: ProblemFile, given: Mapping[str, Path | None]) -> dict[str, Path | None]:
    """Files to write by option, ``--checkpoint`` among them: those given, else those of the table ``[output]``."""
    from hemivar.evolution import Checkpoint

    found = dict(given)
    kept = None if stated.time is None else stated.time.march.checkpoint
    for option, name in (
        ("--fields", stated.output.fields),
        ("--table", stated.output.table),
        ("--animation", stated.output.animation),
        ("--checkpoint", kept.file if isinstance(kept, Checkpoint) else None),
    ):
        if found.get(option) is None and name is not None:
            found[option] = Path(name)
    return found


def check_tools(outputs: Mapping[str, Path | None]) -> None:
    """Refuse formats for which something is not installed.

    Raises
    ------
    ProblemError
    """
    if (table := outputs.get("--table")) is not None:
        from hemivar.files.history_table import check_table

        check_table(table)
    if (film := outputs.get("--animation")) is not None:
        from hemivar.report.animation import check_film

        check_film(film)


class MarchRun:
    """A march of a problem file: what it writes, and how it is shown.

    Parameters
    ----------
    path : Path
        The problem file.
    outputs : mapping of option to Path or None
        What will be written.
    checkpoint : Path or None
    options : MarchOptions
    own : bool
        Whether the table ``[output]`` of the file names files where ``outputs`` does not.

    Raises
    ------
    ProblemError
    """

    def __init__(
        self,
        path: Path,
        outputs: Mapping[str, Path | None],
        checkpoint: Path | None,
        options: MarchOptions,
        *,
        own: bool = True,
    ) -> None:
        options.check()
        given = {**outputs, "--checkpoint": checkpoint}
        self.session = Session(path, given, rtol=options.rtol, given=options.given)
        self.outputs = stated_outputs(self.session.stated, given) if own else given
        check_outputs(self.outputs, path)
        check_tools(self.outputs)
        self.plan = options.plan(
            self.session.stated, self.outputs["--checkpoint"], self.session.controls, self.session.method
        )
        self.found: History | None = None

    def march(self, quiet: bool, *, write: bool = True) -> int:
        """March, and write what was asked for."""
        from hemivar.workflows import evolution_of, result_of
        from hemivar.workflows import march as work

        session, writer = self.session, self.session.writer
        view = MarchView(
            lambda discrete: print_head(session.stated, discrete.problem), self._series, writer.failed, quiet
        )
        with view, _ends_after_the_step() as asked, protecting(writer.inputs):
            try:
                found = result_of(
                    work(evolution_of(session.stated), self.plan), lambda event: view(event) or bool(asked)
                )
            except ProblemError as error:
                raise naming_file(error, session.stated.name) from error
        self.found = found
        print_history(found)
        if found.unkept:
            writer.failed.append(f"--checkpoint: {found.unkept}")
        if write:
            self._write(found, view.series, quiet)
            writer.tell()
        code = code_of(found, session.stated.name)
        return writer.ended(code) if write else code

    def _series(self, discrete: DiscreteEvolution) -> Series | None:
        """What writes frames while they come."""
        fields = self.outputs.get("--fields")
        if fields is None or fields.suffix.lower() != ".pvd":
            return None
        from hemivar.files.series import Series

        return Series(fields, discrete)

    def _write(self, found: History, series: Series | None, quiet: bool) -> None:
        from hemivar.files.history_table import write_history_json

        writer, outputs = self.session.writer, self.outputs

        def fields(path: Path) -> tuple[Path, ...]:
            from hemivar.files.series import numbered

            return found.write(path) if series is None else series.finish(numbered(found))

        units = self.session.stated.units

        def plot(path: Path) -> None:
            from hemivar.report import plot_march
            from hemivar.report.saving import save

            save(plot_march(found, "ledger", title=self.session.title, units=units), path)

        writer.write("--table", outputs["--table"], found.write)
        writer.write("--json", outputs["--json"], lambda path: write_history_json(found, path, units.record()))
        writer.write("--fields", outputs["--fields"], fields)
        writer.write("--plot", outputs["--plot"], plot, picture=True)
        write_film(
            writer,
            "--animation",
            outputs["--animation"],
            found,
            quiet,
            title=self.session.title,
            unit=units.length,
            time_unit=units.time,
        )


def write_film(
    writer: Writer, option: str, path: Path | None, film: Film | History, quiet: bool, **options: Any
) -> None:
    """Write a film, with a bar on a terminal."""

    def draw(file: Path) -> None:
        from hemivar.report.animation import animate

        with Bar(quiet, "frame") as bar:
            animate(film, file, progress=lambda now, count: bar.show(now / count, f"{now} of {count}"), **options)

    writer.write(option, path, draw, picture=True)


@contextlib.contextmanager
def _ends_after_the_step() -> Iterator[list[int]]:
    """Ctrl-C, SIGTERM and SIGHUP are noted in the list; Ctrl-C again, some seconds later, ends the step as well."""
    asked: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield asked
        return
    last = -math.inf

    def note(number: int, _: object) -> None:
        nonlocal last
        now = time.monotonic()
        if asked and now - last > _COALESCE and number == signal.SIGINT:
            raise KeyboardInterrupt
        if not asked:
            asked.append(number)
            last = now

    before = {}
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            before[number] = signal.signal(number, note)
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
