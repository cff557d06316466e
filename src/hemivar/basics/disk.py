"""The one reader and writer of files: regular files of bounded size come in, whole files or none go out."""

from __future__ import annotations

import codecs
import contextlib
import os
import re
import secrets
import stat
import sys
import time
from collections.abc import Iterable, Iterator
from contextvars import ContextVar
from pathlib import Path

from hemivar.basics.arguments import described, quoted
from hemivar.errors import FileError

try:
    import fcntl
except ImportError:  # no such locks: what killed processes left stays
    fcntl = None  # type: ignore[assignment]

__all__ = [
    "MOST_BYTES",
    "append_line",
    "first_bytes",
    "make_folder",
    "noting_files_read",
    "path_of",
    "protecting",
    "read_bytes",
    "read_text",
    "regular_file",
    "remove_file",
    "same_file",
    "shown",
    "try_output",
    "whole_file",
    "write_text",
]

#: Bytes of a text file (problem, law table, result) that are read unless the caller says otherwise.
MOST_BYTES = 256 * 2**20
#: Bytes that are read at a time, to see between them whether a file is longer than it may be.
_PORTION = 16 * 2**20
#: Seconds for which a temporary file is left alone, though nobody has locked it: its maker is about to.
_YOUNG = 60.0

_noted: ContextVar[list[Path] | None] = ContextVar("files read", default=None)


@contextlib.contextmanager
def noting_files_read() -> Iterator[list[Path]]:
    """The files that are read inside the block, in a list that grows; what is written must not fall on them."""
    files: list[Path] = []
    token = _noted.set(files)
    try:
        yield files
    finally:
        _noted.reset(token)


_protected: ContextVar[tuple[Path, ...]] = ContextVar("files that are not written", default=())


@contextlib.contextmanager
def protecting(files: Iterable[str | Path]) -> Iterator[None]:
    """Within this block nothing here writes or removes these files, by whatever name or link it is asked to."""
    token = _protected.set((*_protected.get(), *map(Path, files)))
    try:
        yield
    finally:
        _protected.reset(token)


def _guard(path: str | Path, verb: str) -> None:
    """Refuse what would change a protected file."""
    for file in _protected.get():
        if same_file(path, file):
            raise FileError(f"cannot {verb} {shown(path)}: {shown(file)} was read for this problem; name another file")


def remove_file(path: str | Path) -> None:
    """Remove a file, or a link to one, if it is there."""
    _guard(path, "remove")
    try:
        Path(path).unlink(missing_ok=True)
    except OSError as error:
        raise FileError(f"cannot remove {shown(path)}: {_reason(error)}") from error


def path_of(name: object) -> Path:
    """The path that a name of a file is."""
    try:
        if str(name).strip():
            return Path(name)  # type: ignore[arg-type]
        raise FileError(f"the name of a file is {quoted(name)}; give its path")
    except TypeError:
        raise FileError(f"the name of a file is {described(name)}; give its path as a text or a Path") from None


def regular_file(path: str | Path, what: str = "file", most_bytes: int = MOST_BYTES) -> Path:
    """The path, if it names a regular file that can be read and is not larger than ``most_bytes``.

    Pipes, devices and directories are refused before they are opened, for reading them may hang or never end.
    """
    name = path_of(path)
    try:
        status = name.stat()
    except (OSError, ValueError) as error:  # a NUL in the name is a ValueError
        raise FileError(f"cannot read {what} {shown(path)}: {_reason(error)}") from error
    if not stat.S_ISREG(status.st_mode):
        kind = "a directory" if stat.S_ISDIR(status.st_mode) else "not a regular file (a pipe or a device)"
        raise FileError(f"cannot read {what} {shown(path)}: it is {kind}; give the name of a regular file")
    if status.st_size > most_bytes:
        raise FileError(
            f"{what} {shown(path)} has {status.st_size / 2**20:.0f} MiB; "
            f"at most {most_bytes / 2**20:.0f} MiB are read: give a shorter file"
        )
    noted = _noted.get()
    if noted is not None:
        noted.append(name)
    return name


