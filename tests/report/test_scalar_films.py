"""Scalar problems in time: what they refuse, restarts, files."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Evolution, march
from hemivar.files.problem_file import parse_problem_file
from hemivar.workflows.marching import evolution_of
from tests.cli.test_scalar_march import FILE
from tests.evolution.test_scalar_evolution import membrane


def test_frames_are_read_back(tmp_path: Path) -> None:
    history = march(evolution_of(parse_problem_file(FILE)), 0.5, step=0.1)
    history.write(tmp_path / "heat.pvd")
    assert not (tmp_path / "heat_contact.pvd").exists()
    last = meshio.read(sorted((tmp_path / "heat").iterdir())[-1])
    np.testing.assert_allclose(last.point_data["temperature"], history.frames[-1].displacement[:, 0])
    assert "velocity" not in last.point_data
    # the stated gap is that of the time of the frame
    at = last.point_data["boundary"] == 0
    np.testing.assert_allclose(last.point_data["initial_gap"][at], 0.2 * 0.5)
    np.testing.assert_allclose(last.point_data["gap"][at], -last.point_data["penetration"][at])
    np.testing.assert_allclose(last.point_data["penetration"][at], last.point_data["temperature"][at] - 0.1, atol=1e-14)
    with pytest.raises(hv.errors.ProblemError, match="films show bodies that deform"):
        history.animate(tmp_path / "heat.gif")
    ringing = march(Evolution(membrane(source=1.0), inertia=True), 0.1, step=0.05)
    ringing.write(tmp_path / "membrane.pvd")
    last = meshio.read(sorted((tmp_path / "membrane").iterdir())[-1])
    np.testing.assert_allclose(last.point_data["velocity"], ringing.frames[-1].velocity[:, 0])
    np.testing.assert_allclose(last.point_data["displacement"][:, 2], last.point_data["deflection"])
