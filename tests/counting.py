"""Measures of work that no clock disturbs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import pytest
import scipy.sparse.linalg as spla

from hemivar.basics.deadline import Budget

__all__ = ["WatchedFactors", "at_most_calls", "sparse_factors", "time_by_looks"]


@contextmanager
def at_most_calls(most: int) -> Iterator[None]:
    """In this block at most so many functions written in Python are called; the one too many is stopped."""
    done = 0

    def count(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal done
        done += event == "call"
        if done > most:
            raise AssertionError(f"more than {most} calls")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        yield
    finally:
        sys.setprofile(before)


def time_by_looks(monkeypatch: pytest.MonkeyPatch, step: float = 1e-3) -> None:
    """Let time go on by so many seconds whenever a limit of time is looked at, and not otherwise."""
    looks = 0

    def spent(_: Budget) -> float:
        nonlocal looks
        looks += 1
        return looks * step

    monkeypatch.setattr(Budget, "spent", property(spent))


class WatchedFactors:
    """Factors of SciPy that count what is solved with them."""

    def __init__(self, factors: spla.SuperLU) -> None:
        self._factors = factors
        self.solves = 0

    def solve(self, *given: object) -> object:
        self.solves += 1
        return self._factors.solve(*given)

    def __getattr__(self, name: str) -> object:
        return getattr(self._factors, name)


def sparse_factors(monkeypatch: pytest.MonkeyPatch) -> list[WatchedFactors]:
    """All that SciPy factorises from now on, watched."""
    made: list[WatchedFactors] = []
    original = spla.splu

    def watched(*given: object, **options: object) -> WatchedFactors:
        made.append(WatchedFactors(original(*given, **options)))
        return made[-1]

    monkeypatch.setattr(spla, "splu", watched)
    return made