def read_bytes(path: str | Path, what: str = "file", most_bytes: int = MOST_BYTES) -> bytes:
    """All bytes of a regular file.  Raises as :func:`regular_file` does."""
    name = regular_file(path, what, most_bytes)
    try:
        # opened without blocking, and looked at again: the name may have changed hands since
        descriptor = os.open(name, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
        with os.fdopen(descriptor, "rb") as stream:
            if not stat.S_ISREG(os.fstat(stream.fileno()).st_mode):
                raise FileError(f"cannot read {what} {shown(path)}: it is not a regular file; name another")
            parts, left = [], most_bytes + 1  # in portions, for a buffer of the limit may not fit where the file does
            while left > 0 and (part := stream.read(min(left, _PORTION))):
                parts.append(part)
                left -= len(part)
    except OSError as error:
        raise FileError(f"cannot read {what} {shown(path)}: {_reason(error)}") from error
    if left <= 0:
        raise FileError(
            f"{what} {shown(path)} grew beyond {most_bytes / 2**20:.0f} MiB while it was read; wait until it is "
            f"complete"
        )
    return parts[0] if len(parts) == 1 else b"".join(parts)


def first_bytes(path: str | Path, count: int, what: str = "file") -> bytes:
    """The first bytes of a regular file, however large it is.  Raises as :func:`regular_file` does."""
    name = regular_file(path, what, 1 << 62)
    try:
        with name.open("rb") as stream:
            return stream.read(count)
    except OSError as error:
        raise FileError(f"cannot read {what} {shown(path)}: {_reason(error)}") from error


def read_text(path: str | Path, what: str = "file", most_bytes: int = MOST_BYTES) -> str:
    """The text (UTF-8, with or without a byte order mark) of a regular file.  Raises as :func:`regular_file` does."""
    try:
        content = read_bytes(path, what, most_bytes)
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            raise FileError(f"{what} {shown(path)} is UTF-16 text; save it as UTF-8") from error
        raise FileError(f"{what} {shown(path)} is not UTF-8 text (byte {error.start}); save it as UTF-8") from error
    return text.replace("\r\n", "\n").replace("\r", "\n")


@contextlib.contextmanager
def whole_file(path: str | Path) -> Iterator[Path]:
    """A temporary name beside ``path``, renamed to it when the block ends well and removed when it does not.

    Whoever writes by name (a plotting or mesh library) writes to the name it is given, which ends like ``path``.  The
    old content of ``path`` stays whole until the new one has reached the disk: through full disks, interrupts, a killed
    process, and two writers, of whom the last one wins.  Links are followed, permissions kept.  What is no regular file
    (a pipe, ``/dev/stdout``) is written to directly, for it cannot be replaced.  What a killed process has left of the
    same file under a temporary name is removed.
    """
    temporary: Path | None = None
    lock: int | None = None
    around = sys.exc_info()[1]
    try:
        target, mode = _target(path)
        if mode is not None and not stat.S_ISREG(mode):
            yield Path(path)
            return
        _remove_leftovers(target)
        temporary = _beside(target)
        lock = _make(temporary)
        yield temporary
        if mode is not None:
            os.chmod(temporary, stat.S_IMODE(mode))
        _flush(temporary)
        os.replace(temporary, target)
        _flush_directory(target.parent)
    except FileError:
        raise
    except Exception as error:
        cause: Exception | None = _disk_error(error, around)
        if cause is None and temporary is None and isinstance(error, ValueError):
            cause = error  # a NUL in the name
        if cause is None:
            raise
        raise FileError(f"cannot write {shown(path)}: {_reason(cause)}") from error
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
        if lock is not None:
            os.close(lock)


def try_output(path: str | Path) -> None:
    """Find out whether a file could be written, by all that :func:`whole_file` does but the last step; leaves nothing.

    Pipes are refused, for opening one waits for its reader.
    """
    temporary: Path | None = None
    lock: int | None = None
    try:
        target, mode = _target(path)
        if mode is not None and not stat.S_ISREG(mode):
            if not (stat.S_ISCHR(mode) or stat.S_ISBLK(mode)):
                raise FileError(f"cannot write {shown(path)}: it is a pipe; name a regular file")
            return
        temporary = _beside(target)
        lock = _make(temporary)
    except FileError:
        raise
    except (OSError, ValueError) as error:
        raise FileError(f"cannot write {shown(path)}: {_reason(error)}") from error
    finally:
        if temporary is not None:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
        if lock is not None:
            os.close(lock)


def _target(path: str | Path) -> tuple[Path, int | None]:
    """What a name leads to, and its mode (None if there is no such file yet); a name that cannot be written is refused.

    A protected file is refused though its folder would let it be replaced.
    """
    _guard(path, "write")
    target = Path(os.path.realpath(path_of(path)))
    try:
        mode = target.stat().st_mode
    except FileNotFoundError:
        return target, None
    if stat.S_ISDIR(mode):
        raise FileError(f"cannot write {shown(path)}: it is a directory; name a file in it")
    if not os.access(target, os.W_OK):
        raise FileError(f"cannot write {shown(path)}: it is write-protected; name another file")
    return target, mode


def _beside(target: Path) -> Path:
    """A name for the time of writing, hidden, in the folder of the target and ending like it."""
    return target.with_name(f".{target.stem[:40]}-{secrets.token_hex(6)}{target.suffix}")


def _make(temporary: Path) -> int | None:
    """An empty new file, with the permissions that new files have here; the descriptor that keeps it locked, if any."""
    descriptor = os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)
    if _locks(descriptor):
        return descriptor
    os.close(descriptor)
    return None


