"""VTU files in every mode of the format, and what is refused before it is unpacked."""

from __future__ import annotations

import random
import time
import tracemalloc
from pathlib import Path

import meshio
import numpy as np
import pytest

from hemivar.basics.plain_xml import parse_xml
from hemivar.errors import FileError, ProblemError
from hemivar.mesh import read_mesh
from hemivar.mesh import vtu_grid as reader
from hemivar.mesh.vtu_grid import read_vtu
from tests.robustness.vtu import MODES, Grid, Mode, bomb, forged, plate, write_vtu

NODES = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [2.0, 0.5]])
CELLS = np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]])


def _plate(copies: int = 40) -> Grid:
    """Many plates in a row, so that arrays fill several blocks."""
    nodes = np.concatenate([NODES + np.array([3.0 * k, 0.0]) for k in range(copies)])
    cells = np.concatenate([CELLS + len(NODES) * k for k in range(copies)])
    rng = np.random.default_rng(4)
    grid = plate(nodes, cells, u=rng.normal(size=(len(nodes), 3)), state=np.arange(len(nodes), dtype=np.int32))
    grid.arrays["CellData", "stress"] = rng.normal(size=(len(cells), 6)).astype(np.float32)
    grid.arrays["FieldData", "groups"] = np.array([1, 2], dtype=np.uint16)
    return grid


@pytest.mark.parametrize("mode", MODES, ids=str)
def test_every_mode_says_the_same(mode: Mode, tmp_path: Path) -> None:
    grid, path = _plate(), tmp_path / "a.vtu"
    path.write_bytes(write_vtu(grid, mode))
    found = read_vtu(path, "file")
    (block,) = found.cells
    assert block.type == "triangle"
    np.testing.assert_array_equal(block.data.ravel(), grid.arrays["Cells", "connectivity"])
    np.testing.assert_array_equal(found.points, grid.arrays["Points", "Points"])
    for name in ("u", "state"):
        wanted = grid.arrays["PointData", name]
        np.testing.assert_array_equal(found.point_data[name], wanted)
        assert found.point_data[name].dtype == wanted.dtype
    np.testing.assert_array_equal(found.cell_data["stress"][0], grid.arrays["CellData", "stress"])
    np.testing.assert_array_equal(found.field_data["groups"], [1, 2])


@pytest.mark.parametrize("compression", ["zlib", "lzma", None, "ascii"])
@pytest.mark.parametrize("header", ["UInt32", "UInt64"])
def test_files_of_meshio_are_read_as_by_meshio(compression: str | None, header: str, tmp_path: Path) -> None:
    rng, path = np.random.default_rng(3), tmp_path / "a.vtu"
    points = rng.normal(size=(3000, 3))
    blocks = [("tetra", rng.integers(0, 3000, (2500, 4))), ("triangle", rng.integers(0, 3000, (800, 3)))]
    blocks += [("line", np.array([[0, 1]])), ("vertex", np.array([[7]])), ("tetra10", rng.integers(0, 3000, (5, 10)))]
    given = meshio.Mesh(
        points,
        blocks,
        point_data={"a": rng.normal(size=3000), "b": rng.integers(0, 9, (3000, 2)).astype(np.int16)},
        cell_data={"gmsh:physical": [rng.integers(0, 3, len(rows)) for _, rows in blocks]},
    )
    how = {"binary": False} if compression == "ascii" else {"compression": compression, "header_type": header}
    meshio.vtu.write(path, given, **how)
    ours, theirs = read_vtu(path, "file"), meshio.vtu.read(path)
    np.testing.assert_array_equal(ours.points, theirs.points)
    assert [(one.type, one.data.tolist()) for one in ours.cells] == [
        (one.type, one.data.tolist()) for one in theirs.cells
    ]
    for mine, yours in ((ours.point_data, theirs.point_data), (ours.cell_data, theirs.cell_data)):
        assert list(mine) == list(yours)
        for name in mine:
            np.testing.assert_array_equal(
                np.concatenate(list(mine[name]), axis=None), np.concatenate(list(yours[name]), axis=None)
            )


@pytest.mark.parametrize("word", ["u4", "u8"])
@pytest.mark.parametrize("apart", [False, True])
@pytest.mark.parametrize("packing", ["", "zlib"])
@pytest.mark.parametrize("form", ["binary", "base64"])
def test_base64_of_any_length(form: str, packing: str, apart: bool, word: str, tmp_path: Path) -> None:
    """The end of the size of an array, and of the numbers behind it, may or may not be padded."""
    path = tmp_path / "a.vtu"
    for count in range(9):
        grid = plate(NODES, CELLS)
        grid.arrays["FieldData", "x"] = np.arange(count, dtype=np.uint8)
        path.write_bytes(write_vtu(grid, Mode(form, packing, word=word, apart=apart)))
        np.testing.assert_array_equal(read_vtu(path, "file").field_data["x"], np.arange(count))


