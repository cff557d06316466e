"""``hemivar identify``: a law from a curve, by the command."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.cli.app import main

GLUE = """
title = "a glued block, pulled off"
[mesh]
rectangle = [1.0, 1.0]
cells = [2, 2]
[material]
lame = [40.0, 40.0]
[supports]
top = { x = 0.0, y = 0.01 }
[contact.bottom]
normal = { law = "adhesive", stiffness = 30.0, strength = 1.5, softening = 20.0 }
"""
HEAD = "supports.top.y,support.top.force.y\n"


@pytest.fixture(scope="module")
def curve() -> str:
    """A curve of another law of the same kind."""
    rng, lines, last = np.random.default_rng(3), [HEAD], None
    for pull in np.linspace(0.005, 0.2, 16):
        body = hv.ContactProblem(
            mesh=hv.rectangle((1.0, 1.0), 2), material=hv.Material.lame(40.0, 40.0),
            supports={"top": hv.Fixed(x=0.0, y=float(pull))},
            contact={"bottom": hv.Contact(hv.Adhesive(stiffness=40.0, strength=2.0, softening=25.0))},
        )  # fmt: skip
        last = hv.solve(body, initial=last)
        lines.append(f"{pull:.8g},{last.reactions['top'][1] + 0.01 * rng.standard_normal():.8g}\n")
    return "".join(lines)


@pytest.fixture
def folder(curve: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The problem and the curve."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "glue.toml").write_text(GLUE)
    (tmp_path / "curve.csv").write_text(curve)
    return tmp_path


def test_a_law_from_a_curve(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--starts", "1", "--csv", "p.csv", "--json", "p.json", "--latex", "p.tex", "--plot", "p.png"]
    assert main(["identify", "glue.toml", "--data", "curve.csv", "--law", "adhesive", *options]) == 0
    told = capsys.readouterr().out
    assert "contact.bottom.normal.strength" in told
    found = json.loads((folder / "p.json").read_text())["parameters"]
    for name, value in (("stiffness", 40.0), ("strength", 2.0), ("softening", 25.0)):
        one = found[f"contact.bottom.normal.{name}"]
        assert one["value"] == pytest.approx(value, rel=0.05)
        assert one["interval"][0] < one["value"] < one["interval"][1]
        assert one["identified"]
    assert (folder / "p.png").stat().st_size > 3000
    assert (folder / "p.csv").read_text().startswith("parameter,value,low,high")


def test_what_the_curve_does_not_tell_is_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = (folder / "curve.csv").read_text().splitlines()
    (folder / "early.csv").write_text("\n".join(rows[:6]) + "\n")
    fitted = ["--fit", "contact.bottom.normal.stiffness=3:300", "--fit", "contact.bottom.normal.softening=1:400"]
    given = ["--set", "contact.bottom.normal.strength=2", "--starts", "1"]
    assert main(["identify", "glue.toml", "--data", "early.csv", *fitted, *given]) == 1
    assert "softening is not identifiable from this curve" in capsys.readouterr().out


def test_what_is_set_is_not_fitted(folder: Path) -> None:
    """``--law`` fits all numbers of the law but those that ``--set`` gives."""
    given = ["--set", "contact.bottom.normal.strength=2", "--starts", "1", "--json", "p.json"]
    assert main(["identify", "glue.toml", "--data", "curve.csv", "--law", "adhesive", *given]) == 0
    found = json.loads((folder / "p.json").read_text())["parameters"]
    assert sorted(key.rpartition(".")[2] for key in found) == ["softening", "stiffness"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ([], "--law NAME or by --fit"),
        (["--law", "softening"], "has the law 'adhesive' in the file"),
        (["--law", "nothing"], "is not known"),
        (["--law", "adhesive", "--contact", "top"], "one of bottom"),
        (["--fit", "contact.bottom.normal.strength"], "KEY=LOW:HIGH"),
        (["--fit", "contact.bottom.normal.strength=5:1"], "a lower end and a higher one"),
        (["--fit", "contact.bottom.normal.strengthh=1:5"], "strength"),
        (["--fit", "mesh.cells.0=1:5"], "whole number|integer|body is another"),
        (["--law", "adhesive", "--confidence", "2"], "between 0 and 1"),
        (["--law", "adhesive", "--data", "none.csv"], "none.csv"),
    ],
)
def test_bad_options(options: list[str], says: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = [] if "--data" in options else ["--data", "curve.csv"]
    assert main(["identify", "glue.toml", *data, *options]) == 2
    error = capsys.readouterr().err
    assert len(error.strip().splitlines()) == 1
    import re

    assert re.search(says, error), error


def test_a_material_is_no_input(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "m.csv").write_text("material.lame.0,support.top.force.y\n40,0.1\n50,0.2\n60,0.3\n70,0.4\n80,0.5\n")
    assert main(["identify", "glue.toml", "--data", "m.csv", "--law", "adhesive"]) == 2
    assert "column 'material.lame.0' is neither a load nor a support of glue.toml" in capsys.readouterr().err
