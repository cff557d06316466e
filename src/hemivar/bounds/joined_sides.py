"""Bodies that touch along facets that coincide, as those of an interface that was opened do."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import IntArray
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.keys import facet_keys
from hemivar.mesh.mesh import Mesh

__all__ = ["joined_sides", "touch"]


def touch(problem: ContactProblem) -> bool:
    """Whether there is contact of two bodies."""
    return any(contact.against for contact in problem.contact.values())


def joined_sides(problem: ContactProblem) -> tuple[IntArray, IntArray] | None:
    """One number for all nodes at a place (N,), and the facets (k, d) of the bodies that are touched.

    None where no body touches another one, or where the facets of two that do are not the same.
    """
    pairs = [problem.pair(name) for name, contact in problem.contact.items() if contact.against]
    if not pairs:
        return None
    mesh, joined = problem.mesh, []
    for slave, master in pairs:
        nodes = _nodes_at_one_place(mesh, mesh.boundaries[slave], mesh.boundaries[master])
        if nodes is None:
            return None
        joined.append(nodes)
    ends, count = np.concatenate(joined), mesh.number_of_nodes
    graph = sp.coo_array((np.ones(len(ends)), ends.T), shape=(count, count))
    places = sp.csgraph.connected_components(graph, directed=False)[1]
    return np.asarray(places, dtype=np.int64), np.concatenate([mesh.boundaries[master] for _, master in pairs])


def _nodes_at_one_place(mesh: Mesh, slave: IntArray, master: IntArray) -> IntArray | None:
    """Pairs (k, 2) of the nodes of two boundaries; None where their facets are not the same."""
    if len(slave) != len(master):
        return None
    ours, theirs = np.unique(slave), np.unique(master)
    with IMPORTS:
        from scipy.spatial import cKDTree
    distance, nearest = cKDTree(mesh.points[theirs]).query(mesh.points[ours])
    if np.max(distance) > ROUNDED * float(np.ptp(mesh.points, axis=0).max()):
        return None
    seen = np.arange(mesh.number_of_nodes)
    seen[ours] = theirs[nearest]
    mine, others = (np.sort(facet_keys(facets, len(seen))) for facets in (seen[slave], master))
    return np.column_stack([ours, theirs[nearest]]) if np.array_equal(mine, others) else None
