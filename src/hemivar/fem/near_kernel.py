"""Near-nullspace (rigid motions) and nodal blocks of the unknowns, of which smoothed aggregation makes its levels."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.rigid_modes import rigid_basis
from hemivar.discrete.space import Field
from hemivar.linear.algebraic import NodeSlots, near_each_other

__all__ = ["near_kernel", "node_slots", "rigid_motions"]


def rigid_motions(field: Field) -> Array:
    """Unknowns of the rigid translations and rotations, scaled to size one, shape (n, 3 or 6); jumps as if the slave
    moved alone."""
    motions, _ = rigid_basis(field.nodes)
    return np.asarray(field.own.T @ motions)


def near_kernel(field: Field | None) -> Array | None:
    """Unknowns (n, q) of the rigid motions, whatever the supports; None where the unknowns are no displacement."""
    return None if field is None or not field.moves else rigid_motions(field)


def node_slots(field: Field | None, stiffness: sp.csr_array) -> NodeSlots | None:
    """Where the unknowns of a field stand by nodes, coupled nodes near each other; None where there is no mesh."""
    if field is None or field.partial:
        return None
    basis, size = field.own, field.components
    node, component = np.divmod(basis.indices[basis.indptr[:-1]], size)
    used = np.zeros(basis.shape[0] // size, dtype=bool)
    used[node] = True
    number, signs = np.cumsum(used) - 1, None
    if basis.nnz > node.size:  # directions of a node that are turned: one after the other
        first = np.concatenate([[True], np.diff(node) != 0])
        component = np.arange(node.size) - np.maximum.accumulate(np.where(first, np.arange(node.size), 0))
    else:
        signs = np.sign(basis.data)
    slots = NodeSlots(number[node] * size + component, size, int(number[-1]) + 1, signs, _groups(field, node))
    return near_each_other(slots, stiffness)


def _groups(field: Field, node: IntArray) -> IntArray | None:
    """Of unknowns at nodes (n,) twice the number of the part, and one more for jumps; None where there are no jumps."""
    if field.own.nnz == field.basis.nnz:
        return None
    mesh, jumps = field.mesh, np.diff(field.lift.tocsr().indptr) > np.diff(field.own.indptr)
    part = np.zeros(field.number_of_nodes, dtype=np.int64)
    part[mesh.cell_nodes(field.order)] = mesh.parts.cell[:, None]
    return np.asarray(2 * part[node] + jumps)
