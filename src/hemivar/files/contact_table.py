"""The tables [contact.NAME] of a problem file, read and written: laws, friction bounds, obstacles, memory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import OF_ONE, Argument, Form, keys_of
from hemivar.basics.types import Array, Parameter
from hemivar.basics.user_code import of_user
from hemivar.files.mesh_table import file_name
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import quantity_record
from hemivar.files.schema import check_named, decode, encode, encode_arguments, read_arguments, written
from hemivar.files.toml import KEYS, TomlTable, context, kind, listed
from hemivar.formula import Formula
from hemivar.formula.formula import ScalarFormula
from hemivar.laws import CoulombBound, Friction, NoFriction, PenetrationBound, Superpotential, Tie, VectorLaw
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.memory import Memory
from hemivar.laws.own.columns import BOUND_COLUMNS, LAW_COLUMNS, read_columns
from hemivar.laws.parameters import FRICTION
from hemivar.laws.registry import (
    COUPLED_LAWS,
    FRICTION_LAWS,
    MEMORIES,
    NORMAL_LAWS,
    LawEntry,
    LawKind,
    entry_named,
    entry_of,
)
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.obstacles import Cylinder, Normals, Obstacle, Plane, SignedDistance, Sphere
from hemivar.mechanics.scalar import ScalarContact
from hemivar.mechanics.statement import AREA, ContactProblem
from hemivar.mesh import Mesh

__all__ = ["SideFiles", "contact_records", "read_contacts"]

_OBSTACLES: Mapping[str, type[Plane | Sphere | Cylinder]] = {"plane": Plane, "sphere": Sphere, "cylinder": Cylinder}

#: What may stand under "normal".
_LAWS = {**NORMAL_LAWS, **COUPLED_LAWS}
#: From which of these a law of the user's is derived that stands there, too.
_BASES: Mapping[str, tuple[type, ...]] = {"normal": (Superpotential, VectorLaw), "friction": (Superpotential, Friction)}
_OF_ONE = ("normal", "friction", *keys_of(Contact, by=OF_ONE))
_OVER = KEYS["area.*"]


def read_contacts(
    top: TomlTable, mesh: Mesh, folder: Path, of_one: bool, code: Sequence[str] = ()
) -> dict[str, Contact]:
    """Contacts by boundary and by region; tables of laws are looked for in a folder, laws of the user's in code."""
    reader, table = _Reader(mesh.dim, folder, code), top.table("contact", None)
    contacts: dict[str, Contact] = {}
    for name in table.data:
        check_named(mesh, table, name)
        read = reader.of_one if of_one else reader.contact
        contacts[name] = read(table.table(name, _OF_ONE if of_one else KEYS["contact.*"]))
    return contacts | _read_areas(top, mesh, reader.of_one if of_one else reader.over, _OF_ONE if of_one else _OVER)


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

    def __init__(self, dim: int, folder: Path, code: Sequence[str] = ()) -> None:
        self.dim = dim
        self.folder = folder
        self.code = code

    def contact(self, table: TomlTable) -> Contact:
        if "normal" not in table:
            raise table.error("normal", f"is missing; name a normal law ({', '.join(NORMAL_LAWS)})")
        ties = table.data["normal"] == Tie.name
        normal = Tie() if ties else self.law(table, "normal", _LAWS)
        friction = self.law(table, "friction", FRICTION_LAWS)
        assert isinstance(normal, Superpotential | VectorLaw)
        assert isinstance(friction, Friction)
        moved = decode(Contact, table, self.dim)
        obstacle = self.obstacle(table) if "obstacle" in table else None
        normals = None
        if obstacle is None and "normals" in table:
            raise table.error("normals", "says whose normals contact with an obstacle has; add obstacle or remove it")
        if obstacle is not None:
            if "gap" in table:
                raise table.error("gap", "follows from the obstacle; give one of the two")
            normals = Normals(table.text("normals", Normals.OBSTACLE, [choice.value for choice in Normals]))
        damping = self.law(table, "damping", NORMAL_LAWS) if "damping" in table else None
        assert damping is None or isinstance(damping, Superpotential)
        memory = _read_memory(table, self.dim, self.code)
        with context(f"{table.where('normal')}:"):
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
        stated = decode(Contact, table, self.dim, by=OF_ONE)
        with context(f"{table.where(key)}:"):
            made = ScalarContact(law, stated.get("gap", 0.0), stated.get("side", Side.ABOVE))  # type: ignore[arg-type]
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
        shape_table = given.table(shape, keys_of(kind_of), inline=True)
        missing = [key for key in keys_of(kind_of) if key not in shape_table and key != "inside"]
        if missing:
            raise shape_table.error(missing[0], f"is missing; write {shape} = {{ {' = ..., '.join(missing)} = ... }}")
        with context(f"{given.where(shape)}:"):
            return kind_of(**decode(kind_of, shape_table, self.dim))

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
        entry = laws[name] if name in laws else self._own_law(given, name, laws)
        given.only(("law", *(p.key for p in entry.parameters)))
        parameters = read_arguments(entry, given, self.dim, key, {Form.OWN: self.bound, Form.FILE: self.file})
        for formula in ("potential", "derivative"):
            if formula in parameters and name in laws:
                parameters["where"] = given.where(formula)
        with context(f"{table.where(key)}:"):
            return cast(Superpotential | Friction | VectorLaw, entry.build(**parameters))

    def _own_law(self, given: TomlTable, name: str, laws: Mapping[str, LawEntry]) -> LawEntry:
        """A law of the user's; what is none is refused."""
        other, kind_of = NORMAL_LAWS if laws is FRICTION_LAWS else FRICTION_LAWS, next(iter(laws.values())).kind
        if name in other:
            kind_of = other[name].kind
            raise given.error(
                "law", f"'{name}' is a {kind_of} law; use it under {kind_of} (known here: {', '.join(laws)})"
            )
        bases = (Superpotential,) if laws is NORMAL_LAWS else _BASES[kind_of]
        with context(f"{given.where('law')}:"):
            entry = entry_named(name, kind_of, bases, self.code)
        if entry is None:
            raise given.error("law", f"'{name}' is not a {kind_of} law{suggest(name, list(laws))}")
        return entry

    def file(self, given: TomlTable, argument: Argument) -> Path:
        return self.folder / given.text(argument.key)  # an absolute path stays

    def bound(self, given: TomlTable, argument: Argument) -> Parameter | StateBound:
        """A friction bound: a number, a formula of x, or a table with one of table, formula and coulomb."""
        name, value = argument.key, given.data[argument.key]
        if not isinstance(value, dict):
            return given.quantity(name, value, self.dim, argument.stated.lowest, timed=True)
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
    records = {name: record(name, contact, aside) for name, contact in {**problem.contact, **problem.ties}.items()}
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
    normal = Tie.name if contact.ties else _law_record(contact.normal, f"{where}.normal", name, aside, _LAWS)
    record: dict[str, object] = {"normal": normal}
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
        and type(friction) is Friction
        and bound == none.bound
        and friction.profile is none.profile
        and friction.of is None
    )


