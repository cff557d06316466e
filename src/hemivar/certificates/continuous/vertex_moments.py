"""Tractions in equilibrium with a discrete solution, vertex by vertex (element equilibration).

The tractions of an admissible stress are of the degree of the displacement on facets and known by their moments
``m_{F,a} = int_F s nu phi_a``. On every cell T and at every node a of it they shall fulfil

    sum of m_{F,a} over the facets F of T at a, outward  =  int_T s_h grad phi_a - int_T f0 phi_a,

which makes them work like ``s_h = C eps(u_h)`` against every field of that degree on T: forces and moments of the cell
balance. Equations of different nodes have no moment in common. At a midpoint there is one facet, whose moment is known
by that. Those of a vertex, for the moments nearest to ``s_h nu`` of both sides, are a graph Laplacian on the cells
around it. How near is measured by what a change m of a moment on F costs in misfit, about ``|C^-1| |T| m^2 / |F|^2`` in
either cell: else tractions of flat cells, or of soft ones, change where it is dear. In a direction in which no facet at
the node may take up a force they are solvable because the node is in equilibrium.

P. Ladeveze and D. Leguillon, SIAM J. Numer. Anal. 20 (1983); compared with others in arXiv 1704.06680.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.continuous.body_data import BodyData
from hemivar.certificates.continuous.facet_table import FacetTable, facet_vertices
from hemivar.errors import ProblemError
from hemivar.mesh.keys import equal_rows

__all__ = ["Tractions", "UnsettledTractions", "equilibrated", "unsettled"]

#: Part of the largest projection below which no facet at a vertex takes up a force along a direction.
_FREE = 1e-10
#: Least ease of a facet at a vertex over the largest one there.
_APART = 1e-4
#: Numbers of the matrices solved together, and cells and facets that are looked at together: they fit a cache.
_ENTRIES, _CELLS = 1 << 19, 1 << 12
#: Vertices whose cells hang together in the same way for which one matrix is factored.
_MANY = 64


@dataclass(frozen=True, eq=False)
class Tractions:
    """Moments of tractions in equilibrium."""

    #: Facet, node, component; of the outward normal of the first cell.
    moments: Array  # (F, k, d)
    #: Loads ``int_T g phi_a`` that had to be added to those of the body: what nodes without contact lack for
    #: equilibrium, rounding or an unfinished solve, and ``missed``.
    defect: Array  # (M, l, d)
    #: The part of it that comes from loads which the discrete problem integrates by a rule.
    missed: Array  # (M, l, d)


@dataclass(frozen=True, eq=False)
class UnsettledTractions:
    """Tractions near to those of a displacement, in equilibrium with its nodes but not on cells."""

    #: The mean of both sides inside; those that share the forces of the nodes on contact facets.
    moments: Array  # (F, k, d)
    #: What the nodes of the cells lack for equilibrium with them.
    lack: Array  # (M, l, d)
    #: As in :class:`Tractions`.
    defect: Array  # (M, l, d)
    missed: Array  # (M, l, d)
    #: Local numbers of the facets in their first and second cells.
    sides: IntArray  # (F, 2)
    #: By what a unit of potential changes the moments of a facet at its vertices.
    ease: Array  # (F, d)
    _stars: _Stars

    def pressed(self, data: BodyData, pressures: Array) -> UnsettledTractions:
        """With pressures (F, k, d) on contact facets that were none: what they leave to the nodes is shared there."""
        dim = data.table.dim
        contact = _Contact.of(data)
        own = np.einsum("fij,faj->fai", np.eye(dim) - data.unknown[contact.facets], pressures[contact.facets])
        total = np.zeros(data.displacement.shape)
        np.add.at(total, contact.nodes, own)
        change = own - contact.shared(total, _free_directions(data, self._stars))
        moments, lack = self.moments.copy(), self.lack.copy()
        contact.add(data, change, self.sides, moments, lack)
        return replace(self, moments=moments, lack=lack)

    def settled(self, data: BodyData) -> Tractions:
        """The nearest tractions in equilibrium on cells."""
        table, dim = data.table, data.table.dim
        members = facet_vertices(dim)
        lack = self.lack[:, : dim + 1]
        potential = self._stars.solve(lack.reshape(-1, dim))
        ease = self.ease[:, :, None]
        moments = self.moments.copy()
        first, second = self.sides.T
        inside, outer = np.flatnonzero(table.interior), np.flatnonzero(~table.interior)
        start = (dim + 1) * table.owners
        for at in range(0, len(inside), _CELLS):
            here = inside[at : at + _CELLS]
            change = np.take(potential, start[here, 0][:, None] + members[first[here]], axis=0)
            change -= np.take(potential, start[here, 1][:, None] + members[second[here]], axis=0)
            moments[here, :dim] += ease[here] * change
        change = potential[start[outer, 0][:, None] + members[first[outer]]]
        moments[outer, :dim] += ease[outer] * np.einsum("fij,faj->fai", data.unknown[outer], change)
        if data.order == 2:
            middle = facet_vertices(dim, 2)[first, dim]
            moments[:, dim] += np.einsum("fij,fj->fi", data.unknown, self.lack[table.owners[:, 0], middle])
        return Tractions(moments, self.defect, self.missed)


def unsettled(data: BodyData) -> UnsettledTractions:
    """Tractions near to those of a displacement."""
    table = data.table
    dim = table.dim
    sides = _sides(data)
    dear = _dear(data)[table.owners, sides] * (table.owners >= 0)
    ease = _eases(table, dear.sum(axis=1))
    dear /= dear.sum(axis=1, keepdims=True)
    stars = _Stars.of(data, ease)
    own = data.cell_moments  # of the stress of each cell, outward
    first, second = table.owners.T
    moments = np.ascontiguousarray(own[first, sides[:, 0]])  # else each look at a part copies the whole
    inside, outer = np.flatnonzero(table.interior), np.flatnonzero(~table.interior)
    for start in range(0, len(inside), _CELLS):
        here = inside[start : start + _CELLS]
        both = moments[here], -own[second[here], sides[here, 1]]
        moments[here] = sum(part * one for part, one in zip(dear[here].T[:, :, None, None], both, strict=True))
    given = data.facet_loads[outer]
    moments[outer] = given + np.einsum("fij,faj->fai", data.unknown[outer], moments[outer] - given)

    lack = data.forces - data.loads
    members = facet_vertices(dim, data.order)
    for start in range(0, len(lack), _CELLS):
        part = slice(start, start + _CELLS)
        outward = table.of_cells(moments, part)
        for facet in range(dim + 1):
            for place, node in enumerate(members[facet]):
                lack[part, node] -= outward[:, facet, place]

    # what is missing along directions that no facet at the node takes up
    nodes, free = data.cell_nodes, _free_directions(data, stars)
    total = np.zeros((len(free), dim))
    for c in range(dim):
        total[:, c] = np.bincount(nodes.ravel(), weights=lack[:, :, c].ravel(), minlength=len(total))
    total = np.einsum("nij,nj->ni", free, total)
    contact = _Contact.of(data)
    contact.add(data, contact.share[:, :, None] * total[contact.nodes], sides, moments, lack)
    total[contact.nodes] = 0.0
    around = np.bincount(nodes.ravel(), weights=np.repeat(table.volumes, nodes.shape[1]), minlength=len(total))
    share = (table.volumes[:, None] / around[nodes])[:, :, None]
    defect = np.take(total, nodes, axis=0) * share
    lack -= defect
    missed = np.zeros(defect.shape)
    if data.varying.missed.any():
        total = -np.einsum("nij,nj->ni", free, data.varying.missed)
        total[contact.nodes] = 0.0
        missed = np.take(total, nodes, axis=0) * share
    return UnsettledTractions(moments, lack, defect, missed, sides, ease, stars)


def equilibrated(data: BodyData, pressures: Array, start: UnsettledTractions | None = None) -> Tractions:
    """Tractions in equilibrium on every cell and at every node of it.

    ``pressures`` is (F, k, d).
    """
    return (unsettled(data) if start is None else start).pressed(data, pressures).settled(data)


@dataclass(frozen=True, eq=False)
class _Contact:
    """Contact facets (k,), their nodes (k, l), and their shares (k, l) of what nodes have on such facets."""

    facets: IntArray
    nodes: IntArray
    share: Array

    @classmethod
    def of(cls, data: BodyData) -> _Contact:
        facets = np.flatnonzero(data.contact >= 0)
        nodes, measures = data.facet_nodes[facets], data.table.measures[facets]
        weights = np.repeat(measures, nodes.shape[1])
        size = np.bincount(nodes.ravel(), weights=weights, minlength=len(data.displacement))
        return cls(facets, nodes, measures[:, None] / size[nodes])

    def shared(self, total: Array, free: Array) -> Array:
        """What nodes (n, d) have along free directions (n, d, d), shared among facets: (k, l, d)."""
        return np.asarray(self.share[:, :, None] * np.einsum("faij,faj->fai", free[self.nodes], total[self.nodes]))

    def add(self, data: BodyData, change: Array, sides: IntArray, moments: Array, lack: Array) -> None:
        """Add moments (k, l, d) to those of facets, and take them off what cells lack, in place."""
        moments[self.facets] += change
        members = facet_vertices(data.table.dim, data.order)
        cell, side = data.table.owners[self.facets, 0], sides[self.facets, 0]
        for a in range(change.shape[1]):  # a cell may have two such facets
            np.subtract.at(lack, (cell, members[side, a]), change[:, a])


def _free_directions(data: BodyData, stars: _Stars) -> Array:
    """Projections (nodes, d, d) on the directions along which no facet at the node takes up a force."""
    if data.order == 1:
        return stars.free
    dim, table = data.table.dim, data.table
    middle = np.zeros((len(data.displacement) - len(stars.free), dim, dim))
    loose = np.eye(dim) - data.unknown
    loose[table.interior] = np.eye(dim)  # both sides know the moment: their sum has to vanish
    for nodes in (data.opposite, data.facet_nodes):
        middle[nodes[:, dim] - len(stars.free)] = loose
    return np.concatenate([stars.free, middle])


def _dear(data: BodyData) -> Array:
    """About what the square of a moment on each facet costs each cell in misfit, (M, d + 1)."""
    table = data.table
    size = np.linalg.norm(data.compliance, axis=(1, 2))
    return np.asarray((size * table.volumes)[:, None] / table.measures[table.cell_facets] ** 2)


def _eases(table: FacetTable, dear: Array) -> Array:
    """By what a unit of potential changes the moments of facets at their vertices, (F, d): at most 1 around each.

    It is not too small beside that, for the balance is as exact as the systems of the vertices are well conditioned.
    """
    flat, ease = table.facets.ravel(), np.repeat(1.0 / dear, table.dim)
    largest = np.zeros(table.mesh.number_of_nodes)
    np.maximum.at(largest, flat, ease)
    return np.maximum(ease / largest[flat], _APART).reshape(table.facets.shape)


def _sides(data: BodyData) -> IntArray:
    """Local numbers (F, 2) of the facets in their first and second cells."""
    table = data.table
    at = table.cell_facets[table.owners] == np.arange(len(table.facets))[:, None, None]
    return np.asarray(np.argmax(at, axis=2), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class _Stars:
    """The cells around the vertices: pairs of a cell and a vertex of it, numbered ``cell (d + 1) + vertex``."""

    #: The vertex of each pair, and its place among the pairs of that vertex.
    vertex: IntArray  # (pairs,)
    place: IntArray  # (pairs,)
    #: Cells around each vertex.
    count: IntArray  # (N,)
    #: Pairs vertex after vertex, in their places, and where those of each vertex begin.
    order: IntArray  # (pairs,)
    first: IntArray  # (pairs,)
    #: Pairs of two cells at the ends of each facet inside, for each of its vertices; vertex after vertex.
    joined: IntArray  # (k, 2)
    #: Where those of each vertex begin.
    facets_first: IntArray  # (N + 1,)
    #: Pairs at boundary facets that take up a force, one for each facet, and ``block``, shape (h, d, d), along what.
    held: IntArray  # (h,)
    block: Array  # (h, d, d)
    #: By what a unit of potential changes the moments between the pairs of ``joined``.
    ease: Array  # (k,)
    #: Projections on the directions along which no facet at the vertex takes up a force.
    free: Array  # (N, d, d)

    @classmethod
    def of(cls, data: BodyData, eases: Array) -> _Stars:
        table = data.table
        dim, corners = table.dim, table.dim + 1
        nodes = table.mesh.number_of_nodes
        vertex = table.cells.ravel()
        order = np.argsort(vertex, kind="stable")
        count = np.bincount(vertex, minlength=nodes)
        place = np.empty(len(vertex), dtype=np.int64)
        first = np.cumsum(count) - count
        place[order] = np.arange(len(vertex)) - np.repeat(first, count)
        members = facet_vertices(dim)
        pair = np.empty((len(table.facets), 2, dim), dtype=np.int64)
        cell, side = np.divmod(np.arange(table.cell_facets.size), corners)
        number, second = table.cell_facets.ravel(), (table.signs.ravel() < 0.0).astype(np.int64)
        pair[number, second] = (cell * corners)[:, None] + members[side]
        inside = table.interior
        joined = pair[inside].transpose(0, 2, 1).reshape(-1, 2)
        by_vertex = np.argsort(vertex[joined[:, 0]], kind="stable")
        joined, ease = joined[by_vertex], eases[inside].ravel()[by_vertex]
        _refuse_pinched(joined, vertex, nodes, table.mesh.points)
        outer = np.flatnonzero(~inside & data.unknown.any(axis=(1, 2)))
        held = pair[outer, 0].ravel()
        block = (eases[outer, :, None, None] * data.unknown[outer, None]).reshape(-1, dim, dim)
        taken = np.zeros((nodes, dim, dim))
        np.add.at(taken, vertex[held], block)
        free = np.broadcast_to(np.eye(dim), taken.shape).copy()
        some = np.flatnonzero(taken.any(axis=(1, 2)))
        size, axes = np.linalg.eigh(taken[some])
        loose = (size < _FREE * dim).astype(float)
        free[some] = np.einsum("kin,kn,kjn->kij", axes, loose, axes)
        facets_first = np.concatenate([[0], np.cumsum(np.bincount(vertex[joined[:, 0]], minlength=nodes))])
        return cls(vertex, place, count, order, first, joined, facets_first, held, block, ease, free)

    def solve(self, lack: Array) -> Array:
        """Potentials (pairs, d) whose differences over facets bring each pair what it lacks, shape (pairs, d)."""
        nodes, dim = self.free.shape[:2]
        coupled = np.zeros(nodes, dtype=bool)
        coupled[self.vertex[self.held]] = True
        out = np.zeros(lack.shape)
        for size in np.unique(self.count):
            for group, components in ((self.count == size) & ~coupled, 1), ((self.count == size) & coupled, dim):
                chosen = np.flatnonzero(group)
                step = max(_ENTRIES // (size * components) ** 2, 1)
                for start in range(0, len(chosen), step):
                    self._solve(chosen[start : start + step], int(size), components, lack, out)
        return out

    def _solve(self, chosen: IntArray, size: int, components: int, lack: Array, out: Array) -> None:
        """Vertices with the same number of cells; one system for all components, or one that couples them."""
        dim = self.free.shape[1]
        pairs = self.order[self.first[chosen][:, None] + np.arange(size)]
        at, joined = _ranges(self.facets_first, chosen)
        joined, ease = self.joined[joined], self.ease[joined]
        graph = np.zeros((len(chosen), size, size))
        one, two = self.place[joined[:, 0]], self.place[joined[:, 1]]
        graph[at, one, two] = graph[at, two, one] = -ease
        diagonal = np.arange(size)
        graph[:, diagonal, diagonal] = -graph.sum(axis=2)
        right = np.take(lack, pairs, axis=0)
        if components == 1:
            number = _alike(at, one * size + two, len(chosen), ease)
            found = np.empty(right.shape)
            for kind in range(int(number.max(initial=-1)) + 1):  # stars that hang together in the same way
                same = np.flatnonzero(number == kind)
                flat = right[same].transpose(1, 0, 2).reshape(size, -1)
                flat = np.linalg.solve(graph[same[0]] + 1.0 / size, flat)
                found[same] = flat.reshape(size, len(same), dim).transpose(1, 0, 2)
            rest = np.flatnonzero(number < 0)
            found[rest] = np.linalg.solve(graph[rest] + 1.0 / size, right[rest])
        else:
            full = np.einsum("kab,ij->kaibj", graph, np.eye(dim))
            full += (self.free / size)[chosen][:, None, :, None, :]
            row = np.full(len(self.free), -1, dtype=np.int64)
            row[chosen] = np.arange(len(chosen))
            at = row[self.vertex[self.held]]
            here = at >= 0
            held = np.zeros((len(chosen), size, dim, dim))
            np.add.at(held, (at[here], self.place[self.held[here]]), self.block[here])
            full[:, diagonal, :, diagonal] += held.transpose(1, 0, 2, 3)
            flat = full.reshape(len(chosen), size * dim, size * dim)
            found = np.linalg.solve(flat, right.reshape(len(chosen), -1, 1)).reshape(right.shape)
        out[pairs] = found


def _ranges(first: IntArray, chosen: IntArray) -> tuple[IntArray, IntArray]:
    """For each entry from ``first[c]`` to ``first[c + 1]``: the place of c in ``chosen``, and its own."""
    count = first[chosen + 1] - first[chosen]
    at = np.repeat(np.arange(len(chosen)), count)
    return at, np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count) + first[chosen][at]


def _alike(at: IntArray, pairs: IntArray, count: int, ease: Array) -> IntArray:
    """Numbers (count,) from 0 on, the same for those with the same pairs; -1 for those that have few like them.

    ``at`` says in order whose each pair is.
    """
    many = np.bincount(at, minlength=count)
    if not len(at) or many.min() != many.max():
        return np.full(count, -1)
    eases = ease.reshape(count, -1)
    rounded = np.rint(eases / eases.max(axis=1, keepdims=True) * 1e9).astype(np.int64)
    number = equal_rows(np.concatenate([pairs.reshape(count, -1), rounded], axis=1))
    size = np.bincount(number)
    return np.where(size >= _MANY, np.cumsum(size >= _MANY) - 1, -1)[number]


def _refuse_pinched(joined: IntArray, vertex: IntArray, nodes: int, points: Array) -> None:
    """Refuse bodies that hang together at a vertex only."""
    ones: BoolArray = np.ones(len(joined), dtype=bool)
    graph = sp.coo_array((ones, (joined[:, 0], joined[:, 1])), shape=(len(vertex), len(vertex)))
    parts, label = sp.csgraph.connected_components(graph, directed=False)
    if parts == nodes:
        return
    _, first = np.unique(label, return_index=True)
    bad = int(np.argmax(np.bincount(vertex[first], minlength=nodes) > 1))
    place = ", ".join(f"{x:.6g}" for x in points[bad])
    raise ProblemError(
        f"cells around the node {bad}, x = ({place}), meet there and share no facet; join them through facets"
    )
