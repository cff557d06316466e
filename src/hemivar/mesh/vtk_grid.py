"""Legacy files of VTK (.vtk), versions 1 to 5.1, text and binary: unstructured grids and the data of their cells."""

from __future__ import annotations

import numpy as np

from hemivar.basics.disk import shown
from hemivar.basics.types import AnyArray, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.texts import floats, whole
from hemivar.mesh.vtu_grid import CellGrid, blocks_of, checked_nodes, widths_of

__all__ = ["is_unstructured_vtk", "parse_vtk"]

_TYPES = {
    "char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2", "int": "i4", "unsigned_int": "u4",
    "long": "i8", "unsigned_long": "u8", "float": "f4", "double": "f8", "vtkidtype": "i8", "bit": "u1",
    **{f"vtktype{kind}{8 * size}": f"{kind[0]}{size}" for kind in ("int", "uint") for size in (1, 2, 4, 8)},
}  # fmt: skip
#: Components of an attribute of each kind.
_ATTRIBUTES = {"VECTORS": 3, "NORMALS": 3, "TENSORS": 9, "TENSORS6": 6, "GLOBAL_IDS": 1, "PEDIGREE_IDS": 1}


def is_unstructured_vtk(start: bytes) -> bool:
    """Whether this is the beginning of a file of an unstructured grid."""
    lines = start.split(b"\n", 5)
    return start.startswith(b"# vtk DataFile") and any(
        line.split() == [b"DATASET", b"UNSTRUCTURED_GRID"] for line in lines
    )


def parse_vtk(data: bytes) -> CellGrid:
    """The grid in the bytes of a file."""
    return _Reader(data).read()


