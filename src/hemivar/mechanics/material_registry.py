"""The nonlinear materials by name, for problem files and lists: what the files of this package say of themselves."""

from __future__ import annotations

from typing import cast

from hemivar import mechanics
from hemivar.errors import ProblemError
from hemivar.laws.named import LawKind, named_in
from hemivar.mechanics.material import Material

__all__ = ["MATERIAL_LAWS", "named_material"]

#: Nonlinear materials by name.
MATERIAL_LAWS = named_in(LawKind.MATERIAL, mechanics)


def named_material(name: str, **values: object) -> Material:
    """The material of this name, such as ``named_material("locking", bulk=6.7, shear=4.0, ...)``."""
    if name not in MATERIAL_LAWS:
        raise ProblemError(f"material '{name}' is not known; the materials are {', '.join(MATERIAL_LAWS)}")
    return cast(Material, MATERIAL_LAWS[name].make(**values))
