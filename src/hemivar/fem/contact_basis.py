"""The basis in which contact sees a displacement of order 2 in space.

The integrals of the quadratic functions of the corners of a triangle vanish.  With a part of those of the middles
beside, ``phi_v + alpha sum phi_e`` at corners and ``(1 - 2 alpha) phi_e`` at middles, all are positive (Popp, Wohlmuth,
Gitterle, Wall, Dual quadratic mortar finite element methods for 3D finite deformation contact, 2012).  The functions
span the same space and sum to one.  The value that belongs to a corner is that of the field; to the middle of an edge
ab belongs ``(u_e - alpha (u_a + u_b)) / (1 - 2 alpha)``, which is the value of a linear field there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.mechanics.kinematics import BodyKinematics
from hemivar.mechanics.statement import Quadrature
from hemivar.mesh.boundary_rule import BoundaryRule
from hemivar.mesh.mesh import Mesh

__all__ = [
    "contact_shapes",
    "contact_weights",
    "lagrange_moments",
    "nodal_depths",
    "nodal_values",
    "seen_gap",
    "seen_values",
]

#: Share of a weight in that of facets at the largest radius that is rounding.
_NONE = 1e-9
#: With it the weight of a corner is 2/15 of the triangle, and that of a middle 1/5.
_ALPHA = 0.2
#: How far a gap may be off the parabola of an edge, of the second difference there: less than at a kink or a step.
_PARABOLA = 1.0 / 16.0
#: The parabola through end, middle and end at the quarters of an edge.
_QUARTERS = np.array([[0.375, 0.75, -0.125], [-0.125, 0.75, 0.375]])
#: The functions of contact by those of Lagrange, vertices first, then the edges 01, 12 and 02.
_CHANGE = np.block(
    [
        [np.eye(3), _ALPHA * np.array([[1.0, 0.0, 1.0], [1.0, 1.0, 0.0], [0.0, 1.0, 1.0]])],
        [np.zeros((3, 3)), (1.0 - 2.0 * _ALPHA) * np.eye(3)],
    ]
)


def contact_shapes(order: int, barycentric: Array) -> Array:
    """Functions on facets by which contact is integrated, of positive integrals; vertices, then edges.

    Shapes: ``barycentric`` (..., d); returns (..., L).
    """
    shapes = shape_values(order, barycentric)
    return shapes @ _CHANGE.T if shapes.shape[-1] == len(_CHANGE) else shapes


def contact_weights(mesh: Mesh, rule: BoundaryRule, body: BodyKinematics) -> tuple[Array, BoolArray]:
    """Integrals (N,) of the functions of contact over a boundary, by node; and which of them are no more than rounding.

    None they are away from it, and on the axis of a body of revolution: at corners of quadratic facets, and at those of
    facets along it.
    """
    barycentric, weights = quadrature_rule(mesh.dim - 1, rule.order + body.ring)
    points = np.einsum("qc,fcd->fqd", barycentric, mesh.points[rule.facets])
    parts = (body.measure(points) * weights) @ contact_shapes(rule.order, barycentric)
    count = mesh.number_of_nodes + (len(mesh.edges) if rule.order == 2 else 0)
    size, own = np.zeros(count), np.zeros(count)
    np.add.at(size, rule.nodes, rule.weights[:, None])
    np.add.at(own, rule.nodes, rule.weights[:, None] * parts)
    return own, np.asarray(own <= _NONE * float(body.measure(mesh.points).max()) * size)


def lagrange_moments(moments: Array) -> Array:
    """Integrals against the functions of Lagrange by those against these functions, (..., L)."""
    return moments @ np.linalg.inv(_CHANGE).T if moments.shape[-1] == len(_CHANGE) else moments


def nodal_values(mesh: Mesh, order: int, nodes: IntArray, seen: Array) -> Array:
    """A field at nodes (k, ...) by the values seen there; these where an end of the edge is not among the nodes."""
    field, (at, ends) = seen.copy(), _middles(mesh, order, nodes)
    field[at] = (1.0 - 2.0 * _ALPHA) * seen[at] + _ALPHA * seen[ends].sum(axis=1)
    return field


def nodal_depths(problem: DiscreteProblem, seen: Array) -> Array:
    """Penetrations or gaps (m, ...) at the nodes of the contact points of a problem, by those that contact sees."""
    stated, contact = problem.origin, problem.contact
    if stated is None or stated.order == 1 or stated.mesh.dim == 2 or stated.quadrature is not Quadrature.NODAL:
        return seen
    depths = seen.copy()
    for number in np.unique(contact.boundary):
        at = np.flatnonzero(contact.boundary == number)
        depths[at] = nodal_values(stated.mesh, stated.order, contact.node[at], seen[at])
    return depths


def seen_gap(
    mesh: Mesh, order: int, nodes: IntArray, alone: BoolArray, gap: Array, places: Array, gaps: Callable[[Array], Array]
) -> Array:
    """Gaps (k,) in the basis of contact by those at nodes (k,), so that a body that fills the gap touches at all nodes.

    So it is along edges where the gap is near its parabola.  Elsewhere, as at steps and where an end is beside the
    obstacle, it stays the one at the node: the change would be an interference where one end is far from the body.
    So it does where contact sees the node ``alone (k,)``.  ``gaps`` gives those at other ``places``, of which there is
    a row for each node.
    """
    seen, (at, ends) = gap.copy(), _middles(mesh, order, nodes)
    edges = np.column_stack([ends[:, 0], at, ends[:, 1]])
    edges = edges[np.isfinite(gap[edges]).all(axis=1) & ~alone[at]]
    bend = gap[edges] @ [1.0, -2.0, 1.0]
    edges, bend = edges[bend != 0.0], bend[bend != 0.0]
    if bend.size:
        between = np.einsum("qn,end->qed", _QUARTERS, places[edges])
        off = [np.abs(gaps(one) - gap[edges] @ part) for one, part in zip(between, _QUARTERS, strict=True)]
        bend[np.max(off, axis=0) > _PARABOLA * np.abs(bend)] = 0.0
        seen[edges[:, 1]] -= _ALPHA / (1.0 - 2.0 * _ALPHA) * bend
    return seen


def _middles(mesh: Mesh, order: int, nodes: IntArray) -> tuple[IntArray, IntArray]:
    """Places among nodes (k,) of middles of edges, and those of their ends (m, 2), where these are among them."""
    if order == 1 or mesh.dim == 2:
        return np.zeros(0, dtype=np.int64), np.zeros((0, 2), dtype=np.int64)
    number = np.full(mesh.number_of_nodes + len(mesh.edges), -1)
    number[nodes] = np.arange(len(nodes))
    middle = np.flatnonzero(nodes >= mesh.number_of_nodes)
    ends = number[mesh.edges[nodes[middle] - mesh.number_of_nodes]]
    both = (ends >= 0).all(axis=1)
    return middle[both], ends[both]


def seen_values(mesh: Mesh, order: int, nodes: IntArray) -> sp.csr_array:
    """The matrix (k, all nodes) from a field to the values that belong to these functions at k of the nodes."""
    count = mesh.number_of_nodes + (len(mesh.edges) if order == 2 else 0)
    rows, columns, data = np.arange(len(nodes)), nodes, np.ones(len(nodes))
    if order == 2 and mesh.dim == 3:
        middle = np.flatnonzero(nodes >= mesh.number_of_nodes)
        ends = mesh.edges[nodes[middle] - mesh.number_of_nodes]
        data[middle] /= 1.0 - 2.0 * _ALPHA
        rows, columns = np.append(rows, np.repeat(middle, 2)), np.append(columns, ends.ravel())
        data = np.append(data, np.full(ends.size, -_ALPHA / (1.0 - 2.0 * _ALPHA)))
    return sp.csr_array(sp.coo_array((data, (rows, columns)), shape=(len(nodes), count)))
