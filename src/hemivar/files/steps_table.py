"""The list [[steps]] of a problem file, read and written: load steps, each with what changes in it."""

from __future__ import annotations

from collections.abc import Mapping

from hemivar.basics.stated import stated_fields
from hemivar.files.body_table import named_supports_record, read_loads, read_supports, tractions_record
from hemivar.files.schema import written
from hemivar.files.toml import KEYS, TomlTable, context, kind
from hemivar.mechanics.load_steps import Step
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh import Mesh

__all__ = ["read_steps", "steps_record"]

#: What a step may say of the loads.
_LOADS = ("body", "traction", "pressure", "stress", "strain")


def read_steps(top: TomlTable, mesh: Mesh) -> tuple[Step, ...]:
    """The load steps of a file."""
    given = top.data["steps"]
    if not isinstance(given, list) or not all(isinstance(one, dict) for one in given):
        raise top.error("steps", f"must be a list of tables, not {kind(given)}; write [[steps]] above each")
    return tuple(_step(TomlTable(one, top.source, f"steps.{k}", KEYS["steps"]), mesh) for k, one in enumerate(given))


def _step(table: TomlTable, mesh: Mesh) -> Step:
    name, ramp = table.text("name"), table.data.get("ramp", True)
    if not isinstance(ramp, bool):
        raise table.error("ramp", f"must be true or false, not {kind(ramp)}")
    loads = read_loads(table.table("loads", _LOADS), mesh, False)
    given = table.table("bolts", None)
    bolts = {boundary: given.number(boundary, force) for boundary, force in given.data.items()}
    with context(f"{table.source}: [{table.name}]"):
        return Step(name, read_supports(table, mesh, False), bolts=bolts, ramp=ramp, **loads)  # type: ignore[arg-type]


def steps_record(problem: ContactProblem) -> list[dict[str, object]]:
    """The load steps of a problem."""
    return [_record(step, problem.mesh.dim) for step in problem.steps]


def _record(step: Step, dim: int) -> dict[str, object]:
    loads: dict[str, object] = {}
    for key, (field, stated) in stated_fields(ContactProblem, "loads").items():
        if key in _LOADS and field.name != "tractions" and step.changes(field.name):
            value = getattr(step, field.name)
            none = field.name == "body_force" and value == 0.0  # the number 0 means no vector
            loads[key] = [0.0] * dim if none else written(value, stated.form, f"step '{step.name}': {field.name}")
    loads |= tractions_record(step.tractions, dim)
    record: dict[str, object] = {"name": step.name} | ({} if step.ramp else {"ramp": False})
    supports = named_supports_record(step.supports)
    parts: Mapping[str, object] = {"loads": loads, "supports": supports, "bolts": dict(step.bolts)}
    return record | {key: part for key, part in parts.items() if part}
