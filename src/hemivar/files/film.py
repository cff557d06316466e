"""Frames of a body as a film shows them: from a history, or from a PVD file with its VTU files."""

from __future__ import annotations

import contextlib
import io
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.disk import path_of, read_text, regular_file, shown
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.errors import FileError, ProblemError
from hemivar.evolution.history import History
from hemivar.files.snapshot import snapshot
from hemivar.files.vtu import CELL_TYPES
from hemivar.solvers import ContactStates

if TYPE_CHECKING:
    import meshio

__all__ = ["Film", "FilmFrame", "film_of", "read_film"]


@dataclass(frozen=True, eq=False)
class FilmFrame:
    """A body at one time.

    Attributes
    ----------
    time : float
    displacement, velocity : arrays (nodes, d)
    places : array (p, d)
        Contact points at rest.
    moved : array (p, d)
        Their displacement.
    force : array (p, d)
        Force per area of the foundation on the body.
    states : ContactStates
        What each contact point does.
    gap : array (p,)
        Distance of the foundation from the body at rest, along the normal, with what is worn off it.
    """

    time: float
    displacement: Array
    velocity: Array
    places: Array
    moved: Array
    force: Array
    states: ContactStates
    gap: Array


@dataclass(frozen=True, eq=False)
class Film:
    """A mesh and its frames.

    Attributes
    ----------
    points : array (N, d)
        Vertices.
    cells : int array (M, d + 1)
        Of vertices.
    times : array (k,)
    title : str
    frame : function
        Of the number of a frame, 0 to k - 1; reads it where it lies in a file.
    """

    points: Array
    cells: IntArray
    times: Array
    title: str
    frame: Callable[[int], FilmFrame]


def film_of(history: History) -> Film:
    """The frames of a history.

    Parameters
    ----------
    history : History

    Returns
    -------
    Film

    Raises
    ------
    ProblemError
        Nothing was saved, or it is a scalar problem.
    """
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
    at_nodes = contact.node >= 0 if contact.points is not None else np.zeros(0, dtype=bool)

    def frame(number: int) -> FilmFrame:
        seen = snapshot(discrete, history.frames[number])
        moved = np.zeros_like(points)
        moved[at_nodes] = seen.displacement[contact.node[at_nodes]]
        for k, name in enumerate(contact.names):
            here = ~at_nodes & (contact.boundary == k)
            moved[here] = seen.displacement[mesh.boundaries[name][contact.facet[here]]].mean(axis=1)
        force = seen.tractions if len(points) else points
        gap = seen.problem.contact.gap + _worn(seen.memory)
        return FilmFrame(seen.time, seen.displacement, seen.velocity, points, moved, force, seen.states, gap)

    times = np.array([one.time for one in history.frames])
    return Film(mesh.points, mesh.cells, times, discrete.evolution.problem.title, frame)


def _worn(memory: Mapping[str, Array]) -> Array | float:
    """What contact points remember as lost height, by wear or creep of the foundation: their ``depth``."""
    return sum((np.nan_to_num(v) for name, v in memory.items() if name.rpartition(".")[2] == "depth"), 0.0)


