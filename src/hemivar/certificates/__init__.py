"""Certificates: constants, error bounds and the kind of a point, recomputed from the problem alone."""

from hemivar.certificates.bound import equilibrium_multiplier, trace_force
from hemivar.certificates.certificate import Certificate, certify
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
