"""The body of a step in time: set up once for all steps of a length, and put under one load after another."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from hemivar.basics.types import Array, BoolArray
from hemivar.engines.petsc.assembly import BodyOnRanks
from hemivar.engines.petsc.preconditioner import Multigrid
from hemivar.engines.petsc.stiffness import Stiffness
from hemivar.laws import VectorLaw
from hemivar.systems.krylov_newton import Truncation

__all__ = ["Cycles", "StepBody"]

#: What depends on the mesh alone, and so is the same under every load, offset and law.
_OF_THE_MESH = ("prolongation", "owned", "held", "_scatter")


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


class _Reused:
    """Newton's matrix of one solve, by a cycle that outlives it."""

    def __init__(self, body: StepBody) -> None:
        self._body = body
        self._matrix: Multigrid | None = None

    @property
    def diagonal(self) -> Array:
        return self._body.elastic.matrix_diagonal

    def change(self, x: Array, held: BoolArray, curvature: Array) -> None:
        if self._matrix is None:
            self._matrix = self._body.cycles.at(self._body, x, held, curvature)
        else:
            self._matrix.change(x, held, curvature)

    def __matmul__(self, vector: Array) -> Array:
        assert self._matrix is not None
        return self._matrix @ vector

    def cycle(self, right: Array) -> Array:
        assert self._matrix is not None
        return self._matrix.cycle(right)

    def release(self) -> None:
        """The cycle stays."""


@dataclass(frozen=True, eq=False, kw_only=True)
class StepBody(BodyOnRanks):
    """A body that is put under many loads, with one matrix and one cycle for all of them.

    Attributes
    ----------
    cycles : Cycles
    """

    cycles: Cycles

    @staticmethod
    def of(body: BodyOnRanks) -> StepBody:
        """A body to be put under other loads."""
        return StepBody(**{entry.name: getattr(body, entry.name) for entry in fields(body)}, cycles=Cycles())

    def under(self, load: Array, offset: Array, law: VectorLaw) -> StepBody:
        """The body under a load (n,), with offsets (m, d) and a law of its contact points; all ranks call this."""
        own = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        own |= {"load": np.where(self.held, 0.0, load), "offset": offset, "law": law, "below": None, "constant": 0.0}
        found = StepBody(**own)
        for name in _OF_THE_MESH:
            if name == "prolongation" and self.coarser is None:
                continue
            found.__dict__[name] = getattr(self, name)
        _ = found.load_scale, found.stiffest  # found by all ranks together, so that each may look at it alone
        return found

    def slower(self, resistance: float) -> StepBody:
        """The body with a stiffness that is larger by a factor: one step against a resistance in the energy norm."""
        factor = 1.0 + resistance
        matrix = self.K.copy()
        matrix.scale(factor)
        own = {entry.name: getattr(self, entry.name) for entry in fields(self)}
        own |= {
            "elastic": Stiffness(matrix, self.ranks, self.unknown, self.sign, self.active),
            "row_sums": factor * self.row_sums,
            "compliance": self.compliance / factor,
            "typical": factor * self.typical,
            "cycles": Cycles(),
        }
        found = StepBody(**own)
        for name in _OF_THE_MESH:
            if name != "prolongation" or self.coarser is not None:
                found.__dict__[name] = getattr(self, name)
        return found

    def truncation(self) -> Truncation:
        return _Reused(self)
