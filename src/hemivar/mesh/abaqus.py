"""Input files of Abaqus and CalculiX: nodes, elements, sets and surfaces, of parts and where instances place them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hemivar.basics.disk import shown
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.kinds import CODES, KINDS, ElementKind, unknown_kind
from hemivar.mesh.raw import Block, RawMesh, put_together
from hemivar.mesh.texts import Included, floats, rows_of, whole

__all__ = ["is_abaqus", "parse_abaqus"]

#: Kinds of elements by the number of nodes that their names end with, for each beginning of a name.
_SOLID = {
    4: "tetra", 5: "pyramid", 6: "wedge", 8: "hexahedron", 10: "tetra10", 13: "pyramid13", 15: "wedge15",
    20: "hexahedron20", 27: "hexahedron27",
}  # fmt: skip
_PLANE = {3: "triangle", 4: "quad", 6: "triangle6", 8: "quad8", 9: "quad9", 65: "triangle6"}
_LINE = {2: "line", 3: "line3"}
_BEAM = {1: "line", 2: "line3", 3: "line"}
_TYPES = (
    (re.compile(r"(?:C3D|DC3D|AC3D|F3D|SC)(\d+)"), _SOLID),
    (re.compile(r"(?:CPS|CPEG?|CG?AX|DC2D|AC2D|DCAX|ACAX|M3D|R3D|SFM3D|STRI|DS|S)(\d+?)(?:R?5)?(?=\D|$)"), _PLANE),
    (re.compile(r"(?:T2D|T3D|R2D|RAX|RB2D|RB3D|DC1D|AC1D)(\d)"), _LINE),
    (re.compile(r"(?:B2|B3|SAX|MAX)(\d)"), _BEAM),
)
#: Elements that are no part of a body: springs, masses, couplings, gaps.
_OTHERS = ("MASS", "ROTARYI", "SPRING", "DASHPOT", "CONN", "GAP", "DCOUP", "ESPRNG", "JOINT", "ITS", "DIST", "HEATCAP")
#: Corners of the faces S1, S2, ... of elements.
_FACES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": ((0, 1, 2, 3), (4, 7, 6, 5), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)),
}
_FACET = {2: "line", 3: "triangle", 4: "quad"}
#: How it begins, after comments: with a keyword; one of LS-DYNA is none.
_BEGIN = re.compile(rb"(?:\s*\*\*[^\n]*\n)*\s*\*(?!KEYWORD)[A-Z]", re.IGNORECASE)
#: A file that stands in the place of a line, and keywords whose data may stand in a file.
_INCLUDE = re.compile(r"^[ \t]*\*INCLUDE\b(?:\s*,\s*INPUT[ \t]*=)?([^\n,]*)[^\n]*$", re.MULTILINE | re.IGNORECASE)
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")
_GENERATED = ("NGEN", "NFILL", "NCOPY", "NMAP", "ELGEN", "ELCOPY")


def is_abaqus(start: bytes) -> bool:
    """Whether this is the beginning of an input file of Abaqus or CalculiX."""
    return _BEGIN.match(start) is not None


def parse_abaqus(text: str, path: Path) -> RawMesh:
    """The mesh in the text of an input file of this name, and of the files that it includes.

    Element sets and surfaces are groups; node sets are groups of nodes.
    """
    reader = _Reader()
    for key, values, data in _keywords(Included(path, text)):
        reader.take(key, values, data)
    return reader.mesh()


@dataclass(frozen=True)
class _Keyword:
    """A set or a surface as it stands in the file."""

    key: str
    name: str
    scope: str
    rows: list[list[str]]
    generate: bool
    shown: bool


@dataclass(frozen=True, eq=False)
class _Part:
    """Nodes and elements whose numbers belong together."""

    ids: list[IntArray] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)
    elements: list[tuple[ElementKind, IntArray, IntArray, str]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Instance:
    """Where a part is put."""

    part: str
    rows: list[list[str]]

    def move(self, points: Array) -> Array:
        """Places of the points of the part: shifted, then turned about an axis."""
        given = [floats([word for word in row if word], "*INSTANCE") for row in self.rows]
        if given:
            points = points + np.pad(given[0], (0, 3))[:3]
        if len(given) > 1 and len(given[1]) >= 7:
            start, along, angle = given[1][:3], given[1][3:6] - given[1][:3], math.radians(given[1][6])
            axis = along / np.linalg.norm(along)
            arm = points - start
            around = np.cross(axis, arm) * math.sin(angle) + np.outer(arm @ axis, axis) * (1.0 - math.cos(angle))
            points = start + arm * math.cos(angle) + around
        return points


class _Reader:
    """Takes the keywords of a file in their order."""

    def __init__(self) -> None:
        self.parts: dict[str, _Part] = {}
        self.instances: dict[str, _Instance] = {}
        self.named: list[_Keyword] = []
        self.scope = ""
        self.others: set[str] = set()

    def take(self, key: str, values: dict[str, str], data: list[str]) -> None:
        """A keyword, its parameters and its data."""
        rows = [[word.strip() for word in line.split(",")] for line in data if line.strip()]
        if key == "PART":
            self.scope = values.get("NAME", "").upper()
        elif key in ("END PART", "ASSEMBLY", "END INSTANCE"):
            self.scope = ""
        elif key == "INSTANCE":
            name = values.get("NAME", "").upper()
            self.instances[name] = _Instance(values.get("PART", "").upper(), rows)
            self.scope = name  # an instance may hold a mesh of its own
        elif key in ("NODE", "ELEMENT") and self.scope not in self.parts:
            self.parts[self.scope] = _Part()
        if key in _GENERATED:
            raise ProblemError(f"it generates nodes or elements by *{key}, which is not read; save the whole mesh")
        if key == "NODE":
            self._nodes(values, rows)
        elif key == "ELEMENT":
            self._elements(values, rows)
        elif key in ("NSET", "ELSET", "SURFACE"):
            name = values.get("NAME" if key == "SURFACE" else key, "").strip('"')
            if not name:
                raise ProblemError(f"a *{key} has no name; add {'NAME' if key == 'SURFACE' else key}=")
            scope = values.get("INSTANCE", self.scope).upper()
            if key == "SURFACE" and values.get("TYPE", "ELEMENT").upper() == "NODE":
                key = "NSET"
                rows = [row[:1] for row in rows]
            self.named.append(_Keyword(key, name, scope, rows, "GENERATE" in values, "INTERNAL" not in values))

    def _nodes(self, values: dict[str, str], rows: list[list[str]]) -> None:
        if values.get("SYSTEM", "R").upper() != "R":
            raise ProblemError(
                "nodes are given in cylindrical or spherical coordinates (*NODE, SYSTEM); save them as x, y, z"
            )
        part, many = self.parts[self.scope], [[*row, "", "", ""][:4] for row in rows]
        ids = whole([row[0] for row in many], "*NODE")
        part.ids.append(ids)
        part.points.append(floats([word or "0" for row in many for word in row[1:]], "*NODE").reshape(-1, 3))
        if "NSET" in values:
            self.named.append(
                _Keyword("NSET", values["NSET"], self.scope, [[str(one)] for one in ids.tolist()], False, True)
            )

    def _elements(self, values: dict[str, str], rows: list[list[str]]) -> None:
        name = values.get("TYPE", "").upper()
        if name.startswith(_OTHERS):
            self.others.add(name)
            return
        kind = _kind(name)
        words = [word for row in rows for word in row if word]
        table = rows_of(whole(words, "*ELEMENT"), 1 + kind.nodes, f"*ELEMENT of type {shown(name)}")
        self.parts[self.scope].elements.append((kind, table[:, 0], table[:, 1:], values.get("ELSET", "").strip('"')))

    # ---- the whole -----------------------------------------------------------------------------------------------

    def mesh(self) -> RawMesh:
        """All instances of parts, in numbers of their own."""
        placed = dict(self.instances) or {name: _Instance(name, []) for name in self.parts}
        if self.instances and "" in self.parts:
            placed[""] = _Instance("", [])
        body = _Body()
        for name, instance in placed.items():
            own = self.parts.get(name) or self.parts.get(instance.part)
            if own is None:
                raise ProblemError(
                    f"instance '{shown(name)}' is of part '{shown(instance.part)}', which is not there; save it again"
                )
            body.add(name, instance, own)
        if not body.blocks:
            raise ProblemError("it holds no *ELEMENT; save the mesh with its elements")
        for keyword in self.named:
            body.name(keyword)
        raw = body.put_together()
        raw.notes.extend(f"elements {name} belong to no body and were ignored" for name in sorted(self.others))
        return raw


class _Body:
    """Instances of parts: nodes and elements with numbers that no two of them share."""

    def __init__(self) -> None:
        self.first: dict[str, int] = {}
        self.parts: dict[str, list[str]] = {}
        self.ids: list[IntArray] = []
        self.points: list[Array] = []
        self.blocks: list[Block] = []
        self.numbers: list[IntArray] = []
        self.sets: dict[tuple[str, str, str], list[IntArray]] = {}
        self.surfaces: dict[str, list[tuple[ElementKind, IntArray]]] = {}
        self.shown: dict[str, dict[str, list[IntArray]]] = {"NSET": {}, "ELSET": {}}
        self.notes: list[str] = []

    def add(self, name: str, instance: _Instance, part: _Part) -> None:
        """An instance of a part."""
        step = 1 + max(
            [0, *(int(ids.max(initial=0)) for ids in self.ids), *(int(n.max(initial=0)) for n in self.numbers)]
        )
        start = 0 if not self.ids else step
        self.first[name] = start
        self.parts.setdefault(instance.part, []).append(name)
        self.ids += [ids + start for ids in part.ids]
        self.points += [instance.move(points) for points in part.points]
        for kind, numbers, nodes, elset in part.elements:
            ends = [0, 2, 1] if kind.name == "line3" else slice(None)  # the middle comes second
            self.blocks.append(Block(kind, nodes[:, ends] + start, []))
            self.numbers.append(numbers + start)
            if elset:
                self._keep("ELSET", elset, name, numbers + start, True)

    def _keep(self, key: str, name: str, scope: str, ids: IntArray, known: bool) -> None:
        self.sets.setdefault((key, scope, name.upper()), []).append(ids)
        if known:
            self.shown[key].setdefault(name, []).append(ids)

    def name(self, keyword: _Keyword) -> None:
        """A set or a surface, in every instance of the part that it belongs to."""
        scopes = [keyword.scope] if keyword.scope in self.first else self.parts.get(keyword.scope, [""])
        for scope in scopes:
            if keyword.key == "SURFACE":
                self._surface(keyword, scope)
                continue
            if keyword.generate:
                start = self.first.get(scope, 0)
                known = np.concatenate(self.ids if keyword.key == "NSET" else self.numbers) - start
                numbers = [
                    known[(known >= first) & (known <= last) & ((known - first) % max(step, 1) == 0)] + start
                    for first, last, step in map(_limits, keyword.rows)
                ]
            else:
                words = [word for row in keyword.rows for word in row if word]
                plain = [word for word in words if word.lstrip("+-").isdigit()]
                numbers = [whole(plain, f"*{keyword.key}") + self.first.get(scope, 0)] if plain else []
                numbers += [
                    self._look_up(keyword.key, word, scope, keyword.name)
                    for word in words
                    if not word.lstrip("+-").isdigit()
                ]
            self._keep(
                keyword.key, keyword.name, scope, np.concatenate([*numbers, np.zeros(0, dtype=np.int64)]), keyword.shown
            )

    def _look_up(self, key: str, word: str, scope: str, of: str) -> IntArray:
        """Members of a set by its name, or of an instance: ``instance.set``, ``instance.number``."""
        instance, dot, rest = word.strip('"').partition(".")
        if dot and instance.upper() in self.first:
            scope, word = instance.upper(), rest
            if word.isdigit():
                return np.array([int(word) + self.first[scope]])
        wanted = word.strip('"').upper()
        for where in (scope, "", *self.first):
            if (key, where, wanted) in self.sets:
                return np.concatenate(self.sets[key, where, wanted])
        raise ProblemError(
            f"'{shown(of)}' refers to the set '{shown(word)}', which is not there; correct it or save it again"
        )

    def _surface(self, keyword: _Keyword, scope: str) -> None:
        for word, side in ((row[0], row[1].upper() if len(row) > 1 else "") for row in keyword.rows if row[0]):
            plain = word.isdigit()
            ids = (
                np.array([int(word) + self.first.get(scope, 0)])
                if plain
                else self._look_up("ELSET", word, scope, keyword.name)
            )
            if not re.fullmatch(r"[SP]\d", side):
                self.notes.append(
                    f"surface '{keyword.name}' has a row without the number of a face (S1, S2, ...); it was ignored"
                )
                continue
            for block, numbers in zip(self.blocks, self.numbers, strict=True):
                nodes, faces = block.nodes[np.isin(numbers, ids)], _FACES.get(block.kind.shape.name, ())
                if not len(nodes):
                    continue
                if int(side[1]) - 1 not in range(len(faces)):
                    raise ProblemError(
                        f"surface '{keyword.name}' names face {side} of a {block.kind.shape.name}; it has {len(faces)}"
                    )
                face = faces[int(side[1]) - 1]
                self.surfaces.setdefault(keyword.name, []).append((KINDS[CODES[_FACET[len(face)]]], nodes[:, face]))

    def put_together(self) -> RawMesh:
        """The mesh of the whole."""
        names, facets = dict[tuple[int, int], str](), list[Block]()
        for number, (name, pairs) in enumerate(self.surfaces.items(), start=1):
            for kind, nodes in pairs:
                names[kind.dim, number] = name
                facets.append(Block(kind, nodes, [number]))
        ids = np.concatenate([*self.ids, np.zeros(0, dtype=np.int64)])
        points = np.concatenate([*self.points, np.zeros((0, 3))])
        raw = put_together(ids, points, [*self.blocks, *facets], names, repeated=False)
        for dim in raw.cells:
            blocks = [
                numbers for block, numbers in zip(self.blocks, self.numbers, strict=True) if block.kind.dim == dim
            ]
            own = np.concatenate([*blocks, np.zeros(0, dtype=np.int64)])
            for name, sets in self.shown["ELSET"].items():
                rows = np.flatnonzero(np.isin(own, np.concatenate(sets)))
                if len(rows):
                    raw.groups[dim, name] = np.union1d(raw.groups.get((dim, name), rows), rows)
        for name, sets in self.shown["NSET"].items():
            raw.at_nodes[name] = np.flatnonzero(np.isin(ids, np.concatenate(sets)))
        raw.notes.extend(dict.fromkeys(self.notes))
        return raw


def _limits(row: list[str]) -> tuple[int, int, int]:
    """First and last number and step of a generated set."""
    numbers = whole([word for word in row if word], "GENERATE").tolist()
    if len(numbers) not in (2, 3):
        raise ProblemError(f"a generated set has the line '{shown(', '.join(row))}'; give first, last and step")
    return numbers[0], numbers[1], [*numbers, 1][2]


def _kind(name: str) -> ElementKind:
    """A kind of element by its name."""
    for pattern, kinds in _TYPES:
        match = pattern.match(name)
        if match and int(match.group(1)) in kinds:
            return KINDS[CODES[kinds[int(match.group(1))]]]
    raise ProblemError(unknown_kind(shown(name) or "(*ELEMENT without TYPE)"))


# ---- keywords ----------------------------------------------------------------------------------------------------


def _keywords(file: Included) -> list[tuple[str, dict[str, str], list[str]]]:
    """Keywords, parameters and data lines, those of included files among them."""
    lines = _lines(file.whole(_INCLUDE))
    starts = [number for number, line in enumerate(lines) if line.lstrip().startswith("*")]
    if not starts:
        raise ProblemError("it holds no keyword of Abaqus (*NODE, *ELEMENT); check what kind of file it is")
    keywords = list[tuple[str, dict[str, str], list[str]]]()
    for start, end in zip(starts, [*starts[1:], len(lines)], strict=True):
        head, at = lines[start].strip(), start + 1
        while head.endswith(",") and at < end:  # a keyword may go on
            head, at = head + lines[at].strip(), at + 1
        key, *words = (word.strip() for word in head.split(","))
        pairs = (word.partition("=") for word in words if word)
        values = {name.strip().upper(): value.strip() for name, _, value in pairs}
        name = " ".join(key.lstrip("*").upper().split())
        more = _lines(file.opened(values["INPUT"]).text) if name in _WITH_INPUT and "INPUT" in values else []
        keywords.append((name, values, lines[at:end] + more))
    return keywords


def _lines(text: str) -> list[str]:
    return [line for line in text.splitlines() if not line.startswith("**")]
