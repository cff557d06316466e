"""Checkpoint of long work as a log: a line of JSON for each part, appended when it is done, to continue from."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from hemivar.basics import disk
from hemivar.errors import FileError

__all__ = ["ResumeLog"]

#: What a line begins with: the check of the rest of it.
_CHECK = '{"check": "'


class _Part(Protocol):
    def line(self) -> str: ...


Part = TypeVar("Part", bound=_Part)


class ResumeLog(Generic[Part]):
    """A file that holds the parts of one work that are done, bound to that work by a digest.

    A process that is killed leaves whole lines, and perhaps the beginning of one, which is left out.  Every line has a
    check, the beginning of its digest, so that none that was damaged since is taken for what was computed.  The check
    does not protect against forgery.
    """

    def __init__(
        self,
        path: str | Path,
        kind: str,
        part: str,
        digest: str,
        read: Callable[[str], Part],
        more: Mapping[str, object] | None = None,
        most_bytes: int = disk.MOST_BYTES,
        wanted: bool = True,
    ) -> None:
        self.path = disk.path_of(path)
        self.unkept = ""
        self._wanted = wanted
        self._kind = kind
        self._parts: list[Part] = []
        head = json.dumps({f"hemivar-{kind}": 3, "digest": digest, **(more or {})})
        if not os.path.lexists(self.path):
            self._write(lambda: disk.write_text(self.path, head + "\n"))
            return
        text = disk.read_text(self.path, f"record of a {kind}", most_bytes)
        whole = text[: text.rfind("\n") + 1]
        first, *lines = whole.splitlines() or [""]
        if first != head:
            self._refuse(first)
        for number, line in enumerate(lines, start=2):
            try:
                self._parts.append(read(_checked(line)))
            except (
                ValueError,
                KeyError,
                TypeError,
                AttributeError,
                IndexError,
                OverflowError,
                RecursionError,
            ) as error:
                raise FileError(
                    f"{disk.shown(path)}, line {number}: this is not a {part} of a {kind}, or it was changed since; "
                    "remove the line, or the file"
                ) from error
        if whole != text:  # the process ended while it wrote the last line
            self._write(lambda: disk.write_text(self.path, whole))

    def _refuse(self, first: str) -> None:
        try:
            ours = f"hemivar-{self._kind}" in json.loads(first)
        except (ValueError, TypeError, RecursionError):
            ours = False
        what = f"holds another {self._kind}, or the problem has changed since"
        what = what if ours else f"is not a record of a {self._kind}"
        raise FileError(f"{disk.shown(self.path)}: the file {what}; name another file, or remove it")

    def __iter__(self) -> Iterator[Part]:
        """The parts that were there already, and those that were added."""
        return iter(tuple(self._parts))

    def add(self, part: Part) -> None:
        """Keep a part: on return its line has reached the disk, or :attr:`unkept` says why no more are kept."""
        line = part.line()
        if not self.unkept:
            self._write(lambda: disk.append_line(self.path, f'{_CHECK}{_check(line)}", {line[1:]}'))
        self._parts.append(part)

    def _write(self, task: Callable[[], None]) -> None:
        try:
            task()
        except FileError as error:
            if self._wanted:
                raise
            self.unkept = str(error)


def _check(line: str) -> str:
    return hashlib.sha256(line.encode()).hexdigest()[:16]


def _checked(line: str) -> str:
    """A line without its check; ValueError if it is not the line of which that is one."""
    check, _, rest = line.removeprefix(_CHECK).partition('", ')
    if not line.startswith(_CHECK) or _check("{" + rest) != check:
        raise ValueError("the check of the line is not its own")
    return "{" + rest
