"""VTU files by code of our own: a writer of small ones in all modes of the format, and what is forged or a bomb."""

from __future__ import annotations

import base64
import lzma
import random
import zlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

__all__ = ["MODES", "Grid", "Mode", "bomb", "forged", "plate", "write_vtu"]

_NAMES = {"f": "Float", "i": "Int", "u": "UInt"}
_KIND = {2: 5, 3: 10}


@dataclass(frozen=True)
class Mode:
    """How a file is written.

    Attributes
    ----------
    form : str
        ``ascii``, ``binary``, ``raw`` or ``base64`` (the latter two appended).
    packing : str
        ``zlib``, ``lzma`` or none.
    order : str
        ``<`` or ``>``.
    word : str
        ``u4`` or ``u8``.
    apart : bool
        Whether the size of an array that is not compressed is encoded apart from it.
    """

    form: str = "binary"
    packing: str = ""
    order: str = "<"
    word: str = "u4"
    apart: bool = False


MODES = (
    Mode("ascii"),
    Mode(apart=True),
    Mode("base64", word="u8", apart=True),
    *(
        Mode(form, packing, order, word)
        for form in ("binary", "raw", "base64")
        for packing in ("", "zlib", "lzma")
        for order in "<>"
        for word in ("u4", "u8")
    ),
)


@dataclass
class Grid:
    """What a file states; every part may be forged before it is written.

    Attributes
    ----------
    arrays : dict of (section, name) to array
        Sections are ``Points``, ``Cells``, ``PointData``, ``CellData`` and ``FieldData``.
    counts : dict
        Attributes of the piece.
    types : dict of name to text
        Types of arrays, where they are not those of the numbers.
    components : dict of name to text
        The same of their components.
    head : function or None
        Given the head of each array, as a list of numbers; returns another one.
    """

    arrays: dict[tuple[str, str], np.ndarray]
    counts: dict[str, Any] = field(default_factory=dict)
    types: dict[str, str] = field(default_factory=dict)
    components: dict[str, str] = field(default_factory=dict)
    head: Callable[[str, list[int]], list[int]] | None = None


def plate(nodes: np.ndarray, cells: np.ndarray, **point_data: np.ndarray) -> Grid:
    """A body of triangles or tetrahedra."""
    count, width = cells.shape
    arrays = {
        ("Points", "Points"): np.column_stack([nodes, np.zeros((len(nodes), 3 - nodes.shape[1]))]),
        ("Cells", "connectivity"): cells.ravel(),
        ("Cells", "offsets"): width * np.arange(1, count + 1),
        ("Cells", "types"): np.full(count, _KIND[width - 1], dtype=np.uint8),
    }
    arrays |= {("PointData", name): values for name, values in point_data.items()}
    return Grid(arrays, {"NumberOfPoints": len(nodes), "NumberOfCells": count})


