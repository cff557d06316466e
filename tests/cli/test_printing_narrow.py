"""What is printed on a terminal of 80 columns: whole words, whole tables."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console

from hemivar.cli import main
from hemivar.cli.printing import print_table
from hemivar.report.tables import Table

WIDE = Table(
    ("method", *(f"quantity {k}" for k in range(9))),
    tuple((name, *(k + 0.5 for k in range(9))) for name in ("newton", "augmented-lagrangian-newton")),
    "every method",
)


def printed(table: Table, width: int, terminal: bool = True, keys: int = 1) -> str:
    stream = io.StringIO()
    colour = None if not terminal else "standard"
    console = Console(file=stream, width=width, force_terminal=terminal, color_system=colour, no_color=True)
    print_table(console, table, keys)
    return stream.getvalue()


def plain(text: str) -> list[str]:
    return re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines()


@pytest.mark.parametrize("width", [80, 60])
def test_a_wide_table_stands_in_parts(width: int) -> None:
    lines = plain(printed(WIDE, width))
    assert max(map(len, lines)) <= width
    heads = [line.split("  ") for line in lines if "quantity" in line]
    assert len(heads) > 1
    named = [word.strip() for head in heads for word in head if word.strip()]
    assert named == [word for head in heads for word in ("method", *(w.strip() for w in head if "quantity" in w))]
    assert [word for word in named if word != "method"] == list(WIDE.columns[1:])
    assert sum("augmented-lagrangian-newton" in line for line in lines) == len(heads)
    assert sum("every method" in line for line in lines) == 1


def test_columns_that_tell_rows_apart_are_in_every_part() -> None:
    lines = plain(printed(WIDE, 70, keys=2))
    heads = [line for line in lines if "method" in line and "quantity" in line]
    assert len(heads) > 1
    assert all("quantity 0" in head for head in heads)
    assert all(f"quantity {k}" in "".join(heads) for k in range(9))


def test_elsewhere_lines_are_as_long_as_they_must_be() -> None:
    assert max(map(len, plain(printed(WIDE, 80, terminal=False)))) > 100
    assert max(map(len, plain(printed(WIDE, 200)))) > 100
    assert sum("quantity" in line for line in plain(printed(WIDE, 200))) == 1


@pytest.mark.parametrize("arguments", [[], ["--help"], ["doctor", "--quick"], ["new", "--template", "list"]])
def test_first_words_fit_a_terminal(
    arguments: list[str], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main(arguments) in (0, 1)
    out = capsys.readouterr().out
    assert max(map(len, out.splitlines())) <= 80
    assert "\u2026" not in out


def test_the_first_three_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    out = capsys.readouterr().out
    for command in ("hemivar new problem.toml", "hemivar solve problem.toml --plot", "hemivar certify problem.toml"):
        assert command in out
