"""The heat of a body over its mesh: how it is coupled with the motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.thermal_stress import thermal_matrix
from hemivar.laws import ContactLaw, PiecewiseQuadratic, VectorLaw
from hemivar.laws.coupled import join_laws
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import Heat

if TYPE_CHECKING:
    from hemivar.evolution.discrete import DiscreteEvolution

__all__ = ["DiscreteHeat", "coupled_heat"]


@dataclass(frozen=True, eq=False)
class DiscreteHeat(PickleMixin):
    """Heat over the mesh of a body."""

    heat: Heat
    #: Of heat alone.
    conduction: DiscreteEvolution
    #: Force of nodal temperatures on the unknowns and on the prescribed displacements.
    pull: sp.csr_array  # (n + k, nodes)
    #: Contact point of the body at each contact point of the heat. A node that supports hold altogether is none: it has
    #: the nearest one of the boundary if the conductance there asks for it, and else -1.
    partner: IntArray  # (q,)
    #: Parts of the heat of friction at the contact points of the body that go into the nodes.
    entering: sp.csr_array  # (nodes, m)

    @property
    def fed_back(self) -> bool:
        """Whether the motion says something to the heat."""
        heat = self.heat
        dependent = any(one.depends_on_state for one in heat.contact.values())
        return dependent or bool(heat.coupling and heat.stresses) or self.entering.nnz > 0

    def load(self, temperature: Array) -> Array:
        """Force (n + k,) of nodal temperatures (nodes,)."""
        return np.asarray(self.pull @ (temperature - self.heat.stress_free))

    def temperature(self, place: Array) -> Array:
        """Nodal temperatures (nodes,) of unknowns and prescribed temperatures."""
        return self.conduction.full(place)[:, 0]

    def rubbed(self, heat: Array) -> Array:
        """Nodal heat (nodes,) of heat that friction makes at the contact points of the body (m,)."""
        return np.asarray(self.entering @ heat)

    def deformed(self, change: Array) -> Array:
        """Nodal heat (nodes,) that a change (n + k,) of the displacement makes."""
        return np.asarray(-self.heat.coupling * (self.pull.T @ change))

    def law(self, stated: VectorLaw, penetration: Array, pressure: Array) -> VectorLaw:
        """The exchange of heat where the body has penetration and pressure (m,)."""
        here = self.partner >= 0
        parts: list[tuple[VectorLaw, int]] = []
        for name, index in self.conduction.blocks:
            one = self.heat.contact[name]
            if not one.depends_on_state:
                parts.append((stated.take(index), index.size))
                continue
            met = here[index]
            r, p = np.zeros(index.size), np.zeros(index.size)
            r[met], p[met] = penetration[self.partner[index[met]]], pressure[self.partner[index[met]]]
            h = np.where(met, one.conductances(r, p), 0.0)[:, None]
            zero = np.zeros_like(h)
            law = PiecewiseQuadratic(zero, np.hstack([h, h]), zero, name="conductance")
            parts.append((ContactLaw(law).at(None), index.size))
        return join_laws(parts) if parts else stated


def coupled_heat(
    stated: ContactProblem, heat: Heat, problem: DiscreteProblem, moved: IntArray, conduction: DiscreteEvolution
) -> DiscreteHeat:
    """The heat of a body.

    ``moved`` is (k,).
    """
    field = problem.field
    assert field is not None
    matrix = thermal_matrix(stated, heat)
    pull = sp.csr_array(sp.vstack([field.basis.T @ matrix, matrix[moved]]))
    contact, exchanged = problem.contact, conduction.problem.contact
    return DiscreteHeat(heat, conduction, pull, _partners(heat, contact, exchanged), _entering(stated, heat, contact))


def _entering(stated: ContactProblem, heat: Heat, contact: ContactPoints) -> sp.csr_array:
    """Parts (nodes, m) of the heat of friction at contact points that go into the nodes.

    Both sides of a joint take theirs as they take its traction; at a node that belongs to both sides these cancel,
    and the others of the point take what is missing.
    """
    mesh, order = stated.mesh, stated.order
    found = sp.csr_array((contact.count, len(mesh.nodes(order))))
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
            inside[np.unique(mesh.facet_nodes(mesh.boundaries[side], order))] = 1.0
            found = found + part * _shared_out(sp.csr_array(rows @ sp.diags_array(inside)))
        if len(sides) == 1:
            found = found + share * rows
    found.eliminate_zeros()
    return sp.csr_array(found.T)


def _shared_out(rows: sp.csr_array) -> sp.csr_array:
    """Rows (m, nodes) times numbers that make each of them sum to one; empty ones stay."""
    sums = np.asarray(rows.sum(axis=1)).ravel()
    return sp.csr_array(sp.diags_array(np.where(sums == 0.0, 0.0, 1.0 / np.where(sums == 0.0, 1.0, sums))) @ rows)


def _partners(heat: Heat, contact: ContactPoints, exchanged: ContactPoints) -> IntArray:
    """Contact points of the body whose penetration and pressure the conductance is that of, (q,).

    That at the same node, of the same boundary if there is one; of two bodies none of another boundary.
    """
    place = np.full(int(max(contact.node.max(initial=-1), exchanged.node.max(initial=-1))) + 1, -1)
    place[contact.node] = np.arange(contact.count)
    partner = place[exchanged.node]
    for name, one in heat.contact.items():
        if not (one.depends_on_state and name in contact.names):
            continue
        index, own = exchanged.on(name), contact.on(name)
        here = np.full(place.size, -1) if name in contact.pairs else place.copy()
        here[contact.node[own]] = own
        partner[index] = here[exchanged.node[index]]
        alone = index[partner[index] < 0]
        if alone.size and own.size:
            assert exchanged.points is not None
            assert contact.points is not None
            _, nearest = cKDTree(contact.points[own]).query(exchanged.points[alone])
            partner[alone] = own[nearest]
    return partner
