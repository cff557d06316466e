"""Kits that try whether an object of a user is consistent with itself: the steps, and the report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

__all__ = ["ConformanceReport", "failures_of"]

#: What is checked, in words that complete "it is not: ...", and the check; it says what is wrong, or nothing.
Step = tuple[str, Callable[[], str | None]]


@dataclass(frozen=True)
class ConformanceReport:
    """What a kit tried and found.

    Attributes
    ----------
    name : str
        Name of what was checked.
    checks : tuple of str
        What was checked.
    failures : tuple of str
        What is wrong; empty if all is in order.
    """

    name: str
    checks: tuple[str, ...]
    failures: tuple[str, ...] = ()

    #: What was checked, in one word.
    subject: ClassVar[str] = "object"

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        return not self.failures

    def __str__(self) -> str:
        if self.passed:
            return f"{self.subject} '{self.name}': {len(self.checks)} checks passed"
        listed = "".join(f"\n  - {failure}" for failure in self.failures)
        return f"{self.subject} '{self.name}' fails {len(self.failures)} of {len(self.checks)} checks:{listed}"


def failures_of(steps: Sequence[Step]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The checks made and what is wrong; after the first step none is made if that fails, for they build on it."""
    checks, failures = [], []
    for name, step in steps:
        checks.append(name)
        try:
            with np.errstate(all="ignore"):
                wrong = step()
        except Exception as error:
            wrong = f"{type(error).__name__}: {error}"
        if wrong:
            failures.append(f"{name}: it is not: {wrong}")
            if len(checks) == 1:
                break
    return tuple(checks), tuple(failures)
