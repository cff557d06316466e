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

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from hemivar.basics.types import Array, IntArray
from hemivar.certificates.continuous.body_data import BodyData, body_data
from hemivar.certificates.smallness import smallness
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.fem.contact_points import pair_projection, shares
from hemivar.fem.discretize import discretize
from hemivar.fem.supports import stated_supports
from hemivar.mechanics.statement import ContactProblem

__all__ = ["refuse_touching", "touch", "touching_bodies"]


def touch(problem: ContactProblem) -> bool:
    """Whether there is contact of two bodies."""
    return any(contact.against for contact in problem.contact.values())


def refuse_touching(problem: ContactProblem) -> None:
    """Refuse quantities of interest of bodies that touch.

    Raises
    ------
    ProblemError
    """
    if touch(problem):
        raise ProblemError(
            "quantities of interest are bounded for bodies on foundations, and these touch one another; give no goal, "
            "and the distance to the exact solution is estimated"
        )


def touching_bodies(problem: ContactProblem, displacement: Array) -> tuple[BodyData, float]:
    """The bodies without contact, under the contact tractions of a displacement, and the c of the discrete problem.

    Parameters
    ----------
    problem : ContactProblem
    displacement : array, shape (nodes, d)
        That of a solution of the discrete problem.

    Returns
    -------
    BodyData
    float
        Of a law that depends on the solution that with the state of this one; inf if the laws jump down.
    """
    discrete = discretize(problem, check_coercivity=False)
    data = body_data(replace(problem, contact={}), displacement)
    assert discrete.field is not None
    u, contact = discrete.field.restrict(displacement), discrete.contact
    forces = _contact_forces(discrete, u)
    loads = data.facet_loads.copy()
    for boundary, moments in _moments(problem, contact, contact.global_vectors(forces)):
        table, nodes = data.table, problem.mesh.facet_nodes(problem.mesh.boundaries[boundary], problem.order)
        number = table.numbers(problem.mesh.boundaries[boundary])
        ours, theirs = np.argsort(data.facet_nodes[number], axis=1), np.argsort(nodes, axis=1)
        np.subtract.at(loads, (number[:, None], ours), np.take_along_axis(moments, theirs[:, :, None], axis=1))
    law = discrete.law.frozen(discrete.local(u), forces / contact.weights[:, None])
    return replace(data, facet_loads=loads), _constant(discrete.with_(law=law))


def _constant(discrete: DiscreteProblem) -> float:
    """c of the mesh; nothing softens where it is 0, whatever holds the bodies."""
    normal, tangential = discrete.law.weak_convexity
    if not ((normal > 0.0).any() or (tangential > 0.0).any()):
        return 0.0
    return smallness(discrete, trace_constant=False).constant


def _contact_forces(discrete: DiscreteProblem, u: Array) -> Array:
    """Local forces (m, d) on the foundation, or of one side on the other, that balance unknowns (n,)."""
    contact = discrete.contact
    rows = np.flatnonzero(np.diff(contact.trace.indptr) > 0)
    seen = sp.csr_array(contact.trace[rows])
    found = np.zeros(contact.trace.shape[0])
    found[rows] = spla.splu(sp.csc_array(seen @ seen.T)).solve(seen @ discrete.out_of_balance(u))
    return found.reshape(contact.shape)


def _moments(problem: ContactProblem, contact: ContactPoints, forces: Array) -> Iterator[tuple[str, Array]]:
    """Moments (f, n, d) of these forces (m, d) on the facets of each boundary that touches."""
    nodes, supports = len(problem.mesh.nodes(problem.order)), stated_supports(problem)
    for number, (name, stated) in enumerate(problem.contact.items()):
        on = np.flatnonzero(contact.boundary == number)
        if stated.against:
            found, _ = pair_projection(problem, name, supports)
            yield from zip(problem.pair(name), found.moments(_at(nodes, contact, on, forces)[found.nodes]), strict=True)
            continue
        alone = np.flatnonzero([not problem.contact[contact.names[k]].against for k in contact.boundary])
        density = _at(nodes, contact, alone, forces / contact.weights[:, None])
        density[contact.node[on]] = (forces / contact.weights[:, None])[on]
        facets = problem.mesh.boundaries[name]
        measures = problem.mesh.facet_normals(facets)[1]
        share = shares(problem.order, problem.mesh.dim)[:, None] * measures[:, None, None]
        yield name, share * density[problem.mesh.facet_nodes(facets, problem.order)]


def _at(nodes: int, contact: ContactPoints, points: IntArray, values: Array) -> Array:
    """Values (m, d) of some contact points, by node."""
    if (contact.node[points] < 0).any():
        raise ProblemError("contact tractions of bodies that touch are known for quadrature at the nodes")
    found = np.zeros((nodes, values.shape[1]))
    found[contact.node[points]] = values[points]
    return found
