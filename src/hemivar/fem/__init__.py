"""Finite elements: from a statement to a discrete problem, and from its unknowns to fields."""

from hemivar.fem.discretize import discretize
from hemivar.fem.error_norms import ErrorNorms, KnownField, error_norms
from hemivar.fem.fields import gradient, nodal_average, strain, stress, v_norm, von_mises
from hemivar.fem.forms import FormBody, FormProblem
from hemivar.fem.load_line import LoadLine
from hemivar.fem.mixed_bulk import MixedBulk
from hemivar.fem.reactions import support_reactions
from hemivar.fem.small_strain import Deformation, deformation
from hemivar.fem.transfer import interpolate, interpolation_matrix

__all__ = [
    "Deformation",
    "ErrorNorms",
    "FormBody",
    "FormProblem",
    "KnownField",
    "LoadLine",
    "MixedBulk",
    "deformation",
    "discretize",
    "error_norms",
    "gradient",
    "interpolate",
    "interpolation_matrix",
    "nodal_average",
    "strain",
    "stress",
    "support_reactions",
    "v_norm",
    "von_mises",
]
