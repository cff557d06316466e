"""Samples of which a few run by default; the others are slow tests, with the same seeds."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import TYPE_CHECKING, TypeVar

import pytest

if TYPE_CHECKING:
    from _pytest.mark.structures import ParameterSet

Sample = TypeVar("Sample")


def slow(*values: object) -> ParameterSet:
    """A case that is a slow test."""
    return pytest.param(*values, marks=pytest.mark.slow)


def sampled(samples: Iterable[Sample], quick: int | Collection[Sample] = 10) -> list[Sample | ParameterSet]:
    """All samples; each tenth from the first on, or another part, or those named run by default, others are slow."""
    every = list(samples)
    chosen = every[::quick] if isinstance(quick, int) else quick
    assert all(one in every for one in chosen)
    return [one if one in chosen else slow(*one) if isinstance(one, tuple) else slow(one) for one in every]
