"""Cracks and interfaces: curves and surfaces inside a body, opened; nodes are doubled, both sides are boundaries."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from hemivar.basics.types import BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.keys import cell_facets, facet_keys, frozen, shared_facets
from hemivar.mesh.refine import Refinement

if TYPE_CHECKING:
    from hemivar.mesh.mesh import Mesh

__all__ = ["opened"]


def opened(mesh: Mesh, name: str, facets: IntArray) -> Mesh:
    """The mesh in which the facets (k, d) inside of it are open, see :meth:`Mesh.opened`."""
    cut = _opened(mesh, name, facets)
    if cut is None:
        raise ProblemError(
            f"interface '{name}' has no node away from its ends, so nothing opens; refine the mesh, or let it reach "
            "the boundary of the body"
        )
    closed = _closed(mesh, cut.cells, facets)
    if not len(closed):
        return cut
    point, apart = _first_place(mesh, facets, closed)
    if apart:
        raise ProblemError(
            f"interface '{name}': its piece at {point} has no node away from its ends; refine the mesh there, or let "
            "the piece reach the boundary of the body"
        )
    note = (
        f"interface '{name}': {len(closed)} of its {len(facets)} facets stay closed, the first at {point}, as all of "
        "their nodes are ends of it; refine the mesh there"
    )
    return cut.made_by(None, replace(cut.reading, notes=(*mesh.notes, note)))


def _closed(mesh: Mesh, cells: IntArray, facets: IntArray) -> IntArray:
    """Those of the facets that did not open, as their cells have the same nodes there."""
    every, pair, new_keys = _pairs(mesh, cells, facets)
    closed: IntArray = every[pair[new_keys[pair[:, 0]] == new_keys[pair[:, 1]], 0]]
    return closed


def _pairs(mesh: Mesh, cells: IntArray, facets: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """All facets of cells, the pairs of their numbers that lie on both sides of these facets, and keys in new nodes."""
    every, keys, _ = cell_facets(mesh.cells, mesh.number_of_nodes)
    pair = np.column_stack(shared_facets(keys))
    pair = pair[np.isin(keys[pair[:, 0]], facet_keys(facets, mesh.number_of_nodes))]
    return every, pair, cell_facets(cells, int(cells.max()) + 1)[1]


def _first_place(mesh: Mesh, facets: IntArray, closed: IntArray) -> tuple[str, bool]:
    """Where the first closed facet is, if there is one in a piece that is closed altogether, and whether there is."""
    count = mesh.number_of_nodes
    ends = facets[:, :1].repeat(facets.shape[1], axis=1).ravel(), facets.ravel()
    graph = sp.csr_array((np.ones(facets.size, dtype=np.int8), ends), shape=(count, count))
    _, piece = connected_components(graph, directed=False)
    of = piece[facets[:, 0]]
    stays = np.bincount(piece[closed[:, 0]], minlength=count) == np.bincount(of, minlength=count)
    whole = stays[piece[closed[:, 0]]]
    point = mesh.points[closed[int(np.argmax(whole))]].mean(axis=0)
    return f"({', '.join(f'{x:.6g}' for x in point)})", bool(whole.any())


def _opened(mesh: Mesh, name: str, facets: IntArray) -> Mesh | None:
    """None where no node is doubled."""
    cells, first = _doubled(mesh, facets)
    if len(first) == mesh.number_of_nodes:
        return None
    points = mesh.points[first]
    sides = _sides(mesh, name, cells, facets)
    boundaries = dict(zip(mesh.boundaries, _moved(mesh, cells, list(mesh.boundaries.values())), strict=True))
    others = {other: own for other, own in mesh.interfaces.items() if other != name}
    interfaces = dict(zip(others, _moved(mesh, cells, list(others.values())), strict=True))
    for label, own in sides.items():
        side = f"{name}:{label}"
        if side in boundaries:
            raise ProblemError(f"the mesh has a boundary '{side}' already; give the interface '{name}' another name")
        boundaries[side] = own
    parent = _parent(mesh, cells, len(first), name)
    if parent is not None:
        parent = parent.named(boundaries, mesh.regions, interfaces)
    reading = mesh.reading.onto(first[:, None])
    return mesh.trusted(points, cells, boundaries, mesh.regions, parent, None, interfaces, reading)


def _doubled(mesh: Mesh, facets: IntArray) -> tuple[IntArray, IntArray]:
    """Cells with nodes of their own on each side (M, d + 1), and the old node of each new one.

    The corners of cells at a node are joined through facets at it that are not open; each set of joined corners gets a
    copy of the node.  So an end within the body is not doubled; where several sides meet, each has a copy.
    """
    count, dim = mesh.number_of_nodes, mesh.dim
    every, keys, owner = cell_facets(mesh.cells, count)
    one, other = shared_facets(keys)
    inside = np.zeros(count, dtype=bool)
    inside[facets] = True
    closed = ~np.isin(keys[one], facet_keys(facets, count)) & inside[every[one]].any(axis=1)
    one, other = one[closed], other[closed]
    corner = np.arange(mesh.cells.size).reshape(mesh.cells.shape)
    nodes = every[one]  # (k, d), each a corner of both cells
    left = _corner(mesh.cells, corner, owner[one], nodes)
    right = _corner(mesh.cells, corner, owner[other], nodes)
    graph = sp.csr_array((np.ones(left.size, dtype=np.int8), (left, right)), shape=(corner.size, corner.size))
    _, label = connected_components(graph, directed=False)
    at = mesh.cells.ravel()
    here = np.flatnonzero(inside[at])
    sets, start = np.unique(label[here], return_index=True)  # each with its first corner
    node = at[here[start]]
    cell = here[start] // (dim + 1)
    by_node = np.lexsort((cell, node))
    again = np.concatenate([[False], node[by_node][1:] == node[by_node][:-1]])
    number = np.empty(len(sets), dtype=np.int64)
    number[by_node[~again]] = node[by_node[~again]]  # the side of the first cell keeps the node
    number[by_node[again]] = count + np.arange(np.count_nonzero(again))
    cells = mesh.cells.copy().ravel()
    cells[here] = number[np.searchsorted(sets, label[here])]
    return cells.reshape(mesh.cells.shape), np.concatenate([np.arange(count), node[by_node[again]]])


def _corner(cells: IntArray, corner: IntArray, owner: IntArray, nodes: IntArray) -> IntArray:
    """Corners of cells (k,) at these nodes (k, d)."""
    local = np.argmax(cells[owner][:, None, :] == nodes[:, :, None], axis=2)
    return np.take_along_axis(corner[owner], local, axis=1).ravel()


def _sides(mesh: Mesh, name: str, cells: IntArray, facets: IntArray) -> dict[str, IntArray]:
    """The facets of the two sides in new nodes, outward oriented, by what lies there."""
    every, pair, new_keys = _pairs(mesh, cells, facets)
    owner, fresh = np.repeat(np.arange(len(cells)), cells.shape[1]), cell_facets(cells, int(cells.max()) + 1)[0]
    pair = pair[new_keys[pair[:, 0]] != new_keys[pair[:, 1]]]  # the others did not open
    regions = _region(mesh, owner[pair])
    sides: dict[str, list[IntArray]] = {}
    between = (regions >= 0).all(axis=1)
    names = list(mesh.regions)
    for column in (0, 1):
        for k in np.unique(regions[between, column]):
            chosen = between & (regions[:, column] == k)
            sides.setdefault(names[k], []).append(fresh[pair[chosen, column]])
    if not between.all():
        within = pair[~between]
        number = _numbered(fresh[within], every[within], owner[within])
        if (number[:, 0] == number[:, 1]).any():
            point = mesh.points[every[within[int(np.argmax(number[:, 0] == number[:, 1])), 0]]].mean(axis=0)
            raise ProblemError(
                f"interface '{name}': both sides of its facet at ({', '.join(f'{x:.6g}' for x in point)}) are joined "
                "around another of its parts; give its curves names of their own and open one after another"
            )
        for k in np.unique(number):
            sides.setdefault(str(k + 1), []).append(fresh[within[number == k]])
    return {label: np.concatenate(parts) for label, parts in sides.items()}


def _region(mesh: Mesh, cells: IntArray) -> IntArray:
    """For pairs of cells (k, 2), the first region that holds the one and not the other; -1 where there is none."""
    result = np.full(cells.shape, -1, dtype=np.int64)
    for number, ids in reversed(list(enumerate(mesh.regions.values()))):
        inside = np.zeros(mesh.number_of_cells, dtype=bool)
        inside[ids] = True
        own = inside[cells]
        result[own & ~own[:, ::-1]] = number
    return result


def _numbered(fresh: IntArray, old: IntArray, owner: IntArray) -> IntArray:
    """Sides within one region, (k, 2): in each connected piece from 0 on, by the smallest numbers of their cells."""
    half = np.arange(owner.size).reshape(owner.shape)
    _, doubled = np.unique(np.column_stack([old.ravel(), fresh.ravel()]), axis=0, return_inverse=True)
    copies = np.unique(np.column_stack([old.ravel(), doubled.ravel()]), axis=0)[:, 0]
    several = np.bincount(copies, minlength=int(old.max()) + 1) > 1
    size = fresh.shape[-1]
    halves = np.repeat(half.ravel(), size)

    def pieces(nodes: IntArray, chosen: BoolArray, extra: IntArray | None = None) -> IntArray:
        top = int(nodes.max()) + 1
        rows, columns = halves[chosen], owner.size + nodes.ravel()[chosen]
        if extra is not None:
            rows, columns = np.concatenate([rows, extra[:, 0]]), np.concatenate([columns, extra[:, 1]])
        shape = (owner.size + top,) * 2
        graph = sp.csr_array((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=shape)
        return np.asarray(connected_components(graph, directed=False)[1][: owner.size])

    side = pieces(fresh, several[old.ravel()])
    piece = pieces(old, np.ones(old.size, dtype=bool), half)
    sides, which = np.unique(side, return_inverse=True)
    least = np.full(len(sides), np.iinfo(np.int64).max)
    np.minimum.at(least, which, owner.ravel())
    of = np.empty(len(sides), dtype=np.int64)
    of[which] = piece
    ordered = np.lexsort((least, of))
    start = np.flatnonzero(np.concatenate([[True], of[ordered][1:] != of[ordered][:-1]]))
    rank = np.empty(len(sides), dtype=np.int64)
    rank[ordered] = np.arange(len(sides)) - np.repeat(start, np.diff(start, append=len(sides)))
    return rank[which].reshape(owner.shape)


def _moved(mesh: Mesh, cells: IntArray, groups: list[IntArray]) -> list[IntArray]:
    """Facets in new nodes: those of their cell, of the first one where they lie between two."""
    if not groups:
        return []
    _, keys, _ = cell_facets(mesh.cells, mesh.number_of_nodes)
    fresh, _, _ = cell_facets(cells, int(cells.max()) + 1)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    return [fresh[order[np.searchsorted(ordered, facet_keys(facets, mesh.number_of_nodes))]] for facets in groups]


def _parent(mesh: Mesh, cells: IntArray, count: int, name: str) -> Refinement | None:
    """The coarser mesh opened as well: each copy of a node stems from the copies in the cell around it."""
    step = mesh.parent
    if step is None or name not in step.mesh.interfaces:
        return None
    coarse = _opened(step.mesh, name, step.mesh.interfaces[name])
    if coarse is None:
        return None
    holder = np.empty(count, dtype=np.int64)
    holder[cells.ravel()[::-1]] = np.repeat(np.arange(len(cells)), cells.shape[1])[::-1]
    old = np.empty(count, dtype=np.int64)
    old[cells] = mesh.cells
    above = step.cells[holder]
    local = np.argmax(step.mesh.cells[above][:, None, :] == step.ends[old][:, :, None], axis=2)
    return Refinement(coarse, frozen(np.take_along_axis(coarse.cells[above], local, axis=1)), step.cells)
