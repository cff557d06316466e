"""An order of the nodes in which neighbours are near each other: smoothers and memory work best so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import IntArray
from hemivar.linear.compiled import NodeSlots

__all__ = ["near_each_other"]

#: Nodes of a block of the smoother at least: fewer stand in one block in any order.
_FEW = 512
#: Mean distance of neighbours, as a part of the nodes, from which on they are scattered. Nodes by lines and planes stay
#: below a tenth; mesh generators, which begin with the boundary, and refinement lie at a fifth.
_SCATTERED = 0.1
#: Unknowns that are looked at.
_SAMPLE = 1000


def near_each_other(slots: NodeSlots, matrix: sp.csr_array) -> NodeSlots:
    """The same slots with the nodes in another order, by Cuthill and McKee, where the matrix couples distant ones.

    ``matrix (n, n)``: its pattern is symmetric.
    """
    node = slots.places // slots.size
    if slots.nodes <= _FEW or _mean_distance(node, matrix) <= _SCATTERED * slots.nodes:
        return slots
    with IMPORTS:
        from scipy.sparse.csgraph import reverse_cuthill_mckee

    member = sp.csr_array((np.ones(node.size), (node, np.arange(node.size))), shape=(slots.nodes, node.size))
    graph = sp.csr_array(member @ sp.csr_array((np.ones(matrix.nnz), matrix.indices, matrix.indptr)) @ member.T)
    number = np.empty(slots.nodes, dtype=np.int64)
    number[reverse_cuthill_mckee(graph, symmetric_mode=True)] = np.arange(slots.nodes)
    return replace(slots, places=number[node] * slots.size + slots.places % slots.size)


def _mean_distance(node: IntArray, matrix: sp.csr_array) -> float:
    """How far apart coupled nodes are in their order, on the average, seen from some of the rows."""
    step = max(1, matrix.shape[0] // _SAMPLE)
    rows = sp.csr_array(matrix[::step])
    own = np.repeat(node[::step], np.diff(rows.indptr))
    return float(np.abs(node[rows.indices] - own).mean()) if rows.nnz else 0.0
