"""Patches whose cells make a ring or a row, facet after facet: around a vertex in the plane, around an edge in space.

Facets have slots: cell c lies between slots c and c + 1, in a ring the last cell between the last slot and slot 0. At
the ends of a row stand facets of the boundary, which are of the patch where they are free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.continuous.facet_table import FacetTable
from hemivar.certificates.continuous.patches import Batch, PatchKind, cell_patches, coloured, facet_patches
from hemivar.mesh.keys import EDGES, equal_rows

__all__ = ["Rings", "ring_batches"]

#: The two facets of a cell at each of its vertices in the plane, at each of its edges in space.
_SIDES = {
    2: np.array([[1, 2], [0, 2], [0, 1]]),
    3: np.array([[facet for facet in range(4) if facet not in edge] for edge in EDGES[3]]),
}


#: Rings or rows of one kind from which they are told from others: below, to look for what they share takes longer.
_MANY = 64


@dataclass(frozen=True, eq=False)
class Rings:
    """Rings of c cells, or rows, that share no cell.

    Attributes
    ----------
    facets : int array, shape (k, s)
        By slot; s = c in rings, c + 1 in rows.
    free : bool array, shape (k, s)
        Which of them are of the patch.
    cells : int array, shape (k, c)
    sides : int array, shape (k, c, 2)
        The two facets of each cell by their local numbers, in the order of the slots.
    turn : array, shape (k, s)
        Sign that takes what leaves the cell before a facet, and enters the one behind it, to what leaves the first cell
        of the facet.
    kind : int
        The same for rings and rows whose cells are congruent and of one material, slot by slot; -1 for those that are
        taken as all different.
    """

    facets: IntArray
    free: BoolArray
    cells: IntArray
    sides: IntArray
    turn: Array
    kind: int = -1

    @property
    def flows(self) -> bool:
        """Whether a force can flow through all cells: all facets are free."""
        return bool(self.free.all())

    def take(self, chosen: BoolArray | IntArray | slice) -> Rings:
        """Some of the patches."""
        return replace(
            self, facets=self.facets[chosen], free=self.free[chosen], cells=self.cells[chosen],
            sides=self.sides[chosen], turn=self.turn[chosen],
        )  # fmt: skip

    def closed(self) -> Rings:
        """Rings without the last slot, where the first facet stands again."""
        return replace(self, facets=self.facets[:, :-1], free=self.free[:, :-1], turn=self.turn[:, :-1])

    def as_batch(self, table: FacetTable) -> Batch:
        """The same as patches of any shape; all have the same number of free facets."""
        facets = np.sort(self.facets[self.free].reshape(len(self.facets), -1), axis=1)
        same = table.cell_facets[self.cells][..., None] == facets[:, None, None]
        place = np.where(same.any(axis=3), np.argmax(same, axis=3), facets.shape[1])
        return Batch(facets, self.cells, place)


def ring_batches(
    table: FacetTable,
    kind: PatchKind,
    free: BoolArray,
    whole: BoolArray,
    patches: BoolArray | None = None,
    alike: IntArray | None = None,
) -> tuple[list[Rings], BoolArray]:
    """Rings and rows, colour after colour, those of one batch alike; and those with facets that are partly free.

    Around an edge where parts of a body touch without a facet between them there is neither.

    Parameters
    ----------
    table : FacetTable
    kind : PatchKind
        Vertices in the plane, edges in space.
    free : bool array, shape (F,)
        Facets that are of patches.
    whole : bool array, shape (F,)
        Those all of whose components are free; rings and rows have no others.
    patches : bool array, shape (P,), optional
        Some of the vertices or edges alone.
    alike : int array, shape (M,), optional
        The same numbers for cells of which rings are of one kind.

    Returns
    -------
    list of Rings, bool array (P,)
    """
    of_cells, of_facets = cell_patches(table, kind), facet_patches(table, kind)
    count = int(max(of_facets.max(initial=-1), of_cells.max(initial=-1))) + 1
    facets_of = np.bincount(of_facets[free].ravel(), minlength=count)
    del of_facets
    cells_of = np.bincount(of_cells.ravel(), minlength=count)
    wanted = facets_of > 0 if patches is None else patches & (facets_of > 0)

    start, partner = _halves(table, of_cells, count)
    good, fine, around = np.zeros((3, count), dtype=bool)
    row, same, kinds = np.zeros(count, dtype=np.int64), np.full(count, -1), 0
    paths: dict[int, IntArray] = {}
    for cells in np.flatnonzero(np.bincount(cells_of[wanted])).tolist():
        chosen = np.flatnonzero(wanted & (cells_of == cells))
        path, good[chosen], around[chosen] = _walked(start[chosen], partner, cells)
        rows = _along(table, free, path)
        fine[chosen] = good[chosen] & (whole[rows.facets] | ~rows.free).all(axis=1)
        paths[cells], row[chosen] = path, np.arange(len(chosen))
        if alike is not None:
            number = _of_many(rows, alike, around[chosen])
            same[chosen] = np.where(number < 0, -1, number + kinds)
            kinds += len(chosen)
        del rows  # and what is walked along: colours take memory, too
    del partner, start

    colour = coloured(np.where(fine[of_cells], of_cells, -1), count)
    chosen = np.flatnonzero(fine)
    most_facets, most_cells = int(facets_of.max(initial=0)) + 1, int(cells_of.max(initial=0)) + 1
    shape = (facets_of * most_cells + cells_of) * 2 + around
    shape = np.where(same < 0, shape, 2 * most_facets * most_cells + same)
    shape += colour * (2 * most_facets * most_cells + kinds)
    order = chosen[np.argsort(shape[chosen], kind="stable")]
    bounds = np.flatnonzero(np.diff(shape[order])) + 1
    batches = []
    for some in np.split(order, bounds) if order.size else ():
        batch = _along(table, free, paths[int(cells_of[some[0]])][row[some]], int(same[some[0]]))
        batches.append(batch.closed() if around[some[0]] else batch)
    return batches, good & ~fine


def _halves(table: FacetTable, of_cells: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Where each of so many patches begins, and the half behind the facet that each half begins with; -1 for none.

    A half is a cell seen at one of its patches from one of its two facets there; the other is its number ^ 1.
    """
    keys = np.repeat(of_cells.ravel(), 2)
    keys *= len(table.facets)
    keys += table.cell_facets[:, _SIDES[table.dim]].ravel()
    partner = _partners(keys)
    start = np.zeros(count, dtype=np.int64)
    start[of_cells.ravel()] = 2 * np.arange(of_cells.size)
    ends = np.flatnonzero(partner < 0)
    start[of_cells.ravel()[ends // 2]] = ends
    return start, partner


def _along(table: FacetTable, free: BoolArray, path: IntArray, kind: int = -1) -> Rings:
    """Rows through the halves of cells (k, c), one after the other."""
    corner, half = np.divmod(path, 2)
    cell, local = np.divmod(corner, len(_SIDES[table.dim]))
    sides = np.stack([_SIDES[table.dim], _SIDES[table.dim][:, ::-1]], axis=1)[local, half]
    facets = table.cell_facets[cell[:, :, None], sides]
    facets = np.concatenate([facets[:, :, 0], facets[:, -1:, 1]], axis=1)
    signs = table.signs[cell[:, :, None], sides]
    turn = np.concatenate([-signs[:, :1, 0], signs[:, :, 1]], axis=1)
    return Rings(facets, free[facets], cell, sides, turn, kind)


def _of_many(rows: Rings, alike: IntArray, around: BoolArray) -> IntArray:
    """Numbers of rows, the same for those of one kind; -1 for those of which there are few.

    Their cells are of the same kinds, passed by the same sides; the same facets are free; they are rings, or are not.
    """
    sides = rows.sides.max(initial=0) + 1
    seen = (alike[rows.cells] * sides + rows.sides[:, :, 0]) * sides + rows.sides[:, :, 1]
    number = equal_rows(np.concatenate([seen, 2 * rows.free + around[:, None]], axis=1))
    return np.where(np.bincount(number, minlength=1)[number] < _MANY, -1, number)


def _partners(keys: IntArray) -> IntArray:
    """For each key the place of the other one that equals it, -1 where there is none; none is there three times."""
    out = np.full(len(keys), -1)
    shift = len(keys).bit_length()
    if int(keys.max(initial=0)).bit_length() + shift < 64:  # sorted together with their places, which is much faster
        keys = keys << shift
        keys += np.arange(len(keys))
        keys.sort()
        first = np.flatnonzero((keys[1:] >> shift) == (keys[:-1] >> shift))
        one, two = (keys[at] & ((1 << shift) - 1) for at in (first, first + 1))
    else:
        order = np.argsort(keys)
        first = np.flatnonzero(np.diff(keys[order]) == 0)
        one, two = order[first], order[first + 1]
    out[one], out[two] = two, one
    return out


def _walked(start: IntArray, partner: IntArray, cells: int) -> tuple[IntArray, BoolArray, BoolArray]:
    """Halves (k, c) from cell to cell; which patches are rings or rows of c cells, and which of them rings."""
    path = np.empty((len(start), cells), dtype=np.int64)
    good = np.ones(len(start), dtype=bool)
    now = start
    for c in range(cells):
        path[:, c] = now
        following = partner[now ^ 1]
        if c < cells - 1:
            good &= (following >= 0) & (following != start)
            now = np.where(good, following, now)
    ring = good & (following == start)
    return path, good & (ring | ((following < 0) & (partner[start] < 0))), ring
