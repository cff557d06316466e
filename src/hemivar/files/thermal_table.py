"""The table [heat] of a problem file, read and written: heat in a body."""

from __future__ import annotations

from hemivar.basics.stated import keys_of
from hemivar.files.contact_table import SideFiles, _law_record, _Reader
from hemivar.files.not_expressible import not_expressible
from hemivar.files.schema import check_named, decode, encode
from hemivar.files.toml import TomlTable, context, kind
from hemivar.laws.registry import NORMAL_LAWS
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import Heat, HeatContact, Touching

__all__ = ["HEAT_KEYS", "heat_record", "read_heat"]

#: Keys of [heat].
HEAT_KEYS = keys_of(Heat)


def read_heat(table: TomlTable, problem: ContactProblem, reader: _Reader) -> Heat:
    """The table [heat] of a body."""
    mesh = problem.mesh
    for key in ("conductivity", "capacity"):
        if key not in table:
            raise table.error(key, "is missing; heat needs a conductivity and a capacity")

    def contact(given: TomlTable) -> dict[str, HeatContact]:
        parts = given.table("contact", None)
        for boundary in parts.data:
            check_named(mesh, parts, boundary)
        return {name: _read_contact(parts.table(name, keys_of(HeatContact)), reader) for name in parts.data}

    found = decode(Heat, table, mesh, contact=contact)
    with context(f"{table.source}: [heat]"):
        heat = Heat(**found)
        heat.conduction(problem)
    return heat


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

    return encode(
        heat, "heat", contact=lambda parts: {name: _contact_record(name, one, aside) for name, one in parts.items()}
    )


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
