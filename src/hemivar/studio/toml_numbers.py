"""Where the numbers of a TOML text stand, so that one of them can be replaced and all else stays as it is written."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from hemivar.basics.first_use import IMPORTS

if TYPE_CHECKING:
    from tomlkit.items import Float, Integer

__all__ = ["TextNumber", "in_utf16", "numbers_of", "replaced"]

_NUMBER = re.compile(r"[+-]?(\d(_?\d)*)(\.\d(_?\d)*)?([eE][+-]?\d(_?\d)*)?$")
#: A character for private use, which marks the places of numbers.
_EDGE = "\ue000"


@dataclass(frozen=True)
class TextNumber:
    """A number in a TOML text."""

    path: tuple[str | int, ...]  # keys of the tables on the way, and places in lists, from 0
    start: int  # the characters that it takes
    end: int
    value: float | int

    @property
    def key(self) -> str:
        """The path joined by dots."""
        return ".".join(map(str, self.path))


def numbers_of(text: str) -> list[TextNumber]:
    """The numbers of a text that is valid TOML, in the order in which they stand; inf, nan and hex are left out."""
    with IMPORTS:
        import tomlkit

    document: Any = tomlkit.parse(text)
    edge = _EDGE
    while edge in text:
        edge += _EDGE
    leaves = [(path, item) for path, item in _leaves(document, ()) if _NUMBER.match(item.as_string())]
    for number, (path, _) in enumerate(leaves):
        table = document
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = f"{edge}{number}{edge}"
    numbers, shift = [], 0
    for mark in re.finditer(f'"{edge}(\\d+){edge}"', tomlkit.dumps(document)):
        path, item = leaves[int(mark[1])]
        start, length = mark.start() + shift, len(item.as_string())
        numbers.append(TextNumber(path, start, start + length, item.unwrap()))
        shift += length - len(mark[0])
    return numbers


def in_utf16(text: str, numbers: list[TextNumber]) -> list[TextNumber]:
    """The numbers with their places in UTF-16 units, as a browser counts: a character beyond U+FFFF takes two."""
    wide = [index for index, character in enumerate(text) if ord(character) > 0xFFFF]
    return [
        replace(n, start=n.start + bisect_left(wide, n.start), end=n.end + bisect_left(wide, n.end)) for n in numbers
    ]


def _leaves(value: object, path: tuple[str | int, ...]) -> Iterator[tuple[tuple[str | int, ...], Integer | Float]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from _leaves(inner, (*path, str(key)))
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _leaves(inner, (*path, index))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path, value  # type: ignore[misc]


def replaced(text: str, number: TextNumber, value: float | int) -> str:
    """The text with another value in the place of a number."""
    return f"{text[: number.start]}{value!r}{text[number.end :]}"