def write_vtu(grid: Grid, mode: Mode = Mode(), block: int = 256) -> bytes:
    """The bytes of a file; compressed in blocks of so many bytes."""
    sections: dict[str, str] = {}
    appended = b""
    for (section, name), values in grid.arrays.items():
        kind = grid.types.get(name, f"{_NAMES[values.dtype.kind]}{8 * values.dtype.itemsize}")
        width = grid.components.get(name, "" if values.ndim == 1 else str(values.shape[1]))
        words = f'type="{kind}" Name="{name}"' + (f' NumberOfComponents="{width}"' if width else "")
        text = ""
        if mode.form == "ascii":
            words += ' format="ascii"'
            text = " ".join(map(repr, values.ravel().tolist()))
        else:
            packed = _packed(grid, mode, name, values.astype(values.dtype.newbyteorder(mode.order)).tobytes(), block)
            if mode.form == "binary":
                words, text = f'{words} format="binary"', packed.decode()
            else:
                words += f' format="appended" offset="{len(appended)}"'
                appended += packed
        line = f"<DataArray {words}>{text}</DataArray>\n"
        sections[section] = sections.get(section, "") + line
    before = "".join(f"<{s}>\n{t}</{s}>\n" for s, t in sections.items() if s == "FieldData")
    inside = "".join(f"<{s}>\n{t}</{s}>\n" for s, t in sections.items() if s != "FieldData")
    counts = " ".join(f'{name}="{count}"' for name, count in grid.counts.items())
    compressor = {"": "", "zlib": ' compressor="vtkZLibDataCompressor"', "lzma": ' compressor="vtkLZMADataCompressor"'}
    order = {"<": "LittleEndian", ">": "BigEndian"}[mode.order]
    long = ' header_type="UInt64"' if mode.word == "u8" else ""
    text = (
        f'<?xml version="1.0"?>\n<VTKFile type="UnstructuredGrid" version="{"1.0" if long else "0.1"}" '
        f'byte_order="{order}"{long}{compressor[mode.packing]}>\n<UnstructuredGrid>\n{before}<Piece {counts}>\n{inside}'
        f"</Piece>\n</UnstructuredGrid>\n"
    )
    if mode.form in ("raw", "base64"):
        text += f'<AppendedData encoding="{mode.form}">\n_'
        return text.encode() + appended + b"\n</AppendedData>\n</VTKFile>\n"
    return f"{text}</VTKFile>\n".encode()


def _packed(grid: Grid, mode: Mode, name: str, data: bytes, size: int) -> bytes:
    """An array with its head."""
    code = (lambda b: b) if mode.form == "raw" else base64.b64encode
    blocks = [data[k : k + size] for k in range(0, len(data), size)] if mode.packing else [data]
    head = [len(data)]
    if mode.packing:
        pack = zlib.compress if mode.packing == "zlib" else lzma.compress
        last = len(blocks[-1]) % size if blocks else 0
        blocks = [pack(one) for one in blocks]
        head = [len(blocks), size, last, *map(len, blocks)]
    if grid.head is not None:
        head = grid.head(name, head)
    first = np.array([n % 2 ** (8 * int(mode.word[1])) for n in head], dtype=f"{mode.order}{mode.word}").tobytes()
    body = b"".join(blocks)
    return code(first + body) if not mode.packing and not mode.apart else code(first) + code(body)


# ---- faults ------------------------------------------------------------------------------------------------------


def forged(grid: Grid, rng: random.Random) -> tuple[Grid, str]:
    """A grid of which one thing is wrong, and which."""
    arrays = {key: values.copy() for key, values in grid.arrays.items()}
    nodes, cells = grid.counts["NumberOfPoints"], grid.counts["NumberOfCells"]
    wild = rng.choice([0, -1, 1, nodes, nodes - 1, cells + 1, 255, 2**31, 2**32 - 1, 10**12, 2**63, 2**64 - 1, 10**30])
    section, name = rng.choice(list(arrays))
    values = arrays[section, name]
    match rng.randrange(10):
        case 0:
            key = rng.choice(list(grid.counts))
            new = rng.choice([wild, "", "x", "1e3", "nan"])
            return replace(grid, counts={**grid.counts, key: new}), f"{key} = {new!r}"
        case 1:
            kind = rng.choice(["Int8", "UInt64", "Int32", "Float32", "Float64", "String", "", "Bit", "Int128"])
            return replace(grid, types={name: kind}), f"{name} of type {kind!r}"
        case 2:
            width = str(rng.choice([wild, "x", " ", 2, 9]))
            return replace(grid, components={name: width}), f"{name} of {width} components"
        case 3:
            place = rng.randrange(4)

            def head(which: str, given: list[int]) -> list[int]:
                if which == name and given:
                    given[min(place, len(given) - 1)] = wild
                return given

            return replace(grid, head=head), f"number {place} of the head of {name} is {wild}"
        case 4 | 5:
            key = rng.choice([("Cells", "connectivity"), ("Cells", "offsets"), ("Cells", "types")])
            row = rng.randrange(len(arrays[key]))
            wide = arrays[key].astype(np.int64)
            wide[row] = rng.choice([-1, 0, nodes, 2**31, 2**62, -(2**62), 42, 7, 9, 22, 1, 3])
            arrays[key] = wide
            return replace(grid, arrays=arrays), f"{key[1]}[{row}] = {wide[row]}"
        case 6 | 7:
            if values.dtype.kind == "f" and values.size:
                strange = rng.choice([np.nan, np.inf, -np.inf, 1e308, -1e300, 1e160, 1e17, 1e-310])
                with np.errstate(over="ignore"):
                    values[rng.randrange(len(values))] = strange
                return replace(grid, arrays=arrays), f"{name} has {strange}"
            arrays[section, name] = values.astype(float)
            return replace(grid, arrays=arrays), f"{name} in floating point"
        case 8:
            arrays[section, name] = values[: rng.randrange(len(values) + 1)]
            return replace(grid, arrays=arrays), f"{name} of {len(arrays[section, name])} rows"
        case _:
            del arrays[section, name]
            return replace(grid, arrays=arrays), f"without {name}"


