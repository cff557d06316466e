"""Tables of results: to the terminal, CSV, LaTeX, Markdown and HTML."""

from __future__ import annotations

import html
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import expect, expecting
from hemivar.basics.csv_text import csv_text
from hemivar.basics.disk import make_folder, path_of, shown, write_text
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.pandas_frame import data_frame
from hemivar.basics.rows import ResultRows
from hemivar.basics.types import Record
from hemivar.basics.units import Units
from hemivar.errors import ProblemError
from hemivar.solvers import Solution
from hemivar.workflows.comparison import energy_norm_difference

if TYPE_CHECKING:
    from pandas import DataFrame
    from rich.table import Table as RichTable

__all__ = ["PAPER_TABLE_1", "PaperRow", "Table", "comparison_table"]


@dataclass(frozen=True)
class PaperRow:
    """One method of the survey's Table 1, for h = 1/8, 1/16, 1/32, 1/64, 1/128."""

    seconds: tuple[float, ...]  # without assembly, on the machine of the authors
    count_name: str = ""
    counts: tuple[int, ...] = ()  # functional evaluations or set iterations


#: The survey's Table 1 (arXiv 2103.14518); one entry for each of 1/h = 8, 16, 32, 64, 128.
PAPER_TABLE_1: Mapping[str, PaperRow] = MappingProxyType(
    {
        "direct optimization": PaperRow(
            (0.14, 0.36, 1.33, 3.97, 40.40), "functional evaluations", (1027, 1397, 2832, 2748, 5329)
        ),
        "augmented Lagrangian": PaperRow((0.26, 0.74, 1.38, 3.79, 37.60)),
        "primal-dual active set": PaperRow((0.07, 0.19, 0.76, 6.96, 178.07), "set iterations", (4, 4, 4, 5, 6)),
    }
)


