"""Mortar projection between two boundaries, with dual multipliers (Wohlmuth 2000).

On each facet F of the slave the functions ``psi = A phi`` are biorthogonal to the shape functions, ``A = D M^-1`` with
the mass matrix M of the part of F that the master covers and D the diagonal of its row sums.  A node that gives no
multiplier hands its function on to the others of the facet in equal parts, so that they still sum to one.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.rings import facet_shares, weightless
from hemivar.fem.supports import sum_by
from hemivar.mesh.mesh import Mesh

__all__ = ["Mortar", "mortar"]

#: Cosine of the angle of two normals above which facets do not face each other.
_FACING = -0.2
#: Shares of a facet that are rounding, by which parts of the master may overlap, and below which a point is dropped.
_ROUNDED, _LAYERS, _COVERED = 1e-13, 1e-6, 1e-6


@dataclass(frozen=True, eq=False)
class _Coupling:
    """Integrals of psi and shape functions, on the facets of the slave and on what overlaps."""

    own: IntArray  # (f, n), nodes of the slave's facets
    here: Array  # (f, n, n)
    slave: IntArray  # (k,), facets of what overlaps
    master: IntArray  # (k,)
    there: Array  # (k, n, n)
    masters: int  # facets of the master
    rule: _Rule
    psi: Array  # (k, q, n)


@dataclass(frozen=True, eq=False)
class Mortar:
    """The jump of a field between two boundaries, at the nodes of the slave."""

    nodes: IntArray  # (m,)
    weights: Array  # (m,), integrals of psi
    jump: sp.csr_array  # (m, nodes): psi-weighted mean of the field on the slave less that on the master
    turned: float  # degrees, by which facets that face each other are not parallel, at most
    coupling: _Coupling

    def moments(self, forces: Array) -> tuple[Array, Array]:
        """What forces (m, d) on the slave do facet by facet, and the opposite ones on the master.

        They are moments of the tractions ``sum psi_p forces_p / weights_p`` against the functions of the nodes of each
        facet of the slave (f, n, d) and of the master (g, n, d).
        """
        at, count = self.coupling, self.jump.shape[1]
        traction = np.zeros((count, forces.shape[1]))
        traction[self.nodes] = forces / self.weights[:, None]
        there = np.einsum("kil,kid->kld", at.there, traction[at.own[at.slave]])
        across = np.zeros((at.masters, *there.shape[1:]))
        np.subtract.at(across, at.master, there)
        return np.asarray(np.einsum("fij,fid->fjd", at.here, traction[at.own])), across

    def mean(self, own: Array, other: Array) -> Array:
        """The psi-weighted mean (m, d) of a field on the slave less that of one on the master.

        Both are quadratic on each facet, by the nodes of order 2: shapes (f, n, d) and (g, n, d).
        """
        at, rule = self.coupling, self.coupling.rule
        field = np.einsum("kqn,knd->kqd", shape_values(2, rule.on_slave), own[at.slave])
        field -= np.einsum("kqn,knd->kqd", shape_values(2, rule.on_master), other[at.master])
        moments = np.einsum("kqi,kqd->kid", rule.weight[:, :, None] * at.psi, field)
        summed = sum_by(at.own[at.slave].ravel(), moments.reshape(-1, field.shape[2]), self.jump.shape[1])
        return np.asarray(summed[self.nodes] / self.weights[:, None])


@dataclass(frozen=True, eq=False)
class _Rule:
    """Points of integration on the overlap, in the barycentric coordinates of both sides, and their weights."""

    on_slave: Array  # (k, q, d)
    on_master: Array  # (k, q, d)
    weight: Array  # (k, q)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Simplices of the overlap of slave and master facets, by corners in the barycentric coordinates of both."""

    slave: IntArray  # (k,)
    master: IntArray  # (k,)
    on_slave: Array  # (k, d, d)
    on_master: Array  # (k, d, d)
    share: Array  # (k,), of the slave facet


