"""The tables [loads] and [supports] of a problem file, read and written."""

from __future__ import annotations

from collections.abc import Mapping

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import OF_ONE
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.schema import check_named, decode, encode
from hemivar.files.toml import TomlTable, kind
from hemivar.formula import VARIABLES
from hemivar.mechanics.conditions import SUPPORTS, Fixed, Prescribed, Pressure, ScalarData, Support
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh import Mesh

__all__ = ["loads_record", "read_loads", "read_supports", "supports_record"]


def read_loads(table: TomlTable, mesh: Mesh, of_one: bool) -> dict[str, object]:
    """The fields of a problem that the table [loads] states."""
    if of_one:
        return decode(ContactProblem, table, mesh, "loads", OF_ONE)
    found = decode(ContactProblem, table, mesh, "loads")
    if "pressure" in table:
        tractions = found.setdefault("tractions", {})
        for name, value in decode(Pressure, table, mesh, "loads")["value"].items():
            if name in tractions:
                raise table.error(f"pressure.{name}", "this boundary has a traction too; give one of the two")
            tractions[name] = Pressure(value)
    return found


def loads_record(problem: ContactProblem) -> dict[str, object]:
    """The table [loads]."""
    if problem.kind:
        return encode(problem, part="loads", by=OF_ONE)
    pushed = {name: value for name, value in problem.tractions.items() if isinstance(value, Pressure)}

    def vectors(tractions: Mapping[str, object]) -> dict[str, object]:
        none = [0.0] * problem.mesh.dim  # the number 0 means no vector
        plain = {name: value for name, value in tractions.items() if name not in pushed}
        return {
            name: none if isinstance(value, float) else entries_record(value, f"tractions['{name}']")
            for name, value in plain.items()
        }

    record = encode(problem, part="loads", tractions=vectors)
    parts = {name: quantity_record(one.value, f"tractions['{name}']") for name, one in pushed.items()}
    return {key: value for key, value in (record | {"pressure": parts}).items() if value}


def read_supports(top: TomlTable, mesh: Mesh, of_one: bool) -> dict[str, Support | ScalarData]:
    """Supports by boundary."""
    table = top.table("supports", None)
    if of_one:
        for name, value in table.data.items():
            check_named(mesh, table, name)
            if isinstance(value, dict) or value in SUPPORTS:
                raise table.error(name, f"must be the value of u, a number or a formula, not {kind(value)}; write 0.0")
        values: dict[str, Support | ScalarData] = decode(ContactProblem, top, mesh, by=OF_ONE).get("supports", {})
        return values
    found: dict[str, Support | ScalarData] = {}
    for name, value in table.data.items():
        check_named(mesh, table, name)
        if isinstance(value, str):
            if value not in SUPPORTS:
                others = "or a table: { x = 0.0 } holds one component, { displacement = [...] } prescribes all"
                raise table.error(name, f"'{value}' is not known{suggest(value, list(SUPPORTS))}; {others}")
            found[name] = SUPPORTS[value]
            continue
        if not isinstance(value, dict):
            ways = '"clamped", "roller", { x = 0.0 } or { displacement = [...] }'
            raise table.error(name, f"must be {ways}, not {kind(value)}")
        held = table.table(name, (*VARIABLES[: mesh.dim], "displacement"), inline=True)
        if "displacement" in held and len(held.data) > 1:
            raise held.error("displacement", "fixes every direction; remove the single ones")
        if not held.data:
            raise table.error(name, 'fixes nothing; give x, y or displacement, or write "clamped"')
        form = Prescribed if "displacement" in held else Fixed
        found[name] = form(**decode(form, held, mesh))
    return found


def supports_record(problem: ContactProblem) -> dict[str, object]:
    """The table [supports]."""
    if problem.kind:
        return encode(problem, by=OF_ONE).get("supports", {})  # type: ignore[return-value]
    words: dict[type, str] = {type(one): word for word, one in SUPPORTS.items()}
    return {
        name: words.get(type(one)) or encode(one, f"supports['{name}']")  # type: ignore[arg-type]
        for name, one in problem.supports.items()
    }
