"""What acts on a body over time (loads, supports, gaps, laws), and at which times it has kinks and jumps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass

import numpy as np

from hemivar.basics.arrays import ROUNDED
from hemivar.basics.first_use import cached_property
from hemivar.basics.last_used import Recent
from hemivar.basics.types import Array
from hemivar.evolution.discrete import KEPT, DiscreteEvolution, ExternalData
from hemivar.formula import Formula

__all__ = ["ChangedData", "DataInTime", "StatedData", "kinks_in_time"]

#: Kinks of one formula that are met, at most.
_MOST = 500
#: How deep formulas are looked for in a statement.
_DEEP = 12
#: Part of the size of what is added up that is rounding.
_ROUNDING = 16.0 * float(np.finfo(float).eps)


def kinks_in_time(statement: object, start: float, until: float) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Times between start and end at which a formula of a statement has a kink, and sentences on what is not known."""
    kinks: list[float] = []
    doubts: list[str] = []
    for formula in dict.fromkeys(_formulas(statement, 0)):
        if "t" not in formula.variables:
            continue
        formula.refuse_pole_in_time(start, until)
        times, sure = formula.kinks_in_time(start, until)
        if times.size > _MOST:
            doubts.append(
                f"the formula '{formula.text}' has {times.size} kinks in time, which are not step ends; name those "
                f"that matter as stops"
            )
            continue
        kinks += times.tolist()
        if not sure:
            doubts.append(
                f"the kinks in time of the formula '{formula.text}' could not all be found; name those that matter as "
                "stops"
            )
    kept: list[float] = []
    for time in sorted(kinks):
        if not kept or time - kept[-1] > ROUNDED * max(abs(start), abs(until)):
            kept.append(time)
    return tuple(kept), tuple(doubts)


def _formulas(value: object, depth: int) -> Iterator[Formula]:
    if isinstance(value, Formula):
        yield value
    elif depth > _DEEP or isinstance(value, np.ndarray | str | bytes):
        return
    elif isinstance(value, Mapping):
        for entry in value.values():
            yield from _formulas(entry, depth + 1)
    elif isinstance(value, tuple | list):
        for entry in value:
            yield from _formulas(entry, depth + 1)
    elif is_dataclass(value) and not isinstance(value, type):
        for one in fields(value):
            if not one.name.startswith("_"):
                yield from _formulas(getattr(value, one.name, None), depth + 1)


class DataInTime(ABC):
    """What acts on a body as a function of time."""

    @abstractmethod
    def at(self, time: float) -> ExternalData:
        """What acts at a time."""

    @abstractmethod
    def sides(self, time: float) -> tuple[float, float]:
        """Times at which what acts just before and just after a time is looked at: both the time itself but at jumps.

        Loads, supports and gaps are looked at, laws are not.
        """

    def before(self, time: float) -> ExternalData:
        """What acts just before a time: another than just after it where it jumps."""
        return self.at(self.sides(time)[0])

    def after(self, time: float) -> ExternalData:
        """What acts just after a time."""
        return self.at(self.sides(time)[1])

    def jumps_at(self, time: float) -> bool:
        """Whether what acts jumps at a time at which it is known that it may."""
        before, after = self.sides(time)
        return before != after


@dataclass(frozen=True, eq=False)
class StatedData(DataInTime):
    """What was stated."""

    discrete: DiscreteEvolution
    #: Times at which what acts may jump, and how near to them it is looked at.
    stops: Mapping[float, float] = field(default_factory=dict)
    _known: Recent[float, ExternalData] = field(default_factory=lambda: Recent(KEPT), repr=False)
    _sides: Recent[float, tuple[float, float]] = field(default_factory=lambda: Recent(KEPT), repr=False)

    @cached_property
    def _steady(self) -> bool:
        return not self.discrete.evolution.problem.time_dependent

    def at(self, time: float) -> ExternalData:
        key = self.discrete.evolution.start if self._steady else time
        return self._known.once(key, lambda: self.discrete.data_at(key))

    def sides(self, time: float) -> tuple[float, float]:
        near = self.stops.get(time)
        if near is None or self._steady:
            return time, time

        def looked_at() -> tuple[float, float]:
            first = time <= self.discrete.evolution.start  # nothing acts before it
            times = [time if first else time - part * near for part in (2.0, 1.0)]
            times += [time + part * near for part in (1.0, 2.0)]
            jumps = _jumps(self.discrete, *(self.at(one) for one in times))
            return (times[1], times[2]) if jumps else (time, time)

        return self._sides.once(time, looked_at)


@dataclass(frozen=True, eq=False)
class ChangedData(DataInTime):
    """Data to which more is added, that jumps nowhere."""

    stated: DataInTime
    #: Makes what acts of what was stated, and of the time.
    change: Callable[[ExternalData, float], ExternalData]

    def at(self, time: float) -> ExternalData:
        return self.change(self.stated.at(time), time)

    def sides(self, time: float) -> tuple[float, float]:
        return self.stated.sides(time)


def _jumps(
    discrete: DiscreteEvolution, far: ExternalData, left: ExternalData, right: ExternalData, away: ExternalData
) -> bool:
    """Whether loads or places change between the two times in the middle by more than three times as much as beside
    them, rounding aside."""

    def change(one: ExternalData, other: ExternalData) -> Array:
        pairs = (one.load - other.load, one.prescribed - other.prescribed, one.offset - other.offset)
        return discrete.vectors.largest(*(float(np.abs(pair).max(initial=0.0)) for pair in pairs))

    sizes = (np.maximum(np.abs(a), np.abs(b)) for a, b in (
        (left.load, right.load), (left.prescribed, right.prescribed), (left.offset, right.offset)
    ))  # fmt: skip
    rounding = _ROUNDING * discrete.vectors.largest(*(float(size.max(initial=0.0)) for size in sizes))
    beside = change(far, left) + change(right, away)
    return bool((change(left, right) > 3.0 * beside + rounding).any())