def read_film(path: str | Path) -> Film:
    """The frames that a PVD file names, as ``hemivar march FILE --fields run.pvd`` writes them.

    Parameters
    ----------
    path : str or Path
        Name of the PVD file.

    Returns
    -------
    Film

    Raises
    ------
    FileError
        The file cannot be read, is no such list, or names a file that is missing or of another kind.
    """
    path = path_of(path)
    name = shown(path)
    text = read_text(path, "PVD file")
    try:
        root = ElementTree.fromstring(text)
        entries = [(float(entry.attrib["timestep"]), entry.attrib["file"]) for entry in root.iter("DataSet")]
    except (ElementTree.ParseError, KeyError, ValueError) as error:
        raise FileError(
            f"{name}: this is no PVD file ({error}); 'hemivar march FILE --fields run.pvd' writes one"
        ) from None
    if not entries:
        raise FileError(f"{name}: the list holds no frame; let the march save some, --every TIME")
    times = np.array([time for time, _ in entries])
    first = _read_vtu(path.parent / entries[0][1])
    kinds = {kind: (d, order) for (d, order), kind in CELL_TYPES.items()}
    blocks = [(block, *kinds[block.type]) for block in first.cells if block.type in kinds]
    if len(blocks) != 1:
        raise FileError(f"{name}: its frames are no bodies of triangles or tetrahedra; name the list of the bodies")
    block, dim, _ = blocks[0]
    cells = np.asarray(block.data[:, : dim + 1], dtype=np.int64)
    used, numbers = np.unique(cells, return_inverse=True)
    vertices = np.asarray(first.points, dtype=float)[used][:, :dim]

    def frame(number: int) -> FilmFrame:
        read = _read_vtu(path.parent / entries[number][1])
        data = {key: np.asarray(values) for key, values in read.point_data.items()}
        if "displacement" not in data or len(read.points) != len(first.points):
            raise FileError(f"{shown(entries[number][1])}: this is no frame of the same body; write the list anew")
        displacement = data["displacement"][:, :dim]
        state = data.get("state", np.full(len(displacement), -1)).astype(np.int64)
        at = np.flatnonzero(state >= 0)
        moving = data.get("tangential_state")  # files written before there was one hold the first numbers of states
        states = ContactStates.of_codes(state[at], None if moving is None else moving[at].astype(np.int64))
        places = np.asarray(read.points, dtype=float)[at][:, :dim]
        none = np.zeros(len(displacement))
        force = data.get("contact_force", np.zeros((len(displacement), 3)))[at][:, :dim]
        gap = data.get("gap", none)[at] + np.broadcast_to(_worn(data), none.shape)[at]
        velocity = data.get("velocity", np.zeros((len(displacement), 3)))[used][:, :dim]
        return FilmFrame(
            float(times[number]), displacement[used], velocity, places, displacement[at], force, states, gap
        )

    return Film(vertices, numbers.reshape(cells.shape), times, "", frame)


def _read_vtu(path: Path) -> meshio.Mesh:
    """A frame as meshio reads it, its pieces joined if it lies in several."""
    with IMPORTS:
        import meshio

    regular_file(path, "frame", 1 << 62)
    if path.suffix.lower() == ".pvtu":
        return _joined([_read_vtu(piece) for piece in _pieces(path)])
    noise = io.StringIO()
    try:
        with contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
            return meshio.vtu.read(path)
    except (Exception, SystemExit) as error:
        raise FileError(f"{shown(path)}: the frame cannot be read ({error}); write it anew") from None


def _pieces(path: Path) -> list[Path]:
    """The files of a frame that lies in pieces."""
    try:
        found = [path.parent / piece.attrib["Source"] for piece in ElementTree.parse(path).getroot().iter("Piece")]
    except (ElementTree.ParseError, KeyError) as error:
        raise FileError(f"{shown(path)}: the frame cannot be read ({error}); write it anew") from None
    if not found:
        raise FileError(f"{shown(path)}: the frame has no pieces; write it anew")
    return found


def _joined(parts: list[meshio.Mesh]) -> meshio.Mesh:
    """Pieces of one body, the nodes that several of them have once."""
    with IMPORTS:
        import meshio

    every = np.concatenate([part.points for part in parts])
    _, first, number = np.unique(every, axis=0, return_index=True, return_inverse=True)
    starts = np.cumsum([0, *(len(part.points) for part in parts)])
    cells = [number.ravel()[part.cells[0].data + start] for part, start in zip(parts, starts, strict=False)]
    data = {name: np.concatenate([part.point_data[name] for part in parts])[first] for name in parts[0].point_data}
    return meshio.Mesh(every[first], [(parts[0].cells[0].type, np.concatenate(cells))], point_data=data)
