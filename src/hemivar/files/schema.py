"""Fields of statements read from a table of a problem file and written to one, as each of them says.

See :mod:`hemivar.basics.stated`. Reading and writing go through the same list of fields; what has its default is not
written.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, Field
from typing import TYPE_CHECKING, Any

import numpy as np

from hemivar.basics.stated import Form, Stated, stated_fields
from hemivar.files.quantities import entries_record, quantity_record
from hemivar.files.toml import TomlTable, kind

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

__all__ = ["decode", "encode", "read_value", "rows_of"]


def decode(
    cls: DataclassInstance | type[DataclassInstance],
    table: TomlTable,
    dim: int = 0,
    **own: Callable[[TomlTable], object],
) -> dict[str, Any]:
    """The fields of a dataclass that a table gives, by their names; the others keep their defaults.

    Parameters
    ----------
    cls : type or instance
        A dataclass of stated fields.
    table : TomlTable
    dim : int
        Directions of the body.
    **own : function
        Readers of fields of the form ``OWN``, by name.

    Raises
    ------
    ProblemError
        One line that names the file, the table and the key.
    """
    found = {}
    for key, (one, said) in stated_fields(cls).items():
        if key in table:
            found[one.name] = own[one.name](table) if said.form is Form.OWN else read_value(table, key, said, dim)
        elif _default(one) is MISSING:
            raise table.error(key, f"is missing; give {said.says}")
    return found


def encode(value: DataclassInstance, where: str = "", **own: Callable[..., object]) -> dict[str, object]:
    """The table of a dataclass of stated fields, from which :func:`decode` reads the same.

    Parameters
    ----------
    value : dataclass
    where : str
        What messages call it.
    **own : function
        Writers of fields of the form ``OWN``, by name; a field of that form without one is left out.

    Raises
    ------
    ProblemError
        A value is one that a file cannot say.
    """
    record = {}
    for key, (one, said) in stated_fields(value).items():
        part, default = getattr(value, one.name), _default(one)
        if part is None or (default is not MISSING and not callable(part) and _equal(part, default)):
            continue
        if said.form is not Form.OWN:
            record[key] = _written(part, said.form, f"{where}.{one.name}".lstrip("."))
        elif one.name in own:
            record[key] = own[one.name](part)
    return record


def rows_of(*classes: type[DataclassInstance], defaults: bool = True) -> list[str]:
    """The rows of dataclasses in the tables of the page of the problem file: key, what it is, and its default.

    Parameters
    ----------
    *classes : type
    defaults : bool
        Whether the table has a column of defaults.
    """
    rows = []
    for cls in classes:
        for key, (one, said) in stated_fields(cls).items():
            default = _default(one)
            shown = said.left_out or ("" if default is MISSING or default is None else f"`{_toml(default)}`")
            rows.append(f"| `{key}` | {said.says} |" + (f" {shown} |" if shown and defaults else " |" * defaults))
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


def _equal(one: object, other: object) -> bool:
    given, default = np.asarray(one), np.asarray(other)
    if default.ndim == 0 and given.size:  # a vector of zeros is none
        return bool(np.all(given == default))
    return bool(np.array_equal(given, default))


def _default(one: Field[object]) -> object:
    return one.default if one.default_factory is MISSING else one.default_factory()


def read_value(table: TomlTable, key: str, said: Stated, dim: int = 0) -> object:
    """The value of a key, in the form of its field."""
    value = table.data[key]
    match said.form:
        case Form.NUMBER:
            return _within(table, key, table.number(key, value), said)
        case Form.WHOLE:
            return table.whole(key, value, int(said.least or 0))
        case Form.FLAG:
            if not isinstance(value, bool):
                raise table.error(key, f"must be true or false, not {kind(value)}")
            return value
        case Form.TEXT:
            return table.text(key, None, said.choices or None)
        case Form.FILE:
            return _file(table, key, said.endings)
        case Form.POINT:
            return table.numbers(key, dim, f"a list of {dim} numbers")
        case Form.VECTOR:
            return table.vector(key, value, dim, timed=said.timed)
    least = -np.inf if said.least is None else said.least
    return table.quantity(key, value, dim, least, said.above, said.timed)


def _within(table: TomlTable, key: str, number: float, said: Stated) -> float:
    """A number within its limits."""
    if said.least is not None and said.most is not None:
        if not said.least <= number <= said.most:
            raise table.error(key, f"is {number:g}; it must lie between {said.least:g} and {said.most:g}")
    elif said.least is not None and number < said.least:
        raise table.error(key, f"is {number:g}; it must be at least {said.least:g}")
    elif said.above is not None and not number > said.above:
        more = "positive" if said.above == 0.0 else f"greater than {said.above:g}"
        raise table.error(key, f"is {number:g}; it must be {more}")
    elif said.below is not None and not number < said.below:
        raise table.error(key, f"is {number:g}; it must be smaller than {said.below:g}")
    return number


def _file(table: TomlTable, key: str, endings: tuple[str, ...]) -> str:
    name = table.text(key)
    if endings and not any(name.endswith(ending) and name != ending for ending in endings):
        raise table.error(key, f"is '{name}'; give the name of a file that ends in {' or '.join(endings)}")
    if not name.strip():
        raise table.error(key, "has an empty name; give the name of a file")
    return name


def _written(value: object, form: Form, where: str) -> object:
    match form:
        case Form.QUANTITY:
            return quantity_record(value, where)
        case Form.VECTOR | Form.POINT:
            return entries_record(value, where)
        case Form.TEXT | Form.FILE:
            return str(value)
        case Form.NUMBER:
            return float(value)  # type: ignore[arg-type]
    return value
