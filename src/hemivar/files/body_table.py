"""The tables [loads] and [supports] of a problem file, read and written."""

from __future__ import annotations

from collections.abc import Mapping

from hemivar.basics.arguments import suggest
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.toml import Quantity, TomlTable, kind
from hemivar.formula import VARIABLES
from hemivar.mechanics.conditions import (
    SUPPORTS,
    Clamped,
    Fixed,
    Prescribed,
    Pressure,
    Roller,
    ScalarData,
    Support,
    Traction,
    VectorData,
)
from hemivar.mesh import Mesh

__all__ = ["check_boundary", "loads_record", "read_bedding", "read_loads", "read_supports", "supports_record"]


def check_boundary(mesh: Mesh, table: TomlTable, name: str) -> None:
    """Refuse the name of a boundary that the mesh does not have."""
    known = list(mesh.boundaries)
    if name not in known:
        raise table.error(name, f"the mesh has no boundary '{name}'{suggest(name, known, 'boundaries')}")


# ---- loads and supports -----------------------------------------------------------------------------------


def read_loads(table: TomlTable, mesh: Mesh) -> tuple[VectorData | float, dict[str, Traction]]:
    """The body force, and tractions by boundary."""
    body: VectorData | float = 0.0
    if "body" in table:
        body = table.vector("body", table.data["body"], mesh.dim, timed=True)
    traction = table.table("traction", None, inline=True)
    pressure = table.table("pressure", None, inline=True)
    tractions: dict[str, Traction] = {}
    for name, value in traction.data.items():
        check_boundary(mesh, traction, name)
        tractions[name] = traction.vector(name, value, mesh.dim, timed=True)
    for name, value in pressure.data.items():
        check_boundary(mesh, pressure, name)
        if name in tractions:
            raise pressure.error(name, "this boundary has a traction too; give one of the two")
        tractions[name] = Pressure(pressure.quantity(name, value, mesh.dim, timed=True))
    return body, tractions


def read_bedding(table: TomlTable, mesh: Mesh) -> Quantity:
    """The stiffness per volume of a bedding of the body."""
    return table.quantity("bedding", table.data["bedding"], mesh.dim, 0.0) if "bedding" in table else 0.0


def loads_record(
    body: VectorData | float, tractions: Mapping[str, Traction], bedding: ScalarData, dim: int
) -> dict[str, object]:
    """The table [loads]."""

    def vector(value: object, where: str) -> list[object]:
        none = isinstance(value, float)  # the number 0 means no vector
        return [0.0] * dim if none else entries_record(value, where)

    record: dict[str, object] = {}
    if not isinstance(body, float):
        record["body"] = vector(body, "body_force")
    pressure, traction = {}, {}
    for name, value in tractions.items():
        where = f"tractions['{name}']"
        if isinstance(value, Pressure):
            pressure[name] = quantity_record(value.value, where)
        else:
            traction[name] = vector(value, where)
    record |= ({"traction": traction} if traction else {}) | ({"pressure": pressure} if pressure else {})
    return record if bedding == 0.0 else record | {"bedding": quantity_record(bedding, "bedding")}


def read_supports(table: TomlTable, mesh: Mesh) -> dict[str, Support]:
    """Supports by boundary."""
    found: dict[str, Support] = {}
    for name, value in table.data.items():
        check_boundary(mesh, table, name)
        if isinstance(value, str):
            if value not in SUPPORTS:
                others = "or a table: { x = 0.0 } holds one component, { displacement = [...] } prescribes all"
                raise table.error(name, f"'{value}' is not known{suggest(value, list(SUPPORTS))}; {others}")
            found[name] = SUPPORTS[value]
            continue
        if not isinstance(value, dict):
            ways = '"clamped", "roller", { x = 0.0 } or { displacement = [...] }'
            raise table.error(name, f"must be {ways}, not {kind(value)}")
        axes = VARIABLES[: mesh.dim]
        held = table.table(name, (*axes, "displacement"), inline=True)
        if "displacement" in held:
            if len(held.data) > 1:
                raise held.error("displacement", "fixes every direction; remove the single ones")
            found[name] = Prescribed(held.vector("displacement", value["displacement"], mesh.dim, timed=True))
        elif not held.data:
            raise table.error(name, 'fixes nothing; give x, y or displacement, or write "clamped"')
        else:
            found[name] = Fixed(**{axis: held.quantity(axis, v, mesh.dim, timed=True) for axis, v in value.items()})
    return found


def supports_record(supports: Mapping[str, Support]) -> dict[str, object]:
    """The table [supports]."""
    record: dict[str, object] = {}
    for name, support in supports.items():
        where = f"supports['{name}']"
        match support:
            case Clamped():
                record[name] = "clamped"
            case Roller():
                record[name] = "roller"
            case Prescribed(value=value):
                record[name] = {"displacement": entries_record(value, where)}
            case Fixed():
                given = {axis: getattr(support, axis) for axis in VARIABLES}
                record[name] = {
                    axis: quantity_record(value, f"{where}.{axis}")
                    for axis, value in given.items()
                    if value is not None
                }
    return record