def _locks(descriptor: int) -> bool:
    """Whether a file is now locked by this process: no other one that lives is writing it."""
    if fcntl is None:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        return False
    return True


def _remove_leftovers(target: Path) -> None:
    """Remove temporary files of a target that processes left which were killed: old ones that nobody has locked."""
    name = re.compile(rf"\.{re.escape(target.stem[:40])}-[0-9a-f]{{12}}{re.escape(target.suffix)}")
    with contextlib.suppress(OSError, FileError):
        for leftover in filter(name.fullmatch, os.listdir(target.parent)):
            left = target.parent / leftover
            status = left.lstat()
            if not stat.S_ISREG(status.st_mode) or time.time() - status.st_mtime < _YOUNG:
                continue
            descriptor = os.open(left, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOFOLLOW", 0))
            try:
                if _locks(descriptor):
                    remove_file(left)
            finally:
                os.close(descriptor)


def make_folder(path: str | Path) -> Path:
    """The folder, made with all above it if it does not exist."""
    folder = path_of(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise FileError(f"folder {shown(path)} cannot be made: {_reason(error)}; choose another") from error
    return folder


def write_text(path: str | Path, text: str) -> None:
    """Write a text file (UTF-8), whole or not at all.  Raises as :func:`whole_file` does."""
    with whole_file(path) as name, name.open("w", encoding="utf-8", newline="") as stream:
        stream.write(text)


def append_line(path: str | Path, line: str) -> None:
    """Put a line at the end of a text file that is there, in one write that has reached the disk on return.

    A process that is killed leaves whole lines and perhaps the beginning of one, without its end of line.
    """
    _guard(path, "write")
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | getattr(os, "O_BINARY", 0))
        with os.fdopen(descriptor, "wb", buffering=0) as stream:
            text = f"{line}\n".encode()
            if stream.write(text) != len(text):
                raise FileError(
                    f"cannot write {shown(path)}: the disk is full; free some space, then continue from what was saved"
                )
            os.fsync(stream.fileno())
    except (OSError, ValueError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"cannot write {shown(path)}: {_reason(error)}") from error


def same_file(one: str | Path, other: str | Path) -> bool:
    """Whether two names lead to one file, by links too; names of files that do not exist are compared as names."""
    try:
        return os.path.samefile(one, other)
    except (OSError, ValueError):
        try:
            return os.path.realpath(one) == os.path.realpath(other)
        except (OSError, ValueError):
            return str(one) == str(other)


def _disk_error(error: BaseException, around: BaseException | None) -> OSError | None:
    """The error of the system that an error is, or came after; ``around`` was there before and is none of them."""
    cause: BaseException | None = error
    while cause is not None and cause is not around:
        if isinstance(cause, OSError):
            return cause
        cause = cause.__context__
    return None


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


def shown(name: object) -> str:
    """A name as it may stand in a message or on a terminal: control characters and the like escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(name))


def _reason(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror.lower() if error.strerror != error.strerror.upper() else error.strerror
    return str(error) or type(error).__name__
