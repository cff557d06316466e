"""Mesh files of SU2, whose boundaries are its markers (https://su2code.github.io/docs_v7/Mesh-File/)."""

from __future__ import annotations

import numpy as np

from hemivar.basics.disk import shown
from hemivar.errors import ProblemError
from hemivar.mesh.kinds import CODES, KINDS, VTK_KINDS, unknown_kind
from hemivar.mesh.raw import Block, RawMesh, put_together
from hemivar.mesh.texts import floats, rows_of, whole

__all__ = ["parse_su2"]


def parse_su2(text: str) -> RawMesh:
    """The mesh in the text of an SU2 file."""
    lines = [line for raw in text.splitlines() if (line := raw.partition("%")[0].strip())]
    points, blocks, names = np.zeros((0, 3)), list[Block](), dict[tuple[int, int], str]()
    dim, marker, row = 0, "", 0
    while row < len(lines):
        key, equals, value = (part.strip() for part in lines[row].partition("="))
        row += 1
        if not equals:
            raise ProblemError(
                f"its line '{shown(key[:40])}' is not 'KEY= value'; the counts before it are wrong: save it again"
            )
        if key == "MARKER_TAG":
            marker = value
        if key not in ("NDIME", "NPOIN", "NELEM", "MARKER_ELEMS"):
            continue
        count = int(whole(value.split()[:1] or [""], key)[0])
        if key == "NDIME":
            dim = count
            continue
        own = lines[row : row + count]
        if count < 0 or len(own) < count:
            raise ProblemError(f"{key} says {value} lines, and {len(own)} are there; it is cut off: save it again")
        row += count
        if key == "NPOIN":
            if dim not in (2, 3):
                raise ProblemError(f"NDIME is {dim}; it must be 2 or 3 and stand before NPOIN")
            columns = len(own[0].split()) if own else dim
            table = rows_of(floats([word for line in own for word in line.split()], key), columns, key)
            if columns < dim:
                raise ProblemError(f"its points have {columns} coordinates, and NDIME is {dim}; save it again")
            points = np.column_stack([table[:, :dim], np.zeros((len(own), 3 - dim))])
        else:
            _elements(own, marker if key == "MARKER_ELEMS" else "", blocks, names)
    return put_together(np.arange(len(points)) + 1, points, blocks, names, repeated=False)


def _elements(lines: list[str], name: str, blocks: list[Block], names: dict[tuple[int, int], str]) -> None:
    """Blocks of the elements of each kind; a marker is their group."""
    of = [line.split(None, 1)[0] for line in lines]
    for word in dict.fromkeys(of):
        number = int(whole([word], "kind of an element")[0])
        if number not in VTK_KINDS:
            raise ProblemError(unknown_kind(f"{number} of VTK"))
        kind = KINDS[CODES[VTK_KINDS[number]]]
        words = [
            part
            for line, own in zip(lines, of, strict=True)
            if own == word
            for part in line.split()[1 : 1 + kind.nodes]
        ]
        group = len(names) + 1
        if name:
            names[kind.dim, group] = name
        nodes = rows_of(whole(words, "nodes of an element"), kind.nodes, f"elements of kind {number}")
        blocks.append(Block(kind, nodes + 1, [group] if name else []))
