"""Rigid obstacles: distances and rays against brute force, contact normals, messages."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.files.problem_file import parse_problem
from hemivar.mechanics import Plane, Sphere
from hemivar.mechanics.obstacles import Obstacle
from hemivar.mesh import Mesh
from tests.mechanics.test_obstacles import square_over
from tests.mesh.meshes import cube

HEAD = """\
[mesh]
rectangle = [1.0, 1.0]
cells = [8, 8]
pattern = "cross"
[material]
young = 1.0
poisson = 0.3
[supports]
top = { displacement = [0.0, -0.02] }
[contact.bottom]
normal = "signorini"
"""


@pytest.mark.parametrize(
    ("text", "obstacle", "normals"),
    [
        ("obstacle = { sphere = { center = [0.5, -2.0], radius = 1.99 } }", Sphere((0.5, -2.0), 1.99), None),
        (
            'obstacle = { sphere = { center = [0.5, 3], radius = 3, inside = true } }\nnormals = "body"',
            Sphere((0.5, 3.0), 3.0, inside=True),
            "body",
        ),
        (
            'obstacle = { plane = { point = [0.5, 0.0], normal = [0.1, 1] } }\nnormals = "obstacle"',
            Plane((0.5, 0.0), (0.1, 1.0)),
            "obstacle",
        ),
        (
            'obstacle = { distance = "sqrt((x - 0.5)^2 + (y + 2)^2) - 1.99" }',
            Sphere((0.5, -2.0), 1.99),
            None,
        ),
    ],
)
def test_obstacles_in_problem_files(text: str, obstacle: Obstacle, normals: str | None) -> None:
    found = discretize(parse_problem(f"{HEAD}{text}\n"))
    expected = discretize(square_over(obstacle, normals))
    np.testing.assert_allclose(found.gap, expected.gap, atol=1e-12)
    np.testing.assert_allclose(found.contact.frames, expected.contact.frames, atol=1e-8)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("obstacle = { }", "[contact.bottom] obstacle: give one of"),
        ("obstacle = { spere = { radius = 1 } }", "did you mean 'sphere'?"),
        ("obstacle = { sphere = { center = [0, 0] } }", "obstacle.sphere.radius: is missing"),
        ("obstacle = { sphere = { center = [0, 0, 0], radius = 1 } }", "obstacle.sphere.center: has 3 entries"),
        ("obstacle = { sphere = { center = [0, 0], radius = -1 } }", "it must be positive"),
        ("obstacle = { sphere = { center = [0, 0], radius = 1, inside = 1 } }", "must be true or false"),
        ("obstacle = { cylinder = { point = [0, 0], axis = [0, 1], radius = 1 } }", "in the plane it is a circle"),
        ("obstacle = { plane = { point = [0, 0], normal = [0, 0] } }", "normal is zero"),
        ("obstacle = { distance = 3 }", "give a formula of the coordinates"),
        ("obstacle = { distance = 'x + q' }", "'q' is not known"),
        ("obstacle = { distance = 'y' }\ngap = 0.1", "[contact.bottom] gap: follows from the obstacle"),
        ("normals = 'body'", "[contact.bottom] normals: says whose normals"),
        ("obstacle = { distance = 'y' }\nnormals = 'bdy'", "did you mean 'body'?"),
    ],
)
def test_bad_obstacles_in_problem_files(text: str, words: str) -> None:
    with pytest.raises(ProblemError, match=re.escape(words)) as caught:
        parse_problem(f"{HEAD}{text}\n")
    assert "\n" not in str(caught.value)


def test_cylinder_in_a_problem_file(tmp_path: Path) -> None:
    import meshio

    mesh: Mesh = cube(2)
    bottom = mesh.boundaries["bottom"]
    cells = [("tetra", mesh.cells), ("triangle", bottom), ("triangle", mesh.boundaries["top"])]
    raw = meshio.Mesh(
        mesh.points,
        cells,
        cell_data={"gmsh:physical": [np.full(len(c), k) for k, (_, c) in enumerate(cells, 1)]}
        | {"gmsh:geometrical": [np.full(len(c), k) for k, (_, c) in enumerate(cells, 1)]},
        field_data={"body": np.array([1, 3]), "bottom": np.array([2, 2]), "top": np.array([3, 2])},
    )
    meshio.write(tmp_path / "cube.msh", raw, file_format="gmsh22", binary=False)
    found = discretize(
        parse_problem(
            '[mesh]\nfile = "cube.msh"\n[material]\nyoung = 1.0\npoisson = 0.3\n'
            "[supports]\ntop = { displacement = [0, 0, -0.02] }\n[contact.bottom]\nnormal = 'signorini'\n"
            "obstacle = { cylinder = { point = [0.5, 0.5, -2], axis = [0, 3, 0], radius = 1.99 } }\n",
            tmp_path,
        )
    )
    x = found.contact.points[:, 0] - 0.5
    np.testing.assert_allclose(found.gap, np.hypot(x, 2.0) - 1.99, atol=1e-14)
