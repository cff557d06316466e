"""Thread safety: imports on first use, values computed on demand, and locks that survive a fork.

Python 3.11 locks each module while it is loaded.  Two threads that load the modules of one package from different ends
wait for each other, and one of them is given a module that is half loaded.  So whoever imports inside a function of
this package does it under one lock::

    with IMPORTS:
        from hemivar.report import plot_solution
"""

from __future__ import annotations

import functools
import os
import sys
import threading
import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING

import lazy_loader

__all__ = ["IMPORTS", "Lock", "cached_property", "on_demand"]

#: Held while a module is loaded on first use. A process that forks waits for it, so that no child has half a module.
IMPORTS = threading.RLock()


def on_demand(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """``__getattr__``, ``__dir__`` and ``__all__`` of a package whose names are loaded when they are first used.

    Which names there are, and where each comes from, stands in ``__init__.pyi`` beside the file of the package.
    """
    attached, names, public = lazy_loader.attach_stub(package, file)

    def load(name: str) -> object:
        with IMPORTS:
            return attached(name)

    return load, names, public


if TYPE_CHECKING or sys.version_info >= (3, 12):
    from functools import cached_property
else:

    class cached_property(functools.cached_property):  # noqa: N801
        """``functools.cached_property`` without its lock, as Python 3.12 has it.

        The lock of Python 3.11 belongs to the class: it makes threads with objects of their own wait for each other,
        and a child that is forked while another thread computes waits for ever.
        """

        def __get__(self, instance: object, owner: type | None = None) -> object:
            if instance is None:
                return self
            known = vars(instance)
            if self.attrname in known:
                return known[self.attrname]
            return known.setdefault(self.attrname, self.func(instance))


class Lock:
    """A lock that its holder may take again, and that is free in a child forked while another thread holds it."""

    def __init__(self) -> None:
        self._lock = threading.RLock()
        self._holder = 0
        _locks.add(self)

    def __enter__(self) -> None:
        self._lock.acquire()
        self._holder = threading.get_ident()

    def __exit__(self, *_: object) -> None:
        self._lock.release()

    def renew(self) -> None:
        """In a child: its only thread is the one that forked, and keeps what it held."""
        if self._holder != threading.get_ident():
            self._lock = threading.RLock()


_locks: weakref.WeakSet[Lock] = weakref.WeakSet()


def _renew() -> None:
    for lock in list(_locks):
        lock.renew()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(before=IMPORTS.acquire, after_in_parent=IMPORTS.release, after_in_child=IMPORTS.release)
    os.register_at_fork(after_in_child=_renew)
