"""The commands march, history and animate."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from hemivar import cli
from hemivar.cli import main
from hemivar.errors import FileError
from hemivar.evolution import Checkpoint
from hemivar.files.film import read_film
from hemivar.files.history_table import read_history_table

STATIC = """\
title = "block"
[mesh]
rectangle = [2.0, 1.0]
cells = [4, 2]
[material]
lame = [4.0, 4.0]
density = 1.0
viscosity = [0.2, 0.2]
[loads]
body = [0.3, -0.8]
[supports]
left = "clamped"
[contact.bottom]
normal = { law = "survey", q_max = 0.3, p_const = 2.0 }
friction = { law = "tresca", bound = 0.05 }
"""
TIMED = """
[time]
until = 1.0
scheme = { name = "generalized-alpha", rho = 0.7 }
step = 0.05
inertia = true
[output]
every = 0.25
fields = "run.pvd"
table = "run.csv"
probes = { tip = [2.0, 1.0] }
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "static.toml").write_text(STATIC)
    (tmp_path / "timed.toml").write_text(STATIC + TIMED)
    return tmp_path


def test_stops_of_a_file_are_met(folder: Path) -> None:
    text = (STATIC + TIMED).replace("step = 0.05", "step = 0.05\nstops = [0.12, 0.33]")
    (folder / "stops.toml").write_text(text)
    assert main(["march", "stops.toml", "--quiet"]) == 0
    times = read_history_table(folder / "run.csv")["time"]
    assert all(np.abs(times - stop).min() < 1e-14 for stop in (0.12, 0.33, 1.0))


def test_a_file_with_time_is_marched(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["march", "timed.toml"]) == 0
    out = capsys.readouterr().out
    for text in ("finished at t = 1 after 20 steps", "least margin", "balance error", "run.csv, run.pvd"):
        assert text in out
    table = read_history_table(folder / "run.csv")
    assert table["time"][-1] == 1.0
    assert np.abs(table["gap"]).max() < 1e-12 * table["work"].max()
    assert {"tip.u_x", "tip.u_y"} <= table.keys()
    assert read_film(folder / "run.pvd").times == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])


def test_options_go_before_the_file(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ["--until", "0.5", "--step", "0.1", "--scheme", "implicit-euler", "--every", "0.1", "--output", "new/a"]
    assert main(["march", "timed.toml", *options, "--json", "a.json", "--plot", "a.png", "-q"]) == 0
    assert "5 steps" in capsys.readouterr().out
    assert sorted(p.name for p in (folder / "new").iterdir()) == ["a", "a.ckpt", "a.csv", "a.pvd", "a_contact.pvd"]
    assert len(read_film(folder / "new" / "a.pvd").times) == 6
    assert (folder / "a.json").exists()
    assert (folder / "a.png").exists()
    assert not (folder / "run.csv").exists()


def test_a_static_file_says_what_it_needs(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["march", "static.toml", "--until", "1"]) == 2
    assert "[time] with until and step, or give --until and --step" in capsys.readouterr().err
    assert main(["march", "static.toml", "--until", "1", "--step", "0.25", "--table", "s.csv"]) == 0
    assert read_history_table(folder / "s.csv")["time"].tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert main(["march", "static.toml", "--until", "1", "--adaptive", "1e-3", "-q"]) == 0


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--until", "-1"], "let it end later"),
        (["--until", "nan"], "--until is nan"),
        (["--step", "0"], "--step is 0; it must be a positive number"),
        (["--step", "7"], "longer than the whole"),
        (["--adaptive", "-1"], "--adaptive is -1"),
        (["--every", "0"], "--every is 0"),
        (["--scheme", "newmrk"], "did you mean 'newmark'"),
        (["--scheme", "sdirk2"], "for bodies without mass"),
        (["--control", "disipation"], "give 'dissipation', or"),
        (["--control", "slip:bottom"], "give 'dissipation', or"),
        (["--jump", "globl"], "did you mean 'global'"),
        (["--max-time", "0"], "--max-time is 0"),
        (["--rtol", "1"], "--rtol is 1"),
        (["--resume"], "--resume needs a checkpoint; name it by --checkpoint"),
        (["--minutes", "1"], "--minutes goes with a checkpoint"),
        (["--minutes", "-1", "--checkpoint", "a.ckpt"], "--minutes is -1"),
        (["--fields", "a.vtk"], "the name must end in .pvd"),
        (["--table", "a.txt"], "the name must end in .csv or .parquet"),
        (["--animation", "a.avi"], "the name must end in .gif or .mp4"),
        (["--checkpoint", "run.csv"], "run.csv: this is --table already"),
        (["--table", "timed.toml/a.csv"], "is not a folder"),
    ],
)
def test_bad_options(options: list[str], says: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["march", "timed.toml", *options]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
    assert not (folder / "run.pvd").exists()


def test_a_checkpoint_of_another_problem_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["--until", "0.5", "--step", "0.1", "--checkpoint", "a.ckpt", "-q"]
    assert main(["march", "static.toml", *arguments]) == 0
    (folder / "other.toml").write_text(STATIC.replace("-0.8", "-0.9"))
    assert main(["march", "other.toml", *arguments, "--resume"]) == 2
    assert "belongs to another evolution" in capsys.readouterr().err


def test_resumed_is_the_same(folder: Path) -> None:
    """A march in two parts leaves the files of one."""
    whole = ["march", "timed.toml", "--checkpoint", "a.ckpt", "--minutes", "0", "-q"]
    assert main(whole) == 0
    files = {path: path.read_bytes() for path in [folder / "run.csv", *folder.glob("run*.pvd"), *folder.glob("run/*")]}
    for path in (*files, folder / "a.ckpt"):
        path.unlink()
    assert main([*whole, "--max-time", "0.02"]) in (0, 1)
    assert main([*whole, "--resume"]) == 0
    for path, data in files.items():
        assert path.read_bytes() == data, path


def test_ctrl_c_ends_after_the_step_with_everything_written(folder: Path) -> None:
    (folder / "long.toml").write_text(
        (STATIC + TIMED).replace("[4, 2]", "[16, 8]").replace("until = 1.0", "until = 1000.0")
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "hemivar", "march", "long.toml", "--checkpoint", "a.ckpt"],
        env={**os.environ, "PYTHONPATH": str(Path(cli.__file__).parents[2])},
        cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),  # ignored by what runs in the back
    )  # fmt: skip
    assert process.stdout is not None
    while process.stdout.readline().split()[:1] != ["1"]:
        assert process.poll() is None
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, err) == (130, "hemivar: interrupted\n")
    assert "interrupted at t = " in out
    table = read_history_table(folder / "run.csv")
    assert len(table["time"]) > 1
    assert read_film(folder / "run.pvd").times[-1] == table["time"][-1]
    assert (folder / "a.ckpt").exists()


