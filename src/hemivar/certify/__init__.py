"""Certificates: constants, error bounds and the kind of a point, recomputed from the problem alone."""

from hemivar.certify.bound import equilibrium_multiplier, trace_force
from hemivar.certify.certificate import Certificate, certify
from hemivar.certify.distance_to_exact import DistanceToExact
from hemivar.certify.norms import EnergyNorm, MultigridNorm, energy_norm, factorises
from hemivar.certify.smallness import Smallness, TraceConstants, ellipticity, one_solution, smallness, trace_constants
from hemivar.discrete.point_kind import PointKind

__all__ = [
    "Certificate",
    "DistanceToExact",
    "EnergyNorm",
    "MultigridNorm",
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

# ``hemivar.certify`` is the function: it leads to what is in this package of the same name.
vars(certify).update({name: value for name, value in globals().items() if not name.startswith("__")})
