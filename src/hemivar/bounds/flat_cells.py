"""Cells that are flat, or needles, and meshes on which those that matter are better.

Where loads and supports make the stress change over the height of flat cells, no stress that is in equilibrium on these
is near to it: a bound grows with their aspect, and the error does not.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, BoolArray
from hemivar.bounds.facet_table import FacetTable, facet_table
from hemivar.mesh.local_refinement import bisected
from hemivar.mesh.mesh import Mesh

__all__ = ["are_flat", "bettered", "largest_share"]

#: Lengths of cells over their heights from which on what the bound may be is reported, and those from which on better
#: cells are looked for, in the plane and in space.
_TOLD, _FLAT = 8.0, {2: 24.0, 3: 18.0}
#: That from which on they are halved.
_LONG = 5.0
#: How often cells are halved, and their parts.
_HALVINGS = 3
#: Part of the sum that the cells add which are halved, and how many these are at most, in the plane and in space.
_SHARE, _MOST = 0.6, {2: 500, 3: 60}


def are_flat(table: FacetTable) -> tuple[bool, bool]:
    """Whether some cells are flat enough for a word, and for a search for better ones."""
    worst = float(_flatness(table).max())
    return worst >= _TOLD, worst >= _FLAT[table.dim]


def _flatness(table: FacetTable) -> Array:
    """The longest edge of each cell over its least height, (M,)."""
    mesh = table.mesh
    ends = mesh.points[mesh.edges]
    longest = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[mesh.cell_edges].max(axis=1)
    return np.asarray(longest * table.measures[table.cell_facets].max(axis=1) / (table.dim * table.volumes))


def largest_share(added: Array, share: float) -> BoolArray:
    """The fewest cells that hold a share of the sum, and those that add as much as the last of them."""
    largest = -np.sort(-added)
    cumulative = np.cumsum(largest)
    last = largest[min(int(np.searchsorted(cumulative, share * cumulative[-1])), len(largest) - 1)]
    return np.asarray(added >= (1.0 - SAME) * last)


def bettered(table: FacetTable, added: Array) -> Mesh | None:
    """A mesh on which the long cells that add most, by what cells add (M,), are halved some times.

    None without such, or if they are many: in space a bound that is not sharp is better than one that takes minutes.
    """
    mesh, marked = table.mesh, largest_share(added, _SHARE) & (_flatness(table) > _LONG)
    if not 0 < np.count_nonzero(marked) <= _MOST[table.dim]:
        return None
    for _ in range(_HALVINGS):
        mesh, parent = bisected(mesh, marked)
        marked = marked[parent] & (_flatness(facet_table(mesh)) > _LONG)
        if not marked.any():
            break
    return mesh
