"""Tables as CSV: texts in them are texts to a spreadsheet too, and come back as they were."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable

from hemivar.errors import FileError

__all__ = ["cell_read", "csv_rows", "csv_text", "number_in"]

#: What a spreadsheet takes for the beginning of a formula.
_FORMULA = re.compile(r"'*[=+\-@\t\r]")


def csv_text(columns: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """A table as CSV, numbers with all their digits, None as an empty cell.

    A text that a spreadsheet would take for a formula (``=1+1``, ``@SUM``), and that is no number, gets an apostrophe
    in front, as spreadsheets have it; :func:`cell_read` takes it away.
    """
    stream = io.StringIO()
    writer = csv.writer(stream)
    writer.writerow([_guarded(name) for name in columns])
    writer.writerows([_guarded(cell) for cell in row] for row in rows)
    return stream.getvalue()


def csv_rows(text: str, name: str) -> list[list[str]]:
    """The rows of a CSV text that are not empty."""
    reader = csv.reader(io.StringIO(text))
    try:
        return [row for row in reader if row]
    except csv.Error as error:
        raise FileError(f"{name}, line {reader.line_num}: this is not a line of a table: {error}") from None


def cell_read(text: str) -> str:
    """A text that :func:`csv_text` wrote, as it was."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text) else text


def _guarded(cell: object) -> object:
    return f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) and not _is_number(cell) else cell


def number_in(text: str) -> float:
    """A number as tables hold it, in decimal digits; Python alone would take 1_5 for 15."""
    if "_" in text or not text.isascii():
        raise ValueError(text)
    return float(text)


def _is_number(text: str) -> bool:
    try:
        number_in(text)
    except ValueError:
        return False
    return True
