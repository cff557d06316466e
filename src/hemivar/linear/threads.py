"""One BLAS thread for dense linear algebra while multigrid works: its dense matrices are too small to be shared out."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from hemivar.basics.first_use import IMPORTS, Lock

__all__ = ["one_thread"]

_lock = Lock()


@lru_cache
def _libraries() -> tuple[Any, ...]:
    with IMPORTS:
        from threadpoolctl import ThreadpoolController

    return tuple(ThreadpoolController().select(user_api="blas").lib_controllers)


class _Limit:
    """One thread for some libraries, from the first that asks to the last that is done."""

    def __init__(self) -> None:
        self.users = 0
        self.before: list[tuple[Any, int]] = []

    def enter(self, libraries: list[Any]) -> None:
        self.users += 1
        if self.users == 1:
            for library in libraries:
                threads = library.get_num_threads()
                _set(library, 1)
                if threads is not None and library.get_num_threads() != threads:
                    self.before.append((library, threads))

    def leave(self) -> None:
        self.users -= 1
        if self.users == 0:
            while self.before:
                _set(*self.before.pop())


class _OfThread(threading.local):
    """Of libraries in which each thread has a limit of its own."""

    def __init__(self) -> None:
        self.limit = _Limit()


_shared = _Limit()
_own = _OfThread()


def _set(library: Any, threads: int) -> None:
    library.set_num_threads(threads)
    # Newer versions of threadpoolctl let only the thread that set a limit change it while that thread lives; here
    # the last one restores it, whichever that is.
    release = getattr(type(library), "clear_controlling_thread", None)
    if release is not None:
        release()


@contextmanager
def one_thread(wanted: bool = True) -> Iterator[None]:
    """A context in which BLAS takes one thread, if ``wanted``; threads may enter and leave it in any order.

    With two threads on two cores, products of vectors and factorisations of matrices of a few hundred rows take
    longer than with one, for the threads wait for each other: a contact solve at 1/h = 512 takes half as long again.
    The limit holds for the whole process where the library knows no other; it ends when the last thread leaves.
    """
    if not wanted:
        yield
        return
    with _lock:
        each = [library for library in _libraries() if getattr(library, "threading_layer", "") == "openmp"]
        _shared.enter([library for library in _libraries() if library not in each])
        _own.limit.enter(each)
    try:
        yield
    finally:
        with _lock:
            _shared.leave()
            _own.limit.leave()
