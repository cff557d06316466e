"""Mortar projection between two boundaries, with dual multipliers (Wohlmuth 2000).

On each facet F of the slave the functions ``psi = A phi`` are biorthogonal to the functions phi of contact
(:mod:`hemivar.fem.contact_basis`), ``A = D M^-1`` with the mass matrix M of the part of F that the master covers and D
the diagonal of its row sums.  A node that gives no multiplier, or would have no positive weight where the master covers
little around it, hands its function on to the others of the facet in equal parts, so that they still sum to one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.contact_basis import contact_shapes, contact_weights, lagrange_moments
from hemivar.fem.elements import shape_values
from hemivar.fem.pairing import Pairing
from hemivar.fem.quadrature import quadrature_rule
from hemivar.fem.supports import sum_by
from hemivar.mechanics.kinematics import BodyKinematics
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.refine import COVERED

__all__ = ["Mortar", "mortar"]


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
    pieces: Pairing

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


def mortar(mesh: Mesh, pieces: Pairing, without: BoolArray, body: BodyKinematics) -> Mortar:
    """The projection from the facets of the master to those of the slave.

    ``without (f, n)`` are the nodes of the slave's facets that give no multiplier there.
    """
    (slave, master), order = pieces.sides, pieces.sides[0].order
    own, other = slave.nodes, master.nodes
    rule = _integration(mesh, pieces, body)
    phi, across, weight = contact_shapes(order, rule.on_slave), shape_values(order, rule.on_master), rule.weight
    size = own.shape[1]
    mass = np.zeros((len(own), size, size))
    np.add.at(mass, pieces.slave, np.einsum("kq,kqi,kqj->kij", weight, phi, phi))
    around, none = contact_weights(mesh, slave, body)
    count = len(around)
    seen = np.flatnonzero(pieces.touches)
    none |= np.bincount(own[seen].ravel(), mass[seen].sum(axis=2).ravel(), count) <= COVERED * around
    without = without | none[own]
    dual = np.zeros_like(mass)
    dual[seen] = _dual(mass[seen], without[seen])
    # coupling of psi with the slave's and the master's shape functions
    here = lagrange_moments(np.einsum("fij,fjk->fik", dual, mass))
    there = np.einsum("kij,kjl->kil", dual[pieces.slave], np.einsum("kq,kqi,kql->kil", weight, phi, across))
    matrix = _assembled(own, own, here, count) - _assembled(own[pieces.slave], other[pieces.master], there, count)
    weights: Array = np.bincount(own.ravel(), here.sum(axis=2).ravel(), count).astype(float)
    nodes = np.flatnonzero(~none & (weights > COVERED * around))
    rows = sp.diags_array(1.0 / weights[nodes]) @ sp.csr_array(matrix)[nodes]
    rows.data[np.abs(rows.data) < ROUNDED] = 0.0
    rows.eliminate_zeros()
    turned = _turned(mesh, pieces)
    psi = np.einsum("kij,kqj->kqi", dual[pieces.slave], phi)
    coupling = _Coupling(own, here, pieces.slave, pieces.master, there, len(other), rule, psi)
    return Mortar(nodes, weights[nodes], sp.csr_array(rows), turned, coupling, pieces)


def _integration(mesh: Mesh, pieces: Pairing, body: BodyKinematics) -> _Rule:
    """A rule that is exact for products of two shape functions, and of one and a quadratic."""
    slave = pieces.sides[0]
    rule, portion = quadrature_rule(mesh.dim - 1, slave.order + 2 + body.ring)
    on_slave, on_master = (np.einsum("qc,kcb->kqb", rule, at) for at in (pieces.on_slave, pieces.on_master))
    weight = (pieces.share * slave.weights[pieces.slave])[:, None] * portion
    points = np.einsum("kqb,kbd->kqd", on_slave, mesh.points[slave.facets[pieces.slave]])
    return _Rule(on_slave, on_master, weight * body.measure(points))


def _turned(mesh: Mesh, pieces: Pairing) -> float:
    """The largest angle in degrees between facets that are nearer to each other than their size."""
    slave, master = pieces.sides[0].take(pieces.slave), pieces.sides[1].take(pieces.master)
    middle = [
        np.einsum("kc,kcd->kd", at.mean(axis=1), mesh.points[side.facets])
        for at, side in ((pieces.on_slave, slave), (pieces.on_master, master))
    ]
    far = np.abs(np.einsum("kd,kd->k", slave.normals, middle[1] - middle[0]))
    cosine = -np.einsum("kd,kd->k", slave.normals, master.normals)[far <= slave.widths]
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
