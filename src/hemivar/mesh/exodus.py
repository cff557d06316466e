"""Exodus II files (Cubit, MOOSE, SEACAS): element blocks, side sets and node sets, in netCDF of either kind."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np

from hemivar.basics.disk import read_bytes, shown
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.hdf5 import HDF5, arrays_of_hdf5
from hemivar.mesh.kinds import CODES, KINDS, ElementKind, unknown_kind
from hemivar.mesh.raw import Block, RawMesh, put_together

__all__ = ["is_classic_netcdf", "parse_exodus"]

#: Shapes of elements, by how the names of their types begin.
_SHAPES = (
    ("TET", "tetra"), ("HEX", "hexahedron"), ("WEDGE", "wedge"), ("PYR", "pyramid"), ("TRI", "triangle"),
    ("QUAD", "quad"), ("SHELL", "quad"), ("BAR", "line"), ("BEAM", "line"), ("TRUSS", "line"), ("EDGE", "line"),
    ("SPHERE", "vertex"), ("CIRCLE", "vertex"),
)  # fmt: skip
#: Nodes in the middles of edges in the order of VTK.
_ORDER = {
    "hexahedron": [*range(12), *range(16, 20), *range(12, 16)],
    "wedge": [*range(9), *range(12, 15), *range(9, 12)],
}
#: Corners of the sides 1, 2, ... of elements.
_SIDES = {
    "line": ((0,), (1,)),
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)),
    "pyramid": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 3), (0, 3, 2, 1)),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2), (0, 2, 1), (3, 4, 5)),
    "hexahedron": ((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (0, 4, 7, 3), (0, 3, 2, 1), (4, 5, 6, 7)),
}
_FACET = {1: "vertex", 2: "line", 3: "triangle", 4: "quad"}
#: What is read of a file; results are not.
_WANTED = re.compile(r"coord[xyz]?|connect\d+|(?:eb|ss|ns)_(?:names|prop1)|(?:elem|side)_ss\d+|node_ns\d+")


def is_classic_netcdf(start: bytes) -> bool:
    """Whether this is the beginning of a file of netCDF that is not HDF5."""
    return start.startswith((b"CDF\1", b"CDF\2", b"CDF\5"))


def parse_exodus(path: Path, start: bytes) -> RawMesh:
    """What an Exodus file holds: element blocks and side sets are groups, node sets groups of nodes."""
    if start.startswith(HDF5):
        arrays, types = arrays_of_hdf5(path, _WANTED, "elem_type")
    elif is_classic_netcdf(start):
        arrays, types = _classic(path, start)
    else:
        raise ProblemError("it does not begin like an Exodus file (netCDF or HDF5); save it again")
    points = _points(arrays)
    numbers = sorted(int(name[7:]) for name in arrays if name.startswith("connect"))
    blocks, shells = [], list[bool]()
    for number in numbers:
        word = types.get(f"connect{number}", "").upper()
        kind, nodes = _kind(word, arrays[f"connect{number}"].shape), arrays[f"connect{number}"].astype(np.int64)
        order = _ORDER.get(kind.shape.name, []) if kind.quadratic else []
        blocks.append(Block(kind, nodes[:, [*order, *range(len(order), kind.nodes)]], [number]))
        shells.append(word.startswith(("SHELL", "TRISHELL")) or (word.startswith("TRI") and points.shape[1] == 3))
    top = max((block.kind.dim for block in blocks), default=0)
    called = _names(arrays, "eb", max([0, *numbers]))
    names = {(block.kind.dim, number): called[number - 1] for block, number in zip(blocks, numbers, strict=True)}
    sets = sorted(int(name[7:]) for name in arrays if name.startswith("elem_ss"))
    notes = list[str]()
    for number, name in zip(sets, _chosen(_names(arrays, "ss", max([0, *sets])), sets), strict=True):
        members = arrays[f"elem_ss{number}"].astype(np.int64), arrays[f"side_ss{number}"].astype(np.int64)
        facets, left = _side_set(name, *members, blocks[: len(numbers)], shells, top)
        group = max([0, *numbers]) + number
        blocks += [Block(KINDS[CODES[_FACET[rows.shape[1]]]], rows, [group]) for rows in facets]
        names[top - 1, group] = name
        if left:
            notes.append(
                f"side set '{name}' has {left} sides that are edges of shells or ends of bars; they were ignored"
            )
    raw = put_together(np.arange(len(points)) + 1, points, blocks, names, repeated=False)
    _node_sets(raw, arrays)
    raw.notes.extend(notes)
    return raw


def _classic(path: Path, start: bytes) -> tuple[dict[str, AnyArray], dict[str, str]]:
    """Arrays of a file of netCDF 3, and types of elements."""
    if start.startswith(b"CDF\5"):
        raise ProblemError(
            "it is netCDF of the kind CDF-5, which is not read; save it as netCDF-4 or with 64-bit offsets"
        )
    with IMPORTS:
        from scipy.io import netcdf_file

    data = io.BytesIO(read_bytes(path, "mesh file", path.stat().st_size))
    try:
        with netcdf_file(data, "r", mmap=False) as file:
            own = {name: one for name, one in file.variables.items() if _WANTED.fullmatch(name)}
            arrays = {name: np.array(one.data) for name, one in own.items()}
            types = {name: getattr(one, "elem_type", b"").decode("latin-1") for name, one in own.items()}
    except Exception as error:
        raise ProblemError("cannot be read as an Exodus file: it is cut off or damaged; save it again") from error
    return {name: one.astype(one.dtype.newbyteorder("=")) for name, one in arrays.items()}, types


def _points(arrays: dict[str, AnyArray]) -> Array:
    """Coordinates (N, d), which lie in one array or in one for each direction."""
    if "coord" in arrays:
        return np.asarray(arrays["coord"].T, dtype=np.float64)
    rows = [arrays[f"coord{axis}"] for axis in "xyz" if f"coord{axis}" in arrays]
    if not rows or len({len(row) for row in rows}) != 1:
        raise ProblemError("it holds no coordinates (coordx, coordy); save the mesh, not results alone")
    return np.column_stack(rows).astype(np.float64)


def _kind(word: str, shape: tuple[int, ...]) -> ElementKind:
    """The kind of element of a name and a number of nodes: TETRA, TET4 and TETRA4 are one."""
    nodes = shape[1] if len(shape) == 2 else 0
    of = next((of for begin, of in _SHAPES if word.startswith(begin)), "")
    of = "triangle" if of == "quad" and nodes in (3, 6, 7) else of  # triangular shells are SHELL3 or TRISHELL
    kind = next((kind for kind in KINDS if kind.shape.name == of and kind.nodes == nodes), None)
    if kind is None:
        raise ProblemError(unknown_kind(f"{shown(word) or '(without a name)'} of {nodes} nodes"))
    return kind


def _names(arrays: dict[str, AnyArray], of: str, count: int) -> list[str]:
    """Names of blocks or sets, or their numbers where they have none."""
    given = [] if f"{of}_names" not in arrays else list(np.atleast_2d(arrays[f"{of}_names"]))
    texts = [
        b"".join(row.astype("S1").tolist()).partition(b"\0")[0].decode("utf-8", "replace").strip() for row in given
    ]
    ids = [str(number) for number in np.ravel(arrays.get(f"{of}_prop1", [])).tolist()]
    plain = [ids[k] if k < len(ids) else str(k + 1) for k in range(count)]
    return [texts[k] if k < len(texts) and texts[k] else plain[k] for k in range(count)]


def _chosen(names: list[str], numbers: list[int]) -> list[str]:
    return [names[number - 1] for number in numbers]


def _side_set(
    name: str, elements: IntArray, sides: IntArray, blocks: list[Block], shells: list[bool], top: int
) -> tuple[list[IntArray], int]:
    """Corners of the facets of a side set, in blocks (k, 2 to 4), and how many of its sides are no facets."""
    ends = np.cumsum([0, *(len(block.nodes) for block in blocks)])
    if len(elements) != len(sides) or (len(elements) and not 1 <= elements.min() <= elements.max() <= ends[-1]):
        raise ProblemError(f"side set '{shown(name)}' refers to an element that is not there; save the mesh again")
    facets, left = [], 0
    of = np.searchsorted(ends, elements, side="left") - 1
    for number in np.unique(of).tolist():
        block, own = blocks[number], of == number
        rows, shape = block.nodes[elements[own] - 1 - ends[number]], block.kind.shape
        for side in np.unique(sides[own]).tolist():
            chosen = rows[sides[own] == side]
            at = side - 1 - 2 * (shells[number] and shape.dim == top)  # before its edges a shell has two faces
            if shape.dim == top - 1 and side in (1, 2) and shape.dim > 0:
                facets.append(chosen[:, : shape.corners])
            elif shape.dim < top or at < 0 <= side - 1:
                left += len(chosen)
            elif at >= len(_SIDES[shape.name]) or at < 0:
                raise ProblemError(
                    f"side set '{shown(name)}' names side {side} of a {shape.name}; it has {len(_SIDES[shape.name])}"
                )
            else:
                facets.append(chosen[:, _SIDES[shape.name][at]])
    return facets, left


def _node_sets(raw: RawMesh, arrays: dict[str, AnyArray]) -> None:
    sets = sorted(int(name[7:]) for name in arrays if name.startswith("node_ns"))
    for number, name in zip(sets, _chosen(_names(arrays, "ns", max([0, *sets])), sets), strict=True):
        nodes = arrays[f"node_ns{number}"].astype(np.int64)
        if len(nodes) and not 1 <= nodes.min() <= nodes.max() <= len(raw.points):
            raise ProblemError(f"node set '{shown(name)}' refers to a node that is not there; save the mesh again")
        raw.at_nodes[name] = np.union1d(raw.at_nodes.get(name, nodes[:0]), nodes - 1)
