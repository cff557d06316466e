"""Materials: linear with viscosity, relaxation and regions, or by a stored energy of one's own."""

from hemivar.mechanics.material import Material
from hemivar.mechanics.material_check import check_material
from hemivar.mechanics.moduli import Branch
from hemivar.mechanics.stored_energy import InvariantEnergy, Invariants, IsotropicBounds, StoredEnergy

__all__ = [
    "Branch",
    "InvariantEnergy",
    "Invariants",
    "IsotropicBounds",
    "Material",
    "StoredEnergy",
    "check_material",
]
