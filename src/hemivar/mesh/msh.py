"""Gmsh's own format MSH (2.0 to 2.2, 4.0, 4.1; text and binary), read and checked.

What a file may contain stands in the manual of Gmsh.  Sections that do not matter here (periodic nodes, ghost elements,
parametrizations, fields of post-processing) are passed over.  A file is refused rather than guessed at: numbers that
are not numbers, counts that are wrong, nodes that are missing, cut off files, all in one sentence.
"""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np

from hemivar.basics.disk import shown
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.kinds import CODES, KINDS, ElementKind, unknown_kind
from hemivar.mesh.msh_numbers import (
    Bytes,
    Numbers,
    checked_count,
    first_rows,
    parameters,
    runs,
)
from hemivar.mesh.raw import MOST_GROUPS, Block, RawMesh, put_together

__all__ = ["is_msh", "parse_msh"]

#: Names of the kinds of elements that are read, by their numbers in the format.
_KINDS = {
    1: "line", 2: "triangle", 3: "quad", 4: "tetra", 5: "hexahedron", 6: "wedge", 7: "pyramid", 8: "line3",
    9: "triangle6", 10: "quad9", 11: "tetra10", 12: "hexahedron27", 13: "wedge18", 14: "pyramid14", 15: "vertex",
    16: "quad8", 17: "hexahedron20", 18: "wedge15", 19: "pyramid13",
}  # fmt: skip
_OTHER_KINDS = {
    20: "triangle9", 21: "triangle10", 22: "triangle12", 23: "triangle15", 26: "line4", 27: "line5", 29: "tetra20",
    30: "tetra35", 36: "quad16", 92: "hexahedron64",
}  # fmt: skip
#: Edges in the order in which the format numbers their middles, of shapes where it differs from that of VTK.
_EDGES = {
    "tetra": ((0, 1), (1, 2), (0, 2), (0, 3), (2, 3), (1, 3)),
    "pyramid": ((0, 1), (0, 3), (0, 4), (1, 2), (1, 4), (2, 3), (2, 4), (3, 4)),
    "wedge": ((0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5)),
    "hexahedron": (
        (0, 1), (0, 3), (0, 4), (1, 2), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 7), (5, 6), (6, 7),
    ),
}  # fmt: skip
#: What entities of a dimension are called.
_ENTITIES = ("point", "curve", "surface", "volume")
#: Versions of the format, as files state them.
_OLD, _FOUR, _NEW = ("2", "2.0", "2.1", "2.2"), ("4", "4.0"), ("4.1",)
_BEGINS = re.compile(rb"\$(MeshFormat|Comments|PhysicalNames|Entities|Nodes|ParametricNodes|Elements|NOD)\s*[\r\n]")
_SECTIONS = ("Entities", "PartitionedEntities", "Nodes", "ParametricNodes", "Elements")


def is_msh(data: bytes) -> bool:
    """Whether this is the beginning of a file of Gmsh, and not of another that begins with a dollar sign."""
    return _BEGINS.match(data[:64].removeprefix(b"\xef\xbb\xbf").lstrip()) is not None


def parse_msh(data: bytes) -> RawMesh:
    """The mesh in the bytes of an MSH file."""
    return _Reader(data).read()


