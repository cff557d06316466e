"""``hemivar march``, time integration: its options, what it writes, how it ends."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from hemivar.basics.arguments import suggest
from hemivar.basics.disk import make_folder, protecting
from hemivar.basics.first_use import cached_property
from hemivar.cli import options as opt
from hemivar.cli.command import Done, OnProblem
from hemivar.cli.engine import Engine, engine_named
from hemivar.cli.march_view import MarchView, code_of
from hemivar.cli.options import ENGINES, check_limits, option, written
from hemivar.cli.outputs import Files, check_outputs
from hemivar.cli.printing import Bar, console, print_claims
from hemivar.cli.session import Session, naming_file, print_head
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hemivar.evolution import History, March
    from hemivar.evolution.discrete import DiscreteEvolution
    from hemivar.files.film import Film
    from hemivar.files.problem_file import ProblemFile
    from hemivar.files.series import Series
    from hemivar.solvers import Controls, Solver

__all__ = ["MarchCommand", "MarchOptions", "check_tools", "film_of", "stated_outputs"]


@dataclass(frozen=True)
class MarchOptions:
    """Options of the command that go before the file; None where that holds."""

    until: opt.Until = None
    step: opt.StepLength = None
    adaptive: opt.Tolerance = None
    scheme: opt.SchemeName = None
    every: Annotated[float | None, option("Time between frames (200 frames at most).", of="T")] = None
    minutes: Annotated[float | None, option("Least time between checkpoints (10).", of="X")] = None
    resume: opt.Resume = False
    jump: Annotated[str | None, option("Where a step may have several solutions: local, stop ...", of="NAME")] = None
    control: Annotated[str | None, option("Finds the load: dissipation, opening:BOUNDARY.", of="NAME")] = None
    rtol: opt.Rtol = None
    max_time: opt.MaxTime = None
    given: opt.Given = None

    def check(self) -> None:
        """Refuse options that make no sense, whatever the file says."""
        from hemivar.evolution.jumps import SelectionRule
        from hemivar.evolution.schemes.by_name import SCHEMES

        check_limits(self.rtol, self.max_time)
        for name, value in (("--step", self.step), ("--adaptive", self.adaptive), ("--every", self.every)):
            if value is not None and not 0.0 < value < math.inf:
                raise ProblemError(f"{name} is {value:g}; it must be a positive number")
        if self.until is not None and not math.isfinite(self.until):
            raise ProblemError(f"--until is {self.until:g}; it must be a finite time")
        if self.minutes is not None and not 0.0 <= self.minutes < math.inf:
            raise ProblemError(f"--minutes is {self.minutes:g}; it must be a number >= 0")
        jumps = [kind.value for kind in SelectionRule]
        for name, given, known in (("--scheme", self.scheme, list(SCHEMES)), ("--jump", self.jump, jumps)):
            if given is not None and given not in known:
                raise ProblemError(f"{name} {given}: it is not known{suggest(given, known)}")

    @property
    def _control(self) -> str | dict[str, str] | None:
        """The control as :class:`hemivar.evolution.March` has it."""
        kind, colon, boundary = (self.control or "").partition(":")
        return {kind: boundary} if colon else self.control

    def plan(
        self, stated: ProblemFile, checkpoint: Path | None, controls: Controls, solver: Solver | None = None
    ) -> March:
        """How the evolution of a file is computed with these options."""
        from hemivar.evolution import AdaptiveStep, Checkpoint
        from hemivar.evolution.schemes.by_name import SCHEMES
        from hemivar.workflows.marching import plan_of

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
            "control": self._control,
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

    outputs = dict(given)
    kept = None if stated.time is None else stated.time.march.checkpoint
    for what, name in (
        ("--fields", stated.output.fields),
        ("--table", stated.output.table),
        ("--animation", stated.output.animation),
        ("--checkpoint", kept.file if isinstance(kept, Checkpoint) else None),
    ):
        if outputs.get(what) is None and name is not None:
            outputs[what] = Path(name)
    return outputs


def check_tools(outputs: Mapping[str, Path | None]) -> None:
    """Refuse formats for which something is not installed."""
    if (table := outputs.get("--table")) is not None:
        from hemivar.files.history_table import check_table

        check_table(table)
    if (film := outputs.get("--animation")) is not None:
        from hemivar.report.animation import check_film

        check_film(film)


class MarchCommand(MarchOptions, OnProblem):
    """Integrate a problem in time, with a uniqueness margin per step and an energy balance.

    Options override what the file says of time and output. Exit code 0 if the end of the time interval is
    reached. Ctrl-C ends the run after the current step, with everything written.
    """

    output: Annotated[
        Path | None,
        option("Write NAME.pvd, NAME.csv and NAME.ckpt in a folder.", "--output", "-o", of="DIR/NAME"),
    ] = None
    fields: Annotated[opt.File, written("Write the frames (.pvd), for ParaView.")] = None
    table: Annotated[opt.File, written("Write the table (.csv or .parquet).")] = None
    json: opt.Json = None
    plot: Annotated[opt.File, written("Draw the energy balance (.png, .svg or .pdf).")] = None
    animation: Annotated[opt.File, written("Write a film (.gif or .mp4).")] = None
    checkpoint: opt.Checkpoint = None
    quiet: opt.Quiet = False
    engine: opt.EngineName = ENGINES[0]

    @cached_property
    def backend(self) -> Engine:
        """The engine that is asked for."""
        return engine_named(self.engine, "--fields")

    def check(self) -> None:
        super().check()
        if self.output is not None and self.output.parent != Path():
            make_folder(self.output.parent)

    @cached_property
    def named(self) -> dict[str, Path | None]:
        """The files to write that the command line names."""
        own = self.output
        given = {"--fields": self.fields, "--table": self.table, "--json": self.json, "--plot": self.plot}
        given |= {"--animation": self.animation, "--checkpoint": self.checkpoint}
        if own is not None:
            for name, suffix in (("--fields", ".pvd"), ("--table", ".csv"), ("--checkpoint", ".ckpt")):
                given[name] = given[name] or own.parent / f"{own.name}{suffix}"
        return given

    @cached_property
    def outputs(self) -> dict[str, Path | None]:
        """The files to write, those that the problem file names among them."""
        return stated_outputs(self.session.stated, self.named)

    @cached_property
    def session(self) -> Session:
        """The problem file, read."""
        return Session(
            self.problem, self.named, rtol=self.rtol, given=self.given, engine=self.backend, code=self.allow_code
        )

    def work(self) -> Done:
        history, series = self.march()
        return Done(self._files(history, series), last=partial(code_of, history, self.session.stated.name))

    def march(self) -> tuple[History, Series | None]:
        """March; returns what was found, and what wrote frames while they came."""
        from hemivar.report.summary import Summary
        from hemivar.workflows import result_of
        from hemivar.workflows.marching import evolution_of

        session, writer, backend = self.session, self.writer, self.backend
        evolution, plan = backend.agree(lambda: (evolution_of(session.stated), self._planned()))
        view = MarchView(
            lambda discrete: print_head(session, discrete.problem), self._series, writer.failed, self.quiet
        )
        with view, backend.asked_to_end() as asked, protecting(writer.inputs):
            try:
                history = result_of(backend.marching(evolution, plan), lambda event: view(event) or asked())
            except backend.refusals as error:
                raise naming_file(error, session.stated.name) from error
        print_claims(console(), Summary.of(history.claims()).lines(), history.ended, history.finished)
        if history.unkept:
            writer.failed.append(f"--checkpoint: {history.unkept}")
        return history, view.series

    def _planned(self) -> March:
        """How it is computed, once its files could be written, those that the problem file names among them."""
        outputs, session, serial = self.outputs, self.session, self.engine == ENGINES[0]
        if not serial and outputs["--animation"] is not None and outputs["--fields"] is None:
            raise ProblemError(
                "--animation: the engine 'petsc' makes a film of its frames; write --fields run.pvd as well"
            )
        check_outputs(outputs, self.problem)
        check_tools(outputs)
        method = session.method if serial else None
        return self.plan(session.stated, outputs.get("--checkpoint"), session.controls, method)

    def _series(self, discrete: DiscreteEvolution) -> Series | None:
        """What writes frames while they come."""
        fields = self.outputs.get("--fields")
        return None if fields is None else self.backend.series(fields, discrete)

    def _files(self, history: History, series: Series | None) -> Files:
        from hemivar.files.history_table import write_history_json

        units, title = self.session.stated.units, self.session.title

        def fields(path: Path) -> tuple[Path, ...]:
            from hemivar.files.series import numbered

            return (series or self.backend.series(path, history.discrete)).finish(numbered(history))

        def plot() -> Figure:
            from hemivar.report import plot_march

            return plot_march(history, "ledger", title=title, units=units)

        return {
            "--table": history.write,
            "--json": lambda path: write_history_json(history, path, units.record()),
            "--fields": fields,
            "--plot": plot,
            "--animation": film_of(
                partial(self.backend.film, history, self.outputs["--fields"]),
                self.quiet,
                title=title,
                unit=units.length,
                time_unit=units.time,
            ),
        }


def film_of(film: Callable[[], Film | History], quiet: bool, **options: Any) -> Callable[[Path], None]:
    """What writes a film, with a bar on a terminal."""

    def draw(file: Path) -> None:
        from hemivar.report.animation import animate

        with Bar(quiet) as bar:

            def show(now: int, count: int) -> None:
                bar.show(f"frame {now} of {count}", now / count)

            animate(film(), file, progress=show, **options)

    return draw
