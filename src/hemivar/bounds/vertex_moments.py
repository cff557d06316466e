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

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import CACHED
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.compiled_stars import CompiledStars
from hemivar.bounds.facet_table import FacetTable, facet_vertices
from hemivar.bounds.roundings import FREE
from hemivar.errors import ProblemError

__all__ = ["Tractions", "equilibrated", "shared_on_contact"]

#: Least ease of a facet at a vertex over the largest one there.
_APART = 1e-4


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


def equilibrated(data: BodyData, pressures: Array | None = None) -> Tractions:
    """Tractions in equilibrium on every cell and at every node of it.

    ``pressures`` (F, k, d) are those on contact facets that are near to the tractions; by default none.
    """
    compiled = CompiledStars.of(data, _dear(data), pressures)
    if compiled is None:
        return _Unsettled.of(data, pressures).settled(data)
    pinched, *parts = compiled.settled()
    if pinched >= 0:
        raise _pinched(pinched, data.table.mesh.points)
    return Tractions(*parts)


def shared_on_contact(data: BodyData, stated: Array | None = None) -> Array:
    """Moments (F, k, d) of contact facets that share the forces of the nodes there; zero on all other facets.

    With ``stated`` contact tractions (F, k, d) these are taken, but for components that supports hold.
    """
    touched = data.contact >= 0
    if stated is not None:
        facets, moments = np.flatnonzero(touched), np.zeros(stated.shape)
        own = data.cell_moments[data.table.owners[facets, 0], _sides(data)[facets, 0]]
        given = data.loads_on(facets) + stated[facets]
        moments[facets] = given + np.einsum("fij,faj->fai", data.freed(facets), own - given)
        return moments
    compiled = CompiledStars.of(data, _dear(data))
    if compiled is not None:
        return compiled.on_contact(np.unique(data.table.facets[touched]))
    return np.where(touched[:, None, None], _Unsettled.of(data, None).moments, 0.0)


def _dear(data: BodyData) -> Array:
    """About what the square of a moment costs each cell in misfit, times that of the measure of its facet, (M,)."""
    return np.asarray(np.linalg.norm(data.compliance, axis=(1, 2)) * data.table.volumes)


def _pinched(vertex: int, points: Array) -> ProblemError:
    x = ", ".join(f"{part:.6g}" for part in points[vertex])
    return ProblemError(
        f"cells around the node {vertex}, x = ({x}), meet there and share no facet; join them through facets"
    )


