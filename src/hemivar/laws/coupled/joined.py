"""Different laws at different contact points, of which some couple opening and slip."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.coupled.orthotropic import OrthotropicLaw
from hemivar.laws.stacked import gathered_debonding
from hemivar.laws.superpotential import Interval
from hemivar.laws.vector_law import Linearisation, Sides, VectorLaw

__all__ = ["JoinedLaw", "join_laws"]


@dataclass(frozen=True, eq=False)
class JoinedLaw(VectorLaw):
    """Law ``parts[i]`` at the contact points ``indices[i]``; together the indices cover 0..m-1 once.

    Raises
    ------
    ProblemError
        A bound depends on the state.
    """

    parts: tuple[VectorLaw, ...]
    indices: tuple[IntArray, ...]
    name: ClassVar[str] = "several laws"  # type: ignore[misc]

    def __post_init__(self) -> None:
        moded = next((law.name for law in self.parts if law.depends_on_whole_state), "")
        if moded:
            raise ProblemError(
                f"law '{moded}' depends on the mode of the solution and stands alone on a body; take one law for all "
                "contact boundaries, or glue with one fracture energy (MixedMode)"
            )
        coupled = next((law.name for law in self.parts if not law.splits), "")
        if any(law.state_dependent for law in self.parts):
            raise ProblemError(
                f"law '{coupled}' couples opening and slip, and a friction bound beside it depends on the state; "
                "take a bound that does not"
            )

    def _gather(self, ask: Callable[[VectorLaw, IntArray], Array]) -> Array:
        found: Array | None = None
        for law, index in zip(self.parts, self.indices, strict=True):
            values = np.asarray(ask(law, index))
            if found is None:
                found = np.empty((self._count, *values.shape[1:]), dtype=values.dtype)
            found[index] = values if values.ndim and len(values) == index.size else np.broadcast_to(values, index.shape)
        assert found is not None
        return found

    def _whether(self, ask: Callable[[VectorLaw, IntArray], BoolArray]) -> BoolArray:
        return np.asarray(self._gather(lambda law, i: np.asarray(ask(law, i), dtype=float)) > 0.0)

    def _several(self, ask: Callable[[VectorLaw, IntArray], tuple[Array, ...]], count: int) -> list[Array]:
        return [self._gather(lambda law, i, k=k: ask(law, i)[k]) for k in range(count)]  # type: ignore[misc]

    @cached_property
    def _count(self) -> int:
        return sum(index.size for index in self.indices)

    def at(self, points: Array | None) -> JoinedLaw:
        return self

    def take(self, index: IntArray) -> VectorLaw:
        index = np.atleast_1d(np.asarray(index, dtype=np.int64))
        owner, place = np.empty(self._count, dtype=np.int64), np.empty(self._count, dtype=np.int64)
        for k, rows in enumerate(self.indices):
            owner[rows], place[rows] = k, np.arange(rows.size)
        here = [np.flatnonzero(owner[index] == k) for k in range(len(self.parts))]
        chosen = [(law.take(place[index[rows]]), rows) for law, rows in zip(self.parts, here, strict=True) if rows.size]
        if len(chosen) == 1:
            return chosen[0][0]
        return JoinedLaw(tuple(law for law, _ in chosen), tuple(rows for _, rows in chosen))

    def _each(self, ask: Callable[[VectorLaw], VectorLaw]) -> VectorLaw:
        """The law of other parts; itself where they are the same."""
        parts = tuple(ask(law) for law in self.parts)
        same = all(one is other for one, other in zip(parts, self.parts, strict=True))
        return self if same else JoinedLaw(parts, self.indices)

    def in_increments(self, rate: float) -> VectorLaw:
        return self._each(lambda law: law.in_increments(rate))

    def at_rest(self) -> VectorLaw:
        return self._each(lambda law: law.at_rest())

    def stored_energy(self, r: Array) -> Array:
        return self._gather(lambda law, i: law.stored_energy(r[i]))

    def is_function(self, components: int) -> bool:
        return all(law.is_function(components) for law in self.parts)

    def value(self, r: Array) -> Array:
        return self._gather(lambda law, i: law.value(r[i]))

    def distance(self, r: Array, lam: Array) -> Array:
        return self._gather(lambda law, i: law.distance(r[i], lam[i]))

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        return self._gather(lambda law, i: law.graph_distance(r[i], lam[i], tau[i]))

    def kinks_along(self, start: Array, end: Array, bend: Array) -> Array:
        own = [law.kinks_along(start[i], end[i], bend[i]) for law, i in zip(self.parts, self.indices, strict=True)]
        return self._padded(own, np.nan)

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        return self._gather(lambda law, i: law.nearest_multiplier(r[i], lam[i]))

    def clamp(self, start: Array, end: Array) -> Array:
        return self._gather(lambda law, i: law.clamp(start[i], end[i]))

    def local_argmin(self, a: Array, b: Array) -> Array:
        return self._gather(lambda law, i: law.local_argmin(a[i], b[i]))

    def downhill(self, a: Array, b: Array, r: Array) -> Array:
        return self._gather(lambda law, i: law.downhill(a[i], b[i], r[i]))

    def linearise(self, r: Array) -> Linearisation:
        lines = [law.linearise(r[i]) for law, i in zip(self.parts, self.indices, strict=True)]
        smooth, m, d = np.empty((len(r), 2), dtype=bool), *r.shape
        gradient, hessian = np.empty((m, d)), np.empty((m, d, d))
        for line, index in zip(lines, self.indices, strict=True):
            smooth[index], gradient[index], hessian[index] = line.smooth, line.gradient, line.hessian
        return Linearisation(smooth, gradient, hessian)

    def admissible(self, r: Array) -> Array:
        return self._gather(lambda law, i: law.admissible(r[i]))

    def recession(self, direction: Array) -> Array:
        return self._gather(lambda law, i: law.recession(direction[i]))

    @property
    def growth(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        normal = self._several(lambda law, i: law.growth[0], 2)
        tangential = self._several(lambda law, i: law.growth[1], 2)
        return (normal[0], normal[1]), (tangential[0], tangential[1])

    @property
    def growth_sampled(self) -> bool:
        return any(law.growth_sampled for law in self.parts)

    @property
    def rates(self) -> tuple[Array, Array, Array]:
        up, down, slip = self._several(lambda law, i: law.rates, 3)
        return up, down, slip

    def strongest(self, rest: Array, size: float) -> tuple[Array, Array, Array]:
        up, down, slip = self._several(lambda law, i: law.strongest(rest[i], size), 3)
        return up, down, slip

    def asymptotic_curvature(self, sign: float) -> tuple[Array, Array]:
        normal, tangential = self._several(lambda law, i: law.asymptotic_curvature(sign), 2)
        return normal, tangential

    @cached_property
    def _alphas(self) -> tuple[Array, Array]:
        normal, tangential = self._several(lambda law, i: law.weak_convexity, 2)
        return normal, tangential

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        return self._alphas

    def weak_convexity_within(self, reach: tuple[float, ...]) -> tuple[Array, Array]:
        normal, tangential = self._several(lambda law, i: law.weak_convexity_within(reach), 2)
        return normal, tangential

    @property
    def alpha_reach(self) -> tuple[float, float]:
        reaches = [law.alpha_reach for law in self.parts]
        return min(normal for normal, _ in reaches), min(tangential for _, tangential in reaches)

    @property
    def alpha_sampled(self) -> bool:
        return any(law.alpha_sampled for law in self.parts)

    @property
    def constants_sampled(self) -> bool:
        return any(law.constants_sampled for law in self.parts)

    @property
    def by_differences(self) -> bool:
        return any(law.by_differences for law in self.parts)

    def derivative_error(self, r: Array) -> Array:
        return self._gather(lambda law, i: law.derivative_error(r[i]))

    @property
    def penetrations(self) -> Interval:
        return Interval(
            self._gather(lambda law, i: law.penetrations.lower), self._gather(lambda law, i: law.penetrations.upper)
        )

    @property
    def penetration_knots(self) -> Array:
        return self._padded([law.penetration_knots for law in self.parts], np.inf)

    def _padded(self, tables: Sequence[Array], fill: float) -> Array:
        """Tables of the parts, (their points or 1, K) with K of their own, as one for all points."""
        found = np.full((self._count, max(table.shape[1] for table in tables)), fill)
        for table, index in zip(tables, self.indices, strict=True):
            found[index, : table.shape[1]] = table
        return found

    @property
    def rubs(self) -> BoolArray:
        return self._whether(lambda law, i: law.rubs)

    def snap_to_kinks(self, r: Array, near: float) -> Array:
        return self._gather(lambda law, i: law.snap_to_kinks(r[i], near))

    def fitted(self, r: Array, lam: Array, tau: Array) -> Array:
        return self._gather(lambda law, i: law.fitted(r[i], lam[i], tau[i]))

    def sides(self, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
        return [
            Sides(index[one.point], *list(vars(one).values())[1:])
            for law, index in zip(self.parts, self.indices, strict=True)
            for one in law.sides(r[index], lam[index], active[index], tau[index], slack)
        ]

    def at_normal_kink(self, r: Array) -> BoolArray:
        return self._whether(lambda law, i: law.at_normal_kink(r[i]))

    def moves(self, r: Array, small: float) -> BoolArray:
        return self._whether(lambda law, i: law.moves(r[i], small))

    def pulls(self, r: Array) -> BoolArray:
        return self._whether(lambda law, i: law.pulls(r[i]))

    def past_peak(self, r: Array, pull: Array | None = None, near: float = 0.0, slack: float = 0.0) -> BoolArray:
        return self._whether(lambda law, i: law.past_peak(r[i], None if pull is None else pull[i], near, slack))

    def debonding(self, r: Array) -> dict[str, Array]:
        return gathered_debonding(
            [law.debonding(r[i]) for law, i in zip(self.parts, self.indices, strict=True)], self.indices
        )

    def resistance(self, r: Array, lam: Array) -> Array:
        return self._gather(lambda law, i: law.resistance(r[i], lam[i]))


def join_laws(laws: Sequence[tuple[VectorLaw, int]]) -> VectorLaw:
    """One law from laws for consecutive blocks of contact points.

    Parameters
    ----------
    laws : sequence of (VectorLaw, int)
        The law of each block, with parameters resolved at its points, and how many these are.

    Returns
    -------
    VectorLaw
        A :class:`ContactLaw` where all of them split, an :class:`OrthotropicLaw` where some friction depends on the
        direction of the slip.

    Raises
    ------
    ProblemError
        No contact point is left, or a bound that depends on the state stands beside a law that couples.
    """
    laws = [(law, count) for law, count in laws if count > 0]
    split = [(law, count) for law, count in laws if isinstance(law, ContactLaw)]
    if len(split) == len(laws):
        return ContactLaw.concatenate(split)
    directed = OrthotropicLaw.concatenate(laws)
    if directed is not None:
        return directed
    if len(laws) == 1:
        return laws[0][0]
    ends = np.cumsum([count for _, count in laws])
    rows = tuple(np.arange(end - count, end) for end, (_, count) in zip(ends, laws, strict=True))
    return JoinedLaw(tuple(law for law, _ in laws), rows)
