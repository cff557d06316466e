"""Mesh files of Netgen (.vol), whose groups are materials and boundary conditions."""

from __future__ import annotations

import numpy as np

from hemivar.basics.disk import shown
from hemivar.errors import ProblemError
from hemivar.mesh.kinds import CODES, KINDS, unknown_kind
from hemivar.mesh.raw import Block, RawMesh, put_together
from hemivar.mesh.texts import floats, rows_of, whole

__all__ = ["parse_netgen"]

#: Kinds of elements by their numbers of nodes, and the places of these nodes in the order of VTK.
_SURFACES = {
    3: ("triangle", [0, 1, 2]), 6: ("triangle6", [0, 1, 2, 5, 3, 4]), 4: ("quad", [0, 1, 2, 3]),
    8: ("quad8", [0, 1, 2, 3, 4, 7, 5, 6]),
}  # fmt: skip
_SOLIDS = {
    4: ("tetra", [0, 2, 1, 3]), 10: ("tetra10", [0, 2, 1, 3, 5, 7, 4, 6, 9, 8]), 5: ("pyramid", [0, 3, 2, 1, 4]),
    6: ("wedge", [0, 2, 1, 3, 5, 4]), 8: ("hexahedron", [0, 3, 2, 1, 4, 7, 6, 5]),
    13: ("pyramid13", [0, 3, 2, 1, 4, 7, 6, 8, 5, 9, 12, 11, 10]),
    15: ("wedge15", [0, 2, 1, 3, 5, 4, 7, 8, 6, 13, 14, 12, 9, 11, 10]),
    20: ("hexahedron20", [0, 3, 2, 1, 4, 7, 6, 5, 10, 9, 11, 8, 16, 19, 18, 17, 14, 13, 15, 12]),
}  # fmt: skip


def parse_netgen(text: str) -> RawMesh:
    """The mesh in the text of a file."""
    sections = _sections(text)
    dim = int(whole(sections.get("dimension", [["3"]])[0][:1], "dimension")[0])
    points = sections.get("points", [])
    if "mesh3d" not in sections or not points:
        raise ProblemError("it is not a Netgen mesh (mesh3d, points); mesh the geometry before it is saved")
    places = rows_of(floats([word for row in points for word in row[:3]], "points"), 3, "points")
    blocks, names = list[Block](), dict[tuple[int, int], str]()
    for section, rows in sections.items():
        if section == "volumeelements":
            _elements(rows, (0, 1, 2), _SOLIDS, blocks)
        elif section.startswith("surfaceelements"):
            _elements(rows, (1, 4, 5), _SURFACES, blocks)
        elif section.startswith("edgesegments") and rows and dim == 2:
            new = section.endswith("gi3")
            ends = [row[:2] if new else row[2:4] for row in rows]
            group = whole([row[6] if new else row[0] for row in rows], section) + new
            nodes = rows_of(whole([word for pair in ends for word in pair], section), 2, section)
            blocks.append(Block(KINDS[CODES["line"]], nodes, group))
    for section, of in (("materials", dim), ("bcnames", dim - 1)):
        for row in sections.get(section, []):
            names[of, int(whole(row[:1], section)[0])] = " ".join(row[1:])
    return put_together(np.arange(len(places)) + 1, places, blocks, names, repeated=False)


def _elements(
    rows: list[list[str]], columns: tuple[int, int, int], kinds: dict[int, tuple[str, list[int]]], blocks: list[Block]
) -> None:
    """Blocks of the elements of each number of nodes."""
    group, count, first = columns
    for word in dict.fromkeys(row[count] for row in rows if len(row) > count):
        number = int(whole([word], "nodes of an element")[0])
        if number not in kinds:
            raise ProblemError(unknown_kind(f"of {number} nodes"))
        name, order = kinds[number]
        own = [row for row in rows if row[count : count + 1] == [word]]
        words = [node for row in own for node in row[first : first + number]]
        nodes = rows_of(whole(words, "nodes of an element"), number, f"elements of {number} nodes")
        if len(nodes) != len(own):
            raise ProblemError(f"an element of {number} nodes is cut off; save the mesh again")
        blocks.append(Block(KINDS[CODES[name]], nodes[:, order], whole([row[group] for row in own], "group")))


def _sections(text: str) -> dict[str, list[list[str]]]:
    """Rows of words below each keyword, as many as the number after the keyword says."""
    lines = [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
    sections: dict[str, list[list[str]]] = {}
    at = 0
    while at < len(lines) and lines[at][0] != "endmesh":
        key = lines[at][0]
        at += 1
        if not key[0].isalpha():
            continue
        if key in ("mesh3d", "dimension", "geomtype"):
            sections[key] = lines[at : at + 1]
            at += key != "mesh3d"
            continue
        count = int(whole(lines[at][:1] if at < len(lines) else [""], key)[0])
        sections[key] = lines[at + 1 : at + 1 + count]
        if count < 0 or len(sections[key]) < count:
            raise ProblemError(f"{shown(key)} says {count} rows, and the file ends before; save it again")
        at += 1 + count
    return sections
