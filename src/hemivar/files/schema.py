"""The schema of problem files: fields of statements read from a table and written to one, as each of them says.

See :mod:`hemivar.basics.stated`. Reading and writing go through the same list of fields; what has its default is not
written.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.stated import Argument, Form, Stated, stated_fields
from hemivar.files.not_expressible import not_expressible
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.toml import TomlTable, array, kind
from hemivar.formula import Formula, FormulaArray
from hemivar.mechanics.gradient_energy import GradientEnergy
from hemivar.mesh import Mesh

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from hemivar.laws.registry import LawEntry

__all__ = ["check_named", "decode", "encode", "encode_arguments", "read_arguments", "read_value", "rows_of", "written"]


def decode(
    cls: DataclassInstance | type[DataclassInstance],
    table: TomlTable,
    dim: int | Mesh = 0,
    part: str = "",
    by: str = "stated",
    **own: Callable[[TomlTable], object],
) -> dict[str, Any]:
    """The fields of a dataclass that a table gives, by their names; the others keep their defaults."""
    values = {}
    for key, (field, stated) in stated_fields(cls, part, by).items():
        if key in table:
            values[field.name] = own[field.name](table) if stated.form is Form.OWN else _read(table, key, stated, dim)
        elif _default(field) is MISSING:
            raise table.error(key, f"is missing; give {stated.says}")
    return values


def _read(table: TomlTable, key: str, stated: Stated, dim: int | Mesh) -> object:
    """The value of a key, or one for each of the boundaries or regions that it names."""
    if isinstance(dim, int):
        return read_value(table, key, stated, dim)
    if not stated.by or (stated.by == "region" and not isinstance(table.data[key], dict)):
        return read_value(table, key, stated, dim.dim)
    named = table.table(key, None, inline=bool(table.name))
    for name in named.data:
        check_named(dim, named, name, stated.by)
    return {name: read_value(named, name, stated, dim.dim) for name in named.data}


def check_named(mesh: Mesh, table: TomlTable, name: str, what: str = "boundary") -> None:
    """Refuse the name of a boundary or region that the mesh does not have."""
    many = "boundaries" if what == "boundary" else "regions"
    known = list(getattr(mesh, many))
    if name not in known:
        if what == "boundary" and name in mesh.interfaces:
            raise table.error(
                name, f"lies inside the body; write [mesh] opened = ['{name}'] and name one of its two sides"
            )
        raise table.error(name, f"the mesh has no {what} '{name}'{suggest(name, known, many)}")


def encode(
    value: DataclassInstance, where: str = "", part: str = "", by: str = "stated", **own: Callable[..., object]
) -> dict[str, object]:
    """The table of a dataclass of stated fields, from which :func:`decode` reads the same."""
    record = {}
    for key, (field, stated) in stated_fields(value, part, by).items():
        given, default = getattr(value, field.name), _default(field)
        if given is None or (default is not MISSING and not callable(given) and _equal(given, default)):
            continue
        if field.name in own:
            record[key] = own[field.name](given)
        elif stated.form is not Form.OWN:
            record[key] = written(given, stated.form, f"{where}.{field.name}".lstrip("."))
    return record


def read_arguments(
    entry: LawEntry,
    table: TomlTable,
    dim: int,
    key: str = "",
    own: Mapping[Form, Callable[[TomlTable, Argument], object]] = MappingProxyType({}),
) -> dict[str, object]:
    """What a table gives of the parameters of a law or a material, by their names in Python."""
    values: dict[str, object] = {}
    for argument in entry.parameters:
        if argument.key not in table:
            if argument.required:
                given = ", ".join((f'{entry.key} = "{entry.name}"', *(f"{name} = ..." for name in entry.required)))
                example = f"{key} = {{ {given} }}" if key else given
                raise table.error(argument.key, f"is missing ({argument.stated.says}); write {example}")
        elif argument.stated.form is Form.QUANTITY:  # a law itself says that zero is not allowed
            least = argument.stated.lowest if argument.stated.below is None else -np.inf
            values[argument.name] = table.quantity(
                argument.key, table.data[argument.key], dim, least, timed=argument.stated.timed
            )
        else:
            read = own.get(argument.stated.form)
            values[argument.name] = (
                read(table, argument) if read else read_value(table, argument.key, argument.stated, dim)
            )
    return values


def encode_arguments(entry: LawEntry, value: object, where: str) -> dict[str, object]:
    """The parameters of what an entry makes, from which :func:`read_arguments` reads the same."""
    record = {}
    for argument in entry.parameters:
        given = getattr(value, argument.name, None)
        if given is not None and (argument.default is None or callable(given) or not _equal(given, argument.default)):
            record[argument.key] = written(given, argument.stated.form, f"{where}.{argument.name}")
    return record


def rows_of(*classes: type[DataclassInstance], defaults: bool = True, part: str = "") -> list[str]:
    """The rows of dataclasses in the tables of the page of the problem file: key, what it is, and its default."""
    rows = []
    for cls in classes:
        for key, (field, stated) in stated_fields(cls, part).items():
            default = _default(field)
            shown = stated.left_out or ("" if default is MISSING or default is None else f"`{_toml(default)}`")
            rows.append(f"| `{key}` | {stated.says} |" + (f" {shown} |" if shown and defaults else " |" * defaults))
    return rows


def _toml(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return f'"{value}"'
        case tuple():
            return str(list(value))
    return f"{value}"


def _equal(left: object, right: object) -> bool:
    if isinstance(left, Mapping):
        return not left
    given, default = np.asarray(left), np.asarray(right)
    if default.ndim == 0 and given.size:  # a vector of zeros is none
        return bool(np.all(given == default))
    return bool(np.array_equal(given, default))


def _default(field: Field[object]) -> object:
    return field.default if field.default_factory is MISSING else field.default_factory()


def read_value(table: TomlTable, key: str, stated: Stated, dim: int = 0) -> object:
    """The value of a key, in the form of its field."""
    value = table.data[key]
    match stated.form:
        case Form.NUMBER:
            return _within(table, key, table.number(key, value), stated)
        case Form.WHOLE:
            whole = table.whole(key, value, int(stated.least or 0))
            if stated.most is not None and whole > stated.most:
                lowest, highest = int(stated.least or 0), int(stated.most)
                which = (
                    f"{lowest} or {highest}" if highest == lowest + 1 else f"a whole number from {lowest} to {highest}"
                )
                raise table.error(key, f"is {whole}; write {which}")
            return whole
        case Form.FLAG:
            if not isinstance(value, bool):
                raise table.error(key, f"must be true or false, not {kind(value)}")
            return value
        case Form.TEXT:
            return table.text(key, None, stated.choices or None)
        case Form.FILE:
            return _file(table, key, stated.endings)
        case Form.POINTS if isinstance(value, list) and value and isinstance(value[0], list):
            points = [table.items(key, point, (dim,), f"a list of points of {dim} numbers each") for point in value]
            return [tuple(table.number(key, x) for x in point) for point in points]
        case Form.POINT | Form.POINTS:
            return table.numbers(key, dim, f"a list of {dim} numbers")
        case Form.LIST:
            if not isinstance(value, list) or not value:
                raise table.error(key, f"must be a list of numbers, not {kind(value)}")
            return [table.number(key, number) for number in value]
        case Form.VECTOR | Form.TORQUE if stated.form is Form.VECTOR or dim == 3:
            return table.vector(key, value, dim, timed=stated.timed)
        case Form.TENSOR | Form.STRESS if isinstance(value, list):
            size = 3 if stated.form is Form.STRESS and len(value) == 3 else dim
            what = f"a number, a formula, or {size} lists of {size} of these"
            return _square(table, key, dim, size, what, stated.timed)
        case Form.MATRIX:
            size = dim * (dim + 1) // 2
            what = f"{size} lists of {size} numbers or formulas, the rows of the {stated.says} matrix"
            return _square(table, key, dim, size, what)
        case Form.PAIR:
            pair = table.items(key, value, (2,), "a list of two numbers or formulas, lambda and mu")
            return tuple(table.quantity(key, entry, dim) for entry in pair)
    least, above = -np.inf if stated.least is None else stated.least, stated.above if stated.below is None else None
    quantity = table.quantity(key, value, dim, least, above, stated.timed)
    if stated.below is not None and not callable(quantity) and not stated.lowest < quantity < stated.below:
        ends = f"{stated.lowest:g} and {stated.below:g}"
        raise table.error(key, f"is {quantity:g}; it must lie between {ends}, both excluded")
    return quantity


def _square(table: TomlTable, key: str, dim: int, size: int, what: str, timed: bool = False) -> object:
    rows = [table.items(key, row, (size,), what) for row in table.items(key, table.data[key], (size,), what)]
    return array([table.quantity(key, entry, dim, timed=timed) for row in rows for entry in row], (size, size))


def _within(table: TomlTable, key: str, number: float, stated: Stated) -> float:
    """A number within its limits."""
    if stated.least is not None and stated.most is not None:
        if not stated.least <= number <= stated.most:
            raise table.error(key, f"is {number:g}; it must lie between {stated.least:g} and {stated.most:g}")
    elif stated.least is not None and number < stated.least:
        raise table.error(key, f"is {number:g}; it must be at least {stated.least:g}")
    elif stated.above is not None and not number > stated.above:
        more = "positive" if stated.above == 0.0 else f"greater than {stated.above:g}"
        raise table.error(key, f"is {number:g}; it must be {more}")
    elif stated.below is not None and not number < stated.below:
        raise table.error(key, f"is {number:g}; it must be smaller than {stated.below:g}")
    return number


def _file(table: TomlTable, key: str, endings: tuple[str, ...]) -> str:
    name = table.text(key)
    if endings and not any(name.endswith(ending) and name != ending for ending in endings):
        raise table.error(key, f"is '{name}'; give the name of a file that ends in {' or '.join(endings)}")
    return name


def _rows(matrix: object, where: str) -> list[object]:
    entries = entries_record(matrix, where)
    size = round(len(entries) ** 0.5)
    return [entries[k * size : (k + 1) * size] for k in range(size)]


def written(value: object, form: Form, where: str) -> object:
    """A value, or one for each of several names, as a file states it."""
    if isinstance(value, Mapping):
        return {name: written(entry, form, f"{where}['{name}']") for name, entry in value.items()}
    match form:
        case Form.TENSOR | Form.STRESS:
            if isinstance(value, GradientEnergy):
                raise not_expressible(where, f"a {type(value).__name__}", "a number, a formula or a tensor")
            if np.ndim(value) in (1, 3):  # type: ignore[arg-type]
                raise not_expressible(where, "a value for each cell", "a number, a formula or a tensor")
            if isinstance(value, Formula) or (not callable(value) and np.ndim(value) == 0):  # type: ignore[arg-type]
                return quantity_record(value, where)
            return _rows(value, where)
        case Form.MATRIX:
            return _rows(value, where)
        case Form.PAIR:
            return [quantity_record(entry, where) for entry in value]  # type: ignore[attr-defined]
        case Form.QUANTITY:
            return quantity_record(value, where)
        case Form.VECTOR | Form.POINT | Form.TORQUE:
            vector = form is not Form.TORQUE or np.ndim(value) or isinstance(value, FormulaArray)  # type: ignore[arg-type]
            return entries_record(value, where) if vector else quantity_record(value, where)
        case Form.TEXT | Form.FILE:
            return str(value)
        case Form.NUMBER:
            if callable(value) or np.ndim(value):  # type: ignore[arg-type]
                raise not_expressible(where, value, "a number")
            return float(value)  # type: ignore[arg-type]
        case Form.LIST:
            return np.asarray(value, dtype=float).ravel().tolist()
        case Form.POINTS:
            points = np.asarray(value, dtype=float).tolist()
            return points[0] if len(points) == 1 else points
    return value