_BLOCKS: dict[tuple[str, int], bytes] = {}


def bomb(rng: random.Random) -> tuple[bytes, str]:
    """A small file that would take gigabytes: by compression, by one place read often, or by XML."""
    match rng.randrange(6):
        case 0 | 1:
            packing, size = rng.choice([("zlib", 24 << 21), ("lzma", 24 << 19)])
            if (packing, size) not in _BLOCKS:
                _BLOCKS[packing, size] = (zlib if packing == "zlib" else lzma).compress(bytes(size))
            block, count = _BLOCKS[packing, size], rng.choice([22, 40, 100])
            lie = rng.choice([size, size, 240])  # what the head says of each
            head = np.array([count, lie, lie, *[len(block)] * count], dtype="<u4").tobytes()
            array = base64.b64encode(head) + base64.b64encode(block * count)
            rows = count * lie // 24 if rng.random() < 0.5 else 3
            points = f'<DataArray type="Float64" NumberOfComponents="3" format="binary">{array.decode()}</DataArray>'
            return _shell(points, rows, packing), f"{packing}, {count} blocks of {size}, said to be {lie}, {rows} rows"
        case 2:
            count = rng.choice([10**3, 10**4])
            one = '<DataArray type="Float64" Name="a%d" NumberOfComponents="3" format="appended" offset="0"/>'
            text = _shell(one % 0, 1 << 15, "", "".join(one % k for k in range(count)))
            data = np.array([24 << 15], dtype="<u4").tobytes() + bytes(24 << 15)
            whole = text.replace(b"</VTKFile>", b'<AppendedData encoding="raw">_' + data)
            return whole + b"</AppendedData></VTKFile>", f"{count} arrays of one place"
        case 3:
            entities = b'<!ENTITY a "' + b"x" * 100 + b'">'
            entities += b"".join(b'<!ENTITY %c "%s">' % (c, b"&%c;" % (c - 1) * 20) for c in b"bcdefgh")
            return b'<?xml version="1.0"?><!DOCTYPE VTKFile [' + entities + b"]><VTKFile>&h;</VTKFile>", "entities"
        case 4:
            depth = rng.choice([10**3, 10**6])
            return b"<a>" * depth + b"</a>" * depth, f"XML {depth} deep"
        case _:
            count = rng.choice([10**5, 10**6])
            return b'<VTKFile type="UnstructuredGrid">' + b"<a/>" * count + b"</VTKFile>", f"{count} elements"


def _shell(points: str, rows: int, packing: str, more: str = "") -> bytes:
    """A file with these points."""
    packer = {"zlib": 'compressor="vtkZLibDataCompressor"', "lzma": 'compressor="vtkLZMADataCompressor"', "": ""}
    return (
        f'<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian" {packer[packing]}><UnstructuredGrid>'
        f'<Piece NumberOfPoints="{rows}" NumberOfCells="0"><Points>{points}</Points><PointData>{more}</PointData>'
        "</Piece></UnstructuredGrid></VTKFile>"
    ).encode()
