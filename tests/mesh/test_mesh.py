"""Meshes: construction, validation, refinement, reading."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import meshio
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hemivar.errors import ProblemError
from hemivar.mesh import Mesh, read_mesh, rectangle

from .meshes import cube


@pytest.mark.parametrize("pattern", ["cross", "right", "left"])
def test_rectangle_is_a_valid_mesh(pattern: str) -> None:
    mesh = rectangle((2.0, 1.0), (4, 3), pattern, origin=(1.0, -1.0))
    checked = Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))
    assert math.isclose(checked.volumes.sum(), 2.0)
    assert len(checked.boundary_facets) == 14
    for name, normal in {"left": (-1, 0), "right": (1, 0), "bottom": (0, -1), "top": (0, 1)}.items():
        np.testing.assert_array_equal(mesh.boundaries[name], checked.boundaries[name])
        found, length = mesh.facet_normals(mesh.boundaries[name])
        np.testing.assert_allclose(found, np.broadcast_to(normal, found.shape), atol=1e-15)
        assert math.isclose(length.sum(), 1.0 if name in ("left", "right") else 2.0)


def test_diagonals() -> None:
    right, left = rectangle((1, 1), 1, "right"), rectangle((1, 1), 1, "left")
    assert [0, 3] in right.edges.tolist()
    assert [1, 2] in left.edges.tolist()
    assert math.isclose(right.size, math.sqrt(2))


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"size": (0.0, 1.0)}, "positive"),
        ({"size": (1.0, math.nan)}, r"size\[1\] = nan"),
        ({"cells": 0}, "at least 1"),
        ({"cells": 2.5}, "whole numbers"),
        ({"cells": (1, 2, 3)}, "one or two numbers"),
        ({"size": (1.0,)}, "two lengths"),
        ({"cells": (2, 1.5)}, "whole numbers"),
        ({"pattern": "criss"}, "criss"),
    ],
)
def test_rectangle_refuses(arguments: dict, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        rectangle(**arguments)


SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]


@pytest.mark.parametrize(
    ("points", "cells", "boundaries", "regions", "words"),
    [
        ([[0, 0], [1, 0], [math.nan, 1]], [[0, 1, 2]], {}, {}, r"points\[2, 0\] = nan; every number must be finite"),
        ([[0.0], [1.0]], [[0, 1]], {}, {}, "points has shape"),
        ("no", [[0, 1, 2]], {}, {}, "points is not an array of numbers"),
        (SQUARE, [[0, 1, 7]], {}, {}, "cells refers to number 7"),
        (SQUARE, [[0, 1, -1]], {}, {}, "cells refers to number -1"),
        (SQUARE, [[0.0, 1.0, 2.0]], {}, {}, "whole numbers"),
        (SQUARE, [[0, 1]], {}, {}, "triangles need shape"),
        (SQUARE, [[0, 1, 1], [1, 2, 3]], {}, {}, "degenerate.*cells 0"),
        (SQUARE, [[0, 1, 2], [0, 3, 2]], {}, {}, "inverted: cells 1"),
        ([*SQUARE, [3.0, 3.0]], [[0, 1, 2], [0, 2, 3]], {}, {}, "1 nodes belong to no cell: nodes 4"),
        (SQUARE, [[0, 1, 2], [0, 2, 3], [0, 1, 3], [0, 1, 2]], {}, {}, "belongs to 3 cells"),
        (SQUARE, [[0, 1, 2], [0, 2, 3]], {"in": [[0, 2]]}, {}, "boundary 'in'.*between two cells"),
        (SQUARE, [[0, 1, 2], [0, 2, 3]], {"in": [[1, 3]]}, {}, "boundary 'in'.*not a facet"),
        (SQUARE, [[0, 1, 2], [0, 2, 3]], {"in": []}, {}, "boundary 'in' holds no facets"),
        (SQUARE, [[0, 1, 2], [0, 2, 3]], {"in": [[0, 1, 2]]}, {}, "boundary 'in' has shape"),
        (SQUARE, [[0, 1, 2], [0, 2, 3]], {"in": [[0, 9]]}, {}, "boundary 'in' refers to number 9"),
        (SQUARE, [[0, 1, 2], [0, 2, 3]], {}, {"soft": [2]}, "region 'soft' refers to number 2"),
        (SQUARE, [[0, 1, 2], [0, 2, 3]], {}, {"soft": []}, "region 'soft' holds no cells"),
        (SQUARE, [[0, 1, 2], [0, 2, 3]], {}, {"soft": [[0]]}, "region 'soft' has shape"),
    ],
)
def test_mesh_refuses(points: object, cells: object, boundaries: dict, regions: dict, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        Mesh(points, cells, boundaries, regions)  # type: ignore[arg-type]


def test_oriented_turns_inverted_cells() -> None:
    mesh = Mesh.oriented(SQUARE, [[0, 1, 2], [0, 3, 2]], {"bottom": [[1, 0]]})
    assert (mesh.volumes > 0).all()
    assert mesh.boundaries["bottom"].tolist() == [[0, 1]]


def test_facets_given_twice_count_once() -> None:
    mesh = Mesh(SQUARE, [[0, 1, 2], [0, 2, 3]], {"bottom": [[1, 0], [0, 1]]})
    assert mesh.boundaries["bottom"].tolist() == [[0, 1]]


def test_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        rectangle().points[0, 0] = 3.0


@pytest.mark.parametrize("make", [lambda: rectangle((2, 1), (4, 2), "cross"), cube])
def test_refined(make: Callable[[], Mesh]) -> None:
    coarse = make()
    coarse = Mesh(coarse.points, coarse.cells, dict(coarse.boundaries), {"part": [0, 3]})
    fine = coarse.refined()
    checked = Mesh(fine.points, fine.cells, dict(fine.boundaries), dict(fine.regions))
    assert checked.number_of_cells == 2**coarse.dim * coarse.number_of_cells
    np.testing.assert_array_equal(fine.points[: coarse.number_of_nodes], coarse.points)
    for name, facets in coarse.boundaries.items():
        children, measures = fine.facet_normals(fine.boundaries[name])
        normals, whole = coarse.facet_normals(facets)
        assert math.isclose(measures.sum(), whole.sum())
        np.testing.assert_allclose(children.mean(axis=0), normals.mean(axis=0), atol=1e-14)
        np.testing.assert_array_equal(np.sort(checked.boundaries[name], axis=1), np.sort(fine.boundaries[name], axis=1))
    assert math.isclose(fine.volumes[fine.regions["part"]].sum(), coarse.volumes[[0, 3]].sum())
    assert math.isclose(fine.size, coarse.size / 2) or coarse.dim == 3
    assert coarse.refined(0) is coarse


def test_cube_facets_point_outward() -> None:
    mesh = cube()
    normals, areas = mesh.facet_normals(mesh.boundaries["bottom"])
    np.testing.assert_allclose(normals, np.broadcast_to([0, 0, -1.0], normals.shape), atol=1e-15)
    assert math.isclose(areas.sum(), 1.0)
    total, all_areas = mesh.facet_normals(mesh.boundary_facets)
    np.testing.assert_allclose((total * all_areas[:, None]).sum(axis=0), 0.0, atol=1e-13)
    assert math.isclose(all_areas.sum(), 6.0)


def test_moved() -> None:
    mesh = rectangle((1, 1), 2)
    np.testing.assert_allclose(mesh.rotated(math.pi / 2).points, mesh.points @ [[0, 1], [-1, 0]], atol=1e-15)
    np.testing.assert_allclose(mesh.scaled(3.0).points, 3 * mesh.points)
    for wrong in (0.0, -1.0, math.nan):
        with pytest.raises(ProblemError, match="positive"):
            mesh.scaled(wrong)
    for turned_over_or_flat in ([[1, 0], [0, -1]], [[1, 1], [1, 1]], np.zeros((2, 2))):
        with pytest.raises(ProblemError, match="determinant"):
            mesh.moved(turned_over_or_flat)
    with pytest.raises(ProblemError, match="this mesh is 3D and needs one"):
        cube().rotated(1.0)
    with pytest.raises(ProblemError, match="this mesh is 2D and has none"):
        mesh.rotated(1.0, (0.0, 0.0, 1.0))
    for wrong in ((0.0, 0.0, 0.0), (1.0, 0.0), (math.inf, 0.0, 0.0), (math.nan, 0.0, 0.0)):
        with pytest.raises(ProblemError, match="axis"):
            cube().rotated(1.0, wrong)


def test_turned_about_an_axis() -> None:
    """By scipy's rotations; the length of the axis does not matter."""
    for axis in ((0.0, 0.0, 1e-9), (1.0, 2.0, -2.0), (1e200, 0.0, 1e200)):
        unit = np.array(axis) / np.abs(axis).max()
        unit /= np.linalg.norm(unit)
        turned = cube().rotated(0.7, axis)
        np.testing.assert_allclose(
            turned.points, Rotation.from_rotvec(0.7 * unit).apply(cube().points.copy()), atol=1e-15
        )
        assert turned.volumes.sum() == pytest.approx(1.0)


