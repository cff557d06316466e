"""Markers of faces, which TetGen writes into a file beside its tetrahedra."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from hemivar.basics.disk import read_bytes
from hemivar.mesh.kinds import CODES
from hemivar.mesh.raw import RawMesh
from hemivar.mesh.texts import rows_of, whole

__all__ = ["tetgen_faces"]


def tetgen_faces(path: Path, raw: RawMesh) -> None:
    """Add the faces of a ``.face`` file beside a ``.node`` or ``.ele`` file, in groups of their markers."""
    beside = path.with_suffix(".face")
    if not beside.is_file():
        raw.notes.append("there is no .face file beside it, which names boundaries")
        return
    rows = [_words(path.with_suffix(".node"))[1:2], _words(beside)]
    first = int(whole(rows[0][0][:1], "first node of the .node file")[0]) if rows[0] else 0
    head, own = rows[1][0], rows[1][1:]
    columns = 4 + int(whole(head[1:2] or ["0"], "head of the .face file")[0])
    table = rows_of(whole([word for row in own for word in row[:columns]], ".face file"), columns, ".face file")
    raw.cells[2], raw.kinds[2] = table[:, 1:4] - first, np.full(len(table), CODES["triangle"])
    if columns == 4:
        raw.notes.append("its faces have no markers, which name boundaries")
        return
    for marker in np.unique(table[:, 4]).tolist():
        if marker:
            raw.groups[2, str(marker)] = np.flatnonzero(table[:, 4] == marker)


def _words(path: Path) -> list[list[str]]:
    """The words of each line that is no comment."""
    text = read_bytes(path, "mesh file", max(path.stat().st_size, 1)).decode("utf-8", "replace")
    return [words for line in text.splitlines() if (words := line.partition("#")[0].split())]
