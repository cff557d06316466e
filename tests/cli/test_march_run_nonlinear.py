"""Nonlinear bodies in time: against an integrator of an assembly of its own, and linear bodies written as energies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hemivar.cli import main
from hemivar.files.film import read_film
from hemivar.files.history_table import read_history_table


def test_the_command_marches_a_problem_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    file = Path(__file__).parents[2] / "examples" / "problems" / "creeping_layer.toml"
    assert main(["march", str(file), "--until", "0.3", "--every", "0.1", "--output", "a", "-q"]) == 0
    table = read_history_table("a.csv")
    assert np.abs(table["gap"]).max() < 1e-8 * table["moved"][-1]
    assert table["viscous"][-1] > 0.0
    assert read_film("a.pvd").times == pytest.approx([0.0, 0.1, 0.2, 0.3])
