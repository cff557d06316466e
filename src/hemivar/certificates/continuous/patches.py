"""Patches of facets with the cells on their sides, coloured so that patches of one colour have no cell in common."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.continuous.facet_table import FacetTable
from hemivar.mesh.keys import EDGES, pair_keys

__all__ = [
    "Batch",
    "PatchKind",
    "cell_patches",
    "coloured",
    "facet_patches",
    "lowering",
    "patch_batches",
    "patch_sides",
    "priorities",
    "rigid_modes",
]


class PatchKind(StrEnum):
    """What the facets of a patch have in common."""

    FACET = "facet"
    """Every facet is a patch of its own."""
    EDGE = "edge"
    """An edge of a body in space; in the plane, edges are facets."""
    VERTEX = "vertex"
    """A vertex."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Patches of one colour with the same numbers of facets and cells."""

    facets: IntArray  # (k, f)
    cells: IntArray  # (k, c)
    #: Where each facet of each cell stands among the facets of the patch; f where it is none of them.
    place: IntArray  # (k, c, d + 1)

    def take(self, chosen: BoolArray | IntArray | slice) -> Batch:
        """Some of the patches."""
        return Batch(self.facets[chosen], self.cells[chosen], self.place[chosen])


def coloured(of_cells: IntArray, count: int, seed: int = 0, first: IntArray | None = None) -> IntArray:
    """Colours (count,) of patches, different for patches of one cell.

    Each colour is a largest set of patches that share no cell, found by rounds in which a patch is taken if it has the
    highest of random numbers in all its cells (M. Luby, SIAM J. Comput. 15, 1986). The same mesh has the same colours.

    ``of_cells`` is (M, q); ``first`` is (count,).
    """
    colour = np.full(count + 1, -1, dtype=np.int64)  # the last for -1
    number = priorities(count, seed, first) + 1
    cells_of = np.bincount(of_cells[of_cells >= 0], minlength=count)
    colour[:-1][cells_of == 0] = colour[-1] = 0
    current, left = 0, np.ascontiguousarray(of_cells.T)  # cells with patches that have no colour
    while left.size:
        value = np.append(np.where(colour[:-1] < 0, number, 0), 0)
        rivals = left[:, (value[left] > 0).any(axis=0)]  # cells with patches that may take this one
        while rivals.size:
            best, top = rivals[0], value[rivals[0]]
            for other in rivals[1:]:
                best = np.where(value[other] > top, other, best)
                top = value[best]
            wins = np.append(np.bincount(best, minlength=count) == cells_of, False) & (value > 0)
            colour[wins] = current
            value[rivals[:, wins[best]]] = 0
            rivals = rivals[:, (value[rivals] > 0).any(axis=0)]
        left = left[:, (colour[left] < 0).any(axis=0)]
        current += 1
    return colour[:-1]


def priorities(count: int, seed: int = 0, first: IntArray | None = None) -> IntArray:
    """Numbers from 0 on, at random and different for each; patches of higher ones are coloured before others."""
    number = np.random.default_rng(seed).permutation(count)
    if first is not None:
        number[np.lexsort((number, -first))] = np.arange(count)
    return number


