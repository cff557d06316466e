"""Kinks of what acts on a body in time: the formulas of a statement tell them by themselves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass

import numpy as np

from hemivar.formula import Formula

__all__ = ["kinks_in_time"]

#: Kinks that are one up to rounding, as a part of the whole time.
_SAME = 1e-12
#: Kinks of one formula that are met, at most.
_MOST = 500
#: How deep formulas are looked for in a statement.
_DEEP = 12


def kinks_in_time(statement: object, start: float, until: float) -> tuple[tuple[float, ...], tuple[str, ...]]:
    """Times between start and end at which a formula of a statement has a kink, and sentences on what is not known."""
    found: list[float] = []
    doubts: list[str] = []
    for formula in dict.fromkeys(_formulas(statement, 0)):
        if "t" not in formula.variables:
            continue
        formula.refuse_pole_in_time(start, until)
        times, sure = formula.kinks_in_time(start, until)
        if times.size > _MOST:
            doubts.append(
                f"the formula '{formula.text}' has {times.size} kinks in time, which are not met; name those that "
                "matter as stops"
            )
            continue
        found += times.tolist()
        if not sure:
            doubts.append(
                f"the kinks in time of the formula '{formula.text}' could not all be found; name those that matter as "
                "stops"
            )
    kept: list[float] = []
    for time in sorted(found):
        if not kept or time - kept[-1] > _SAME * max(abs(start), abs(until)):
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
