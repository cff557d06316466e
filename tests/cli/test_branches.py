"""The commands ``solutions`` and ``path``."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import pytest
from rich.console import Console

from hemivar import cli
from hemivar.branches import PathProgress, SearchProgress
from hemivar.cli.printing import StageView
from hemivar.workflows import Event

BLOCK = """\
title = "block on a brittle layer"
[mesh]
rectangle = [2.0, 1.0]
cells = [4, 2]
[material]
lame = [4.0, 4.0]
[loads]
body = [-1.2, -0.9]
[supports]
left = "clamped"
[contact.bottom]
normal = { law = "capped", stiffness = 20.0, limit = 0.1 }
"""


@pytest.fixture
def block(tmp_path: Path) -> Path:
    path = tmp_path / "block.toml"
    path.write_text(BLOCK)
    return path


def test_solutions_are_listed_and_written(block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "solutions.json"
    assert cli.main(["solutions", str(block), "--json", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "all 256 combinations of pieces and kinks were tried" in shown
    assert "no others exist" in shown
    record = json.loads(out.read_text())
    assert record["exhaustive"]
    energies = [solution["energy"] for solution in record["solutions"]]
    assert energies == sorted(energies)
    kinds = {solution["kind"] for solution in record["solutions"]}
    assert {"local minimiser", "saddle"} <= kinds
    assert len(record["solutions"][0]["contact"]["penetration"]) == 4
    assert all(solution["residual"] < 1e-9 for solution in record["solutions"])


def test_the_path_is_followed_written_and_drawn(
    block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, figure = tmp_path / "path.json", tmp_path / "path.png"
    arguments = ["path", str(block), "--load-factor", "0", "3", "--json", str(out), "--plot", str(figure)]
    assert cli.main(arguments) == 0
    shown = capsys.readouterr().out
    assert "fold              load factor" in shown
    assert "while loading" in shown
    assert figure.stat().st_size > 5000
    record = json.loads(out.read_text())
    points = record["points"]
    assert points[0]["load_factor"] == 0.0
    assert points[-1]["load_factor"] == 3.0
    assert set(points[0]) == {
        "load_factor", "energy", "stable", "normal_force", "friction_force", "max_penetration", "value",
    }  # fmt: skip
    assert record["folds"]
    assert record["jumps"]
    assert {point["stable"] for point in points} == {True, False}
    for fold in record["folds"]:
        assert points[fold["point"]]["load_factor"] == fold["load_factor"]


def test_another_quantity(block: Path, tmp_path: Path) -> None:
    out, figure = tmp_path / "path.json", tmp_path / "path.svg"
    arguments = ["path", str(block), "--quantity", "normal-force", "--json", str(out), "--plot", str(figure)]
    assert cli.main(arguments) == 0
    record = json.loads(out.read_text())
    assert record["quantity"] == "normal-force"
    assert all(point["value"] == point["normal_force"] for point in record["points"])


def test_a_path_ends_at_a_value(block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "path.json"
    arguments = ["path", str(block), "--end-at", "max-penetration=0.02", "--end-at", "max-slip=9", "--json", str(out)]
    assert cli.main(arguments) == 0
    assert "a quantity reached the value" in capsys.readouterr().out
    assert json.loads(out.read_text())["points"][-1]["max_penetration"] == pytest.approx(0.02, rel=1e-10)


def test_a_path_that_is_cut_short_is_told_by_the_exit_code(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["path", str(block), "--load-factor", "0", "3", "--max-points", "4"]) == 1
    assert "limit of points" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["path", "--quantity", "penetraton"], "quantity 'penetraton' is not known"),
        (["path", "--end-at", "max-openin=1"], "did you mean 'max-opening'?"),
        (["path", "--end-at", "max-opening"], "write NAME=VALUE"),
        (["path", "--load-factor", "2", "1"], "give a finite range"),
        (["path", "--plot", "path.txt"], "must end in"),
        (["solutions", "--json", "here.txt"], "must end in"),
    ],
)
def test_bad_input_is_refused_in_one_line(
    block: Path, arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([arguments[0], str(block), *arguments[1:]]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("event", "text"),
    [
        (SearchProgress(7, 2), "7 starts, 2 solutions"),
        (SearchProgress(0, 0, 130), "0 of 130 starts, 0 solutions"),
        (SearchProgress(130, 2, 130), "130 starts, 2 solutions"),
        (SearchProgress(0, 2), "2 solutions"),
        (PathProgress(5, 0.25), "5 points, load factor 0.25"),
    ],
)
def test_a_terminal_shows_how_far_a_search_is(event: Event, text: str) -> None:
    for terminal in (True, False):
        out = io.StringIO()
        with StageView(Console(file=out, force_terminal=terminal, width=120)) as view:
            view(event)
        assert (text in out.getvalue()) is terminal


def test_a_terminal_shows_how_long_a_search_takes_yet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten starts took twenty seconds: thirty more take sixty, and a hundred take minutes; two tell nothing."""
    clock = [100.0]
    monkeypatch.setattr("hemivar.cli.printing.time.monotonic", lambda: clock[0])
    for event, left in (
        (SearchProgress(10, 1, 40), "about 60 s left"),
        (SearchProgress(10, 1, 110), "about 3 min left"),
        (SearchProgress(2, 1, 40), ""),
        (SearchProgress(40, 1, 40), ""),
    ):
        out = io.StringIO()
        with StageView(Console(file=out, force_terminal=True, width=120)) as view:
            clock[0] += 20.0
            view(event)
        assert ("left" in out.getvalue()) == bool(left)
        assert left in out.getvalue()