def _law_record(
    law: Superpotential | VectorLaw | Friction,
    where: str,
    name: str,
    aside: SideFiles,
    laws: Mapping[str, LawEntry],
    bound: object = None,
) -> object:
    """A law as a file states it: its name, or a table with its parameters."""
    stated = None if type(law) is Friction else getattr(law, "stated", None)
    entry = entry_of(type(law), next(iter(laws.values())).kind)
    if entry is not None:
        stated = {
            argument.key: getattr(law, argument.name, None)
            for argument in entry.parameters
            if argument.key not in FRICTION
        }
    elif stated is None or stated["law"] not in laws or of_user(type(law)):
        own = "the laws that 'hemivar laws' lists, tables (table_law) and potentials as text (FormulaLaw)"
        raise not_expressible(where, law, f"{own}, and classes of a module")
    else:
        entry = laws[str(stated["law"])]
    record: dict[str, object] = {"law": entry.name}
    for argument in entry.parameters:
        value = bound if argument.stated.form is Form.OWN else stated.get(argument.key)
        if argument.stated.form is Form.FILE:
            side = where.rpartition(".")[2]
            record[argument.key] = (
                file_name(value, aside.folder)
                if isinstance(value, Path)
                else aside.table(where, f"{name}-{side}", stated["rows"], (LAW_COLUMNS[0][0], LAW_COLUMNS[1][0]))  # type: ignore[arg-type]
            )
        elif value is None or (isinstance(value, tuple | list) and not value):
            continue
        else:
            record[argument.key] = written(value, argument.stated.form, f"{where}.{argument.key}")
        if argument.default is not None and record.get(argument.key) == argument.default:
            del record[argument.key]
    return record if len(record) > 1 else entry.name


