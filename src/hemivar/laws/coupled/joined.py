"""One contact law of different laws at different contact points (gather and scatter), some of them coupled."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.coupled.orthotropic import OrthotropicLaw
from hemivar.laws.piecewise_law import gathered_debonding, taken_apart
from hemivar.laws.proof import Constant, Proof, gathered
from hemivar.laws.superpotential import Interval
from hemivar.laws.vector_law import Chart, Linearisation, OnGraph, Sides, VectorLaw

__all__ = ["JoinedLaw", "join_laws"]


def _by_points(question: str, fill: float | None = None) -> Callable[..., np.ndarray]:
    """The answer to a question about each point, whose arrays are those of all points."""

    def asked(law: JoinedLaw, *given: object) -> np.ndarray:
        return law.gather([getattr(part, question)(*own) for part, own in _given(law, given)], fill)

    return asked


def _several(question: str) -> Callable[..., tuple[np.ndarray, ...]]:
    """The same where several arrays are the answer."""

    def asked(law: JoinedLaw, *given: object) -> tuple[np.ndarray, ...]:
        answers = [getattr(part, question)(*own) for part, own in _given(law, given)]
        return tuple(law.gather(parts) for parts in zip(*answers, strict=True))

    return asked


def _given(law: JoinedLaw, given: tuple[object, ...]) -> list[tuple[VectorLaw, list[object]]]:
    """The parts, and what they are asked of their own points."""
    return [
        (part, [argument[index] if isinstance(argument, np.ndarray) else argument for argument in given])
        for part, index in zip(law.parts, law.indices, strict=True)
    ]


def _of_all(question: str, fill: float | None = None) -> property:
    """What is known of each point, as one array."""
    return property(lambda law: law.gather([getattr(part, question) for part in law.parts], fill))


def _of_both(question: str) -> cached_property[tuple[np.ndarray, ...]]:
    """The same of several arrays, which are kept."""
    return cached_property(
        lambda law: tuple(map(law.gather, zip(*(getattr(part, question) for part in law.parts), strict=True)))
    )


def _whether(question: str) -> property:
    """Whether it is so for some part."""
    return property(lambda law: any(getattr(part, question) for part in law.parts))


@dataclass(frozen=True, eq=False)
class JoinedLaw(VectorLaw):
    """Law ``parts[i]`` at the contact points ``indices[i]``; together the indices cover 0..m-1 once."""

    parts: tuple[VectorLaw, ...]
    indices: tuple[IntArray, ...]
    name: ClassVar[str] = "several laws"  # type: ignore[misc]

    def gather(self, parts: Sequence[np.ndarray], fill: float | None = None) -> np.ndarray:
        """What the parts say of their contact points, (their points or 1, ...), as one for all points.

        Rows may be of different lengths, if there is something to ``fill`` them with.
        """
        if fill is not None:
            width = max(part.shape[1] for part in parts)
            parts = [np.pad(table, ((0, 0), (0, width - table.shape[1])), constant_values=fill) for table in parts]
        out = np.empty((self._count, *parts[0].shape[1:]), dtype=np.result_type(*parts))
        for part, index in zip(parts, self.indices, strict=True):
            out[index] = part
        return out

    @cached_property
    def _count(self) -> int:
        return sum(index.size for index in self.indices)

    def take(self, index: IntArray) -> VectorLaw:
        chosen = [(self.parts[k].take(own), here) for k, own, here in taken_apart(self.indices, index)]
        if len(chosen) == 1:
            return chosen[0][0]
        return JoinedLaw(tuple(law for law, _ in chosen), tuple(rows for _, rows in chosen))

    def _each(self, ask: Callable[..., VectorLaw], *given: object) -> VectorLaw:
        """The law of other parts, asked with what is given of their own points; itself where they are the same."""
        parts = tuple(ask(law, *own) for law, own in _given(self, given))
        same = all(part is other for part, other in zip(parts, self.parts, strict=True))
        return self if same else JoinedLaw(parts, self.indices)

    def in_increments(self, rate: float) -> VectorLaw:
        return self._each(lambda law: law.in_increments(rate))

    def at_rest(self) -> VectorLaw:
        return self._each(lambda law: law.at_rest())

    def is_function(self, components: int) -> bool:
        return all(law.is_function(components) for law in self.parts)

    # ---- whether it depends on the state ----------------------------------------------------------------

    state_dependent = _whether("state_dependent")
    depends_on_whole_state = _whether("depends_on_whole_state")

    @property
    def follows_state(self) -> bool:
        return all(law.follows_state for law in self.parts if law.state_dependent)

    def frozen(self, r: Array, lam: Array) -> VectorLaw:
        return self._each(lambda law, *own: law.frozen(*own), r, lam)

    # ---- asked point by point ---------------------------------------------------------------------------

    value = _by_points("value")
    stored_energy = _by_points("stored_energy")
    distance = _by_points("distance")
    graph_distance = _by_points("graph_distance")
    nearest_multiplier = _by_points("nearest_multiplier")
    clamp = _by_points("clamp")
    local_argmin = _by_points("local_argmin")
    local_minimiser = _by_points("local_minimiser")
    admissible = _by_points("admissible")
    recession = _by_points("recession")
    fitted = _by_points("fitted")
    moves = _by_points("moves")
    past_peak = _by_points("past_peak")
    resistance = _by_points("resistance")
    kinks_along = _by_points("kinks_along", np.nan)
    rubbed = _by_points("rubbed")
    kinks = _several("kinks")  # type: ignore[assignment]
    strongest = _several("strongest")  # type: ignore[assignment]
    asymptotic_curvature = _several("asymptotic_curvature")  # type: ignore[assignment]

    def pressures(self, r: Array) -> Interval:
        ends = [law.pressures(r[i]) for law, i in zip(self.parts, self.indices, strict=True)]
        return Interval(self.gather([end.lower for end in ends]), self.gather([end.upper for end in ends]))

    def linearise(self, r: Array) -> Linearisation:
        lines = [vars(law.linearise(r[i])) for law, i in zip(self.parts, self.indices, strict=True)]
        return Linearisation(*(self.gather([line[name] for line in lines]) for name in lines[0]))

    def on_graph(self, p: Array, a: Array) -> OnGraph:
        return self.joined([law.on_graph(p[i], a[i]) for law, i in zip(self.parts, self.indices, strict=True)])

    def joined(self, pairs: Sequence[OnGraph]) -> OnGraph:
        """Pairs of the parts as those of all points."""
        return OnGraph(*(self.gather(arrays) for arrays in zip(*(vars(pair).values() for pair in pairs), strict=True)))

    def chart(self, a: Array, components: int) -> Chart | None:
        charts = [law.chart(a[i], components) for law, i in zip(self.parts, self.indices, strict=True)]
        known = tuple(chart for chart in charts if chart is not None)
        return _JoinedChart(self, a, known) if len(known) == len(charts) else None

    def sides(self, r: Array, lam: Array, active: BoolArray, tau: Array, slack: float) -> list[Sides]:
        return [
            replace(side, point=index[side.point])
            for law, index in zip(self.parts, self.indices, strict=True)
            for side in law.sides(r[index], lam[index], active[index], tau[index], slack)
        ]

    def debonding(self, r: Array) -> dict[str, Array]:
        return gathered_debonding(
            [law.debonding(r[i]) for law, i in zip(self.parts, self.indices, strict=True)], self.indices
        )

    # ---- what is known of all ---------------------------------------------------------------------------

    @property
    def growth(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        (n0, n1), (t0, t1) = ([self.gather([law.growth[k][i] for law in self.parts]) for i in (0, 1)] for k in (0, 1))
        return (n0, n1), (t0, t1)

    lipschitz = _of_all("lipschitz")
    steering = _of_all("steering")
    rubs = _of_all("rubs")
    penetration_knots = _of_all("penetration_knots", np.inf)
    rates = _of_both("rates")  # type: ignore[assignment]
    curve_above = _of_both("curve_above")  # type: ignore[assignment]
    weak_convexity = _of_both("weak_convexity")  # type: ignore[assignment]

    def proof(self, constant: Constant) -> Proof:
        return gathered([law.proof(constant) for law in self.parts], self.gather)

    @property
    def penetrations(self) -> Interval:
        ends = [law.penetrations for law in self.parts]
        return Interval(self.gather([end.lower for end in ends]), self.gather([end.upper for end in ends]))


@dataclass(frozen=True, eq=False)
class _JoinedChart(Chart):
    """The charts of the parts."""

    law: JoinedLaw
    parts: tuple[Chart, ...]

    @property
    def _each(self) -> Iterator[tuple[Chart, IntArray]]:
        """Them, with the numbers of their points."""
        return zip(self.parts, self.law.indices, strict=True)

    def at(self, p: Array, near: Array | None = None) -> OnGraph:
        return self.law.joined([chart.at(p[i], None if near is None else near[i]) for chart, i in self._each])

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        parts = [chart.graph_distance(r[i], lam[i], tau[i]) for chart, i in self._each]
        same = min(part.shape[1] for part in parts) == max(part.shape[1] for part in parts)
        return self.law.gather(parts if same else [np.linalg.norm(part, axis=1, keepdims=True) for part in parts])

    def bounded(self, part: float) -> Chart | None:
        charts = [chart.bounded(part) for chart in self.parts]
        if not any(charts):
            return None
        return replace(self, parts=tuple(new or old for new, old in zip(charts, self.parts, strict=True)))

    def least_multiplier(self, r: Array) -> Array:
        return self.law.gather([chart.least_multiplier(r[i]) for chart, i in self._each])


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
        No contact point is left.
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
