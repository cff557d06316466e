"""Problem files with load steps: gone through by the command, refused by what takes one problem."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hemivar.cli.app import main
from hemivar.files.film import read_film

FILE = """
mesh = { rectangle = [100.0, 10.0], cells = [25, 1] }
material = { young = 70000.0, poisson = 0.0 }
supports = { bottom = "roller", top = "roller" }
area.friction = { law = "tresca", bound = 2.0 }
steps = [
    { name = "pull", loads.traction.right = [120.0, 0.0] },
    { name = "release", loads.traction.right = [0.0, 0.0] },
    { name = "again", loads.traction.right = [60.0, 0.0] },
]
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "steps.toml").write_text(FILE, encoding="utf-8")
    return tmp_path


def test_the_command_goes_through_the_steps(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["march", "steps.toml", "--fields", "run.pvd", "--json", "run.json", "--table", "run.csv"]) == 0
    out = capsys.readouterr().out
    assert "finished at t = 3 after 3 steps" in out
    for line in ("load steps        1 pull: normal force", "3 again: normal force"):
        assert line in out
    assert read_film("run.pvd").times == pytest.approx([1.0, 2.0, 3.0])
    record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert record["load_steps"] == ["pull", "release", "again"]
    assert record["table"]["time"] == [1.0, 2.0, 3.0]
    assert main(["march", "steps.toml", "--step", "0.5"]) == 0
    assert "after 5 steps" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["solve", "certify", "solutions", "path", "bracket", "study"])
def test_commands_for_one_problem_refuse_steps(command: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([command, "steps.toml"]) == 2
    assert "load steps, and this is for one" in capsys.readouterr().err


def test_the_forces_of_each_boundary_are_printed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A block hangs on a bolt, which stretches it by 100 times .01 more, beside a wall that it does not touch."""
    monkeypatch.chdir(tmp_path)
    text = """
    mesh = { rectangle = [1.0, 1.0], cells = 4 }
    material = { young = 100.0, poisson = 0.0 }
    supports = { top = { displacement = [0.0, 0.0] } }
    contact = { bottom.normal = "bolt", left.normal = "signorini" }
    steps = [{ name = "tighten", bolts.bottom = 2.0 }, { name = "work", supports.top.displacement = [0.0, 0.01] }]
    """
    (tmp_path / "bolt.toml").write_text(text, encoding="utf-8")
    assert main(["march", "bolt.toml"]) == 0
    assert "2 work: normal force and friction of bottom -3, 0; left 0, 0; residual" in capsys.readouterr().out
