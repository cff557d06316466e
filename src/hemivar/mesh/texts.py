"""Numbers in the texts of mesh files."""

from __future__ import annotations

import re

import numpy as np

from hemivar.basics.disk import shown
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import ProblemError

__all__ = ["floats", "rows_of", "whole"]

#: Exponents as Fortran writes them, and those that Nastran writes without a letter.
_LETTER = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
_NO_LETTER = re.compile(r"(?<=[\d.])(?=[+-]\d)")


def floats(words: list[str], what: str) -> Array:
    """Words as numbers; ``what`` is said of where they stand."""
    return _read(words, what, np.float64)


def whole(words: list[str], what: str) -> IntArray:
    """Words as whole numbers."""
    return _read(words, what, np.int64)


def _read(words: list[str], what: str, kind: type[np.float64 | np.int64]) -> AnyArray:
    try:
        return np.array(words, dtype=kind) if kind is np.int64 else np.array(words, dtype="U").astype(np.float64)
    except (ValueError, OverflowError):
        pass
    if kind is np.float64:
        words = _NO_LETTER.sub("E", _LETTER.sub("E", "\n".join(words))).split("\n")
    for word in words:
        try:
            np.float64(word) if kind is np.float64 else np.int64(word)
        except (ValueError, OverflowError):
            of = "a number" if kind is np.float64 else "a whole number"
            raise ProblemError(
                f"'{shown(word[:30])}' is not {of} ({what}); correct it or save the file again"
            ) from None
    return np.array(words, dtype="U").astype(kind)


def rows_of(values: AnyArray, columns: int, what: str) -> AnyArray:
    """Numbers in rows of so many columns."""
    if columns < 1 or len(values) % columns:
        raise ProblemError(
            f"{what}: {len(values)} numbers are not rows of {columns}; the file is cut off or damaged: save it again"
        )
    return values.reshape(-1, columns)
