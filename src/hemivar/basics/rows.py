"""Rows of a result, stated once by its columns (tidy data), and its claims: what all output is made of."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import EllipsisType
from typing import overload

import numpy as np

from hemivar.basics.types import AnyArray, Record

__all__ = ["Claim", "Column", "ResultRows", "plain", "two_decimals"]


@dataclass(frozen=True, eq=False)
class Column:
    """What each row says under one name."""

    head: str | None  # heading in tables; None: in records alone
    values: Sequence[object] | AnyArray  # one for each row; ... where a row says nothing
    key: str = ""  # its name in records; empty: in tables alone
    within: str = ""  # the table of the record that it stands in
    brief: str | EllipsisType | None = ...  # heading in brief tables, if another one; None: not there
    unit: str = ""  # of what: "length", "force", "energy"
    cell: Callable[[object], object] | None = None  # how a value is written in tables


@dataclass(frozen=True, eq=False)
class ResultRows(Sequence[Record]):
    """The rows of a result, each a record of its values by their names."""

    columns: tuple[Column, ...]

    def __len__(self) -> int:
        return len(self.columns[0].values)

    @overload
    def __getitem__(self, index: int) -> Record: ...

    @overload
    def __getitem__(self, index: slice) -> list[Record]: ...

    def __getitem__(self, index: int | slice) -> Record | list[Record]:
        if isinstance(index, slice):
            return [self[number] for number in range(*index.indices(len(self)))]
        record: Record = {}
        for column in self.columns:
            value = column.values[index]
            if column.key and value is not ...:
                (record.setdefault(column.within, {}) if column.within else record)[column.key] = _own(value)
        return record

    def by_name(self) -> Record:
        """The values of each column of records by its name, or by its heading where it stands in a table of them."""
        named: Record = {}
        for column in self.columns:
            if not column.key or isinstance(column.values[0] if len(self) else None, dict):
                continue
            name = str(column.head) if column.within else column.key
            several = isinstance(column.values, np.ndarray) and column.values.ndim == 2
            parts = np.asarray(column.values).T if several else [column.values]
            ends = [f"_{number + 1}" for number in range(len(parts))] if len(parts) > 1 else [""]
            named |= {name + end: self._whole(part) for end, part in zip(ends, parts, strict=False)}
        return named

    def _whole(self, values: Sequence[object] | AnyArray) -> object:
        return values if isinstance(values, np.ndarray) else [None if one is ... else one for one in values]

    def cells(self, column: Column) -> list[object]:
        """The cells of a column in a table: empty where there is no number."""
        values = [_own(value) for value in column.values]
        known = [None if value is ... or value != value else value for value in values]
        return known if column.cell is None else [None if one is None else column.cell(one) for one in known]


@dataclass(frozen=True)
class Claim:
    """One thing that a result says, as every output tells it."""

    #: Before the sentence in lines, empty where it goes on; of several claims of one label the first is found by it.
    label: str
    sentence: str
    #: The number, word or truth that is claimed; relative, of a distance.
    value: object = None
    #: Why that is an estimate, in a word or two; empty where it is proved.
    doubt: str = ""
    #: Whether it is left out of summaries.
    whole: bool = False

    @property
    def size(self) -> str:
        """What stands before a number that bounds, or estimates."""
        return "about" if self.doubt else "at most"


def two_decimals(value: object) -> object:
    """A number as it stands in tables of orders."""
    return round(value, 2) if isinstance(value, float) else value


def _own(value: object) -> object:
    """A number of Python for one of NumPy; of a table in a record its own copy."""
    return dict(value) if isinstance(value, dict) else value.item() if isinstance(value, np.generic) else value


def plain(value: object) -> object:
    """Lists, numbers and strings; numbers that are not finite become None."""
    if isinstance(value, np.ndarray):
        known = value.dtype.kind in "iub" or (value.dtype.kind == "f" and bool(np.isfinite(value).all()))
        return value.tolist() if known else plain(value.tolist())
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
