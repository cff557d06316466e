"""Where the numbers of a TOML text stand, so that one of them can be replaced and all else stays as it is written."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass

__all__ = ["TextNumber", "numbers_of", "replaced"]

_BARE = re.compile(r"[^,\]}#\n]+")
_KEY = re.compile(r"[A-Za-z0-9_-]+")
_NUMBER = re.compile(r"[+-]?(\d(_?\d)*)(\.\d(_?\d)*)?([eE][+-]?\d(_?\d)*)?$")


@dataclass(frozen=True)
class TextNumber:
    """A number in a TOML text.

    Attributes
    ----------
    path : tuple of str and int
        Keys of the tables on the way, and places in lists, from 0.
    start, end : int
        Characters that it takes.
    value : float or int
    """

    path: tuple[str | int, ...]
    start: int
    end: int
    value: float | int

    @property
    def key(self) -> str:
        """The path joined by dots."""
        return ".".join(map(str, self.path))


def numbers_of(text: str) -> list[TextNumber]:
    """The numbers of a text that is valid TOML, in the order in which they stand; inf, nan and hex are left out."""
    return list(_Scanner(text).statements())


def replaced(text: str, number: TextNumber, value: float | int) -> str:
    """The text with another value in the place of a number."""
    return f"{text[: number.start]}{value!r}{text[number.end :]}"


class _Scanner:
    """A walk through a text that ``tomllib`` has accepted: it need not look for mistakes."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.at = 0

    def statements(self) -> Iterator[TextNumber]:
        text = self.text
        table: tuple[str | int, ...] = ()
        lists: dict[tuple[str | int, ...], int] = {}
        while self._skip("\r\n\t "):
            if text.startswith("[[", self.at):
                self.at += 2
                path = self._placed(self._keys(), lists)
                lists[path] = lists.get(path, -1) + 1
                table = (*path, lists[path])
                self.at = text.index("]]", self.at) + 2
            elif text[self.at] == "[":
                self.at += 1
                table = self._placed(self._keys(), lists)
                self.at = text.index("]", self.at) + 1
            else:
                yield from self._pair(table)

    @staticmethod
    def _placed(keys: tuple[str, ...], lists: dict[tuple[str | int, ...], int]) -> tuple[str | int, ...]:
        """A header's path, in the last entry of the lists of tables on the way."""
        path: tuple[str | int, ...] = ()
        for depth, key in enumerate(keys):
            path = (*path, key)
            if path in lists and depth < len(keys) - 1:
                path = (*path, lists[path])
        return path

    def _skip(self, blank: str) -> bool:
        """Pass blanks and comments; whether there is more."""
        text = self.text
        while self.at < len(text):
            if text[self.at] in blank:
                self.at += 1
            elif text[self.at] == "#":
                end = text.find("\n", self.at)
                self.at = len(text) if end < 0 else end
            else:
                return True
        return False

    def _keys(self) -> tuple[str, ...]:
        found: list[str] = []
        while True:
            self._skip(" \t")
            if self.text[self.at] in "\"'":
                begin = self.at
                self._string()
                found.append(next(iter(tomllib.loads(f"{self.text[begin : self.at]} = 0"))))
            else:
                match = _KEY.match(self.text, self.at)
                assert match is not None
                found.append(match[0])
                self.at = match.end()
            self._skip(" \t")
            if self.text[self.at] != ".":
                return tuple(found)
            self.at += 1

    def _pair(self, table: tuple[str | int, ...]) -> Iterator[TextNumber]:
        keys = self._keys()
        self.at += 1  # the sign =
        self._skip(" \t")
        yield from self._value((*table, *keys))

    def _string(self) -> None:
        text, quote = self.text, self.text[self.at]
        if text.startswith(3 * quote, self.at):
            self.at += 3
            while not text.startswith(3 * quote, self.at):
                self.at += 2 if quote == '"' and text[self.at] == "\\" else 1
            self.at += 3
            while self.at < len(text) and text[self.at] == quote:  # quotes that end the text itself
                self.at += 1
            return
        self.at += 1
        while text[self.at] != quote:
            self.at += 2 if quote == '"' and text[self.at] == "\\" else 1
        self.at += 1

    def _value(self, path: tuple[str | int, ...]) -> Iterator[TextNumber]:
        match self.text[self.at]:
            case '"' | "'":
                self._string()
            case "[":
                self.at += 1
                place = 0
                while self._skip(" \t\r\n,") and self.text[self.at] != "]":
                    yield from self._value((*path, place))
                    place += 1
                self.at += 1
            case "{":
                self.at += 1
                while self._skip(" \t\r\n,") and self.text[self.at] != "}":
                    yield from self._pair(path)
                self.at += 1
            case _:
                match = _BARE.match(self.text, self.at)
                assert match is not None
                word = match[0].rstrip()
                if _NUMBER.match(word):
                    plain = word.replace("_", "")
                    whole = not any(mark in plain for mark in ".eE")
                    value: float | int = int(plain) if whole else float(plain)
                    yield TextNumber(path, self.at, self.at + len(word), value)
                self.at = match.end()
