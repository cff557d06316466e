"""Materials: linear with viscosity, relaxation and regions, or by a stored energy of one's own."""

from hemivar.mechanics.material import Material
from hemivar.mechanics.material_check import MaterialError, MaterialReport, check_material
from hemivar.mechanics.material_description import MaterialDescription
from hemivar.mechanics.material_words import BoundsBy, PlaneState, StrainMeasure
from hemivar.mechanics.moduli import Branch
from hemivar.mechanics.stored_energy import InvariantEnergy, Invariants, IsotropicBounds, StoredEnergy

__all__ = [
    "BoundsBy",
    "Branch",
    "InvariantEnergy",
    "Invariants",
    "IsotropicBounds",
    "Material",
    "MaterialDescription",
    "MaterialError",
    "MaterialReport",
    "PlaneState",
    "StoredEnergy",
    "StrainMeasure",
    "check_material",
]
