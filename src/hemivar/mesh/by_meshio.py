"""Mesh files that meshio reads, and the names of groups in its data."""

from __future__ import annotations

import contextlib
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.disk import first_bytes, read_bytes, shown
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import AnyArray, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.exodus import is_classic_netcdf
from hemivar.mesh.hdf5 import HDF5, format_of_hdf5, refuse_unwritten
from hemivar.mesh.kinds import CODES, KINDS, unknown_kind
from hemivar.mesh.raw import MOST_GROUPS, RawMesh
from hemivar.mesh.tetgen import tetgen_faces
from hemivar.mesh.vtk_grid import is_unstructured_vtk, parse_vtk
from hemivar.mesh.vtu_grid import CellGrid, read_vtu

if TYPE_CHECKING:
    import meshio

__all__ = ["format_of", "read_by_meshio"]

#: Cell data that number groups; 0 is no group.
_TAGS = (
    "gmsh:physical", "medit:ref", "tetgen:ref", "cell_tags", "CellEntityIds", "flac3d:group",
    "avsucd:material",
)  # fmt: skip
#: Cell data that number something else.
_NO_TAGS = ("gmsh:geometrical", "gmsh:bounding_entities", "vtkGhostType")
#: Elements of Medit that meshio does not know.
_CURVED = re.compile(
    rb"^\s*((?:Edges|Triangles|Quadrilaterals|Tetrahedra|Hexahedra|Prisms|Pyramids)[PQ]\d)\s", re.MULTILINE
)
#: How files of other formats begin.
_SIGNS = {
    "vtu": re.compile(rb"<VTKFile[^>]*type\s*=\s*[\"']UnstructuredGrid"),
    "vtk": re.compile(rb"\A# vtk DataFile"),
    "medit": re.compile(rb"\A\s*MeshVersionFormatted"),
    "tecplot": re.compile(rb"^\s*VARIABLES\s*=", re.MULTILINE | re.IGNORECASE),
}
#: Triangles of WKT, with n in the place of numbers and without blanks beside what parts them.
_NUMBER = re.compile(rb"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_AROUND = re.compile(rb" ?([(),]) ?")
_TIN = re.compile(rb"TIN ?Z?\(\(\(n n n(?:,n n n){3}\)\)(?:,\(\(n n n(?:,n n n){3}\)\))*\)")
#: What to do about a file that cannot be read.
_SAVE = "save it as Gmsh 2.2 or 4.1, Abaqus, Nastran or VTU"


def format_of(path: Path, start: bytes) -> str:
    """The format of a file that begins so; empty where only its name tells."""
    if start.startswith(HDF5):
        return format_of_hdf5(path)
    return (
        "exodus"
        if is_classic_netcdf(start)
        else next((name for name, sign in _SIGNS.items() if sign.search(start)), "")
    )


def read_by_meshio(path: Path, formats: Sequence[str] = ()) -> RawMesh:
    """What a file holds, of a format that meshio reads, or of VTK, whose data are alike; by its suffix where none is
    given.
    """
    grid = _read(path, formats or _by_suffix(path))
    raw, places = _elements(grid)
    for name, parts in _sets(grid):
        for number, rows in parts:
            _add(raw, (KINDS[CODES[grid.cells[number].type]].dim, name), places[number], rows)
    raw.at_nodes.update(_node_sets(grid))
    raw.notes.extend(
        f"array '{name}' numbers more than {MOST_GROUPS} groups; it was ignored"
        for name, values in grid.cell_data.items()
        if _numbers_groups(name, values) and _count(values) > MOST_GROUPS
    )
    if path.suffix.lower() in (".ele", ".node"):
        tetgen_faces(path, raw)
    return raw


def _read(path: Path, formats: Sequence[str]) -> meshio.Mesh | CellGrid:
    if formats[0] == "vtu":
        return read_vtu(path, "mesh file")
    start = first_bytes(path, 1024, "mesh file")
    if formats[0] == "vtk" and is_unstructured_vtk(start):
        return parse_vtk(read_bytes(path, "mesh file", path.stat().st_size))
    if start.startswith(HDF5):
        refuse_unwritten(path)
    if formats[0] == "wkt":  # its reader tries for ever to match what is no such text
        shape = _NUMBER.sub(b"n", read_bytes(path, "mesh file", path.stat().st_size).strip())
        if not _TIN.fullmatch(_AROUND.sub(rb"\1", b" ".join(shape.split()))):
            raise ProblemError("it is not a TIN of triangles, or it is cut off; save it again")
    return _read_silently(path, formats)


def _by_suffix(path: Path) -> list[str]:
    """The formats that meshio knows by the suffix of a name."""
    with IMPORTS:
        import meshio

    suffixes = ["".join(path.suffixes[-2:]).lower(), path.suffix.lower()]
    formats = [name for suffix in suffixes for name in meshio.extension_to_filetypes.get(suffix, [])]
    if not first_bytes(path, 1, "mesh file"):
        raise ProblemError("cannot be read as a mesh: it is empty")
    if not formats:
        what = (
            f"its suffix '{shown(path.suffix)}' stands for no format that is read"
            if path.suffix
            else "its name has no suffix"
        )
        raise ProblemError(f"cannot be read as a mesh: {what}; {_SAVE}")
    return formats


def _elements(grid: meshio.Mesh | CellGrid) -> tuple[RawMesh, list[int]]:
    """Points and elements, and the number of the first element of each block."""
    foreign = sorted({block.type for block in grid.cells if len(block.data)} - set(CODES))
    if foreign:
        raise ProblemError(unknown_kind(", ".join(foreign)))
    points = np.asarray(grid.points, dtype=np.float64)
    if points.ndim != 2 or not np.isfinite(points).all():
        raise ProblemError("its points are not finite coordinates; save it again")
    cells: dict[int, list[IntArray]] = {}
    kinds: dict[int, list[IntArray]] = {}
    places = []
    for block in grid.cells:
        kind, data = KINDS[CODES[block.type]], np.asarray(block.data)
        if data.dtype.kind not in "iu" or data.ndim != 2 or (data.size and not _within(data, len(points))):
            raise ProblemError("a cell refers to a node that is not in it; save it again")
        own = cells.setdefault(kind.dim, [])
        places.append(sum(map(len, own)))
        own.append(data.astype(np.int64))
        kinds.setdefault(kind.dim, []).append(np.full(len(data), CODES[kind.name]))
    some = [dim for dim, own in cells.items() if sum(map(len, own))]
    widths = {dim: max(own.shape[1] for own in cells[dim]) for dim in some}
    padded = {
        dim: np.concatenate([np.pad(own, ((0, 0), (0, widths[dim] - own.shape[1])), mode="edge") for own in cells[dim]])
        for dim in some
    }
    return RawMesh(points, padded, {dim: np.concatenate(kinds[dim]) for dim in some}), places


def _within(data: AnyArray, count: int) -> bool:
    return bool(data.min() >= 0 and data.max() < count)


def _add(raw: RawMesh, key: tuple[int, str], start: int, rows: IntArray) -> None:
    raw.groups[key] = np.union1d(raw.groups.get(key, np.zeros(0, dtype=np.int64)), start + rows)


# ---- groups ------------------------------------------------------------------------------------------------------

#: Members of a group, by the number of the block.
_Members = list[tuple[int, IntArray]]


def _sets(grid: meshio.Mesh | CellGrid) -> Iterator[tuple[str, _Members]]:
    """Named groups of elements: sets, then what arrays number."""
    named = set()
    for name, blocks in getattr(grid, "cell_sets", {}).items():
        if name.startswith("gmsh:"):
            continue
        parts = [
            (number, np.asarray(ids, dtype=np.int64))
            for number, ids in enumerate(blocks)
            if ids is not None and len(ids)
        ]
        if not all(_within(rows, len(grid.cells[number].data)) for number, rows in parts):
            raise ProblemError(f"group '{name}' refers to a cell that is not there; save the mesh again")
        named.add(name)
        yield name, parts
    for name, values in grid.cell_data.items():
        if _numbers_groups(name, values) and _count(values) <= MOST_GROUPS:
            for number, tags in enumerate(values):
                for tag in np.unique(tags).tolist():
                    dim = KINDS[CODES[grid.cells[number].type]].dim
                    for group in _names(grid, name, dim, tag):
                        if group not in named:
                            yield group, [(number, np.flatnonzero(np.asarray(tags).ravel() == tag))]


def _numbers_groups(name: str, values: list[AnyArray]) -> bool:
    """Whether cell data hold one whole number for each element."""
    whole = all(np.asarray(value).dtype.kind in "iu" and np.asarray(value).size == len(value) for value in values)
    return whole and name not in _NO_TAGS


def _count(values: list[AnyArray]) -> int:
    return len(np.unique(np.concatenate([np.ravel(value) for value in values])))


def _names(grid: meshio.Mesh | CellGrid, array: str, dim: int, tag: int) -> list[str]:
    """Names of the groups of a number: those that the file gives, the number itself, or array and number."""
    if array not in _TAGS:
        return [f"{array}:{tag}"]
    if not tag:
        return []
    if array == "cell_tags":  # families of MED, which have names or are none
        return list(getattr(grid, "cell_tags", {}).get(tag, []))
    values = {str(key): np.ravel(value) for key, value in grid.field_data.items()}
    known = [key for key, value in values.items() if len(value) == 2 and value[1] == dim and value[0] == tag]
    return known[:1] or [str(tag)]


def _node_sets(grid: meshio.Mesh | CellGrid) -> Iterator[tuple[str, IntArray]]:
    """Named groups of nodes."""
    for name, ids in getattr(grid, "point_sets", {}).items():
        yield name, np.asarray(ids, dtype=np.int64)
    families, tags = getattr(grid, "point_tags", {}), grid.point_data.get("point_tags", np.zeros(0))
    names = {name for family in families.values() for name in family}
    for name in sorted(names):
        own = [tag for tag, family in families.items() if name in family]
        yield name, np.flatnonzero(np.isin(tags, own))


# ---- what meshio says ----------------------------------------------------------------------------------------------


class _Ended:
    """A stream that stops readers who go on beyond its end."""

    past = 0

    def readline(self, *size: int) -> str | bytes:
        return self._some(super().readline(*size))  # type: ignore[misc]

    def read(self, *size: int) -> str | bytes:
        return self._some(super().read(*size))  # type: ignore[misc]

    def _some(self, data: str | bytes) -> str | bytes:
        self.past = 0 if data else self.past + 1
        if self.past > _PAST_THE_END:
            raise EOFError
        return data


class _Text(_Ended, io.TextIOWrapper):  # type: ignore[misc]
    """Of text."""


class _Bytes(_Ended, io.BufferedReader):  # type: ignore[misc]
    """Of bytes."""


#: Formats whose readers take a stream; some would wait for ever for what was cut off.
_TEXTS, _BYTES, _PAST_THE_END = ("tecplot", "permas", "obj", "off"), ("mdpa", "ply", "ansys"), 100


@contextlib.contextmanager
def _stream(path: Path, name: str) -> Iterator[object]:
    """What a reader of meshio is given of a format: a stream where it takes one, else the path."""
    if name not in (*_TEXTS, *_BYTES):
        yield path
        return
    binary = io.FileIO(path)
    with _Bytes(binary) if name in _BYTES else _Text(io.BufferedReader(binary), "utf-8", "replace") as stream:
        yield stream


def _read_silently(path: Path, formats: Sequence[str]) -> meshio.Mesh:
    """The meshio mesh of a file; meshio's printing is swallowed and its failures reported in one line."""
    with IMPORTS:
        import meshio

    reasons, noise = [], io.StringIO()
    for name in formats:
        try:
            with (
                contextlib.redirect_stdout(noise),
                contextlib.redirect_stderr(noise),
                np.errstate(all="ignore"),
                _stream(path, name) as source,
            ):
                return getattr(meshio, name).read(source)
        except MemoryError as error:
            raise ProblemError("it needs more memory than there is; take a coarser mesh") from error
        except ModuleNotFoundError as error:
            raise ProblemError(f"its format is read with the package {error.name}; pip install {error.name}") from error
        except (Exception, SystemExit) as error:
            reasons.append((name, error))
    curved = _CURVED.search(read_bytes(path, "mesh file", path.stat().st_size))
    if curved:
        raise ProblemError(unknown_kind(curved.group(1).decode("ascii")))
    name, why = reasons[0]
    raise ProblemError(f"cannot be read as a mesh of the format {name}{_reason(why)}; {_SAVE}") from why


def _reason(error: BaseException) -> str:
    """What meshio said, in brackets; what Python says when a reader stumbles is not for users."""
    with IMPORTS:
        from meshio import ReadError

    words = " ".join(str(error).split()) if type(error) is ReadError else ""
    words = re.sub(r"(?i)\bmeshio\b", "the reader", words).strip(" .:")
    return f" ({shown(words[:120])})" if words else ": it is cut off, damaged or of another kind"
