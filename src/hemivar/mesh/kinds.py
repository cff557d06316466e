"""Kinds of elements that mesh files hold: their corners, edges and faces, and their parts where edges are halved.

Nodes are numbered as in VTK: corners first, then the middles of the edges in the order of ``Shape.edges``.  Middles of
faces and cells may follow; they are not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from hemivar.basics.types import Array, IntArray

__all__ = ["CODES", "KINDS", "SHAPES", "VTK_KINDS", "ElementKind", "Shape", "red_tetrahedra", "unknown_kind"]


@dataclass(frozen=True)
class Shape:
    """What an element looks like, by the numbers of its nodes."""

    name: str
    plural: str
    dim: int
    corners: int
    edges: tuple[tuple[int, int], ...] = ()  # corners of the edges
    faces: tuple[tuple[int, ...], ...] = ()  # corners of the faces of a solid, outward oriented
    children: tuple[tuple[str, tuple[int, ...]], ...] = ()

    @property
    def quads(self) -> tuple[tuple[int, ...], ...]:
        """Its quadrilaterals, which have a middle."""
        return ((0, 1, 2, 3),) if self.name == "quad" else tuple(face for face in self.faces if len(face) == 4)


def _shapes() -> dict[str, Shape]:
    ring = ((0, 1), (1, 2), (2, 3), (3, 0))
    grid = (  # the 27 nodes of a hexahedron by their places along x, y and z
        ((0, 16, 4), (11, 24, 15), (3, 19, 7)),
        ((8, 22, 12), (20, 26, 21), (10, 23, 14)),
        ((1, 17, 5), (9, 25, 13), (2, 18, 6)),
    )
    around = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
    levels = ((0, 1, 2, 6, 7, 8), (12, 13, 14, 15, 16, 17), (3, 4, 5, 9, 10, 11))  # of a wedge of 18 nodes
    triangles = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))  # of one of second order
    box = tuple(
        ("hexahedron", tuple(grid[x + a][y + b][z + c] for a, b, c in around))
        for x, y, z in product(range(2), repeat=3)
    )
    prisms = tuple(
        ("wedge", tuple(low[k] for k in part) + tuple(high[k] for k in part))
        for low, high in pairwise(levels)
        for part in triangles
    )
    base = ((0, 5, 13, 8, 9), (5, 1, 6, 13, 10), (13, 6, 2, 7, 11), (8, 13, 7, 3, 12), (9, 10, 11, 12, 4))
    between = ((5, 9, 10, 13), (6, 10, 11, 13), (7, 11, 12, 13), (8, 12, 9, 13))
    all_shapes = (
        Shape("vertex", "points", 0, 1, children=(("vertex", (0,)),)),
        Shape("line", "lines", 1, 2, ((0, 1),), children=(("line", (0, 2)), ("line", (2, 1)))),
        Shape(
            "triangle", "triangles", 2, 3, ((0, 1), (1, 2), (2, 0)),
            children=tuple(("triangle", part) for part in triangles),
        ),
        Shape(
            "quad", "quadrilaterals", 2, 4, ring,
            children=tuple(("quad", part) for part in ((0, 4, 8, 7), (4, 1, 5, 8), (8, 5, 2, 6), (7, 8, 6, 3))),
        ),
        Shape(
            "tetra", "tetrahedra", 3, 4, ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
            ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)),
        ),
        Shape(
            "pyramid", "pyramids", 3, 5, (*ring, (0, 4), (1, 4), (2, 4), (3, 4)),
            ((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
            (*(("pyramid", part) for part in (*base, (9, 12, 11, 10, 13))), *(("tetra", part) for part in between)),
        ),
        Shape(
            "wedge", "wedges", 3, 6,
            ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
            ((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)), prisms,
        ),
        Shape(
            "hexahedron", "hexahedra", 3, 8,
            (*ring, (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
            ((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (2, 3, 7, 6), (0, 4, 7, 3), (1, 2, 6, 5)), box,
        ),
    )  # fmt: skip
    return {shape.name: shape for shape in all_shapes}


SHAPES = _shapes()


@dataclass(frozen=True)
class ElementKind:
    """A kind of element."""

    name: str  # as in meshio
    shape: Shape
    nodes: int  # number of nodes

    @property
    def dim(self) -> int:
        """Dimension."""
        return self.shape.dim

    @property
    def quadratic(self) -> bool:
        """Whether it has nodes in the middles of its edges."""
        return self.nodes > self.shape.corners


def _kinds() -> tuple[ElementKind, ...]:
    more = {
        "line": (3,), "triangle": (6, 7), "quad": (8, 9), "tetra": (10,), "pyramid": (13, 14), "wedge": (15, 18),
        "hexahedron": (20, 27),
    }  # fmt: skip
    plain = [ElementKind(name, shape, shape.corners) for name, shape in SHAPES.items()]
    return (*plain, *(ElementKind(f"{name}{n}", SHAPES[name], n) for name, several in more.items() for n in several))


#: All kinds; elements say which one they are by its place here.
KINDS = _kinds()
#: Names of the kinds by their numbers in VTK; pixels and voxels have other orders of nodes.
VTK_KINDS = {
    1: "vertex", 3: "line", 5: "triangle", 8: "quad", 9: "quad", 10: "tetra", 11: "hexahedron", 12: "hexahedron",
    13: "wedge", 14: "pyramid", 21: "line3", 22: "triangle6", 23: "quad8", 24: "tetra10", 25: "hexahedron20",
    26: "wedge15", 27: "pyramid13", 28: "quad9", 29: "hexahedron27", 32: "wedge18", 34: "triangle7",
}  # fmt: skip
CODES = {kind.name: code for code, kind in enumerate(KINDS)}


def unknown_kind(name: str) -> str:
    """What is said of a kind that is not in the table."""
    return (
        f"it holds cells of type {name}, which are not read; mesh with triangles, quadrilaterals, tetrahedra, "
        "hexahedra, wedges or pyramids of order 1 or 2"
    )


def red_tetrahedra(points: Array, cells: IntArray, middles: IntArray) -> IntArray:
    """Eight children of each tetrahedron, positively oriented.

    The octahedron inside is cut along the diagonal between the midpoints of 02 and 13, for which tetrahedra are turned
    if another diagonal is shorter.  The k-th child of cell c of M is row ``c + k M``.
    """
    ends = ((2, 4), (1, 3), (0, 5))
    lengths = [np.sum((points[middles[:, a]] - points[middles[:, b]]) ** 2, axis=1) for a, b in ends]
    shortest = np.argmin([lengths[0] * (1.0 - 2e-9), lengths[1] * (1.0 - 1e-9), lengths[2]], axis=0)
    v, e = cells.copy(), middles.copy()
    for diagonal, corners, edges in ((1, (0, 2, 3, 1), (2, 5, 3, 0, 1, 4)), (2, (0, 3, 1, 2), (3, 4, 0, 2, 5, 1))):
        turned = np.flatnonzero(shortest == diagonal)
        v[turned] = cells[turned][:, corners]
        e[turned] = middles[turned][:, edges]
    (v0, v1, v2, v3), (e01, e12, e02, e03, e13, e23) = v.T, e.T
    children = [
        (v0, e01, e02, e03), (e01, v1, e12, e13), (e02, e12, v2, e23), (e03, e13, e23, v3),
        (e01, e02, e03, e13), (e02, e12, e13, e01), (e02, e03, e13, e23), (e12, e13, e23, e02),
    ]  # fmt: skip
    return np.vstack([np.column_stack(child) for child in children])
