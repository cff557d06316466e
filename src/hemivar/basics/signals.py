"""Signals that are handled for a while, and then as they were before."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["handled"]

Handler = Callable[[int, FrameType | None], object] | signal.Handlers


@contextmanager
def handled(handler: Handler, *names: str, taken: Callable[[object], bool] = lambda before: True) -> Iterator[None]:
    """Signals of these names are handled inside the block, in the main thread, for only that may.

    ``taken`` says by what handles a signal before whether it is taken from it.
    """
    before = {}
    for name in names if threading.current_thread() is threading.main_thread() else ():
        number = getattr(signal, name, None)
        if number is not None and taken(signal.getsignal(number)):
            before[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, old in before.items():
            signal.signal(number, signal.SIG_DFL if old is None else old)