def mortar(
    mesh: Mesh,
    order: int,
    slave: IntArray,
    master: IntArray,
    without: BoolArray,
    names: str,
    ring: bool = False,
) -> Mortar:
    """The projection from the facets ``master (g, d)`` to ``slave (f, d)``.

    ``without (nodes,)`` are nodes that give no multiplier; ``names`` is what messages call the pair; integrals are over
    whole rings of a body of revolution where ``ring`` says so.  Facets are seen along the normals of the slave's
    facets.  Raises ProblemError: nothing faces the slave, or several layers do.
    """
    pieces = _overlap(mesh, slave, master)
    own, other = mesh.facet_nodes(slave, order), mesh.facet_nodes(master, order)
    covered = np.bincount(pieces.slave, pieces.share, len(slave))
    if not covered.any():
        raise ProblemError(
            f"{names}: no facet of the one faces the other along its normals; check names, places and units"
        )
    if (covered > 1.0 + _LAYERS).any():
        place = mesh.points[slave[int(np.argmax(covered))]].mean(axis=0)
        raise ProblemError(
            f"{names}: several layers face the facet at ({', '.join(f'{x:.6g}' for x in place)}); name a smaller "
            "boundary"
        )
    rule = _integration(mesh, order, slave, pieces, ring)
    phi, across, weight = shape_values(order, rule.on_slave), shape_values(order, rule.on_master), rule.weight
    size = own.shape[1]
    mass = np.zeros((len(slave), size, size))
    np.add.at(mass, pieces.slave, np.einsum("kq,kqi,kqj->kij", weight, phi, phi))
    none, count = weightless(mesh, slave, order, ring), len(mesh.nodes(order))
    without, seen = without | none, np.flatnonzero(covered > _COVERED)
    dual = np.zeros_like(mass)
    dual[seen] = _dual(mass[seen], without[own[seen]])
    # coupling of psi with the slave's and the master's shape functions
    here = np.einsum("fij,fjk->fik", dual, mass)
    there = np.einsum("kij,kjl->kil", dual[pieces.slave], np.einsum("kq,kqi,kql->kil", weight, phi, across))
    matrix = _assembled(own, own, here, count) - _assembled(own[pieces.slave], other[pieces.master], there, count)
    weights: Array = np.bincount(own.ravel(), here.sum(axis=2).ravel(), count).astype(float)
    around = np.bincount(own.ravel(), facet_shares(mesh, slave, order, ring).ravel(), count)
    nodes = np.flatnonzero(~none & (weights > _COVERED * around))
    rows = sp.diags_array(1.0 / weights[nodes]) @ sp.csr_array(matrix)[nodes]
    rows.data[np.abs(rows.data) < _ROUNDED] = 0.0
    rows.eliminate_zeros()
    turned = _turned(mesh, slave, master, pieces)
    psi = np.einsum("kij,kqj->kqi", dual[pieces.slave], phi)
    coupling = _Coupling(own, here, pieces.slave, pieces.master, there, len(master), rule, psi)
    return Mortar(nodes, weights[nodes], sp.csr_array(rows), turned, coupling)


def _integration(mesh: Mesh, order: int, slave: IntArray, pieces: _Pieces, ring: bool) -> _Rule:
    """A rule that is exact for products of two shape functions, and of one and a quadratic."""
    rule, portion = quadrature_rule(mesh.dim - 1, order + 2 + ring)
    on_slave, on_master = (np.einsum("qc,kcb->kqb", rule, at) for at in (pieces.on_slave, pieces.on_master))
    weight = (pieces.share * mesh.facet_normals(slave)[1][pieces.slave])[:, None] * portion
    if ring:
        radius = mesh.points[slave, 0][pieces.slave]
        weight = weight * 2.0 * np.pi * np.einsum("kqb,kb->kq", on_slave, radius)
    return _Rule(on_slave, on_master, weight)


