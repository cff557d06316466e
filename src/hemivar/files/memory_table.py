"""The key memory of a table [contact.NAME]: what contact points remember, read and written."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import quantity_record
from hemivar.files.toml import TomlTable, context, kind, listed
from hemivar.laws import memory

__all__ = ["memory_kinds", "memory_record", "read_memory"]


def memory_kinds() -> Mapping[str, Any]:
    """The memories that a problem file can state, by name: those whose fields are all parameters."""
    named: list[Any] = [getattr(memory, name) for name in memory.__all__]
    kinds = [one for one in named if inspect.isclass(one) and issubclass(one, memory.Memory) and is_dataclass(one)]
    return {one.name: one for one in kinds if all(_is_parameter(field) for field in fields(one))}


def _is_parameter(field: Field[object]) -> bool:
    return field.init and str(field.type).split(" ")[0] in ("Parameter", "float")


def read_memory(table: TomlTable, dim: int) -> tuple[memory.Memory, ...] | None:
    """The memories of a contact, in the order in which they are stated; None where nothing is said of them."""
    if "memory" not in table:
        return None
    kinds, value = memory_kinds(), table.data["memory"]
    example = 'memory = [{ kind = "secant" }]'
    if not isinstance(value, list):
        raise table.error("memory", f"must be a list such as {example}, not {kind(value)}")
    made = []
    for number, one in enumerate(value):
        if not isinstance(one, dict):
            raise table.error("memory", f"must be a list of tables such as {example}; it holds {kind(one)}")
        given = TomlTable(one, table.source, table.name, None, f"{table.prefix}memory[{number}].")
        if "kind" not in given:
            raise given.error("kind", f"is missing; add kind = one of {listed(list(kinds))}")
        name = given.text("kind", None, list(kinds))
        parts = fields(kinds[name])
        given.only(("kind", *(part.name for part in parts)))
        parameters: dict[str, object] = {}
        for part in parts:
            if part.name in given:
                parameters[part.name] = given.quantity(part.name, one[part.name], dim)
            elif part.default is MISSING and part.default_factory is MISSING:
                required = ", ".join(f"{p.name} = ..." for p in parts if p.default is MISSING)
                raise given.error(part.name, f'is missing; write {{ kind = "{name}", {required} }}')
        with context(f"{table.where('memory')}:"):
            remembered = kinds[name](**parameters)
            if not any(callable(value) for value in parameters.values()):
                remembered.at(None)
            made.append(remembered)
    return tuple(made)


def memory_record(memories: Sequence[Any], where: str) -> list[object]:
    """The list of a contact's memories."""
    kinds, record = memory_kinds(), list[object]()
    for number, stated in enumerate(memories):
        if kinds.get(getattr(stated, "name", "")) is not type(stated):
            raise not_expressible(f"{where}[{number}]", stated, f"memories of the kinds {', '.join(kinds)}")
        one: dict[str, object] = {"kind": stated.name}
        for part in fields(stated):
            value = getattr(stated, part.name)
            if part.default is MISSING or callable(value) or value != part.default:
                one[part.name] = quantity_record(value, f"{where}[{number}].{part.name}")
        record.append(one)
    return record
