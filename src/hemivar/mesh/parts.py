"""Connected components of a body: cells that are joined through facets."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.mesh.keys import cell_parts

if TYPE_CHECKING:
    from hemivar.mesh.mesh import Mesh

__all__ = ["Parts", "parts_of"]


@dataclass(frozen=True, eq=False)
class Parts:
    """Cells of a mesh that are joined through facets."""

    count: int  # number of parts
    cell: IntArray  # (M,): the part of each cell

    def place(self, mesh: Mesh, part: int) -> Array:
        """A point inside a part: the middle of its largest cell, (d,)."""
        cells = np.flatnonzero(self.cell == part)
        largest = cells[int(np.argmax(mesh.volumes[cells]))]
        return np.asarray(mesh.points[mesh.cells[largest]].mean(axis=0))

    def name(self, mesh: Mesh, part: int) -> str | None:
        """The name of a part: the region that is the whole of it; None where there is none."""
        inside = self.cell == part
        size = np.count_nonzero(inside)
        whole = (name for name, ids in mesh.regions.items() if len(ids) == size and inside[ids].all())
        return next(whole, None)

    def boundaries(self, mesh: Mesh, part: int) -> list[str]:
        """Names of the boundaries that belong to a part, or to it among others."""
        mine = np.zeros(mesh.number_of_nodes, dtype=bool)
        mine[mesh.cells[self.cell == part]] = True
        return [name for name, facets in mesh.boundaries.items() if mine[facets].all(axis=1).any()]


def parts_of(mesh: Mesh) -> Parts:
    """The parts of a mesh; a refined mesh has those of the coarser one."""
    if mesh.parent is not None:
        coarse = mesh.parent.mesh.parts
        return Parts(coarse.count, coarse.cell[mesh.parent.cells])
    return Parts(*cell_parts(mesh.cells, mesh.number_of_nodes))
