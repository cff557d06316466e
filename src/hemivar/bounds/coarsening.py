"""A mesh of few well shaped cells of a body, or of nearly all of it, made from a mesh of many or of thin ones.

Nodes move onto neighbours, one after another, and cells between both vanish.  Of the cells at a node those that are
left must have positive volumes; then they fill what they filled before, but for the simplices between the node and the
new facets of the surface, which have volumes of their own.  These vanish on labelled facets, where supports hold the
body or it touches, and between materials.  Elsewhere they may be cut off, never added: the cells that are left are a
part of the body.  That makes trace constants smaller, as its energy is an integral over less.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.facet_table import facet_table
from hemivar.mesh.keys import EDGES, signed_volumes
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.smooth_chains import STRAIGHT

__all__ = ["LOSS", "Coarse", "coarsened", "shapes"]

#: Part of the volume of the cells at a node that may be cut off.
LOSS = 0.02
#: Shapes of cells, 1 for regular ones, that nodes may leave behind where they were better: at first, and the last.
_SHAPES = {2: (0.75, 0.05), 3: (0.4, 0.1)}
#: Shape of a cell that has no volume.
_FLAT = 1e-4
#: Factor between one and the next.
_LESS = 0.8
#: Edges up to which all of them are tried in a round.
_FEW = 6000
#: Rounds of choosing nodes that share no cell.
_CHOICES = 5
#: Part of the cells that must go in a round for another one.
_PROGRESS = 0.02
#: Up to so many cells share an edge on average, and tell of it from both ends.
_REPEATED = 10
#: Digits of the logarithm of a length, to the base 2, that tell it from another one; what is added before these are
#: rounded, so that no simple ratio of lengths lies where rounding turns.
_DIGITS, _OFF = 6, 0.2357e-6


@dataclass(frozen=True, eq=False)
class Coarse:
    """What is left: cells (M, d + 1) of nodes with their old numbers, facets (k, d) with their labels, the loss."""

    points: Array
    cells: IntArray
    groups: IntArray
    facets: IntArray
    labels: IntArray
    #: Volume that was cut off.
    loss: float


def coarsened(
    mesh: Mesh,
    labels: IntArray,
    groups: IntArray,
    target: int,
    loss: float = LOSS,
    seed: int = 0,
    least: float = 0.0,
) -> Coarse:
    """Nodes are taken out until about so many cells are left, or no more can go.

    Those that leave cells of good shape, or no worse ones, go even then.  Those at short edges go first; with a seed
    that is not zero lengths count by up to twice what they are.

    Shapes: ``labels`` (F,), ``groups`` (M,).
    """
    table = facet_table(mesh)
    inner = table.interior
    between = np.zeros(len(inner), dtype=bool)
    between[inner] = groups[table.owners[inner, 0]] != groups[table.owners[inner, 1]]
    kept = ~inner | between
    facets, label = table.facets[kept], np.where(between, -1, labels)[kept]
    outward = _outward(mesh.points, facets, table.area_normals[kept])
    creases, dims = _strata(mesh.points, facets, label, table.area_normals[kept])
    dims[np.unique(mesh.cells)[_pinched(table.cells, table.owners[inner], table.facets[inner])]] = 0
    state = _State(mesh.points, np.asarray(mesh.cells), groups, outward, label, creases, dims, 0.0, loss, seed > 0)
    random = np.random.default_rng(seed)
    shape, last = _SHAPES[mesh.dim]
    while shape >= max(last, least):
        before = state.count
        state = state.smaller(random, target, shape)
        if before - state.count <= _PROGRESS * before:
            if state.count <= target:
                break
            shape *= _LESS
    return Coarse(state.points, state.cells, state.groups, state.facets, state.labels, state.loss)


def _outward(points: Array, facets: IntArray, normals: Array) -> IntArray:
    """Facets with their nodes in the order that makes their normals these."""
    sides = points[facets[:, 1:]] - points[facets[:, :1]]
    own = (
        np.stack([sides[:, 0, 1], -sides[:, 0, 0]], axis=1) if facets.shape[1] == 2 else np.cross(*sides.swapaxes(0, 1))
    )
    turned = np.einsum("fi,fi->f", own, normals) < 0.0
    out = facets.copy()
    out[turned, :2] = facets[turned, 1::-1]
    return out


def _strata(points: Array, facets: IntArray, labels: IntArray, normals: Array) -> tuple[IntArray, IntArray]:
    """Edges (c, 2) where faces end, in space, and how many dimensions nodes (N,) may move in."""
    dim, count = points.shape[1], len(points)
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    sides = np.concatenate([np.delete(facets, i, axis=1) for i in range(dim)])
    owner = np.tile(np.arange(len(facets)), dim)
    sides.sort(axis=1)
    every, number, counts = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    number = number.ravel()
    order = np.argsort(number, kind="stable")
    start = np.concatenate([[0], np.cumsum(counts)[:-1]])
    one, other = owner[order[start]], owner[order[np.minimum(start + 1, len(order) - 1)]]
    bent = np.linalg.norm(unit[one] - unit[other], axis=1)
    if (labels == -1).any():  # between materials normals have no side
        bent = np.where(labels[one] == -1, np.minimum(bent, np.linalg.norm(unit[one] + unit[other], axis=1)), bent)
    crease = (counts != 2) | (labels[one] != labels[other]) | ((labels[one] != 0) & (bent > STRAIGHT))
    dims = np.full(count, dim)
    dims[facets] = dim - 1
    if dim == 2:
        dims[every[crease]] = 0
        return np.zeros((0, 2), dtype=np.int64), dims
    lines = every[crease]
    dims[lines] = 0
    node = np.concatenate([lines[:, 0], lines[:, 1]])
    along = points[lines[:, 1]] - points[lines[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    leaving = np.concatenate([along, -along])
    total = np.stack([np.bincount(node, leaving[:, i], count) for i in range(3)], axis=1)
    straight = (np.bincount(node, minlength=count) == 2) & (np.linalg.norm(total, axis=1) <= STRAIGHT)
    dims[straight] = 1
    return lines, dims


def _pinched(cells: IntArray, owners: IntArray, facets: IntArray) -> BoolArray:
    """Whether the cells at a node hang together there at the node, or at edges, only; nodes in ascending order."""
    k = cells.shape[1]
    pairs = [
        np.concatenate(
            [owners[:, i] * k + np.argmax(cells[owners[:, i]] == node[:, None], axis=1) for node in facets.T]
        )
        for i in range(2)
    ]
    size = cells.size
    graph = sp.coo_array((np.ones(len(pairs[0]), dtype=np.int8), tuple(pairs)), shape=(size, size))
    part = sp.csgraph.connected_components(graph, directed=False)[1]
    nodes = np.unique(np.column_stack([cells.ravel(), part]), axis=0)[:, 0]
    return np.asarray(np.unique(nodes, return_counts=True)[1] > 1)


def shapes(points: Array, cells: IntArray) -> tuple[Array, Array]:
    """Volumes and shapes (n,), 1 for regular simplices and negative for inverted ones."""
    dim = points.shape[1]
    volume, squares = signed_volumes(points, cells), np.zeros(len(cells))
    for x in points.T:  # the sum of the squares of all edges, by those from the first corner
        sides = x[cells[:, 1:]] - x[cells[:, :1]]
        squares += (dim + 1) * np.einsum("ni,ni->n", sides, sides) - sides.sum(axis=1) ** 2
    if dim == 2:
        return volume, 4.0 * np.sqrt(3.0) * volume / squares
    return volume, np.sign(volume) * 12.0 * np.abs(3.0 * volume) ** (2.0 / 3.0) / squares


@dataclass(frozen=True, eq=False)
class _State:
    """A mesh on its way: nodes keep their numbers."""

    points: Array
    cells: IntArray
    groups: IntArray
    facets: IntArray
    labels: IntArray
    creases: IntArray
    dims: IntArray
    loss: float
    allowed: float
    #: Whether chance has a part in which nodes go first.
    at_random: bool

    @property
    def dim(self) -> int:
        return int(self.points.shape[1])

    @property
    def count(self) -> int:
        return len(self.cells)

    def smaller(self, random: np.random.Generator, target: int, shape: float) -> _State:
        """Some nodes that share no cell go, each onto a neighbour."""
        node, onto = self._pairs(random)
        stars = _incidences(self.cells, node, len(self.points))
        fans = _incidences(self.facets, node, len(self.points))
        allowed, cut = self._judged(node, onto, stars, fans, shape, self.count <= target)
        length = self._lengths(node, onto) + (np.log2(1.0 + random.random(len(node))) if self.at_random else 0.0)
        rank = np.argsort(np.argsort(np.where(allowed, length, np.inf), kind="stable"), kind="stable")
        chosen = _apart(rank, allowed, stars, len(self.cells))
        if self.count > target and chosen.any():
            excess = (self.count - target) // (2 * self.dim) + 1
            chosen &= rank <= np.sort(rank[chosen])[:excess][-1]
        goes = np.arange(len(self.points))
        goes[node[chosen]] = onto[chosen]
        cells, whole = _mapped(goes, self.cells)
        facets, left = _mapped(goes, self.facets)
        creases, _ = _mapped(goes, self.creases)
        return replace(
            self,
            cells=cells,
            groups=self.groups[whole],
            facets=facets,
            labels=self.labels[left],
            creases=creases,
            loss=self.loss + float(cut[chosen].sum()),
        )

    def _lengths(self, node: IntArray, onto: IntArray) -> Array:
        """Logarithms of the lengths of edges over the longest, the same where rounding alone tells these apart."""
        length = np.linalg.norm(self.points[node] - self.points[onto], axis=1)
        return np.asarray(np.round(np.log2(length / length.max(initial=0.0)) + _OFF, _DIGITS))

    def _pairs(self, random: np.random.Generator) -> tuple[IntArray, IntArray]:
        """Nodes that may go and where to, by their strata; one short edge of each node if there are many."""
        ways = [(self.cells, EDGES[self.dim]), (self.facets, [(0, 1), (0, 2), (1, 2)] if self.dim == 3 else [(0, 1)])]
        ways += [(self.creases, [(0, 1)])] if self.dim == 3 else []
        pairs = []
        for level, (simplices, edges) in enumerate(ways):
            ends = np.concatenate([simplices[:, [i, j]] for i, j in edges])
            ends = np.concatenate([ends, ends[:, ::-1]])
            pairs.append(ends[self.dims[ends[:, 0]] == self.dim - level])
        node, onto = np.concatenate(pairs).T
        count = len(self.points)
        if len(node) <= _REPEATED * _FEW:
            key = np.unique(node * count + onto)
            node, onto = key // count, key % count
        if len(node) > _FEW:
            length = self._lengths(node, onto) + np.log2(1.0 + random.random(len(node)))
            least = np.full(count, np.inf)
            np.minimum.at(least, node, length)
            nodes, first = np.unique(np.where(length == least[node], node, count), return_index=True)
            node, onto = nodes[nodes < count], onto[first[nodes < count]]
        return node, onto

    def _judged(
        self,
        node: IntArray,
        onto: IntArray,
        stars: tuple[IntArray, IntArray],
        fans: tuple[IntArray, IntArray],
        least: float,
        few: bool,
    ) -> tuple[BoolArray, Array]:
        """Which nodes may go, and what that cuts off."""
        count = len(node)
        who, cell = stars
        volume, shape = (values[cell] for values in shapes(self.points, self.cells))
        before, total = np.full(count, np.inf), np.bincount(who, volume, count)
        np.minimum.at(before, who, shape)
        new = np.where(self.cells[cell] == node[who, None], onto[who, None], self.cells[cell])
        left = (self.cells[cell] != onto[who, None]).all(axis=1)
        after = np.full(count, np.inf)
        np.minimum.at(after, who[left], shapes(self.points, new[left])[1])
        least = (1.0 - SAME) * (_SHAPES[self.dim][0] if few else least)
        allowed = (after > _FLAT) & (after >= np.minimum((1.0 - _FLAT) * before, least))
        who, facet = fans
        old = self.facets[facet]
        left = (old != onto[who, None]).all(axis=1)
        who, old, label = who[left], old[left], self.labels[facet[left]]
        new = np.where(old == node[who, None], onto[who, None], old)
        between = signed_volumes(self.points, np.column_stack([new, node[who]])) * (1.0 if self.dim == 3 else -1.0)
        small = SAME * total[who]
        wrong = np.where(label == 0, between < -small, np.abs(between) > small)
        cut = np.bincount(who, np.where((label == 0) & (between > small), between, 0.0), count)
        allowed &= np.bincount(who, wrong, count) == 0
        return allowed & (cut <= (1.0 + SAME) * self.allowed * total), np.asarray(cut, dtype=float)


def _incidences(simplices: IntArray, nodes: IntArray, count: int) -> tuple[IntArray, IntArray]:
    """Pairs of a place in ``nodes`` and the number of a simplex with that node."""
    order = np.argsort(simplices.ravel(), kind="stable")
    sizes = np.bincount(simplices.ravel(), minlength=count)
    start = np.cumsum(sizes) - sizes
    many = sizes[nodes]
    who = np.repeat(np.arange(len(nodes)), many)
    at = np.arange(len(who)) - np.repeat(np.cumsum(many) - many, many) + start[nodes][who]
    return who, order[at] // simplices.shape[1]


def _apart(rank: IntArray, allowed: BoolArray, stars: tuple[IntArray, IntArray], cells: int) -> BoolArray:
    """A choice of those allowed of which no two share a cell: low ranks first."""
    chosen, open_ = np.zeros(len(rank), dtype=bool), allowed.copy()
    who, cell = stars
    for _ in range(_CHOICES):
        some = open_[who]
        who, cell = who[some], cell[some]
        best = np.full(cells, len(rank))
        np.minimum.at(best, cell, rank[who])
        beaten = np.bincount(who, best[cell] < rank[who], len(rank)) > 0
        new = open_ & ~beaten
        chosen |= new
        taken = np.zeros(cells, dtype=bool)
        taken[cell[new[who]]] = True
        open_ &= np.bincount(who, taken[cell], len(rank)) == 0
        if not open_.any():
            break
    return chosen


def _mapped(goes: IntArray, simplices: IntArray) -> tuple[IntArray, BoolArray]:
    """Simplices with their nodes moved, without those that have one twice, and which these are."""
    new = goes[simplices]
    order = np.sort(new, axis=1)
    whole = (order[:, 1:] != order[:, :-1]).all(axis=1)
    return new[whole], whole
