"""VTU files, the unstructured grids of VTK in XML, read within bounds that are known before anything is unpacked.

The format is that of https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html.  A file is refused rather
than guessed at: sizes that do not belong together, cells with nodes that are not there, points that are not finite.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from hemivar.basics.disk import read_bytes, regular_file, shown
from hemivar.basics.memory import require
from hemivar.basics.plain_xml import parse_xml
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import FileError, ProblemError
from hemivar.mesh.kinds import CODES, KINDS, VTK_KINDS, unknown_kind
from hemivar.mesh.vtu_arrays import NUMBERS, Packing, VtuArray, short, whole

__all__ = ["BUDGET", "CellGrid", "GridBlock", "blocks_of", "checked_nodes", "read_vtu", "widths_of"]

#: A file may unpack to so many bytes whatever its size, and to so many times its size if that is more.
BUDGET = (256 * 2**20, 20)
#: Bytes of memory for each byte of a file, and of what it unpacks to.
_OF_FILE, _OF_ARRAYS = 3.0, 2.0
_VERSIONS = ("0.1", "1.0", "2.0", "2.1", "2.2", "2.3")
#: Name in meshio and number of nodes of the kinds of cells that are read, by their numbers in VTK.
_KINDS = {number: (KINDS[CODES[name]].name, KINDS[CODES[name]].nodes) for number, name in VTK_KINDS.items()}
#: Nodes of pixels and voxels in the order of quadrilaterals and hexahedra.
_TURNED = {8: [0, 1, 3, 2], 11: [0, 1, 3, 2, 4, 5, 7, 6]}
_OTHER_KINDS = {
    2: "poly-vertex", 4: "poly-line", 6: "triangle strip", 7: "polygon", 35: "cubic line", 42: "polyhedron",
    68: "Lagrange line", 69: "Lagrange triangle", 70: "Lagrange quadrilateral", 71: "Lagrange tetrahedron",
    72: "Lagrange hexahedron",
}  # fmt: skip
_WIDTHS = np.array([_KINDS.get(kind, ("", 0))[1] for kind in range(max(_KINDS) + 1)])


@dataclass(frozen=True, eq=False)
class GridBlock:
    """Cells of one kind."""

    type: str  # as in meshio
    data: IntArray  # (k, n): their nodes


@dataclass(frozen=True, eq=False)
class CellGrid:
    """An unstructured grid, under the names of meshio."""

    points: Array  # (N, 3)
    cells: list[GridBlock]
    point_data: dict[str, AnyArray] = field(default_factory=dict)  # (N, ...)
    cell_data: dict[str, list[AnyArray]] = field(default_factory=dict)
    field_data: dict[str, AnyArray] = field(default_factory=dict)


def read_vtu(path: str | Path, what: str, most_bytes: int = 1 << 62, share: int = 1) -> CellGrid:
    """The grid in a VTU file, in ASCII, base64 or appended, compressed by zlib or LZMA or not at all.

    Cells come in one block for each kind, in the order of the file within it; its pieces are put together.
    """
    size = regular_file(path, what, most_bytes).stat().st_size
    named = f"{what} '{shown(path)}'"
    least, ratio = BUDGET
    try:
        require(_OF_FILE * size, "reading it", "take a coarser mesh")
        return _read(read_bytes(path, what, max(size, 1)), max(least // share, ratio * size))
    except FileError:
        raise
    except ProblemError as error:
        raise FileError(f"{named}: {error}") from error
    except MemoryError as error:
        raise FileError(f"{named} needs more memory than there is; take a coarser mesh") from error


def _read(data: bytes, budget: int) -> CellGrid:
    """Sizes first, numbers after them."""
    text, appended = _appended(data)
    root = parse_xml(text)
    if root.tag != "VTKFile" or root.get("type") != "UnstructuredGrid":
        raise ProblemError("it is not an unstructured grid of VTK (VTKFile, UnstructuredGrid); save it as VTU")
    if root.get("version", "0.1") not in _VERSIONS:
        raise ProblemError(
            f"it is in version {short(root.get('version'))} of the format; save it in one from 0.1 to 2.3"
        )
    packing = Packing(root, appended, budget)
    grids = root.findall("UnstructuredGrid")
    pieces = [_Piece(packing, piece) for grid in grids for piece in grid.findall("Piece")]
    if len(grids) != 1 or not pieces:
        raise ProblemError("it holds no piece of a grid, or more than one grid; save it again")
    numbers = [one for one in grids[0].findall("FieldData/DataArray") if one.get("type") in NUMBERS]  # others are texts
    fields = {_name(one): packing.array(one) for one in numbers}
    require(_OF_ARRAYS * packing.declared, "what it unpacks to", "take a coarser mesh")
    points = _joined([piece.points for piece in pieces])
    if not np.isfinite(points).all():
        raise ProblemError("its points are not finite coordinates; save it again")
    at_points = _of_all([piece.at_points for piece in pieces])
    in_cells = _of_all([piece.in_cells for piece in pieces])
    connected, start = [], 0
    for piece in pieces:
        nodes, types = piece.connected()
        connected.append((nodes + start, types))
        start += piece.nodes
    blocks, rows = blocks_of(*(np.concatenate(parts) for parts in zip(*connected, strict=True)))
    return CellGrid(
        points,
        blocks,
        point_data=at_points,
        cell_data={name: [values[own] for own in rows] for name, values in in_cells.items()},
        field_data={name: array.read() for name, array in fields.items()},
    )


class _Piece:
    """The arrays of a piece, their sizes checked as far as that can be before they are unpacked."""

    def __init__(self, packing: Packing, element: Element) -> None:
        self.nodes, self.cells = whole(element, "NumberOfPoints"), whole(element, "NumberOfCells")
        points = element.findall("Points/DataArray")
        if len(points) != 1:
            raise ProblemError("a piece holds no points, or more than one array of them; save it again")
        self.points = packing.array(points[0], self.nodes, components=3)
        own = {_name(one): one for one in element.findall("Cells/DataArray")} if self.cells else {}
        if self.cells and not {"connectivity", "offsets", "types"} <= own.keys():
            raise ProblemError("its cells lack connectivity, offsets or types; save it again")
        rows = {"connectivity": None, "offsets": self.cells, "types": self.cells}
        self.of_cells = {name: packing.array(own[name], rows[name]) for name in rows if name in own}
        self.at_points, self.in_cells = (
            {_name(one): packing.array(one, rows) for one in element.findall(f"{tag}/DataArray")}
            for tag, rows in (("PointData", self.nodes), ("CellData", self.cells))
        )

    def connected(self) -> tuple[IntArray, IntArray]:
        """Nodes of all cells, one cell after the other, and the kind of each."""
        if not self.cells:
            return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
        types, ends = self._integers("types"), self._integers("offsets")
        if not np.array_equal(np.diff(ends, prepend=0), widths_of(types)):
            raise ProblemError("the offsets of its cells do not belong to their types; save it again")
        self.of_cells["connectivity"].expect(int(ends[-1]))
        nodes = self._integers("connectivity")
        return checked_nodes(nodes, self.nodes), types

    def _integers(self, name: str) -> IntArray:
        values = self.of_cells[name].read().ravel()
        if values.dtype.kind not in "iu":
            raise ProblemError(f"the {name} of its cells are not whole numbers; save it again")
        return values.astype(np.int64, copy=False)  # what is too large for it becomes negative, and is refused


def _appended(data: bytes) -> tuple[bytes, bytes | str]:
    """The XML of a file without what is appended to it, and that, raw or as text in base64."""
    match = re.compile(rb"<AppendedData\b([^>]*)>").match(data, max(data.find(b"<AppendedData"), 0))
    if match is None or match.group(1).endswith(b"/"):
        return data, ""
    begin, end = data.find(b"_", match.end()), data.rfind(b"</AppendedData>")
    if begin < 0 or end < begin:
        raise ProblemError("what is appended to it is cut off; save it again")
    raw = re.search(rb"encoding\s*=\s*[\"']raw[\"']", match.group(1))
    appended = data[begin + 1 : end]
    try:
        return data[: match.end()] + data[end:], appended if raw else appended.decode("ascii").strip()
    except UnicodeDecodeError:
        raise ProblemError("the data appended to it are not base64; save it again") from None


def widths_of(types: IntArray) -> IntArray:
    """Numbers of nodes of cells of these types of VTK; kinds that are not read are refused."""
    unknown = sorted(set(np.unique(types).tolist()) - set(_KINDS))
    if unknown:
        raise ProblemError(unknown_kind(", ".join(_OTHER_KINDS.get(kind, f"{kind} of VTK") for kind in unknown[:8])))
    return np.asarray(_WIDTHS[types], dtype=np.int64)


def checked_nodes(nodes: IntArray, count: int) -> IntArray:
    """Nodes of cells, refused where there are none of that number."""
    if len(nodes) and (nodes.min() < 0 or nodes.max() >= count):
        raise ProblemError("a cell refers to a node that is not in it; save it again")
    return nodes


def blocks_of(nodes: IntArray, types: IntArray) -> tuple[list[GridBlock], list[IntArray | slice]]:
    """Cells by kind, in the order in which the kinds appear, and which of all cells those of each block are."""
    if len(types) and (types == types[0]).all():
        kind = int(types[0])
        name, width = _KINDS[kind]
        return [GridBlock(name, _in_order(kind, nodes.reshape(-1, width)))], [slice(None)]
    kinds, first = np.unique(types, return_index=True)
    ends = np.cumsum(_WIDTHS[types])
    blocks: list[GridBlock] = []
    rows: list[IntArray | slice] = []
    for kind in kinds[np.argsort(first)].tolist():
        name, width = _KINDS[kind]
        own = np.flatnonzero(types == kind)
        blocks.append(GridBlock(name, _in_order(kind, nodes[ends[own][:, None] + np.arange(-width, 0)])))
        rows.append(own)
    return blocks, rows


def _in_order(kind: int, nodes: IntArray) -> IntArray:
    """Nodes of cells (k, n) as quadrilaterals and hexahedra have them."""
    return nodes[:, _TURNED[kind]] if kind in _TURNED else nodes


def _of_all(pieces: Sequence[Mapping[str, VtuArray]]) -> dict[str, AnyArray]:
    """The arrays of the first piece, which all have, each one piece after the other."""
    if any(pieces[0].keys() - piece.keys() for piece in pieces):
        raise ProblemError("its pieces hold arrays of other names than one another; save it again")
    return {name: _joined([piece[name] for piece in pieces]) for name in pieces[0]}


def _joined(parts: Sequence[VtuArray]) -> AnyArray:
    if len({part.components for part in parts}) > 1:
        raise ProblemError(f"its array '{parts[0].name}' has other components in other pieces; save it again")
    return parts[0].read() if len(parts) == 1 else np.concatenate([part.read() for part in parts])


def _name(element: Element) -> str:
    name = element.get("Name")
    if name is None:
        raise ProblemError("one of its arrays has no name; save it again")
    return name
