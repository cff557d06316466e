"""Numbers of the sections of an MSH file, in text and in binary, one after the other."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from hemivar.basics.types import BoolArray, IntArray
from hemivar.errors import ProblemError

__all__ = ["Bytes", "Number", "Words", "checked_count", "entries_at", "first_rows", "parameters", "runs", "signed"]

_N = TypeVar("_N", int, float)
#: Types of the entries of a section.
Number = TypeVar("Number", np.int64, np.float64)


class Words:
    """Numbers of a section in text, one after the other."""

    def __init__(self, words: Iterator[bytes], name: str) -> None:
        self.words = words
        self.name = name

    def _next(self, count: int, kind: Callable[[bytes], _N]) -> list[_N]:
        try:
            return [kind(next(self.words)) for _ in range(count)]
        except (StopIteration, RuntimeError):
            raise ProblemError(f"${self.name} holds less than its counts say; save the mesh again") from None
        except ValueError:
            raise ProblemError(f"${self.name} holds what is not a number where one is due; save it again") from None

    def size(self) -> int:
        """A size, the next number."""
        return checked_count(self._next(1, int)[0], f"${self.name}")

    def integers(self, count: int) -> list[int]:
        """The next whole numbers."""
        return self._next(count, int)

    def floats(self, count: int) -> list[float]:
        """The next numbers."""
        return self._next(count, float)


class Bytes:
    """Numbers of a binary section, one after the other."""

    def __init__(self, data: bytes, place: int, order: str, word: int, name: str) -> None:
        self.data = data
        self.place = place
        self.name = name
        self._integer = np.dtype(f"{order}i4")
        self._size = np.dtype(f"{order}u{word}")
        self._float = np.dtype(f"{order}f8")

    @property
    def left(self) -> int:
        """Bytes from the place on."""
        return len(self.data) - self.place

    def array(self, kind: np.dtype[Any], count: int, move: bool = True) -> NDArray[Any]:
        """Entries of a kind; ``move`` takes the place behind them."""
        if count * kind.itemsize > self.left or count < 0:
            raise ProblemError(f"${self.name} is cut off or damaged: its counts go beyond the end; save the mesh again")
        values = np.frombuffer(self.data, kind, count, self.place)
        if move:
            self.place += count * kind.itemsize
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
    place = 0
    while count:
        if place + least > len(rows):
            raise ProblemError(f"{name} holds fewer rows than it says; it is cut off or damaged: save the mesh again")
        columns, keys = width(rows[place:])
        many = min(count, (len(rows) - place) // columns)
        if many == 0:
            raise ProblemError(f"{name} holds fewer rows than it says; it is cut off or damaged: save the mesh again")
        many = first_rows(rows[place : place + many * columns].reshape(many, columns)[:, list(keys)], many, name)
        yield place, columns, many
        place += many * columns
        count -= many
    if place != len(rows):
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


def entries_at(number: NDArray[Number], place: int, count: int, name: str) -> NDArray[Number]:
    """So many entries of an array from a place on, which are due there."""
    if place + count > len(number):
        raise ProblemError(f"{name} holds less than its counts say; it is cut off or damaged: save the mesh again")
    return number[place : place + count]


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
