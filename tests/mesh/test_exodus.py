"""Exodus files: names of kinds of elements, sides of elements, sets and blocks."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.mesh import Mesh, read_mesh
from hemivar.mesh.kinds import CODES, KINDS

from .exodus_files import write_exodus
from .test_abaqus_and_nastran_names import CORNERS as OF_ABAQUS
from .test_abaqus_and_nastran_names import length

CORNERS = {
    name: OF_ABAQUS[of]
    for name, of in (
        ("tetra", "C3D4"), ("pyramid", "C3D5"), ("wedge", "C3D6"), ("hexahedron", "C3D8R"), ("triangle", "CPS3"),
        ("quad", "CPE4R"),
    )
}  # fmt: skip
#: Corners of the sides 1, 2, ... of each shape, as the manual of Exodus lists them.
SIDES = {
    "tetra": ["124", "234", "143", "132"],
    "pyramid": ["125", "235", "345", "154", "1432"],
    "wedge": ["1254", "2365", "1463", "132", "456"],
    "hexahedron": ["1265", "2376", "3487", "1584", "1432", "5678"],
    "triangle": ["12", "23", "31"],
    "quad": ["12", "23", "34", "41"],
}


def places_in_file(mesh: Mesh, name: str) -> set[tuple[float, ...]]:
    return {tuple(point) for point in mesh.points[mesh.boundaries[name]].reshape(-1, mesh.dim).tolist()}


@pytest.mark.parametrize("how", ["classic", "hdf5", "one array"])
@pytest.mark.parametrize(
    ("kind", "shape"),
    [("TETRA4", "tetra"), ("TET4", "tetra"), ("tetra", "tetra"), ("TETRA", "tetra"), ("PYRAMID5", "pyramid"),
     ("PYRA", "pyramid"), ("WEDGE6", "wedge"), ("HEX8", "hexahedron"), ("HEX", "hexahedron"), ("TRI3", "triangle"),
     ("QUAD4", "quad")],
)  # fmt: skip
def test_sides_of_elements_are_numbered_as_in_the_manual(kind: str, shape: str, how: str, tmp_path: Path) -> None:
    points, path = np.array(CORNERS[shape], dtype=float), tmp_path / "one.exo"
    nodes = [list(range(1, len(points) + 1))]
    sets = [(f"side {k}", [1], [k]) for k in range(1, len(SIDES[shape]) + 1)]
    write_exodus(path, points, [(kind, "body", nodes)], sets, how=how)
    mesh = read_mesh(path)
    for number, side in enumerate(SIDES[shape], start=1):
        assert places_in_file(mesh, f"side {number}") == {tuple(points[int(node) - 1].tolist()) for node in side}
    assert sum(length(mesh, name) for name in mesh.boundaries) == pytest.approx(
        mesh.facet_normals(mesh.boundary_facets)[1].sum()
    )
    assert set(mesh.regions) == {"body"}


@pytest.mark.parametrize("how", ["classic", "hdf5"])
def test_sets_of_a_bar_of_two_blocks(how: str, tmp_path: Path) -> None:
    """Elements are counted through the blocks; unnamed blocks and sets are called by their numbers."""
    y, z = [0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]
    points = [(float(x), y[k], z[k]) for x in range(4) for k in range(4)]
    cells = [[4 * x + k + 1 for x in (x, x + 1) for k in range(4)] for x in range(3)]
    path = tmp_path / "bar.e"
    write_exodus(
        path, points, [("HEX8", "steel", cells[:1]), ("HEX8", "", cells[1:])],
        [("", [1, 2, 3], [4, 4, 4]), ("between", [1], [6]), ("ends", [1, 3], [5, 6])],
        [("left", [1, 2, 3, 4]), ("", [13, 14, 15, 16])], how,
    )  # fmt: skip
    mesh = read_mesh(path)
    assert {name: mesh.volumes[own].sum() for name, own in mesh.regions.items()} == pytest.approx(
        {"steel": 1.0, "20": 2.0}
    )
    assert {name: length(mesh, name) for name in mesh.boundaries} == pytest.approx(
        {"100": 3.0, "ends": 2.0, "left": 1.0, "14": 1.0}
    )
    assert mesh.points[mesh.boundaries["100"]][..., 1].max() == 0.0
    assert mesh.points[mesh.boundaries["14"]][..., 0].min() == 3.0
    assert {name: length(mesh, name) for name in mesh.interfaces} == pytest.approx({"between": 1.0})


@pytest.mark.parametrize("kind", ["tetra10", "TET10", "HEX20", "WEDGE15", "PYRAMID13", "TRI6", "QUAD8"])
def test_middles_of_edges_stand_in_their_places(kind: str, tmp_path: Path) -> None:
    """Cut at its middles, an element has its own volume, and no part of it is inverted."""
    name = {"tet": "tetra10", "hex": "hexahedron20", "wed": "wedge15", "pyr": "pyramid13", "tri": "triangle6"}
    own = KINDS[CODES[name.get(kind[:3].lower(), kind.lower())]]
    corners = np.array(CORNERS[own.shape.name], dtype=float)
    edges = list(own.shape.edges)
    if own.shape.name in ("hexahedron", "wedge"):  # the upright edges come before those of the top
        n = own.shape.corners // 2
        edges = edges[:n] + edges[2 * n :] + edges[n : 2 * n]
    points = np.vstack([corners, *[corners[list(edge)].mean(axis=0) for edge in edges]])
    path = tmp_path / "one.e"
    write_exodus(path, points, [(kind, "body", [list(range(1, len(points) + 1))])])
    mesh = read_mesh(path, order=1)
    exact = {"tetra": 1 / 6, "hexahedron": 1.0, "wedge": 0.5, "pyramid": 1 / 3, "triangle": 0.5, "quad": 1.0}
    assert mesh.volumes.sum() == pytest.approx(exact[own.shape.name])
    assert mesh.volumes.min() > 0.0


def test_shells_on_a_solid_are_boundaries_and_side_sets_go_through_them(tmp_path: Path) -> None:
    path, points = tmp_path / "skin.e", CORNERS["tetra"]
    write_exodus(
        path, points, [("TETRA4", "body", [[1, 2, 3, 4]]), ("TRI3", "skin", [[1, 3, 2]])],
        [("below", [2], [1]), ("rim", [2, 1], [3, 2])],
    )  # fmt: skip
    mesh = read_mesh(path)
    assert {name: length(mesh, name) for name in mesh.boundaries} == pytest.approx(
        {"skin": 0.5, "below": 0.5, "rim": np.sqrt(0.75)}
    )
    assert mesh.notes == ("side set 'rim' has 1 sides that are edges of shells or ends of bars; they were ignored",)


def test_a_plate_of_shells_in_a_plane(tmp_path: Path) -> None:
    """Sides 1 and 2 of a shell are its faces, and its edges follow."""
    path, points = tmp_path / "plate.e", [(x, y, 0.0) for x, y in CORNERS["quad"]]
    write_exodus(path, points, [("SHELL4", "plate", [[1, 2, 3, 4]])], [("edge", [1], [3]), ("face", [1], [1])])
    mesh = read_mesh(path)
    assert places_in_file(mesh, "edge") == {(0.0, 0.0), (1.0, 0.0)}
    assert set(mesh.boundaries) == {"edge"}


@pytest.mark.parametrize("how", ["classic", "hdf5"])
@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"kind": "TETRA8"}, "cells of type TETRA8 of 4 nodes|cells of type"),
        ({"kind": "NFACED"}, "cells of type NFACED of 4 nodes, which are not read"),
        ({"kind": ""}, r"cells of type \(without a name\) of 4 nodes"),
        ({"sides": [("low", [1], [5])]}, "side set 'low' names side 5 of a tetra; it has 4"),
        ({"sides": [("low", [1], [0])]}, "side set 'low' names side 0 of a tetra; it has 4"),
        ({"sides": [("low", [2], [1])]}, "side set 'low' refers to an element that is not there"),
        ({"nodes": [("top", [5])]}, "node set 'top' refers to a node that is not there"),
        ({"cells": [[1, 2, 3, 9]]}, "an element refers to node 9, which is not in the file"),
    ],
)
def test_bad_exodus_files_are_refused_in_a_sentence(change: dict, says: str, how: str, tmp_path: Path) -> None:
    path = tmp_path / "bad.e"
    block = (change.get("kind", "TETRA4"), "body", change.get("cells", [[1, 2, 3, 4]]))
    if change.get("kind") == "TETRA8":
        block = ("TETRA8", "body", [[1, 2, 3, 4, 1, 2, 3, 4]])
        says = "cells of type TETRA8 of 8 nodes, which are not read"
    write_exodus(path, CORNERS["tetra"], [block], change.get("sides", ()), change.get("nodes", ()), how)
    with pytest.raises(ProblemError, match=says) as caught:
        read_mesh(path)
    assert "\n" not in str(caught.value)


def test_exodus_files_that_are_damaged_end_in_a_mesh_or_a_sentence(tmp_path: Path) -> None:
    path, rng = tmp_path / "cut.e", np.random.default_rng(5)
    write_exodus(path, CORNERS["tetra"], [("TETRA4", "body", [[1, 2, 3, 4]])], [("low", [1], [4])], [("top", [4])])
    data = path.read_bytes()
    spoilt = [data[:end] for end in range(0, len(data), 41)]
    for _ in range(100):
        one = bytearray(data)
        for at in rng.integers(4, len(data), 3):
            one[at] = rng.integers(0, 256)
        spoilt.append(bytes(one))
    for one in [*spoilt, b"CDF\5" + data[4:], b"\x89HDF\r\n\x1a\n" + data]:
        path.write_bytes(one)
        with contextlib.suppress(ProblemError):  # nothing else is raised
            assert read_mesh(path).number_of_cells == 1
    path.write_bytes(b"CDF\5" + data[4:])
    with pytest.raises(ProblemError, match="netCDF of the kind CDF-5, which is not read; save it as netCDF-4"):
        read_mesh(path)
    path.write_text("nothing")
    with pytest.raises(ProblemError, match="it does not begin like an Exodus file"):
        read_mesh(path)
