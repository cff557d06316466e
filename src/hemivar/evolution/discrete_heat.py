"""Thermomechanical coupling over a mesh: thermal stress, heat of friction, conductance of contact points."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from hemivar.basics.types import IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.thermal_stress import thermal_matrix
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import Heat
from hemivar.mesh.boundary_rule import boundary_rule

__all__ = ["coupling"]


def coupling(
    stated: ContactProblem, heat: Heat, problem: DiscreteProblem, moved: IntArray, exchanged: ContactPoints
) -> tuple[sp.csr_array, IntArray, sp.csr_array]:
    """Pull, partner and entering of :class:`hemivar.evolution.discrete.DiscreteHeat`.

    ``moved`` is (k,); ``exchanged`` are the contact points of the heat.
    """
    field = problem.field
    assert field is not None
    matrix = thermal_matrix(stated, heat)
    pull = sp.csr_array(sp.vstack([field.basis.T @ matrix, matrix[moved]]))
    return pull, _partners(heat, problem.contact, exchanged), _entering(stated, heat, problem.contact)


def _entering(stated: ContactProblem, heat: Heat, contact: ContactPoints) -> sp.csr_array:
    """Parts (nodes, m) of the heat of friction at contact points that go into the nodes.

    Both sides of a joint take theirs as they take its traction; at a node that belongs to both sides these cancel,
    and the others of the point take what is missing.
    """
    mesh, order = stated.mesh, stated.order
    entering = sp.csr_array((contact.count, len(mesh.nodes(order))))
    for name, one in heat.contact.items():
        if name not in contact.names:
            continue
        on = np.zeros(contact.count)
        on[contact.on(name)] = 1.0
        sides = contact.pairs.get(name, (name,))
        share = one.share if one.share is not None else 0.5 if len(sides) > 1 else 0.0
        assert contact.mean is not None
        rows = sp.csr_array(sp.diags_array(on) @ contact.mean)
        for side in sides if len(sides) > 1 else ():
            part = share if side == name else 1.0 - share
            inside = np.zeros(rows.shape[1])
            inside[np.unique(boundary_rule(mesh, side, order).nodes)] = 1.0
            entering = entering + part * _shared_out(sp.csr_array(rows @ sp.diags_array(inside)))
        if len(sides) == 1:
            entering = entering + share * rows
    entering.eliminate_zeros()
    return sp.csr_array(entering.T)


def _shared_out(rows: sp.csr_array) -> sp.csr_array:
    """Rows (m, nodes) times numbers that make each of them sum to one; empty ones stay."""
    sums = np.asarray(rows.sum(axis=1)).ravel()
    return sp.csr_array(sp.diags_array(np.where(sums == 0.0, 0.0, 1.0 / np.where(sums == 0.0, 1.0, sums))) @ rows)


def _partners(heat: Heat, contact: ContactPoints, exchanged: ContactPoints) -> IntArray:
    """Contact points of the body whose penetration and pressure the conductance is that of, (q,).

    That at the same node, of the same boundary if there is one; of two bodies none of another boundary.
    """
    point_at = np.full(int(max(contact.node.max(initial=-1), exchanged.node.max(initial=-1))) + 1, -1)
    point_at[contact.node] = np.arange(contact.count)
    partner = point_at[exchanged.node]
    for name, one in heat.contact.items():
        if not (one.depends_on_state and name in contact.names):
            continue
        index, own = exchanged.on(name), contact.on(name)
        here = np.full(point_at.size, -1) if name in contact.pairs else point_at.copy()
        here[contact.node[own]] = own
        partner[index] = here[exchanged.node[index]]
        alone = index[partner[index] < 0]
        if alone.size and own.size:
            assert exchanged.points is not None
            assert contact.points is not None
            _, nearest = cKDTree(contact.points[own]).query(exchanged.points[alone])
            partner[alone] = own[nearest]
    return partner
