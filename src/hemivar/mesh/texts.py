"""Numbers in the texts of mesh files."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hemivar.basics.disk import read_bytes, regular_file, same_file, shown
from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.errors import ProblemError

__all__ = ["Included", "floats", "rows_of", "whole"]

#: Exponents as Fortran writes them, and those that Nastran writes without a letter.
_LETTER = re.compile(r"(?<=[\d.])[dD](?=[+-]?\d)")
_NO_LETTER = re.compile(r"(?<=[\d.])(?=[+-]\d)")


#: Included files may include others so deep, and there may be so many.
_DEPTH, _MOST_INCLUDED = 50, 1000


@dataclass(frozen=True)
class Included:
    """The text of a mesh file, and of files that it includes; their names count from its folder, or from the first."""

    path: Path
    text: str
    outer: tuple[Path, ...] = ()  # the files that include one another up to this one
    count: list[int] = field(default_factory=lambda: [0])  # how many files were included

    def whole(self, include: re.Pattern[str], end: str = "(?!)") -> str:
        """The text up to an end, with the files in it that lines of a pattern include, by one of its groups."""

        def put(match: re.Match[str]) -> str:
            name = next(group for group in match.groups() if group is not None)
            return self.opened(re.sub(r"\s*\n\s*", "", name)).whole(include, end)

        return include.sub(put, re.split(end, self.text.replace("\r\n", "\n"), maxsplit=1)[0])

    def opened(self, name: str) -> Included:
        """A file that this one names."""
        self.count[0] += 1
        chain = (*self.outer, self.path)
        given = name.strip().strip("\"'").replace("\\", "/")
        places = [one.parent / given for one in (self.path, chain[0])]
        path = next((one for one in places if os.path.isfile(one)), places[0])
        if any(same_file(path, one) for one in chain):
            raise ProblemError(
                f"'{shown(self.path.name)}' includes '{shown(name)}', which includes it; remove the circle"
            )
        if len(chain) > _DEPTH or self.count[0] > _MOST_INCLUDED:
            what = f"more than {_DEPTH} deep" if len(chain) > _DEPTH else f"more than {_MOST_INCLUDED} times"
            raise ProblemError(f"files include one another {what}, at '{shown(name)}'; write them as one file")
        if not given or not os.path.exists(path):
            raise ProblemError(
                f"'{shown(self.path.name)}' includes '{shown(given)}', which is not there; put that file beside it"
            )
        text = read_bytes(regular_file(path, "included file", 2**62), "included file", max(path.stat().st_size, 1))
        return Included(path, text.decode("utf-8-sig", "replace"), chain, self.count)


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
