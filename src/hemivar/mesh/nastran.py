"""Bulk data of Nastran: grid points, elements and their properties, in free, small and large fields."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.kinds import CODES, KINDS, unknown_kind
from hemivar.mesh.nastran_systems import KINDS_OF_SYSTEMS, in_basic_system
from hemivar.mesh.raw import Block, RawMesh, put_together
from hemivar.mesh.texts import Included, floats, whole

__all__ = ["is_nastran", "parse_nastran"]

#: Shapes of elements, by how their cards begin.
_SHAPES = {
    "CTRIA": "triangle", "CQUAD": "quad", "CPLSTN3": "triangle", "CPLSTS3": "triangle", "CPLSTN6": "triangle",
    "CPLSTS6": "triangle", "CPLSTN": "quad", "CPLSTS": "quad", "CSHEAR": "quad", "CTETRA": "tetra", "CPYR": "pyramid",
    "CPENTA": "wedge", "CHEXA": "hexahedron", "CBAR": "line", "CBEAM": "line", "CROD": "line", "CTUBE": "line",
}  # fmt: skip
#: Elements that are no part of a body (springs, masses, rigid ones, gaps), and cards that are no elements.
_OTHERS = (
    "CELAS", "CDAMP", "CMASS", "CONM", "CONROD", "CBUSH", "CGAP", "CWELD", "CFAST", "CVISC", "PLOTEL",
)  # fmt: skip
_NO_ELEMENTS = ("CORD", "CEND", "CSUPER", "CASE")
#: Nodes in the middles of edges in the order of VTK.
_ORDER = {
    "hexahedron20": [*range(12), *range(16, 20), *range(12, 16)],
    "wedge15": [*range(9), *range(12, 15), *range(9, 12)],
}
#: Names of properties in comments, as HyperMesh, Femap and ANSA write them.
_NAMES = re.compile(
    r'^\$(?:HMNAME (?:PROP|COMP)\s*(?P<a>\d+)\s*"(?P<an>[^"]+)"|\s*Femap Property (?P<b>\d+)\s*:\s*(?P<bn>.+)'
    r"|ANSA_NAME;(?P<c>\d+);P\w+;~?(?P<cn>[^;]+))",
    re.MULTILINE,
)
_CARD = re.compile(rb"^(?:GRID[\s*,]|BEGIN\s+BULK|SOL\s|CEND\b|INCLUDE\s*['\"])", re.MULTILINE | re.IGNORECASE)
#: A file that is included: its name, which may go on over lines where it stands in quotes.
_INCLUDE = re.compile(
    r"""^[ \t]*INCLUDE[ \t]*(?:'([^']*)'|"([^"]*)"|([^\s'"][^\n$]*))[^\n]*$""", re.MULTILINE | re.IGNORECASE
)
_ENDDATA = r"(?im)^[ \t]*ENDDATA"


def is_nastran(start: bytes) -> bool:
    """Whether this is the beginning of a deck of Nastran."""
    return _CARD.search(start) is not None


def parse_nastran(text: str, path: Path) -> RawMesh:
    """The mesh in the text of a deck of this name, and of the files that it includes; properties are groups."""
    text = Included(path, text).whole(_INCLUDE, _ENDDATA)
    names = {}
    for match in _NAMES.finditer(text):
        number, name = (one for one in match.groups() if one is not None)
        names[int(number)] = name.strip()
    cards = _cards(text)
    ids, points, turned = _grid(cards)
    blocks, others = list[Block](), set[str]()
    for card, fields in cards:
        if card.startswith(_OTHERS):
            others.add(card)
        elif card.startswith("C") and not card.startswith(_NO_ELEMENTS):
            _elements(card, fields, blocks)
    groups = {(block.kind.dim, group) for block in blocks for group in np.unique(block.groups).tolist()}
    known = {(dim, group): names[group] for dim, group in groups if group in names}
    raw = put_together(ids, points, blocks, known, repeated=False)
    if turned:
        raw.notes.append(
            "directions of displacements that grid points have of their own (CD) were ignored: they are x, y, z"
        )
    raw.notes.extend(f"elements {card} belong to no body and were ignored" for card in sorted(others))
    return raw


