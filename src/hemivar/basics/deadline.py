"""The time that a piece of work may take, for rooms that do not know of one another.

Whoever limits the time says ``with limited(Budget(seconds)):``; long loops below call :func:`check_time`, which raises
:class:`OutOfTime` once the time is up.  The limit belongs to the thread that set it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from hemivar.basics.arguments import number

__all__ = ["CALLED", "LATE", "Budget", "OutOfTime", "check_time", "limited"]

#: What :meth:`Budget.due` returns: the time is over; somebody has asked for the end.
LATE, CALLED = 1.0, 2.0


class OutOfTime(Exception):  # noqa: N818 - a signal, not an error
    """Raised inside a method when the time limit is reached."""


_LIMITS: ContextVar[tuple[Budget, ...]] = ContextVar("limits", default=())


@dataclass(frozen=True)
class Budget:
    """The time that is left."""

    limit: float  # seconds
    started: float = field(default_factory=lambda: time.perf_counter())  # on the clock of ``time.perf_counter``

    def __post_init__(self) -> None:
        number(self.limit, "the time limit", "give seconds")

    @property
    def spent(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self.started

    @property
    def left(self) -> float:
        """Seconds until the end, at least 0."""
        return max(self.limit - self.spent, 0.0)

    def due(self) -> float:
        """:data:`LATE` once the limit is passed, or that of a block around this call, else 0.

        Budgets that can be ended from outside say :data:`CALLED`.
        """
        return LATE if any(budget.spent > budget.limit for budget in (self, *_LIMITS.get())) else 0.0

    def check(self) -> None:
        """Raise :class:`OutOfTime` once the limit is passed."""
        if self.due():
            raise OutOfTime


@contextmanager
def limited(budget: Budget) -> Iterator[None]:
    """Within this block :func:`check_time` knows of the budget, and of those around it."""
    token = _LIMITS.set((*_LIMITS.get(), budget))
    try:
        yield
    finally:
        _LIMITS.reset(token)


def check_time() -> None:
    """Raise :class:`OutOfTime` if the time of a block around this call is up; without a limit, nothing happens."""
    for budget in _LIMITS.get():
        budget.check()
