"""What one hostile case is: files, a command line, and the conditions under which it runs."""

from __future__ import annotations

import json
import os
import shlex
import stat
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["CANARY", "Case", "lay_out", "leave_command"]

#: Every attempt at running code makes this file; it must never exist.
CANARY = "CANARY"


@dataclass(frozen=True)
class Case:
    """One run of the command.

    Attributes
    ----------
    name : str
        ``seed:number``; it makes the case again.
    family : str
        Which generator made it.
    note : str
        What is hostile about it.
    arguments : sequence of str
        Of the command ``hemivar``.
    files : mapping of name to bytes
        Regular files of its folder.
    special : mapping of name to text
        Other things in the folder: ``fifo``, ``folder``, ``socket``, ``unreadable``, ``read-only``,
        ``sparse N`` (bytes),
        ``link TARGET``.
    environment : mapping
        Added to the environment.
    streams : str
        Where standard output goes: ``file``, ``closed``, ``full`` (/dev/full) or ``gone`` (a pipe nobody reads).
    fresh : bool
        In a new interpreter rather than in a copy of one that has imported the library.
    file_size : int or None
        Limit of the size of files that are written.
    problem : str or None
        The problem file, where the answer can be examined.
    answer : str or None
        The JSON file with the answer.
    rewritten : sequence of str
        Files that the command may change.
    """

    name: str
    family: str
    note: str
    arguments: Sequence[str]
    files: Mapping[str, bytes] = field(default_factory=dict)
    special: Mapping[str, str] = field(default_factory=dict)
    environment: Mapping[str, str] = field(default_factory=dict)
    streams: str = "file"
    fresh: bool = False
    file_size: int | None = None
    problem: str | None = None
    answer: str | None = None
    rewritten: Sequence[str] = ()

    @property
    def command(self) -> str:
        """The subcommand."""
        return next((a for a in self.arguments if not a.startswith("-")), "")


def lay_out(case: Case, folder: Path) -> None:
    """Make the files of a case."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in case.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    for name, what in case.special.items():
        path = folder / name
        kind, _, detail = what.partition(" ")
        if kind == "fifo":
            os.mkfifo(path)
        elif kind == "folder":
            path.mkdir()
        elif kind == "socket":
            os.mknod(path, stat.S_IFSOCK | 0o600)
        elif kind == "unreadable":
            path.touch()
            path.chmod(0)
        elif kind == "read-only":
            path.chmod(0o400)
        elif kind == "sparse":
            with path.open("wb") as file:
                file.truncate(int(detail))
        elif kind == "link":
            path.symlink_to(detail)
        else:
            raise ValueError(f"unknown kind of file: {what}")


def leave_command(case: Case, folder: Path) -> None:
    """Write beside the files of a case how it is repeated."""
    command = shlex.join([sys.executable, "-m", "hemivar", *(a.replace("\0", "\\0") for a in case.arguments)])
    streams = {"closed": " >&-", "full": " > /dev/full", "gone": " | true"}.get(case.streams, "")
    settings = "".join(f"{key}={shlex.quote(value)} " for key, value in case.environment.items())
    limit = "" if case.file_size is None else f"ulimit -f {max(case.file_size // 1024, 1)}; "
    lines = [
        f"# {case.family}: {case.note}".replace("\n", " "),
        f"# from the root of the project: python -m tests.robustness --case {case.name}",
        f"{limit}{settings}{command}{streams}",
    ]
    (folder / "repeat.sh").write_text("\n".join(lines) + "\n", encoding="utf-8", errors="backslashreplace")
    record = {"case": case.name, "family": case.family, "note": case.note, "arguments": list(case.arguments)}
    (folder / "case.json").write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")
