"""Compiled Gauss-Seidel sweeps, loaded when they are first needed: small problems do without them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

from hemivar.basics.first_use import IMPORTS

__all__ = ["kernels"]


@lru_cache
def kernels() -> Any:
    """Those of pyamg, for matrices by rows."""
    with IMPORTS:
        from pyamg import amg_core

    return amg_core
