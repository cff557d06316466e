"""The statement: bodies, materials, supports, loads, obstacles and foundations."""

from hemivar.mechanics.conditions import Clamped, Fixed, Prescribed, Pressure, Roller, Support, Traction
from hemivar.mechanics.material import Material, PlaneState
from hemivar.mechanics.obstacles import Cylinder, Normals, Obstacle, Plane, SignedDistance, Sphere
from hemivar.mechanics.statement import Contact, ContactProblem, Quadrature

__all__ = [
    "Clamped",
    "Contact",
    "ContactProblem",
    "Cylinder",
    "Fixed",
    "Material",
    "Normals",
    "Obstacle",
    "Plane",
    "PlaneState",
    "Prescribed",
    "Pressure",
    "Quadrature",
    "Roller",
    "SignedDistance",
    "Sphere",
    "Support",
    "Traction",
]
