"""Late binding: what the method leaves to packages that use it, as ``solution.plot()``, is loaded when it is called.

Which entry leads where stands in one table of the package root, so that no package imports one above it.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from typing import Any

from hemivar.basics.first_use import IMPORTS
from hemivar.errors import MethodError

__all__ = ["MISSING", "above", "define_above", "defined_above"]

#: What messages say of a package that is not there.
MISSING = "not installed here; install all of hemivar"

_TABLE: dict[str, str] = {}


def define_above(table: Mapping[str, str]) -> None:
    """Learn where entries lead: ``"Type.method"`` or ``"module.function"`` to ``"package.module.name"`` of hemivar."""
    _TABLE.update(table)


def defined_above(entry: str) -> Callable[..., Any] | None:
    """What an entry leads to, loaded on first use; None where its package is not installed."""
    module, _, name = _TABLE[entry].rpartition(".")
    package = f"hemivar.{module.split('.')[0]}"
    with IMPORTS:
        try:
            importlib.import_module(package)
        except ImportError as error:
            if error.name == package:
                return None
            raise
        target: Callable[..., Any] = getattr(importlib.import_module(f"hemivar.{module}"), name)
    return target


def above(entry: str, what: str = "") -> Callable[..., Any]:
    """The function that an entry leads to; threads wait for one another."""
    target = defined_above(entry)
    if target is None:
        package = _TABLE[entry].split(".")[0]
        raise MethodError(f"{what or entry} is part of hemivar.{package}, which is {MISSING}")
    return target
