"""Patches whose cells make a ring or a row, facet after facet: around a vertex in the plane, around an edge in space.

Facets have slots: cell c lies between slots c and c + 1, in a ring the last cell between the last slot and slot 0. At
the ends of a row stand facets of the boundary, which are of the patch where they are free.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.adapt.patches import Batch, PatchKind, cell_patches, coloured, facet_patches
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.facet_table import FacetTable
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
    cells_of = np.bincount(of_cells.ravel(), minlength=count)
    wanted = facets_of > 0 if patches is None else patches & (facets_of > 0)

    # A half is a cell seen at one of its patches from one of its two facets there; the other is its number ^ 1.
    facet = table.cell_facets[:, _SIDES[table.dim]].ravel()
    partner = _partners(np.repeat(of_cells.ravel(), 2) * len(table.facets) + facet)
    start = np.zeros(count, dtype=np.int64)
    start[of_cells.ravel()] = 2 * np.arange(of_cells.size)
    ends = np.flatnonzero(partner < 0)
    start[of_cells.ravel()[ends // 2]] = ends

    good, fine, around = np.zeros((3, count), dtype=bool)
    row, same, kinds = np.zeros(count, dtype=np.int64), np.full(count, -1), 0
    rows: dict[int, Rings] = {}
    for cells in np.flatnonzero(np.bincount(cells_of[wanted])).tolist():
        chosen = np.flatnonzero(wanted & (cells_of == cells))
        path, good[chosen], around[chosen] = _walked(start[chosen], partner, cells)
        slots = np.concatenate([facet[path], facet[path[:, -1:] ^ 1]], axis=1)
        mine = free[slots]
        fine[chosen], row[chosen] = good[chosen] & (whole[slots] | ~mine).all(axis=1), np.arange(len(chosen))
        corner, half = np.divmod(path, 2)
        cell, local = np.divmod(corner, of_cells.shape[1])
        sides = _SIDES[table.dim][local]
        sides = np.where(half[..., None], sides[..., ::-1], sides)
        signs = np.take_along_axis(table.signs[cell], sides, axis=2)
        turn = np.concatenate([-signs[:, :1, 0], signs[:, :, 1]], axis=1)
        rows[cells] = Rings(slots, mine, cell, sides, turn)
        if alike is not None:
            seen = (alike[cell] * (table.dim + 1) + sides[:, :, 0]) * (table.dim + 1) + sides[:, :, 1]
            number = _of_many(np.concatenate([seen, 2 * mine + around[chosen, None]], axis=1))
            same[chosen] = np.where(number < 0, -1, number + kinds)
            kinds += len(chosen)

    colour = coloured(np.where(fine[of_cells], of_cells, -1), count)
    chosen = np.flatnonzero(fine)
    most_facets, most_cells = int(facets_of.max(initial=0)) + 1, int(cells_of.max(initial=0)) + 1
    shape = (facets_of * most_cells + cells_of) * 2 + around
    shape = np.where(same < 0, shape, 2 * most_facets * most_cells + same)
    shape += colour * (2 * most_facets * most_cells + kinds)
    order = chosen[np.argsort(shape[chosen], kind="stable")]
    bounds = np.flatnonzero(np.diff(shape[order])) + 1
    batches = []
    for alike in np.split(order, bounds) if order.size else ():
        batch = replace(rows[int(cells_of[alike[0]])].take(row[alike]), kind=int(same[alike[0]]))
        batches.append(batch.closed() if around[alike[0]] else batch)
    return batches, good & ~fine


def _of_many(rows: IntArray) -> IntArray:
    """Numbers of rows (n, q), the same for equal ones; -1 for those of which there are few."""
    number = equal_rows(rows)
    return np.where(np.bincount(number, minlength=1)[number] < _MANY, -1, number)


def _partners(keys: IntArray) -> IntArray:
    """For each key the place of the other one that equals it, -1 where there is none; none is there three times."""
    order = np.argsort(keys)
    first = np.flatnonzero(keys[order[1:]] == keys[order[:-1]])
    out = np.full(len(keys), -1)
    out[order[first]], out[order[first + 1]] = order[first + 1], order[first]
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
