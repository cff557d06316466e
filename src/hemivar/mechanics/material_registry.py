"""The nonlinear materials by name: one table for problem files, for the list of materials, and for whoever adds one."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from types import MappingProxyType
from typing import cast

from hemivar.errors import ProblemError
from hemivar.laws.registry import LawEntry, LawKind
from hemivar.mechanics.material import Material
from hemivar.mechanics.named_energies import Hencky, Locking, RambergOsgood
from hemivar.mechanics.own_energies import own_energy

__all__ = ["MATERIAL_LAWS", "named_material"]

_material = partial(LawEntry, LawKind.MATERIAL)
_ENTRIES = (
    _material(
        "hencky",
        Hencky,
        "elastic in volume, with a shear modulus that softens as the strain grows (deformation theory)",
        "sigma = bulk tr(eps) I + 2 shear (q + (1 - q)/sqrt(1 + |dev eps|^2/strain^2)) dev eps, q = softened",
    ),
    _material(
        "ramberg-osgood",
        RambergOsgood,
        "metal in the deformation theory of plasticity, with von Mises' stress",
        "a bar stretches by sigma/young + offset (sigma/young) (sigma/yield_stress)^(exponent - 1)",
    ),
    _material(
        "locking",
        Locking,
        "elastic with projection on a convex set of strains, beyond which it stiffens",
        "sigma = C eps + stiffening (eps - P eps), P the projection on |dev eps| <= strain",
    ),
    _material(
        "potential",
        own_energy,
        "stored energy as a formula of tr and dev2 = |dev eps|^2, or of exx, eyy, ezz, eyz, exz, exy",
        "W(eps) = energy",
    ),
)

#: Nonlinear materials by name.
MATERIAL_LAWS: Mapping[str, LawEntry] = MappingProxyType({entry.name: entry for entry in _ENTRIES})


def named_material(name: str, **values: object) -> Material:
    """The material of this name, such as ``named_material("locking", bulk=6.7, shear=4.0, ...)``."""
    if name not in MATERIAL_LAWS:
        raise ProblemError(f"material '{name}' is not known; the materials are {', '.join(MATERIAL_LAWS)}")
    return cast(Material, MATERIAL_LAWS[name].make(**values))
