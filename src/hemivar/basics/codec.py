"""Serialisation: frozen dataclasses as JSON and arrays, and back again: every bit of them, by their annotations.

A new field, or a new class inside of one, needs no format of its own.
"""

from __future__ import annotations

import base64
import math
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from typing import TypeVar, cast

import numpy as np

from hemivar.basics.types import AnyArray

__all__ = ["COMPUTED", "array_of_text", "decoded", "encoded", "text_of_array"]

Kind = TypeVar("Kind")

#: Metadata of a field that is computed again, and not kept.
COMPUTED: Mapping[str, object] = types.MappingProxyType({"kept": False})
#: What JSON has no numbers for, as the texts that stand for them.
_NO_NUMBERS = ("nan", "inf", "-inf")


def encoded(value: object, arrays: list[AnyArray]) -> object:
    """A value as JSON has it; its arrays are appended to the list, and stand as their places in it."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return len(arrays) - 1
    if is_dataclass(value):
        return {one.name: encoded(getattr(value, one.name), arrays) for one in fields(value) if _kept(one.metadata)}
    if isinstance(value, Mapping):
        return {name: encoded(one, arrays) for name, one in value.items()}
    if isinstance(value, tuple | list):
        return [encoded(one, arrays) for one in value]
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, bool | str) or value is None:
        return value
    if isinstance(value, int | np.integer):
        return int(value)
    number = float(value)  # type: ignore[arg-type]
    return number if math.isfinite(number) else str(number)  # JSON has no such numbers


def decoded(kind: type[Kind], head: object, arrays: Sequence[AnyArray]) -> Kind:
    """The value of a class that :func:`encoded` was given."""
    return cast(Kind, _value(kind, head, arrays))


def _kept(metadata: Mapping[str, object]) -> bool:
    return bool(metadata.get("kept", True))


def _value(kind: object, head: object, arrays: Sequence[AnyArray]) -> object:
    origin, inside = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        if head is None and types.NoneType in inside:
            return None
        return _value(next(one for one in inside if one is not types.NoneType), head, arrays)
    if origin is np.ndarray:
        if type(head) is not int or not 0 <= head < len(arrays):
            raise KeyError(f"array {head!r}")
        return arrays[head]
    if isinstance(kind, type) and is_dataclass(kind):
        return _object(kind, head, arrays)
    if origin is tuple:
        entries: list[object] = _expected(list, head)
        kinds = [inside[0]] * len(entries) if inside[-1] is Ellipsis else inside
        return tuple(_value(one, entry, arrays) for one, entry in zip(kinds, entries, strict=True))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {name: _value(inside[1], one, arrays) for name, one in _expected(dict, head).items()}
    if kind is float:
        if isinstance(head, bool) or not (isinstance(head, int | float) or head in _NO_NUMBERS):
            raise TypeError(f"{head!r:.40} is not a number")
        return float(head)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(head)
    return _expected(cast(type, kind), head)


def _object(kind: type, head: object, arrays: Sequence[AnyArray]) -> object:
    hints, given = typing.get_type_hints(kind), _expected(dict, head)
    kept = [one.name for one in fields(kind) if _kept(one.metadata)]
    if given.keys() != set(kept):
        lacks = next((name for name in kept if name not in given), None)
        raise KeyError(f"{kind.__name__} has the fields {', '.join(kept)}") if lacks is None else KeyError(lacks)
    return kind(**{name: _entry(name, hints[name], given[name], arrays) for name in kept})


def _entry(name: str, kind: object, head: object, arrays: Sequence[AnyArray]) -> object:
    try:
        return _value(kind, head, arrays)
    except (TypeError, ValueError, OverflowError) as error:
        raise TypeError(f"'{name}': {error}") from None


def _expected(kind: type[Kind], head: object) -> Kind:
    if type(head) is not kind:
        raise TypeError(f"{head!r:.40} is not a {kind.__name__}")
    return head


def text_of_array(array: AnyArray) -> dict[str, object]:
    """An array of floats as JSON: its shape, and its bytes, eight a number, the lowest first, in base 64."""
    data = base64.b64encode(np.ascontiguousarray(array, dtype="<f8").tobytes()).decode("ascii")
    return {"shape": list(array.shape), "data": data}


def array_of_text(packed: object) -> AnyArray:
    """The contrary of :func:`text_of_array`."""
    given: dict[str, object] = _expected(dict, packed)
    shape: list[int] = _expected(list, given["shape"])
    if any(type(length) is not int or length < 0 for length in shape):
        raise TypeError("a shape is not a list of whole numbers")
    numbers = np.frombuffer(base64.b64decode(str(given["data"]), validate=True), dtype="<f8")
    return numbers.astype(float).reshape(shape)