@dataclass(frozen=True)
class Table:
    """ResultRows of text and numbers with a heading.

    Attributes
    ----------
    columns : tuple of str
    rows : tuple of tuples
        Strings, numbers or None (empty), as many as there are columns.
    title : str
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[object, ...], ...]
    title: str = ""

    def __post_init__(self) -> None:
        expect(self.title, str, "the title of a table", "give a text")
        listed = isinstance(self.columns, tuple | list) and isinstance(self.rows, tuple | list)
        if not listed or not all(isinstance(row, tuple | list) for row in self.rows):
            raise ProblemError("a table has a tuple of names of columns, and a tuple of rows, each a tuple; give these")
        for number, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ProblemError(
                    f"row {number} of table '{self.title}' has {len(row)} entries for {len(self.columns)} columns; "
                    "give one each"
                )

    @classmethod
    @expecting(rows=ResultRows, title=str, units=Units, brief=bool)
    def of(cls, rows: ResultRows, title: str = "", *, units: Units | None = None, brief: bool = False) -> Table:
        """The table of the rows of a result, whole or brief, with the units in its headings."""
        units, kept = Units() if units is None else units, []
        for column in rows.columns:
            head = column.brief if brief and column.brief is not ... else column.head
            kept += [] if head is None else [(units.head(head, column.unit), rows.cells(column))]
        return cls(tuple(head for head, _ in kept), tuple(zip(*(cells for _, cells in kept), strict=True)), title)

    def write_csv(self, path: str | Path) -> Path:
        """Write the table with full precision; returns the path.

        A text that a spreadsheet would take for a formula has an apostrophe in front.

        Raises
        ------
        FileError
            The file or its folder cannot be made.
        """
        return _written(path, csv_text(self.columns, self.rows))

    def write_latex(self, path: str | Path) -> Path:
        """Write :meth:`latex`; returns the path.  Raises as :meth:`write_csv`."""
        return _written(path, self.latex())

    def latex(self) -> str:
        """The table for LaTeX with the package booktabs, the title as its caption.

        Numbers of a column have the same digits, zeros at their ends included: orders two decimals, others three or
        four significant ones. A mesh size ``h`` that is the reciprocal of a whole number is written as one, ``1/64``.
        """
        right = self._numeric()
        texts = [_digits(name, column) for name, column in zip(self.columns, self._by_columns(), strict=True)]
        lines = [" & ".join(map(_latex, row)) for row in zip(*texts, strict=True)]
        tabular = [
            r"\begin{tabular}{" + "".join("r" if to_right else "l" for to_right in right) + "}",
            r"\toprule",
            " & ".join(map(_latex, self.columns)) + r" \\",
            r"\midrule",
            *(line + r" \\" for line in lines),
            r"\bottomrule",
            r"\end{tabular}",
        ]
        if self.title:
            caption = r"\caption{" + _latex(self.title) + "}"
            tabular = [r"\begin{table}", r"\centering", caption, *tabular, r"\end{table}"]
        return "\n".join([r"% \usepackage{booktabs}", *tabular, ""])

    def markdown(self) -> str:
        """The table in Markdown, numbers rounded and to the right."""
        right = self._numeric()
        lines = [
            "| " + " | ".join(_escape(name) for name in self.columns) + " |",
            "|" + "|".join("---:" if to_right else "---" for to_right in right) + "|",
        ]
        lines += ["| " + " | ".join(_escape(_text(cell)) for cell in row) + " |" for row in self.rows]
        heading = f"**{_escape(self.title)}**\n\n" if self.title else ""
        return heading + "\n".join(lines) + "\n"

    def _repr_html_(self) -> str:
        return self.html()

    def to_dataframe(self) -> DataFrame:
        """The table for pandas, with all digits; an empty cell is None, among numbers nan.

        Raises
        ------
        ProblemError
            pandas is not installed.
        """
        return data_frame(self.record(), "the columns and rows of the table")

    def record(self) -> Record:
        """The cells of each column by its name."""
        return dict(zip(self.columns, map(list, self._by_columns()), strict=True))

    def _by_columns(self) -> Iterable[tuple[object, ...]]:
        return zip(*self.rows, strict=True) if self.rows else [()] * len(self.columns)

    def html(self) -> str:
        """The table as HTML."""
        right = self._numeric()

        def line(cells: Sequence[str], tag: str) -> str:
            row = (
                f"<{tag}{' class=number' if to_right else ''}>{html.escape(cell)}</{tag}>"
                for cell, to_right in zip(cells, right, strict=True)
            )
            return "<tr>" + "".join(row) + "</tr>"

        caption = f"<caption>{html.escape(self.title)}</caption>" if self.title else ""
        body = "\n".join(line([_text(cell) for cell in row], "td") for row in self.rows)
        return f"<table>{caption}<thead>{line(self.columns, 'th')}</thead>\n<tbody>{body}</tbody></table>"

    def rich(self) -> RichTable:
        """The table for the terminal, to be printed by ``rich``."""
        with IMPORTS:
            from rich.table import Table as RichTable
            from rich.text import Text

        table = RichTable(title=shown(self.title) or None)
        for name, to_right in zip(self.columns, self._numeric(), strict=True):
            table.add_column(Text(shown(name)), justify="right" if to_right else "left")
        for row in self.rows:
            table.add_row(*(Text(shown(_text(cell))) for cell in row))
        return table

    def _numeric(self) -> list[bool]:
        """Which columns hold numbers (or text that begins like one)."""
        return [all(map(_like_number, column)) and len(self.rows) > 0 for column in self._by_columns()]


def _written(path: str | Path, text: str) -> Path:
    path = path_of(path)
    make_folder(path.parent)
    write_text(path, text)
    return path


def _like_number(cell: object) -> bool:
    return cell is None or not isinstance(cell, str) or cell[:1] in "0123456789>-" or cell == ""


def _text(cell: object) -> str:
    if cell is None:
        return ""
    if isinstance(cell, float | np.floating):
        value = float(cell)
        if value == 0.0:
            return "0"
        return f"{value:.2e}" if not 1e-3 <= abs(value) < 1e5 else f"{value:.4g}"
    return str(cell)


def _digits(name: str, column: Sequence[object]) -> list[str]:
    """The cells of a column for print."""
    numbers = [float(cell) for cell in column if isinstance(cell, float | np.floating) and math.isfinite(float(cell))]
    sizes = [abs(value) for value in numbers if value]
    if name == "h" and sizes and all(reciprocal(size) for size in sizes):
        return [
            f"1/{reciprocal(float(cell))}" if isinstance(cell, float | np.floating) else _text(cell) for cell in column
        ]
    if "order" in name:
        form = ".2f"
    elif sizes and (min(sizes) < 1e-3 or max(sizes) >= 1e5):
        form = ".2e"
    else:
        form = f".{max(3 - math.floor(math.log10(max(sizes))), 0)}f" if sizes else ".4g"
    plain = [isinstance(cell, float | np.floating) and math.isfinite(float(cell)) for cell in column]
    return [f"{cell:{form}}" if fine else _text(cell) for cell, fine in zip(column, plain, strict=True)]


def reciprocal(size: float) -> int:
    """The whole number n of 2 or more with ``size = 1/n``, or 0 where there is none."""
    n = round(1.0 / size) if 1e-9 < size < 0.6 else 0
    return n if n > 1 and abs(size * n - 1.0) < 1e-9 else 0


def _escape(text: str) -> str:
    """A text for Markdown, in which it makes neither cells, lines, links, pictures nor HTML."""
    plain = "".join(c if c.isprintable() else " " for c in text)
    marked = re.sub(r"([\\`*_\[\]|~$])", r"\\\1", html.escape(plain, quote=False))
    return marked.replace("://", ":&#47;/").replace("www.", "www&#46;").replace("@", "&#64;")  # which are links bare


#: What stands for characters that LaTeX takes for commands.
_LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "_": r"\_", "%": r"\%",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "|": r"\textbar{}",
}  # fmt: skip


def _latex(text: str) -> str:
    """A text for LaTeX, numbers as formulas."""
    number = re.fullmatch(r"(-?\d+(?:[./]\d+)?)(?:e([-+]\d+))?", text)
    if number is not None:
        power = "" if number[2] is None else rf" \cdot 10^{{{int(number[2])}}}"
        return f"${number[1]}{power}$"
    plain = "".join(c if c.isprintable() else " " for c in text)
    return "".join(_LATEX.get(c, c) for c in plain)


def comparison_table(
    solutions: Mapping[str, Solution] | Sequence[Solution],
    *,
    reference: Solution | None = None,
    title: str = "",
) -> Table:
    """Several solutions of one discrete problem side by side.

    Parameters
    ----------
    solutions : mapping of name to Solution, or sequence
        A sequence is labelled by the names of the methods.
    reference : Solution, optional
        What the others are compared with; the first one by default.
    title : str

    Returns
    -------
    Table
        Columns method, status, residual, energy, difference (relative, in the energy norm, to the reference), steps,
        evaluations, condense, iterate, recover (seconds).

    Raises
    ------
    ProblemError
        No solution, or solutions of different problems.
    """
    named = list(solutions.items()) if isinstance(solutions, Mapping) else [(s.method, s) for s in solutions]
    if not named:
        raise ProblemError("there is no solution to compare; give at least one")
    reference = named[0][1] if reference is None else reference
    rows = tuple(
        (
            name,
            solution.status.value,
            solution.residual.relative,
            f"{solution.energy:.9g}",
            energy_norm_difference(solution, reference),
            solution.steps,
            solution.evaluations,
            *(solution.timings.get(stage, 0.0) for stage in ("condense", "iterate", "recover")),
        )
        for name, solution in named
    )
    columns = (
        "method", "status", "residual", "energy", "difference", "steps", "evaluations", "condense (s)", "iterate (s)",
        "recover (s)",
    )  # fmt: skip
    return Table(columns, rows, title)