def test_pieces_and_kinds_that_alternate_are_put_together(tmp_path: Path) -> None:
    """Each kind is one block, however the kinds alternate; cells of a second piece count its own nodes."""
    text = write_vtu(_plate(1), Mode("ascii")).decode()
    begin, end = text.index("<Piece"), text.index("</Piece>") + len("</Piece>")
    path = tmp_path / "a.vtu"
    path.write_text(text[:end] + text[begin:])
    (block,) = read_vtu(path, "file").cells
    np.testing.assert_array_equal(block.data, np.concatenate([CELLS, CELLS + 5]))
    grid = plate(NODES, CELLS)
    grid.arrays["Cells", "connectivity"] = np.array([0, 1, 2, 0, 1, 0, 2, 3])
    grid.arrays["Cells", "offsets"], grid.arrays["Cells", "types"] = np.array([3, 5, 8]), np.array([5, 3, 5])
    grid.arrays["CellData", "gmsh:physical"] = np.array([11, 1, 11])
    path.write_bytes(write_vtu(grid))
    mesh = read_mesh(path)
    assert mesh.boundaries["1"].tolist() == [[0, 1]]
    assert len(mesh.regions["11"]) == mesh.number_of_cells == 2


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ({("Cells", "connectivity"): [0, 1, -1]}, "refers to a node that is not in it"),
        ({("Cells", "connectivity"): [0, 1, 5]}, "refers to a node that is not in it"),
        ({("Cells", "connectivity"): [0.0, 1.0, 2.0]}, "connectivity of its cells are not whole numbers"),
        ({("Cells", "offsets"): [2]}, "offsets of its cells do not belong to their types"),
        ({("Cells", "types"): [7]}, "cells of type polygon, which are not read"),
        ({("Cells", "types"): [42]}, "cells of type polyhedron"),
        ({("Cells", "types"): [-3]}, "cells of type -3 of VTK"),
        ({("Points", "Points"): [[np.nan, 0.0, 0.0]] * 5}, "points are not finite"),
        ({("PointData", "u"): [1.0, 2.0]}, "'u' has not the 5 rows"),
        ({("Cells", "types"): [5, 5]}, "'types' has not the 1 rows"),
    ],
)
@pytest.mark.parametrize("mode", [Mode("ascii"), Mode(packing="zlib")], ids=["ascii", "zlib"])
def test_what_does_not_belong_together_is_refused(fault: dict, says: str, mode: Mode, tmp_path: Path) -> None:
    grid = plate(NODES, CELLS[:1])
    grid.arrays |= {key: np.array(values) for key, values in fault.items()}
    path = tmp_path / "a.vtu"
    path.write_bytes(write_vtu(grid, mode))
    with pytest.raises(FileError, match=says) as caught:
        read_vtu(path, "mesh file")
    assert str(caught.value).startswith(f"mesh file '{path}': ")


def test_bombs_are_refused_before_they_are_unpacked(tmp_path: Path) -> None:
    """All kinds, by what their heads and counts say: within a second and 64 MiB each, whatever they would unpack to."""
    seen = set()
    for number in range(11):
        data, note = bomb(random.Random(f"bomb {number}"))
        if note in seen:
            continue
        seen.add(note)
        path = tmp_path / "a.vtu"
        path.write_bytes(data)
        tracemalloc.start()
        begun = time.process_time()
        try:
            with pytest.raises(FileError):
                read_vtu(path, "file")
            taken = tracemalloc.get_traced_memory()[1]
        finally:
            tracemalloc.stop()
        assert taken < (64 << 20) + 8 * len(data), note
        assert time.process_time() - begun < 10.0, note
    assert len(seen) > 5


def test_the_budget_is_that_of_the_file_and_is_shared_by_pieces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.vtu"
    path.write_bytes(write_vtu(plate(NODES, CELLS, u=np.zeros((5, 3))), Mode(packing="zlib")))
    monkeypatch.setattr(reader, "BUDGET", (1000, 0))
    assert len(read_vtu(path, "file").points) == 5
    with pytest.raises(FileError, match=r"would unpack to more than .* MiB, far more than a file of its size"):
        read_vtu(path, "file", share=4)
    monkeypatch.setattr(reader, "BUDGET", (0, 20))
    assert len(read_vtu(path, "file", share=4).points) == 5


def test_forged_files_end_in_one_sentence_or_in_a_grid(tmp_path: Path) -> None:
    path, refused, said = tmp_path / "a.vtu", 0, []
    for number in range(200):
        rng = random.Random(f"forged {number}")
        grid, _ = forged(_plate(2), rng)
        path.write_bytes(write_vtu(grid, rng.choice(MODES)))
        try:
            found = read_vtu(path, "file")
        except FileError as error:
            refused += 1
            said.append(str(error))
        else:
            assert np.isfinite(found.points).all()
            assert all(block.data.min() >= 0 and block.data.max() < len(found.points) for block in found.cells)
    assert refused > 120
    assert not any("\n" in text for text in said)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (b'<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "DOCTYPE"),
        (b"<a>" * 40 + b"</a>" * 40, "more than 32 in one another"),
        (b"<a>" + b"<b/>" * 200_001 + b"</a>", "more than 200000 elements"),
        (b"<a", "not readable XML"),
        (b"<?xml version='1.0' encoding='none'?><a/>", "not readable XML"),
        (b"", "not readable XML"),
    ],
)
def test_xml_is_bounded(text: bytes, says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        parse_xml(text)
