"""The stored energy (hyperelastic potential) of a body over ranks that is not linear, by the cells of each rank."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from hemivar.basics.types import Array
from hemivar.fem.edge_blocks import EdgeBlocks
from hemivar.fem.energy_integral import BeddedEnergy
from hemivar.ranks.nodes import NodesOnRanks

__all__ = ["StoredOnRanks"]

T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class StoredOnRanks:
    """A stored energy by displacements (N, d) of the nodes of each rank's piece; all ranks ask for it together.

    It is shifted as that of :class:`.Potential`: it and its forces are zero under the prescribed
    displacements.
    """

    nodes: NodesOnRanks
    own: BeddedEnergy | None  # that of the cells of this rank; None where there are none
    initial_value: float  # stored under the prescribed displacements alone, by all ranks
    initial_forces: Array  # (n,): internal forces under these

    def value(self, field: Array) -> float:
        """The part of this rank, before the shift."""
        return self._asked(lambda own: own.value(field), 0.0)

    def forces(self, field: Array) -> Array:
        """Internal forces (n,), shifted; zero where supports hold."""
        nodes = self.nodes
        forces = nodes.summed(nodes.along(self._asked(lambda own: own.forces(field), np.zeros(field.shape))))
        return np.where(nodes.fixed, 0.0, forces) - self.initial_forces

    def tangent(self, field: Array) -> EdgeBlocks | None:
        """The stiffness of this rank's cells; None where there are none."""
        return self._asked(lambda own: own.blocks(field), None)

    def bound(self, upper: bool) -> EdgeBlocks | None:
        """The stiffness of this rank's cells by the upper tensor, or by the lower one; None where there are none."""
        return self._asked(lambda own: own.bound(upper), None)

    def bounded_below(self) -> bool:
        """Whether a lower tensor is known in all cells of all ranks."""
        own = self._asked(lambda own: own.nodal.bounded_below, True)
        return not self.nodes.ranks.largest(float(not own))[0]

    def marks(self) -> list[float]:
        """Numbers of this rank by whose sums an energy is known again: those of bodies strained as a whole."""
        points = self.nodes.piece.mesh.points
        sheared = np.roll(points, 1, axis=1)
        strains = (1e-4, 1e-3, 1e-2, 1e-1)  # from nearly linear to large
        fields = [strain * field for strain in strains for field in (points, -points, sheared, points + sheared)]
        return self._asked(lambda own: [own.value(field) for field in fields], [0.0] * len(fields))

    def _asked(self, ask: Callable[[BeddedEnergy], T], without_cells: T) -> T:
        """What the material says of this rank's cells; if it refuses on one rank, the same error on all."""
        own = self.own
        return self.nodes.ranks.agree(lambda: without_cells if own is None else ask(own))
