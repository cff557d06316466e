"""Supports of points, and springs, in problem files: read, written and read again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.files.problem_file import parse_problem
from hemivar.mechanics import RigidPlate, Spring
from tests.fem.test_point_supports import MSH

HEAD = """
mesh = { rectangle = [2.0, 1.0], cells = [4, 2] }
material = { young = 10.0, poisson = 0.3 }
loads.traction.top = [0.1, -0.2]
"""

STATED = {
    "pin = { at = [0.0, 0.0] }": {"pin": hv.Clamped(at=(0.0, 0.0))},
    "pin = { at = [0.0, 0.0], x = 0.0 }\nleft = { y = 0.0 }": {
        "pin": hv.Fixed(x=0.0, at=(0.0, 0.0)), "left": hv.Fixed(y=0.0),
    },
    "pin = { at = [[0, 0], [2, 0]], displacement = [0.1, 0.0] }": {
        "pin": hv.Prescribed((0.1, 0.0), at=[(0.0, 0.0), (2.0, 0.0)])
    },
    "bottom = { normal = 2.0, tangential = 3.0 }": {"bottom": Spring(2.0, 3.0)},
    "top = { rigid = true, force = [0.0, -2.0], moment = 0.5, about = [1.0, 1.0], x = 0.0 }": {
        "top": RigidPlate(force=(0.0, -2.0), moment=0.5, about=(1.0, 1.0), x=0.0)
    },
    "bottom = 'clamped'\npin = { at = [1.0, 1.0], normal = 2.0, direction = [0.0, 1.0] }": {
        "bottom": hv.Clamped(), "pin": Spring(2.0, direction=(0.0, 1.0), at=(1.0, 1.0)),
    },
}  # fmt: skip


@pytest.mark.parametrize("text", STATED)
def test_files_state_what_python_does(text: str, tmp_path: Path) -> None:
    read = parse_problem(f"{HEAD}[supports]\n{text}\n")
    assert dict(read.supports) == STATED[text]
    hv.write_problem(read, tmp_path / "again.toml")
    assert dict(hv.read_problem(tmp_path / "again.toml").supports) == STATED[text]


def test_a_formula_of_a_spring_is_kept(tmp_path: Path) -> None:
    read = parse_problem(f"{HEAD}[supports]\nbottom = {{ normal = '1 + x', tangential = 1.0 }}\n")
    hv.write_problem(read, tmp_path / "again.toml")
    again = hv.solve(hv.read_problem(tmp_path / "again.toml")).displacement
    assert np.array_equal(again, hv.solve(read).displacement)


def test_a_plate_in_space_that_follows_the_time(tmp_path: Path) -> None:
    text = """
mesh = { box = [1.0, 1.0, 1.0], cells = [1, 1, 1] }
material = { young = 10.0, poisson = 0.0 }
supports.bottom = "clamped"
supports.top = { rigid = true, moment = [0.0, "-t", 0.0], turn_z = 0.0 }
time = { until = 1.0, step = 0.5 }
"""
    read = parse_problem(text)
    hv.write_problem(read, tmp_path / "again.toml")
    for problem in (read, hv.read_problem(tmp_path / "again.toml")):
        plate = hv.solve(problem.at_time(1.0)).plates["top"]
        assert plate["moment_y"] == pytest.approx(-1.0)
        assert plate["turn_z"] == pytest.approx(0.0, abs=1e-12)
        assert plate["turn_y"] < 0.0


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("pin = { at = [0.0] }", r"pin\.at: .*a list of 2 numbers"),
        ("pin = { at = [[0.0], [1.0]] }", "a list of points of 2 numbers each"),
        ("pin = { x = 0.0 }", "the mesh has no boundary 'pin'"),
        ("left = { at = [0.0, 0.0] }", "'left' is a boundary"),
        ("pin = { at = [0.0, 0.0], x = 0.0, normal = 1.0 }", r"pin\.normal: is of a spring; remove x"),
        ("left = { x = 0.0, displacement = [0.0, 0.0] }", "fixes every direction; remove the single ones"),
        ("left = { normal = -1.0 }", "-1"),
        ("pin = { at = [0.0, 0.0], normal = 1.0 }", "pin: a Spring at a point has no normal"),
        ("top = { rigid = false, force = [0.0, 1.0] }", "is true of a plate"),
        ("top = { rigid = true, force = [0.0] }", "force"),
        ("top = { rigid = true, z = 0.0 }", "prescribes z"),
        ("top = { rigid = true, normal = 1.0 }", "unknown key"),
        ("left = { normal = '1 + t' }", "cannot change with time"),
    ],
)
def test_bad_supports_are_refused_with_their_place(text: str, says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        parse_problem(f"{HEAD}[supports]\n{text}\n")


def test_supports_of_sets_of_nodes_are_written_by_their_names(tmp_path: Path) -> None:
    (tmp_path / "body.msh").write_text(MSH)
    supports = {"pin": hv.Clamped(), "right": hv.Fixed(x=0.0)}
    named = hv.ContactProblem(hv.read_mesh(tmp_path / "body.msh"), hv.Material.young(10.0, 0.3), {}, supports)
    hv.write_problem(replace(named, body_force=(1.0, -1.0)), tmp_path / "problem.toml")
    assert hv.read_problem(tmp_path / "problem.toml").supports == supports


def test_motions_of_a_plate_are_in_the_record() -> None:
    plate = RigidPlate(force=(0.0, -0.4))
    supports = {"bottom": "clamped", "top": plate}
    solution = hv.solve(hv.ContactProblem(hv.rectangle(cells=2), hv.Material.young(10.0, 0.3), {}, supports))
    assert solution.to_dict()["plates"]["top"] == solution.plates["top"]