@pytest.mark.parametrize("make", [lambda: rectangle((2, 1), (4, 2), "cross"), cube])
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_mirrored(make: Callable[[], Mesh], axis: str) -> None:
    """Positively oriented cells, facets that point outwards, the same names; twice is as before."""
    mesh = make().with_interfaces({"cut": lambda x: np.abs(x[:, 0] - 0.5) < 1e-9})
    mesh = Mesh(mesh.points, mesh.cells, mesh.boundaries, {"part": [0, 3]}, interfaces=mesh.interfaces)
    if axis == "z" and mesh.dim == 2:
        with pytest.raises(ProblemError, match=r"cannot be mirrored in 'z'; give one of x, y$"):
            mesh.mirrored(axis)
        return
    k = "xyz".index(axis)
    sign = np.where(np.arange(mesh.dim) == k, -1.0, 1.0)
    for one in (mesh, mesh.refined(2)):
        other = one.mirrored(axis)
        assert other.recipe is None
        np.testing.assert_array_equal(other.points, sign * one.points)
        np.testing.assert_array_equal(np.sort(other.cells, axis=1), np.sort(one.cells, axis=1))
        # the constructor checks orientation, and that a mesh refines its parent
        checked = Mesh(
            other.points, other.cells, other.boundaries, other.regions, other.parent, interfaces=other.interfaces
        )
        for name, facets in one.boundaries.items():
            normals, measures = checked.facet_normals(checked.boundaries[name])
            there, wanted = checked.facet_normals(other.boundaries[name])
            np.testing.assert_allclose(normals.sum(axis=0), there.sum(axis=0), atol=1e-12)
            own = one.facet_normals(facets)
            np.testing.assert_allclose(
                np.sum(there * wanted[:, None], axis=0), sign * (own[0] * own[1][:, None]).sum(axis=0), atol=1e-12
            )
            assert measures.sum() == pytest.approx(own[1].sum())
        assert set(other.interfaces) == {"cut"}
        assert other.volumes[other.regions["part"]].sum() == pytest.approx(one.volumes[one.regions["part"]].sum())
        np.testing.assert_array_equal(other.mirrored(axis).points, one.points)
        np.testing.assert_array_equal(other.mirrored(axis).cells, one.cells)
    assert other.parent.mesh.parent.mesh.number_of_cells == mesh.number_of_cells
    assert mesh.refined_where([0, 3]).mirrored(axis).parent is None