# ---- by NumPy ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Unsettled:
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
    stars: _Stars

    @classmethod
    def of(cls, data: BodyData, pressures: Array | None) -> _Unsettled:
        """With pressures (F, k, d) on contact facets: what they leave to the nodes is shared there."""
        table, dim = data.table, data.table.dim
        sides = _sides(data)
        dear = _dear(data)[table.owners] * (table.owners >= 0)
        ease = _eases(table, dear.sum(axis=1) / table.measures**2)
        dear /= dear.sum(axis=1, keepdims=True)
        stars = _Stars.of(data, ease)
        own, (first, second) = data.cell_moments, table.owners.T  # of the stress of each cell, outward
        inside, outer = np.flatnonzero(table.interior), table.outer
        moments = np.array(own[first, sides[:, 0]])
        moments[inside] *= dear[inside, :1, None]
        moments[inside] -= dear[inside, 1:, None] * own[second[inside], sides[inside, 1]]
        given = data.outer_loads + (0.0 if pressures is None else pressures[outer])
        moments[outer] = given + np.einsum("fij,faj->fai", data.freed(outer), moments[outer] - given)
        lack = data.forces - data.loads
        outward = table.of_cells(moments)
        for facet, nodes in enumerate(facet_vertices(dim, data.order)):
            lack[:, nodes] -= outward[:, facet]

        # what is missing along directions that no facet at the node takes up
        nodes, free = data.cell_nodes, _free_directions(data, stars)
        total = np.zeros((len(free), dim))
        np.add.at(total, nodes, lack)
        total = np.einsum("nij,nj->ni", free, total)
        contact = _Contact.of(data)
        contact.add(data, contact.share[:, :, None] * total[contact.nodes], sides, moments, lack)
        total[contact.nodes] = 0.0
        around = np.bincount(nodes.ravel(), weights=np.repeat(table.volumes, nodes.shape[1]), minlength=len(total))
        share = (table.volumes[:, None] / around[nodes])[:, :, None]
        defect = total[nodes] * share
        missed = -np.einsum("nij,nj->ni", free, data.varying.missed)
        missed[contact.nodes] = 0.0
        return cls(moments, lack - defect, defect, missed[nodes] * share, sides, ease, stars)

    def settled(self, data: BodyData) -> Tractions:
        """The nearest tractions in equilibrium on cells."""
        table, dim = data.table, data.table.dim
        potential = self.stars.solve(self.lack[:, : dim + 1].reshape(-1, dim)).reshape(-1, dim + 1, dim)
        moments, members, (first, second) = self.moments.copy(), facet_vertices(dim), self.sides.T
        change = potential[table.owners[:, :1], members[first]]
        inside = np.flatnonzero(table.interior)
        change[inside] -= potential[table.owners[inside, 1:], members[second[inside]]]
        moments[:, :dim] += self.ease[:, :, None] * np.einsum("fij,faj->fai", data.unknown, change)
        if data.order == 2:
            middle = facet_vertices(dim, 2)[first, dim]
            moments[:, dim] += np.einsum("fij,fj->fi", data.unknown, self.lack[table.owners[:, 0], middle])
        return Tractions(moments, self.defect, self.missed)


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
    dim = data.table.dim
    middle = np.zeros((len(data.displacement) - len(stars.free), dim, dim))
    loose = np.eye(dim) - data.unknown
    loose[data.table.interior] = np.eye(dim)  # both sides know the moment: their sum has to vanish
    for nodes in (data.opposite, data.facet_nodes):
        middle[nodes[:, dim] - len(stars.free)] = loose
    return np.concatenate([stars.free, middle])


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

    table: FacetTable
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
        dim, corners, nodes, vertex = table.dim, table.dim + 1, table.mesh.number_of_nodes, table.cells.ravel()
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
        loose = (size < FREE * dim).astype(float)
        free[some] = np.einsum("kin,kn,kjn->kij", axes, loose, axes)
        facets_first = np.concatenate([[0], np.cumsum(np.bincount(vertex[joined[:, 0]], minlength=nodes))])
        return cls(table, joined, facets_first, held, block, ease, free)

    def solve(self, lack: Array) -> Array:
        """Potentials (pairs, d) whose differences over facets bring each pair what it lacks, shape (pairs, d)."""
        nodes, dim = self.free.shape[:2]
        coupled = np.zeros(nodes, dtype=bool)
        coupled[self.table.cells.ravel()[self.held]] = True
        out, counts = np.zeros(lack.shape), np.diff(self.table.stars[0])
        for size in np.unique(counts):
            for group, components in ((counts == size) & ~coupled, 1), ((counts == size) & coupled, dim):
                chosen = np.flatnonzero(group)
                step = max(CACHED // (size * components) ** 2, 1)
                for start in range(0, len(chosen), step):
                    self._solve(chosen[start : start + step], int(size), components, lack, out)
        return out

    def _solve(self, chosen: IntArray, size: int, components: int, lack: Array, out: Array) -> None:
        """Vertices with the same number of cells; one system for all components, or one that couples them."""
        dim, (first, order, rank) = self.free.shape[1], self.table.stars
        pairs = order[first[chosen][:, None] + np.arange(size)]
        at, joined = _ranges(self.facets_first, chosen)
        joined, ease = self.joined[joined], self.ease[joined]
        graph = np.zeros((len(chosen), size, size))
        one, two = rank[joined[:, 0]], rank[joined[:, 1]]
        graph[at, one, two] = graph[at, two, one] = -ease
        diagonal = np.arange(size)
        graph[:, diagonal, diagonal] = -graph.sum(axis=2)
        right = np.take(lack, pairs, axis=0)
        if components == 1:
            out[pairs] = np.linalg.solve(graph + 1.0 / size, right)
            return
        full = np.einsum("kab,ij->kaibj", graph, np.eye(dim))
        full += (self.free / size)[chosen][:, None, :, None, :]
        row = np.full(len(self.free), -1, dtype=np.int64)
        row[chosen] = np.arange(len(chosen))
        at = row[self.table.cells.ravel()[self.held]]
        here = at >= 0
        held = np.zeros((len(chosen), size, dim, dim))
        np.add.at(held, (at[here], rank[self.held[here]]), self.block[here])
        full[:, diagonal, :, diagonal] += held.transpose(1, 0, 2, 3)
        flat = full.reshape(len(chosen), size * dim, size * dim)
        out[pairs] = np.linalg.solve(flat, right.reshape(len(chosen), -1, 1)).reshape(right.shape)


def _ranges(first: IntArray, chosen: IntArray) -> tuple[IntArray, IntArray]:
    """For each entry from ``first[c]`` to ``first[c + 1]``: the place of c in ``chosen``, and its own."""
    count = first[chosen + 1] - first[chosen]
    at = np.repeat(np.arange(len(chosen)), count)
    return at, np.arange(len(at)) - np.repeat(np.cumsum(count) - count, count) + first[chosen][at]


def _refuse_pinched(joined: IntArray, vertex: IntArray, nodes: int, points: Array) -> None:
    """Refuse bodies that hang together at a vertex only."""
    ones: BoolArray = np.ones(len(joined), dtype=bool)
    graph = sp.coo_array((ones, (joined[:, 0], joined[:, 1])), shape=(len(vertex), len(vertex)))
    parts, label = sp.csgraph.connected_components(graph, directed=False)
    if parts == nodes:
        return
    _, first = np.unique(label, return_index=True)
    bad = int(np.argmax(np.bincount(vertex[first], minlength=nodes) > 1))
    raise _pinched(bad, points)