def test_what_is_refused_on_the_way_leaves_what_was_computed(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A load that is no number from t = 0.52 on: table, frames and checkpoint end at 0.5, one line says why."""
    (folder / "timed.toml").write_text((STATIC + TIMED).replace("body = [0.3,", 'body = ["sqrt(0.52 - t + 0*x)",'))
    assert main(["march", "timed.toml", "--checkpoint", "a.ckpt"]) == 2
    out, err = capsys.readouterr()
    assert "refused at t = 0.5 after 10 steps" in out
    assert err.startswith(
        "hemivar: error: timed.toml: after t = 0.5: [loads] body: formula 'sqrt(0.52 - t + 0*x)' is nan"
    )
    assert err.count("\n") == 1
    assert read_history_table(folder / "run.csv")["time"][-1] == pytest.approx(0.5)
    assert read_film(folder / "run.pvd").times == pytest.approx([0.0, 0.25, 0.5])
    assert main(["march", "timed.toml", "--checkpoint", "a.ckpt", "--resume"]) == 2
    notes = [line for line in capsys.readouterr().out.splitlines() if line.startswith("note  ")]
    assert len([note for note in notes if "beyond small strains" not in note]) == 1


def test_a_refusal_before_the_first_step_prints_no_table(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ("contact.bottom.gap=-0.1", 'contact.bottom.normal="signorini"', "supports.left={ x = 0.0 }")
    overlapping = [word for change in given for word in ("--set", change)]
    for arguments, says in ((["--until", "-1"], "let it end later"), (overlapping, "beyond what its law allows")):
        assert main(["march", "timed.toml", *arguments]) == 2
        out, err = capsys.readouterr()
        assert "residual" not in out
        assert says in err
        assert err.count("\n") == 1


def test_a_march_outlives_a_checkpoint_that_cannot_be_written(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A disk that is full from the third step on takes the checkpoint, and not the march."""
    writes = []

    def write(self: Checkpoint, *_: object) -> None:
        writes.append(self.file)
        if len(writes) > 2:
            raise FileError(f"cannot write {self.file}: no space left on device")

    monkeypatch.setattr(Checkpoint, "write", write)
    assert main(["march", "timed.toml", "--checkpoint", "a.ckpt", "--minutes", "0"]) == 2
    out, err = capsys.readouterr()
    assert len(writes) == 21  # of 20 steps, and of the end
    assert out.count("cannot write a.ckpt: no space left on device") == 1
    assert "finished at t = 1 after 20 steps" in out
    assert err == "hemivar: error: --checkpoint: cannot write a.ckpt: no space left on device\n"
    assert len(read_history_table(folder / "run.csv")["time"]) == 21


def test_frames_that_were_begun_by_a_march_that_was_killed_are_removed(folder: Path) -> None:
    (folder / "run").mkdir()
    begun = [folder / "run" / f".run_000005{part}-0123456789ab.vtu" for part in ("", "_contact")]
    other = folder / "run" / ".notes-0123456789ab.vtu"
    for path in (*begun, other):
        path.touch()
    assert main(["march", "timed.toml", "-q"]) == 0
    assert [path.exists() for path in (*begun, other)] == [False, False, True]


def test_antiplane_friction_in_time_has_frames(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its contact points have two components, and yet no file of their own."""
    (folder / "sheared.toml").write_text(
        'kind = "antiplane"\n[mesh]\nrectangle = [1.0, 1.0]\ncells = [4, 4]\n[material]\nshear_modulus = 2.0\n'
        '[supports]\ntop = "0.1*t"\n[contact.bottom]\nfriction = { law = "tresca", bound = 0.05 }\n'
        "[time]\nuntil = 1.0\nstep = 0.5\n"
    )
    assert main(["march", "sheared.toml", "--output", "a", "-q"]) == 0
    assert "written           a.csv, a.pvd\n" in capsys.readouterr().out
    assert len(read_film(folder / "a.pvd").times) == 3
    assert not (folder / "a_contact.pvd").exists()


def test_what_was_put_in_is_told_whole(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is stored at the start and what thermal stress does are part of the balance."""
    heated = "[heat]\nconductivity = 1.0\ncapacity = 1.0\nthermal_stress = 0.5\ntemperature = 1.0\n"
    start = "initial = { velocity = [0.0, 0.5] }\n[output]"
    (folder / "timed.toml").write_text(STATIC + heated + TIMED.replace("[output]", start))
    assert main(["march", "timed.toml", "-q", "--scheme", "implicit-euler"]) == 0
    lines = {line[:18].strip(): line[18:] for line in capsys.readouterr().out.splitlines()}
    put, stored, lost = (
        sum(float(word) for word in re.findall(r"-?\d[\d.e-]*", lines[name]))
        for name in ("external work", "stored", "dissipated")
    )
    assert "by thermal stress" in lines["external work"]
    assert "at the start" in lines["external work"]
    assert put == pytest.approx(stored + lost, rel=1e-4)


def test_columns_that_are_infinite_are_listed_so(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A margin of -inf is the least there is; nan was not looked for."""
    (folder / "a.csv").write_text(
        "time,step,margin,largest_step\n0,0,nan,nan\n1,1,-inf,nan\n2,1,0.5,inf\n3,1,0.7,nan\n"
    )
    assert main(["history", "a.csv"]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["margin", "-inf", "0.7", "0.7"] in rows
    assert ["largest_step", "inf", "inf"] in rows


def test_history(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["march", "timed.toml", "-q"]) == 0
    capsys.readouterr()
    assert main(["history", "run.csv", "--columns", "normal_force,tip.u_y"]) == 0
    out = capsys.readouterr().out
    assert "rows              21, t = 0 to 1" in out
    assert "tip.u_y" in out
    assert "residual" not in out
    for kind in ("ledger", "forces", "loop", "steps"):
        assert main(["history", "run.csv", "--plot", f"{kind}.png", "--kind", kind]) == 0
        assert (folder / f"{kind}.png").stat().st_size > 3000
    assert main(["history", "run.csv", "--plot", "c.svg", "--columns", "tip.u_x,kinetic"]) == 0
    for arguments, says in (
        (["--kind", "map", "--plot", "m.png"], "--kind map: it is not known"),
        (["--columns", "tip.u_z"], "did you mean 'tip.u_"),
        (["--plot", "run.csv"], "the name must end in"),
        (["--plot", "f.png", "--kind", "forces", "--columns", "kinetic"], "--columns goes with --kind columns or loop"),
    ):
        assert main(["history", "run.csv", *arguments]) == 2
        assert says in capsys.readouterr().err


def test_animate(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from PIL import Image

    assert main(["march", "timed.toml", "-q"]) == 0
    assert main(["animate", "run.pvd", "-o", "a.gif", "--dpi", "40"]) == 0
    assert main(["animate", "timed.toml", "-o", "b.gif", "--dpi", "40", "-q"]) == 0
    for name in ("a.gif", "b.gif"):
        with Image.open(folder / name) as film:
            assert film.n_frames == 5  # type: ignore[attr-defined]
    capsys.readouterr()
    for arguments, says in (
        (["run.pvd", "-o", "a.png"], "films are written as .gif or .mp4"),
        (["run.pvd", "-o", "a.gif", "--until", "2"], "go with a problem file"),
        (["nothing.pvd", "-o", "a.gif"], "no such file"),
        (["static.toml", "-o", "a.gif"], "it has no time"),
    ):
        assert main(["animate", *arguments]) == 2
        assert says in capsys.readouterr().err