def test_each_solution_is_drawn_and_all_side_by_side(
    block: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, record = tmp_path / "all.svg", tmp_path / "all.json"
    files = ["--plot", str(out), "--json", str(record)]
    assert cli.main(["solutions", str(block), *files, "--colour", "stress", "--max-solutions", "2"]) == 0
    energies = [f"energy {solution['energy']:.6g}" for solution in json.loads(record.read_text())["solutions"]]
    assert len(energies) == 2
    overview = out.read_text()
    assert all(energy in overview for energy in energies)
    assert "2 solutions; there may be others" in overview
    for number, energy in enumerate(energies, start=1):
        own = (tmp_path / f"all_{number}.svg").read_text()
        assert f"solution {number}: {energy}" in own
        assert "von Mises stress" in own
        assert "residual " in own
    assert f"all_{len(energies)}.svg" in capsys.readouterr().out
    assert not (tmp_path / f"all_{len(energies) + 1}.svg").exists()


def test_the_example_that_is_pulled_off_speaks_of_openings(capsys: pytest.CaptureFixture[str]) -> None:
    """All points have lifted and hang on the glue; at no load there is rounding, not penetration."""
    strip = str(Path(__file__).parents[2] / "examples" / "problems" / "delamination.toml")
    assert cli.main(["solve", strip, "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert "max penetration" not in shown
    assert re.search(r"^least opening +1\.7\S+e-05 ", shown, re.MULTILINE)
    assert re.search(r"^contact points +\d bonded, \d softening; 16 free$", shown, re.MULTILINE)
    cli.main(["path", strip, "--max-points", "3"])
    assert re.search(r"^max penetration +-\S+ to 0$", capsys.readouterr().out, re.MULTILINE)


GLUED = """
[mesh]
rectangle = [1.0, 1.0]
cells = 4
[material]
lame = [4e3, 4e3]
[loads]
body = [0.0, 4.6]
[contact.bottom]
normal = { law = "mixed-mode", strength = 2.0, energy = 0.5, stiffness = 24.0 }
"""


def test_the_printed_load_factor_is_carried(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What an overloaded solve prints is typed in as it stands, and converges."""
    file, out = tmp_path / "glued.toml", tmp_path / "s.json"
    file.write_text(GLUED)
    assert cli.main(["solve", str(file), "--quiet"]) == 1
    said = capsys.readouterr()
    printed = re.search(r"`hemivar solve (--load-factor [\d.]+)`", said.err)
    assert printed is not None
    assert printed.group(0) in said.out
    option, factor = printed.group(1).split()
    assert cli.main(["solve", str(file), "--quiet", option, factor, "--json", str(out)]) == 0
    record = json.loads(out.read_text())
    assert record["status"] == "converged"
    assert record["resultants"]["normal_force"] == pytest.approx(-4.6 * float(factor), rel=1e-6)


def test_a_load_factor_scales_what_supports_prescribe(tmp_path: Path) -> None:
    file, out = tmp_path / "block.toml", tmp_path / "s.json"
    file.write_text(BLOCK.replace('left = "clamped"', "left = { x = 0.02, y = 0.01 }"))
    forces = []
    for given in (["--load-factor", "0.5"], ["--set", "loads.body=[-0.6,-0.45]", "--set", "supports.left.x=0.01"]):
        more = [] if given[0] == "--load-factor" else ["--set", "supports.left.y=0.005"]
        assert cli.main(["solve", str(file), "--quiet", *given, *more, "--json", str(out)]) == 0
        forces.append(json.loads(out.read_text())["resultants"]["normal_force"])
    assert forces[0] == pytest.approx(forces[1], rel=1e-9)
    assert forces[0] > 0.0


def test_a_load_factor_goes_alone_and_is_a_number(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["solve", str(block), "--load-factor", "0.5", "--adaptive", "0.1"]) == 2
    assert "--adaptive and --load-factor exclude one another" in capsys.readouterr().err
    assert cli.main(["solve", str(block), "--load-factor", "1e300"]) == 2
    assert "--load-factor is 1e+300" in capsys.readouterr().err
