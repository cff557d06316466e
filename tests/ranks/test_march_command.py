"""``hemivar march --engine petsc`` under mpirun: the files of the serial command."""

from __future__ import annotations

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hemivar.cli import main
from hemivar.files.film import read_film
from hemivar.files.history_table import read_history_table
from tests.ranks.running import environment, mpirun

pytest.importorskip("petsc4py")
pytest.importorskip("mpi4py")
if shutil.which("mpirun") is None:
    pytest.skip("mpirun is not installed", allow_module_level=True)

pytestmark = pytest.mark.mpi

_BLOCK = """\
title = "block"
[mesh]
rectangle = [2.0, 1.0]
cells = [{cells}]
[material]
lame = [4.0, 4.0]
{material}
[loads]
body = ["0.6 * sin(6 * t)", "-0.8 * t - 0.4"]
[supports]
left = "clamped"
[contact.bottom]
normal = {{ law = "compliance", stiffness = 20.0 }}
friction = {{ law = "tresca", bound = 0.05 }}
[contact.right]
normal = {{ law = "compliance", stiffness = 5.0 }}
gap = 0.01
[time]
until = {until}
scheme = {scheme}
step = {step}
inertia = {inertia}
[output]
every = 0.2
fields = "run.pvd"
table = "run.csv"
probes = {{ tip = [2.0, 1.0] }}
"""
_EULER = '{ name = "implicit-euler" }'
_VISCOUS = "viscosity = [0.2, 0.2]"


def _file(
    material: str = "", scheme: str = _EULER, inertia: str = "false", until: float = 1.0, step: Any = 0.1,
    cells: str = "8, 4",
) -> str:  # fmt: skip
    return _BLOCK.format(material=material, scheme=scheme, inertia=inertia, until=until, step=step, cells=cells)


FILES = {
    "quasistatic": _file(),
    "Kelvin-Voigt": _file(_VISCOUS + "\nbranches = [{ lame = [2.0, 1.0], time = 0.3 }]"),
    "dynamic, implicit Euler": _file(_VISCOUS + "\ndensity = 1.0", inertia="true"),
    "dynamic, generalised-alpha": _file(
        _VISCOUS + "\ndensity = 1.0", '{ name = "generalized-alpha", rho = 0.8 }', "true", step=0.05
    ),
}
RTOL = ("--rtol", "1e-12")


def _march(ranks: int, *options: str | Path) -> subprocess.CompletedProcess[str]:
    return mpirun(ranks, "-m", "hemivar", "march", *options, "--engine", "petsc", limit=300.0)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@cache
def _grid(path: Path) -> tuple[np.ndarray[Any, Any], dict[str, np.ndarray[Any, Any]]]:
    """Nodes in an order of their own and what is known there, of a file or of all its pieces, each node once."""
    import meshio

    files = [path]
    if path.suffix == ".pvtu":
        files = [path.parent / piece.attrib["Source"] for piece in ElementTree.parse(path).getroot().iter("Piece")]
    with contextlib.redirect_stdout(sys.stderr):
        parts = [meshio.vtu.read(file) for file in files]
    points = np.round(np.concatenate([part.points for part in parts]), 10) + 0.0
    points, first = np.unique(points, axis=0, return_index=True)
    data = {name: np.concatenate([part.point_data[name] for part in parts])[first] for name in parts[0].point_data}
    return points, data


def _times_and_files(pvd: Path) -> list[tuple[float, Path]]:
    entries = ElementTree.parse(pvd).getroot().iter("DataSet")
    return [(float(entry.attrib["timestep"]), pvd.parent / entry.attrib["file"]) for entry in entries]


