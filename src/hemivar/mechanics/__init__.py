"""The statement: bodies, materials, supports, loads, obstacles and foundations."""

from hemivar.mechanics.conditions import Clamped, Fixed, Prescribed, Pressure, Roller, Support, Traction
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.gradient_energy import GradientEnergy, PowerLaw, SaturatingFlux
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_check import MaterialError, MaterialReport, check_material
from hemivar.mechanics.material_description import MaterialDescription
from hemivar.mechanics.material_words import BoundsBy, PlaneState, ScalarKind, StrainMeasure
from hemivar.mechanics.moduli import Branch
from hemivar.mechanics.obstacles import Cylinder, Normals, Obstacle, Plane, SignedDistance, Sphere
from hemivar.mechanics.scalar import ScalarContact, ScalarProblem
from hemivar.mechanics.statement import ContactProblem, Geometry, Quadrature
from hemivar.mechanics.stored_energy import InvariantEnergy, Invariants, IsotropicBounds, StoredEnergy
from hemivar.mechanics.thermal import Heat, HeatContact

__all__ = [
    "BoundsBy",
    "Branch",
    "Clamped",
    "Contact",
    "ContactProblem",
    "Cylinder",
    "Fixed",
    "Geometry",
    "GradientEnergy",
    "Heat",
    "HeatContact",
    "InvariantEnergy",
    "Invariants",
    "IsotropicBounds",
    "Material",
    "MaterialDescription",
    "MaterialError",
    "MaterialReport",
    "Normals",
    "Obstacle",
    "Plane",
    "PlaneState",
    "PowerLaw",
    "Prescribed",
    "Pressure",
    "Quadrature",
    "Roller",
    "SaturatingFlux",
    "ScalarContact",
    "ScalarKind",
    "ScalarProblem",
    "Side",
    "SignedDistance",
    "Sphere",
    "StoredEnergy",
    "StrainMeasure",
    "Support",
    "Traction",
    "check_material",
]