def patch_batches(
    table: FacetTable,
    kind: PatchKind,
    free: BoolArray,
    patches: BoolArray | None = None,
    first: IntArray | None = None,
) -> list[Batch]:
    """The patches of a kind, of the facets that are free, shape (F,), in batches; colour after colour.

    Of all patches, or of some alone: a bool for each vertex, edge or facet. ``first`` is that of :func:`coloured`.
    """
    of_facets, of_cells = facet_patches(table, kind), cell_patches(table, kind)
    count = int(max(of_facets.max(initial=-1), of_cells.max(initial=-1))) + 1
    chosen = np.flatnonzero(free)
    width = of_facets.shape[1]
    patch, facet = of_facets[chosen].ravel(), np.repeat(chosen, width)
    if patches is not None:
        patch, facet = patch[patches[patch]], facet[patches[patch]]
    order = np.lexsort((facet, patch))
    patch, facet = patch[order], facet[order]
    facets_of = np.bincount(patch, minlength=count)
    first_facet = np.cumsum(facets_of) - facets_of

    owner = table.owners[facet]
    cells = len(table.cells)
    pairs = np.repeat(patch, 2) * cells + owner.ravel()
    pairs = np.sort(pairs[owner.ravel() >= 0])
    pairs = pairs[np.append(True, pairs[1:] != pairs[:-1])] if pairs.size else pairs
    patch_of, cell_of = np.divmod(pairs, cells)
    cells_of = np.bincount(patch_of, minlength=count)
    first_cell = np.cumsum(cells_of) - cells_of

    keys = patch * len(table.facets) + facet
    wanted = patch_of[:, None] * len(table.facets) + table.cell_facets[cell_of]
    found = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
    inside = keys[found] == wanted if len(keys) else np.zeros(wanted.shape, dtype=bool)
    place = np.where(inside, found - first_facet[patch_of][:, None], facets_of[patch_of][:, None])

    colour = coloured(np.where(facets_of[of_cells] > 0, of_cells, -1), count, first=first)
    batches = []
    live = np.flatnonzero(facets_of > 0)
    kinds, group = np.unique(np.column_stack([colour, facets_of, cells_of])[live], axis=0, return_inverse=True)
    for number, (_, f, c) in enumerate(kinds):
        of = live[group.ravel() == number]
        at = first_cell[of][:, None] + np.arange(c)
        batches.append(Batch(facet[first_facet[of][:, None] + np.arange(f)], cell_of[at], place[at]))
    return batches


def facet_patches(table: FacetTable, kind: PatchKind) -> IntArray:
    """The patches of each facet, shape (F, p)."""
    if kind is PatchKind.VERTEX:
        return table.facets
    if kind is PatchKind.FACET or table.dim == 2:
        return np.arange(len(table.facets))[:, None]
    return _edges(table, table.facets, EDGES[2])


def cell_patches(table: FacetTable, kind: PatchKind) -> IntArray:
    """The patches of each cell, shape (M, q): of vertices in their order, of edges in that of ``EDGES``."""
    if kind is PatchKind.VERTEX:
        return table.cells
    if kind is PatchKind.FACET or table.dim == 2:
        return table.cell_facets
    return _edges(table, table.cells, EDGES[3])


def patch_sides(dim: int, kind: PatchKind) -> IntArray:
    """Local facets (q, p) of a cell that are of each of its patches, in the order of :func:`cell_patches`."""
    every = range(dim + 1)
    if kind is PatchKind.FACET or (kind is PatchKind.EDGE and dim == 2):
        return np.arange(dim + 1)[:, None]
    corners = [(a,) for a in every] if kind is PatchKind.VERTEX else EDGES[3]
    return np.array([[facet for facet in every if facet not in corner] for corner in corners])


def _edges(table: FacetTable, simplices: IntArray, pairs: tuple[tuple[int, int], ...]) -> IntArray:
    """Numbers of edges of the mesh, by places of their ends in simplices."""
    count = table.mesh.number_of_nodes
    known = np.asarray(table.mesh.edges, dtype=np.int64)
    ends = np.stack([simplices[:, pair] for pair in pairs], axis=1)
    return np.asarray(np.searchsorted(known[:, 0] * count + known[:, 1], pair_keys(ends, count)))


def lowering(matrix: Array, slope: Array, change: Array) -> BoolArray:
    """Which changes x (k, n) lower ``x'H x / 2 + b'x``, for H (k, n, n) and b (k, n).

    Those of patches with cells so flat that rounding decides need not; nothing but the sharpness depends on them.
    """
    bent = (matrix @ change[:, :, None])[:, :, 0]
    return np.asarray(np.einsum("kn,kn->k", change, 0.5 * bent + slope) < 0.0)


def rigid_modes(x: Array) -> Array:
    """Rigid motions at places (..., d): (..., r, d), r = 3 or 6."""
    dim = x.shape[-1]
    turns = [(1, 0)] if dim == 2 else [(2, 1), (0, 2), (1, 0)]
    out = np.zeros((*x.shape[:-1], dim + len(turns), dim))
    for c in range(dim):
        out[..., c, c] = 1.0
    for row, (i, j) in enumerate(turns):
        out[..., dim + row, i] = x[..., j]
        out[..., dim + row, j] = -x[..., i]
    return out
