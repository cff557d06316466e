"""The one reader and writer of files: regular files of bounded size come in, whole files or none go out."""

from __future__ import annotations

import contextlib
import os
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from hemivar.errors import FileError

__all__ = ["MOST_BYTES", "open_new", "read_bytes", "read_text", "regular_file", "same_file", "whole_file", "write_text"]

#: Bytes of a text file (problem, law table, result) that are read unless the caller says otherwise.
MOST_BYTES = 256 * 2**20


def regular_file(path: str | Path, what: str = "file", most_bytes: int = MOST_BYTES) -> Path:
    """The path, if it names a regular file that can be read and is not larger than ``most_bytes``.

    Pipes, devices and directories are refused before they are opened, for reading them may hang or never end.

    Raises
    ------
    FileError
        In one sentence that names the file.
    """
    name = Path(path)
    try:
        found = name.stat()
    except (OSError, ValueError) as error:  # a NUL in the name is a ValueError
        raise FileError(f"cannot read {what} {_shown(path)}: {_reason(error)}") from error
    if not stat.S_ISREG(found.st_mode):
        kind = "a directory" if stat.S_ISDIR(found.st_mode) else "not a regular file (a pipe or a device)"
        raise FileError(f"cannot read {what} {_shown(path)}: it is {kind}; give the name of a regular file")
    if found.st_size > most_bytes:
        raise FileError(
            f"{what} {_shown(path)} has {found.st_size / 2**20:.0f} MiB; at most {most_bytes / 2**20:.0f} MiB are read"
        )
    return name


def read_bytes(path: str | Path, what: str = "file", most_bytes: int = MOST_BYTES) -> bytes:
    """All bytes of a regular file.  Raises as :func:`regular_file` does."""
    name = regular_file(path, what, most_bytes)
    try:
        # opened without blocking, and looked at again: the name may have changed hands since
        descriptor = os.open(name, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(descriptor, "rb") as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise FileError(f"cannot read {what} {_shown(path)}: it is not a regular file")
            data = stream.read(most_bytes + 1)
    except OSError as error:
        raise FileError(f"cannot read {what} {_shown(path)}: {_reason(error)}") from error
    if len(data) > most_bytes:
        raise FileError(f"{what} {_shown(path)} grew beyond {most_bytes / 2**20:.0f} MiB while it was read")
    return data


def read_text(path: str | Path, what: str = "file", most_bytes: int = MOST_BYTES) -> str:
    """The text (UTF-8, with or without a byte order mark) of a regular file.  Raises as :func:`regular_file` does."""
    try:
        text = read_bytes(path, what, most_bytes).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(f"{what} {_shown(path)} is not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary name beside ``path``, renamed to it when the block ends well and removed when it does not.

    Whoever writes by name (a plotting or mesh library) writes to the name it is given, which ends like ``path``.  The
    old content of ``path`` stays whole until the new one has reached the disk: through full disks, interrupts, a killed
    process, and two writers, of whom the last one wins.  Links are followed, permissions kept.  What is no regular file
    (a pipe, ``/dev/stdout``) is written to directly, for it cannot be replaced.

    Raises
    ------
    FileError
        In one sentence that names the file, for every :class:`OSError` of the block.
    """
    try:
        target = Path(os.path.realpath(path))
        mode: int | None = None
        with contextlib.suppress(FileNotFoundError):
            mode = target.stat().st_mode
        if mode is not None and stat.S_ISDIR(mode):
            raise FileError(f"cannot write {_shown(path)}: it is a directory")
        if mode is not None and not stat.S_ISREG(mode):
            yield Path(path)
            return
        descriptor, name = tempfile.mkstemp(prefix=f".{target.stem[:80]}-", suffix=target.suffix, dir=target.parent)
        os.close(descriptor)
    except (OSError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"cannot write {_shown(path)}: {_reason(error)}") from error
    temporary = Path(name)
    try:
        yield temporary
        os.chmod(temporary, _default_mode() if mode is None else stat.S_IMODE(mode))
        _flush(temporary)
        os.replace(temporary, target)
        _flush_directory(target.parent)
    except OSError as error:
        raise FileError(f"cannot write {_shown(path)}: {_reason(error)}") from error
    finally:
        with contextlib.suppress(OSError):
            temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write a text file (UTF-8), whole or not at all.  Raises as :func:`whole_file` does."""
    with whole_file(path) as name, open_new(name) as stream:
        stream.write(text)


def open_new(name: Path) -> IO[str]:
    """A name from :func:`whole_file`, opened for text: UTF-8, line ends as written."""
    return name.open("w", encoding="utf-8", newline="")


def same_file(one: str | Path, other: str | Path) -> bool:
    """Whether two names lead to one file, by links too; names of files that do not exist are compared as names."""
    try:
        return os.path.samefile(one, other)
    except (OSError, ValueError):
        try:
            return os.path.realpath(one) == os.path.realpath(other)
        except (OSError, ValueError):
            return str(one) == str(other)


def _default_mode() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return 0o666 & ~mask


def _flush(path: Path) -> None:
    with path.open("rb+") as stream:
        os.fsync(stream.fileno())


def _flush_directory(path: Path) -> None:
    """Make the new name itself durable, where the system lets a directory be opened."""
    with contextlib.suppress(OSError):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


def _shown(path: str | Path) -> str:
    """A name as it may stand in a message: control characters escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(path))


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower() if error.strerror != error.strerror.upper() else error.strerror
    return str(error) or type(error).__name__
