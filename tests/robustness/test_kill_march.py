"""A march that is killed at random moments and goes on from its checkpoint leaves the files of one that never was."""

from __future__ import annotations

import random
import signal
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.robustness.test_kill import PROBLEM, Driver

MARCHED = (
    PROBLEM.replace("lame = [4.0, 4.0]", "lame = [4.0, 4.0]\ndensity = 1.0\nviscosity = [0.1, 0.1]")
    + """\
[time]
until = 1.0
scheme = { name = "generalized-alpha", rho = 0.8 }
step = { rtol = 2e-3, first = 0.02, max = 0.04 }
inertia = true
initial = { velocity = [0.0, -0.2] }
[output]
every = 0.1
fields = "run.pvd"
table = "run.csv"
probes = { tip = [1.0, 1.0] }
"""
)
COMMAND = ["march", "m.toml", "--checkpoint", "run.ckpt", "--minutes", "0", "--quiet"]


@pytest.fixture(scope="module")
def driver() -> Iterator[Driver]:
    one = Driver()
    yield one
    one.close()


def made(folder: Path) -> dict[str, bytes]:
    """What a march leaves for its user."""
    files = [folder / "run.csv", *folder.glob("run*.pvd"), *folder.glob("run/run*.vtu")]
    return {str(file.relative_to(folder)): file.read_bytes() for file in files}


def readable(folder: Path) -> None:
    """The lists name whole files, at whatever moment the process died."""
    for path in folder.glob("[!.]*.pvd"):  # hidden ones were not finished
        for entry in ElementTree.parse(path).getroot().iter("DataSet"):
            ElementTree.fromstring((folder / entry.attrib["file"]).read_bytes())


_SLOW = tuple(pytest.param(10, seed, marks=pytest.mark.slow) for seed in (2, 3))


@pytest.mark.parametrize(("kills", "seed"), [(2, 1), *_SLOW])
def test_a_killed_march_goes_on_as_if_nothing_had_been(kills: int, seed: int, driver: Driver, tmp_path: Path) -> None:
    folders = [tmp_path / name for name in ("whole", "killed")]
    for folder in folders:
        folder.mkdir()
        (folder / "m.toml").write_text(MARCHED)
    whole, killed = folders
    code, seconds = driver(whole, COMMAND)
    assert code == 0
    rng = random.Random(seed)
    died = 0
    for _ in range(kills):
        code, _ = driver(killed, [*COMMAND, "--resume"], after=rng.uniform(0.1, 1.5) * seconds / kills**0.5)
        died += code == -signal.SIGKILL
        readable(killed)
        if code == 0:  # begun anew: there is nothing left to kill
            for file in [killed / "run.ckpt", *(killed / name for name in made(killed))]:
                file.unlink()
    assert died
    assert driver(killed, [*COMMAND, "--resume"])[0] == 0
    assert made(killed) == made(whole)
