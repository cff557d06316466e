"""``hemivar history`` and ``hemivar animate``: the table of a march, and its film."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hemivar.basics.arguments import suggest
from hemivar.basics.units import Units
from hemivar.cli.march_run import MarchOptions, MarchRun, write_film
from hemivar.cli.options import Colour, Exit, Quiet, StepLength, UnitNames, Until
from hemivar.cli.outputs import Writer, check_outputs
from hemivar.cli.printing import console, print_table
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hemivar.basics.types import Array
    from hemivar.evolution import History
    from hemivar.files.film import Film
__all__ = ["animate", "history"]


def history(
    table: Annotated[Path, typer.Argument(metavar="TABLE.csv", help="What 'hemivar march' wrote as --table.")],
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw the table (.png, .svg or .pdf).")] = None,
    kind: Annotated[
        str | None, typer.Option(metavar="NAME", help="ledger, forces, loop, steps or columns (ledger).")
    ] = None,
    columns: Annotated[str | None, typer.Option(metavar="A,B,...", help="Columns to draw or to list.")] = None,
    units: UnitNames = None,
) -> int:
    """List the columns of the table of a march, or draw it."""
    from hemivar.files.history_table import read_history_table
    from hemivar.report.march_figures import MARCH_FIGURES, plot_march

    check_outputs({"--plot": plot}, table)
    named = _units(units)
    known = [name for name in MARCH_FIGURES if name != "map"]
    kind = kind or ("ledger" if columns is None else "columns")
    if kind not in known:
        raise ProblemError(f"--kind {kind}: it is not known{suggest(kind, known)}")
    if columns is not None and kind not in ("columns", "loop"):
        raise ProblemError(f"--columns goes with --kind columns or loop; the figure '{kind}' has its own columns")
    found = read_history_table(table)
    chosen = [] if columns is None else [name.strip() for name in columns.split(",")]
    for name in chosen:
        if name not in found:
            raise ProblemError(f"--columns {name}: the table has no such column{suggest(name, list(found))}")
    writer = Writer([table])
    if plot is None:
        _list_columns(found, chosen or list(found))
        return writer.ended(Exit.CONVERGED)

    def draw(file: Path) -> None:
        from hemivar.report.saving import save

        save(plot_march(found, kind, columns=chosen, units=named), file)

    writer.write("--plot", plot, draw, picture=True)
    writer.tell()
    return writer.ended(Exit.CONVERGED)


def _units(names: str | None) -> Units:
    """Units for the labels; those at the end may be left out."""
    given = [] if names is None else [name.strip() for name in names.split(",")]
    if len(given) > len(fields(Units)):
        raise ProblemError(f"--units {names}: give five at most, as in s,mm,N,MPa,mJ")
    return Units(*given)


def _list_columns(found: Mapping[str, Array], names: list[str]) -> None:
    """Least, greatest and last value of columns; what was not looked for (nan) is neither."""
    import numpy as np

    from hemivar.report.tables import Table

    times = found["time"]
    print(f"rows              {len(times)}, t = {times[0]:g} to {times[-1]:g}")

    def row(name: str) -> tuple[object, ...]:
        values = found[name][~np.isnan(found[name])]
        if not values.size:
            return name, "", "", ""
        last = found[name][-1]
        return name, f"{values.min():.6g}", f"{values.max():.6g}", "" if np.isnan(last) else f"{last:.6g}"

    print_table(console(), Table(("column", "least", "greatest", "last"), tuple(map(row, names))))


def animate(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A list of frames (.pvd), or a problem file.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="Write the film (.gif or .mp4).")],
    scale: Annotated[
        float | None, typer.Option(metavar="X", help="Factor of the displacement (so that it is visible).")
    ] = None,
    seconds: Annotated[float, typer.Option(metavar="S", help="Length of the film.")] = 6.0,
    frames: Annotated[int, typer.Option(metavar="N", min=1, help="Frames at most.")] = 200,
    colour: Colour = None,
    units: UnitNames = None,
    dpi: Annotated[int, typer.Option(metavar="N", help="Dots per inch; the film is 6.3 inches wide.")] = 100,
    until: Until = None,
    step: StepLength = None,
    quiet: Quiet = False,
) -> int:
    """Make a film of a march: from its frames, or from a problem file, which is marched first."""
    from hemivar.report.animation import check_film
    from hemivar.report.film_pictures import FilmColour

    check_film(output)
    named = _units(units)
    colours = [kind.value for kind in FilmColour]
    if colour is not None and colour not in colours:
        raise ProblemError(f"--colour {colour}: it is not known{suggest(colour, colours)}")
    film: Film | History | None
    code: int = Exit.CONVERGED
    if file.suffix.lower() == ".pvd":
        from hemivar.files import read_film

        if until is not None or step is not None:
            raise ProblemError("--until and --step go with a problem file; a list of frames has its times already")
        check_outputs({"--output": output}, file)
        film, writer = read_film(file), Writer([file])
    else:
        run = MarchRun(file, {"--output": output}, None, MarchOptions(until=until, step=step), own=False)
        code = run.march(quiet, write=False)
        film, writer = run.found, run.session.writer
        named = run.session.stated.units if units is None else named
        if film is None or code == Exit.INTERRUPTED:
            return writer.ended(code)
    drawn: dict[str, Any] = {"scale": "auto" if scale is None else scale, "seconds": seconds, "frames": frames}
    drawn |= {"dpi": dpi, "colour": colour, "unit": named.length, "time_unit": named.time}
    write_film(writer, "--output", output, film, quiet, **drawn)
    writer.tell()
    return writer.ended(code)
