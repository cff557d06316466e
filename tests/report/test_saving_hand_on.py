"""A solution hands itself on to files and figures."""

from __future__ import annotations

import json
from pathlib import Path

import meshio
import numpy as np
import pytest

from hemivar.files import read_solution, solution_record
from hemivar.files.record import read_json
from hemivar.solvers import Solution

from .test_picture_figures import texts


def test_dictionary_and_json(plane: Solution, tmp_path: Path) -> None:
    record = plane.to_dict()
    assert record == solution_record(plane)
    assert json.loads(json.dumps(record)) == record
    path = plane.to_json(tmp_path / "new" / "plane.json")
    assert read_json(path) == record
    unknowns, multiplier = read_solution(path, plane.problem)
    np.testing.assert_allclose(unknowns, plane.unknowns, atol=1e-15)
    np.testing.assert_array_equal(multiplier, plane.multiplier)


def test_record_has_forces_and_reactions_by_name(plane: Solution, bar: Solution) -> None:
    record = plane.to_dict()
    assert record["reactions"] == {name: force.tolist() for name, force in plane.reactions.items()}
    bottom = plane.on("bottom")
    assert record["boundaries"] == {
        "bottom": {
            "normal_force": bottom.normal_force,
            "force": bottom.force.tolist(),
            "contact_length": plane.contact_length,
        }
    }
    assert record["boundaries"]["bottom"]["force"] == pytest.approx(record["resultants"]["force"])
    assert bar.to_dict()["reactions"] is None
    assert bar.to_dict()["boundaries"] == {}


def test_vtu(plane: Solution, tmp_path: Path) -> None:
    path = plane.to_vtu(tmp_path / "plane.vtu")
    np.testing.assert_array_equal(meshio.read(path).point_data["displacement"][:, :2], plane.displacement)
    assert (tmp_path / "plane_contact.vtu").is_file()


def test_plot(plane: Solution, bar: Solution) -> None:
    figure = plane.plot(scale=2.0, title="A title", unit="mm")
    for words in ("A title", "x (mm)", "displacement times 2"):
        assert words in texts(figure)
    assert "contact point" in texts(bar.plot())
