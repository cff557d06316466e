"""Rows of a result, stated once by its columns: tables, records, files and frames are made of them (tidy data)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from types import EllipsisType
from typing import overload

import numpy as np

from hemivar.basics.types import Array, Record

__all__ = ["Column", "Rows", "plain", "two_decimals"]


@dataclass(frozen=True, eq=False)
class Column:
    """What each row says under one name."""

    head: str | None  # heading in tables; None: in records alone
    values: Sequence[object] | Array  # one for each row; ... where a row says nothing
    key: str = ""  # its name in records; empty: in tables alone
    within: str = ""  # the table of the record that it stands in
    brief: str | EllipsisType | None = ...  # heading in brief tables, if another one; None: not there
    unit: str = ""  # of what: "length", "force", "energy"
    cell: Callable[[object], object] | None = None  # how a value is written in tables


@dataclass(frozen=True, eq=False)
class Rows(Sequence[Record]):
    """The rows of a result, each a record of plain values."""

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
                (record.setdefault(column.within, {}) if column.within else record)[column.key] = plain(value)
        return record

    def by_name(self) -> Record:
        """The values of each column of records by its name."""
        return {column.key: list(column.values) for column in self.columns if column.key}

    def cells(self, column: Column) -> list[object]:
        """The cells of a column in a table: empty where there is no number."""
        values = [value.item() if isinstance(value, np.generic) else value for value in column.values]
        known = [None if value is ... or value != value else value for value in values]
        return known if column.cell is None else [None if one is None else column.cell(one) for one in known]


def two_decimals(value: object) -> object:
    """A number as it stands in tables of orders."""
    return round(value, 2) if isinstance(value, float) else value


def plain(value: object) -> object:
    """A value for a file: numbers of Python, None where one is not finite; lists and texts as they are."""
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [plain(one) for one in value]
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value
