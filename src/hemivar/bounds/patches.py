"""Patches of facets with the cells on their sides, coloured so that patches of one colour have no cell in common.

Tractions of patches change so that every cell stays in equilibrium. A facet with vertices x_a has moments without force
and without moment about any point, its own fields. All others carry a force and a moment from the cell on one side to
that on the other. In equilibrium they flow round circuits of the graph whose nodes are the cells of the patch, and what
is outside of the body, and whose edges are the facets: one circuit around a vertex in the plane or an edge in space,
none through a single facet. Facets of rollers take up forces along some directions only: their fields are found
numerically, and are few.

On a facet with vertices x_a the moments ``m_k = x_l - x_k = -m_l`` along each of its edges have neither force nor
moment: one field on an edge, three on a triangle. With ``m_a = rho(x_a)``, rho a rigid motion, they make all moments of
a facet, and any force and moment is that of one rho. Quadratic tractions of an edge have two more such fields: equal
moments at its ends, along the edge or across, and twice the opposite one at its midpoint.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.facet_table import FacetTable
from hemivar.mesh.keys import EDGES

__all__ = [
    "FACET_EDGES",
    "Batch",
    "PatchFields",
    "PatchKind",
    "across_fields",
    "cell_patches",
    "coloured",
    "edge_fields",
    "facet_patches",
    "flow_fields",
    "lowering",
    "patch_batches",
    "patch_fields",
    "patch_sides",
    "priorities",
    "rigid_modes",
    "with_resultants",
]

#: The edges of a facet by its vertices, in the plane and in space.
FACET_EDGES = {2: ((0, 1),), 3: EDGES[2]}
#: Part of the largest work on free facets below which a rigid motion does none.
_FREE = 1e-10


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
    local: IntArray  # (k, c, d + 1)

    def take(self, chosen: BoolArray | IntArray | slice) -> Batch:
        """Some of the patches."""
        return Batch(self.facets[chosen], self.cells[chosen], self.local[chosen])


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
    position = np.minimum(np.searchsorted(keys, wanted), max(len(keys) - 1, 0))
    inside = keys[position] == wanted if len(keys) else np.zeros(wanted.shape, dtype=bool)
    local = np.where(inside, position - first_facet[patch_of][:, None], facets_of[patch_of][:, None])

    colour = coloured(np.where(facets_of[of_cells] > 0, of_cells, -1), count, first=first)
    batches = []
    live = np.flatnonzero(facets_of > 0)
    kinds, group = np.unique(np.column_stack([colour, facets_of, cells_of])[live], axis=0, return_inverse=True)
    for number, (_, f, c) in enumerate(kinds):
        of = live[group.ravel() == number]
        at = first_cell[of][:, None] + np.arange(c)
        batches.append(Batch(facet[first_facet[of][:, None] + np.arange(f)], cell_of[at], local[at]))
    return batches


def facet_patches(table: FacetTable, kind: PatchKind) -> IntArray:
    """The patches of each facet, shape (F, p)."""
    if kind is PatchKind.VERTEX:
        return table.places[table.facets]
    if kind is PatchKind.FACET or table.dim == 2:
        return np.arange(len(table.facets))[:, None]
    return table.edge_numbers(table.facets, EDGES[2])


def cell_patches(table: FacetTable, kind: PatchKind) -> IntArray:
    """The patches of each cell, shape (M, q): of vertices in their order, of edges in that of ``EDGES``."""
    if kind is PatchKind.VERTEX:
        return table.places[table.cells]
    if kind is PatchKind.FACET or table.dim == 2:
        return table.cell_facets
    return table.cell_edges


def patch_sides(dim: int, kind: PatchKind) -> IntArray:
    """Local facets (q, p) of a cell that are of each of its patches, in the order of :func:`cell_patches`."""
    every = range(dim + 1)
    if kind is PatchKind.FACET or (kind is PatchKind.EDGE and dim == 2):
        return np.arange(dim + 1)[:, None]
    corners = [(a,) for a in every] if kind is PatchKind.VERTEX else EDGES[3]
    return np.array([[facet for facet in every if facet not in corner] for corner in corners])


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


def edge_fields(nodes: Array) -> Array:
    """Moments (k, e, l, d) along the edges of facets with these nodes (k, l, d): without force and moment."""
    pairs = FACET_EDGES[nodes.shape[2]]
    fields = np.zeros((len(nodes), len(pairs), *nodes.shape[1:]))
    for number, (i, j) in enumerate(pairs):
        along = nodes[:, j] - nodes[:, i]
        fields[:, number, i], fields[:, number, j] = along, -along
    return fields


def across_fields(nodes: Array) -> Array:
    """The other moments (k, s, l, d) without force and moment, s = 0 or 2, of facets with these nodes (k, l, d)."""
    count, dim = nodes.shape[1:]
    if count == dim:
        return np.empty((len(nodes), 0, count, dim))
    along = nodes[:, 1] - nodes[:, 0]
    ways = np.stack([along, np.stack([-along[:, 1], along[:, 0]], axis=1)], axis=1)
    return np.asarray(ways[:, :, None] * np.array([0.5, 0.5, -1.0])[:, None])


def with_resultants(nodes: Array, force: Array, couple: Array) -> Array:
    """Moments (k, l, d) of facets with these nodes (k, l, d) that have a force (k, d), and a moment (k, r) about 0.

    They are forces that are the same at all nodes, and a moment without force. On a triangle with sides a and b from
    vertex 0, and ``n = a x b``, the latter is w for ``m_1 = (w.n b / 2 - w.b n) / n.n`` and ``m_2 = (w.a n - w.n a / 2)
    / n.n``. There are others; but for self-balanced fields they are the same.
    """
    middle = nodes.mean(axis=1)
    left = couple - (rigid_modes(middle)[:, nodes.shape[2] :] @ force[:, :, None])[:, :, 0]
    return np.asarray(force[:, None] / nodes.shape[1] + _turning(nodes, left[:, None])[:, 0])


def flow_fields(nodes: Array) -> Array:
    """Moments (k, d + r, l, d) of facets with these nodes (k, l, d): each a unit force, or a unit moment about 0.

    Those of :func:`with_resultants`.
    """
    count, places, dim = nodes.shape
    modes = dim * (dim + 1) // 2
    turns = np.broadcast_to(np.eye(modes - dim), (count, modes - dim, modes - dim))
    flat = _turning(nodes, turns).reshape(count, modes - dim, -1)
    fields = np.empty((count, modes, places * dim))
    fields[:, :dim] = np.tile(np.eye(dim), places) / places
    fields[:, :dim] -= rigid_modes(nodes.mean(axis=1))[:, dim:].transpose(0, 2, 1) @ flat
    fields[:, dim:] = flat
    return fields.reshape(count, modes, places, dim)


def _turning(nodes: Array, couple: Array) -> Array:
    """Moments (k, q, l, d) without force that have these moments (k, q, r)."""
    dim = nodes.shape[2]
    if dim == 2:
        turns = rigid_modes(nodes - nodes.mean(axis=1, keepdims=True))[:, :, 2]
        turns /= np.sum(turns * turns, axis=(1, 2))[:, None, None]
        return np.asarray(couple[:, :, :, None] * turns[:, None])
    a, b = nodes[:, 1] - nodes[:, 0], nodes[:, 2] - nodes[:, 0]
    n = np.stack([a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
    unit = n / np.sum(n * n, axis=1, keepdims=True)
    turn, along, across = np.moveaxis(couple @ np.stack([0.5 * unit, a, b], axis=2), 2, 0)[..., None]
    out = np.empty((*couple.shape[:2], dim, dim))
    out[:, :, 1] = turn * b[:, None] - across * unit[:, None]
    out[:, :, 2] = along * unit[:, None] - turn * a[:, None]
    out[:, :, 0] = -out[:, :, 1] - out[:, :, 2]
    return out


@dataclass(frozen=True, eq=False)
class PatchFields:
    """Fields of k patches with f facets each, q for each patch: those of the facets, of the circuits, of rollers.

    Where a patch has fewer than others the rest vanish.
    """

    #: Places of the nodes of the facets about the middle of the patch.
    nodes: Array  # (k, f, l, d)
    #: Facets all of whose components are free.
    whole: BoolArray  # (k, f)
    #: 1 where a circuit leaves the first cell of a facet through it, -1 where it enters that cell, else 0.
    circuits: Array  # (k, w, f)
    #: Moments of the fields with rollers.
    partly: Array  # (k, r, f, l, d)

    def take(self, chosen: IntArray) -> PatchFields:
        """Of some patches."""
        return PatchFields(self.nodes[chosen], self.whole[chosen], self.circuits[chosen], self.partly[chosen])

    def matrix(self) -> Array:
        """Moments (k, f, l, d, q)."""
        count, facets, places, dim = self.nodes.shape
        flat = self.nodes.reshape(-1, places, dim)
        own = np.concatenate([edge_fields(flat), across_fields(flat)], axis=1)
        own = own.reshape(count, facets, -1, places, dim) * self.whole[:, :, None, None, None]
        number, width, modes = own.shape[2], self.circuits.shape[1], dim * (dim + 1) // 2
        out = np.zeros((count, facets, places, dim, facets * number + width * modes + self.partly.shape[1]))
        for j in range(facets):
            out[:, j, :, :, j * number : (j + 1) * number] = np.moveaxis(own[:, j], 1, 3)
        if width:
            flow = np.moveaxis(self._flows().reshape(count, facets, modes, places, dim), 2, 4)
            signs = self.circuits.transpose(0, 2, 1)[:, :, None, None, :, None]
            both = (flow[:, :, :, :, None] * signs).reshape(count, facets, places, dim, -1)
            out[..., facets * number : facets * number + width * modes] = both
        out[..., facets * number + width * modes :] = np.moveaxis(self.partly, 1, 4)
        return out

    def moments(self, numbers: Array) -> Array:
        """Moments (k, f, l, d) of so much of each field, (k, q)."""
        count, facets, places, dim = self.nodes.shape
        pairs, flat = FACET_EDGES[dim], self.nodes.reshape(-1, places, dim)
        across = across_fields(flat)
        number = len(pairs) + across.shape[1]
        own = (numbers[:, : facets * number].reshape(count, facets, number) * self.whole[:, :, None]).reshape(
            -1, number
        )
        out = np.zeros(flat.shape)
        for column, (i, j) in enumerate(pairs):
            couple = own[:, column, None] * (flat[:, j] - flat[:, i])
            out[:, i] += couple
            out[:, j] -= couple
        if number > len(pairs):
            out = np.asarray(out + np.einsum("kn,knad->kad", own[:, len(pairs) :], across))
        width, modes = self.circuits.shape[1], dim * (dim + 1) // 2
        if width:
            flow = numbers[:, facets * number : facets * number + width * modes].reshape(count, width, modes)
            through = (self.circuits.transpose(0, 2, 1) @ (flow * self._sizes[:, None])).reshape(-1, modes)
            out += with_resultants(flat, through[:, :dim], through[:, dim:])
        moved = out.reshape(self.nodes.shape)
        if self.partly.shape[1]:
            moved = moved + np.einsum("kr,krfad->kfad", numbers[:, -self.partly.shape[1] :], self.partly)
        return np.asarray(moved)

    @property
    def _sizes(self) -> Array:
        """Forces and moments (k, d + m) of a unit of flow, for fields as large as the patch."""
        dim = self.nodes.shape[3]
        reach = np.abs(self.nodes).max(axis=(1, 2, 3))
        powers = np.where(np.arange(dim * (dim + 1) // 2) < dim, 1.0, 2.0)
        return np.asarray(reach[:, None] ** powers)

    def _flows(self) -> Array:
        """Moments (k, f, modes, l d) of flows through facets."""
        count, facets, places, dim = self.nodes.shape
        flows = flow_fields(self.nodes.reshape(-1, places, dim)).reshape(count, facets, -1, places * dim)
        return np.asarray(flows * self._sizes[:, None, :, None])


def patch_fields(places: Array, ends: IntArray, whole: BoolArray, cells: int, freed: Array) -> PatchFields:
    """All fields of patches.

    ``places`` is (k, f, l, d); ``ends`` is (k, f, 2); ``whole`` is (k, f); ``freed`` is (k, f, d, d).
    """
    count, facets, at, dim = places.shape
    nodes = places - places.mean(axis=(1, 2))[:, None, None]
    circuits, path, label = _circuits(ends, whole, cells)
    fields = PatchFields(nodes, whole, circuits, np.zeros((count, 0, facets, at, dim)))
    if whole.all():
        return fields
    return PatchFields(nodes, whole, circuits, _partly(fields, ends, path, label, freed))


def _circuits(ends: IntArray, usable: BoolArray, cells: int) -> tuple[Array, Array, IntArray]:
    """Independent circuits (k, w, f), and for each cell and the outside (k, c + 1, f) a path to the root of its tree.

    Paths and circuits are facets with the sign of the way in which they are passed. Trees have numbers (k, c + 1).
    """
    count, facets = usable.shape
    every = np.arange(count)
    label = np.tile(np.arange(cells + 1), (count, 1))
    path, steps = np.zeros((count, cells + 1, facets)), np.zeros((count, facets, facets))
    closed = np.zeros((count, facets), dtype=bool)
    for j in range(facets):
        one, two = ends[:, j].T
        first, second = label[every, one], label[every, two]
        step = path[every, two] - path[every, one]  # from two to the roots, and back to one
        step[:, j] += 1.0
        closed[:, j] = usable[:, j] & (first == second)
        steps[:, j] = step
        joins = usable[:, j] & (first != second)
        moved = (label == second[:, None]) & joins[:, None]
        path -= moved[:, :, None] * step[:, None]
        label = np.where(moved, first[:, None], label)
    width = int(closed.sum(axis=1).max(initial=0))
    order = np.argsort(~closed, axis=1, kind="stable")[:, :width]
    circuits = np.take_along_axis(steps * closed[:, :, None], order[:, :, None], axis=1)
    return circuits, path, label


def _partly(fields: PatchFields, ends: IntArray, path: Array, label: IntArray, freed: Array) -> Array:
    """Fields (k, r, f, l, d) that have moments on facets of the boundary not all of whose components are free.

    Each such moment has a resultant, which flows on through the cells: outside where a facet lets it, else against
    those of others, which is a condition on all of them.
    """
    count, facets, places, dim = fields.nodes.shape
    modes, cells = dim * (dim + 1) // 2, path.shape[1] - 1
    shut = ~fields.whole
    slots = int(shut.sum(axis=1).max())
    facet = np.argsort(~shut, axis=1, kind="stable")[:, :slots]
    there = np.take_along_axis(shut, facet, axis=1)
    every = np.arange(count)[:, None]
    size, axes = np.linalg.eigh(freed[every, facet])
    axes = axes.transpose(0, 1, 3, 2) * (there[:, :, None] & (size > 0.5))[..., None]  # one way after the other
    moments = np.zeros((count, slots, places, dim, facets, places, dim))
    for slot in range(slots):
        for a in range(places):
            moments[every[:, 0], slot, a, :, facet[:, slot], a] = axes[:, slot]
    reach = np.abs(fields.nodes).max(axis=(1, 2, 3))
    rigid = rigid_modes(fields.nodes[every, facet] / reach[:, None, None, None])  # (k, s, l, modes, d)
    resultants = np.einsum("ksamd,ksid->ksaim", rigid, axes).reshape(count, slots, -1, modes)

    root = label[every, ends[every, facet, 0]]
    outside = label[:, -1:]
    route = path[every, ends[every, facet, 0]]
    route = route - (root == outside)[:, :, None] * path[:, -1:]  # on from the root
    carried = resultants * np.where(np.arange(modes) < dim, 1.0, reach[:, None, None, None])
    through = flow_fields(fields.nodes.reshape(-1, places, dim)).reshape(count, facets, modes, places, dim)
    moments = moments.reshape(count, slots, places * dim, facets, places, dim)
    moments -= np.einsum("ksf,ksnm,kfmad->ksnfad", route, carried, through, optimize=True)

    width = slots * places * dim
    tree = (root[:, :, None] == np.arange(cells + 1)) & (root[:, :, None] != outside[:, :, None])
    conditions = np.einsum("kst,ksnm->ktmsn", tree.astype(float), resultants).reshape(count, -1, width)
    idle = np.repeat(~np.asarray(axes.any(axis=3)), places, axis=1).reshape(count, width)
    conditions = np.concatenate([conditions, idle[:, :, None] * np.eye(width)], axis=1)
    _, size, ways = np.linalg.svd(conditions)
    kept = np.ones((count, width), dtype=bool)
    kept[:, : size.shape[1]] = size <= _FREE
    ways = ways * kept[:, :, None]
    return np.asarray(np.einsum("krn,knfad->krfad", ways, moments.reshape(count, width, facets, places, dim)))
