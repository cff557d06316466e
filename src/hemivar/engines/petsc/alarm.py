"""When work is to end before it is done: a limit of time, or a signal from outside."""

from __future__ import annotations

import math
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType

__all__ = ["CALLED", "LATE", "Alarm"]

#: What :meth:`Alarm.due` returns: nothing, the time is over, a signal has come.
LATE, CALLED = 1.0, 2.0

#: ``mpirun`` hands SIGUSR1 on without ending the ranks after it, as it does after the others.
_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP", "SIGUSR1")


class Alarm:
    """A limit of time and a bell for signals, looked at by the ranks together, each having its own.

    Parameters
    ----------
    limit : float
        Seconds from now.
    """

    def __init__(self, limit: float = math.inf) -> None:
        self.limit = limit
        self.began = time.perf_counter()
        self._called: float | None = None

    def start(self, limit: float) -> None:
        """Begin to count the time."""
        self.limit, self.began = limit, time.perf_counter()

    @property
    def spent(self) -> float:
        """Seconds since the start."""
        return time.perf_counter() - self.began

    def due(self) -> float:
        """:data:`CALLED`, :data:`LATE` or 0 on this rank; the largest over the ranks holds for all."""
        if self._called is not None:
            return CALLED
        return LATE if self.spent > self.limit else 0.0

    def ring(self) -> None:
        """End the work as a signal does."""
        self._called = time.perf_counter()

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Take the signals that ask a process to end as a call to stop in good order; a later one ends it at once."""

        def hear(number: int, _: FrameType | None) -> None:
            # a launcher and a terminal may both send the first one
            if self._called is not None and time.perf_counter() - self._called > 1.0:
                os._exit(128 + number)
            self.ring()

        before = {}
        for name in _SIGNALS:
            number = getattr(signal, name, None)
            with suppress(ValueError):  # only the main thread may
                if number is not None:
                    before[number] = signal.signal(number, hear)
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, signal.SIG_DFL if handler is None else handler)
