"""Sweeps and studies with columns: the numbers of single solves, at their price."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.cli.app import main
from hemivar.errors import ProblemError
from hemivar.solvers.numbers_by_name import quantity_of
from hemivar.workflows.sweep import SweepAxis, read_axis
from tests.solvers.test_numbers_by_name import pressed_block

NAMES = ("max-pressure", "max-stress", "support.left.force", "load-factor")


def test_columns_are_the_numbers_of_single_solves() -> None:
    swept = hv.sweep(pressed_block, {"load": [-1.0, -2.0, -3.0]}, columns=NAMES)
    for row, load in zip(swept.rows(), (-1.0, -2.0, -3.0), strict=True):
        solution = hv.solve(pressed_block(load))
        for name in NAMES:
            assert row[name] == pytest.approx(quantity_of(solution, name), rel=1e-9)
    assert "max-pressure" in repr(swept)


def test_neither_search_nor_margin_is_made(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError("no search")

    module = sys.modules["hemivar.workflows.sweep"]
    monkeypatch.setattr(module, "finding", never)
    monkeypatch.setattr(module, "smallness", never)
    assert len(hv.sweep(pressed_block, {"load": [-1.0, -2.0]}, columns=["energy"]).points) == 2


def test_a_name_that_is_not_known_fails_every_point() -> None:
    with pytest.raises(ProblemError, match="max-presure"):
        hv.sweep(pressed_block, {"load": [-1.0]}, columns=["max-presure"])


def test_values_may_be_listed() -> None:
    assert read_axis("contact.bottom.gap=.1, .15,0.2") == SweepAxis("contact.bottom.gap", (0.1, 0.15, 0.2))
    assert read_axis("mesh.cells=2,4") == SweepAxis("mesh.cells", (2, 4))


def test_the_command_sweeps_over_values(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    hv.write_problem(pressed_block(), "block.toml")
    sets = ["--set", "contact.bottom.friction.bound", "--values", ".1,.15,.2"]
    assert main(["sweep", "block.toml", *sets, "--columns", ",".join(NAMES), "--csv", "out.csv"]) == 0
    rows = list(csv.DictReader(Path("out.csv").read_text().splitlines()))
    assert [row["contact.bottom.friction.bound"] for row in rows] == ["0.1", "0.15", "0.2"]
    solution = hv.solve(pressed_block())
    assert float(rows[0]["max-stress"]) == pytest.approx(quantity_of(solution, "max-stress"), rel=1e-9)


@pytest.mark.parametrize(
    ("more", "match"),
    [
        (["--values", "1,2"], "--set KEY"),
        (["--set", "contact.bottom.gap", "--values", "0,.1", "--columns", "max-presure"], "did you mean"),
        (["--set", "contact.bottom.gap=0,.1", "--columns", "energy", "--plot", "a.png"], "--plot"),
    ],
)
def test_what_makes_no_sense_is_refused(
    more: list[str], match: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    hv.write_problem(pressed_block(), "block.toml")
    assert main(["sweep", "block.toml", *more]) == 2
    assert match in capsys.readouterr().err


def test_a_study_has_the_largest_pressure_and_stress_on_each_mesh() -> None:
    study = hv.study(pressed_block(), 2)
    rows = study.rows()
    assert [row["max_stress"] for row in rows] == [quantity_of(one.solution, "max-stress") for one in study.levels]
    chosen = hv.study(pressed_block(), 1, columns=["support.left.force"]).rows()
    force = np.linalg.norm(hv.solve(pressed_block()).reactions["left"])
    assert chosen[0]["support.left.force"] == pytest.approx(force, rel=1e-8)
    assert "max_stress" not in chosen[0]


def test_a_study_refuses_a_name_before_it_solves() -> None:
    with pytest.raises(ProblemError, match="did you mean"):
        hv.study(pressed_block(), 1, columns=["support.right.force"])
