"""Primal-dual active sets on a small condensed body: all rounds in one call of the compiled kernels."""

from __future__ import annotations

import weakref
from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array
from hemivar.kernels import kernels
from hemivar.kernels.library import Kernels
from hemivar.laws.contact_chart import GraphTables

__all__ = ["CompiledRounds", "Rounds", "compiled_rounds"]

#: Components up to which the factors of the kernels are as fast as those of LAPACK.
_MOST = 200


@dataclass(frozen=True, eq=False)
class Rounds:
    """Where rounds of active sets ended."""

    count: int  # rounds that were made
    settled: bool  # whether the multiplier of the body misses that of the law by no more than was allowed
    r: Array  # (m, d)
    lam: Array  # (m, d): multiplier of the body
    of_law: Array  # (m, d): that of the law
    missed: float  # by how much the multiplier of the law is missed
    force: float  # the size of its force


class CompiledRounds:
    """A condensed body and the tables of a law, as the kernels read them; the factor that was made last is kept.

    It belongs to one thread: its memory is used again.

    ``law``: straight on its pieces; ``matrix (m d, m d)``: stiffness between the local components, all of which are
    free to move; symmetric; ``weights (m,)``; ``compliance (m, d)``: by which displacements are held against
    multipliers; ``coefficient (m,)``, if any: multiples of the pressure that bound friction, whose tables are those of
    the bound 1. Raises ValueError: an array is not what it should be.
    """

    def __init__(
        self,
        kernels: Kernels,
        law: GraphTables,
        matrix: Array,
        weights: Array,
        compliance: Array,
        coefficient: Array | None = None,
    ) -> None:
        self.shape, self._call = law.shape, kernels.call
        n, states, kinks = law.stiffness.size, len(law.anchor), len(law.knots)
        if law.curved:
            raise ValueError("the law must be straight on its pieces")
        if coefficient is not None and law.shape[1] != 2:
            raise ValueError("the law must have two components where friction follows the pressure")
        if states != 2 * kinks + 1 or law.shape[0] * law.shape[1] != n or weights.shape != law.shape[:1]:
            raise ValueError(f"tables of {states} states and {n} components do not belong to {law.shape} components")
        # What the kernels point to is held here.
        self._tables = [
            _table(law.stiffness, (n,)),
            _table(law.bounds, (2 * kinks, n)),
            *(_table(table, (states, n)) for table in (law.anchor, law.base, law.slope)),
            *(_table(table, (kinks, n)) for table in (law.knots, law.low, law.high)),
            *(_table(end, (n,)) for end in law.domain),
            _table(matrix, (n, n)),
            _table(np.repeat(weights, law.shape[1]), (n,)),
            _table(compliance.ravel(), (n,)),
        ]
        if coefficient is not None:
            self._tables.append(_table(coefficient, (n // 2,)))
        at = kernels.address
        tables = np.zeros(14, dtype=np.uintp)
        tables[: len(self._tables)] = [at(table) for table in self._tables]
        self._pointer = kernels.made(self._call.hv_active_sets_new(n, states, at(tables)))
        weakref.finalize(self, self._call.hv_active_sets_free, self._pointer)
        # Load, displacement, multiplier, multiplier of the law, numbers that are told.
        self._room = np.zeros((5, max(n, 3)))
        self._at = [at(row) for row in self._room]

    def __reduce__(self) -> str:
        raise TypeError("compiled rounds belong to this process")

    def run(self, load: Array, r: Array, lam: Array, most: int, atol: float, rtol: float, size: float) -> Rounds | None:
        """Rounds from a pair, ``most`` of them, until it is missed by no more than ``atol + rtol max(size, force)``.

        None where Newton's equation has no solution, or a number is not finite.

        ``load (m d,)``; ``r, lam (m, d)``.
        """
        self._fill(load, r, lam)
        end = self._call.hv_active_sets_run(self._pointer, *self._at[:4], most, atol, rtol, size, self._at[4])
        if end > 1:
            return None
        pairs = self._room[1:4, : load.size].copy().reshape(3, *self.shape)
        count, missed, force = self._room[4, :3].tolist()
        return Rounds(int(count), end == 1, pairs[0], pairs[1], pairs[2], missed, force)

    def distance(self, r: Array, lam: Array) -> float:
        """Norm of the weighted distances of pairs (m, d) to the graphs of their laws, as of
        :meth:`GraphTables.graph_distance`."""
        self._fill(r, r, lam)
        return float(self._call.hv_active_sets_distance(self._pointer, *self._at[1:3]))

    def _fill(self, load: Array, r: Array, lam: Array) -> None:
        shape, n = self.shape, self.shape[0] * self.shape[1]
        if load.size != n or r.shape != shape or lam.shape != shape:
            raise ValueError(f"pairs of {shape} components are needed, not {load.shape}, {r.shape} and {lam.shape}")
        self._room[0, :n], self._room[1, :n], self._room[2, :n] = load.ravel(), r.ravel(), lam.ravel()


def _table(numbers: Array, shape: tuple[int, ...]) -> Array:
    table = np.require(numbers, float, ["C", "A"])
    if table.shape != shape:
        raise ValueError(f"a table of the active sets has shape {table.shape} in place of {shape}")
    return table


def compiled_rounds(
    law: GraphTables, matrix: Array, weights: Array, compliance: Array, coefficient: Array | None
) -> CompiledRounds | None:
    """What makes rounds in one call; None where the kernels are not there, or not for such a law or body."""
    library = kernels()
    if library is None or law.curved or not 0 < law.stiffness.size <= _MOST:
        return None
    return CompiledRounds(library, law, matrix, weights, compliance, coefficient)
