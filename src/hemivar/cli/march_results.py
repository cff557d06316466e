"""``hemivar history`` and ``hemivar animate``: the table of a march, and its film."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.basics.arguments import suggest
from hemivar.basics.first_use import cached_property
from hemivar.basics.units import Units
from hemivar.cli import options as opt
from hemivar.cli.command import Command, Done
from hemivar.cli.march_run import MarchCommand, MarchOptions, film_of
from hemivar.cli.march_view import code_of
from hemivar.cli.options import Exit, option, written
from hemivar.cli.outputs import Writer
from hemivar.cli.printing import console, print_table
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.basics.types import Array
    from hemivar.evolution import History
    from hemivar.files.film import Film

__all__ = ["AnimateCommand", "HistoryCommand"]


class HistoryCommand(Command):
    """List the columns of the table of a march, or draw it."""

    table: Annotated[Path, typer.Argument(metavar="TABLE.csv", help="The table written by 'hemivar march --table'.")]
    plot: Annotated[opt.File, written("Draw the table (.png, .svg or .pdf).")] = None
    kind: Annotated[
        str | None, option("Kind of figure: ledger (energy balance), forces, loop, steps or columns.", of="NAME")
    ] = None
    columns: Annotated[str | None, option("Columns to draw or to list.", of="A,B,...")] = None
    units: opt.UnitNames = None

    @property
    def read(self) -> Path:
        return self.table

    @property
    def _figure(self) -> str:
        return self.kind or ("ledger" if self.columns is None else "columns")

    @property
    def _chosen(self) -> list[str]:
        return [] if self.columns is None else [name.strip() for name in self.columns.split(",")]

    def check(self) -> None:
        from hemivar.report.march_figures import MARCH_FIGURES

        _units(self.units)
        kind, known = self._figure, [name for name in MARCH_FIGURES if name != "map"]
        if kind not in known:
            raise ProblemError(f"--kind {kind}: it is not known{suggest(kind, known)}")
        if self.columns is not None and kind not in ("columns", "loop"):
            raise ProblemError(f"--columns goes with --kind columns or loop; the figure '{kind}' has its own columns")

    def work(self) -> Done:
        from hemivar.files.history_table import read_history_table
        from hemivar.report.march_figures import plot_march

        columns = read_history_table(self.table)
        for name in self._chosen:
            if name not in columns:
                raise ProblemError(f"--columns {name}: the table has no such column{suggest(name, list(columns))}")
        if self.plot is None:
            _list_columns(columns, self._chosen or list(columns))
        kind, units = self._figure, _units(self.units)
        return Done({"--plot": partial(plot_march, columns, kind, columns=self._chosen, units=units)})


def _units(names: str | None) -> Units:
    """Units for the labels; those at the end may be left out."""
    given = [] if names is None else [name.strip() for name in names.split(",")]
    if len(given) > len(fields(Units)):
        raise ProblemError(f"--units {names}: give five at most, as in s,mm,N,MPa,mJ")
    return Units(*given)


def _list_columns(columns: Mapping[str, Array], names: list[str]) -> None:
    """Least, greatest and last value of columns; what was not looked for (nan) is neither."""
    import numpy as np

    from hemivar.report.tables import Table

    times = columns["time"]
    print(f"rows              {len(times)}, t = {times[0]:g} to {times[-1]:g}")

    def row(name: str) -> tuple[object, ...]:
        values = columns[name][~np.isnan(columns[name])]
        if not values.size:
            return name, "", "", ""
        last = columns[name][-1]
        return name, f"{values.min():.6g}", f"{values.max():.6g}", "" if np.isnan(last) else f"{last:.6g}"

    print_table(console(), Table(("column", "least", "greatest", "last"), tuple(map(row, names))))


class AnimateCommand(Command):
    """Make a film of a march: from its frames, or from a problem file, which is marched first."""

    file: Annotated[Path, typer.Argument(metavar="FILE", help="A list of frames (.pvd), or a problem file.")]
    output: Annotated[Path, opt.WRITTEN, option("Write the film (.gif or .mp4).", "--output", "-o", of="FILE")]
    scale: Annotated[float | None, option("Factor of the displacement (so that it is visible).", of="X")] = None
    seconds: Annotated[float, option("Length of the film.", of="S")] = 6.0
    frames: Annotated[int, option("Frames at most.", of="N", least=1)] = 200
    colour: opt.Colour = None
    units: opt.UnitNames = None
    dpi: Annotated[int, option("Dots per inch; the film is 6.3 inches wide.", of="N")] = 100
    until: opt.Until = None
    step: opt.StepLength = None
    quiet: opt.Quiet = False
    allow_code: opt.AllowCode = None

    @cached_property
    def march(self) -> MarchCommand | None:
        """The march of a problem file."""
        if self.file.suffix.lower() == ".pvd":
            return None
        return _FilmedMarch(
            self.file, self.until, self.step, output=self.output, quiet=self.quiet, allow_code=self.allow_code
        )

    @property
    def read(self) -> Path:
        return self.file

    @cached_property
    def writer(self) -> Writer:
        """That of the march."""
        return super().writer if self.march is None else self.march.writer

    def check(self) -> None:
        from hemivar.report.animation import check_film
        from hemivar.report.film_pictures import FilmColour

        check_film(self.output)
        _units(self.units)
        colours = [kind.value for kind in FilmColour]
        if self.colour is not None and self.colour not in colours:
            raise ProblemError(f"--colour {self.colour}: it is not known{suggest(self.colour, colours)}")
        if self.march is not None:
            self.march.check()
        elif self.until is not None or self.step is not None:
            raise ProblemError("--until and --step go with a problem file; a list of frames has its times already")

    def work(self) -> Done:
        film, units, ended = self._film()
        drawn = film_of(
            lambda: film,
            self.quiet,
            scale="auto" if self.scale is None else self.scale,
            seconds=self.seconds,
            frames=self.frames,
            dpi=self.dpi,
            colour=self.colour,
            unit=units.length,
            time_unit=units.time,
        )
        code = ended()
        return Done({} if code is Exit.INTERRUPTED else {"--output": drawn}, last=lambda: code)

    def _film(self) -> tuple[Film | History, Units, Callable[[], Exit]]:
        """What is drawn, the units of its labels, and what tells how its march ended."""
        if self.march is None:
            from hemivar.files.film import read_film

            return read_film(self.file), _units(self.units), lambda: Exit.CONVERGED
        (history, _), stated = self.march.march(), self.march.session.stated
        units = stated.units if self.units is None else _units(self.units)
        return history, units, partial(code_of, history, stated.name)


class _FilmedMarch(MarchCommand):
    """A march of which nothing but a film is written."""

    def check(self) -> None:
        MarchOptions.check(self)

    @property
    def named(self) -> dict[str, Path | None]:
        return {"--output": self.output, "--checkpoint": None}

    @property
    def outputs(self) -> dict[str, Path | None]:
        return self.named
