"""Numbers of the sections of an MSH file, in text and in binary, one after the other."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.disk import shown
from hemivar.basics.types import AnyArray, Array, BoolArray, IntArray
from hemivar.errors import ProblemError

__all__ = ["Bytes", "Numbers", "checked_count", "first_rows", "parameters", "runs", "signed"]

#: Types of the entries of a section.
Number = TypeVar("Number", np.int64, np.float64)


#: What may be a whole number that is written as another one.
_WHOLE_BY_VALUE = re.compile(rb"\.0*\s|[eE]\+?\d")
_ALL = slice(None)


class Numbers:
    """Numbers of a section in text, one after the other."""

    def __init__(self, values: AnyArray, name: str, text: bytes = b"") -> None:
        self.values = values
        self.name = name
        self.offset = 0
        #: The words, if one of them may be a whole number that is written as another one, such as 9.0.
        self._words = text.split() if _WHOLE_BY_VALUE.search(text) else []

    def _take(self, count: int, tags: slice | None = None) -> AnyArray:
        """The next numbers, of which ``tags`` are to be written as whole numbers."""
        if self.offset + count > len(self.values):
            raise ProblemError(f"${self.name} holds less than its counts say; it is cut off or damaged: save it again")
        self.offset += count
        if tags is not None and self._words:
            for word in self._words[self.offset - count : self.offset][tags]:
                if not word.lstrip(b"+-").isdigit():
                    text = shown(word[:30].decode("ascii", "backslashreplace"))
                    raise ProblemError(f"'{text}' is not a whole number (${self.name}); correct it or save it again")
        return self.values[self.offset - count : self.offset]

    def size(self) -> int:
        """A size, the next number."""
        return checked_count(self._take(1, _ALL)[0], f"${self.name}")

    def integers(self, count: int) -> list[int]:
        """The next whole numbers."""
        return [checked_count(value, f"${self.name}", least=-(2**31)) for value in self._take(count, _ALL)]

    def floats(self, count: int) -> list[float]:
        """The next numbers."""
        values: list[float] = self._take(count).tolist()
        return values

    def tags(self, rows: int, columns: int) -> AnyArray:
        """Numbers of nodes and elements, in rows."""
        return self._take(rows * columns, _ALL).reshape(rows, columns)

    def coordinates(self, rows: int, columns: int) -> Array:
        """Coordinates, in rows."""
        return self._take(rows * columns).reshape(rows, columns)

    def nodes(self, rows: int, columns: int) -> tuple[AnyArray, Array]:
        """Nodes, each by its number and its coordinates."""
        table = self._take(rows * (1 + columns), slice(None, None, 1 + columns)).reshape(rows, 1 + columns)
        return table[:, 0], table[:, 1:]

    def finish(self) -> None:
        """Refuse what is left over."""
        if self.offset != len(self.values):
            raise ProblemError(f"${self.name} holds more than its counts say; save it again")


class Bytes:
    """Numbers of a binary section, one after the other."""

    def __init__(self, data: bytes, offset: int, order: str, word: int, name: str, long_tags: bool) -> None:
        self.data = data
        self.offset = offset
        self.name = name
        self._integer = np.dtype(f"{order}i4")
        self._size = np.dtype(f"{order}u{word}")
        self._float = np.dtype(f"{order}f8")
        self._tag = self._size if long_tags else self._integer

    @property
    def left(self) -> int:
        """Bytes from the place on."""
        return len(self.data) - self.offset

    def array(self, kind: np.dtype[np.generic], count: int, move: bool = True) -> AnyArray:
        """Entries of a kind; ``move`` takes the place behind them."""
        if count * kind.itemsize > self.left or count < 0:
            raise ProblemError(f"${self.name} is cut off or damaged: its counts go beyond the end; save the mesh again")
        values = np.frombuffer(self.data, kind, count, self.offset)
        if move:
            self.offset += count * kind.itemsize
        return values

    def size(self) -> int:
        """A size, the next number."""
        return int(self.array(self._size, 1)[0])

    def integers(self, count: int) -> list[int]:
        """The next whole numbers."""
        values: list[int] = self.array(self._integer, count).tolist()
        return values

    def floats(self, count: int) -> list[float]:
        """The next numbers."""
        values: list[float] = self.array(self._float, count).tolist()
        return values

    def tags(self, rows: int, columns: int) -> IntArray:
        """Numbers of nodes and elements, in rows."""
        return signed(self.array(self._tag, rows * columns)).reshape(rows, columns)

    def coordinates(self, rows: int, columns: int) -> Array:
        """Coordinates, in rows."""
        return self.array(self._float, rows * columns).reshape(rows, columns)

    def nodes(self, rows: int, columns: int) -> tuple[IntArray, Array]:
        """Nodes, each by its number and its coordinates."""
        table = self.array(np.dtype([("id", self._integer), ("x", self._float, (columns,))]), rows)
        return table["id"].astype(np.int64), table["x"]

    def finish(self) -> None:
        """What follows is another section."""


def runs(
    rows: NDArray[Number],
    count: int,
    least: int,
    width: Callable[[NDArray[Number]], tuple[int, tuple[int, ...]]],
    name: str,
) -> Iterator[tuple[int, int, int]]:
    """Consecutive rows of equal widths in a flat array: start, width, number of rows.

    ``width`` tells from the first entries of a row its width, and which columns the width follows from.
    """
    row = 0
    while count:
        if row + least > len(rows):
            raise ProblemError(f"{name} holds fewer rows than it says; it is cut off or damaged: save the mesh again")
        columns, keys = width(rows[row:])
        many = min(count, (len(rows) - row) // columns)
        if many == 0:
            raise ProblemError(f"{name} holds fewer rows than it says; it is cut off or damaged: save the mesh again")
        many = first_rows(rows[row : row + many * columns].reshape(many, columns)[:, list(keys)], many, name)
        yield row, columns, many
        row += many * columns
        count -= many
    if row != len(rows):
        raise ProblemError(f"{name} holds more rows than it says, or rows of wrong lengths; save the mesh again")


def first_rows(keys: NDArray[Number], most: int, name: str) -> int:
    """How many rows from the first one on are equal to it, looked at in growing portions."""
    if most == 0:
        raise ProblemError(f"{name} is cut off or damaged; save the mesh again")
    done, portion = 1, 64
    while done < most:
        part: BoolArray = (keys[done : done + portion] == keys[0]).all(axis=1)
        if not part.all():
            return done + int(np.argmin(part))
        done, portion = min(done + portion, most), 2 * portion
    return done


def parameters(dim: float) -> int:
    """Parameters of a node on an entity of this dimension, in the parametric variants."""
    return int(dim) if dim in (1, 2) else 0


def checked_count(value: float, name: str, least: int = 0) -> int:
    """A value as the count that it should be."""
    if not (least <= value < 2**53 and value == int(value)):
        raise ProblemError(f"{name} has {value:g} where a count is due; it is damaged: save the mesh again")
    return int(value)


def signed(values: NDArray[np.integer]) -> IntArray:
    """Sizes as signed integers, clipped."""
    if values.dtype.itemsize < 8:
        return values.astype(np.int64)
    return np.asarray(np.minimum(values, np.uint64(np.iinfo(np.int64).max)).astype(np.int64))
