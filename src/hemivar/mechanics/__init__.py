"""Bodies, supports, loads and foundations, and their discretisation by finite elements."""

from hemivar.mechanics.conditions import Clamped, Fixed, Prescribed, Pressure, Roller, Support, Traction
from hemivar.mechanics.discrete import DiscreteProblem, FieldMap
from hemivar.mechanics.discretize import discretize
from hemivar.mechanics.fields import nodal_average, strain, stress, v_norm, von_mises
from hemivar.mechanics.material import Material, PlaneState
from hemivar.mechanics.mesh import Mesh, box, read_mesh, rectangle
from hemivar.mechanics.obstacles import Cylinder, Normals, Obstacle, Plane, SignedDistance, Sphere
from hemivar.mechanics.problem import Contact, ContactProblem, Quadrature
from hemivar.mechanics.residual import Residual, residual
from hemivar.mechanics.transfer import interpolate, interpolation_matrix

__all__ = [
    "Clamped",
    "Contact",
    "ContactProblem",
    "Cylinder",
    "DiscreteProblem",
    "FieldMap",
    "Fixed",
    "Material",
    "Mesh",
    "Normals",
    "Obstacle",
    "Plane",
    "PlaneState",
    "Prescribed",
    "Pressure",
    "Quadrature",
    "Residual",
    "Roller",
    "SignedDistance",
    "Sphere",
    "Support",
    "Traction",
    "box",
    "discretize",
    "interpolate",
    "interpolation_matrix",
    "nodal_average",
    "read_mesh",
    "rectangle",
    "residual",
    "strain",
    "stress",
    "v_norm",
    "von_mises",
]
