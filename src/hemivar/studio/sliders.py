"""Sliders for the numbers of a problem file: which there are, how far each goes, and what they are called."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

from hemivar.basics.stated import Argument
from hemivar.basics.units import Units
from hemivar.evolution.schemes.by_name import SCHEME_ENTRIES
from hemivar.laws.parameters import LENGTH, LINE, PRESSURE, RATE
from hemivar.laws.registry import COUPLED_LAWS, FRICTION_LAWS, MEMORIES, NORMAL_LAWS, LawKind, entry_named
from hemivar.mechanics.material_registry import MATERIAL_LAWS
from hemivar.studio.toml_numbers import TextNumber

__all__ = ["Slider", "key_of_message", "sliders_of"]

#: Tables whose numbers say how to compute, or are no part of what a picture shows.
_LEFT_OUT = ("solver", "output", "units")
#: Whole numbers, with the least and the most that a slider gives.
_WHOLE = {"cells": (1, 160), "refine": (0, 4), "order": (1, 2)}
#: Most cells along a direction of a body in space.
_CELLS_IN_SPACE = 24
#: Numbers that must be greater than zero, or stay within bounds.
_POSITIVE = ("young", "rectangle", "box", "scale", "density", "until", "step", "radius")
_BOUNDED = {"poisson": (0.0, 0.49)}
#: Entries of a list that have a slider each.
_LISTS_SHOWN = 24
#: What numbers are that no law has, by the key of theirs.
_KINDS = {
    **dict.fromkeys(("young", "lame", "traction"), PRESSURE),
    **dict.fromkeys(("displacement", "rectangle", "box", "shift", "gap", "radius", "centre"), LENGTH),
    **dict.fromkeys(("until", "step"), "time"),
}  # fmt: skip
#: The units of a file that make up what a number is.
_UNITS = {
    PRESSURE: ("stress",), RATE: ("stress", "length"), LENGTH: ("length",), LINE: ("force", "length"),
    "time": ("time",),
}  # fmt: skip
#: What stands under a name in each table, and the key of the name where it is not "law".
_ENTRIES = {
    LawKind.NORMAL: {**NORMAL_LAWS, **COUPLED_LAWS}, LawKind.FRICTION: FRICTION_LAWS, LawKind.MEMORY: MEMORIES,
    LawKind.MATERIAL: MATERIAL_LAWS, LawKind.SCHEME: SCHEME_ENTRIES,
}  # fmt: skip
_KEYS = {LawKind.MEMORY: "kind", LawKind.SCHEME: "name"}


@dataclass(frozen=True)
class Slider:
    """One number of the text."""

    key: str  # its path, joined by dots
    table: str
    label: str
    start: int
    end: int
    value: float
    low: float
    high: float
    step: float
    whole: bool  # whether it is a whole number
    meaning: str = ""  # what it is, in words
    unit: str = ""  # its unit, by those of the file

    def record(self) -> dict[str, object]:
        """For JSON."""
        return asdict(self)


def sliders_of(
    data: Mapping[str, object], numbers: list[TextNumber], units: Units, code: Sequence[str] = ()
) -> list[Slider]:
    """The sliders of a file: of its law, loads, material, supports, mesh and time."""
    sliders = []
    for number in numbers:
        first = str(number.path[0])
        if (
            first in _LEFT_OUT
            or len(number.path) < 2
            or any(isinstance(k, int) and k >= _LISTS_SHOWN for k in number.path)
        ):
            continue
        parameter = _parameter(data, number, code)
        low, high, whole = _range(data, number, parameter)
        step = 1.0 if whole else _nice((high - low) / 200.0)
        table, label = _names(number)
        meaning = "" if parameter is None else f"{parameter.stated.says} ({parameter.stated.unit})".removesuffix(" ()")
        span, unit = (number.start, number.end), _unit(number, parameter, units)
        sliders.append(Slider(number.key, table, label, *span, number.value, low, high, step, whole, meaning, unit))
    return sliders


def key_of_message(message: str, keys: list[str]) -> str | None:
    """The key that a message of the library names: ``file: [contact.bottom] normal.q_max: ...``, or a table of it."""
    words = message.split(": ")
    for word in words[:3]:
        table, bracket, rest = word.partition("] ")
        key_named = f"{table[1:]}.{rest}" if bracket and table.startswith("[") else word.strip("[]")
        near = [key for key in keys if key == key_named or key.startswith(f"{key_named}.")]
        if near:
            return near[0]
    return None


def _names(number: TextNumber) -> tuple[str, str]:
    path = [str(step) for step in number.path]
    depth = 2 if path[0] in ("contact", "area") and len(path) > 2 else 1
    return ".".join(path[:depth]), ".".join(path[depth:])


def _unit(number: TextNumber, parameter: Argument | None, units: Units) -> str:
    """The unit of a number; empty where the file gives none for it."""
    names = [str(step) for step in number.path if isinstance(step, str)]
    kind = parameter.stated.unit if parameter is not None else next((_KINDS[n] for n in names[1:] if n in _KINDS), "")
    parts = [getattr(units, name) for name in _UNITS.get(kind, ())]
    return "/".join(parts) if all(parts) else ""


def _parameter(data: Mapping[str, object], number: TextNumber, code: Sequence[str]) -> Argument | None:
    """The parameter of a law, a memory, a material or a scheme that a number is."""
    match number.path:
        case ("contact", _, "normal" | "friction" as part, _, *_):
            depth, kind = 3, LawKind(part)
        case ("contact", _, "memory", int(), _, *_):
            depth, kind = 4, LawKind.MEMORY
        case ("material", "regions", _, _, *_):
            depth, kind = 3, LawKind.MATERIAL
        case ("material", _, *_):
            depth, kind = 1, LawKind.MATERIAL
        case ("time", "scheme", _, *_):
            depth, kind = 2, LawKind.SCHEME
        case _:
            return None
    table: object = data
    for step in number.path[:depth]:
        inner = table.get(str(step)) if isinstance(table, Mapping) else None
        table = table[int(step)] if isinstance(table, Sequence) else inner
    name = table.get(_KEYS.get(kind, "law")) if isinstance(table, Mapping) else None
    entry = _ENTRIES[kind].get(str(name))
    if entry is None and isinstance(name, str):  # of the user, and allowed: the file was read
        entry = entry_named(name, kind, (object,), code)
    return None if entry is None else next((p for p in entry.parameters if p.key == number.path[depth]), None)


def _range(data: Mapping[str, object], number: TextNumber, parameter: Argument | None) -> tuple[float, float, bool]:
    value, name = float(number.value), next(str(k) for k in reversed(number.path) if isinstance(k, str))
    if number.path[0] == "mesh" and name in _WHOLE:
        least, most = _WHOLE[name]
        mesh = data.get("mesh")
        if name == "cells" and isinstance(mesh, Mapping) and "box" in mesh:
            most = _CELLS_IN_SPACE
        return least, max(most, value), True
    if name in _BOUNDED and _BOUNDED[name][0] <= value <= _BOUNDED[name][1]:
        return (*_BOUNDED[name], False)
    size = _nice(2.0 * abs(value)) if value else 1.0
    low, high = (-size, size) if number.path[0] in ("loads", "supports", "contact") else (0.0, size)
    if parameter is not None:
        low = max(low, parameter.stated.lowest)
        high = max(high, low + size)
        if low == 0.0 and parameter.required and value > 0.0:
            low = size / 200.0
    elif value < 0.0:
        low, high = -size, size
    if name in _POSITIVE and value > 0.0:
        low = size / 50.0
    return low, high, False


def _nice(value: float) -> float:
    """The smallest of 1, 2, 5 times a power of ten that is at least ``value``."""
    power = 10.0 ** math.floor(math.log10(value)) if 1e-300 < value < 1e300 else 1.0
    digit = next((d for d in (1, 2, 5, 10) if d * power >= value * (1.0 - 1e-9)), 10)
    return float(f"{digit * power:.6g}")
