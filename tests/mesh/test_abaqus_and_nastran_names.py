"""Names in Abaqus and Nastran files, and what becomes of groups of facets and nodes."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

import hemivar as hv
from hemivar.mesh import Mesh, read_mesh

CORNERS = {
    "C3D4": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)],
    "C3D5": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 0.5, 1)],
    "C3D6": [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1)],
    "C3D8R": [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)],
    "CPS3": [(0, 0), (1, 0), (0, 1)],
    "CPE4R": [(0, 0), (1, 0), (1, 1), (0, 1)],
}
#: Nodes of the faces S1, S2, ... as the manual of Abaqus gives them.
FACES = {
    "C3D4": ["123", "142", "243", "341"],
    "C3D5": ["1234", "152", "253", "354", "451"],
    "C3D6": ["123", "465", "1254", "2365", "3146"],
    "C3D8R": ["1234", "5876", "1562", "2673", "3784", "4851"],
    "CPS3": ["12", "23", "31"],
    "CPE4R": ["12", "23", "34", "41"],
}


def abaqus(tmp_path: Path, text: str) -> Mesh:
    path = tmp_path / "part.inp"
    path.write_text(text)
    return read_mesh(path)


def nodes(points: list, start: int = 1) -> str:
    rows = (", ".join(map(str, (number, *map(float, point)))) for number, point in enumerate(points, start=start))
    return "*NODE\n" + "\n".join(rows) + "\n"


def length(mesh: Mesh, name: str) -> float:
    return float(mesh.facet_normals({**mesh.boundaries, **mesh.interfaces}[name])[1].sum())


@pytest.mark.parametrize("kind", CORNERS)
def test_faces_of_elements_are_numbered_as_in_the_manual(kind: str, tmp_path: Path) -> None:
    corners = np.array(CORNERS[kind], dtype=float)
    text = nodes(CORNERS[kind]) + f"*Element, type={kind}\n7, {', '.join(map(str, range(1, len(corners) + 1)))}\n"
    for number in range(1, len(FACES[kind]) + 1):
        text += f"*Surface, type=ELEMENT, name=f{number}\n7, S{number}\n"
    mesh = abaqus(tmp_path, text)
    for number, face in enumerate(FACES[kind], start=1):
        found = {tuple(point) for point in mesh.points[mesh.boundaries[f"f{number}"]].reshape(-1, mesh.dim).tolist()}
        assert found == {tuple(corners[int(node) - 1].tolist()) for node in face}
    assert sum(length(mesh, name) for name in mesh.boundaries) == pytest.approx(
        mesh.facet_normals(mesh.boundary_facets)[1].sum()
    )


PART = (
    "** a comment\n*Part, name=Block\n"
    + nodes([(0, 0), (1, 0), (1, 1), (0, 1)])
    + '*Element, type=CPE4,\n ELSET="All of it"\n1, 1, 2, 3, 4\n*Nset, nset=Low\n1, 2\n*End Part\n'
)


def test_parts_are_put_where_their_instances_say(tmp_path: Path) -> None:
    """Twice the same part: one shifted, one shifted and turned by a right angle about an axis through (2, 0)."""
    mesh = abaqus(
        tmp_path,
        PART + "*Assembly, name=A\n*Instance, name=One, part=Block\n5., 0.\n*End Instance\n"
        "*Instance, name=Two, part=Block\n2., 0., 0.\n2., 0., 0., 2., 0., 1., 90.\n*End Instance\n"
        "*Nset, nset=Right, instance=One\n2, 3\n*Nset, nset=Left\nTwo.3, Two.4\n"
        "*Elset, elset=_f, internal, instance=Two\n1,\n*Surface, type=ELEMENT, name=Base\n_f, S1\n*End Assembly\n",
    )
    assert mesh.parts.count == 2
    assert mesh.volumes.sum() == pytest.approx(2.0)
    sizes = {name: length(mesh, name) for name in mesh.boundaries}
    assert sizes == pytest.approx({"Low": 2.0, "Right": 1.0, "Left": 1.0, "Base": 1.0})
    places = {name: mesh.points[facets].mean(axis=(0, 1)).tolist() for name, facets in mesh.boundaries.items()}
    assert places["Right"] == pytest.approx([6.0, 0.5])
    assert places["Left"] == pytest.approx([1.0, 0.5])  # the side y = 1 of the part
    assert places["Base"] == pytest.approx([2.0, 0.5])  # the side y = 0, turned
    assert set(mesh.regions) == {"All of it"}


def test_instances_have_meshes_of_their_own(tmp_path: Path) -> None:
    """As for independent instances: numbers and sets belong to each, and places are those of the instance."""
    own = nodes([(0, 0), (1, 0), (1, 1), (0, 1)])
    own += "*Element, type=CPE4, elset=All\n1, 1, 2, 3, 4\n*Nset, nset=Low\n1, 2\n*End Instance\n"
    mesh = abaqus(
        tmp_path,
        "*Part, name=Block\n*End Part\n*Assembly, name=A\n*Instance, name=One, part=Block\n" + own
        + "*Instance, name=Two, part=Block\n0., 3.\n" + own.replace("=All", "=Rest")
        + "*Nset, nset=Right, instance=Two\n2, 3\n*End Assembly\n",
    )  # fmt: skip
    assert (mesh.parts.count, mesh.volumes.sum()) == (2, pytest.approx(2.0))
    assert {name: length(mesh, name) for name in mesh.boundaries} == pytest.approx({"Low": 2.0, "Right": 1.0})
    assert mesh.points[mesh.boundaries["Right"]].mean(axis=(0, 1)).tolist() == pytest.approx([1.0, 3.5])
    assert {name: mesh.volumes[own].sum() for name, own in mesh.regions.items()} == {"All": 1.0, "Rest": 1.0}


def test_sets_of_sets_and_generated_ones(tmp_path: Path) -> None:
    square = list(itertools.product(range(3), range(3)))
    cells = [(3 * i + j + 1, 3 * i + j + 4, 3 * i + j + 5, 3 * i + j + 2) for i in range(2) for j in range(2)]
    text = nodes([(x, y) for x, y in square]) + "*ELEMENT, TYPE=CPS4R, ELSET=body\n"
    text += "".join(f"{number}, {', '.join(map(str, cell))}\n" for number, cell in enumerate(cells, start=10))
    text += (
        "*ELSET, ELSET=first\n10,\n11\n*ELSET, ELSET=odd, GENERATE\n11, 99999999999, 2\n*ELSET, ELSET=some\nfirst, 12\n"
    )
    text += "*NSET, NSET=left, GENERATE\n1, 3\n*NSET, NSET=both\nLEFT, 9, 6\n*SURFACE, NAME=cut\nfirst, S2\n"
    text += "*SURFACE, NAME=ends, TYPE=NODE\nleft, 1.\n"
    mesh = abaqus(tmp_path, text)
    regions = {name: mesh.volumes[own].sum() for name, own in mesh.regions.items()}
    assert regions == pytest.approx({"body": 4.0, "first": 2.0, "odd": 2.0, "some": 3.0})
    assert {name: length(mesh, name) for name in mesh.boundaries} == {"left": 2.0, "both": 4.0, "ends": 2.0}
    assert {name: length(mesh, name) for name in mesh.interfaces} == {"cut": 2.0}


NASTRAN = (
    ("GRID,1,,0.,0.,0.", "CTRIA3,1,3,1,2,3"),
    ("GRID           1              0.      0.      0.", "CTRIA3         1       3       1       2       3"),
    (
        "GRID*                  1                             0.0             0.0\n*                    0.0",
        "CTRIA3,1,3,1,2,3",
    ),
    ("GRID*,1,,0.,0.\n*,0.", "CTRIA3*,1,3,1,2\n*,3"),
    ("GRID,1,0,+0.0-5,1.0D-30,0.", "CTRIA3,1,3,1,2,3,0.0"),
    ("GRID\t1\t\t0.\t0.\t0.", "CTRIA3         1       3       1       2       3      0.     0.\n+"),
)


@pytest.mark.parametrize(("grid", "cell"), NASTRAN)
def test_fields_of_nastran(grid: str, cell: str, tmp_path: Path) -> None:
    path = tmp_path / "part.nas"
    path.write_text(
        f'$ a comment with {grid}\nSOL 101\nCEND\nBEGIN BULK\n$HMNAME PROP                   3"steel sheet" 4\n{grid}\n'
        f"GRID,2,,1.5+0,0.,0.\nGRID,3,,0.,1.,0.  $ last\n{cell}\nCROD,9,8,1,2\nCELAS1,10,4,1,1\nENDDATA\n"
    )
    mesh = read_mesh(path)
    assert mesh.volumes.sum() == pytest.approx(0.75)
    assert set(mesh.regions) == {"steel sheet"}
    assert {name: length(mesh, name) for name in mesh.boundaries} == {"8": 1.5}
    assert mesh.notes == ("elements CELAS1 belong to no body and were ignored",)


#: A system turned by 90 degrees about z at (2, 1), in it one that is shifted along its x, and round ones at its origin.
SYSTEMS = (
    "CORD2R,7,5,1.,0.,0.,1.,0.,1.\n,2.,0.,0.\nCORD2R,5,,2.,1.,0.,2.,1.,3.\n,2.,9.,0.\n"
    "CORD2C,8,5,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nCORD2S*,9,5,0.,0.\n*,0.,0.,0.,1.\n*,1.,0.,0.\n"
    "CORD2R,6,8,1.,90.,0.,1.,90.,1.\n,2.,90.,0.\n"
)


@pytest.mark.parametrize(
    ("system", "places"),
    [
        (5, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]),
        (7, [(-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, 0.0, 1.0)]),
        (8, [(0.0, 30.0, 0.0), (1.0, 0.0, 0.0), (1.0, 90.0, 0.0), (0.0, 0.0, 1.0)]),
        (9, [(0.0, 30.0, 0.0), (1.0, 90.0, 0.0), (1.0, 90.0, 90.0), (1.0, 0.0, 50.0)]),
        (6, [(-1.0, 0.0, 0.0), (-1.0, -1.0, 0.0), (0.0, 0.0, 0.0), (-1.0, 0.0, 1.0)]),
    ],
)
@pytest.mark.parametrize("by_default", [False, True])
def test_grid_points_of_nastran_lie_in_systems_of_their_own(
    system: int, places: list, by_default: bool, tmp_path: Path
) -> None:
    """In each of them the same tetrahedron: its corner at (2, 1, 0), and edges along y, -x and z."""
    path = tmp_path / "part.bdf"
    rows = (
        f"GRID,{n},{'' if by_default else system},{x},{y},{z},{'' if by_default else 5}\n"
        for n, (x, y, z) in enumerate(places, start=1)
    )
    default = f"GRDSET,,{system},,,,5\n" if by_default else ""
    path.write_text(f"BEGIN BULK\n{default}{''.join(rows)}{SYSTEMS}CTETRA,1,3,1,2,3,4\nENDDATA\n")
    mesh = read_mesh(path)
    wanted = [[2.0, 1.0, 0.0], [2.0, 2.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 1.0]]
    np.testing.assert_allclose(mesh.points, wanted, atol=1e-14)
    assert mesh.notes == (
        "directions of displacements that grid points have of their own (CD) were ignored: they are x, y, z",
    )


def test_hexahedra_of_nastran_go_on_over_several_lines(tmp_path: Path) -> None:
    points = CORNERS["C3D8R"]
    text = "".join(f"GRID,{number},,{x}.,{y}.,{z}.\n" for number, (x, y, z) in enumerate(points, start=1))
    for more in ("+\n+", "+A\n+A", "\n"):
        path = tmp_path / "part.bdf"
        path.write_text(
            f"{text}CHEXA,1,5,1,2,3,4,5,6,{more},7,8\n" if more != "\n" else f"{text}CHEXA,1,5,1,2,3,4,5,6\n,7,8\n"
        )
        assert read_mesh(path).volumes.sum() == pytest.approx(1.0)


def test_groups_of_nodes_keep_to_their_facets_where_cells_are_cut(tmp_path: Path) -> None:
    """New nodes in the middle of faces belong to a group if all corners do."""
    points = [np.array(point, dtype=float) for point in CORNERS["C3D8R"]]
    ends = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    points += [0.5 * (points[a] + points[b]) for a, b in ends]
    low = [number for number, point in enumerate(points, start=1) if point[2] == 0.0]
    text = nodes([tuple(point) for point in points]) + "*ELEMENT, TYPE=C3D20R, ELSET=body\n"
    text += f"1, {', '.join(map(str, range(1, 16)))},\n {', '.join(map(str, range(16, 21)))}\n"
    text += f"*NSET, NSET=low\n{', '.join(map(str, low))}\n*NSET, NSET=edge\n1, 2, 9\n"
    mesh = abaqus(tmp_path, text)
    assert length(mesh, "low") == pytest.approx(1.0)
    assert np.abs(mesh.points[mesh.boundaries["low"]][..., 2]).max() == 0.0
    assert set(mesh.boundaries) == {"low"}
    assert mesh.number_of_cells == 48
    clamped = hv.ContactProblem(mesh, hv.Material.lame(1.0, 1.0), supports={"low": "clamped"}, body_force=(0, 0, -1.0))
    assert hv.solve(clamped).status.value == "converged"
