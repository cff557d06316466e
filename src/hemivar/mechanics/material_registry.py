"""The nonlinear materials by name: one table for problem files, for the list of materials, and for whoever adds one."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import cast

from hemivar.errors import ProblemError
from hemivar.laws.registry import LawEntry, LawKind, LawParameter, ParameterForm
from hemivar.mechanics.material import Material
from hemivar.mechanics.moduli import Branch, Moduli, Number, Viscosity

__all__ = ["MATERIAL_LAWS", "named_material"]

_STRESS = "force/area"
_PLANE = LawParameter(
    "plane",
    "what a plane mesh assumes across the plane",
    "strain or stress",
    "strain",
    form=ParameterForm.TEXT,
    choices=("strain", "stress"),
)
_BULK = LawParameter("bulk", "bulk modulus", _STRESS, example=6.5)


def _ramberg_osgood(
    young: Number,
    poisson: Number,
    yield_stress: Number,
    exponent: Number,
    offset: Number = 3.0 / 7.0,
    linear_from: Number | None = None,
    plane: str = "strain",
    density: Number | None = None,
    viscosity: Moduli | Viscosity | None = None,
    branches: Sequence[Branch] = (),
) -> Material:
    return Material.ramberg_osgood(
        young, poisson, yield_stress, exponent, offset, linear_from, plane,
        density=density, viscosity=viscosity, branches=branches,
    )  # fmt: skip


_ENTRIES = (
    LawEntry(
        "hencky",
        LawKind.MATERIAL,
        cast(Callable[..., object], Material.hencky),
        "elastic in volume, with a shear modulus that softens as the strain grows (deformation theory)",
        "sigma = bulk tr(eps) I + 2 shear (q + (1 - q)/sqrt(1 + |dev eps|^2/strain^2)) dev eps, q = softened",
        (
            _BULK,
            LawParameter("shear", "shear modulus at small strain", _STRESS, example=4.0),
            LawParameter("softened", "part of the shear modulus left at large strain, at most 1", "1", example=0.25),
            LawParameter("strain", "size of the deviator |dev eps| at which it softens", "1", example=0.05),
            _PLANE,
        ),
    ),
    LawEntry(
        "ramberg-osgood",
        LawKind.MATERIAL,
        _ramberg_osgood,
        "metal in the deformation theory of plasticity, with von Mises' stress",
        "a bar stretches by sigma/young + offset (sigma/young) (sigma/yield_stress)^(exponent - 1)",
        (
            LawParameter("young", "Young's modulus at small strain", _STRESS, example=200e3),
            LawParameter("poisson", "Poisson's ratio at small strain", "1", example=0.3),
            LawParameter("yield_stress", "yield stress", _STRESS, example=400.0),
            LawParameter("exponent", "of the stress; 5 to 20 for metals", "1", minimum=1.0, example=5.0),
            LawParameter("offset", "plastic over elastic strain at the yield stress", "1", 3.0 / 7.0),
            LawParameter(
                "linear_from",
                "|dev eps| from which on the stress grows linearly; left out: no bound holds",
                "1",
                optional=True,
                example=0.02,
            ),
            _PLANE,
        ),
    ),
    LawEntry(
        "locking",
        LawKind.MATERIAL,
        cast(Callable[..., object], Material.locking),
        "elastic with projection on a convex set of strains, beyond which it stiffens",
        "sigma = C eps + stiffening (eps - P eps), P the projection on |dev eps| <= strain",
        (
            _BULK,
            LawParameter("shear", "shear modulus", _STRESS, example=4.0),
            LawParameter("stiffening", "stiffness added beyond the set", _STRESS, example=20.0),
            LawParameter("strain", "size of the set", "1", example=0.03),
            LawParameter(
                "measure",
                "what is limited: the size of the deviator or of the whole strain",
                "deviator or strain",
                "deviator",
                form=ParameterForm.TEXT,
                choices=("deviator", "strain"),
            ),
            _PLANE,
        ),
    ),
    LawEntry(
        "potential",
        LawKind.MATERIAL,
        cast(Callable[..., object], Material.potential),
        "stored energy as a formula of tr and dev2 = |dev eps|^2, or of exx, eyy, ezz, eyz, exz, exy",
        "W(eps) = energy",
        (
            LawParameter(
                "energy",
                "formula of the stored energy",
                "force/area",
                form=ParameterForm.TEXT,
                example="3.3*tr^2 + dev2 + 0.015*(sqrt(1 + 400*dev2) - 1)",
            ),
            LawParameter("reach", "size |eps| of the strain up to which it is examined", "1", example=0.2),
            _PLANE,
        ),
    ),
)

#: Nonlinear materials by name.
MATERIAL_LAWS: Mapping[str, LawEntry] = MappingProxyType({entry.name: entry for entry in _ENTRIES})


def named_material(name: str, **values: object) -> Material:
    """The material of this name, such as ``named_material("locking", bulk=6.7, shear=4.0, ...)``.

    Raises
    ------
    ProblemError
        There is none of this name, or a constant is missing or unknown.
    """
    if name not in MATERIAL_LAWS:
        raise ProblemError(f"material '{name}' is not known; the materials are {', '.join(MATERIAL_LAWS)}")
    return cast(Material, MATERIAL_LAWS[name].make(**values))
