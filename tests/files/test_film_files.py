"""Lists of frames and frames in pieces: what they may name, and what a frame must hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hemivar.errors import FileError
from hemivar.files.film import read_film
from tests.robustness.vtu import Grid, plate, write_vtu

NODES = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
CELLS = np.array([[0, 1, 2], [0, 2, 3]])


def _frame(cells: np.ndarray = CELLS, **changed: object) -> Grid:
    """A square, or some of its cells with their own nodes."""
    used, own = np.unique(cells, return_inverse=True)
    data = {"displacement": np.column_stack([-0.1 * NODES, np.zeros(4)]), "state": np.array([1, 2, -1, -1]), **changed}
    return plate(NODES[used], own.reshape(cells.shape), **{name: np.asarray(v)[used] for name, v in data.items()})


def _listed(folder: Path, *files: str, times: tuple[str, ...] = ()) -> Path:
    shown = times or tuple(map(str, range(len(files))))
    lines = [f'<DataSet timestep="{t}" file="{file}"/>' for t, file in zip(shown, files, strict=True)]
    (folder / "run.pvd").write_text(f"<VTKFile>{''.join(lines)}</VTKFile>")
    return folder / "run.pvd"


def _in_pieces(folder: Path, *sources: str) -> Path:
    pieces = "".join(f'<Piece Source="{source}"/>' for source in sources)
    (folder / "a.pvtu").write_text(f"<VTKFile><PUnstructuredGrid>{pieces}</PUnstructuredGrid></VTKFile>")
    return _listed(folder, "a.pvtu")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, cells in (("a", CELLS), ("left", CELLS[1:]), ("right", CELLS[:1])):
        (tmp_path / f"{name}.vtu").write_bytes(write_vtu(_frame(cells)))
    return tmp_path


def test_pieces_are_one_body(folder: Path) -> None:
    whole, parts = read_film(_listed(folder, "a.vtu")), read_film(_in_pieces(folder, "left.vtu", "right.vtu"))
    assert len(parts.points) == 4
    assert sorted(map(sorted, parts.points[parts.cells].tolist())) == sorted(
        map(sorted, whole.points[whole.cells].tolist())
    )
    for film in (whole, parts):
        frame = film.frame(0)
        np.testing.assert_array_equal(frame.displacement, -0.1 * film.points)
        assert sorted(zip(frame.states.codes.tolist(), frame.places.tolist(), strict=True)) == [
            (1, [0.0, 0.0]),
            (2, [1.0, 0.0]),
        ]


@pytest.mark.parametrize(
    ("sources", "says"),
    [
        (["a.pvtu"], r"it names 'a\.pvtu'; name \.vtu files below its own folder"),
        (["../left.vtu"], "below its own folder"),
        (["/dev/zero"], "below its own folder"),
        (["left.vtu", "./left.vtu"], "names a file twice"),
        (["left.vtu", "other.vtu"], "not parts of one body"),
        ([], "the frame has no pieces"),
    ],
)
def test_pieces_that_are_none(sources: list[str], says: str, folder: Path) -> None:
    other = _frame()
    del other.arrays["PointData", "state"]
    (folder / "other.vtu").write_bytes(write_vtu(other))
    with pytest.raises(FileError, match=says):
        read_film(_in_pieces(folder, *sources))


@pytest.mark.parametrize(
    ("files", "times", "says"),
    [
        (["a.vtu", "a.vtu"], ["0", "1"], "names a file twice"),
        (["a.vtu", "left.vtu"], ["1", "0"], "not finite and in order"),
        (["a.vtu"], ["nan"], "not finite and in order"),
        (["run.pvd"], ["0"], r"name \.vtu or \.pvtu files"),
        (["../a.vtu"], ["0"], "below its own folder"),
    ],
)
def test_lists_that_are_none(files: list[str], times: list[str], says: str, folder: Path) -> None:
    with pytest.raises(FileError, match=says):
        read_film(_listed(folder, *files, times=tuple(times)))


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"displacement": np.full((4, 3), np.nan)}, "'displacement' is not a finite number or vector"),
        ({"displacement": np.zeros(4)}, "'displacement' is not a finite number or vector"),
        ({"gap": np.zeros((4, 2))}, "'gap' is not a finite number or vector"),
        ({"state": np.array([0.5, 1.0, 1.0, 1.0])}, "'state' holds numbers that are not a contact state"),
        ({"state": np.array([1, -1, -1, -1])}, "not a frame of the same body"),
    ],
)
def test_frames_hold_what_is_drawn(changed: dict, says: str, folder: Path) -> None:
    (folder / "b.vtu").write_bytes(write_vtu(_frame(**changed)))
    film = read_film(_listed(folder, "a.vtu", "b.vtu"))
    with pytest.raises(FileError, match=says):
        film.frame(1)
