"""Tables of a TOML file: typed values with errors that say where they stand, and the text of what is written."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import fields

import numpy as np

from hemivar.basics.arguments import suggest
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.stated import keys_of
from hemivar.basics.types import Array
from hemivar.basics.units import Units
from hemivar.errors import ProblemError
from hemivar.files.settings import OutputSettings, SolverSettings, TimeSettings
from hemivar.formula import Formula, FormulaArray
from hemivar.formula.reader import TIME, VARIABLES
from hemivar.mechanics.conditions import Pressure
from hemivar.mechanics.linear_material import Anisotropic, Young
from hemivar.mechanics.material_registry import MATERIAL_LAWS
from hemivar.mechanics.single_material import IN_TIME, SingleMaterial
from hemivar.mechanics.statement import ContactProblem
from hemivar.mesh.recipe import MeshRecipe

__all__ = [
    "KEYS",
    "KEYS_OF_ONE",
    "LINEAR_KEYS",
    "Quantity",
    "TomlTable",
    "array",
    "context",
    "kind",
    "listed",
    "printable",
    "text_of",
]

#: Keys of linear materials.
LINEAR_KEYS = ("lame", *keys_of(Young)[:2], *keys_of(Anisotropic), "plane", *keys_of(SingleMaterial, by=IN_TIME))
_BY_LAW = ("law", *(p.key for entry in MATERIAL_LAWS.values() for p in entry.parameters))
_MATERIAL = tuple(dict.fromkeys((*LINEAR_KEYS, *_BY_LAW)))


class _Keys(Mapping[str, tuple[str, ...]]):
    """Keys by table; a function gives those of a table that few files have, so that its classes are not loaded."""

    def __init__(self, known: Mapping[str, tuple[str, ...] | Callable[[], tuple[str, ...]]]) -> None:
        self._known = known

    def __getitem__(self, table: str) -> tuple[str, ...]:
        keys = self._known[table]
        return keys() if callable(keys) else keys

    def __iter__(self) -> Iterator[str]:
        return iter(self._known)

    def __len__(self) -> int:
        return len(self._known)


def _time_keys() -> tuple[str, ...]:
    with IMPORTS:
        from hemivar.evolution.plan import March
    return keys_of(March, TimeSettings)


def _output_keys() -> tuple[str, ...]:
    with IMPORTS:
        from hemivar.evolution.save import Save
    return (*keys_of(Save, OutputSettings), "checkpoint")


#: Keys of each table; tables named after boundaries or regions are written with a star.
KEYS: Mapping[str, tuple[str, ...]] = _Keys(
    {
        "": (
            "title",
            "mesh",
            "material",
            "loads",
            "supports",
            "contact",
            "area",
            "steps",
            "heat",
            "time",
            "output",
            "solver",
            "units",
        ),
        "mesh": (
            "rectangle",
            "box",
            "cells",
            "pattern",
            "origin",
            "file",
            *keys_of(MeshRecipe, ContactProblem, table="mesh"),
        ),
        "material": (*_MATERIAL, "regions"),
        "material.regions.*": _MATERIAL,
        "loads": keys_of(ContactProblem, Pressure, table="loads"),
        "contact.*": (
            "normal",
            "friction",
            "gap",
            "belt",
            "obstacle",
            "normals",
            "damping",
            "memory",
            "against",
            "slave",
        ),
        "area.*": ("normal", "friction", "belt", "memory"),
        "steps": ("name", "ramp", "loads", "supports", "bolts"),
        "time": _time_keys,
        "output": _output_keys,
        "solver": keys_of(SolverSettings),
        "units": tuple(unit.name for unit in fields(Units)),
    }
)

#: Keys of the top of a file of one component.
KEYS_OF_ONE = ("kind", *(key for key in KEYS[""] if key not in ("heat", "steps")))

#: Tables that get a heading of their own when they are written; all others stand in one line.
_HEADED = (*(key for key in KEYS if key != "steps"), "supports", "contact", "material.regions", "area", "heat.contact")

#: Characters of a value that a message repeats.
_SHOWN = 60

#: What is written as a number or as a formula of the coordinates.
Quantity = float | Formula


class TomlTable:
    """A table of a file that knows where it stands; every accessor raises an error that says so."""

    def __init__(
        self,
        data: Mapping[str, object],
        source: str,
        name: str,
        keys: Iterable[str] | None,
        prefix: str = "",
    ) -> None:
        self.data = data
        self.source = source
        self.name = name
        self.prefix = prefix
        if keys is not None:
            self.only(tuple(keys))

    def __contains__(self, key: str) -> bool:
        return key in self.data

    def where(self, key: str) -> str:
        """File, table and key, as messages begin."""
        table = f"[{self.name}] " if self.name else ""
        return f"{self.source}: {table}{self.prefix}{key}"

    def error(self, key: str, what: str) -> ProblemError:
        """The error to raise about a key."""
        return ProblemError(f"{self.where(key)}: {what}")

    def only(self, keys: tuple[str, ...]) -> None:
        """Refuse keys that are not known."""
        for key in self.data:
            if key in keys:
                continue
            what = "table" if isinstance(self.data[key], dict) and not self.name else "key"
            elsewhere = [
                f"[{table}]" if table else "the top of the file"
                for table, known in KEYS.items()
                if key in known and not self.prefix
            ]
            close = difflib.get_close_matches(key, keys, n=1)
            if close:
                advice = f"did you mean '{close[0]}'?"
            elif elsewhere:
                advice = f"it belongs in {elsewhere[0].replace('*', 'NAME')}"
            else:
                advice = "remove it"
            raise self.error(key, f"unknown {what}; {advice} (known here: {', '.join(keys) or 'none'})")

    def table(self, key: str, keys: Iterable[str] | None, inline: bool = False) -> TomlTable:
        """The table under a key, empty if it is missing."""
        value = self.data.get(key, {})
        if not isinstance(value, dict):
            raise self.error(key, f"must be a table, not {kind(value)}; write [{self._path(key)}]")
        if inline:
            return TomlTable(value, self.source, self.name, keys, f"{self.prefix}{key}.")
        return TomlTable(value, self.source, self._path(key), keys)

    def _path(self, key: str) -> str:
        return f"{self.name}.{key}" if self.name else key

    def text(self, key: str, default: str | None = None, choices: Sequence[str] | None = None) -> str:
        """A text, one of the choices if there are any."""
        value = self.data.get(key, default)
        if not isinstance(value, str):
            quoted = f"; write one of {listed(choices)}" if choices else "; put it in quotes"
            raise self.error(key, f"must be a text, not {kind(value)}{quoted}")
        if choices is None and default is None and not value.strip():
            raise self.error(key, "is empty; write what it says, or leave the key out")
        if choices is not None and value not in choices:
            raise self.error(key, f"'{value}' is not known{suggest(value, choices)}")
        return value

    def number(self, key: str, value: object, what: str = "a number") -> float:
        """A finite number."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.error(key, f"must be {what}, not {kind(value)}")
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if not math.isfinite(number):
            raise self.error(key, f"is {number}; give a finite number")
        return number

    def positive(self, key: str) -> float:
        """A positive number."""
        number = self.number(key, self.data[key])
        if not number > 0:
            raise self.error(key, f"is {number:g}; it must be positive")
        return number

    def whole(self, key: str, value: object, minimum: int) -> int:
        """A whole number of at least a minimum."""
        number = self.number(key, value, "a whole number")
        if number != int(number) or number < minimum:
            raise self.error(key, f"is {_shown(value)}; give a whole number of at least {minimum}")
        return int(number)

    def items(self, key: str, value: object, lengths: tuple[int, ...], what: str) -> list[object]:
        """A list of one of the lengths."""
        if not isinstance(value, list):
            raise self.error(key, f"must be {what}, not {kind(value)}")
        if len(value) not in lengths:
            raise self.error(key, f"has {len(value)} entries; it must be {what}")
        return value

    def numbers(self, key: str, length: int, what: str) -> tuple[float, ...]:
        """A list of so many numbers."""
        return tuple(self.number(key, v) for v in self.items(key, self.data[key], (length,), what))

    def quantity(
        self,
        key: str,
        value: object,
        dim: int,
        minimum: float = -math.inf,
        above: float | None = None,
        timed: bool = False,
    ) -> Quantity:
        """A number, or a formula of the coordinates, and of the time if it may change with it."""
        if isinstance(value, str):
            formula = Formula(value, self.where(key), minimum if minimum > -math.inf else None)
            if TIME in formula.variables and not timed:
                what = "this cannot change with time; give a formula of the coordinates"
                raise self.error(key, f"formula '{value}' uses {TIME}, but {what}")
            foreign = sorted(formula.variables - {*VARIABLES[:dim], TIME})
            if foreign:
                raise self.error(key, f"formula '{value}' uses {foreign[0]}, but the mesh is plane; use x and y")
            if formula.variables:
                return formula
            number = float(Formula(value, self.where(key))(np.zeros((1, dim)))[0])
        else:
            number = self.number(key, value, "a number or a formula in quotes")
        if number < minimum:
            raise self.error(key, f"is {number:g}; it must be at least {minimum:g}")
        if above is not None and not number > above:
            raise self.error(key, f"is {number:g}; it must be greater than {above:g}")
        return number

    def vector(self, key: str, value: object, dim: int, timed: bool = False) -> Array | FormulaArray:
        """A vector of numbers, or a function of the coordinates, and of the time if it may change with it."""
        what = f"a list of {dim} numbers or formulas, one for each direction"
        if isinstance(value, int | float) and not isinstance(value, bool):
            path = ".".join(part for part in (self.name, self.prefix + key) if part)
            what += f" (one of them alone is {path}.0)"
        return array([self.quantity(key, v, dim, timed=timed) for v in self.items(key, value, (dim,), what)], (dim,))


