"""Local refinement that leaves facets along which bodies touch the same on both sides.

Cells on one side are cut and those on the other need not be: no node joins them.  A node of one side without one on the
other is the middle of an edge there; the cells at this edge are refined, until both sides are the same again.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import BoolArray, IntArray
from hemivar.bounds.facet_table import facet_table
from hemivar.bounds.joined_sides import joined_sides
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.keys import EDGES
from hemivar.mesh.mesh import Mesh

__all__ = ["refined_alike"]

#: How often cells on the other side are refined: closures are taken back first, and what they bring follows.
_ROUNDS = 20


def refined_alike(problem: ContactProblem, cells: BoolArray) -> Mesh:
    """The mesh of a problem with cells (M,) refined, and others where bodies touch along facets that coincide."""
    mesh = problem.mesh.refined_where(cells)
    if joined_sides(problem) is None:
        return mesh
    pairs = [problem.pair(name) for name, contact in problem.contact.items() if contact.against]
    for _ in range(_ROUNDS):
        behind = np.unique(np.concatenate([_behind(mesh, *sides) for one in pairs for sides in (one, one[::-1])]))
        if not behind.size:
            break
        mesh = mesh.refined_where(behind)
    return mesh


def _behind(mesh: Mesh, fine: str, coarse: str) -> IntArray:
    """The cells at facets of a boundary with an edge that is cut on the other one."""
    with IMPORTS:
        from scipy.spatial import cKDTree
    near = SAME * float(np.ptp(mesh.points, axis=0).max())
    facets = mesh.boundaries[coarse]
    own, nodes = mesh.points[np.unique(facets)], mesh.points[np.unique(mesh.boundaries[fine])]
    alone = nodes[cKDTree(own).query(nodes)[0] > near]
    if not len(alone):
        return np.zeros(0, dtype=np.int64)
    edges = ((0, 1),) if mesh.dim == 2 else EDGES[2]
    middles = np.stack([mesh.points[facets[:, edge]].mean(axis=1) for edge in edges], axis=1)
    cut = cKDTree(alone).query(middles.reshape(-1, mesh.dim))[0].reshape(len(facets), -1).min(axis=1) <= near
    table = facet_table(mesh)
    return np.asarray(table.owners[table.numbers(facets[cut]), 0])
