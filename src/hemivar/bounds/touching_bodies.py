"""Bodies that touch one another, each in equilibrium under its own contact tractions.

The contact forces of a displacement are what balances it at the contact points.  On the side with the contact points
they are tractions ``sum psi_p t_p`` of the dual functions, on the other one their projection.  Both are replaced, facet
by facet, by the linear tractions with the same moments against the functions of the nodes, so that each part is in
equilibrium with them exactly.  An admissible stress of the parts under these tractions as loads then shows how far the
displacement is from that of each body under them.  What the law does between contact points is not seen.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array, IntArray
from hemivar.bounds.body_data import BodyData, body_data
from hemivar.bounds.joined_sides import joined_sides, touch
from hemivar.certificates.smallness import smallness
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.contact_points import pair_projection, shares
from hemivar.fem.discretize import discretize
from hemivar.fem.supports import stated_supports
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.boundary_rule import boundary_rule

__all__ = ["contact_moments", "on_facets", "refuse_touching", "shared_anew", "touching_bodies"]


def refuse_touching(problem: ContactProblem, reason: str = "") -> None:
    """Refuse quantities of interest of bodies that touch, but where facets coincide and there is no other reason."""
    if not touch(problem) or (joined_sides(problem) is not None and not reason):
        return
    why = reason or "the facets of these two do not coincide"
    raise ProblemError(
        "quantities of interest of bodies that touch are bounded where the distance to the exact solution is, and "
        f"{why}; give no goal, and that distance is estimated"
    )


def touching_bodies(problem: ContactProblem, displacement: Array) -> tuple[BodyData, float]:
    """The bodies without contact, under the contact tractions of a displacement, and the c of the discrete problem.

    Shapes: ``displacement`` (nodes, d). Returned: of a law that depends on the solution that with the state of this
    one; inf if the laws jump down.
    """
    discrete, forces = _contact_forces(problem, displacement)
    data = body_data(replace(problem, contact={}), displacement)
    law = discrete.law.frozen(
        discrete.local(_unknowns(discrete, displacement)), forces / discrete.contact.weights[:, None]
    )
    return data.under(on_facets(data, problem, discrete.contact, forces)), _constant(discrete.with_(law=law))


def contact_moments(data: BodyData) -> Array:
    """Moments (F, l, d) of the contact tractions of a displacement, opposite on both sides where two bodies touch.

    The bodies of the data are in equilibrium with them.
    """
    discrete, forces = _contact_forces(data.problem, data.displacement)
    return on_facets(data, data.problem, discrete.contact, forces)


def shared_anew(data: BodyData, moments: Array, wanted: Array) -> Array:
    """Contact moments (F, l, d) near to wanted ones that leave the same force to each node of each contact.

    What the node lacks of it is shared among the facets of this contact there, in proportion to their size.  So what is
    opposite on both sides stays so.
    """
    out = np.zeros_like(moments)
    for number in range(len(data.problem.contact)):
        facets = np.flatnonzero(data.contact == number)
        nodes, measures = data.facet_nodes[facets], data.table.measures[facets]
        lack, size = np.zeros(data.displacement.shape), np.zeros(len(data.displacement))
        np.add.at(lack, nodes, moments[facets] - wanted[facets])
        np.add.at(size, nodes, measures[:, None])
        out[facets] = wanted[facets] + (measures[:, None] / size[nodes])[:, :, None] * lack[nodes]
    return out


def on_facets(data: BodyData, problem: ContactProblem, contact: ContactPoints, forces: Array) -> Array:
    """Moments (F, l, d) of local forces (m, d) of contact points on the facets of the data.

    Where two bodies touch along one facet of the data, those of its first side are the moments.
    """
    on_all, joined = np.zeros(data.facet_loads.shape), bool(data.table.cut.any())
    for boundary, moments in _moments(problem, contact, contact.global_vectors(forces), joined):
        rule = boundary_rule(problem.mesh, boundary, problem.order)
        nodes, number = rule.nodes, data.table.numbers(rule.facets)
        ours, theirs = np.argsort(data.facet_nodes[number], axis=1), np.argsort(nodes, axis=1)
        np.subtract.at(on_all, (number[:, None], ours), np.take_along_axis(moments, theirs[:, :, None], axis=1))
    return on_all


def _constant(discrete: DiscreteProblem) -> float:
    """c of the mesh; nothing softens where it is 0, whatever holds the bodies."""
    normal, tangential = discrete.law.weak_convexity
    if not ((normal > 0.0).any() or (tangential > 0.0).any()):
        return 0.0
    return smallness(discrete, trace_constant=False).constant


def _unknowns(discrete: DiscreteProblem, displacement: Array) -> Array:
    assert discrete.field is not None
    return np.asarray(discrete.field.restrict(displacement))


def _contact_forces(problem: ContactProblem, displacement: Array) -> tuple[DiscreteProblem, Array]:
    """Local forces (m, d) on the foundation, or of one side on the other, that balance a displacement (nodes, d)."""
    discrete = discretize(problem, check_coercivity=False)
    contact, u = discrete.contact, _unknowns(discrete, displacement)
    rows = np.flatnonzero(np.diff(contact.trace.indptr) > 0)
    seen = sp.csr_array(contact.trace[rows])
    forces = np.zeros(contact.trace.shape[0])
    forces[rows] = spla.splu(sp.csc_array(seen @ seen.T)).solve(seen @ discrete.out_of_balance(u))
    return discrete, forces.reshape(contact.shape)


def _moments(
    problem: ContactProblem, contact: ContactPoints, forces: Array, joined: bool
) -> Iterator[tuple[str, Array]]:
    """Moments (f, n, d) of these forces (m, d) on the facets of each boundary that touches.

    Of two boundaries that are ``joined`` those on the one with the contact points.
    """
    nodes, supports = len(problem.mesh.nodes(problem.order)), stated_supports(problem)
    for number, (name, stated) in enumerate(problem.contact.items()):
        on = np.flatnonzero(contact.boundary == number)
        if stated.against:
            projection, _ = pair_projection(problem, name, supports)
            at_nodes = _at(nodes, contact, on, forces)[projection.nodes]
            both = zip(problem.pair(name), projection.moments(at_nodes), strict=True)
            yield from islice(both, 1 if joined else 2)
            continue
        alone = np.flatnonzero([not problem.contact[contact.names[k]].against for k in contact.boundary])
        density = _at(nodes, contact, alone, forces / contact.weights[:, None])
        density[contact.node[on]] = (forces / contact.weights[:, None])[on]
        rule = boundary_rule(problem.mesh, name, problem.order)
        yield name, shares(problem.order, problem.mesh.dim)[:, None] * rule.weights[:, None, None] * density[rule.nodes]


def _at(nodes: int, contact: ContactPoints, points: IntArray, values: Array) -> Array:
    """Values (m, d) of some contact points, by node."""
    if (contact.node[points] < 0).any():
        raise ProblemError("contact tractions of bodies that touch are known for quadrature at the nodes")
    at_nodes = np.zeros((nodes, values.shape[1]))
    at_nodes[contact.node[points]] = values[points]
    return at_nodes
