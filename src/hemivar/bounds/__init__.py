"""Guaranteed bounds of the distance to the exact solution, of trace constants and quantities; meshes that adapt."""

from __future__ import annotations

from hemivar.basics.first_use import on_demand

__getattr__, __dir__, __all__ = on_demand(__name__, __file__)
