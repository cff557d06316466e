"""``hemivar march --engine petsc``: the command run by every rank of ``mpirun``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.disk import noting_files_read, protecting
from hemivar.cli.end_on_ranks import all_or_none
from hemivar.cli.march_run import MarchOptions, check_tools, film_of, stated_outputs
from hemivar.cli.march_view import MarchView, code_of, print_history
from hemivar.cli.on_ranks import end_of_all, named, print_head_on_ranks, stated_on_ranks
from hemivar.cli.options import Exit, controls_of
from hemivar.cli.outputs import Writer, check_outputs, files_of, keep_off
from hemivar.engines.petsc.time_limit import TimeLimit
from hemivar.errors import HemivarError, ProblemError
from hemivar.files.history_table import write_history_json
from hemivar.report.on_ranks import SeriesOnRanks

if TYPE_CHECKING:
    from hemivar.engines.petsc import Piece, Ranks
    from hemivar.evolution import Evolution, History, March
    from hemivar.evolution.discrete import DiscreteEvolution
    from hemivar.files.problem_file import ProblemFile
    from hemivar.files.series import Series
    from hemivar.mesh.mesh import Mesh

__all__ = ["march_file_on_ranks"]


def march_file_on_ranks(
    path: Path, given: Mapping[str, Path | None], options: MarchOptions, quiet: bool, begin: Callable[[], None]
) -> int:
    """March a problem file on all ranks; returns the exit code.

    Parameters
    ----------
    path : Path
    given : mapping of option to Path or None
        Files of the command line: ``--fields``, ``--table``, ``--json``, ``--plot``, ``--animation``, ``--checkpoint``.
    options : MarchOptions
    quiet : bool
        Whether no step is printed.
    begin : function
        Looks at what can be looked at before work begins.
    """
    from hemivar.engines.petsc import world

    ranks = world()
    limit = TimeLimit()
    with all_or_none(ranks), limit.listening():
        ranks.agree(begin)
        ranks.agree(lambda: _check(given, path))
        with noting_files_read() as read:
            stated, pieces = stated_on_ranks(path, ranks, options.given or ())
        inputs = [path, *read]
        outputs = ranks.agree(lambda: _checked(stated_outputs(stated, given), path, inputs))
        plan, base = ranks.agree(lambda: _planned(stated, options, outputs))
        run = _Run(ranks, pieces, stated, outputs, Writer(inputs), quiet)
        with protecting(inputs):
            return run.march(base, plan, limit)


class _Run:
    """A march over ranks, each of which has one of these: what it writes, and how rank 0 shows it."""

    def __init__(
        self,
        ranks: Ranks,
        pieces: list[Piece],
        stated: ProblemFile,
        outputs: Mapping[str, Path | None],
        writer: Writer,
        quiet: bool,
    ) -> None:
        self.ranks, self.pieces, self.stated = ranks, tuple(pieces), stated
        self.outputs, self.writer, self.quiet = outputs, writer, quiet
        self.first = ranks.rank == 0

    def march(self, base: Evolution, plan: March, limit: TimeLimit) -> int:
        """March, write what was asked for, and return the exit code."""
        from hemivar.engines.petsc import prepare_march
        from hemivar.workflows import march as work
        from hemivar.workflows import result_of

        alarm = limit.limited(plan.max_time)

        def state(mesh: Mesh) -> Evolution:
            return replace(base, problem=base.problem.on(mesh))

        view = MarchView(self._head, self._series, self.writer.failed, self.quiet or not self.first, plain=True)
        try:
            ready = prepare_march(self.ranks, self.pieces, state, plan, alarm)
            with view, np.errstate(all="ignore"):
                events = work(ready.discrete, ready.plan, ready.tools)
                history = result_of(events, lambda event: bool(view(event) or alarm.due()))
        except HemivarError as refused:
            raise named(refused, self.stated.name) from None
        return self._ended(history, view.series)

    def _head(self, discrete: DiscreteEvolution) -> None:
        from hemivar.engines.petsc.evolution import EvolutionOnRanks

        assert isinstance(discrete, EvolutionOnRanks)
        if self.first:
            print_head_on_ranks(self.stated, discrete.body, len(self.pieces))

    def _series(self, discrete: DiscreteEvolution) -> Series | None:
        from hemivar.engines.petsc.evolution import EvolutionOnRanks

        assert isinstance(discrete, EvolutionOnRanks)
        fields = self.outputs["--fields"]
        return None if fields is None else SeriesOnRanks(fields, discrete)

    def _ended(self, history: History, series: Series | None) -> int:
        """Write the table on rank 0 and the last frames on all, say how it ended."""
        writer, outputs = self.writer, self.outputs
        if self.first:
            print_history(history, plain=True)
            if history.unkept:
                writer.failed.append(f"--checkpoint: {history.unkept}")
            writer.write("--table", outputs["--table"], history.write)
            units = self.stated.units.record()
            writer.write("--json", outputs["--json"], lambda path: write_history_json(history, path, units))
        if outputs["--fields"] is not None:
            self._last_frames(outputs["--fields"], history, series)
        code: Exit = Exit.NOT_CONVERGED
        if self.first:
            writer.write("--plot", outputs["--plot"], lambda file: self._plot(history, file), picture=True)
            self._film()
            writer.tell()
            code = Exit(writer.ended(code_of(history, self.stated.name)))
        return end_of_all(self.ranks, code)

    def _last_frames(self, path: Path, history: History, series: Series | None) -> None:
        """The frames that are not written yet, by all ranks; a failure is that of all of them."""
        from hemivar.files.series import numbered

        try:
            if series is None:
                discrete = history.discrete
                series = self._series(discrete)
                assert series is not None
            self.writer.written += series.finish(numbered(history))
        except HemivarError as error:
            if not getattr(error, "shared", False):
                raise
            self.writer.failed.append(f"--fields: {error}")

    def _plot(self, history: History, file: Path) -> None:
        from hemivar.report.saving import save

        save(history.plot("ledger", title=self._title), file)

    def _film(self) -> None:
        """The film of the frames that were written."""
        from hemivar.files import read_film

        fields, target = self.outputs["--fields"], self.outputs["--animation"]
        if fields is None or target is None or fields not in self.writer.written:
            return
        self.writer.take("--animation", target, film_of(read_film(fields), True, title=self._title))

    @property
    def _title(self) -> str | None:
        """As :attr:`hemivar.cli.session.Session.title`."""
        return self.stated.problem.title.replace("$", r"\$") or None


def _planned(stated: ProblemFile, options: MarchOptions, outputs: Mapping[str, Path | None]) -> tuple[March, Evolution]:
    """How the evolution is computed, and what it is."""
    from hemivar.workflows import evolution_of

    return options.plan(stated, outputs["--checkpoint"], controls_of(stated, options.rtol)), evolution_of(stated)


def _checked(outputs: dict[str, Path | None], path: Path, inputs: list[Path]) -> dict[str, Path | None]:
    """The files to write, those that the problem file names among them."""
    _check(outputs, path)
    keep_off(files_of(outputs), inputs)
    return outputs


def _check(outputs: Mapping[str, Path | None], path: Path) -> None:
    """Refuse files that could not be written."""
    fields = outputs["--fields"]
    if outputs["--animation"] is not None and fields is None:
        raise ProblemError("--animation: the engine 'petsc' makes a film of its frames; write --fields run.pvd as well")
    check_outputs(outputs, path)
    check_tools(outputs)
