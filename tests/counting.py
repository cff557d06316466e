"""Measures of work that no clock disturbs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import pytest

from hemivar.basics.deadline import Budget

__all__ = ["at_most_calls", "time_by_looks"]


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