def array(entries: list[Quantity], shape: tuple[int, ...]) -> Array | FormulaArray:
    """Numbers as an array, or a function of the coordinates if there is a formula among them."""
    if any(isinstance(entry, Formula) for entry in entries):
        return FormulaArray(tuple(entries), shape)
    return np.array(entries, dtype=float).reshape(shape)


# ---- words of messages ------------------------------------------------------------------------------------


def kind(value: object) -> str:
    """What a value of TOML is, in words."""
    match value:
        case None:
            return "missing"
        case bool():
            return str(value).lower()
        case str():
            return f"the text '{_shown(value)}'"
        case list():
            return "a list"
        case dict():
            return "a table"
        case int() | float():
            return f"the number {_shown(value)}"
    return _shown(value)


def _shown(value: object) -> str:
    """A value as a message repeats it: in one line that is not too long."""
    text = printable(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."


def printable(value: object) -> str:
    """A value as text, with control characters and the like escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(value))


def listed(names: Sequence[str]) -> str:
    """Names in quotes."""
    return ", ".join(f'"{name}"' for name in names)


@contextmanager
def context(where: str) -> Iterator[None]:
    """Put a place before the message of an error, unless it names its file."""
    try:
        yield
    except ProblemError as error:
        message = str(error)
        placed = message.startswith(where.split(": ")[0] + ": ")
        raise ProblemError(message if placed else f"{where} {message}") from error


# ---- writing ----------------------------------------------------------------------------------------------


def text_of(data: Mapping[str, object]) -> str:
    """The TOML text of a problem file's tables: texts, numbers, truth values, lists and mappings of these."""
    blocks: list[str] = []
    _headed(data, "", "", blocks)
    return "\n".join(blocks)


def _headed(data: Mapping[str, object], path: str, pattern: str, blocks: list[str]) -> None:
    """A table with a heading, and those below it."""
    inner, lines = {}, []
    for key, value in data.items():
        below = f"{pattern}.{key}".lstrip(".")
        starred = f"{pattern}.*".lstrip(".")
        if isinstance(value, Mapping) and (below in _HEADED or starred in _HEADED):
            inner[key] = (value, below if below in _HEADED else starred)
        else:
            lines.append(f"{_key(key)} = {_value(value)}\n")
    if lines:
        blocks.append((f"[{path}]\n" if path else "") + "".join(lines))
    for key, (value, name) in inner.items():
        _headed(value, f"{path}.{_key(key)}".lstrip("."), name, blocks)


def _key(name: str) -> str:
    plain = name != "" and all(c.isascii() and (c.isalnum() or c in "-_") for c in name)
    return name if plain else _value(name)


def _value(value: object) -> str:
    match value:
        case bool():
            return str(value).lower()
        case str():
            return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
        case int() | float():
            return repr(value)
        case Mapping():
            return "{ " + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + " }"
        case Sequence():
            return f"[{', '.join(_value(item) for item in value)}]"
    raise TypeError(f"{value!r} is not a TOML value")  # pragma: no cover