@pytest.mark.parametrize(("name", "ranks"), [*((name, 2) for name in FILES), ("dynamic, generalised-alpha", 3)])
def test_table_and_frames_are_those_of_the_serial_command(name: str, ranks: int, folder: Path) -> None:
    for place in ("serial", "ranks"):
        (folder / place).mkdir()
        (folder / place / "p.toml").write_text(FILES[name])
    os.chdir(folder / "serial")
    assert main(["march", "p.toml", "-q", *RTOL, "--json", "r.json"]) == 0
    os.chdir(folder / "ranks")
    done = _march(ranks, "p.toml", *RTOL, "--json", "r.json", "--plot", "p.png")
    assert done.returncode == 0, done.stderr
    assert "finished at t = 1" in done.stdout
    assert "run.csv, r.json, run.pvd, run_contact.pvd, p.png" in done.stdout
    assert (folder / "ranks" / "p.png").stat().st_size > 3000
    ours, theirs = (read_history_table(folder / place / "run.csv") for place in ("ranks", "serial"))
    assert list(ours) == list(theirs)
    energies = ["elastic", "kinetic", "contact", "friction", "viscous", "branch_loss", "work"]
    energy = max(float(np.abs(theirs[column]).max()) for column in energies)
    ledger = {*energies, "branches", "moved", "damping", "memory", "numerical", "jumps", "start", "gap"}
    for column, wanted in theirs.items():
        if column in ("residual", "solver_steps", "time_error", "largest_step"):
            continue
        size = energy if column in ledger else float(np.nanmax(np.abs(wanted), initial=0.0))
        np.testing.assert_allclose(ours[column], wanted, rtol=0.0, atol=1e-9 * size, err_msg=column)
    for key in ("ended", "events", "messages"):
        told = [json.loads((folder / place / "r.json").read_text())[key] for place in ("ranks", "serial")]
        assert told[0] == told[1]
    for pvd in ("run.pvd", "run_contact.pvd"):
        wanted_frames = _times_and_files(folder / "serial" / pvd)
        found_frames = _times_and_files(folder / "ranks" / pvd)
        assert [time for time, _ in found_frames] == [time for time, _ in wanted_frames]
        assert len(found_frames) == 6
        for (_, one), (_, other) in zip(found_frames, wanted_frames, strict=True):
            (points, data), (wanted_points, wanted_data) = _grid(one), _grid(other)
            np.testing.assert_allclose(points, wanted_points, atol=1e-12)
            assert set(data) == set(wanted_data)
            for what, values in wanted_data.items():
                size = float(np.abs(values).max())
                np.testing.assert_allclose(data[what], values, rtol=0.0, atol=1e-9 * size, err_msg=what)
    film, wanted_film = read_film(folder / "ranks" / "run.pvd"), read_film(folder / "serial" / "run.pvd")
    assert film.points.shape == wanted_film.points.shape
    assert len(film.cells) == len(wanted_film.cells)
    assert np.abs(film.frame(5).displacement).max() == pytest.approx(np.abs(wanted_film.frame(5).displacement).max())


def test_a_step_that_the_balance_of_energy_has_to_allow_on_one_rank(folder: Path) -> None:
    """On one rank the balance of each step is measured by the rounding of its body, whose matrix is in PETSc."""
    file = Path(__file__).parents[2] / "examples" / "problems" / "stick_slip.toml"
    assert main(["march", str(file), "-q", "--until", "0.6", "--table", "serial.csv"]) == 0
    done = _march(1, file, "--until", "0.6", "--table", "ranks.csv")
    assert done.returncode == 0, done.stderr
    ours, theirs = (read_history_table(folder / name) for name in ("ranks.csv", "serial.csv"))
    for column in ("elastic", "kinetic", "friction"):
        np.testing.assert_allclose(ours[column], theirs[column], rtol=0.0, atol=1e-6 * np.abs(theirs[column]).max())


def test_the_states_change(folder: Path) -> None:
    """What the comparison is there for: points that are open, stick and slip, on two boundaries."""
    (folder / "p.toml").write_text(FILES["dynamic, generalised-alpha"])
    assert main(["march", "p.toml", "-q", *RTOL]) == 0
    seen = [_grid(file)[1] for _, file in _times_and_files(folder / "run_contact.pvd")]
    assert {0, 1, 2} <= {int(state) for data in seen for state in data["state"]}
    assert any((data["pressure"][data["boundary"] == 1] > 0.0).any() for data in seen)


