"""Certificates: constants, error bounds and the kind of a point, recomputed from the problem alone."""

from hemivar.certificates.certificate import Certificate, certify
from hemivar.certificates.norms import EnergyNorm, energy_norm, factorises
from hemivar.certificates.smallness import Smallness, ellipticity, smallness, trace_constants
from hemivar.discrete.point_kind import PointKind

__all__ = [
    "Certificate",
    "EnergyNorm",
    "PointKind",
    "Smallness",
    "certify",
    "ellipticity",
    "energy_norm",
    "factorises",
    "smallness",
    "trace_constants",
]
