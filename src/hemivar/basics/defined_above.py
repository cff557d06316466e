"""Methods that hand their value on to a function of a room above, ``solution.plot()`` for instance.

Which method leads where stands in one table of the package root, so that no room imports one above it.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

from hemivar.basics.first_use import IMPORTS

__all__ = ["above", "hand_on"]

_TABLE: dict[str, str] = {}


def hand_on(table: Mapping[str, str]) -> None:
    """Learn where methods lead: ``"Type.method"`` to ``"room.module.function"``, below ``hemivar``."""
    _TABLE.update(table)


def above(method: str) -> Callable[..., Any]:
    """The function that a method leads to, loaded on first use; threads wait for one another.

    Parameters
    ----------
    method : str
        ``"Type.method"``, as the table has it.
    """
    module, _, function = _TABLE[method].rpartition(".")
    with IMPORTS:
        found: Callable[..., Any] = getattr(importlib.import_module(f"hemivar.{module}"), function)
    return found
