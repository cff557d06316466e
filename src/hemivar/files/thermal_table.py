"""The table [heat] of a problem file, read and written: heat in a body."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import keys_of
from hemivar.files.body_table import check_boundary
from hemivar.files.contact_table import SideFiles, _law_record, _Reader
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.schema import decode, encode
from hemivar.files.toml import TomlTable, array, context, kind
from hemivar.formula import Formula
from hemivar.laws.registry import NORMAL_LAWS
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import Heat, HeatContact, Touching
from hemivar.mesh import Mesh

__all__ = ["HEAT_KEYS", "heat_record", "read_heat"]

_BY_REGION = ("conductivity", "capacity", "expansion", "thermal_stress")
#: Keys of [heat].
HEAT_KEYS = keys_of(Heat)


def read_heat(table: TomlTable, problem: ContactProblem, reader: _Reader) -> Heat:
    """The table [heat] of a body."""
    mesh, dim = problem.mesh, problem.mesh.dim
    for key in ("conductivity", "capacity"):
        if key not in table:
            raise table.error(key, "is missing; heat needs a conductivity and a capacity")

    def along(given: TomlTable, key: str) -> dict[str, object]:
        named = given.table(key, None, inline=True)
        for boundary in named.data:
            check_boundary(mesh, named, boundary)
        return {name: named.quantity(name, value, dim, timed=True) for name, value in named.data.items()}

    def contact(given: TomlTable) -> dict[str, HeatContact]:
        parts = given.table("contact", None)
        for boundary in parts.data:
            check_boundary(mesh, parts, boundary)
        return {name: _read_contact(parts.table(name, keys_of(HeatContact)), reader) for name in parts.data}

    found = decode(
        Heat,
        table,
        dim,
        **{key: functools.partial(_by_region, key=key, mesh=mesh) for key in _BY_REGION},
        supports=lambda given: along(given, "supports"),
        fluxes=lambda given: along(given, "flux"),
        contact=contact,
    )
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
    found = decode(
        HeatContact,
        table,
        reader.dim,
        conductance=_conductance,
        exchange=lambda given: reader.law(given, "exchange", NORMAL_LAWS),
    )
    with context(f"{table.source}: [{table.name}]"):
        return HeatContact(**found)


def _conductance(table: TomlTable) -> float | Touching:
    value = table.data["conductance"]
    if isinstance(value, dict):
        given = table.table("conductance", keys_of(Touching), inline=True)
        with context(f"{table.source}: [{table.name}]"):
            return Touching(**decode(Touching, given))
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise table.error(
            "conductance", f"must be a number or {{ closed = 2.0, per_pressure = 0.1 }}, not {kind(value)}"
        )
    return table.number("conductance", value)


def heat_record(heat: Heat, aside: SideFiles) -> dict[str, object]:
    """The table [heat]."""

    def by_region(key: str) -> Callable[[object], object]:
        where = f"heat.{key}"
        return lambda value: (
            {name: _said(one, f"{where}['{name}']") for name, one in value.items()}
            if isinstance(value, Mapping)
            else _said(value, where)
        )

    def along(key: str) -> Callable[[Mapping[str, object]], object]:
        return lambda values: {name: quantity_record(one, f"heat.{key}['{name}']") for name, one in values.items()}

    return encode(
        heat,
        "heat",
        **{key: by_region(key) for key in _BY_REGION},
        supports=along("supports"),
        fluxes=along("flux"),
        contact=lambda parts: {name: _contact_record(name, one, aside) for name, one in parts.items()},
    )


def _said(value: object, where: str) -> object:
    if isinstance(value, Formula) or (not callable(value) and np.ndim(value) == 0):  # type: ignore[arg-type]
        return quantity_record(value, where)
    entries = entries_record(value, where)
    size = round(len(entries) ** 0.5)
    return [entries[k * size : (k + 1) * size] for k in range(size)]


def _contact_record(name: str, contact: HeatContact, aside: SideFiles) -> dict[str, object]:
    where = f"heat.contact['{name}']"

    def conductance(value: object) -> object:
        if isinstance(value, Touching):
            return encode(value)
        if callable(value):
            raise not_expressible(f"{where}.conductance", value, "a number, or HeatContact.touching(...)")
        return value

    return encode(
        contact,
        where,
        conductance=conductance,
        exchange=lambda law: _law_record(law, f"{where}.exchange", name, aside, NORMAL_LAWS),
    )
