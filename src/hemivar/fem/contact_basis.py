"""The basis in which contact sees a displacement of order 2 in space.

The integrals of the quadratic functions of the corners of a triangle vanish.  With a part of those of the middles
beside, ``phi_v + alpha sum phi_e`` at corners and ``(1 - 2 alpha) phi_e`` at middles, all are positive (Popp, Wohlmuth,
Gitterle, Wall, Dual quadratic mortar finite element methods for 3D finite deformation contact, 2012).  The functions
span the same space and sum to one.  The value that belongs to a corner is that of the field; to the middle of an edge
ab belongs ``(u_e - alpha (u_a + u_b)) / (1 - 2 alpha)``, which is the value of a linear field there.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.fem.elements import shape_values
from hemivar.mesh.mesh import Mesh

__all__ = ["contact_shapes", "lagrange_moments", "nodal_values", "seen_values"]

#: With it the weight of a corner is 2/15 of the triangle, and that of a middle 1/5.
_ALPHA = 0.2
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


def lagrange_moments(moments: Array) -> Array:
    """Integrals against the functions of Lagrange by those against these functions, (..., L)."""
    return moments @ np.linalg.inv(_CHANGE).T if moments.shape[-1] == len(_CHANGE) else moments


def nodal_values(mesh: Mesh, order: int, nodes: IntArray, seen: Array) -> Array:
    """A field at nodes (k,) by the values (k,) seen there; these where an end of the edge is not among the nodes."""
    found, place = seen.copy(), np.full(len(mesh.nodes(order)), -1)
    if order == 2 and mesh.dim == 3:
        place[nodes] = np.arange(len(nodes))
        middle = np.flatnonzero(nodes >= mesh.number_of_nodes)
        ends = place[mesh.edges[nodes[middle] - mesh.number_of_nodes]]
        both = (ends >= 0).all(axis=1)
        at = middle[both]
        found[at] = (1.0 - 2.0 * _ALPHA) * seen[at] + _ALPHA * seen[ends[both]].sum(axis=1)
    return found


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
