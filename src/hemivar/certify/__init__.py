"""Certificates: constants, error bounds and the kind of a point, recomputed from the problem alone."""

from hemivar.certify._kind import PointKind
from hemivar.certify._linear import EnergyNorm
from hemivar.certify.certificate import Certificate, certify
from hemivar.certify.smallness import Smallness, TraceConstants, ellipticity, smallness, trace_constants

__all__ = [
    "Certificate",
    "EnergyNorm",
    "PointKind",
    "Smallness",
    "TraceConstants",
    "certify",
    "ellipticity",
    "smallness",
    "trace_constants",
]
