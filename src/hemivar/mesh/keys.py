"""Topology of simplices by integer keys: facets, edges and their numbers; signed volumes."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from hemivar.basics.arrays import CACHED
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import ProblemError

__all__ = [
    "EDGES",
    "FACETS",
    "PORTION",
    "cell_facets",
    "cell_parts",
    "distinct_pairs",
    "equal_rows",
    "facet_keys",
    "facet_measures",
    "frozen",
    "pair_keys",
    "shared_facets",
    "signed_volumes",
    "sorted_keys",
]

#: Local nodes of the edges and, outward oriented, of the facets of a cell, by dimension.
EDGES = {2: ((0, 1), (1, 2), (0, 2)), 3: ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))}
FACETS = {2: ((0, 1), (1, 2), (2, 0)), 3: ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1))}
_T = TypeVar("_T", bound=np.generic)
#: Entries, cells or points taken at a time: half a MiB for each column of numbers.
PORTION = CACHED // 4


def frozen(array: NDArray[_T]) -> NDArray[_T]:
    """A read-only view of an array."""
    view = array.view()
    view.flags.writeable = False
    return view


def pair_keys(pairs: IntArray, count: int) -> IntArray:
    """One number per pair of node numbers (last axis), whatever the order in the pair."""
    return np.asarray(np.minimum(pairs[..., 0], pairs[..., 1]) * count + np.maximum(pairs[..., 0], pairs[..., 1]))


def equal_rows(rows: IntArray) -> IntArray:
    """Numbers (n,) of rows (n, q) of integers: equal ones have the same, others another."""
    # sorted by one number each, and looked at once more: others with that number would have a number of their own
    mixed = rows.astype(np.uint64) @ np.random.default_rng(0).integers(1 << 63, size=rows.shape[1], dtype=np.uint64)
    _, first, number = np.unique(mixed, return_index=True, return_inverse=True)
    other = np.flatnonzero((rows != rows[first[number]]).any(axis=1))
    number[other] = len(first) + np.arange(len(other))
    return np.asarray(number)


def distinct_pairs(first: AnyArray, second: AnyArray) -> tuple[IntArray, IntArray]:
    """Distinct unordered pairs (E, 2), smaller number first, sorted; and the number of the pair of each entry.

    Pair and place of each entry are sorted together as one integer where they fit into 64 bits, which is several times
    faster than sorting an index.  The rest goes by portions: most of its time would go into fresh memory.
    """
    portions = [slice(start, min(start + PORTION, len(first))) for start in range(0, len(first), PORTION)]
    lows = (np.minimum(first[part], second[part]).astype(np.int64) for part in portions)
    spans = (np.abs(first[part] - second[part]).astype(np.int64) for part in portions)
    tops = [max(int(values.max()) for values in lows), max(int(values.max()) for values in spans), len(first)]
    _, width, shift = (top.bit_length() for top in tops)
    number = np.empty(len(first), dtype=np.int64)
    if sum(top.bit_length() for top in tops) > 64:
        keys = (np.minimum(first, second).astype(np.int64) << width) | np.abs(first - second)
        distinct, number[:] = np.unique(keys, return_inverse=True)
    else:
        packed = np.empty(len(first), dtype=np.uint64)
        for part in portions:
            key = (np.minimum(first[part], second[part]).astype(np.uint64) << np.uint64(width)) | np.abs(
                first[part] - second[part]
            ).astype(np.uint64)
            packed[part] = (key << np.uint64(shift)) | np.arange(part.start, part.stop, dtype=np.uint64)
        packed.sort()
        pieces, seen, before = [], -1, np.uint64(0)
        for part in portions:
            key = packed[part] >> np.uint64(shift)
            new = np.concatenate([[seen < 0 or key[0] != before], key[1:] != key[:-1]])
            pair = packed[part] & np.uint64((1 << shift) - 1)
            number[pair.astype(np.int64)] = seen + np.cumsum(new)
            pieces.append(key[new])
            seen, before = seen + int(np.count_nonzero(new)), key[-1]
        distinct = np.concatenate(pieces).astype(np.int64)
    start = distinct >> width
    return np.column_stack([start, start + (distinct & ((1 << width) - 1))]), number


def facet_keys(facets: IntArray, count: int) -> IntArray:
    """One number per facet, whatever the order of its nodes."""
    return pair_keys(facets, count) if facets.shape[1] == 2 else sorted_keys(np.sort(facets, axis=1), count)


def sorted_keys(facets: IntArray, count: int) -> IntArray:
    """The same of facets whose nodes rise."""
    if facets.shape[1] == 2:
        return np.asarray(facets[:, 0] * count + facets[:, 1])
    if count > 2_000_000:
        raise ProblemError(f"the mesh has {count} nodes; boundaries are found on up to two million: take fewer")
    low, middle, high = facets.T
    return np.asarray((low * count + middle) * count + high)


def facet_measures(corner: Array) -> Array:
    """Lengths or areas (k,) of facets with these corners, (k, d, d)."""
    first = corner[:, 1] - corner[:, 0]
    if corner.shape[2] == 2:
        return np.asarray(np.linalg.norm(first, axis=1))
    return np.asarray(0.5 * np.linalg.norm(np.cross(first, corner[:, 2] - corner[:, 0]), axis=1))


def cell_facets(cells: IntArray, count: int) -> tuple[IntArray, IntArray, IntArray]:
    """All facets (M (d + 1), d) of the cells (M, d + 1) of a mesh of ``count`` nodes, their keys, and their cells."""
    dim = cells.shape[1] - 1
    facets = np.stack([cells[:, local] for local in FACETS[dim]], axis=1).reshape(-1, dim)
    return facets, facet_keys(facets, count), np.repeat(np.arange(len(cells)), dim + 1)


def shared_facets(keys: IntArray) -> tuple[IntArray, IntArray]:
    """Rows (k,) and (k,) of the facets that two cells share, among all facets with these keys, in rising order of keys.

    The first of two belongs to the cell with the smaller number.
    """
    order = np.argsort(keys, kind="stable")
    same = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    return order[same], order[same + 1]


def signed_volumes(points: Array, cells: IntArray) -> Array:
    """Areas or volumes of cells (M, d + 1), negative where a cell is inverted, (M,)."""
    volumes = np.empty(len(cells))
    for start in range(0, len(cells), PORTION):
        part = slice(start, start + PORTION)
        first, *others = cells[part].T
        side = [[x[other] - x[first] for x in points.T] for other in others]
        if len(side) == 2:
            volumes[part] = 0.5 * (side[0][0] * side[1][1] - side[0][1] * side[1][0])
        else:
            (a, b, c), (d, e, f), (g, h, i) = side
            volumes[part] = (a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)) / 6.0
    return volumes


def cell_parts(cells: IntArray, nodes: int) -> tuple[int, IntArray]:
    """The number of parts, and the part of each cell (M, d + 1) of a mesh of so many nodes."""
    _, keys, cell = cell_facets(cells, nodes)
    first, second = shared_facets(keys)
    shape = (len(cells), len(cells))
    graph = sp.csr_array((np.ones(len(first), dtype=np.int8), (cell[first], cell[second])), shape=shape)
    count, label = connected_components(graph, directed=False)
    return int(count), label.astype(np.int64)
