"""Gmsh files by code of our own: a writer of small ones, and a strict reader of those in ASCII.

The reader is the measure of what the library accepts: what it refuses as malformed must not be solved.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field

import numpy as np

__all__ = ["FORMATS", "MalformedError", "MshMesh", "grid_mesh", "read_msh", "write_msh"]

#: Versions and modes that :func:`write_msh` knows.
FORMATS = tuple((version, binary) for version in ("2.2", "4.0", "4.1") for binary in (False, True))

_KIND = {1: (1, 2), 2: (2, 3), 4: (3, 4), 15: (0, 1)}
_TYPE = {0: 15, 1: 1, 2: 2, 3: 4}


class MalformedError(Exception):
    """The file does not say what it should."""


@dataclass
class MshMesh:
    """A mesh as a Gmsh file states it.

    Attributes
    ----------
    nodes : dict of node number to coordinates
    elements : list of (dimension, group, entity, nodes)
        ``group`` is the number of the physical group, 0 for none.
    names : dict of (dimension, group) to name
    """

    nodes: dict[int, tuple[float, float, float]]
    elements: list[tuple[int, int, int, tuple[int, ...]]]
    names: dict[tuple[int, int], str] = field(default_factory=dict)

    @property
    def dim(self) -> int:
        return max((e[0] for e in self.elements), default=0)

    def group(self, dim: int, name: str) -> list[tuple[int, ...]]:
        """Elements of all groups of this name."""
        return [e[3] for e in self.elements if e[0] == dim and e[1] and self.names.get((dim, e[1]), str(e[1])) == name]

    def coordinates(self) -> dict[int, np.ndarray]:
        return {number: np.array(place) for number, place in self.nodes.items()}


def grid_mesh(nx: int, ny: int, nz: int = 0, regions: int = 1, length: float = 1.0) -> MshMesh:
    """A rectangle or box of simplices with the sides as groups; regions are slices along x."""
    dim = 3 if nz else 2
    counts = [nx, ny, nz][:dim]
    shape = [n + 1 for n in counts]
    places = np.stack(np.meshgrid(*(np.arange(n) for n in shape), indexing="ij"), axis=-1).reshape(-1, dim)
    coordinates = np.zeros((len(places), 3))
    coordinates[:, :dim] = length * places / np.array(counts)
    nodes = {i + 1: (float(p[0]), float(p[1]), float(p[2])) for i, p in enumerate(coordinates)}
    number = np.arange(len(places)).reshape(shape) + 1
    cells: list[tuple[int, tuple[int, ...]]] = []
    paths = [(0, 1, 2), (0, 2, 1), (1, 0, 2), (1, 2, 0), (2, 0, 1), (2, 1, 0)] if dim == 3 else [(0, 1), (1, 0)]
    for corner in np.ndindex(*counts):
        for path in paths:
            at = list(corner)
            cell = [int(number[tuple(at)])]
            for axis in path:
                at[axis] += 1
                cell.append(int(number[tuple(at)]))
            cells.append((min(corner[0] * regions // nx, regions - 1), tuple(cell)))
    elements: list[tuple[int, int, int, tuple[int, ...]]] = []
    names: dict[tuple[int, int], str] = {}
    sides = {"left": (0, 0), "right": (0, nx), "bottom": (dim - 1, 0), "top": (dim - 1, counts[-1])}
    if dim == 3:
        sides |= {"front": (1, 0), "back": (1, ny)}
    local = [[j for j in range(dim + 1) if j != i] for i in range(dim + 1)]
    for group, (name, (axis, value)) in enumerate(sides.items(), start=1):
        names[dim - 1, group] = name
        for _, cell in cells:
            for chosen in local:
                facet = tuple(cell[j] for j in chosen)
                if all(places[v - 1][axis] == value for v in facet):
                    elements.append((dim - 1, group, group, facet))
    for region in range(regions):
        names[dim, 11 + region] = "body" if regions == 1 else f"part{region + 1}"
    elements += [(dim, 11 + region, 1 + region, cell) for region, cell in cells]
    return MshMesh(nodes, elements, names)


def write_msh(mesh: MshMesh, version: str = "4.1", binary: bool = False) -> bytes:
    """The bytes of a Gmsh file."""
    if version == "2.2":
        return _write_2(mesh, binary)
    return _write_4(mesh, version, binary)


def _head(mesh: MshMesh, version: str, binary: bool) -> list[bytes]:
    out = [f"$MeshFormat\n{version} {int(binary)} 8\n".encode()]
    if binary:
        out.append(struct.pack("<i", 1) + b"\n")
    out.append(b"$EndMeshFormat\n$PhysicalNames\n")
    out.append(f"{len(mesh.names)}\n".encode())
    out += [f'{dim} {group} "{name}"\n'.encode() for (dim, group), name in sorted(mesh.names.items())]
    out.append(b"$EndPhysicalNames\n")
    return out


def _write_2(mesh: MshMesh, binary: bool) -> bytes:
    out = _head(mesh, "2.2", binary)
    out.append(f"$Nodes\n{len(mesh.nodes)}\n".encode())
    for number, place in mesh.nodes.items():
        out.append(struct.pack("<i3d", number, *place) if binary else f"{number} {_row(place)}\n".encode())
    out.append(b"\n" * binary + f"$EndNodes\n$Elements\n{len(mesh.elements)}\n".encode())
    for number, (dim, group, entity, nodes) in enumerate(mesh.elements, start=1):
        if binary:
            out.append(struct.pack(f"<6i{len(nodes)}i", _TYPE[dim], 1, 2, number, group, entity, *nodes))
        else:
            out.append(f"{number} {_TYPE[dim]} 2 {group} {entity} {' '.join(map(str, nodes))}\n".encode())
    out.append(b"\n" * binary + b"$EndElements\n")
    return b"".join(out)


def _row(place: tuple[float, ...]) -> str:
    return " ".join(repr(c) for c in place)


def _write_4(mesh: MshMesh, version: str, binary: bool) -> bytes:
    out = _head(mesh, version, binary)
    new = version == "4.1"
    blocks: dict[tuple[int, int], list[tuple[int, ...]]] = {}
    groups: dict[tuple[int, int], int] = {}
    for dim, group, entity, nodes in mesh.elements:
        blocks.setdefault((dim, entity), []).append(nodes)
        groups[dim, entity] = group
    by_dim = [sorted(key for key in blocks if key[0] == dim) for dim in range(4)]
    box = [min(c) for c in zip(*mesh.nodes.values(), strict=True)] + [
        max(c) for c in zip(*mesh.nodes.values(), strict=True)
    ]
    out.append(b"$Entities\n")
    counts = [len(keys) for keys in by_dim]
    out.append(struct.pack("<4Q", *counts) if binary else (" ".join(map(str, counts)) + "\n").encode())
    long = "Q"  # sizes are 64 bits wide in both versions
    for keys in by_dim:
        for dim, entity in keys:
            group = groups[dim, entity]
            physical = [group] if group else []
            bounded = dim > 0
            if binary:
                corners = box if dim > 0 or not new else box[:3]
                out.append(struct.pack(f"<i{len(corners)}d", entity, *corners))
                out.append(struct.pack(f"<{long}{len(physical)}i", len(physical), *physical))
                out.append(struct.pack(f"<{long}", 0) if bounded else b"")
            else:
                corners = box if dim > 0 or not new else box[:3]
                words = [str(entity), _row(tuple(corners)), str(len(physical)), *map(str, physical)]
                out.append((" ".join(words + (["0"] if bounded else [])) + "\n").encode())
    out.append(b"\n" * binary + b"$EndEntities\n$Nodes\n")
    top = by_dim[mesh.dim][0]
    numbers = list(mesh.nodes)
    least, most = min(numbers), max(numbers)
    if binary:
        out.append(struct.pack("<4Q", 1, len(numbers), least, most) if new else struct.pack("<2Q", 1, len(numbers)))
        pair = (top[0], top[1]) if new else (top[1], top[0])
        out.append(struct.pack("<3iQ", *pair, 0, len(numbers)))
        if new:
            out.append(struct.pack(f"<{len(numbers)}Q", *numbers))
            out += [struct.pack("<3d", *place) for place in mesh.nodes.values()]
        else:
            out += [struct.pack("<i3d", number, *place) for number, place in mesh.nodes.items()]
    else:
        out.append((f"1 {len(numbers)} {least} {most}\n" if new else f"1 {len(numbers)}\n").encode())
        pair = (top[0], top[1]) if new else (top[1], top[0])
        out.append(f"{pair[0]} {pair[1]} 0 {len(numbers)}\n".encode())
        if new:
            out += [f"{number}\n".encode() for number in numbers]
            out += [f"{_row(place)}\n".encode() for place in mesh.nodes.values()]
        else:
            out += [f"{number} {_row(place)}\n".encode() for number, place in mesh.nodes.items()]
    out.append(b"\n" * binary + b"$EndNodes\n$Elements\n")
    total = len(mesh.elements)
    if binary:
        out.append(struct.pack("<4Q", len(blocks), total, 1, total) if new else struct.pack("<2Q", len(blocks), total))
    else:
        out.append((f"{len(blocks)} {total} 1 {total}\n" if new else f"{len(blocks)} {total}\n").encode())
    number = 0
    for (dim, entity), members in sorted(blocks.items()):
        pair = (dim, entity) if new else (entity, dim)
        if binary:
            out.append(struct.pack("<3iQ", *pair, _TYPE[dim], len(members)))
        else:
            out.append(f"{pair[0]} {pair[1]} {_TYPE[dim]} {len(members)}\n".encode())
        for nodes in members:
            number += 1
            word = "Q" if new else "i"
            if binary:
                out.append(struct.pack(f"<{len(nodes) + 1}{word}", number, *nodes))
            else:
                out.append(f"{number} {' '.join(map(str, nodes))}\n".encode())
    out.append(b"\n" * binary + b"$EndElements\n")
    return b"".join(out)


# ---- the strict reader -------------------------------------------------------------------------------------


class _Words:
    """The words of a section, taken one by one."""

    def __init__(self, lines: list[str]) -> None:
        self.words = " ".join(lines).split()
        self.next = 0

    def take(self) -> str:
        if self.next >= len(self.words):
            raise MalformedError("a section ends early")
        self.next += 1
        return self.words[self.next - 1]

    def whole(self, least: int | None = None) -> int:
        word = self.take()
        if not word.lstrip("+-").isascii() or not word.lstrip("+-").isdigit():
            raise MalformedError(f"'{word[:20]}' is not a whole number")
        value = int(word)
        if least is not None and value < least:
            raise MalformedError(f"{value} is less than {least}")
        return value

    def number(self) -> float:
        word = self.take()
        try:
            value = float(word)
        except ValueError:
            raise MalformedError(f"'{word[:20]}' is not a number") from None
        if not math.isfinite(value) or "_" in word:
            raise MalformedError(f"'{word[:20]}' is not a finite number")
        return value

    def end(self) -> None:
        if self.next != len(self.words):
            raise MalformedError(f"a section goes on with '{self.words[self.next][:20]}'")


def read_msh(data: bytes) -> MshMesh:
    """Read an ASCII file of version 2.2, 4.0 or 4.1.

    Raises
    ------
    MalformedError
        Whatever is not as the format has it: counts, numbers that are not numbers, nodes that are not there or are
        there twice, sections that do not end.
    NotImplementedError
        Binary files.
    """
    sections: dict[str, list[str]] = {}
    inside: str | None = None
    text = data.removeprefix(b"\xef\xbb\xbf").decode("latin-1").replace("\r\n", "\n")
    for line in text.split("\n"):
        line = line.strip()
        if inside is None:
            if not line:
                continue
            if not line.startswith("$") or line.startswith("$End"):
                raise MalformedError(f"'{line[:20]}' stands outside of all sections")
            inside = line[1:]
            if inside in sections:
                raise MalformedError(f"two sections {inside}")
            sections[inside] = []
        elif line == f"$End{inside}":
            inside = None
        else:
            sections[inside].append(line)
            if inside == "MeshFormat" and len(line.split()) > 1 and line.split()[1] == "1":
                raise NotImplementedError("binary")
    if inside is not None:
        raise MalformedError(f"the section {inside} does not end")
    for needed in ("MeshFormat", "Nodes", "Elements"):
        if needed not in sections:
            raise MalformedError(f"there is no section {needed}")
    words = sections["MeshFormat"][0].split() if sections["MeshFormat"] else []
    if len(words) != 3 or words[0] not in ("2.2", "4", "4.0", "4.1") or words[1] != "0" or words[2] != "8":
        raise MalformedError("the format is not one of 2.2, 4.0 and 4.1 in ASCII")
    names = _names(sections.get("PhysicalNames"))
    mesh = _read_2(sections) if words[0] == "2.2" else _read_4(sections, words[0] == "4.1")
    mesh.names = names
    for _, _, _, nodes in mesh.elements:
        if any(n not in mesh.nodes for n in nodes):
            raise MalformedError("an element has a node that is not there")
        if len(set(nodes)) != len(nodes):
            raise MalformedError("an element has one node twice")
    return mesh


def _names(lines: list[str] | None) -> dict[tuple[int, int], str]:
    if lines is None:
        return {}
    if not lines or not lines[0].isdigit() or len(lines) != int(lines[0]) + 1:
        raise MalformedError("the number of names is not that of their lines")
    names: dict[tuple[int, int], str] = {}
    for line in lines[1:]:
        parts = line.split(None, 2)
        if len(parts) != 3:
            raise MalformedError(f"'{line[:30]}' names no group")
        try:
            key = int(parts[0]), int(parts[1])
        except ValueError:
            raise MalformedError(f"'{line[:30]}' names no group") from None
        if key in names or not 0 <= key[0] <= 3:
            raise MalformedError(f"group {key} is named twice, or has no dimension")
        names[key] = parts[2].strip('"').encode("latin-1").decode("utf-8", "replace")
    return names


def _add(nodes: dict[int, tuple[float, float, float]], number: int, place: tuple[float, float, float]) -> None:
    if number in nodes:
        raise MalformedError(f"node {number} is there twice")
    nodes[number] = place


def _read_2(sections: dict[str, list[str]]) -> MshMesh:
    words = _Words(sections["Nodes"])
    nodes: dict[int, tuple[float, float, float]] = {}
    for _ in range(words.whole(0)):
        _add(nodes, words.whole(1), (words.number(), words.number(), words.number()))
    words.end()
    words = _Words(sections["Elements"])
    elements = []
    for _ in range(words.whole(0)):
        words.whole()  # its number, which nothing refers to
        kind = words.whole()
        if kind not in _KIND:
            raise MalformedError(f"elements of type {kind}")
        tags = [words.whole() for _ in range(words.whole(0))]
        dim, count = _KIND[kind]
        chosen = tuple(words.whole(1) for _ in range(count))
        # a negative group is that of an element of the other orientation
        elements.append((dim, abs(tags[0]) if tags else 0, tags[1] if len(tags) > 1 else 0, chosen))
    words.end()
    return MshMesh(nodes, elements)


def _read_4(sections: dict[str, list[str]], new: bool) -> MshMesh:
    groups: dict[tuple[int, int], list[int]] = {}
    if "Entities" in sections:
        words = _Words(sections["Entities"])
        counts = [words.whole(0) for _ in range(4)]
        for dim, count in enumerate(counts):
            for _ in range(count):
                entity = words.whole()
                for _ in range(3 if dim == 0 and new else 6):
                    words.number()
                groups[dim, entity] = [words.whole() for _ in range(words.whole(0))]
                if dim:
                    for _ in range(words.whole(0)):
                        words.whole()
        words.end()
    words = _Words(sections["Nodes"])
    blocks, total = words.whole(0), words.whole(0)
    if new:
        words.whole(), words.whole()
    nodes: dict[int, tuple[float, float, float]] = {}
    for _ in range(blocks):
        first, second = words.whole(), words.whole()
        dim = first if new else second
        parametric = words.whole(0)
        count = words.whole(0)
        extra = dim if parametric else 0
        if new:
            numbers = [words.whole(1) for _ in range(count)]
            for number in numbers:
                _add(nodes, number, (words.number(), words.number(), words.number()))
                for _ in range(extra):
                    words.number()
        else:
            for _ in range(count):
                _add(nodes, words.whole(1), (words.number(), words.number(), words.number()))
                for _ in range(extra):
                    words.number()
    words.end()
    if len(nodes) != total:
        raise MalformedError(f"{len(nodes)} nodes, but {total} were announced")
    words = _Words(sections["Elements"])
    blocks, total = words.whole(0), words.whole(0)
    if new:
        words.whole(), words.whole()
    elements, total_found = [], 0
    for _ in range(blocks):
        first, second = words.whole(), words.whole()
        dim, entity = (first, second) if new else (second, first)
        kind, count = words.whole(), words.whole(0)
        if kind not in _KIND or _KIND[kind][0] != dim:
            raise MalformedError(f"elements of type {kind} on an entity of dimension {dim}")
        tags = groups.get((dim, entity), [])
        for _ in range(count):
            words.whole()  # its number, which nothing refers to
            total_found += 1
            chosen = tuple(words.whole(1) for _ in range(_KIND[kind][1]))
            elements += [(dim, abs(tag), entity, chosen) for tag in (tags or [0])]
    words.end()
    if total_found != total:
        raise MalformedError(f"{total_found} elements, but {total} were announced")
    return MshMesh(nodes, elements)
