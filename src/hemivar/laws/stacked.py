"""Different scalar laws at different contact points as one superpotential (gather and scatter)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.description import LawDescription
from hemivar.laws.proof import Constant, Proof, gathered
from hemivar.laws.superpotential import Interval, Superpotential

__all__ = ["StackedLaw", "gathered_debonding"]


@dataclass(frozen=True, eq=False)
class StackedLaw(Superpotential):
    """Law ``parts[i]`` at the contact points ``indices[i]``; together the indices cover 0..m-1 once."""

    parts: tuple[Superpotential, ...]
    indices: tuple[IntArray, ...]
    name: str = "several laws"

    @cached_property
    def rows(self) -> int:  # type: ignore[override]
        """Number of contact points."""
        return int(sum(index.size for index in self.indices))

    def _gather(self, ask: Callable[[Superpotential, IntArray], Array]) -> Array:
        """What each part says of its contact points, (m,)."""
        return self._joined([ask(part, index) for part, index in zip(self.parts, self.indices, strict=True)])

    def _joined(self, answers: Sequence[Array]) -> Array:
        out = np.empty(self.rows, dtype=np.result_type(*answers))
        for index, values in zip(self.indices, answers, strict=True):
            out[index] = values
        return out

    def _ask(self, name: str, *arguments: Array) -> Array:
        """The same of a method, given arguments (m,)."""
        given = [np.broadcast_to(np.asarray(x), (self.rows,)) for x in arguments]
        return self._gather(lambda law, i: getattr(law, name)(*(x[i] for x in given)))

    def _on_piece(self, name: str, piece: IntArray, r: Array) -> Array:
        on, at = np.broadcast_to(piece, (self.rows,)), np.broadcast_to(r, (self.rows,))
        return self._gather(lambda law, i: getattr(law, name)(np.minimum(on[i], law.knots.shape[-1]), at[i]))

    @cached_property
    def knots(self) -> Array:  # type: ignore[override]
        """Those of each part, see there."""
        out = np.full((self.rows, max(law.knots.shape[-1] for law in self.parts)), np.inf)
        for part, index in zip(self.parts, self.indices, strict=True):
            out[index, : part.knots.shape[-1]] = part.knots
        return out

    @cached_property
    def domain(self) -> Interval:  # type: ignore[override]
        """Where j is finite, see there."""
        return Interval(self._gather(lambda law, i: law.domain.lower), self._gather(lambda law, i: law.domain.upper))

    def piece_value(self, piece: IntArray, r: Array) -> Array:
        return self._on_piece("piece_value", piece, r)

    def piece_derivative(self, piece: IntArray, r: Array) -> Array:
        return self._on_piece("piece_derivative", piece, r)

    def piece_curvature(self, piece: IntArray, r: Array) -> Array:
        return self._on_piece("piece_curvature", piece, r)

    def recession(self, sign: Array) -> Array:
        return self._ask("recession", sign)

    def local_argmin(self, a: Array, b: Array) -> Array:
        return self._ask("local_argmin", a, b)

    def asymptotic_curvature(self, sign: float) -> Array:
        return self._gather(lambda law, i: law.asymptotic_curvature(sign))

    def debonding(self, r: Array) -> dict[str, Array]:
        r = np.broadcast_to(np.asarray(r, dtype=float), (self.rows,))
        return gathered_debonding(
            [part.debonding(r[i]) for part, i in zip(self.parts, self.indices, strict=True)], self.indices
        )

    def describe(self, point: int = 0) -> LawDescription:
        for part, index in zip(self.parts, self.indices, strict=True):
            here = np.flatnonzero(index == point)
            if here.size:
                return part.describe(int(here[0]))
        raise ProblemError(f"law '{self.name}' has {self.rows} contact points; there is none with number {point}")

    @property
    def straight(self) -> bool:
        return all(law.straight for law in self.parts)

    @property
    def weak_convexity(self) -> Array:
        return self._gather(lambda law, i: law.weak_convexity)

    def proof(self, constant: Constant) -> Proof:
        return gathered([law.proof(constant) for law in self.parts], self._joined)

    @property
    def growth(self) -> tuple[Array, Array]:
        return self._gather(lambda law, i: law.growth[0]), self._gather(lambda law, i: law.growth[1])

    def at(self, points: Array | None) -> StackedLaw:
        return self

    def scaled(self, factor: Array | float) -> StackedLaw:
        factor = np.broadcast_to(np.asarray(factor, dtype=float), (self.rows,))
        parts = tuple(law.scaled(factor[index]) for law, index in zip(self.parts, self.indices, strict=True))
        return StackedLaw(parts, self.indices, name=self.name)

    def take(self, index: IntArray) -> Superpotential:
        where, owner = np.empty((2, self.rows), dtype=np.int64)
        for k, rows in enumerate(self.indices):
            owner[rows], where[rows] = k, np.arange(rows.size)
        index = np.atleast_1d(np.asarray(index, dtype=np.int64))
        parts: list[Superpotential] = []
        indices: list[IntArray] = []
        for k, part in enumerate(self.parts):
            here = np.flatnonzero(owner[index] == k)
            if here.size:
                parts.append(part.take(where[index[here]]))
                indices.append(here)
        return parts[0] if len(parts) == 1 else StackedLaw(tuple(parts), tuple(indices), name=self.name)


def gathered_debonding(parts: Sequence[dict[str, Array]], indices: Sequence[IntArray]) -> dict[str, Array]:
    """What the parts of a law say of their contact points, as one; nan where a part says nothing of it."""
    count = sum(index.size for index in indices)
    out = {name: np.full(count, np.nan) for part in parts for name in part}
    for part, index in zip(parts, indices, strict=True):
        for name, values in part.items():
            out[name][index] = values
    return out


def stack(laws: Sequence[tuple[Superpotential, int]]) -> Superpotential:
    """One law from laws for consecutive blocks of contact points, given as ``(law, number of points)``."""
    laws = [(law, count) for law, count in laws if count > 0]
    if len(laws) == 1:
        return laws[0][0]
    ends = np.cumsum([count for _, count in laws])
    indices = tuple(np.arange(end - count, end) for end, (_, count) in zip(ends, laws, strict=True))
    names = " + ".join(dict.fromkeys(law.name for law, _ in laws))
    return StackedLaw(tuple(law for law, _ in laws), indices, name=names)