def _grid(cards: list[tuple[str, AnyArray]]) -> tuple[IntArray, Array, bool]:
    """Numbers and places of the grid points, and whether any has directions of its own for displacements."""
    own = [_columns(fields, 6) for card, fields in cards if card == "GRID"]
    if not own:
        raise ProblemError("it holds no GRID; save the bulk data of the mesh")
    rows = np.vstack(own)
    left_out = [_columns(fields, 6)[0] for card, fields in cards if card == "GRDSET"] or [np.full(6, "")]
    ids = whole(rows[:, 0].tolist(), "number of a GRID")
    systems, directions = (
        whole(_filled(np.where(rows[:, k] == "", left_out[0][k], rows[:, k])), "coordinate system of a GRID")
        for k in (1, 5)
    )
    points = floats(_filled(rows[:, 2:5]), "GRID").reshape(-1, 3)
    stated = [(card, fields) for card, fields in cards if card in KINDS_OF_SYSTEMS]
    return ids, in_basic_system(ids, systems, points, stated), bool((directions > 0).any())


def _columns(fields: AnyArray, count: int) -> AnyArray:
    return np.hstack([fields, np.full((len(fields), count), "")])[:, :count]


def _filled(fields: AnyArray) -> list[str]:
    """Fields one after the other, empty ones as zeros."""
    words: list[str] = np.where(fields == "", "0", fields).ravel().tolist()
    return words


def _elements(card: str, fields: AnyArray, blocks: list[Block]) -> None:
    """Blocks of elements (k, n) of fields: number, property, nodes."""
    shape = next((shape for begin, shape in _SHAPES.items() if card.startswith(begin)), None)
    if shape is None or card.startswith("CTRIAX"):
        raise ProblemError(unknown_kind(card))
    kinds = {kind.nodes: kind for kind in KINDS if kind.shape.name == shape}
    corners = min(kinds)
    nodes = fields[:, 2 : 2 + max(kinds)]
    nodes = nodes[:, :2] if shape == "line" else nodes
    if card in ("CTRIA3", "CTRIAR", "CQUAD4", "CQUADR", "CSHEAR", "CPLSTN3", "CPLSTS3", "CPLSTN4", "CPLSTS4"):
        nodes = nodes[:, :corners]  # angles and thicknesses follow
    if nodes.shape[1] < corners or (nodes[:, :corners] == "").any():
        raise ProblemError(f"a {card} has fewer than {corners} nodes; it is cut off or damaged: save it again")
    edges = len(KINDS[CODES[shape]].shape.edges)
    full = nodes.shape[1] >= corners + edges
    second = (
        (nodes[:, corners : corners + edges] != "").all(axis=1)
        if full and shape != "line"
        else np.zeros(len(nodes), bool)
    )
    groups = whole(np.where(fields[:, 1] == "", fields[:, 0], fields[:, 1]).tolist(), f"property of a {card}")
    for chosen, count in ((~second, corners), (second, corners + edges)):
        if chosen.any():
            kind = kinds[count]
            own = whole(nodes[chosen, :count].ravel().tolist(), f"nodes of a {card}").reshape(-1, count)
            blocks.append(Block(kind, own[:, _ORDER.get(kind.name, slice(None))], groups[chosen]))


# ---- cards -------------------------------------------------------------------------------------------------------


def _cards(text: str) -> list[tuple[str, AnyArray]]:
    """Cards of a name and of as many lines: their fields (k, n), without the name."""
    lines = [line for line in text.expandtabs().splitlines() if line.strip() and not line.startswith("$")]
    begin = next((number + 1 for number, line in enumerate(lines) if line.upper().startswith("BEGIN")), 0)
    rows = [_fields(line.partition("$")[0]) for line in lines[begin:]]
    first = np.array([not (row[0] == "" or row[0][0] in "+*") for row in rows], dtype=bool)
    if len(rows) and not first[0]:
        raise ProblemError("its first line goes on from another one; the beginning is cut off: save it again")
    starts = np.flatnonzero(first)
    many = np.diff(starts, append=len(rows))
    kinds: dict[tuple[str, int], list[list[str]]] = {}
    for start, count in zip(starts.tolist(), many.tolist(), strict=True):
        fields = [field for row in rows[start : start + count] for field in row[1:]]
        kinds.setdefault((rows[start][0].rstrip("*").upper(), len(fields)), []).append(fields)
    return [(card, np.array(own, dtype="U").reshape(len(own), width)) for (card, width), own in kinds.items()]


def _fields(line: str) -> list[str]:
    """The name of a card, and its fields in this line."""
    if "," in line:
        words = [word.strip() for word in line.split(",")]
        many = 4 if words[0].endswith("*") else 8
        return [words[0], *words[1 : 1 + many], *[""] * (many + 1 - len(words))]
    name = line[:8].strip()
    width, many = (16, 4) if name.endswith("*") or name.startswith("*") else (8, 8)
    return [name, *[line[8 + k * width : 8 + (k + 1) * width].strip() for k in range(many)]]