def _made(folder: Path) -> dict[str, bytes]:
    files = [folder / "run.csv", *folder.glob("run*.pvd"), *folder.glob("run/*")]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def test_a_signal_ends_it_after_the_step_and_it_goes_on_bit_for_bit(folder: Path) -> None:
    text = _file(_VISCOUS + "\ndensity = 1.0", '{ name = "generalized-alpha", rho = 0.8 }', "true", 1.0, 0.02)
    text = text.replace("every = 0.2", "every = 1.0")  # wherever it is interrupted, it leaves a frame of its own
    for place in ("whole", "parts"):
        (folder / place).mkdir()
        (folder / place / "p.toml").write_text(text)
    options = ["p.toml", "--checkpoint", "a.ckpt", "--minutes", "0"]
    os.chdir(folder / "whole")
    assert _march(2, *options).returncode == 0
    os.chdir(folder / "parts")
    run = subprocess.Popen(
        ["mpirun", "-n", "2", sys.executable, "-m", "hemivar", "march", *options, "--engine", "petsc"],
        env=environment(), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert run.stdout is not None
    while not (words := run.stdout.readline().split()) or not words[0].isdigit() or int(words[0]) < 10:
        assert run.poll() is None
    run.send_signal(signal.SIGUSR1)
    out, err = run.communicate(timeout=120)
    assert run.returncode == 130, err
    assert "interrupted at t = " in out
    assert "hemivar: interrupted" in err
    assert 10 < len(read_history_table(folder / "parts" / "run.csv")["time"]) < 51
    assert set(_made(folder / "parts")) - set(_made(folder / "whole"))
    done = _march(2, *options, "--resume", "-q")
    assert done.returncode == 0, done.stderr
    assert _made(folder / "parts") == _made(folder / "whole")
    other = _march(3, *options, "--resume")
    assert other.returncode == 2
    assert "was written on 2 ranks, these are 3" in other.stderr


def test_a_film_of_the_frames(folder: Path) -> None:
    from PIL import Image

    (folder / "p.toml").write_text(FILES["quasistatic"].replace('table = "run.csv"', 'animation = "run.gif"'))
    done = _march(2, "p.toml", "--step", "0.2", "-q")
    assert done.returncode == 0, done.stderr
    assert "run.pvd, run_contact.pvd, run.gif" in done.stdout
    with Image.open(folder / "run.gif") as film:
        assert film.n_frames == 6  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--fields", "a.xdmf"], "the name must end in .pvd"),
        (["--animation", "a.gif"], "write --fields run.pvd as well"),
        (["--jump", "global"], "does not have jump = 'global'"),
        (["--jump", "globl"], "did you mean 'global'"),
        (["--step", "7"], "longer than the whole"),
        (["--minutes", "1"], "--minutes goes with a checkpoint"),
        (["--resume"], "--resume needs a checkpoint"),
        (["--scheme", "sdirk2"], "for bodies without mass"),
        (["--table", "a.txt"], "the name must end in .csv or .parquet"),
        (["--table", "p.toml"], "the name must end in"),
        (["--checkpoint", "none/a.ckpt"], "does not exist; make it first"),
    ],
)
def test_bad_options(options: list[str], says: str, folder: Path) -> None:
    text = FILES["dynamic, implicit Euler"].replace('fields = "run.pvd"\ntable = "run.csv"\n', "")
    (folder / "p.toml").write_text(text)
    done = _march(2, "p.toml", *options)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("hemivar: error: ") == 1
    assert sorted(path.name for path in folder.iterdir()) == ["p.toml"]


def test_heat_is_refused(folder: Path) -> None:
    (folder / "p.toml").write_text(FILES["Kelvin-Voigt"] + "[heat]\nconductivity = 1.0\ncapacity = 1.0\n")
    done = _march(2, "p.toml")
    assert done.returncode == 2
    assert "p.toml: the engine 'petsc' has no heat coupling" in done.stderr
    assert not (folder / "run.csv").exists()


def test_friction_that_may_follow_the_slip_or_its_rate_is_refused(folder: Path) -> None:
    text = FILES["quasistatic"].replace('law = "tresca", bound = 0.05', 'law = "slip-weakening", bound = 0.05')
    (folder / "p.toml").write_text(text)
    done = _march(2, "p.toml")
    assert done.returncode == 2
    assert done.stderr.count("hemivar: error: ") == 1
    assert "say of = 'slip', as in statics, or of = 'rate'" in done.stderr
    assert not (folder / "run.csv").exists()
