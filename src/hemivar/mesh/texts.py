"""Numbers in the texts of mesh files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hemivar.basics.disk import read_bytes, regular_file, shown
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import ProblemError

__all__ = ["Included", "floats", "rows_of", "whole"]

#: Exponents as Fortran writes them, and those that Nastran writes without a letter.
_LETTER = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
_NO_LETTER = re.compile(r"(?<=[\d.])(?=[+-]\d)")


#: Included files may include others so deep, and there may be so many.
_DEPTH, _MOST_INCLUDED = 8, 1000


class Included:
    """The texts of files that the text of a mesh includes; their names count from its folder."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._count = folder, 0

    def text(self, name: str, depth: int) -> str:
        """The text of a file that one included so deep names."""
        self._count += 1
        if depth >= _DEPTH or self._count > _MOST_INCLUDED:
            what = f"more than {_DEPTH} deep" if depth >= _DEPTH else f"more than {_MOST_INCLUDED} times"
            raise ProblemError(f"files include one another {what}, at '{shown(name)}'; remove the circle")
        path = regular_file(self._folder / name.replace("\\", "/"), "included file", 2**62)
        return read_bytes(path, "included file", max(path.stat().st_size, 1)).decode("utf-8", "replace")


def floats(words: list[str], what: str) -> Array:
    """Words as numbers; ``what`` is said of where they stand."""
    return _read(words, what, np.float64)


def whole(words: list[str], what: str) -> IntArray:
    """Words as whole numbers."""
    return _read(words, what, np.int64)


def _read(words: list[str], what: str, kind: type[np.float64 | np.int64]) -> AnyArray:
    together = "".join(words)
    try:
        if "_" in together or not together.isascii():  # Python alone would take 1_5 for 15
            raise ValueError
        return np.array(words, dtype=kind) if kind is np.int64 else np.array(words, dtype="U").astype(np.float64)
    except (ValueError, OverflowError):
        pass
    if kind is np.float64:
        words = _NO_LETTER.sub("E", _LETTER.sub("E", "\n".join(words))).split("\n")
    for word in words:
        try:
            if "_" in word or not word.isascii():
                raise ValueError
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