class _Reader:
    """Goes through the sections of a file."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.offset = 3 if data.startswith(b"\xef\xbb\xbf") else 0
        self.version = ""
        self.binary = False
        self.order = "<"
        self.word = 8  # bytes of a size
        self.names: dict[tuple[int, int], str] = {}
        self.entities: dict[tuple[int, int], list[int]] | None = None
        self.whole: dict[tuple[int, int], int] = {}  # the entity of which one is a partition
        self.ids: list[IntArray] = []
        self.points: list[Array] = []
        self.blocks: list[Block] = []
        self.seen: set[str] = set()

    def read(self) -> RawMesh:
        while (name := self._section()) is not None:
            if name in self.seen and name in (*_SECTIONS, "MeshFormat", "PhysicalNames"):
                raise ProblemError(f"the section ${name} occurs twice; save the mesh again")
            self.seen.add(name)
            if name == "MeshFormat":
                self._format()
            elif not self.version and name != "Comments":
                raise ProblemError(
                    f"it begins with ${name} and states no version of the format ($MeshFormat); save it as MSH 2.2 or "
                    f"4.1"
                )
            elif name == "PhysicalNames":
                self._names(self._text(name))
            elif name in _SECTIONS and self.binary:
                source = Bytes(self.data, self.offset, self.order, self.word, name, self.version in _NEW)
                if self._in_blocks(name):
                    self._sizes_known(name, source)
                else:
                    self._old_binary(name, source)
                self.offset = source.offset
                self._end(name)
            elif name in _SECTIONS and self._in_blocks(name):
                kind = np.int64 if name == "Elements" else np.float64
                text = self._text(name)
                self._sizes_known(name, Numbers(self._numbers(text, name, kind), name, text))
            elif name == "Elements":
                self._old_elements(self._numbers(self._text(name), name, np.int64))
            elif name in _SECTIONS:
                text = self._text(name)
                numbers = Numbers(self._numbers(text, name, np.float64), name, text)
                self._old_nodes(numbers, name == "ParametricNodes")
            else:
                self._text(name)
        if "Nodes" not in self.seen and "ParametricNodes" not in self.seen:
            raise ProblemError("it has no section $Nodes; save the mesh again")
        if "Elements" not in self.seen:
            raise ProblemError("it has no section $Elements; mesh the geometry before it is saved")
        points = np.concatenate([*self.points, np.zeros((0, 3))]).astype(np.float64)
        ids = np.concatenate([*self.ids, np.zeros(0, dtype=np.int64)])
        notes = self._name_by_entities()
        raw = put_together(ids, points, self.blocks, self.names, repeated=self.version in _OLD)
        raw.notes.extend(notes)
        return raw

    def _name_by_entities(self) -> list[str]:
        """Give facets and cells to groups of their entities where no physical group holds any; what is said of that."""
        notes, top = [], max((block.kind.dim for block in self.blocks), default=0)
        for dim in range(max(top - 1, 1), top + 1):
            own = [block for block in self.blocks if block.kind.dim == dim and len(block.nodes)]
            entities = [np.zeros(0, np.int64) if block.entities is None else block.entities for block in own]
            tags = [int(tag) for tag in sorted({*np.unique(np.concatenate([*entities, [0]]))}) if tag > 0]
            if any(np.any(block.groups) for block in own) or len(tags) <= (dim == top):  # one body needs no name
                continue
            word = _ENTITIES[dim]
            if len(tags) > MOST_GROUPS:
                notes.append(f"its {len(tags)} {word}s are in no physical group, and too many for names")
                continue
            called = f"'{word} {tags[0]}'" + (f" to '{word} {tags[-1]}'" if len(tags) > 1 else "")
            notes.append(f"no physical group names its {word}s; they are called by their numbers, {called}")
            self.names |= {(dim, tag): f"{word} {tag}" for tag in tags}
            others = [block for block in self.blocks if block.kind.dim != dim]
            of = zip(own, entities, strict=True)
            self.blocks = others + [replace(block, groups=np.maximum(tag, 0)) for block, tag in of]
        return notes

    # ---- sections ---------------------------------------------------------------------------------------------

    def _section(self) -> str | None:
        """The name of the next section, with the place after its line; None at the end."""
        data, at = self.data, self.offset
        while at < len(data) and data[at] in b" \t\r\n":
            at += 1
        if at >= len(data):
            return None
        line, end = self._line(at)
        if not line.startswith(b"$") or not line[1:].isalnum() or line.startswith(b"$End"):
            text = line[:40].decode("ascii", "backslashreplace")
            raise ProblemError(f"a section should begin at '{shown(text)}' ({self._where(at)}); save it again")
        self.offset = end
        return line[1:].decode("ascii")

    def _line(self, at: int) -> tuple[bytes, int]:
        """The line at a place without blanks round it, and the place after it."""
        end = self.data.find(b"\n", at)
        end = len(self.data) if end < 0 else end
        return self.data[at:end].strip(), end + 1

    def _text(self, name: str) -> bytes:
        """All between the line that opens a section and the one that ends it; the place goes after that."""
        end = self.data.find(b"$End" + name.encode("ascii"), self.offset)
        if end < 0:
            raise ProblemError(f"it is cut off: the section ${name} does not end ($End{name} is missing)")
        text = self.data[self.offset : end]
        self.offset = end
        self._end(name)
        return text

    def _end(self, name: str) -> None:
        """The line that ends a section stands here."""
        at = self.offset
        while at < len(self.data) and self.data[at] in b" \t\r\n":
            at += 1
        line, end = self._line(at)
        if line != b"$End" + name.encode("ascii"):
            cut = "it is cut off" if at >= len(self.data) else "its counts are wrong, or it is damaged"
            raise ProblemError(f"the section ${name} does not end where it should; {cut}: save it again")
        self.offset = end

    def _where(self, at: int) -> str:
        return f"byte {at}" if self.binary else f"line {self.data.count(bytes([10]), 0, at) + 1}"

    def _format(self) -> None:
        line, self.offset = self._line(self.offset)
        words = line.decode("ascii", "replace").split()
        if len(words) != 3 or words[1] not in ("0", "1") or words[2] not in ("4", "8"):
            raise ProblemError("its $MeshFormat is not 'version, 0 or 1, 8'; save it as MSH 2.2 or 4.1")
        if words[0] not in _OLD + _FOUR + _NEW:
            raise ProblemError(
                f"it is in version {shown(words[0])[:20]} of the format; versions 2.2, 4.0 and 4.1 are read: save "
                f"it as one of them"
            )
        self.version, self.binary, self.word = words[0], words[1] == "1", int(words[2])
        if self.binary:
            mark = self.data[self.offset : self.offset + 4]
            if mark not in (b"\1\0\0\0", b"\0\0\0\1"):
                raise ProblemError("the byte order of this binary file is unknown; save it again")
            self.order = "<" if mark == b"\1\0\0\0" else ">"
            self.offset += 4
        self._end("MeshFormat")

    def _names(self, text: bytes) -> None:
        try:
            lines = text.decode("utf-8").strip().splitlines()
        except UnicodeDecodeError:
            lines = text.decode("latin-1").strip().splitlines()
        if not lines or not lines[0].strip().isdecimal() or int(lines[0]) != len(lines) - 1:
            raise ProblemError("$PhysicalNames does not hold as many names as it says; save it again")
        for line in lines[1:]:
            head, quote, rest = line.strip().partition('"')
            words, name = head.split(), rest.rpartition('"')[0]
            if not quote or not rest.endswith('"') or len(words) != 2 or not all(_is_integer(word) for word in words):
                raise ProblemError(f"$PhysicalNames has the line '{shown(line)[:60]}'; write: dimension number name")
            key = (int(words[0]), abs(int(words[1])))
            if self.names.setdefault(key, name) != name:
                raise ProblemError(
                    f"group {key[1]} of dimension {key[0]} has two names, '{shown(self.names[key])}' and "
                    f"'{shown(name)}'; leave one"
                )

    def _in_blocks(self, name: str) -> bool:
        """Whether a section is made of blocks that tell their sizes, the same in text and in binary."""
        return self.version not in _OLD or name in ("Entities", "PartitionedEntities")

    def _sizes_known(self, name: str, source: Numbers | Bytes) -> None:
        """A section made of blocks."""
        if name in ("Entities", "PartitionedEntities"):
            self._entities(name, source)
        else:
            self._blocks(name, source)
        source.finish()

    def _numbers(self, text: bytes, name: str, kind: type[np.int64 | np.float64]) -> AnyArray:
        """All numbers of a text."""
        if b"\0" not in text:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("error")
                    return np.fromstring(text, kind, sep=" ") if text.strip() else np.zeros(0, kind)  # type: ignore[call-overload,no-any-return]
            except (DeprecationWarning, ValueError):
                pass
        start = self.data.find(text)
        for number, line in enumerate(text.split(b"\n")):
            for word in line.split():
                try:
                    (int if kind is np.int64 else float)(word)
                except ValueError:
                    entry = shown(word[:30].decode("ascii", "backslashreplace"))
                    what = "a whole number" if kind is np.int64 else "a number"
                    at = self.data.count(b"\n", 0, start) + number + 1
                    raise ProblemError(
                        f"'{entry}' is not {what} (${name}, line {at}); correct it or save it again"
                    ) from None
        raise ProblemError(f"${name} holds what is not a number; save the mesh again")

    # ---- entities: which physical groups their elements belong to ----------------------------------------------

    def _entities(self, name: str, words: Numbers | Bytes) -> None:
        partitioned = name == "PartitionedEntities"
        if self.entities is None or partitioned:
            self.entities = {}
        if partitioned:
            words.size()
            for _ in range(words.size()):
                words.integers(2)
        counts = [words.size() for _ in range(4)]
        for dim, count in enumerate(counts):
            for _ in range(count):
                tag = words.integers(1)[0]
                if partitioned:
                    parent, of = words.integers(2)
                    self.whole[dim, tag] = of if parent == dim else 0
                    words.integers(words.size())
                words.floats(3 if dim == 0 and self.version in _NEW else 6)
                groups = [abs(group) for group in words.integers(words.size()) if group]
                if dim:
                    words.integers(words.size())
                if (dim, tag) in self.entities:
                    raise ProblemError(f"${name} holds entity {tag} of dimension {dim} twice; save it again")
                self.entities[dim, tag] = groups

    # ---- nodes --------------------------------------------------------------------------------------------------

    def _old_nodes(self, numbers: Numbers, parametric: bool) -> None:
        count, rows = numbers.size(), numbers.values[1:]
        if not parametric:
            if len(rows) != 4 * count:
                raise ProblemError(f"$Nodes says {count} nodes and holds {len(rows) / 4:g}; save the mesh again")
            self._add_nodes(*numbers.nodes(count, 3))
            return
        for start, width, many in runs(
            rows, count, 6, lambda head: (6 + parameters(head[4]), (4,)), "$ParametricNodes"
        ):
            part = rows[start : start + many * width].reshape(many, width)
            self._add_nodes(part[:, 0], part[:, 1:4])

    def _blocks(self, name: str, source: Numbers | Bytes) -> None:
        """Nodes or elements of versions 4."""
        new = self.version in _NEW
        blocks, count = source.size(), source.size()
        if new:
            source.size(), source.size()
        total = 0
        for _ in range(blocks):
            head = source.integers(3)
            dim, tag = (head[0], head[1]) if new else (head[1], head[0])
            many = source.size()
            total += many
            if name == "Elements":
                self._add_block(dim, tag, head[2], source.tags(many, 1 + _kind(head[2]).nodes)[:, 1:])
                continue
            width = 3 + (parameters(dim) if head[2] else 0)
            if new:
                ids, points = source.tags(many, 1)[:, 0], source.coordinates(many, width)
            else:
                ids, points = source.nodes(many, width)
            self._add_nodes(ids, points[:, :3])
        if total != count:
            raise ProblemError(f"${name} says {count} {name.lower()} and holds {total}; save the mesh again")

    def _add_nodes(self, ids: AnyArray, points: Array) -> None:
        whole = ids.astype(np.int64) if ids.dtype.kind in "iu" or bool((np.abs(ids) < 2.0**53).all()) else None
        if whole is None or (ids.dtype.kind == "f" and (whole != ids).any()):
            raise ProblemError("$Nodes has a node whose number is not a whole number; save the mesh again")
        if len(whole) and whole.min() < 1:
            raise ProblemError(f"it has a node of number {whole.min()}; nodes are numbered from 1 on: renumber them")
        self.ids.append(whole)
        self.points.append(points)

    # ---- elements -----------------------------------------------------------------------------------------------

    def _old_elements(self, number: IntArray) -> None:
        count = checked_count(number[0] if len(number) else -1, "$Elements")
        rows = number[1:]

        def width(head: IntArray) -> tuple[int, tuple[int, ...]]:
            return 3 + checked_count(head[2], "$Elements") + _kind(int(head[1])).nodes, (1, 2)

        for start, columns, many in runs(rows, count, 3, width, "$Elements"):
            part = rows[start : start + many * columns].reshape(many, columns)
            self._add_old(int(part[0, 1]), part[:, 3 : 3 + int(part[0, 2])], part[:, 3 + int(part[0, 2]) :])

    def _add_old(self, kind: int, tags: IntArray, nodes: IntArray) -> None:
        what = _kind(kind)
        none = np.zeros(len(nodes), dtype=np.int64)
        groups = np.abs(tags[:, 0]) if tags.shape[1] > 0 else none
        self.blocks.append(Block(what, _ordered(what, nodes), groups, tags[:, 1] if tags.shape[1] > 1 else none))

    def _add_block(self, dim: int, tag: int, kind: int, nodes: IntArray) -> None:
        what = _kind(kind)
        if what.dim != dim:
            raise ProblemError(f"$Elements has elements of type {kind} on an entity of dimension {dim}; save it again")
        groups: list[int] = []
        if self.entities is not None and len(nodes):
            if (dim, tag) not in self.entities:
                raise ProblemError(
                    f"$Elements refers to entity {tag} of dimension {dim}, which $Entities does not hold; save it again"
                )
            groups = self.entities[dim, tag]
        entities = np.full(len(nodes), self.whole.get((dim, tag), tag))
        self.blocks.append(Block(what, _ordered(what, nodes), groups, entities))

    def _old_binary(self, name: str, source: Bytes) -> None:
        line, source.offset = self._line(source.offset)
        if not line.isdigit():
            raise ProblemError(f"${name} does not begin with a number; save it again")
        count = int(line)
        point = [("id", f"{self.order}i4"), ("x", f"{self.order}f8", (3,))]
        if name == "Nodes":
            rows = source.array(np.dtype(point), count)
            self._add_nodes(rows["id"].astype(np.int64), rows["x"])
            return
        left = count
        while left and name == "ParametricNodes":
            near = np.dtype([*point, ("on", f"{self.order}i4", (2,))])
            dim = int(source.array(near, 1, move=False)["on"][0, 0])
            kind = np.dtype([*near.descr, ("u", f"{self.order}f8", (parameters(dim),))])
            rows = source.array(kind, min(left, source.left // kind.itemsize), move=False)
            many = first_rows(rows["on"][:, :1], len(rows), name)
            self._add_nodes(rows["id"][:many].astype(np.int64), rows["x"][:many])
            source.offset += many * kind.itemsize
            left -= many
        while left and name == "Elements":
            kind_of, many, tags = (int(value) for value in source.array(np.dtype(f"{self.order}i4"), 3))
            nodes = _kind(kind_of).nodes
            if not 0 < many <= left or tags < 0:
                raise ProblemError("$Elements holds other numbers of elements than it says; save it again")
            block = source.array(np.dtype(f"{self.order}i4"), many * (1 + tags + nodes)).reshape(many, -1)
            self._add_old(kind_of, block[:, 1 : 1 + tags].astype(np.int64), block[:, 1 + tags :].astype(np.int64))
            left -= many


def _kind(number: int) -> ElementKind:
    """A kind of element by its number."""
    if number not in _KINDS:
        raise ProblemError(unknown_kind(_OTHER_KINDS.get(number, f"{number} of the format")))
    return KINDS[CODES[_KINDS[number]]]


def _ordered(kind: ElementKind, nodes: IntArray) -> IntArray:
    """Nodes of elements (k, n) in the order of VTK."""
    shape = kind.shape
    if not kind.quadratic or shape.name not in _EDGES:
        return nodes
    own = [tuple(sorted(edge)) for edge in shape.edges]
    order = [shape.corners + _EDGES[shape.name].index(edge) for edge in own]
    return nodes[:, [*range(shape.corners), *order, *range(shape.corners + len(own), kind.nodes)]]


def _is_integer(word: str) -> bool:
    return word.removeprefix("-").isdecimal() and len(word) < 16
