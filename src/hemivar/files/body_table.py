"""The tables [loads], [supports] and [heat] of a problem file, read and written."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import OF_ONE, keys_of
from hemivar.files.contact_table import SideFiles, _law_record, _Reader
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.schema import check_named, decode, encode
from hemivar.files.toml import TomlTable, context, kind
from hemivar.formula.reader import VARIABLES
from hemivar.laws.registry import NORMAL_LAWS
from hemivar.mechanics.conditions import (
    SUPPORTS,
    Clamped,
    Fixed,
    Prescribed,
    Pressure,
    RigidPlate,
    ScalarData,
    Spring,
    Support,
    Traction,
)
from hemivar.mechanics.statement import ContactProblem
from hemivar.mechanics.thermal import ContactConductance, Heat, HeatContact
from hemivar.mesh import Mesh

__all__ = [
    "HEAT_KEYS",
    "heat_record",
    "loads_record",
    "named_supports_record",
    "read_heat",
    "read_loads",
    "read_supports",
    "supports_record",
    "tractions_record",
]


def read_loads(table: TomlTable, mesh: Mesh, of_one: bool) -> dict[str, object]:
    """The fields of a problem that the table [loads] states."""
    if of_one:
        return decode(ContactProblem, table, mesh, "loads", OF_ONE)
    loads = decode(ContactProblem, table, mesh, "loads")
    if "pressure" in table:
        tractions = loads.setdefault("tractions", {})
        for name, value in decode(Pressure, table, mesh, "loads")["value"].items():
            if name in tractions:
                raise table.error(f"pressure.{name}", "this boundary has a traction too; give one of the two")
            tractions[name] = Pressure(value)
    return loads


def loads_record(problem: ContactProblem) -> dict[str, object]:
    """The table [loads]."""
    if problem.kind:
        return encode(problem, part="loads", by=OF_ONE)
    record = encode(problem, part="loads", tractions=lambda _: {})
    return {key: value for key, value in record.items() if value} | tractions_record(
        problem.tractions, problem.mesh.dim
    )


def tractions_record(tractions: Mapping[str, Traction], dim: int) -> dict[str, object]:
    """Forces per area, and pressures, by boundary."""
    vectors: dict[str, object] = {}
    pressures: dict[str, object] = {}
    for name, value in tractions.items():
        where = f"tractions['{name}']"
        if isinstance(value, Pressure):
            pressures[name] = quantity_record(value.value, where)
        else:  # the number 0 means no vector
            vectors[name] = [0.0] * dim if isinstance(value, float) else entries_record(value, where)
    return {key: parts for key, parts in (("traction", vectors), ("pressure", pressures)) if parts}


def read_supports(top: TomlTable, mesh: Mesh, of_one: bool) -> dict[str, Support | ScalarData]:
    """Supports by boundary."""
    table = top.table("supports", None)
    if of_one:
        for name, value in table.data.items():
            check_named(mesh, table, name)
            if isinstance(value, dict | list) or value in SUPPORTS:
                raise table.error(name, f"must be the value of u, a number or a formula, not {kind(value)}; write 0.0")
        values: dict[str, Support | ScalarData] = decode(ContactProblem, top, mesh, by=OF_ONE).get("supports", {})
        return values
    supports: dict[str, Support | ScalarData] = {}
    for name, value in table.data.items():
        if not (name in mesh.node_sets or (isinstance(value, dict) and "at" in value)):
            check_named(mesh, table, name)
        if isinstance(value, str):
            if value not in SUPPORTS:
                others = "or a table: { x = 0.0 } holds one component, { displacement = [...] } prescribes all"
                raise table.error(name, f"'{value}' is not known{suggest(value, list(SUPPORTS))}; {others}")
            supports[name] = SUPPORTS[value]
            continue
        if not isinstance(value, dict):
            ways = '"clamped", "roller", { x = 0.0 } or { displacement = [...] }'
            raise table.error(name, f"must be {ways}, not {kind(value)}")
        supports[name] = _support(table, name, mesh)
    return supports


def _support(table: TomlTable, name: str, mesh: Mesh) -> Support:
    """The support of a table of its own; at points that it does not say more of the body is clamped."""
    if "rigid" in table.data[name]:  # type: ignore[operator]  # it is a table
        plate = table.table(name, ("rigid", *keys_of(RigidPlate)), inline=True)
        if plate.data["rigid"] is not True:
            raise plate.error("rigid", "is true of a plate; remove it of other supports")
        return RigidPlate(**decode(RigidPlate, plate, mesh.dim))
    forms: dict[type[Fixed | Prescribed | Spring], tuple[str, ...]] = {
        Fixed: VARIABLES[: mesh.dim], Prescribed: ("displacement",), Spring: ("normal", "tangential", "direction"),
    }  # fmt: skip
    fixed = table.table(name, (*chain(*forms.values()), "at"), inline=True)
    form = next((form for form in reversed(forms) if any(key in fixed for key in forms[form])), None)
    if form is None:
        if "at" not in fixed:
            raise table.error(name, 'fixes nothing; give x, y or displacement, or write "clamped"')
        return Clamped(**decode(Clamped, fixed, mesh))
    for key in fixed.data:
        if key not in (*forms[form], "at"):
            first = next(one for one in forms[form] if one in fixed)
            more = (
                "fixes every direction; remove the single ones"
                if form is Prescribed
                else f"is of a spring; remove {key}"
            )
            raise fixed.error(first, more)
    with context(f"{table.where(name)}:"):
        return form(**decode(form, fixed, mesh))


def supports_record(problem: ContactProblem) -> dict[str, object]:
    """The table [supports]."""
    if problem.kind:
        return encode(problem, by=OF_ONE).get("supports", {})  # type: ignore[return-value]
    return named_supports_record(problem.supports)


def named_supports_record(supports: Mapping[str, object]) -> dict[str, object]:
    """Supports of a body by boundary."""
    words: dict[type, str] = {type(support): word for word, support in SUPPORTS.items()}

    def record(name: str, support: Support) -> object:
        whole = getattr(support, "at", None) is None
        if isinstance(support, RigidPlate):
            return {"rigid": True} | encode(support, f"supports['{name}']")
        return (whole and words.get(type(support))) or encode(support, f"supports['{name}']")

    return {name: record(name, support) for name, support in supports.items()}  # type: ignore[arg-type]


# ---- heat ---------------------------------------------------------------------------------------------------------


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

    values = decode(Heat, table, mesh, contact=contact)
    with context(f"{table.source}: [heat]"):
        heat = Heat(**values)
        heat.conduction(problem)
    return heat


def _read_contact(table: TomlTable, reader: _Reader) -> HeatContact:
    values = decode(
        HeatContact,
        table,
        reader.dim,
        conductance=_conductance,
        exchange=lambda given: reader.law(given, "exchange", NORMAL_LAWS),
    )
    with context(f"{table.source}: [{table.name}]"):
        return HeatContact(**values)


def _conductance(table: TomlTable) -> float | ContactConductance:
    value = table.data["conductance"]
    if isinstance(value, dict):
        given = table.table("conductance", keys_of(ContactConductance), inline=True)
        with context(f"{table.source}: [{table.name}]"):
            return ContactConductance(**decode(ContactConductance, given))
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise table.error(
            "conductance", f"must be a number or {{ closed = 2.0, per_pressure = 0.1 }}, not {kind(value)}"
        )
    return table.number("conductance", value)


def heat_record(heat: Heat, aside: SideFiles) -> dict[str, object]:
    """The table [heat]."""

    return encode(
        heat, "heat", contact=lambda parts: {name: _contact_record(name, part, aside) for name, part in parts.items()}
    )


def _contact_record(name: str, contact: HeatContact, aside: SideFiles) -> dict[str, object]:
    where = f"heat.contact['{name}']"

    def conductance(value: object) -> object:
        if isinstance(value, ContactConductance):
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
