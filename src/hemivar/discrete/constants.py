"""The motions without energy of one component: constants on parts that no support holds."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from hemivar.discrete.rigid_modes import Mechanism, RigidModes
from hemivar.mesh.mesh import Mesh

__all__ = ["free_constants"]


def free_constants(mesh: Mesh, basis: sp.csr_array) -> RigidModes:
    """Constants on what hangs together, be it at one node only, and is held at none: the kernel of a gradient.

    ``basis (nodes, n)`` is that of :class:`hemivar.discrete.Field`.
    """
    size = basis.shape[0]
    low, high = mesh.edges.T
    graph = sp.csr_array((np.ones(len(low), dtype=np.int8), (low, high)), shape=(mesh.number_of_nodes,) * 2)
    count, label = connected_components(graph, directed=False)
    label = np.concatenate([label, label[low]])[:size]  # nodes of order 2 lie on edges
    held = np.zeros(count, dtype=bool)
    held[label[np.diff(basis.indptr) == 0]] = True
    groups, entries = [], []
    for number, piece in enumerate(np.flatnonzero(~held)):
        parts = np.unique(mesh.parts.cell[label[mesh.cells[:, 0]] == piece])
        coefficients, none = np.ones((len(parts), 1, 1)), np.zeros(0, dtype=np.int64)
        groups.append(Mechanism(parts, slice(number, number + 1), coefficients, none))
        entries.append(np.flatnonzero(label == piece))
    rows = np.concatenate([np.zeros(0, dtype=np.int64), *entries])
    columns = np.repeat(np.arange(len(entries)), [len(one) for one in entries])
    motions = sp.csc_array((np.ones(len(rows)), (rows, columns)), shape=(size, len(entries)))
    return RigidModes(motions, tuple(groups), mesh.parts)
