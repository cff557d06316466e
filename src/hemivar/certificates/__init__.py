"""Certificates: constants, error bounds and the kind of a point, recomputed from the problem alone."""

from hemivar.certificates.certificate import Certificate, certify
from hemivar.certificates.norms import EnergyNorm, energy_norm
from hemivar.certificates.smallness import smallness
from hemivar.discrete.point_kind import PointKind

__all__ = ["Certificate", "EnergyNorm", "PointKind", "certify", "energy_norm", "smallness"]
