"""Finite elements: from a statement to a discrete problem, and from its unknowns to fields."""

from hemivar.fem.discretize import discretize
from hemivar.fem.fields import gradient, nodal_average, strain, stress, v_norm, von_mises
from hemivar.fem.forms import FormBody, FormProblem
from hemivar.fem.load_line import LoadLine
from hemivar.fem.small_strain import Deformation, deformation
from hemivar.fem.transfer import interpolate

__all__ = [
    "Deformation",
    "FormBody",
    "FormProblem",
    "LoadLine",
    "deformation",
    "discretize",
    "gradient",
    "interpolate",
    "nodal_average",
    "strain",
    "stress",
    "v_norm",
    "von_mises",
]
