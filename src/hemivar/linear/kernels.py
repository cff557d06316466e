"""Compiled Gauss-Seidel sweeps, loaded when they are first needed: small problems do without them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

__all__ = ["kernels"]


@lru_cache
def kernels() -> Any:
    """Those of pyamg, for matrices by rows."""
    from pyamg import amg_core

    return amg_core
