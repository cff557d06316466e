"""The commands ``study``, ``sweep`` and ``new --template``, and ``--set`` of every command."""

from __future__ import annotations

import csv
import inspect
import json
import os
import re
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest
import typer.main

import hemivar as hv
from hemivar import cli
from hemivar.basics import disk
from hemivar.cli.app import app
from hemivar.errors import FileError
from hemivar.files.problem_file import read_problem_file
from hemivar.files.sample import TEMPLATES, template
from tests.problem_files import MANUFACTURED, MANUFACTURED_EXACT, block_file
from tests.samples import sampled

EXAMPLES = Path(__file__).parents[2] / "examples" / "problems"
COMMANDS = (
    "solve", "certify", "solutions", "path", "bracket", "march", "compare", "study", "steps", "sweep", "identify",
)  # fmt: skip


@pytest.fixture
def block(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "block.toml"
    path.write_text(block_file(2))
    return path


def test_every_command_with_a_problem_file_takes_values() -> None:
    parameters = {
        command.name: inspect.signature(command.callback).parameters
        for command in app.registered_commands
        if command.callback is not None
    }
    stating = [name for name, own in parameters.items() if "problem" in own and name != "studio"]  # it has sliders
    assert sorted(map(str, stating)) == sorted(COMMANDS)
    commands = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    for name in stating:
        assert any("--set" in one.opts for one in commands[name].params), name


@pytest.mark.parametrize("command", COMMANDS)
def test_a_wrong_key_is_refused_by_every_command(block: Path, command: str, capsys: pytest.CaptureFixture[str]) -> None:
    given = [command, str(block), "--set", "contact.botom.normal.q_max=1"]
    given += ["--set", "loads.body.0=0:1:2"] if command == "sweep" else []
    given += ["--data", "curve.csv", "--law", "survey"] if command == "identify" else []
    assert cli.main(given) == 2
    error = capsys.readouterr().err
    assert "--set contact.botom.normal.q_max: there is no table 'botom' in [contact]; did you mean 'bottom'?" in error
    assert error.count("\n") == 1


def test_a_value_is_used_and_told(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["solve", str(block), "--quiet", "--set", "mesh.cells=[3, 3]", "--set", "loads.body.0=0.0"]) == 0
    out = capsys.readouterr().out
    assert "set               mesh.cells = [3, 3]\n" in out
    assert "mesh              16 nodes" in out


@pytest.fixture
def manufactured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "problem.toml"
    path.write_text(f'title = "a_b"\n{MANUFACTURED}')
    return path


def test_study_writes_table_and_figure(tmp_path: Path, manufactured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    problem = manufactured
    names = {suffix: tmp_path / f"out.{suffix}" for suffix in ("csv", "tex", "json", "png")}
    given = [f"--known={text}" for text in MANUFACTURED_EXACT]
    given += ["--csv", str(names["csv"]), "--latex", str(names["tex"]), "--json", str(names["json"])]
    assert cli.main(["study", str(problem), "--refine", "2", "--plot", str(names["png"]), *given]) == 0
    out = capsys.readouterr().out
    assert "reference         exact solution" in out
    assert re.search(r"energy            order (0.9[5-9]|1.0[0-5]), relative error", out)
    record = json.loads(names["json"].read_text())
    assert record["orders"]["displacement"] == pytest.approx(2.0, abs=0.1)
    rows = list(csv.DictReader(names["csv"].read_text().splitlines()))
    assert [float(row["energy error"]) for row in rows] == [mesh["errors"]["energy"] for mesh in record["meshes"]]
    assert r"\caption{a\_b}" in names["tex"].read_text()
    assert names["png"].stat().st_size > 5000


def test_study_begins_on_a_coarser_mesh_of_the_file(
    tmp_path: Path, manufactured: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = manufactured
    out = tmp_path / "out.json"
    assert cli.main(["study", str(problem), "--refine", "2", "--coarser", "1", "--json", str(out)]) == 0
    sizes = [mesh["h"] for mesh in json.loads(out.read_text())["meshes"]]
    assert sizes[0] == pytest.approx(2.0 * 2.0**0.5 / 4.0)
    assert cli.main(["study", str(problem), "--coarser", "9"]) == 2
    assert "--coarser is 9" in capsys.readouterr().err


def test_study_keeps_and_goes_on(manufactured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["study", str(manufactured), "--refine", "1"]
    assert cli.main(given) == 0
    assert ": kept" not in capsys.readouterr().out
    (kept,) = manufactured.parent.glob("problem-*.study.jsonl")
    before = kept.read_bytes()
    assert cli.main([*given, "--known", MANUFACTURED_EXACT[0], "--known", MANUFACTURED_EXACT[1]]) == 0
    out = capsys.readouterr().out
    assert out.count(" unknowns: kept\n") == 2
    assert f"kept              {kept.name}" in out
    assert kept.read_bytes() == before
    assert cli.main([*given, "--set", "loads.body.0=0.5", "--checkpoint", kept.name]) == 2
    error = capsys.readouterr().err
    assert f"{kept.name}: the file holds another study, or the problem has changed since" in error
    assert error.count("\n") == 1
    assert kept.read_bytes() == before


def test_sweep_counts_keeps_and_goes_on(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["sweep", str(block), "--set", "contact.bottom.normal.q_max=0:0.4:3", "--csv", "a.csv", "--plot", "a.png"]
    assert cli.main(given) == 0
    out = capsys.readouterr().out
    assert "contact.bottom.normal.q_max = 0.2: 1 solution, margin 1\n" in out
    (kept,) = block.parent.glob("block-*.sweep.jsonl")
    rows = list(csv.DictReader(Path("a.csv").read_text().splitlines()))
    assert [(row["contact.bottom.normal.q_max"], row["solutions"]) for row in rows] == [
        ("0.0", "1"), ("0.2", "1"), ("0.4", "1"),
    ]  # fmt: skip
    before = kept.read_bytes()
    assert cli.main(given) == 0
    assert "1 solution, margin" not in capsys.readouterr().out  # nothing was computed again
    assert kept.read_bytes() == before
    assert cli.main(["sweep", str(block)]) == 2
    assert "give a range with --set" in capsys.readouterr().err


@pytest.mark.parametrize(
    "work", [["study", "--refine", "1"], ["sweep", "--set", "contact.bottom.normal.q_max=0:0.4:2"]]
)
@pytest.mark.parametrize("full", ["write_text", "append_line"])
def test_a_full_disk_ends_no_work_whose_file_nobody_asked_for(
    block: Path, work: list[str], full: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refused(path: object, text: str) -> None:
        raise FileError(f"cannot write {path}: no space left on device")

    monkeypatch.setattr(disk, full, refused)
    assert cli.main([work[0], str(block), *work[1:]]) == 0
    assert re.search(r"not kept          cannot write .*jsonl: no space left on device", capsys.readouterr().out)
    assert cli.main([work[0], str(block), *work[1:], "--checkpoint", "a.jsonl"]) == 2
    assert "cannot write a.jsonl: no space left" in capsys.readouterr().err


def test_values_beside_the_ranges_hold_at_every_point(block: Path) -> None:
    given = ["sweep", str(block), "--set", "loads.body.1=-0.4", "--set", "contact.bottom.normal.q_max=0.1:0.2:2"]
    assert cli.main([*given, "--checkpoint", "a.jsonl", "--csv", "a.csv"]) == 0
    rows = list(csv.DictReader(Path("a.csv").read_text().splitlines()))
    for row, q in zip(rows, (0.1, 0.2), strict=True):
        text = block_file(2).replace("q_max = 0.3", f"q_max = {q}").replace("[-0.8, -0.8]", "[-0.8, -0.4]")
        block.write_text(text)
        assert float(row["energy"]) == pytest.approx(hv.solve(hv.read_problem(block)).energy, rel=1e-9)


@pytest.mark.parametrize("way", ["0.5:-0.5:3", "-0.5:0.5:3"])
def test_a_sweep_with_failed_points_is_told(block: Path, way: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Whichever end of the range makes no sense."""
    given = ["sweep", str(block), "--set", f"contact.bottom.friction.bound={way}", "--checkpoint", "a.jsonl"]
    assert cli.main(given) == 1
    assert "without result    1 point; the first:" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--set", "contact.bottom.friction.bound=0:1:123456789"], "a sweep has at most 1000000 points"),
        (["--set", "contact.bottom.friction.bound=-1:-2:3"], "friction.bound: is -1"),
        (
            ["--set", "contact.bottom.friction.bound=0:1:3", "--label", "a", "--label", "b"],
            "--label is there 2 times, and 1 parameters have a range; give one for each",
        ),
    ],
    ids=["points", "both ends", "labels"],
)
def test_sweeps_are_refused_in_words(
    block: Path, more: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["sweep", str(block), *more]) == 2
    assert words in capsys.readouterr().err


def test_errors_relative_to_nothing_are_not_drawn(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["study", str(block), "--refine", "1", "--known", "0", "--known", "0", "--plot", "a.png"]
    assert cli.main(given) == 2
    assert "relative to the reference, which is zero" in capsys.readouterr().err


def test_templates_are_the_examples() -> None:
    folder = Path(cli.__file__).parents[1] / "files" / "templates"
    for path in folder.glob("*.toml"):
        assert path.read_text() == (EXAMPLES / path.name).read_text(), path.name
    texts = {name: template(name) for name in TEMPLATES}
    assert len(list(folder.glob("*.toml"))) == len(texts) - 1
    assert len(set(texts.values())) == len(texts)


def test_templates_of_all_kinds() -> None:
    found = {name: tomllib.loads(template(name)) for name in TEMPLATES}
    assert any("box" in data["mesh"] for data in found.values())
    assert any("time" in data for data in found.values())
    assert any("kind" in data for data in found.values())


@pytest.mark.parametrize("name", sampled(TEMPLATES, [name for name in list(TEMPLATES)[::3] if name != "membrane"]))
def test_a_template_solves_as_it_is(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "problem.toml"
    assert cli.main(["new", str(file), "--template", name]) == 0
    command = "march" if read_problem_file(file).time is not None else "solve"
    assert f"hemivar {command}" in capsys.readouterr().out
    # in time the first tenth of it
    given = ["--until", "0.15"] if command == "march" else []
    assert cli.main([command, str(file), "--quiet", *given]) == 0


def test_the_softening_template_has_three_solutions_and_two_folds(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The block presses evenly: 12 per penetration against 60 up to 0.02, then -16; the load is 12 * 0.07 + 0.5."""
    file = tmp_path / "softening.toml"
    assert cli.main(["new", str(file), "--template", "softening"]) == 0
    assert cli.main(["solutions", str(file), "--json", str(tmp_path / "all.json")]) == 0
    assert "3; no others exist" in capsys.readouterr().out
    load = 12.0 * 0.07 + 0.5
    falling = (1.2 + 16.0 * 0.02 - load) / (16.0 - 12.0)
    by_hand = sorted([load / 72.0, falling, load / 12.0])
    records = json.loads((tmp_path / "all.json").read_text())["solutions"]
    found = sorted(max(one["contact"]["penetration"]) for one in records)
    assert found == pytest.approx(by_hand, rel=1e-10)
    given = ["--load-factor", "0", "1.2", "--json", str(tmp_path / "path.json")]
    assert cli.main(["path", str(file), *given]) == 0
    folds = [float(line.split()[3].rstrip(",")) for line in capsys.readouterr().out.splitlines() if line[:4] == "fold"]
    last = 0.02 + 1.2 / 16.0
    assert folds == pytest.approx([(1.2 + 12.0 * 0.02) / load, 12.0 * last / load], rel=1e-9)


def test_the_bounce_template_says_why_it_has_no_margin(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "bounce.toml"
    assert cli.main(["new", str(file), "--template", "bounce"]) == 0
    assert cli.main(["march", str(file), "--quiet", "--until", "0.02"]) == 0
    line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("least margin"))
    assert line.endswith(
        "a friction bound that depends on the pressure, as Coulomb's, or jumps has no uniqueness margin"
    )


def test_templates_are_listed_and_others_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["new", "--template", "list"]) == 0
    assert all(f"{name} " in capsys.readouterr().out for name in ("softening",))
    assert cli.main(["new", str(tmp_path / "a.toml"), "--template", "hertzz"]) == 2
    assert "template 'hertzz' is not known; did you mean 'hertz'?" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("end", [signal.SIGINT, signal.SIGKILL])
def test_a_study_of_processes_is_stopped_and_goes_on(block: Path, end: signal.Signals) -> None:
    command = [sys.executable, "-m", "hemivar", "study", str(block), "--refine", "8", "--jobs", "2"]
    kept = Path("a.jsonl")
    process = subprocess.Popen(
        [*command, "--checkpoint", "a.jsonl"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    late = time.monotonic() + 120.0
    while time.monotonic() < late and (not kept.exists() or kept.read_text().count("\n") < 4):
        time.sleep(0.01)
    process.send_signal(end)  # to this process alone: the others end with it
    out, err = process.communicate(timeout=60)
    assert process.returncode == (130 if end is signal.SIGINT else -signal.SIGKILL), err
    done = kept.read_text().splitlines()
    assert 4 <= len(done) < 10  # the last mesh alone takes seconds
    if end is signal.SIGINT:
        assert err == "hemivar: interrupted\n"
        told = re.search(r"interrupted: (\d) of 9 meshes are done; run the same command to continue", out)
        assert told is not None
        assert int(told[1]) in (len(done) - 1, len(done) - 2)  # it may come when a mesh was kept and is to be told
    late = time.monotonic() + 20.0
    while time.monotonic() < late and others_of(process.pid):
        time.sleep(0.05)
    assert not others_of(process.pid)
    again = [*command, "--checkpoint", "a.jsonl", "--csv", "a.csv"]
    resumed = subprocess.run(again, capture_output=True, text=True, timeout=300)
    assert resumed.returncode == 0, resumed.stderr
    assert resumed.stdout.count(": kept\n") == len(done) - 1
    assert kept.read_text().splitlines()[: len(done)] == done
    alone = [*command[:-1], "1", "--checkpoint", "b.jsonl", "--csv", "b.csv"]
    subprocess.run(alone, capture_output=True, timeout=300, check=True)
    assert Path("b.csv").read_bytes() == Path("a.csv").read_bytes()


def others_of(session: int) -> list[int]:
    """Processes of a session that are still there."""
    found = subprocess.run(["ps", "-o", "pid=", "-s", str(session)], capture_output=True, text=True)
    return [int(pid) for pid in found.stdout.split()]


@pytest.mark.slow
def test_a_sweep_of_processes_is_interrupted_and_goes_on(block: Path) -> None:
    command = [sys.executable, "-m", "hemivar", "sweep", str(block), "--set", "loads.body.1=-1:0:801", "--jobs", "2"]
    command += ["--checkpoint", "a.jsonl", "--csv", "a.csv"]
    kept = Path("a.jsonl")
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # whatever the tests were started with
    )  # fmt: skip
    end = time.monotonic() + 120.0
    while time.monotonic() < end and (not kept.exists() or kept.read_text().count("\n") < 200):
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err == "hemivar: interrupted\n"
    assert "run the same command to continue" in out
    done = kept.read_text().splitlines()
    assert 200 <= len(done) < 800
    again = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert again.returncode == 0, again.stderr
    assert kept.read_text().splitlines()[: len(done)] == done
    resumed = Path("a.csv").read_bytes()
    subprocess.run([*command[:-3], "b.jsonl", "--csv", "b.csv"], capture_output=True, timeout=300, check=True)
    assert Path("b.csv").read_bytes() == resumed


_UNITS = '\n[units]\ntime = "s"\nlength = "mm"\nforce = "N"\nstress = "MPa"\nenergy = "mJ"\n'


def test_units_stand_in_headings_and_records(block: Path, capsys: pytest.CaptureFixture[str]) -> None:
    block.write_text(block.read_text(encoding="utf-8") + _UNITS, encoding="utf-8")
    files = ["--csv", "a.csv", "--json", "a.json"]
    assert cli.main(["study", str(block), "--refine", "1", *files]) == 0
    assert "h (mm)" in capsys.readouterr().out
    head = Path("a.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {"h (mm)", "energy (mJ)", "normal force (N)"} <= set(head)
    assert json.loads(Path("a.json").read_text(encoding="utf-8"))["units"]["length"] == "mm"
    given = ["sweep", str(block), "--set", "contact.bottom.gap=0:0.1:2", "--csv", "b.csv"]
    assert cli.main(given) == 0
    head = Path("b.csv").read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {"energy (mJ)", "penetration (mm)", "force (N)"} <= set(head)
    assert cli.main(["solutions", str(block), "--starts", "2"]) == 0
    assert "energy (mJ)" in capsys.readouterr().out
    assert cli.main(["march", str(block), "--until", "0.2", "--step", "0.1", "--json", "c.json", "-q"]) == 0
    assert json.loads(Path("c.json").read_text(encoding="utf-8"))["units"]["energy"] == "mJ"


def test_halved_steps_of_a_problem_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.toml").write_text(template("bounce").replace("cells = [16, 8]", "cells = [2, 2]"))
    begin = ["steps", "a.toml", "--until", "0.2", "--step", "0.05"]
    files = ["--csv", "a.csv", "--latex", "a.tex", "--json", "a.json", "--plot", "a.png"]
    assert cli.main([*begin, "--refine", "2", *files, "--set", "loads.body=['-sin(9*t)', 0]"]) == 1
    out = capsys.readouterr().out
    assert "reference         finest run" in out
    assert "energy            too few runs for an order, relative error" in out
    assert "step for 0.001    not known" in out
    assert [run["step"] for run in json.loads(Path("a.json").read_text())["runs"]] == [0.05, 0.025, 0.0125]
    assert Path("a.png").stat().st_size > 1000
    assert cli.main([*begin, "--known", "t"]) == 2
    assert "a.toml: the exact solution has 1 components" in capsys.readouterr().err
