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


TRIPOD = """
[mesh]
{refine}
[mesh.left]
file = "leg.msh"
scale = {scale}
[mesh.right]
file = "leg.msh"
scale = {scale}
mirror = "x"
boundaries = {{ foot = "z < {foot}" }}
[mesh.bar]
box = [{long}, {short}, {short}]
cells = [4, 1, 1]
turn = 90
axis = [0, 0, 2]
shift = [{short}, 0.0, 0.0]
[material]
young = {young}
poisson = 0.3
[supports]
"left:left" = "clamped"
"right:foot" = "clamped"
"bar:left" = "clamped"
[contact."left:right"]
normal = {{ law = "compliance", stiffness = 2.0 }}
"""


@pytest.mark.parametrize(("scale", "unit"), [("1.0", 1.0), ("1e-3", 1e-3)])
@pytest.mark.parametrize("refine", ["", 'mirror = "z"\nrefine = 1'])
def test_a_mesh_is_put_together_of_mirrored_and_turned_parts(
    scale: str, unit: float, refine: str, tmp_path: Path
) -> None:
    """A leg in millimetres and its mirror image, and a bar that is turned about z, in millimetres and metres."""
    leg = hv.box((10.0, 5.0, 20.0), (2, 1, 4), origin=(3.0, 0.0, 0.0))
    (tmp_path / "leg.msh").write_text(msh_text(leg))
    file = tmp_path / "tripod.toml"
    numbers = {"long": 40.0 * unit, "short": 5.0 * unit, "foot": 0.1 * unit, "young": 2e5 / unit**2}
    file.write_text(TRIPOD.format(scale=scale, refine=refine, **numbers))
    problem = hv.read_problem(file)
    mesh = problem.mesh
    sizes = {name: mesh.volumes[own].sum() / unit**3 for name, own in mesh.regions.items() if ":" not in name}
    assert sizes == pytest.approx({"left": 1000.0, "right": 1000.0, "bar": 1000.0})
    up = -1.0 if refine else 1.0

    def box_of(part: str) -> list[list[float]]:
        own = mesh.points[np.unique(mesh.cells[mesh.regions[part]])] / unit
        return [own.min(axis=0).tolist(), own.max(axis=0).tolist()]

    heights = sorted([0.0, up * 20.0])
    assert box_of("left") == [pytest.approx([3.0, 0.0, heights[0]]), pytest.approx([13.0, 5.0, heights[1]])]
    assert box_of("right") == [pytest.approx([-13.0, 0.0, heights[0]]), pytest.approx([-3.0, 5.0, heights[1]])]
    assert box_of("bar")[0][:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert box_of("bar")[1][:2] == pytest.approx([5.0, 40.0])
    # what was left stays so in name
    assert mesh.points[mesh.boundaries["right:left"]][..., 0] / unit == pytest.approx(-3.0)
    assert mesh.facet_normals(mesh.boundaries["right:left"])[0][:, 0] == pytest.approx(1.0)
    assert mesh.facet_normals(mesh.boundaries["right:foot"])[1].sum() / unit**2 == pytest.approx(50.0)
    again = hv.read_problem(hv.write_problem(problem, tmp_path / "again.toml"))
    np.testing.assert_array_equal(again.mesh.points, mesh.points)
    np.testing.assert_array_equal(again.mesh.cells, mesh.cells)
    assert again.mesh.recipe == mesh.recipe
    assert 'mirror = "x"' in (tmp_path / "again.toml").read_text()


def test_the_mirror_image_of_a_problem_has_the_mirror_image_of_its_solution(tmp_path: Path) -> None:
    """Both in one file, side by side; contact on the one side is contact on the other."""
    one, two = "rectangle = [2.0, 1.0]\ncells = [8, 4]\norigin = [1.0, 0.0]\n", 'mirror = "x"\n'
    tables = "".join(
        f'[contact."{part}:bottom"]\nnormal = {{ law = "compliance", stiffness = 2.0 }}\n' for part in ("a", "b")
    )
    file = tmp_path / "pair.toml"
    file.write_text(
        f"[mesh.a]\n{one}[mesh.b]\n{one}{two}[material]\nyoung = 5.0\npoisson = 0.3\n"
        f'[supports]\n"a:left" = "clamped"\n"b:left" = "clamped"\n[loads]\nbody = [0.0, -0.2]\n{tables}'
    )
    u = hv.solve(hv.read_problem(file)).displacement
    half = len(u) // 2
    np.testing.assert_allclose(u[half:], u[:half] * [-1.0, 1.0], atol=1e-9 * np.abs(u).max())
    assert np.abs(u).max() > 1e-2


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('mirror = "z"', r"\[mesh\] mirror: the mesh cannot be mirrored in 'z'; give one of x, y"),
        ('mirror = "w"', r"\[mesh\] mirror"),
        ("axis = [0, 0, 1]\nturn = 3", r"\[mesh\] axis: .* this mesh is 2D and has none: leave it out"),
        ("box = [1.0, 1.0, 1.0]\nturn = 3", r"\[mesh\] turn: .* this mesh is 3D and needs one, such as \(0, 0, 1\)"),
        (
            "box = [1.0, 1.0, 1.0]\naxis = [0, 0]\nturn = 3",
            r"\[mesh\] axis: axis must be a direction; give three numbers",
        ),
        ("box = [1.0, 1.0, 1.0]\naxis = [0, 0, 0]\nturn = 3", r"\[mesh\] axis: axis must be a direction"),
    ],
)
def test_wrong_places_are_refused(line: str, message: str, tmp_path: Path) -> None:
    source = "" if "box" in line else "rectangle = [1.0, 1.0]\n"
    (tmp_path / "a.toml").write_text(f"[mesh]\n{source}cells = 2\n{line}\n[material]\nyoung = 5.0\npoisson = 0.3\n")
    with pytest.raises(ProblemError, match=message):
        hv.read_problem(tmp_path / "a.toml")
