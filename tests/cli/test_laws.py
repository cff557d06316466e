"""``hemivar laws``: the list, one law with its constants, its picture."""

from __future__ import annotations

from pathlib import Path

import pytest

from hemivar.cli import main
from hemivar.laws import SawTooth, Signorini
from hemivar.laws.registry import FRICTION_LAWS, NORMAL_LAWS
from hemivar.report.law_figures import plot_law
from tests.samples import sampled


@pytest.mark.parametrize("name", sampled(sorted({*NORMAL_LAWS, *FRICTION_LAWS} - {"table"}), 5))
def test_every_law_is_shown_and_drawn(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture = tmp_path / "law.png"
    assert main(["laws", name, "--plot", str(picture)]) == 0
    out = capsys.readouterr().out
    assert f"  {name}: " in out
    assert "class: " in out
    assert "alpha = " in out
    assert picture.stat().st_size > 10_000


def test_a_law_from_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / "law.csv"
    table.write_text("r,derivative\n0,0\n0.1,2\n0.1,0\n")
    assert main(["laws", "--file", str(table)]) == 0
    out = capsys.readouterr().out
    assert "jump down from 2 to 0 at r = 0.1" in out
    assert "alpha = inf: the derivative jumps down at r = 0.1" in out
    assert main(["laws", "table"]) == 0
    assert "--file LAW.csv" in capsys.readouterr().out


def test_a_law_from_a_formula_and_with_parameters(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["laws", "--formula", "log(1+r)", "--friction", "--set", "bound=0.5"]) == 0
    assert "alpha = 0.5, attained" in capsys.readouterr().out
    assert main(["laws", "softening", "--set", "softening=3"]) == 0
    out = capsys.readouterr().out
    assert "alpha = 3" in out
    assert "shown with        stiffness=2.0  limit=0.1" in out
    assert main(["laws", "layered", "--set", "thicknesses=0.1", "--set", "stiffnesses=4", "--set", "drops=0.4"]) == 0
    assert "jump down from 0.4 to 0 at r = 0.1" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["softning"], ["did you mean 'softening'?"]),
        (["--plot", "law.png"], ["name a law"]),
        (["softening", "--plot", "law.txt"], [".png"]),
        (["softening", "--file", "law.csv"], ["give one of"]),
        (["softening", "--set", "stiffness"], ["NAME=VALUE"]),
        (["softening", "--set", "softness=1"], ["no parameter 'softness'"]),
        (["softening", "--set", "stiffness=-1"], ["stiffness", "positive"]),
        (["softening", "--friction"], ["is a normal law"]),
        (["softening", "--reach", "0"], ["--reach", "positive"]),
        (["--formula", "log(1+*r)"], ["character 7"]),
        (["--file", "none.csv"], ["none.csv", "no such file"]),
    ],
)
def test_bad_input_is_one_line(arguments: list[str], words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["laws", *arguments]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    for word in words:
        assert word in err


def test_the_picture_shows_jumps_as_vertical_lines() -> None:
    figure = plot_law(SawTooth([0.5, 1.0, 2.0], [6.0, 2.0, 1.0], [0.0, 1.0, 0.5]))
    graph = figure.axes[0]
    upright = [
        line for line in graph.lines if len(line.get_xdata()) == 2 and line.get_xdata()[0] == line.get_xdata()[1]
    ]
    dashed = sorted(float(line.get_xdata()[0]) for line in upright if line.get_color() == "#D55E00")
    assert dashed == [-2.0, -1.0, -0.5]
    assert len(plot_law(Signorini(), title="floor", reach=2.0).axes) == 2
