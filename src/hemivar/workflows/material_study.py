"""One nonlinear material: its constants and bounds, for values that are given or that show what it does."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import cast

from hemivar.basics.arguments import suggest
from hemivar.basics.display import brief
from hemivar.errors import ProblemError
from hemivar.laws.registry import LawEntry
from hemivar.mechanics import Material
from hemivar.mechanics.material_registry import MATERIAL_LAWS
from hemivar.workflows.law_study import Value, values_shown

__all__ = ["MaterialStudy", "study_material"]


@dataclass(frozen=True, eq=False)
class MaterialStudy:
    """A material of the registry.

    Attributes
    ----------
    entry : LawEntry
        Its line in the registry.
    material : Material
        ``material.describe()`` has constants and bounds.
    examples : mapping of name to value
        Constants that were not given, with the values that show what the material does.
    """

    entry: LawEntry
    material: Material
    examples: Mapping[str, Value] = field(default_factory=dict)

    __repr__ = brief


def study_material(
    name: str, constants: Mapping[str, Value] | None = None, *, label: str = "constant "
) -> MaterialStudy:
    """The material of a name.

    Parameters
    ----------
    name : str
        "hencky", "ramberg-osgood", "locking" or "potential".
    constants : mapping of name to value
        Examples stand for those that are left out.
    label : str
        What stands before the name of a constant in messages.

    Raises
    ------
    ProblemError
        No such material or constant, or a value that the material does not take.
    """
    if name not in MATERIAL_LAWS:
        raise ProblemError(f"material '{name}' is not known{suggest(name, list(MATERIAL_LAWS))}")
    entry = MATERIAL_LAWS[name]
    values, examples = values_shown(entry, {} if constants is None else constants, label)
    return MaterialStudy(entry, cast(Material, entry.make(**values)), examples)
