"""Meshes of several parts, and curves and surfaces inside a body that are opened."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files import read_problem_file
from hemivar.files.changes import read_change
from hemivar.mesh.write import msh_text
from tests.mesh.test_parts_and_openings import between

FILE = """
[mesh]
refine = 1
{opened}
[mesh.upper]
rectangle = [1.0, 1.0]
cells = [4, 4]
turn = 30
shift = [0.5, 1.2]
[mesh.lower]
file = "lower.msh"
scale = 2.0
[material.regions.upper]
young = 10.0
poisson = 0.3
[material.regions."lower:steel"]
young = 200.0
poisson = 0.3
[material.regions."lower:rubber"]
young = 20.0
poisson = 0.3
[supports]
"lower:bottom" = "clamped"
"upper:bottom" = "clamped"
[loads]
body = [0.0, -0.1]
[contact."lower:top"]
normal = {{ law = "compliance", stiffness = 2.0 }}
"""


@pytest.mark.parametrize("opened", ["", 'opened = [{ name = "glue", between = ["lower:steel", "lower:rubber"] }]'])
def test_a_problem_file_states_parts(tmp_path: Path, opened: str) -> None:
    (tmp_path / "lower.msh").write_text(msh_text(between(hv.rectangle((1.0, 1.0), 4), 0.5)))
    file = tmp_path / "two.toml"
    text = FILE.format(opened=opened)
    file.write_text(text)
    stated = read_problem_file(file, changes=[read_change("contact.lower:top.normal.stiffness=3")])
    mesh = stated.problem.mesh
    assert mesh.parts.count == (3 if opened else 2)
    assert ("glue:lower:steel" in mesh.boundaries) == bool(opened)
    angle = np.radians(30.0)
    turned = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    own = (mesh.points[np.unique(mesh.cells[mesh.regions["upper"]])] - [0.5, 1.2]) @ turned
    assert own.min() == pytest.approx(0.0, abs=1e-12)
    assert own.max() == pytest.approx(1.0)
    again = hv.read_problem(hv.write_problem(stated.problem, tmp_path / "again.toml"))
    np.testing.assert_array_equal(again.mesh.points, mesh.points)
    np.testing.assert_array_equal(again.mesh.cells, mesh.cells)
    assert set(again.mesh.boundaries) == set(mesh.boundaries)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("mesh.cells=4", "belongs to one part, but the mesh has parts; write it under"),
        ("mesh.upper.order=2", "unknown key"),
        ("mesh.upper.shift=[1.0]", "give 2 numbers"),
        ("mesh.opened=3", "must be a list of names"),
        ("mesh.opened=[3]", "names no curve or surface"),
        ('mesh.opened=["glue"]', "the mesh has no interface 'glue'"),
        ("mesh.upper.rectangle=[1.0, -1.0]", "must be positive"),
    ],
)
def test_wrong_parts_of_a_file_are_refused(tmp_path: Path, change: str, message: str) -> None:
    (tmp_path / "lower.msh").write_text(msh_text(between(hv.rectangle((1.0, 1.0), 4), 0.5)))
    file = tmp_path / "two.toml"
    file.write_text(FILE.format(opened=""))
    with pytest.raises(ProblemError, match=message) as raised:
        read_problem_file(file, changes=[read_change(change)])
    assert "[mesh" in str(raised.value)
