"""The statement: bodies, materials, supports, loads, obstacles and foundations."""

from hemivar.mechanics.conditions import Clamped, Fixed, Prescribed, Pressure, RigidPlate, Roller, Spring, Traction
from hemivar.mechanics.foundation import Contact
from hemivar.mechanics.gradient_energy import PowerLaw, SaturatingFlux
from hemivar.mechanics.load_steps import Step
from hemivar.mechanics.material import Material
from hemivar.mechanics.material_check import check_material
from hemivar.mechanics.minimal_support import minimal_support
from hemivar.mechanics.moduli import Branch
from hemivar.mechanics.obstacles import Cylinder, Normals, Plane, SignedDistance, Sphere
from hemivar.mechanics.scalar import ScalarContact, ScalarProblem
from hemivar.mechanics.statement import ContactProblem, Quadrature
from hemivar.mechanics.stored_energy import InvariantEnergy, Invariants, IsotropicBounds, StoredEnergy
from hemivar.mechanics.thermal import Heat, HeatContact

__all__ = [
    "Branch",
    "Clamped",
    "Contact",
    "ContactProblem",
    "Cylinder",
    "Fixed",
    "Heat",
    "HeatContact",
    "InvariantEnergy",
    "Invariants",
    "IsotropicBounds",
    "Material",
    "Normals",
    "Plane",
    "PowerLaw",
    "Prescribed",
    "Pressure",
    "Quadrature",
    "RigidPlate",
    "Roller",
    "SaturatingFlux",
    "ScalarContact",
    "ScalarProblem",
    "SignedDistance",
    "Sphere",
    "Spring",
    "Step",
    "StoredEnergy",
    "Traction",
    "check_material",
    "minimal_support",
]
