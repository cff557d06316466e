"""Scalar problems in time: what they refuse, restarts, files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.evolution import march
from hemivar.files.history_table import read_history_table
from hemivar.files.problem_file import parse_problem_file
from hemivar.workflows.marching import evolution_of

FILE = """\
kind = "heat"
[mesh]
rectangle = [1, 1]
cells = 4
[material]
conductivity = 0.5
capacity = "1 + x"
[loads]
source = "sin(t)"
flux = { right = "t*y" }
[supports]
left = "0.1*t"
[contact.bottom]
normal = { law = "compliance", stiffness = 2.0 }
level = "0.2*t"
[time]
until = 0.5
step = 0.1
initial = { temperature = "0.3*x" }
[output]
every = 0.1
probes = { corner = [1.0, 1.0] }
"""


def test_the_command_marches_a_file(tmp_path: Path) -> None:
    (tmp_path / "heat.toml").write_text(FILE)
    command = [sys.executable, "-m", "hemivar", "march", "heat.toml", "--table", "heat.csv", "--fields", "heat.pvd"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    history = march(
        evolution_of(parse_problem_file(FILE)), 0.5, step=0.1, save=hv.evolution.Save(probes={"corner": (1.0, 1.0)})
    )
    column = read_history_table(tmp_path / "heat.csv")["corner.u"]
    assert np.array_equal(column, history["corner.u"])
    assert (tmp_path / "heat.pvd").exists()