@pytest.mark.parametrize("wrong", ["w", "", "xy", 0, None])
def test_what_is_no_coordinate_does_not_mirror(wrong: object) -> None:
    with pytest.raises(ProblemError, match=r"cannot be mirrored in .*; give one of x, y"):
        rectangle().mirrored(wrong)  # type: ignore[arg-type]


def test_with_boundaries_checks_masks() -> None:
    with pytest.raises(ProblemError, match="bool mask"):
        rectangle().with_boundaries({"a": lambda x: 3.0})
    with pytest.raises(ProblemError, match="holds no facets"):
        rectangle().with_boundaries({"a": lambda x: x[:, 0] > 7})


@pytest.mark.parametrize("dim", [2, 3])
def test_nodes_of_order_two_are_edge_midpoints(dim: int) -> None:
    mesh = rectangle((1, 1), 3, "left") if dim == 2 else cube()
    nodes, cells = mesh.nodes(2), mesh.cell_nodes(2)
    pairs = [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)][: 3 if dim == 2 else 6]
    for k, (a, b) in enumerate(pairs):
        middle = 0.5 * (mesh.points[mesh.cells[:, a]] + mesh.points[mesh.cells[:, b]])
        np.testing.assert_allclose(nodes[cells[:, dim + 1 + k]], middle)
    facets = mesh.boundaries["bottom"]
    members = mesh.facet_nodes(facets, 2)
    np.testing.assert_allclose(nodes[members[:, dim]], nodes[facets[:, :2]].mean(axis=1))


# ---- files -------------------------------------------------------------------------------------------------


def test_read_missing_and_broken(tmp_path: Path) -> None:
    with pytest.raises(ProblemError, match="does not exist"):
        read_mesh(tmp_path / "nothing.msh")
    for name, text in {"broken.msh": "this is no mesh", "strange.xyz": "1 2 3", "empty.msh": ""}.items():
        path = tmp_path / name
        path.write_text(text)
        with pytest.raises(ProblemError, match="cannot be read") as caught:
            read_mesh(path)
        assert "\n" not in str(caught.value)


def test_read_is_silent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "broken.msh"
    path.write_text("this is no mesh")
    with pytest.raises(ProblemError):
        read_mesh(path)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err == ""


