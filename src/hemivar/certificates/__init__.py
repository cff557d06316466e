"""Certificates: constants, error bounds and the kind of a point, recomputed from the problem alone."""

import importlib
from types import ModuleType

from hemivar.basics.first_use import IMPORTS
from hemivar.certificates.bound import equilibrium_multiplier, trace_force
from hemivar.certificates.certificate import Certificate, certify
from hemivar.certificates.distance_to_exact import DistanceToExact
from hemivar.certificates.norms import EnergyNorm, energy_norm, factorises
from hemivar.certificates.smallness import (
    Smallness,
    TraceConstants,
    ellipticity,
    one_solution,
    smallness,
    trace_constants,
)
from hemivar.discrete.point_kind import PointKind

__all__ = [
    "Certificate",
    "DistanceToExact",
    "EnergyNorm",
    "PointKind",
    "Smallness",
    "TraceConstants",
    "certify",
    "ellipticity",
    "energy_norm",
    "equilibrium_multiplier",
    "factorises",
    "one_solution",
    "smallness",
    "trace_constants",
    "trace_force",
]


def __getattr__(name: str) -> ModuleType:
    if name == "MultigridNorm":
        raise AttributeError(f"hemivar.certificates.{name} was removed; take EnergyNorm.by_multigrid(problem)")
    if name != "continuous":
        raise AttributeError(f"module 'hemivar.certificates' has no attribute '{name}'")
    with IMPORTS:
        return importlib.import_module("hemivar.certificates.continuous")
