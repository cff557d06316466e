"""The tables [contact.NAME] of a problem file, read and written: laws, friction bounds, obstacles, memory."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import OF_ONE, Argument, Form, keys_of
from hemivar.basics.types import Array, Parameter
from hemivar.files.mesh_table import file_name
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import quantity_record
from hemivar.files.schema import check_named, decode, encode, read_arguments, written
from hemivar.files.toml import KEYS, TomlTable, context, kind, listed
from hemivar.formula import Formula
from hemivar.formula.formula import ScalarFormula
from hemivar.laws import (
    CoulombBound,
    Friction,
    NoFriction,
    OrthotropicFriction,
    PenetrationBound,
    Superpotential,
    VectorLaw,
    memory,
)
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.own.columns import BOUND_COLUMNS, LAW_COLUMNS, read_columns
from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, NORMAL_LAWS, LawEntry
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.obstacles import Cylinder, Normals, Obstacle, Plane, SignedDistance, Sphere
from hemivar.mechanics.scalar import ScalarContact
from hemivar.mechanics.statement import AREA, ContactProblem
from hemivar.mesh import Mesh

__all__ = ["SideFiles", "contact_records", "memory_kinds", "read_contacts"]

_OBSTACLES: Mapping[str, type[Plane | Sphere | Cylinder]] = {"plane": Plane, "sphere": Sphere, "cylinder": Cylinder}

#: What may stand under "normal".
_LAWS = {**NORMAL_LAWS, **COUPLED_LAWS}
_OF_ONE = ("normal", "friction", *keys_of(Contact, by=OF_ONE))
_OVER = KEYS["area.*"]


def read_contacts(top: TomlTable, mesh: Mesh, folder: Path, of_one: bool) -> dict[str, Contact]:
    """Contacts by boundary and by region; tables of laws are looked for in a folder."""
    reader, table = _Reader(mesh.dim, folder), top.table("contact", None)
    found: dict[str, Contact] = {}
    for name in table.data:
        check_named(mesh, table, name)
        read = reader.of_one if of_one else reader.contact
        found[name] = read(table.table(name, _OF_ONE if of_one else KEYS["contact.*"]))
    return found | _read_areas(top, mesh, reader.of_one if of_one else reader.over, _OF_ONE if of_one else _OVER)


def _read_areas(
    top: TomlTable, mesh: Mesh, read: Callable[[TomlTable], Contact], keys: tuple[str, ...]
) -> dict[str, Contact]:
    """Contacts over the mesh, or over regions of it."""
    area = top.table("area", None)
    if any(key in area for key in keys):
        area.only(keys)
        return {AREA: read(area)}
    for name in area.data:
        if name not in mesh.regions:
            known = f"{', '.join(mesh.regions) or 'none'}"
            raise area.error(name, f"is neither of {', '.join(keys)} nor a region of the mesh (regions: {known})")
        if name in top.table("contact", None):
            raise area.error(name, "a boundary with contact has this name too; rename one of them in the mesh")
    return {name: read(area.table(name, keys)) for name in area.data}


class _Reader:
    """Reads what stands in a table of one contact boundary."""

    def __init__(self, dim: int, folder: Path) -> None:
        self.dim = dim
        self.folder = folder

    def contact(self, one: TomlTable) -> Contact:
        if "normal" not in one:
            raise one.error("normal", f"is missing; name a normal law ({', '.join(NORMAL_LAWS)})")
        normal, friction = self.law(one, "normal", _LAWS), self.law(one, "friction", FRICTION_LAWS)
        assert isinstance(normal, Superpotential | VectorLaw)
        assert isinstance(friction, Friction)
        moved = decode(Contact, one, self.dim)
        obstacle = self.obstacle(one) if "obstacle" in one else None
        normals = None
        if obstacle is None and "normals" in one:
            raise one.error("normals", "says whose normals contact with an obstacle has; add obstacle or remove it")
        if obstacle is not None:
            if "gap" in one:
                raise one.error("gap", "follows from the obstacle; give one of the two")
            normals = Normals(one.text("normals", Normals.OBSTACLE, [way.value for way in Normals]))
        damping = self.law(one, "damping", NORMAL_LAWS) if "damping" in one else None
        assert damping is None or isinstance(damping, Superpotential)
        memory = _read_memory(one, self.dim)
        with context(f"{one.where('normal')}:"):
            return Contact(
                normal, friction, obstacle=obstacle, normals=normals, damping=damping, memory=memory, **moved
            )

    def over(self, table: TomlTable) -> Contact:
        """A contact over an area of a body, where points only slide."""
        made = self.contact(TomlTable({"normal": "none", **table.data}, table.source, table.name, None, table.prefix))
        with context(f"{table.where('friction' if made.friction.acts else 'normal')}:"):
            made.refuse_normals(self.dim)
        return made

    def of_one(self, table: TomlTable) -> Contact:
        """A contact of one component."""
        if ("normal" in table) == ("friction" in table):
            given = "both are given" if "normal" in table else "none is given"
            raise table.error("normal, friction", f"{given}; name one law, of the penetration or of the slip")
        key = "normal" if "normal" in table else "friction"
        law = self.law(table, key, NORMAL_LAWS if key == "normal" else FRICTION_LAWS)
        place = decode(Contact, table, self.dim, by=OF_ONE)
        with context(f"{table.where(key)}:"):
            made = ScalarContact(law, place.get("gap", 0.0), place.get("side", Side.ABOVE))  # type: ignore[arg-type]
        return made

    def obstacle(self, table: TomlTable) -> Obstacle:
        """A rigid obstacle: a table with one of plane, sphere, cylinder and distance."""
        given = table.table("obstacle", (*_OBSTACLES, "distance"), inline=True)
        if len(given.data) != 1:
            ways = "{ plane = ... }, { sphere = ... }, { cylinder = ... } or { distance = FORMULA }"
            raise table.error("obstacle", f"give one of {ways}")
        shape = next(iter(given.data))
        if shape == "distance":
            distance = given.quantity(shape, given.data[shape], self.dim)
            if not isinstance(distance, Formula):
                raise given.error(shape, f"is {distance:g} everywhere; give a formula of the coordinates in quotes")
            return SignedDistance(distance)
        if shape == "cylinder" and self.dim == 2:
            raise given.error(shape, "in the plane it is a circle; write sphere = { center = ..., radius = ... }")
        kind_of = _OBSTACLES[shape]
        one = given.table(shape, keys_of(kind_of), inline=True)
        missing = [key for key in keys_of(kind_of) if key not in one and key != "inside"]
        if missing:
            raise one.error(missing[0], f"is missing; write {shape} = {{ {' = ..., '.join(missing)} = ... }}")
        with context(f"{given.where(shape)}:"):
            return kind_of(**decode(kind_of, one, self.dim))

    def law(self, table: TomlTable, key: str, laws: Mapping[str, LawEntry]) -> Superpotential | Friction | VectorLaw:
        value = table.data.get(key, "none")
        if isinstance(value, str):
            value = {"law": value}
        if not isinstance(value, dict):
            example = f'{{ law = "{next(iter(laws))}", ... }}'
            raise table.error(key, f"must be a law such as {example}, not {kind(value)}")
        given = TomlTable(value, table.source, table.name, None, f"{table.prefix}{key}.")
        if "law" not in given:
            raise table.error(key, f"does not name a law; add law = one of {listed(list(laws))}")
        name = value["law"]
        if not isinstance(name, str):
            raise given.error("law", f"must be one of {listed(list(laws))}, not {kind(name)}")
        if name not in laws:
            other = NORMAL_LAWS if laws is FRICTION_LAWS else FRICTION_LAWS
            if name in other:
                kind_of = other[name].kind
                raise given.error(
                    "law", f"'{name}' is a {kind_of} law; use it under {kind_of} (known here: {', '.join(laws)})"
                )
            kind_of = next(iter(laws.values())).kind
            raise given.error("law", f"'{name}' is not a {kind_of} law{suggest(name, list(laws))}")
        entry = laws[name]
        given.only(("law", *(p.key for p in entry.parameters)))
        parameters = read_arguments(entry, given, self.dim, key, {Form.OWN: self.bound, Form.FILE: self.file})
        for name in ("potential", "derivative"):
            if name in parameters:
                parameters["where"] = given.where(name)
        with context(f"{table.where(key)}:"):
            return cast(Superpotential | Friction | VectorLaw, entry.build(**parameters))

    def file(self, given: TomlTable, one: Argument) -> Path:
        return self.folder / given.text(one.key)  # an absolute path stays

    def bound(self, given: TomlTable, one: Argument) -> Parameter | StateBound:
        """A friction bound: a number, a formula of x, or a table with one of table, formula and coulomb."""
        name, value = one.key, given.data[one.key]
        if not isinstance(value, dict):
            return given.quantity(name, value, self.dim, one.stated.lowest, timed=True)
        ways = ("table", "formula", "coulomb")
        inner = given.table(name, ways, inline=True)
        if len(inner.data) != 1:
            raise given.error(name, "give one of { table = FILE }, { formula = ... } of s and { coulomb = ... }")
        if "coulomb" in inner:
            return CoulombBound(inner.quantity("coulomb", value["coulomb"], self.dim, 0.0, timed=True))
        if "formula" in inner:
            text = str(value["formula"]) if isinstance(value["formula"], int | float) else inner.text("formula")
            formula = ScalarFormula(text, "s", inner.where("formula"))
            with context(f"{inner.where('formula')}:"):
                return PenetrationBound(formula)
        with context(f"{inner.where('table')}:"):
            path = self.folder / inner.text("table")
            return PenetrationBound(read_columns(path, BOUND_COLUMNS), file=path)


# ---- writing ------------------------------------------------------------------------------------------------


class SideFiles:
    """Where tables go that come from no file: beside the problem file if that is wanted, else nowhere."""

    def __init__(self, folder: Path, put: Callable[[str, str], str] | None) -> None:
        self.folder = folder
        self.put = put

    def table(self, where: str, name: str, rows: tuple[Array, Array], heads: tuple[str, str]) -> str:
        """Name of the file in which a table without one was put."""
        if self.put is None:
            raise not_expressible(
                where, "a table of numbers that come from no file", "tables by file: beside=True writes them"
            )
        pairs = zip(*(np.asarray(column, dtype=float).tolist() for column in rows), strict=True)
        lines = [f"{first!r},{second!r}\n" for first, second in pairs]
        return self.put(name, f"{heads[0]},{heads[1]}\n{''.join(lines)}")


def contact_records(problem: ContactProblem, aside: SideFiles) -> dict[str, object]:
    """The tables [contact] and [area] of a problem."""
    record = _record_of_one if problem.kind else _contact_record
    records = {name: record(name, one, aside) for name, one in problem.contact.items()}
    area = {name: records.pop(name) for name in problem.areas}
    return {"contact": records, "area": area.get(AREA, area)}


def _record_of_one(name: str, contact: Contact, aside: SideFiles) -> dict[str, object]:
    where, record = f"contact['{name}']", dict[str, object]()
    if contact.rubs:
        record["friction"] = _friction_record(contact.friction, f"{where}.law", name, aside)
    else:
        record["normal"] = _law_record(contact.normal, f"{where}.law", name, aside, NORMAL_LAWS)
    return record | encode(contact, where, by=OF_ONE)


def _contact_record(name: str, contact: Contact, aside: SideFiles) -> dict[str, object]:
    """The table [contact.NAME] of a contact."""
    where = f"contact['{name}']"
    record: dict[str, object] = {"normal": _law_record(contact.normal, f"{where}.normal", name, aside, _LAWS)}
    if not _is_none(contact.friction):
        record["friction"] = _friction_record(contact.friction, f"{where}.friction", name, aside)
    if contact.obstacle is not None:
        record["obstacle"] = _obstacle_record(contact.obstacle, f"{where}.obstacle")
        if contact.normals is Normals.BODY:
            record["normals"] = Normals.BODY.value
    record |= encode(contact, where)
    if contact.damping is not None:
        record["damping"] = _law_record(contact.damping, f"{where}.damping", name, aside, NORMAL_LAWS)
    if contact.memory is not None:
        record["memory"] = _memory_record(contact.memory, f"{where}.memory")
    return record


def _is_none(friction: Friction) -> bool:
    """Whether there is no friction at all."""
    bound, none = friction.bound, NoFriction()
    plain = not callable(bound) and not isinstance(bound, StateBound) and np.ndim(bound) == 0
    return (
        plain
        and not isinstance(friction, OrthotropicFriction)
        and bound == none.bound
        and friction.profile is none.profile
        and friction.of is None
    )


def _law_record(
    law: Superpotential | VectorLaw | OrthotropicFriction,
    where: str,
    name: str,
    aside: SideFiles,
    laws: Mapping[str, LawEntry],
    bound: object = None,
) -> object:
    """A law as a file states it: its name, or a table with its parameters."""
    stated = law.stated
    if stated is None or stated["law"] not in laws:
        own = "the laws that 'hemivar laws' lists, tables (table_law) and potentials as text (FormulaLaw)"
        raise not_expressible(where, law, own)
    entry = laws[str(stated["law"])]
    record: dict[str, object] = {"law": entry.name}
    for one in entry.parameters:
        value = bound if one.stated.form is Form.OWN else stated.get(one.key)
        if one.stated.form is Form.FILE:
            side = where.rpartition(".")[2]
            record[one.key] = (
                file_name(value, aside.folder)
                if isinstance(value, Path)
                else aside.table(where, f"{name}-{side}", stated["rows"], (LAW_COLUMNS[0][0], LAW_COLUMNS[1][0]))  # type: ignore[arg-type]
            )
        elif value is None or (isinstance(value, tuple | list) and not value):
            continue
        else:
            record[one.key] = written(value, one.stated.form, f"{where}.{one.key}")
        if one.default is not None and record.get(one.key) == one.default:
            del record[one.key]
    return record if len(record) > 1 else entry.name


def _friction_record(friction: Friction, where: str, name: str, aside: SideFiles) -> object:
    bound: object
    law = friction if isinstance(friction, OrthotropicFriction) else friction.profile
    match friction.bound:
        case CoulombBound(coefficient=coefficient) if law is NoFriction().profile:
            record: object = {"law": "coulomb", "coefficient": quantity_record(coefficient, f"{where}.coefficient")}
            return _told_of(record, friction)
        case CoulombBound(coefficient=coefficient):
            bound = {"coulomb": quantity_record(coefficient, f"{where}.coefficient")}
        case PenetrationBound(source=ScalarFormula(text=text)):
            bound = {"formula": text}
        case PenetrationBound(source=source, file=file):
            if callable(source) or isinstance(source, str):
                raise not_expressible(f"{where}.bound", source, "formulas of s as text, and tables")
            heads = (BOUND_COLUMNS[0][0], BOUND_COLUMNS[1][0])
            columns = (np.asarray(source[0], dtype=float), np.asarray(source[1], dtype=float))
            bound = {
                "table": aside.table(f"{where}.bound", f"{name}-bound", columns, heads)
                if file is None
                else file_name(file, aside.folder)
            }
        case StateBound() as other:
            raise not_expressible(f"{where}.bound", other, "numbers, formulas, and bounds by penetration or pressure")
        case plain:
            bound = quantity_record(plain, f"{where}.bound")
    return _told_of(_law_record(law, where, name, aside, FRICTION_LAWS, bound), friction)


def _told_of(record: object, friction: Friction) -> object:
    """The record of friction, with what it is a law of in time where that was said."""
    whole = record if isinstance(record, dict) else {"law": record}
    return record if friction.of is None else whole | {"of": str(friction.of)}


def _obstacle_record(obstacle: Obstacle, where: str) -> dict[str, object]:
    match obstacle:
        case Plane() | Sphere() | Cylinder():
            return {type(obstacle).__name__.lower(): encode(obstacle, where)}
        case SignedDistance(function=Formula(text=text), gradient=None):
            return {"distance": text}
        case SignedDistance(gradient=None):
            raise not_expressible(f"{where}.function", obstacle.function)
    raise not_expressible(where, obstacle, "planes, spheres, cylinders, and signed distances as text, without gradient")


# ---- memory -------------------------------------------------------------------------------------------------------


def memory_kinds() -> Mapping[str, Any]:
    """The memories that a problem file can state, by name: those whose fields are all parameters."""
    named: list[Any] = [getattr(memory, name) for name in memory.__all__]
    kinds = [one for one in named if inspect.isclass(one) and issubclass(one, memory.Memory) and is_dataclass(one)]
    return {one.name: one for one in kinds if all("stated" in field.metadata for field in fields(one))}


def _read_memory(table: TomlTable, dim: int) -> tuple[memory.Memory, ...] | None:
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


def _memory_record(memories: Sequence[Any], where: str) -> list[object]:
    """The list of a contact's memories."""
    kinds, record = memory_kinds(), list[object]()
    for number, stated in enumerate(memories):
        if kinds.get(getattr(stated, "name", "")) is not type(stated):
            raise not_expressible(f"{where}[{number}]", stated, f"memories of the kinds {', '.join(kinds)}")
        record.append({"kind": stated.name} | encode(stated, f"{where}[{number}]"))
    return record
