"""The table [heat] of a problem file, read and written: heat in a body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.files.body_table import check_boundary
from hemivar.files.contact_table import SideFiles, _law_record, _Reader
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.toml import TomlTable, array, context, kind
from hemivar.formula import Formula
from hemivar.laws.registry import NORMAL_LAWS
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import Heat, HeatContact, Touching
from hemivar.mesh import Mesh

__all__ = ["HEAT_KEYS", "heat_record", "read_heat"]

_BY_REGION = ("conductivity", "capacity", "expansion", "thermal_stress")
_NUMBERS = ("coupling", "stress_free", "rtol")
#: Keys of [heat].
HEAT_KEYS = (*_BY_REGION, *_NUMBERS, "temperature", "supports", "flux", "source", "contact")
_CONTACT = ("conductance", "temperature", "share", "exchange")
_TOUCHING = ("closed", "per_pressure", "exponent")


def read_heat(table: TomlTable, problem: ContactProblem, reader: _Reader) -> Heat:
    """The table [heat] of a body."""
    mesh, dim = problem.mesh, problem.mesh.dim
    for key in ("conductivity", "capacity"):
        if key not in table:
            raise table.error(key, "is missing; heat needs a conductivity and a capacity")
    found: dict[str, Any] = {key: _by_region(table, key, mesh) for key in _BY_REGION if key in table}
    found |= {key: table.number(key, table.data[key]) for key in _NUMBERS if key in table}
    if "temperature" in table:
        found["temperature"] = table.quantity("temperature", table.data["temperature"], dim)
    if "source" in table:
        found["source"] = table.quantity("source", table.data["source"], dim, timed=True)
    for key, name in (("supports", "supports"), ("flux", "fluxes")):
        given = table.table(key, None, inline=True)
        for boundary in given.data:
            check_boundary(mesh, given, boundary)
        found[name] = {
            boundary: given.quantity(boundary, value, dim, timed=True) for boundary, value in given.data.items()
        }
    contact = table.table("contact", None)
    for boundary in contact.data:
        check_boundary(mesh, contact, boundary)
    found["contact"] = {name: _read_contact(contact.table(name, _CONTACT), reader) for name in contact.data}
    with context(f"{table.source}: [heat]"):
        heat = Heat(**found)
        heat.conduction(problem)
    return heat


def _by_region(table: TomlTable, key: str, mesh: Mesh) -> object:
    value = table.data[key]
    if not isinstance(value, dict):
        return _one(table, key, value, mesh.dim)
    parts = table.table(key, None, inline=True)
    for name in parts.data:
        if name not in mesh.regions:
            raise parts.error(name, f"the mesh has no region '{name}'{suggest(name, list(mesh.regions), 'regions')}")
    return {name: _one(parts, name, one, mesh.dim, key) for name, one in value.items()}


def _one(table: TomlTable, key: str, value: object, dim: int, what: str | None = None) -> object:
    if (what or key) == "conductivity" and isinstance(value, list):
        shape = f"a number, a formula, or {dim} lists of {dim} of these"
        rows = [table.items(key, row, (dim,), shape) for row in table.items(key, value, (dim,), shape)]
        return array([table.quantity(key, entry, dim) for row in rows for entry in row], (dim, dim))
    return table.quantity(key, value, dim, 0.0)


def _read_contact(table: TomlTable, reader: _Reader) -> HeatContact:
    found: dict[str, Any] = {}
    if "conductance" in table:
        value = table.data["conductance"]
        if isinstance(value, dict):
            given = table.table("conductance", _TOUCHING, inline=True)
            if "closed" not in given:
                raise given.error("closed", "is missing; give the conductance where there is contact")
            found["conductance"] = Touching(**{key: given.number(key, one) for key, one in given.data.items()})
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise table.error(
                "conductance", f"must be a number or {{ closed = 2.0, per_pressure = 0.1 }}, not {kind(value)}"
            )
        else:
            found["conductance"] = table.number("conductance", value)
    if "temperature" in table:
        found["temperature"] = table.quantity("temperature", table.data["temperature"], reader.dim, timed=True)
    if "share" in table:
        found["share"] = table.number("share", table.data["share"])
    if "exchange" in table:
        found["exchange"] = reader.law(table, "exchange", NORMAL_LAWS)
    with context(f"{table.source}: [{table.name}]"):
        return HeatContact(**found)


def heat_record(heat: Heat, aside: SideFiles) -> dict[str, object]:
    """The table [heat]."""
    record: dict[str, object] = {}
    for key in _BY_REGION:
        value = getattr(heat, key)
        if isinstance(value, Mapping):
            record[key] = {name: _said(one, f"heat.{key}['{name}']") for name, one in value.items()}
        elif value is not None:
            record[key] = _said(value, f"heat.{key}")
    defaults = Heat(1.0, 1.0)
    record |= {key: getattr(heat, key) for key in _NUMBERS if getattr(heat, key) != getattr(defaults, key)}
    for key in ("temperature", "source"):
        value = getattr(heat, key)
        if callable(value) or np.ndim(value) or value != 0.0:
            record[key] = quantity_record(value, f"heat.{key}")
    for key, values in (("supports", heat.supports), ("flux", heat.fluxes)):
        if values:
            record[key] = {name: quantity_record(one, f"heat.{key}['{name}']") for name, one in values.items()}
    if heat.contact:
        record["contact"] = {name: _contact_record(name, one, aside) for name, one in heat.contact.items()}
    return record


def _said(value: object, where: str) -> object:
    if isinstance(value, Formula) or (not callable(value) and np.ndim(value) == 0):  # type: ignore[arg-type]
        return quantity_record(value, where)
    entries = entries_record(value, where)
    size = round(len(entries) ** 0.5)
    return [entries[k * size : (k + 1) * size] for k in range(size)]


def _contact_record(name: str, contact: HeatContact, aside: SideFiles) -> dict[str, object]:
    where = f"heat.contact['{name}']"
    record: dict[str, object] = {}
    if isinstance(contact.conductance, Touching):
        said = contact.conductance
        record["conductance"] = {key: getattr(said, key) for key in _TOUCHING}
    elif callable(contact.conductance):
        raise not_expressible(f"{where}.conductance", contact.conductance, "a number, or HeatContact.touching(...)")
    elif contact.conductance:
        record["conductance"] = contact.conductance
    if callable(contact.temperature) or contact.temperature != 0.0:
        record["temperature"] = quantity_record(contact.temperature, f"{where}.temperature")
    if contact.share:
        record["share"] = contact.share
    if contact.exchange is not None:
        record["exchange"] = _law_record(contact.exchange, f"{where}.exchange", name, aside, NORMAL_LAWS)
    return record
