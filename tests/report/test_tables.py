"""Tables say the same in every form."""

from __future__ import annotations

import csv
import io
from html.parser import HTMLParser
from pathlib import Path

import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.gallery import survey
from hemivar.report import comparison_table
from hemivar.report.tables import PAPER_TABLE_1, Table
from hemivar.solvers import METHODS, Solution, solve
from hemivar.workflows.comparison import energy_norm_difference


def test_comparison_of_methods() -> None:
    problem = discretize(survey("5.1", 4))
    solutions = {name: solve(problem, METHODS[name]) for name in ("newton", "active-set")}
    table = comparison_table(solutions, title="both")
    assert [row[0] for row in table.rows] == ["newton", "active-set"]
    column = table.columns.index("difference")
    assert table.rows[0][column] == 0.0
    assert table.rows[1][column] < 1e-12
    assert comparison_table(list(solutions.values())).rows[1][0] == "active-set"


def test_solutions_of_different_problems_are_not_compared(plane: Solution, bar: Solution) -> None:
    with pytest.raises(ProblemError, match="different"):
        energy_norm_difference(plane, bar)
    with pytest.raises(ProblemError, match="no solution"):
        comparison_table([])


TABLE = Table(("name", "value"), (("a|b <c>", 0.123456789), ("d", None), ("e", 1234567.0)), "title & more")


def test_csv_keeps_all_digits(tmp_path: Path) -> None:
    with TABLE.write_csv(tmp_path / "sub" / "table.csv").open() as stream:
        rows = list(csv.reader(stream))
    assert rows == [["name", "value"], ["a|b <c>", "0.123456789"], ["d", ""], ["e", "1234567.0"]]


def test_markdown() -> None:
    lines = TABLE.markdown().splitlines()
    assert lines[2:] == [
        "| name | value |",
        "|---|---:|",
        "| a\\|b &lt;c&gt; | 0.1235 |",
        "| d |  |",
        "| e | 1.23e+06 |",
    ]


def test_hostile_names_make_neither_formulas_nor_links(tmp_path: Path) -> None:
    names = ["=cmd()", "-1.5", "[a](http://b)", "<b>`x` *_\n| c", "![](//d)\\"]
    table = Table(("@law", "value"), tuple((name, 1.0) for name in names), "# [t](u)")
    with table.write_csv(tmp_path / "table.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))
    assert [row[0] for row in rows] == ["'@law", "'=cmd()", *names[1:]]
    marked = table.markdown()
    assert len(marked.splitlines()) == 4 + len(names)
    assert marked.startswith("**# \\[t\\](u)**\n")
    for hostile in ("://", "<", "](h"):
        assert hostile not in marked.replace("\\](h", "")
    assert "| &lt;b&gt;\\`x\\` \\*\\_ \\| c | 1 |" in marked


def test_html_is_escaped() -> None:
    found: list[str] = []
    parser = HTMLParser()
    parser.handle_data = found.append  # type: ignore[method-assign]
    parser.feed(TABLE.html())
    assert [text for text in found if text.strip()] == [
        "title & more", "name", "value", "a|b <c>", "0.1235", "d", "e", "1.23e+06"
    ]  # fmt: skip


def test_terminal() -> None:
    from rich.console import Console

    console = Console(width=60, record=True, file=io.StringIO())
    console.print(TABLE.rich())
    assert "a|b <c>" in console.export_text()


def test_rows_must_fit() -> None:
    with pytest.raises(ProblemError, match="row 0"):
        Table(("a", "b"), ((1,),))


def test_paper_table() -> None:
    assert {len(row.seconds) for row in PAPER_TABLE_1.values()} == {5}
    assert PAPER_TABLE_1["primal-dual active set"].counts == (4, 4, 4, 5, 6)