def _turned(mesh: Mesh, slave: IntArray, master: IntArray, pieces: _Pieces) -> float:
    """The largest angle in degrees between facets that are nearer to each other than their size."""
    normal, measure = (part[pieces.slave] for part in mesh.facet_normals(slave))
    middle = [
        np.einsum("kc,kcd->kd", at.mean(axis=1), mesh.points[facets])
        for at, facets in ((pieces.on_slave, slave[pieces.slave]), (pieces.on_master, master[pieces.master]))
    ]
    far = np.abs(np.einsum("kd,kd->k", normal, middle[1] - middle[0]))
    near = far <= measure ** (1.0 / (mesh.dim - 1))
    cosine = -np.einsum("kd,kd->k", normal, mesh.facet_normals(master)[0][pieces.master])[near]
    return float(np.degrees(np.arccos(np.clip(cosine.min(initial=1.0), -1.0, 1.0))))


def _dual(mass: Array, without: BoolArray) -> Array:
    """Coefficients (f, n, n) of psi in the shape functions, zero rows for nodes without multiplier (f, n)."""
    sums = mass.sum(axis=2)
    scale = np.sqrt(np.maximum(np.einsum("fii->fi", mass), np.finfo(float).tiny))
    inverse = np.linalg.inv(mass / (scale[:, :, None] * scale[:, None, :])) / (scale[:, :, None] * scale[:, None, :])
    dual = sums[:, :, None] * inverse
    kept = np.count_nonzero(~without, axis=1)
    given = np.where(without[:, :, None], dual, 0.0).sum(axis=1) / np.maximum(kept, 1)[:, None]
    return np.asarray(np.where(without[:, :, None], 0.0, dual + given[:, None, :]))


def _assembled(rows: IntArray, columns: IntArray, values: Array, count: int) -> sp.csr_array:
    """The matrix (count, count) of blocks (k, r, c) at rows (k, r) and columns (k, c)."""
    at = np.broadcast_to(rows[:, :, None], values.shape), np.broadcast_to(columns[:, None, :], values.shape)
    return sp.csr_array(sp.coo_array((values.ravel(), (at[0].ravel(), at[1].ravel())), shape=(count, count)))


# ---- overlap -------------------------------------------------------------------------------------------------------


def _overlap(mesh: Mesh, slave: IntArray, master: IntArray) -> _Pieces:
    normal, _ = mesh.facet_normals(slave)
    first, second = _near(mesh, slave, master, normal)
    facing = np.einsum("pd,pd->p", normal[first], mesh.facet_normals(master)[0][second]) < _FACING
    first, second = first[facing], second[facing]
    d = mesh.dim
    corner, seen = mesh.points[slave[first]], mesh.points[master[second]]
    own = mesh.points[slave]
    frame = np.concatenate([own[:, 1:] - own[:, :1], normal[:, None]], axis=1)
    # projected along the normal: barycentric coordinates on the slave's facet
    inner = np.einsum("pcd,pde->pce", seen - corner[:, :1], np.linalg.inv(frame)[first])[:, :, : d - 1]
    inner = np.concatenate([1.0 - inner.sum(axis=2, keepdims=True), inner], axis=2)
    both = np.concatenate([inner, np.broadcast_to(np.eye(d), (len(first), d, d))], axis=2)
    # what lies deeper behind than both facets are wide is the other side of the body, and no overlap of two
    behind = np.einsum("pcd,pd->pc", corner.mean(axis=1, keepdims=True) - seen, normal[first]).min(axis=1)
    width = sum(
        mesh.facet_normals(part)[1][number] ** (1.0 / (d - 1)) for part, number in ((slave, first), (master, second))
    )
    some = np.flatnonzero((inner.max(axis=1) > _ROUNDED).all(axis=1) & (behind < width))
    if not len(some):
        return _Pieces(first[some], second[some], np.zeros((0, d, d)), np.zeros((0, d, d)), np.zeros(0))
    polygon, corners = _clipped(both[some], d)
    simplices, of = _fanned(polygon, corners, d)
    on_slave = simplices[:, :, :d]
    share = np.abs(np.linalg.det(on_slave))  # of barycentric corners: the share of the facet's measure
    big = share > _ROUNDED
    pair = some[of[big]]
    return _Pieces(first[pair], second[pair], on_slave[big], simplices[big, :, d:], share[big])