class _Reader:
    """Goes through the sections of a file."""

    def __init__(self, data: bytes) -> None:
        self.data, self.offset = data, 0
        self.version = self._line()[-1]
        self._line()
        self.binary = self._line() == ["BINARY"]
        self.points: AnyArray = np.zeros((0, 3))
        self.nodes: IntArray = np.zeros(0, dtype=np.int64)
        self.ends: IntArray = np.zeros(0, dtype=np.int64)
        self.types: IntArray = np.zeros(0, dtype=np.int64)
        self.cell_data: dict[str, AnyArray] = {}
        self.count, self.of_cells, self.mixed = 0, False, False

    def _line(self) -> list[str]:
        """The words of the next line that has some; none at the end."""
        while self.offset < len(self.data):
            end = self.data.find(b"\n", self.offset)
            end = len(self.data) if end < 0 else end
            words = self.data[self.offset : end].decode("latin-1").split()
            self.offset = end + 1
            if words:
                return words
        return []

    def _array(self, kind: str, count: int, what: str) -> AnyArray:
        """So many numbers of a type."""
        if kind.lower() not in _TYPES:
            raise ProblemError(f"{shown(what)} is of type '{shown(kind)}', which VTK does not have; save it again")
        form = np.dtype(_TYPES[kind.lower()]).newbyteorder(">")
        if self.binary:
            size = count * form.itemsize
            if count < 0 or self.offset + size > len(self.data):
                raise ProblemError(f"{shown(what)} is cut off; save the file again")
            numbers: AnyArray = np.frombuffer(self.data, form, count, self.offset)
            self.offset += size
            return numbers.astype(form.newbyteorder("="))
        words: list[str] = []
        while len(words) < count and (line := self._line()):
            words += line
        if len(words) != count:
            raise ProblemError(f"{shown(what)} has {len(words)} numbers in place of {count}; save the file again")
        return floats(words, what) if form.kind == "f" else whole(words, what)

    def read(self) -> CellGrid:
        while words := self._line():
            self._section(words[0].upper(), words)
        if not len(self.types) or not len(self.points):
            raise ProblemError("it holds no points or no cells; save it as an unstructured grid")
        widths = widths_of(self.types)
        if self.mixed:  # the number of its nodes stands before each cell
            starts = np.cumsum(widths + 1) - (widths + 1)
            fits = len(self.nodes) == (widths + 1).sum() and np.array_equal(self.nodes[starts], widths)
            nodes = np.delete(self.nodes, starts) if fits else self.nodes
        else:
            fits, nodes = np.array_equal(np.diff(self.ends), widths), self.nodes
        if not fits or len(nodes) != widths.sum():
            raise ProblemError("its cells do not belong to their types; save it again")
        blocks, rows = blocks_of(checked_nodes(nodes, len(self.points)), self.types)
        data = {name: [values[own] for own in rows] for name, values in self.cell_data.items()}
        return CellGrid(self.points.astype(float), blocks, cell_data=data)

    def _section(self, key: str, words: list[str]) -> None:
        if key == "POINTS":
            self.points = self._array(words[2], 3 * self._size(words, 1), "POINTS").reshape(-1, 3)
        elif key == "CELLS" and self.version >= "5.1":
            self.ends = self._array(self._line()[1], self._size(words, 1), "OFFSETS").astype(np.int64)
            self.nodes = self._array(self._line()[1], self._size(words, 2), "CONNECTIVITY").astype(np.int64)
        elif key == "CELLS":
            self.nodes, self.mixed = self._array("int", self._size(words, 2), "CELLS").astype(np.int64), True
        elif key == "CELL_TYPES":
            self.types = self._array("int", self._size(words, 1), "CELL_TYPES").astype(np.int64)
        elif key in ("CELL_DATA", "POINT_DATA"):
            self.count, self.of_cells = self._size(words, 1), key == "CELL_DATA"
        elif key == "METADATA":
            while self.offset < len(self.data) and self.data[self.offset : self.data.find(b"\n", self.offset)].strip():
                self.offset = self.data.find(b"\n", self.offset) + 1
        elif key == "FIELD":
            self._field(self._size(words, 2))
        elif key == "SCALARS":
            if self._line()[:1] != ["LOOKUP_TABLE"]:
                raise ProblemError(f"SCALARS {shown(words[1])} lacks its LOOKUP_TABLE; save it again")
            self._keep(words[1], words[2], int(words[3]) if len(words) > 3 else 1)
        elif key in _ATTRIBUTES:
            self._keep(words[1], words[2], _ATTRIBUTES[key])
        elif key == "TEXTURE_COORDINATES":
            self._keep(words[1], words[3], self._size(words, 2))
        elif key == "COLOR_SCALARS":
            self._array("unsigned_char" if self.binary else "float", self.count * self._size(words, 2), key)
        elif key == "LOOKUP_TABLE":
            self._array("unsigned_char" if self.binary else "float", 4 * self._size(words, 2), key)
        elif key != "DATASET":
            raise ProblemError(
                f"a section should begin at '{shown(' '.join(words)[:40])}'; it is damaged: save it again"
            )

    def _size(self, words: list[str], at: int) -> int:
        return int(whole(words[at : at + 1] or [""], words[0])[0])

    def _field(self, count: int) -> None:
        for _ in range(count):
            words = self._line()
            while words[:1] == ["METADATA"]:
                self._section("METADATA", words)
                words = self._line()
            if len(words) != 4:
                raise ProblemError("an array of a FIELD has no name, sizes and type; it is damaged: save it again")
            width, rows = self._size(words, 1), self._size(words, 2)
            if words[3] == "string":
                raise ProblemError(f"its array '{shown(words[0])}' holds texts; save it as VTU")
            values = self._array(words[3], width * rows, words[0])
            if self.of_cells and rows == len(self.types):
                self.cell_data[words[0]] = values.reshape(rows, width) if width > 1 else values

    def _keep(self, name: str, kind: str, width: int) -> None:
        values = self._array(kind, self.count * width, name)
        if self.of_cells and self.count == len(self.types):
            self.cell_data[name] = values.reshape(-1, width) if width > 1 else values
