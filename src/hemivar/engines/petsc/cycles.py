"""A cycle of multigrid that many solves of one body use in turn, as the steps in time of a length do."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from hemivar.basics.types import Array, BoolArray
from hemivar.engines.petsc.preconditioner import Multigrid

if TYPE_CHECKING:
    from hemivar.engines.petsc.body_on_ranks import BodyOnRanks

__all__ = ["Cycles", "ReusedCycle"]


class Cycles:
    """The cycle of multigrid that the solves of a body leave to one another.

    What it is set up for is always what the solve at hand sets up at first, so that no solve depends on those before.
    """

    def __init__(self) -> None:
        self.kept: Multigrid | None = None

    def at(self, body: BodyOnRanks, x: Array, held: BoolArray, curvature: Array) -> Multigrid:
        """Newton's matrix at the first place of a solve, with a cycle set up for it."""
        if self.kept is not None and not self.kept.again(x, held, curvature):
            self.kept.release()
            self.kept = None
        if self.kept is None:
            self.kept = Multigrid(body)
            self.kept.change(x, held, curvature)
        return self.kept


class ReusedCycle:
    """Newton's matrix of one solve, by a cycle that outlives it."""

    def __init__(self, body: BodyOnRanks, cycles: Cycles) -> None:
        self._body, self._cycles = body, cycles
        self._matrix: Multigrid | None = None

    @property
    def diagonal(self) -> Array:
        return self._body.elastic.matrix_diagonal

    def change(self, x: Array, held: BoolArray, curvature: Array) -> None:
        if self._matrix is None:
            self._matrix = self._cycles.at(self._body, x, held, curvature)
        else:
            self._matrix.change(x, held, curvature)

    def __matmul__(self, vector: Array) -> Array:
        assert self._matrix is not None
        return self._matrix @ vector

    def cycle(self, right: Array) -> Array:
        assert self._matrix is not None
        return self._matrix.cycle(right)

    def preconditioner(self) -> tuple[bool, Callable[[Array], Array]]:
        return False, self.cycle

    def release(self) -> None:
        """The cycle stays."""