def test_read_refuses_other_cells(tmp_path: Path) -> None:
    path = tmp_path / "line.vtu"
    meshio.Mesh(np.array(SQUARE), [("line", np.array([[0, 1]]))]).write(path)
    with pytest.raises(ProblemError, match="holds lines only, and no cells of a body"):
        read_mesh(path)
    lifted = np.column_stack([np.array(SQUARE), [0, 0, 0, 1.0]])
    path = tmp_path / "bent.vtu"
    meshio.Mesh(lifted, [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))]).write(path)
    with pytest.raises(ProblemError, match="surface in 3D"):
        read_mesh(path)


def test_read_turns_inverted_and_drops_unused(tmp_path: Path) -> None:
    points = np.array([[9.0, 9.0, 0.0], *[[*p, 0.0] for p in SQUARE]])
    path = tmp_path / "square.vtu"
    meshio.Mesh(points, [("triangle", np.array([[1, 2, 3], [1, 4, 3]]))]).write(path)
    mesh = read_mesh(path)
    assert mesh.points.tolist() == SQUARE
    assert (mesh.volumes > 0).all()


def test_read_cell_sets(tmp_path: Path) -> None:
    raw = meshio.Mesh(
        np.array(SQUARE),
        [("line", np.array([[0, 1]])), ("triangle", np.array([[0, 1, 2], [0, 2, 3]]))],
        cell_sets={
            "ground": [np.array([0]), np.array([], dtype=int)],
            "upper": [np.array([], dtype=int), np.array([1])],
        },
    )
    path = tmp_path / "sets.inp"
    raw.write(path)
    mesh = read_mesh(path)
    assert mesh.regions["upper"].tolist() == [1]
    assert mesh.boundaries["ground"].tolist() == [[0, 1]]


@pytest.fixture(scope="module")
def gmsh_disc(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A half disc with a curved boundary, two regions, written in both formats."""
    gmsh = pytest.importorskip("gmsh")
    folder = tmp_path_factory.mktemp("gmsh")
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.add("half disc")
        geo = gmsh.model.geo
        size = 0.2
        centre = geo.addPoint(0, 0, 0, size)
        west, south, east = (
            geo.addPoint(-1, 0, 0, size),
            geo.addPoint(0, -1, 0, size),
            geo.addPoint(1, 0, 0, size),
        )
        arcs = [geo.addCircleArc(west, centre, south), geo.addCircleArc(south, centre, east)]
        top = [geo.addLine(east, centre), geo.addLine(centre, west)]
        middle = geo.addLine(south, centre)
        parts = []
        for lines in ([arcs[0], middle, top[1]], [arcs[1], top[0], -middle]):
            parts.append(geo.addPlaneSurface([geo.addCurveLoop(lines)]))
        geo.synchronize()
        gmsh.model.addPhysicalGroup(1, arcs, name="ground")
        gmsh.model.addPhysicalGroup(1, top, name="top")
        gmsh.model.addPhysicalGroup(2, [parts[0]], name="soft")
        gmsh.model.addPhysicalGroup(2, [parts[1]], name="hard")
        gmsh.model.mesh.generate(2)
        for version in ("2.2", "4.1"):
            gmsh.option.setNumber("Mesh.MshFileVersion", float(version))
            gmsh.write(str(folder / f"disc{version}.msh"))
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(folder / "curved.msh"))
    finally:
        gmsh.finalize()
    yield folder
    shutil.rmtree(folder)


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_read_gmsh(gmsh_disc: Path, version: str, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = read_mesh(gmsh_disc / f"disc{version}.msh")
    assert capsys.readouterr().out == ""
    assert mesh.dim == 2
    assert set(mesh.boundaries) == {"ground", "top"}
    assert set(mesh.regions) == {"soft", "hard"}
    radius = np.linalg.norm(mesh.points[mesh.boundaries["ground"]], axis=2)
    np.testing.assert_allclose(radius, 1.0, atol=1e-12)
    _, length = mesh.facet_normals(mesh.boundaries["ground"])
    assert abs(length.sum() - math.pi) < 0.02
    assert abs(mesh.volumes[mesh.regions["soft"]].sum() - math.pi / 4) < 0.02
    assert len(mesh.regions["soft"]) + len(mesh.regions["hard"]) == mesh.number_of_cells
    left = mesh.points[mesh.cells[mesh.regions["soft"]]].mean(axis=1)[:, 0]
    assert (left < 0).all()


def test_curved_cells_of_gmsh_are_cut_along_the_curve(gmsh_disc: Path) -> None:
    mesh = read_mesh(gmsh_disc / "curved.msh")
    radius = np.linalg.norm(mesh.points[mesh.boundaries["ground"]], axis=2)
    np.testing.assert_allclose(radius, 1.0, atol=1e-12)
    assert mesh.notes[0].endswith("triangles of order 1")
    assert mesh.suggested_order == 1
