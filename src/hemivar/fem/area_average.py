"""Forces of a contact over an area for output: averages over cells, in place of values at single nodes.

A force at a node is exact in the mean only.  Where nodes of a mesh differ in their cells, as the corners and the
middles of a crossed mesh do, values jump from one to the next however fine the mesh is.  Their mean over a cell is the
force per area, and so are averages of these means; they add up to the same resultant.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.mesh.mesh import Mesh

__all__ = ["area_average", "over_area"]


def over_area(problem: DiscreteProblem) -> BoolArray:
    """Which contact points belong to a contact over an area, (m,)."""
    contact, stated, field = problem.contact, problem.origin, problem.field
    areas = set(stated.areas) if stated else set()
    if stated is None and field is not None:
        areas = set(field.mesh.regions) - set(field.mesh.boundaries)
    over = np.isin(contact.boundary, [k for k, name in enumerate(contact.names) if name in areas])
    return np.asarray(over & (contact.node >= 0))


def area_average(problem: DiscreteProblem, values: Array) -> Array:
    """Values at contact points (m, ...), over areas averaged twice: over the nodes of each cell, and over cells.

    Shapes: ``values`` (m,) or (m, k).
    """
    stated, contact, averaged = problem.origin, problem.contact, values.copy()
    if stated is None:
        return averaged
    for name, cells in stated.areas.items():
        points = contact.on(name)
        averaged[points] = _averaged(stated.mesh, cells, contact.node[points], values[points])
    return averaged


def _averaged(mesh: Mesh, cells: IntArray, nodes: IntArray, values: Array) -> Array:
    """Values (p,) or (p, k) at nodes (p,), averaged over the nodes of each cell that has one, and over the cells at
    each node."""
    if values.ndim == 2:
        return np.column_stack([_averaged(mesh, cells, nodes, column) for column in values.T])
    known, at = np.zeros(mesh.number_of_nodes), np.zeros(mesh.number_of_nodes)
    known[nodes], at[nodes] = 1.0, values
    members, count = mesh.cells[cells], mesh.number_of_nodes
    there = known[members].sum(axis=1)
    size = mesh.volumes[cells] * (there > 0.0)
    mean = at[members].sum(axis=1) / np.maximum(there, 1.0)
    corners = members.shape[1]
    total, whole = (np.bincount(members.ravel(), np.repeat(part, corners), count) for part in (size * mean, size))
    return np.asarray(total[nodes] / whole[nodes])
