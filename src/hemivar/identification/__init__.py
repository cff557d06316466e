"""Laws from measurements, an inverse problem: parameters that fit a measured curve, and what the curve leaves open."""

from __future__ import annotations

from hemivar.basics.first_use import on_demand

__getattr__, __dir__, __all__ = on_demand(__name__, __file__)