def _near(mesh: Mesh, slave: IntArray, master: IntArray, normal: Array) -> tuple[IntArray, IntArray]:
    """Pairs of facets that may face each other, (p,) and (p,): all within twice the distance and the sizes of both.

    Seen along the normal (f, d) of the slave's facet, their middles are no further apart than both are wide.
    """
    middle, other = (mesh.points[facets].mean(axis=1) for facets in (slave, master))
    radius = [
        np.linalg.norm(mesh.points[facets] - at[:, None], axis=2).max(axis=1)
        for facets, at in ((slave, middle), (master, other))
    ]
    with IMPORTS:
        from scipy.spatial import cKDTree
    tree = cKDTree(other)
    distance, _ = tree.query(middle)
    reach = 2.0 * (np.asarray(distance) + radius[0] + radius[1].max())
    found = tree.query_ball_point(middle, reach, return_sorted=False)
    counts = np.fromiter(map(len, found), dtype=np.int64, count=len(found))
    first = np.repeat(np.arange(len(slave)), counts)
    second = np.fromiter(itertools.chain.from_iterable(found), dtype=np.int64, count=len(first))
    way, along = other[second] - middle[first], normal[first]
    across = np.linalg.norm(way - np.einsum("pd,pd->p", way, along)[:, None] * along, axis=1)
    close = across <= (1.0 + _LAYERS) * (radius[0][first] + radius[1][second])
    return first[close], second[close]


def _clipped(polygon: Array, d: int) -> tuple[Array, IntArray]:
    """Polygons (p, n, 2 d) cut to where their first d coordinates are not negative, and their numbers of corners.

    After Sutherland and Hodgman (1974), all polygons at once; a segment is a polygon of two corners.
    """
    corners = np.full(len(polygon), polygon.shape[1])
    for axis in range(d):
        polygon, corners = _cut(polygon, corners, axis, closed=d == 3)
    return polygon, corners


def _cut(polygon: Array, corners: IntArray, axis: int, *, closed: bool) -> tuple[Array, IntArray]:
    count, most, width = polygon.shape
    place = np.arange(most)
    there = place < corners[:, None]
    following = np.where(place + 1 < corners[:, None], place + 1, 0)
    after = np.take_along_axis(polygon, following[:, :, None], axis=1)
    value, ahead = polygon[:, :, axis], after[:, :, axis]
    inside = there & (value >= 0.0)
    crosses = there & ((value >= 0.0) != (ahead >= 0.0)) & (closed | (place + 1 < corners[:, None]))
    part = np.where(crosses, value / np.where(crosses, value - ahead, 1.0), 0.0)
    cut = polygon + part[:, :, None] * (after - polygon)
    cut[:, :, axis] = np.where(crosses, 0.0, cut[:, :, axis])
    every = np.stack([polygon, cut], axis=2).reshape(count, 2 * most, width)
    kept = np.stack([inside, crosses], axis=2).reshape(count, 2 * most)
    order = np.argsort(~kept, axis=1, kind="stable")
    number = kept.sum(axis=1)
    room = max(int(number.max(initial=0)), 1)
    return np.take_along_axis(every, order[:, :room, None], axis=1), number


def _fanned(polygon: Array, corners: IntArray, d: int) -> tuple[Array, IntArray]:
    """The simplices (k, d, 2 d) of polygons from their first corners, and the polygon of each."""
    if d == 2:
        whole = np.flatnonzero(corners == 2)
        return polygon[whole][:, :2], whole
    pieces, owners = [], []
    for k in range(1, polygon.shape[1] - 1):
        here = np.flatnonzero(corners > k + 1)
        pieces.append(polygon[here][:, [0, k, k + 1]])
        owners.append(here)
    if not pieces:
        return np.zeros((0, d, 2 * d)), np.zeros(0, dtype=np.int64)
    return np.concatenate(pieces), np.concatenate(owners)
