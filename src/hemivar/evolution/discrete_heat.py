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
    #: Part of the heat of friction that goes into the body, at the contact points of the body.
    share: Array  # (m,)
    #: Nodes of the contact points of the body.
    node: IntArray  # (m,)

    def load(self, temperature: Array) -> Array:
        """Force (n + k,) of nodal temperatures (nodes,)."""
        return np.asarray(self.pull @ (temperature - self.heat.stress_free))

    def temperature(self, place: Array) -> Array:
        """Nodal temperatures (nodes,) of unknowns and prescribed temperatures."""
        return self.conduction.full(place)[:, 0]

    def rubbed(self, heat: Array) -> Array:
        """Nodal heat (nodes,) of heat that friction makes at the contact points of the body (m,)."""
        nodes = self.conduction.field.basis.shape[0]
        return np.asarray(np.bincount(self.node, weights=self.share * heat, minlength=nodes), dtype=float)

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
    place = np.full(field.basis.shape[0] // field.components, -1)
    place[contact.node] = np.arange(contact.node.size)
    share = np.zeros(contact.count)
    for name, one in heat.contact.items():
        if name in contact.names:
            share[contact.on(name)] = one.share
    return DiscreteHeat(heat, conduction, pull, _partners(heat, contact, exchanged, place), share, contact.node)


def _partners(heat: Heat, contact: ContactPoints, exchanged: ContactPoints, place: IntArray) -> IntArray:
    """Contact points of the body whose penetration and pressure the conductance is that of, (q,)."""
    partner = place[exchanged.node]
    for name, one in heat.contact.items():
        if not (one.depends_on_state and name in contact.names):
            continue
        index, own = exchanged.on(name), contact.on(name)
        alone = index[partner[index] < 0]
        if alone.size and own.size:
            assert exchanged.points is not None
            assert contact.points is not None
            _, nearest = cKDTree(contact.points[own]).query(exchanged.points[alone])
            partner[alone] = own[nearest]
    return partner
