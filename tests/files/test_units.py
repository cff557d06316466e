"""The table [units] of a problem file: labels, and nothing else."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hemivar import cli
from hemivar.basics.content import content
from hemivar.basics.units import Units
from hemivar.errors import ProblemError
from hemivar.evolution.history import quantity_of
from hemivar.files.history_table import read_history_table
from hemivar.files.problem_file import parse_problem_file, read_problem_file, write_problem
from hemivar.solvers import solve
from tests.problems import square

PLAIN = """
[mesh]
rectangle = [1.0, 1.0]
cells = [4, 4]
[material]
lame = [4.0, 4.0]
[loads]
body = [0.0, -0.5]
[supports]
left = "clamped"
[contact.bottom]
normal = { law = "compliance", stiffness = 2.0 }
"""
STATED = PLAIN + '[units]\nlength = "mm"\nforce = "N"\nstress = "MPa"\nenergy = "mJ"\ntime = "s"\n'
UNITS = Units("s", "mm", "N", "MPa", "mJ")


def test_units_are_read_and_written_back(tmp_path: Path) -> None:
    found = parse_problem_file(STATED)
    assert found.units == UNITS
    path = write_problem(found, tmp_path / "problem.toml")
    assert read_problem_file(path).units == UNITS
    assert parse_problem_file(PLAIN).units == Units()
    assert "[units]" not in write_problem(parse_problem_file(PLAIN), tmp_path / "plain.toml").read_text()
    some = write_problem(replace(found.problem, units=Units(length="µm")), tmp_path / "some.toml")
    assert read_problem_file(some).units == Units(length="µm")


def test_a_scalar_problem_has_units_too(tmp_path: Path) -> None:
    path = tmp_path / "membrane.toml"
    assert cli.main(["new", str(path), "--template", "membrane"]) == 0
    path.write_text(path.read_text() + '\n[units]\nlength = "m"\n')
    assert read_problem_file(path).units == Units(length="m")


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("length = 1.0", "[units] length: must be a text"),
        ('lenght = "mm"', "did you mean 'length'?"),
        ('stress = "M$Pa"', "stress: is no unit; give a short text, such as 'mm', without '$'"),
        ('force = "newton per millimetre"', "force: is no unit"),
        ('force = "N\\n"', "force: is no unit"),
        ('force = ["N"]', "force: must be a text, not a list"),
    ],
)
def test_what_is_no_unit_is_refused(line: str, sentence: str) -> None:
    with pytest.raises(ProblemError) as error:
        parse_problem_file(f"{PLAIN}[units]\n{line}\n", name="a.toml")
    assert str(error.value).startswith("a.toml: [units]")
    assert sentence in str(error.value)


def test_units_must_be_a_table() -> None:
    with pytest.raises(ProblemError, match="units"):
        parse_problem_file(f'units = "mm"\n{PLAIN}')


def test_numbers_stay_and_labels_follow(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    said = {}
    for name, text in (("plain", PLAIN), ("stated", STATED)):
        path = tmp_path / f"{name}.toml"
        path.write_text(text)
        more = ["--json", str(tmp_path / f"{name}.json"), "--plot", str(tmp_path / f"{name}.svg")]
        assert cli.main(["solve", str(path), "--quiet", *more]) == 0
        said[name] = capsys.readouterr().out
    plain, stated = (json.loads((tmp_path / f"{name}.json").read_text()) for name in said)
    assert "units" not in plain
    assert stated["units"] == UNITS.record()
    assert stated["displacement"] == plain["displacement"]
    assert stated["resultants"] == plain["resultants"]
    for label, unit in (
        ("energy", "mJ"), ("normal force", "N"), ("max penetration", "mm"), ("max pressure", "MPa"),
        ("contact length", "mm"),
    ):  # fmt: skip
        line = next(line for line in said["plain"].splitlines() if line.startswith(label))
        assert f"{line} {unit}" in said["stated"].splitlines()
    assert "mm" in (tmp_path / "stated.svg").read_text()
    assert "max penetration" in said["plain"]


def test_the_summary_takes_units() -> None:
    text = str(solve(square(n=4)).summary(units=UNITS))
    assert " mm" in text
    assert " MPa" in text
    assert "MPa" not in str(solve(square(n=4)).summary())
    problem = replace(square(n=4), units=UNITS)
    assert str(solve(problem).summary()) != str(solve(square(n=4)).summary())
    assert " MPa" in str(solve(problem).summary())
    assert " MPa" not in str(solve(problem).summary(units=Units()))


def test_units_are_no_part_of_what_a_problem_is() -> None:
    """Work that was kept goes on when labels change."""
    assert b"".join(content(replace(square(n=4), units=UNITS))) == b"".join(content(square(n=4)))
    with pytest.raises(ProblemError, match=r"units.*give hemivar.report.Units\(length='mm'"):
        replace(square(n=4), units="mm")  # type: ignore[arg-type]


def test_a_table_in_time_has_units_in_its_heads_and_is_read_without(tmp_path: Path) -> None:
    path = tmp_path / "a.toml"
    path.write_text(STATED + "[time]\nuntil = 0.2\nstep = 0.1\n[output]\nprobes = { tip = [1.0, 1.0] }\n")
    assert cli.main(["march", str(path), "--quiet", "--table", str(tmp_path / "a.csv")]) == 0
    heads = (tmp_path / "a.csv").read_text().splitlines()[0].split(",")
    wanted = ("time (s)", "step (s)", "work (mJ)", "normal_force (N)", "tip.u_x (mm)")
    assert set(wanted) <= set(heads), heads
    assert {"margin", "jumped"} <= set(heads)
    table = read_history_table(tmp_path / "a.csv")
    assert {"time", "step", "work", "normal_force", "tip.u_x", "margin"} <= set(table)
    assert table["time"].tolist() == [0.0, 0.1, 0.2]
    path.write_text(path.read_text().replace(STATED, PLAIN))
    assert cli.main(["march", str(path), "--quiet", "--table", str(tmp_path / "b.csv")]) == 0
    plain = read_history_table(tmp_path / "b.csv")
    assert "(" not in (tmp_path / "b.csv").read_text().splitlines()[0]
    assert list(plain) == list(table)
    assert all(np.array_equal(plain[name], table[name], equal_nan=True) for name in plain)


@pytest.mark.parametrize(
    ("column", "quantity"),
    [
        ("time", "time"), ("step", "time"), ("largest_step", "time"), ("bottom.penetration", "length"),
        ("tip.u_x", "length"), ("bottom.normal_force", "force"), ("friction_force", "force"), ("work", "energy"),
        ("gap", "energy"), ("thermal", "energy"), ("margin", ""), ("solver_steps", ""), ("contact_measure", ""),
    ],
)  # fmt: skip
def test_what_a_column_measures(column: str, quantity: str) -> None:
    assert quantity_of(column) == quantity
