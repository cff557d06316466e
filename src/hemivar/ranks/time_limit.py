"""When work is to end before it is done: a limit of time, or a signal from outside."""

from __future__ import annotations

import math
import os
import time
from contextlib import AbstractContextManager
from types import FrameType

from hemivar.basics.deadline import CALLED, Budget
from hemivar.basics.signals import handled

__all__ = ["TimeLimit"]

#: ``mpirun`` hands SIGUSR1 on without ending the ranks after it, as it does after the others.
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1")


class TimeLimit(Budget):
    """A limit of time, and the signals that came, looked at by the ranks together, each having its own."""

    def __init__(self, limit: float = math.inf, signals: list[float] | None = None) -> None:
        super().__init__(limit)
        self._signals: list[float]
        object.__setattr__(self, "_signals", [] if signals is None else signals)

    def limited(self, limit: float) -> TimeLimit:
        """The same signals with another limit of time, from now."""
        return TimeLimit(limit, self._signals)

    def due(self) -> float:
        """:data:`CALLED`, :data:`LATE` or 0 on this rank; the largest over the ranks holds for all."""
        return CALLED if self._signals else super().due()

    def ring(self) -> None:
        """End the work as a signal does."""
        self._signals.append(time.perf_counter())

    def listening(self) -> AbstractContextManager[None]:
        """Take the signals that ask a process to end as a call to stop in good order; a later one ends it at once."""

        def hear(number: int, _: FrameType | None) -> None:
            # a launcher and a terminal may both send the first one
            if self._signals and time.perf_counter() - self._signals[0] > 1.0:
                os._exit(128 + number)
            self.ring()

        return handled(hear, *_SIGNALS)
