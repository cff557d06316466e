"""Names of files that no mesh can come from, and formats of meshio."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np
import pytest

import hemivar.basics.memory as machine
from hemivar.errors import ProblemError
from hemivar.mesh import read_mesh

SQUARE = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
CELLS = np.array([[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize(("name", "start", "need"), [("a.msh", b"", 6), ("a.inp", b"", 12), ("a.bdf", b"GRID,1\n", 28)])
def test_mesh_files_are_held_against_the_memory(
    name: str, start: bytes, need: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / name
    with path.open("wb") as stream:
        stream.write(start)
        stream.truncate(2**30)
    monkeypatch.setattr(machine, "available_bytes", lambda: (need - 2) * 2.0**30)
    with pytest.raises(
        ProblemError, match=rf"{name}' of 1024 MiB needs about {need} GiB of memory, and {need - 2} GiB"
    ):
        read_mesh(path)


@pytest.mark.parametrize(
    "suffix", ["vtu", "vtk", "inp", "mesh", "xdmf", "stl", "obj", "ply", "nas", "off", "su2", "", "h5m"]
)
@pytest.mark.parametrize("data", [b"", b"garbage\n", b"\0\1\2\3" * 100, b"*NODE\n1, 1e, 0\n", b"(0 garbage"])
def test_garbage_in_any_format_is_one_sentence_and_silent(
    suffix: str, data: bytes, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"part.{suffix}"
    path.write_bytes(data)
    with pytest.raises(ProblemError) as caught:
        read_mesh(path)
    text = str(caught.value)
    assert str(path) in text
    assert "\n" not in text
    assert "meshio" not in text.lower()
    captured = capfd.readouterr()
    assert captured.out == ""
    assert captured.err == ""


@pytest.mark.parametrize("cells", [[[0, 1, 9]], [[0, 1, -1]]])
def test_cells_of_other_formats_are_checked(cells: list, tmp_path: Path) -> None:
    path = tmp_path / "part.vtu"
    meshio.Mesh(SQUARE, [("triangle", np.array(cells))]).write(path)
    with pytest.raises(ProblemError, match="refers to a node that is not in it"):
        read_mesh(path)


def test_negative_numbers_of_nodes_do_not_count_from_the_end(tmp_path: Path) -> None:
    path = tmp_path / "part.off"
    path.write_text("OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 -1\n")
    with pytest.raises(ProblemError, match="refers to a node that is not in it"):
        read_mesh(path)


def test_coordinates_of_other_formats_are_checked(tmp_path: Path) -> None:
    path = tmp_path / "part.vtu"
    meshio.Mesh(SQUARE * [[np.nan], [1], [1], [1]], [("triangle", CELLS)]).write(path)
    with pytest.raises(ProblemError, match="not finite"):
        read_mesh(path)
