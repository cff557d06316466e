"""Kits that try whether an object of a user is consistent with itself: the steps, the report, and what all ask."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from hemivar.basics.types import Array
from hemivar.errors import HemivarError

__all__ = ["ConformanceError", "ConformanceReport", "Step", "change_and_integral", "failures_of"]

#: What is checked, in words that complete "it is not: ...", and the check; it says what is wrong, or nothing.
Step = tuple[str, Callable[[], str | None]]

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)


class ConformanceError(HemivarError, AssertionError):
    """An object contradicts itself; the message lists how."""


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

    #: What was checked, in one word, and what is raised where something is wrong.
    subject: ClassVar[str] = "object"
    error: ClassVar[type[ConformanceError]] = ConformanceError

    @property
    def passed(self) -> bool:
        """Whether nothing is wrong."""
        return not self.failures

    def __str__(self) -> str:
        if self.passed:
            return f"{self.subject} '{self.name}': {len(self.checks)} checks passed"
        listed = "".join(f"\n  - {failure}" for failure in self.failures)
        return f"{self.subject} '{self.name}' fails {len(self.failures)} of {len(self.checks)} checks:{listed}"

    def or_raised(self, raises: bool) -> Self:
        """The report, unless something is wrong and that is to be raised."""
        if raises and self.failures:
            raise self.error(str(self))
        return self


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


def change_and_integral(
    of: Callable[[Array], Array], rate: Callable[[Array, Array], Array], start: Array, step: Array
) -> tuple[Array, Array]:
    """The change of an answer along steps ``(k, ...)``, and the integral of its rate, which has to be the same.

    Shapes: ``of`` (k, ...), ``start`` (k, ...), ``step`` (k, ...).
    """
    parts = [
        0.5 * weight * rate(start + 0.5 * (1.0 + node) * step, step)
        for node, weight in zip(_NODES, _WEIGHTS, strict=True)
    ]
    return np.asarray(of(start + step)) - of(start), np.sum(parts, axis=0)
