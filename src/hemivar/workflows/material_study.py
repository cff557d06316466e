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
    """A material of the registry."""

    entry: LawEntry
    material: Material
    examples: Mapping[str, Value] = field(default_factory=dict)

    __repr__ = brief


def study_material(
    name: str, constants: Mapping[str, Value] | None = None, *, label: str = "constant "
) -> MaterialStudy:
    """The material of a name."""
    if name not in MATERIAL_LAWS:
        raise ProblemError(f"material '{name}' is not known{suggest(name, list(MATERIAL_LAWS))}")
    entry = MATERIAL_LAWS[name]
    values, examples = values_shown(entry, {} if constants is None else constants, label)
    return MaterialStudy(entry, cast(Material, entry.make(**values)), examples)
