"""Frames of a body as a film shows them: from a history, or from a PVD file with its VTU files."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hemivar.basics.disk import path_of, read_bytes, shown
from hemivar.basics.plain_xml import parse_xml
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import FileError, ProblemError
from hemivar.evolution.history import History
from hemivar.files.snapshot import snapshot
from hemivar.files.vtu import CELL_TYPES
from hemivar.mesh.vtu_grid import CellGrid, GridBlock, read_vtu
from hemivar.solvers import NormalState, TangentialState
from hemivar.solvers.contact_states import ContactStates

__all__ = ["Film", "FilmFrame", "film_of", "read_film"]


@dataclass(frozen=True, eq=False)
class FilmFrame:
    """A body at one time."""

    time: float
    displacement: Array  # (nodes, d)
    velocity: Array  # (nodes, d)
    places: Array  # (p, d): contact points at rest
    moved: Array  # (p, d): their displacement
    force: Array  # (p, d): force per area of the foundation on the body
    states: ContactStates  # what each contact point does
    gap: Array  # (p,): distance of the foundation from the body at rest, along the normal, with what is worn off it


@dataclass(frozen=True, eq=False)
class Film:
    """A mesh and its frames."""

    points: Array  # (N, d): vertices
    cells: IntArray  # (M, d + 1): of vertices
    times: Array  # (k,)
    title: str
    frame: Callable[[int], FilmFrame]  # of the number of a frame, 0 to k - 1; reads it where it lies in a file
    paired: BoolArray | None = None  # (p,): contact points that touch another body and no foundation; none by default


def film_of(history: History) -> Film:
    """The frames of a history."""
    if not history.frames:
        raise ProblemError("no frames were saved; march(..., save=Save(every=...)) saves them")
    discrete = history.discrete
    if discrete.field.components == 1:
        raise ProblemError(
            f"films show bodies that deform, and this is the {discrete.field.name} of a scalar problem; write its "
            "frames, history.write('run.pvd'), and let ParaView colour and warp them"
        )
    mesh, contact = discrete.field.mesh, discrete.problem.contact
    points = contact.points if contact.points is not None else np.zeros((0, mesh.dim))

    def frame(number: int) -> FilmFrame:
        seen = snapshot(discrete, history.frames[number])
        moved = contact.moved(seen.displacement) if len(points) else points
        force = seen.tractions if len(points) else points
        gap = seen.problem.gap + _worn(seen.memory)
        return FilmFrame(seen.time, seen.displacement, seen.velocity, points, moved, force, seen.states, gap)

    times = np.array([frame.time for frame in history.frames])
    paired = np.isin(contact.boundary, [contact.names.index(name) for name in contact.pairs])
    return Film(mesh.points, mesh.cells, times, discrete.evolution.problem.title, frame, paired)


def _worn(memory: Mapping[str, Array]) -> Array | float:
    """What contact points remember as lost height, by wear or creep of the foundation: their ``depth``."""
    return sum((np.nan_to_num(v) for name, v in memory.items() if name.rpartition(".")[2] == "depth"), 0.0)


def read_film(path: str | Path) -> Film:
    """The frames that a PVD file names, as ``hemivar march FILE --fields run.pvd`` writes them."""
    path = path_of(path)
    name = shown(path)
    try:
        root = parse_xml(read_bytes(path, "PVD file"))
        entries = [(float(entry.attrib["timestep"]), entry.attrib["file"]) for entry in root.iter("DataSet")]
    except FileError:
        raise
    except (KeyError, ValueError) as error:
        raise FileError(
            f"{name}: this is not a PVD file ({error}); 'hemivar march FILE --fields run.pvd' writes one"
        ) from None
    if not entries:
        raise FileError(f"{name}: the list has no frame; save some with --every TIME")
    times = np.array([time for time, _ in entries])
    if not (np.abs(times) < 1e300).all() or (np.diff(times) < 0.0).any():
        raise FileError(f"{name}: its times are not finite and in order; write the list again")
    files = _named_files(path, [file for _, file in entries], (".vtu", ".pvtu"))
    first = _read_frame(files[0])
    kinds = {kind: d for (d, _), kind in CELL_TYPES.items()}
    if len(first.cells) != 1 or first.cells[0].type not in kinds:
        raise FileError(f"{name}: unsupported cell type; pass the .pvd of the body, not that of the contact surface")
    dim = kinds[first.cells[0].type]
    cells = np.asarray(first.cells[0].data[:, : dim + 1], dtype=np.int64)
    used, numbers = np.unique(cells, return_inverse=True)
    vertices = np.asarray(first.points, dtype=float)[used][:, :dim]
    touching = np.flatnonzero(_numbers(first, files[0], "state") >= 0)

    def frame(number: int) -> FilmFrame:
        file = files[number]
        read = _read_frame(file)
        codes = _numbers(read, file, "state")
        at = np.flatnonzero(codes >= 0)
        if (
            len(read.points) != len(first.points)
            or "displacement" not in read.point_data
            or not np.array_equal(at, touching)
        ):
            raise FileError(f"{shown(file.name)}: this is not a frame of the same body; write the list again")
        displacement, velocity, force = (
            _at_nodes(read, file, what, dim) for what in ("displacement", "velocity", "contact_force")
        )
        moving = None  # files written before there was one hold the first numbers of states
        if "tangential_state" in read.point_data:
            moving = np.maximum(_numbers(read, file, "tangential_state")[at], TangentialState.FREE)
        states = ContactStates.of_codes(codes[at], moving)
        # files written before there was one hold the stated gap under the other name
        gap = _at_nodes(read, file, "initial_gap" if "initial_gap" in read.point_data else "gap")
        gap = gap + _worn({what: values for what, values in read.point_data.items() if values.shape == gap.shape})
        places = np.asarray(read.points, dtype=float)[at][:, :dim]
        return FilmFrame(
            float(times[number]), displacement[used], velocity[used], places, displacement[at], force[at], states,
            gap[at],
        )  # fmt: skip

    on = _at_nodes(first, files[0], "boundary") if "boundary" in first.point_data else np.full(len(first.points), -1.0)
    touched = np.setdiff1d(np.flatnonzero(on >= 0), touching)  # sides of other bodies, without contact points
    paired = np.isin(on[touching], on[touched])
    return Film(vertices, numbers.reshape(cells.shape), times, "", frame, paired)


def _at_nodes(grid: CellGrid, file: Path, name: str, width: int = 0) -> Array:
    """Point data, the first components of vectors; zeros where a frame has none of that name."""
    shape = (len(grid.points), width) if width else (len(grid.points),)
    values = np.asarray(grid.point_data.get(name, np.zeros(shape)), dtype=float)
    if values.ndim != len(shape) or (width and values.shape[1] < width) or not np.isfinite(values).all():
        raise FileError(
            f"{shown(file)}: '{shown(name)}' is not a finite number or vector at each point; write it again"
        )
    return values[:, :width] if width else values


def _numbers(grid: CellGrid, file: Path, name: str) -> IntArray:
    """The numbers of the states of contact points among the nodes, -1 elsewhere."""
    if name not in grid.point_data:
        return np.full(len(grid.points), -1)
    numbers = _at_nodes(grid, file, name)
    known = {-1, *TangentialState} | (set(NormalState) if name == "state" else set())
    if not np.isin(numbers, sorted(known)).all():
        raise FileError(f"{shown(file)}: '{name}' holds numbers that are not a contact state; write it again")
    return numbers.astype(np.int64)


def _read_frame(path: Path) -> CellGrid:
    """A frame, its pieces joined if it lies in several."""
    if path.suffix.lower() != ".pvtu":
        return read_vtu(path, "frame")
    try:
        sources = [piece.attrib["Source"] for piece in parse_xml(read_bytes(path, "frame")).iter("Piece")]
    except FileError:
        raise
    except (KeyError, ProblemError) as error:
        raise FileError(f"{shown(path)}: the frame cannot be read ({error}); write it again") from None
    if not sources:
        raise FileError(f"{shown(path)}: the frame has no pieces; write it again")
    pieces = _named_files(path, sources, (".vtu",))
    return _joined(path, [read_vtu(piece, "frame", share=len(pieces)) for piece in pieces])


def _named_files(path: Path, names: list[str], suffixes: tuple[str, ...]) -> list[Path]:
    """The files that a list names: each once, below its own folder, and of the kinds that it may name."""
    for name in names:
        inside = not Path(name).is_absolute() and ".." not in Path(name).parts
        if not inside or Path(name).suffix.lower() not in suffixes:
            raise FileError(
                f"{shown(path)}: it names '{shown(name)[:60]}'; name {' or '.join(suffixes)} files below its own folder"
            )
    if len({Path(name) for name in names}) < len(names):
        raise FileError(f"{shown(path)}: it names a file twice; write it again")
    return [path.parent / name for name in names]


def _joined(path: Path, parts: list[CellGrid]) -> CellGrid:
    """Pieces of one body, the nodes that several of them have once."""
    kinds = {block.type for part in parts for block in part.cells}
    shapes = [{name: np.shape(values)[1:] for name, values in part.point_data.items()} for part in parts]
    if len(kinds) != 1 or any(shape != shapes[0] for shape in shapes) or len({p.points.shape[1] for p in parts}) > 1:
        raise FileError(f"{shown(path)}: its pieces are not parts of one body; write it again")
    every = np.concatenate([part.points for part in parts])
    _, first, number = np.unique(every, axis=0, return_index=True, return_inverse=True)
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    cells = [
        number.ravel()[block.data + start] for part, start in zip(parts, starts, strict=False) for block in part.cells
    ]
    data = {name: np.concatenate([part.point_data[name] for part in parts])[first] for name in parts[0].point_data}
    return CellGrid(every[first], [GridBlock(kinds.pop(), np.concatenate(cells))], point_data=data)
