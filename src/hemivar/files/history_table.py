"""The table of an evolution, a row for each step: as columns, CSV, Parquet, pandas and JSON, and read back."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arguments import quoted
from hemivar.basics.csv_text import cell_read, csv_rows, csv_text, number_in
from hemivar.basics.disk import path_of, read_text, regular_file, shown, whole_file, write_text
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.memory import size_in_words
from hemivar.basics.pandas_frame import data_frame
from hemivar.basics.rows import plain
from hemivar.basics.types import Array, Record
from hemivar.basics.units import Units
from hemivar.errors import FileError, ProblemError
from hemivar.evolution.history import History
from hemivar.evolution.state import EnergyBalance
from hemivar.files.record import prepared, version
from hemivar.files.series import write_pvd
from hemivar.mesh.vtu_grid import BUDGET

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = [
    "HISTORY_FILES",
    "check_table",
    "history_columns",
    "history_frame",
    "history_record",
    "quantity_of",
    "read_history_table",
    "write_history",
    "write_history_json",
    "write_history_table",
]

#: Suffixes that :func:`write_history` knows.
HISTORY_FILES = (".pvd", ".csv", ".parquet", ".json")
#: Columns of the energy balance.
_ENERGIES = {part.name for part in fields(EnergyBalance)} - {"start"}
_WHOLE = ("solver_steps", "jumped", "fallbacks")


def history_columns(history: History) -> dict[str, Array]:
    """The table by columns, each (rows,): floats, whole numbers for ``solver_steps``, ``fallbacks``
    and ``jumped`` (0 or 1)."""
    columns: dict[str, Array] = {}
    for name in history.columns:
        values = history[name]
        columns[name] = np.asarray(values.astype(np.int64) if name in _WHOLE else values)
    return columns


def write_history(history: History, path: str | Path) -> tuple[Path, ...]:
    """Write an evolution, by the suffix of the name.

    ``.pvd`` the frames for ParaView, with a folder of VTU files; ``.csv`` and ``.parquet`` the table;
    ``.json`` the record of :func:`history_record`.
    """
    suffix = path_of(path).suffix.lower()
    if suffix == ".pvd":
        return write_pvd(history, path)
    if suffix == ".json":
        return (write_history_json(history, path),)
    if suffix in (".csv", ".parquet"):
        return (write_history_table(history_columns(history), path, history.discrete.evolution.problem.units),)
    raise ProblemError(f"'{shown(path)}': a history is written as {', '.join(HISTORY_FILES)}, not {quoted(suffix)}")


def quantity_of(column: str) -> str:
    """What a column measures, as :class:`Units` names it; empty where it is a number, or a measure of the contact."""
    name = column.rpartition(".")[2]
    if name.startswith("u_") or name == "penetration":
        return "length"
    if name in ("time", "step", "largest_step", "force_time"):
        return "time"
    return "force" if name.endswith("_force") else "energy" if name in _ENERGIES else ""


def write_history_table(columns: Mapping[str, Array], path: str | Path, units: Units | None = None) -> Path:
    """Write a table as ``.csv`` (every number so that it is read back the same) or ``.parquet``.

    ``units`` stand in the headings of CSV, ``time (s)``.
    """
    path = path_of(path)
    if path.suffix.lower() == ".parquet":
        path = prepared(path, ".parquet")
        arrow, parquet = _arrow()
        with whole_file(path) as name:
            parquet.write_table(arrow.table({name: np.asarray(values) for name, values in columns.items()}), name)
        return path
    path = prepared(path, ".csv")
    rows = zip(*(np.asarray(values).tolist() for values in columns.values()), strict=True)
    heads = columns if units is None else [units.head(name, quantity_of(name)) for name in columns]
    write_text(path, csv_text(heads, rows))
    return path


def check_table(path: Path) -> None:
    """Refuse, before the work, a table that could not be written after it."""
    if path.suffix.lower() == ".parquet":
        _arrow()


def _arrow() -> tuple[ModuleType, ModuleType]:
    try:
        with IMPORTS:
            import pyarrow
            import pyarrow.parquet
    except ImportError:
        raise ProblemError("pyarrow is not installed; pip install pyarrow, or write the table as .csv") from None
    return pyarrow, pyarrow.parquet


def read_history_table(path: str | Path) -> dict[str, Array]:
    """A table that :func:`write_history_table` wrote, by columns, without the units of their headings."""
    path = path_of(path)
    name = shown(path)
    if path.suffix.lower() == ".parquet":
        columns = _from_parquet(path)
    else:
        rows = csv_rows(read_text(path, "table of a history"), name)
        columns = _columns(name, rows)
    if not {"time", "step"} <= columns.keys() or not len(columns["time"]):
        raise FileError(
            f"{name}: this is not the table of a run, which has columns 'time' and 'step' and a row for each step; "
            "write it with 'hemivar march FILE --table run.csv'"
        )
    return columns


def _from_parquet(path: Path) -> dict[str, Array]:
    """The columns of a Parquet file, whose size in memory is known before any of them is read."""
    _, parquet = _arrow()
    name = shown(path)
    least, ratio = BUDGET
    most = max(least, ratio * regular_file(path, "table of a history", 1 << 62).stat().st_size)
    try:
        with parquet.ParquetFile(path) as file:
            head = file.metadata
            groups = [head.row_group(k) for k in range(head.num_row_groups)]
            numbers = 8 * head.num_columns * max(head.num_rows, sum(abs(group.num_rows) for group in groups))
            if max(numbers, sum(abs(group.total_byte_size) for group in groups)) > most:
                raise FileError(f"{name}: the table would take more than {size_in_words(most)}; write it as .csv")
            table = file.read()
        return {column: np.asarray(table[column], dtype=float) for column in table.column_names}
    except FileError:
        raise
    except Exception as error:  # pyarrow raises many kinds
        reason = shown(error)[:200]
        raise FileError(f"{name}: this is not the table of a run ({reason}); write it with --table") from None


def _columns(name: str, rows: Sequence[Sequence[str]]) -> dict[str, Array]:
    head, body = (rows[0], rows[1:]) if rows else ((), ())
    for number, row in enumerate(body, start=2):
        if len(row) != len(head):
            raise FileError(f"{name}: row {number} has {len(row)} entries, the head {len(head)}; write the table again")
    columns = {}
    for k, column in enumerate(head):
        try:
            columns[_without_unit(cell_read(column))] = np.array([number_in(row[k]) for row in body])
        except ValueError:  # any file may be named as a table: nothing of it is repeated
            raise FileError(
                f"{name}: column {k + 1} holds an entry that is not a number; write the table again"
            ) from None
    return columns


def _without_unit(head: str) -> str:
    """The name of a column, whose heading may have a unit: ``work (mJ)``."""
    name, bracket, _ = head.rpartition(" (")
    return name if bracket and head.endswith(")") and quantity_of(name) else head


def history_frame(history: History) -> DataFrame:
    """The table as a pandas DataFrame."""
    return data_frame(history_columns(history), "history.table, which needs numpy only")


def write_history_json(history: History, path: str | Path, units: Mapping[str, str] | None = None) -> Path:
    """Write :func:`history_record` to a file that ends in ``.json``; returns its path."""
    path = prepared(path, ".json")
    record = {**history_record(history), "units": dict(units)} if units else history_record(history)
    write_text(path, json.dumps(record, allow_nan=False) + "\n")
    return path


def history_record(history: History) -> Record:
    """An evolution as plain numbers, texts and lists; numbers that are not finite become None.

    ``ended``, ``time`` at the end, ``steps``, ``solver_steps``, least ``margin``, largest ``residual``, ``ledger``,
    ``time_error`` (norm, bound, guaranteed, why), ``events`` (time, name), ``messages``, and ``table``: a list for each
    column; ``load_steps``, their names, where there are some.

    Parameters
    ----------
    history : History

    Returns
    -------
    dict
    """
    error = history.time_error
    record = {
        "hemivar": version(),
        "ended": history.ended,
        "time": history.state.time,
        "steps": len(history.taken),
        "solver_steps": int(history["solver_steps"].sum()),
        "margin": history.margin,
        "residual": history.residual,
        "ledger": dict(history.ledger),
        "time_error": {name: getattr(error, name) for name in ("norm", "bound", "guaranteed", "why")},
        "events": [list(event) for event in history.events],
        "messages": list(history.messages),
        "table": history_columns(history),
    }
    if steps := history.discrete.evolution.steps:
        record["load_steps"] = [step.name for step in steps]
    return {key: plain(value) for key, value in record.items()}
