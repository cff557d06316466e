"""Conversion to conforming simplices: elements of any kind cut into triangles and tetrahedra that fit together.

Second-order elements of plane meshes whose edges are straight keep their corners, and order 2 is suggested; so do
tetrahedra, whose edges become straight.  All others are cut once at the middles of their edges, which are on the curve
where the file says so; tetrahedra for elements of order 1.  Then plane quadrilaterals
are split by their centre.  Solids are split so that both sides of a face do it alike: a quadrilateral face is cut by
the diagonal at its node of the least number, and the cell is a cone over these triangles from its own least node.
Where that would invert a tetrahedron the cell is a cone from its centre.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.keys import equal_rows, pair_keys, signed_volumes
from hemivar.mesh.kinds import KINDS, SHAPES, Shape, red_tetrahedra
from hemivar.mesh.raw import RawMesh

__all__ = ["Simplices", "cones", "cut_at_least", "simplices"]

#: By how much of the length of an edge its middle may be off, so that it is straight.
_STRAIGHT = 1e-6


@dataclass(frozen=True, eq=False)
class Simplices:
    """What a mesh file holds, in triangles and tetrahedra."""

    points: Array  # (N, d)
    cells: dict[int, IntArray]
    origin: dict[int, IntArray]  # (k,): the element of the file that each stems from
    at_nodes: dict[str, BoolArray]  # (N,)
    order: int  # the order of elements that the file suggests
    notes: tuple[str, ...]  # what was done


#: Elements of one shape: their nodes (k, n), and their numbers in the file.
_Part = tuple[Shape, IntArray, IntArray]
_Parts = dict[int, list[_Part]]


def simplices(raw: RawMesh, wanted: int | None = None) -> Simplices:
    """The elements of a file as simplices, for elements of the ``wanted`` order where one is given."""
    dim = max(raw.cells)
    nodes = _Nodes(raw.points[:, :dim], {name: _mask(ids, len(raw.points)) for name, ids in raw.at_nodes.items()})
    parts = {of: list(_by_shape(cells, raw.kinds[of])) for of, cells in raw.cells.items()}
    order, cut, off = 1, False, 0.0
    if any(KINDS[code].quadratic for code in np.unique(raw.kinds[dim])):
        edges, middles = _middles(raw.cells[dim], raw.kinds[dim], nodes.points)
        off = _off(nodes.points, edges, middles)
        alone = all(shape.name == "tetra" for shape, _, _ in parts[dim])
        cut = off > _STRAIGHT if dim == 2 else wanted == 1 or not alone
        order = 1 if cut or wanted == 1 else 2
        if cut:
            parts = _cut_once(nodes, edges, middles, parts)
    cells, origin = {}, {}
    for of, own in parts.items():
        pieces = [_split(nodes, part) for part in own]
        together = np.concatenate([number for _, number in pieces])
        sort = np.argsort(together, kind="stable")
        cells[of], origin[of] = np.concatenate([simplex for simplex, _ in pieces])[sort], together[sort]
    notes = tuple(_notes(raw, dim, origin[dim], order, cut, off))
    return Simplices(nodes.points, cells, origin, nodes.sets, order, notes)


def _mask(ids: IntArray, count: int) -> BoolArray:
    mask = np.zeros(count, dtype=bool)
    mask[ids] = True
    return mask


class _Nodes:
    """Points that grow, and the sets that they belong to."""

    def __init__(self, points: Array, sets: dict[str, BoolArray]) -> None:
        self.points, self.sets = points, sets

    def add(self, points: Array, corners: IntArray) -> IntArray:
        """Numbers of new points (k, d); they belong to the sets of all of their corners (k, n)."""
        start = len(self.points)
        self.points = np.vstack([self.points, points])
        self.sets = {name: np.append(mask, mask[corners].all(axis=1)) for name, mask in self.sets.items()}
        return start + np.arange(len(points))


def _by_shape(cells: IntArray, kinds: IntArray) -> Iterator[_Part]:
    """Elements by their corners."""
    names = np.array([list(SHAPES).index(kind.shape.name) for kind in KINDS])[kinds]
    for number in np.unique(names).tolist():
        shape, rows = list(SHAPES.values())[number], np.flatnonzero(names == number)
        yield shape, cells[rows, : shape.corners], rows


# ---- second order ------------------------------------------------------------------------------------------------


def _middles(cells: IntArray, kinds: IntArray, points: Array) -> tuple[IntArray, IntArray]:
    """Edges (k, 2) of second-order elements, each once, smaller number first, and their middles (k,)."""
    middles = []
    for code in np.unique(kinds).tolist():
        shape, own = KINDS[code].shape, cells[kinds == code]
        if KINDS[code].quadratic:
            ends = np.sort(own[:, shape.edges], axis=2).reshape(-1, 2)
            middles.append(np.column_stack([ends, own[:, shape.corners : shape.corners + len(shape.edges)].ravel()]))
    rows = np.unique(np.concatenate(middles), axis=0)
    rows = rows[(rows[:, 0] != rows[:, 1]) & (rows[:, 2] >= 0)]  # edges of collapsed cells, middles that are left out
    twice = (rows[1:, :2] == rows[:-1, :2]).all(axis=1)
    if twice.any():
        point = points[rows[int(np.argmax(twice)), 2]]
        raise ProblemError(
            f"an edge at {_place(point)} has another node in its middle in each of two cells; join coincident nodes"
        )
    return rows[:, :2], rows[:, 2]


def _off(points: Array, edges: IntArray, middles: IntArray) -> float:
    """By how much of its length the middle of an edge is off at most."""
    start, end = points[edges[:, 0]], points[edges[:, 1]]
    off = np.linalg.norm(points[middles] - 0.5 * (start + end), axis=1)
    return float((off / np.linalg.norm(end - start, axis=1)).max(initial=0.0))


def _cut_once(nodes: _Nodes, edges: IntArray, middles: IntArray, parts: _Parts) -> _Parts:
    """Elements cut at the middles of their edges, which are new where the file has none."""
    own = [part for of in parts.values() for part in of if part[0].edges]
    for part in own:
        collapsed = ~_distinct(part[1])
        if part[0].dim == 3 and collapsed.any():
            raise _distorted(nodes, part, collapsed, "is of second order and has a node twice")
    ends = [np.sort(corners[:, shape.edges], axis=2) for shape, corners, _ in own]
    every = np.unique(np.concatenate([pairs.reshape(-1, 2) for pairs in ends]), axis=0)
    count = len(nodes.points)
    keys, numbers = pair_keys(every, count), np.where(every[:, 0] == every[:, 1], every[:, 0], -1)
    numbers[np.searchsorted(keys, pair_keys(edges, count))] = middles
    new = every[numbers < 0]
    numbers[numbers < 0] = nodes.add(nodes.points[new].mean(axis=1), new)
    halves = [numbers[np.searchsorted(keys, pair_keys(pairs, count))] for pairs in ends]
    centres = _face_centres(nodes, own, halves)
    whole = [np.hstack([part[1], *more]) for part, *more in zip(own, halves, centres, strict=True)]
    cut = iter([list(_children(nodes, part, full)) for part, full in zip(own, whole, strict=True)])
    return {
        of: [child for part in some for child in (next(cut) if part[0].edges else [part])] for of, some in parts.items()
    }


def _face_centres(nodes: _Nodes, parts: list[_Part], halves: list[IntArray]) -> list[IntArray]:
    """Middles of the quadrilateral faces of elements, (k, q) for each part: where the edges put them."""
    corners, middles = [np.zeros((0, 4), dtype=np.int64)], [np.zeros((0, 4), dtype=np.int64)]
    for (shape, own, _), half in zip(parts, halves, strict=True):
        sides = {tuple(sorted(edge)): number for number, edge in enumerate(shape.edges)}
        for face in shape.quads:
            ring = [tuple(sorted((face[k], face[(k + 1) % 4]))) for k in range(4)]
            corners.append(own[:, face])
            middles.append(half[:, [sides[edge] for edge in ring]])
    faces, around = np.concatenate(corners), np.concatenate(middles)
    _, first, which = np.unique(equal_rows(np.sort(faces, axis=1)), return_index=True, return_inverse=True)
    places = 0.5 * nodes.points[around[first]].sum(axis=1) - 0.25 * nodes.points[faces[first]].sum(axis=1)
    centres = iter(
        np.split(nodes.add(places, faces[first])[which.ravel()], np.cumsum([len(one) for one in corners[1:]]))
    )
    return [
        np.column_stack([np.zeros((len(own), 0), dtype=np.int64), *(next(centres) for _ in shape.quads)])
        for shape, own, _ in parts
    ]


def _children(nodes: _Nodes, part: _Part, full: IntArray) -> Iterator[_Part]:
    """The parts of elements with all their middles, (k, n)."""
    shape, corners, rows = part
    if shape.name == "tetra":
        yield shape, red_tetrahedra(nodes.points, corners, full[:, 4:]), np.tile(rows, 8)
        return
    if shape.name == "hexahedron":
        places = 0.25 * (nodes.points[full[:, 8:20]].sum(axis=1) - nodes.points[corners].sum(axis=1))
        full = np.column_stack([full, nodes.add(places, corners)])
    for name, local in shape.children:
        yield SHAPES[name], full[:, local], rows


# ---- simplices ---------------------------------------------------------------------------------------------------


def _split(nodes: _Nodes, part: _Part) -> tuple[IntArray, IntArray]:
    """Simplices of elements, and the number of the element of each."""
    shape, corners, rows = part
    if shape.corners == shape.dim + 1:
        return corners, rows
    if shape.dim == 3:
        return _cones(nodes, part)
    if nodes.points.shape[1] == 3:
        triangles = cut_at_least(corners)
        real = _distinct(triangles)
        return triangles[real], np.repeat(rows, 2).reshape(-1, 2)[real]
    return _fans(nodes, part)


def cut_at_least(quads: IntArray) -> IntArray:
    """The two triangles (..., 2, 3) of quadrilaterals (..., 4), cut at the node of the least number."""
    turn = np.argmin(quads, axis=-1)[..., None] + np.arange(4)
    ring = np.take_along_axis(quads, turn % 4, axis=-1)
    return ring[..., [[0, 1, 2], [0, 2, 3]]]


def _distinct(rows: IntArray) -> BoolArray:
    """Whether the nodes of simplices (..., n) differ."""
    ordered = np.sort(rows, axis=-1)
    return np.asarray((ordered[..., 1:] != ordered[..., :-1]).all(axis=-1))


def _fans(nodes: _Nodes, part: _Part) -> tuple[IntArray, IntArray]:
    """Triangles of plane quadrilaterals: four round the centre, two where they are not convex, one where collapsed."""
    _, quads, rows = part
    collapsed = quads == np.roll(quads, -1, axis=1)
    flat, many = collapsed.any(axis=1), collapsed.sum(axis=1) > 1
    if many.any():
        raise _distorted(nodes, part, many, "has fewer than three corners")
    ring = np.arange(4)
    corner = nodes.points[quads]
    ahead, behind = np.roll(corner, -1, axis=1) - corner, np.roll(corner, 1, axis=1) - corner
    bend = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
    bend *= np.sign(bend.sum(axis=1))[:, None]
    reflex = np.argmin(bend, axis=1)
    convex = ~flat & (bend.min(axis=1) >= -SAME * bend.max(axis=1))
    bent = ~flat & ~convex
    turned = np.take_along_axis(
        quads, (np.where(flat, np.argmax(collapsed, axis=1) + 1, reflex)[:, None] + ring) % 4, axis=1
    )
    own, halves = quads[convex], turned[bent][:, [[0, 1, 2], [0, 2, 3]]]
    centre = nodes.add(nodes.points[own].mean(axis=1), own)
    fans = np.stack([own, np.roll(own, -1, axis=1), np.broadcast_to(centre[:, None], own.shape)], axis=2)
    wrong = np.zeros(len(quads), dtype=bool)
    for chosen, pieces in ((convex, fans), (bent, halves)):
        areas = signed_volumes(nodes.points, pieces.reshape(-1, 3)).reshape(pieces.shape[:2])
        wrong[chosen] = (areas * np.sign(areas.sum(axis=1))[:, None]).min(axis=1, initial=np.inf) <= 0.0
    if wrong.any():
        raise _distorted(nodes, part, wrong, "crosses itself or has no area")
    parts = ((fans.reshape(-1, 3), convex, 4), (halves.reshape(-1, 3), bent, 2), (turned[flat][:, :3], flat, 1))
    return (
        np.concatenate([triangles for triangles, _, _ in parts]),
        np.concatenate([np.repeat(rows[chosen], count) for _, chosen, count in parts]),
    )


def _cones(nodes: _Nodes, part: _Part) -> tuple[IntArray, IntArray]:
    """Tetrahedra of solids: cones from the least node over the triangles of the faces, from the centre else."""
    shape, cells, rows = part
    tetrahedra, chosen = cones(shape, cells, cells.min(axis=1))
    bad = _bad(nodes, tetrahedra, chosen)
    chosen &= ~bad[:, None]
    solids, number = [tetrahedra[chosen]], [np.broadcast_to(rows[:, None], chosen.shape)[chosen]]
    if bad.any():
        own = cells[bad]
        once = np.sort(own, axis=1)
        weight = np.column_stack(
            [np.ones(len(own), dtype=bool), once[:, 1:] != once[:, :-1]]
        )  # repeated nodes count once
        places = (nodes.points[once] * weight[..., None]).sum(axis=1) / weight.sum(axis=1)[:, None]
        tetrahedra, chosen = cones(shape, own, nodes.add(places, own))
        if (still := _bad(nodes, tetrahedra, chosen)).any():
            wrong = np.zeros(len(cells), dtype=bool)
            wrong[np.flatnonzero(bad)[still]] = True
            raise _distorted(nodes, part, wrong, "is inside out somewhere, or has no volume")
        solids.append(tetrahedra[chosen])
        number.append(np.broadcast_to(rows[bad][:, None], chosen.shape)[chosen])
    return np.concatenate(solids), np.concatenate(number)


def cones(shape: Shape, cells: IntArray, apex: IntArray) -> tuple[IntArray, BoolArray]:
    """Tetrahedra (k, t, 4) between nodes (k,) and the triangles of solids (k, n); which have four nodes, (k, t)."""
    surface = [cells[:, None, face] for face in shape.faces if len(face) == 3]
    surface += [cut_at_least(cells[:, face]) for face in shape.faces if len(face) == 4]
    triangles = np.concatenate(surface, axis=1)[..., [0, 2, 1]]  # seen from inside
    tips = np.broadcast_to(apex[:, None, None], (*triangles.shape[:2], 1))
    tetrahedra = np.concatenate([triangles, tips], axis=2)
    return tetrahedra, _distinct(tetrahedra)


def _bad(nodes: _Nodes, tetrahedra: IntArray, real: BoolArray) -> BoolArray:
    """Which solids (k,) have tetrahedra (k, t, 4) of unlike signs or without volume, or no ``real`` one, (k, t)."""
    volumes = np.where(real, signed_volumes(nodes.points, tetrahedra.reshape(-1, 4)).reshape(real.shape), 0.0)
    whole = volumes.sum(axis=1)
    flat = volumes * np.sign(whole)[:, None] <= SAME * np.abs(whole)[:, None]
    return np.asarray((real & flat).any(axis=1) | ~real.any(axis=1))


def _distorted(nodes: _Nodes, part: _Part, bad: BoolArray, what: str) -> ProblemError:
    """An error that names the first of the elements that cannot be split."""
    shape, cells, rows = part
    first = int(np.argmax(bad))
    several = f" ({np.count_nonzero(bad)} such cells)" if np.count_nonzero(bad) > 1 else ""
    point = _place(nodes.points[cells[first]].mean(axis=0))
    return ProblemError(f"{shape.name} {rows[first] + 1} of the file, at {point}, {what}{several}; correct its shape")


def _place(point: Array) -> str:
    return "(" + ", ".join(f"{x:.6g}" for x in point) + ")"


def _notes(raw: RawMesh, dim: int, origin: IntArray, order: int, cut: bool, off: float) -> Iterator[str]:
    """What was done, one sentence for each shape; middles of edges are ``off`` by this part of their length."""
    names, of = ("triangles", "tetrahedra")[dim - 2], np.bincount(origin, minlength=len(raw.kinds[dim]))
    for shape in SHAPES.values():
        for quadratic in (False, True):
            codes = [code for code, kind in enumerate(KINDS) if kind.shape is shape and kind.quadratic is quadratic]
            own = np.isin(raw.kinds[dim], codes)
            many, pieces = np.count_nonzero(own), of[own].sum()
            second = " of second order" if quadratic else ""
            if not many:
                continue
            if pieces != many:
                how = "cut at the middles of their edges" if cut else "split"
                yield f"{many} {shape.plural}{second} were {how} into {pieces} {names}" + (" of order 1" if cut else "")
            if not quadratic and order == 2:
                yield f"{many} {shape.plural} of first order have order 2 as well, as those of second order beside them"
            if quadratic and order == 2:
                have = "have" if off <= _STRAIGHT else "were given"
                yield f"{many} {shape.plural} of second order {have} straight edges: order = 2 unless another is given"
                if off > _STRAIGHT:
                    yield f"middles of edges moved by up to {off:.2g} of the length; order = 1 cuts the edges there"