def _friction_record(friction: Friction, where: str, name: str, aside: SideFiles) -> object:
    bound: object
    law = friction.profile if type(friction) is Friction else friction
    match friction.bound:
        case CoulombBound(coefficient=coefficient) if law is NoFriction().profile:
            record: object = {"law": "coulomb", "coefficient": quantity_record(coefficient, f"{where}.coefficient")}
            return _with_measure(record, friction)
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
    return _with_measure(_law_record(law, where, name, aside, FRICTION_LAWS, bound), friction)


def _with_measure(record: object, friction: Friction) -> object:
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


def _memory_entry(given: TomlTable, name: str, code: Sequence[str]) -> LawEntry:
    """What a table names, of the library or of the user."""
    if name in MEMORIES:
        return MEMORIES[name]
    with context(f"{given.where('kind')}:"):
        entry = entry_named(name, LawKind.MEMORY, (Memory,), code)
    if entry is None:
        raise given.error("kind", f"'{name}' is not known{suggest(name, list(MEMORIES))}")
    return entry


def _read_memory(table: TomlTable, dim: int, code: Sequence[str]) -> tuple[Memory, ...] | None:
    """The memories of a contact, in the order in which they are stated; None where nothing is said of them."""
    if "memory" not in table:
        return None
    value = table.data["memory"]
    example = 'memory = [{ kind = "secant" }]'
    if not isinstance(value, list):
        raise table.error("memory", f"must be a list such as {example}, not {kind(value)}")
    made = []
    for number, item in enumerate(value):
        if not isinstance(item, dict):
            raise table.error("memory", f"must be a list of tables such as {example}; it holds {kind(item)}")
        given = TomlTable(item, table.source, table.name, None, f"{table.prefix}memory[{number}].")
        if "kind" not in given:
            raise given.error("kind", f"is missing; add kind = one of {listed(list(MEMORIES))}")
        entry = _memory_entry(given, given.text("kind"), code)
        given.only(("kind", *(part.key for part in entry.parameters)))
        parameters = read_arguments(entry, given, dim)
        with context(f"{table.where('memory')}:"):
            remembered = cast(Memory, entry.build(**parameters))
            if not any(callable(value) for value in parameters.values()):
                remembered.at(None)
            made.append(remembered)
    return tuple(made)


def _memory_record(memories: Sequence[Any], where: str) -> list[object]:
    """The list of a contact's memories."""
    record = list[object]()
    for number, stated in enumerate(memories):
        entry, here = entry_of(type(stated), LawKind.MEMORY), f"{where}[{number}]"
        own = MEMORIES.get(getattr(stated, "name", ""))
        entry = own if own is not None and own.build is type(stated) else entry
        if entry is None:
            raise not_expressible(here, stated, f"memories of the kinds {', '.join(MEMORIES)}, and classes of a module")
        record.append({"kind": entry.name} | encode_arguments(entry, stated, here))
    return record
