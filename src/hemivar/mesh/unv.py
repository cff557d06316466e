"""Universal files of I-DEAS: nodes, elements and permanent groups, in datasets of lines of fixed columns."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from hemivar.basics.disk import shown
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.kinds import CODES, KINDS, ElementKind, unknown_kind
from hemivar.mesh.raw import Block, RawMesh, put_together
from hemivar.mesh.texts import floats, rows_of, whole

__all__ = ["is_unv", "parse_unv"]

#: How such a file begins.
_BEGIN = re.compile(rb"\A\s*-1[ \t]*\r?\n[ \t]*\d{1,5}[ \t]*\r?\n")
#: Elements by their numbers there: rods and beams; shells, plates, membranes, plane and revolved ones; solids.
_KINDS = {
    11: "line", 21: "line", 22: "line3", 23: "line3", 24: "line3",
    111: "tetra", 118: "tetra10", 112: "wedge", 113: "wedge15", 115: "hexahedron", 116: "hexahedron20",
} | {
    10 * family + number: name
    for family in range(4, 10)
    for number, name in ((1, "triangle"), (2, "triangle6"), (4, "quad"), (5, "quad8"))
}  # fmt: skip
#: Elements with a line more: beams.
_BEAMS = (11, 21, 22, 23, 24)
#: Springs, masses and constraints, which are no part of a body.
_OTHERS = (121, 122, 136, 137, 138, 139, 141, 142, 151, 152, 161, 171)
#: Nodes in the order of VTK: the file goes around a layer, corner and middle in turns.
_ORDER = {
    "line3": [0, 2, 1],
    "triangle6": [0, 2, 4, 1, 3, 5],
    "quad8": [0, 2, 4, 6, 1, 3, 5, 7],
    "tetra10": [0, 2, 4, 9, 1, 3, 5, 6, 7, 8],
    "wedge15": [0, 2, 4, 9, 11, 13, 1, 3, 5, 10, 12, 14, 6, 7, 8],
    "hexahedron20": [0, 2, 4, 6, 12, 14, 16, 18, 1, 3, 5, 7, 13, 15, 17, 19, 8, 9, 10, 11],
}
#: Datasets of nodes and the lines of one; of elements and the numbers before the count of nodes; of groups.
_NODES, _ELEMENTS = {"15": 1, "781": 2, "2411": 2}, {"780": 7, "2412": 5}
_GROUPS = ("2417", "2429", "2430", "2432", "2435", "2452", "2467", "2477")
#: What a member of a group is.
_NODE, _ELEMENT = 7, 8


def is_unv(start: bytes) -> bool:
    """Whether this is the beginning of a universal file."""
    return _BEGIN.match(start) is not None


def parse_unv(text: str) -> RawMesh:
    """The mesh in the text of a universal file; groups of nodes and elements keep their names."""
    nodes, elements, groups = list[Array](), list[tuple[int, list[str]]](), list[tuple[str, IntArray]]()
    for number, lines in _datasets(text):
        if number in _NODES:
            nodes.append(_nodes(lines, _NODES[number], number))
        elif number in _ELEMENTS:
            elements.append((_ELEMENTS[number], lines))
        elif number in _GROUPS:
            groups.extend(_groups(lines, 4 if number in ("2435", "2452", "2467", "2477") else 2, number))
    if not nodes:
        raise ProblemError("it holds no nodes (dataset 2411); save the mesh, not results alone")
    table = np.vstack(nodes)
    blocks, labels, others = list[Block](), list[IntArray](), set[int]()
    for head, lines in elements:
        for code, rows in _runs(whole([word for line in lines for word in line.split()], "elements"), head):
            if code in _OTHERS:
                others.add(code)
                continue
            kind = _kind(code, rows.shape[1])
            blocks.append(Block(kind, rows[:, 1:][:, _ORDER.get(kind.name, slice(None))], []))
            labels.append(rows[:, 0])
    raw = put_together(table[:, 0].astype(np.int64), table[:, 1:], blocks, {}, repeated=False)
    _name(raw, groups, table[:, 0].astype(np.int64), blocks, labels)
    raw.notes.extend(f"elements of type {code} belong to no body and were ignored" for code in sorted(others))
    return raw


def _datasets(text: str) -> Iterator[tuple[str, list[str]]]:
    """Numbers of datasets, and their lines."""
    lines = text.splitlines()
    ends = [at for at, line in enumerate(lines) if line.strip() == "-1"]
    if len(ends) % 2:
        raise ProblemError("its last dataset has no end (-1); it is cut off: save it again")
    for begin, end in zip(ends[::2], ends[1::2], strict=True):
        if end > begin + 1:
            yield lines[begin + 1].strip(), lines[begin + 2 : end]


def _nodes(lines: list[str], each: int, number: str) -> Array:
    """Labels and coordinates (N, 4)."""
    if each == 2:
        lines = [f"{head} {rest}" for head, rest in zip(lines[::2], lines[1::2], strict=len(lines) % 2 == 0)]
    return rows_of(floats(" ".join(lines).split(), f"dataset {number}"), 7, f"dataset {number}")[:, [0, 4, 5, 6]]


def _runs(words: IntArray, head: int) -> Iterator[tuple[int, IntArray]]:
    """Elements that follow each other and are of one type: the type, and labels and nodes of each (k, 1 + n)."""
    at = 0
    while at < len(words):
        if at + head >= len(words) or words[at + head] < 1:
            raise ProblemError("an element has no nodes; the file is cut off or damaged: save it again")
        code, count = int(words[at + 1]), int(words[at + head])
        first = head + 1 + 3 * (code in _BEAMS)
        width = first + count
        rows = words[at : at + (len(words) - at) // width * width].reshape(-1, width)
        same = (rows[:, 1] == code) & (rows[:, head] == count)
        many = len(rows) if same.all() else int(np.argmin(same))
        if not many:
            raise ProblemError(f"element {words[at]} ends before its {count} nodes; save the file again")
        yield code, rows[:many, [0, *range(first, width)]]
        at += many * width


def _kind(code: int, width: int) -> ElementKind:
    if code not in _KINDS:
        raise ProblemError(unknown_kind(f"{code} of universal files"))
    kind = KINDS[CODES[_KINDS[code]]]
    if width != kind.nodes + 1:
        raise ProblemError(f"an element of type {code} has {width - 1} nodes in place of {kind.nodes}; save it again")
    return kind


def _groups(lines: list[str], each: int, number: str) -> Iterator[tuple[str, IntArray]]:
    """Names of groups, and what and which their members are (k, 2)."""
    at = 0
    while at < len(lines):
        count = int(whole(lines[at].split()[-1:] or [""], f"size of a group in dataset {number}")[0])
        per = 8 // each
        end = at + 2 + -(-max(count, 0) // per)
        if at + 1 >= len(lines) or end > len(lines):
            raise ProblemError(
                f"a group of dataset {number} says {count} members, and the file ends before; save it again"
            )
        words = whole(" ".join(lines[at + 2 : end]).split(), f"members of a group in dataset {number}")
        yield lines[at + 1].strip(), rows_of(words, each, f"dataset {number}")[:, :2]
        at = end


def _name(
    raw: RawMesh, groups: list[tuple[str, IntArray]], ids: IntArray, blocks: list[Block], labels: list[IntArray]
) -> None:
    """Give groups to the mesh: their elements by dimension, and their nodes."""
    by_dim = {
        dim: np.concatenate([own for block, own in zip(blocks, labels, strict=True) if block.kind.dim == dim])
        for dim in raw.cells
    }
    for name, members in groups:
        wanted = members[members[:, 0] == _ELEMENT, 1]
        for dim, own in by_dim.items():
            rows = np.flatnonzero(np.isin(own, wanted))
            if rows.size:
                raw.groups[dim, name] = np.union1d(raw.groups.get((dim, name), rows), rows)
        at = np.flatnonzero(np.isin(ids, members[members[:, 0] == _NODE, 1]))
        if at.size:
            raw.at_nodes[name] = np.union1d(raw.at_nodes.get(name, at), at)
        if not len(members):
            raw.notes.append(f"group '{shown(name)}' is empty; it was ignored")
