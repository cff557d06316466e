"""Files that a command writes: tried before the work, kept off everything it read, written one by one in the end."""

from __future__ import annotations

import contextlib
import json
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeAlias

from hemivar.basics.disk import protecting, same_file, shown, try_output, write_text
from hemivar.cli.options import Exit
from hemivar.cli.terminal import hold_signals, quiet_logging
from hemivar.errors import FileError, HemivarError, ProblemError

__all__ = [
    "Content",
    "Files",
    "Writer",
    "check_distinct",
    "check_folder",
    "check_outputs",
    "files_of",
    "internal_error",
    "keep_off",
    "one_line",
]

#: Characters of a message that are shown: a name of thousands of them would hide what is wrong.
_LONGEST = 1000
_FIGURES = (".png", ".svg", ".pdf")

_SUFFIXES = {
    "--json": (".json",),
    "--arrays": (".npz",),
    "--csv": (".csv",),
    "--latex": (".tex",),
    "--report": (".html",),
    "--fields": (".pvd",),
    "--table": (".csv", ".parquet"),
    "--animation": (".gif", ".mp4"),
    "--output": (".gif", ".mp4"),
    "--vtu": (".vtu",),
    "--plot": _FIGURES,
    "--plot-contact": _FIGURES,
    "--plot-error": _FIGURES,
    "--plot-meshes": _FIGURES,
}
#: What goes into a file: a record, a function that writes it, or one that draws the figure.
Content: TypeAlias = Mapping[str, object] | Callable[..., object]
#: What is written, by option, and a figure beside that of the option by its path.
Files: TypeAlias = dict[str | Path, Content]
#: The files that a process writes in place of one, by option and name.
Pieces: TypeAlias = Callable[[str, Path], list[Path]]


# ---- before the work -------------------------------------------------------------------------------------------


def check_outputs(outputs: Mapping[str, Path | None], source: Path | None = None, pieces: Pieces | None = None) -> None:
    """Refuse output files that could not be written, or that would overwrite one another or ``source``.

    Files that come along with one (``X_contact.vtu``) are tried too.
    """
    for option, path in outputs.items():
        suffixes = _SUFFIXES.get(option)
        if path is not None and suffixes and path.suffix.lower() not in suffixes:
            raise ProblemError(f"{option} {path}: the name must end in {' or '.join(suffixes)}")
    files = files_of(outputs)
    for option, own in files.items():
        for file in own:
            _check_file(file, option)
    for option, named in outputs.items():
        for piece in () if named is None or pieces is None else pieces(option, named):
            _try(piece, option, "file")
    check_distinct(files_of(outputs, pieces), source)


def files_of(outputs: Mapping[str, Path | None], pieces: Pieces | None = None) -> dict[str, list[Path]]:
    """The files that each option writes: with ``--vtu`` and PVD, those of the contact boundaries too, and the pieces
    that some process writes of them."""
    files = {option: [] if path is None else [path] for option, path in outputs.items()}
    for option, suffix in (("--vtu", ".vtu"), ("--fields", ".pvd")):
        for path in tuple(files.get(option, ())):
            if option == "--vtu" or path.suffix.lower() == suffix:
                files[option].append(path.with_name(f"{path.stem}_contact{suffix}"))
    for option, named in outputs.items():
        files[option] += [] if named is None or pieces is None else pieces(option, named)
    return files


def check_distinct(files: Mapping[str, Iterable[Path]], source: Path | None = None) -> None:
    """Refuse files that two options would write, by whatever name, and the problem file ``source``."""
    taken: list[tuple[Path, str]] = [] if source is None else [(source, "the problem file")]
    for option, own in files.items():
        for file in own:
            for other, what in taken:
                if same_file(file, other):
                    raise ProblemError(f"{option} {file}: this is {what} already; name another file")
            taken.append((file, option))


def keep_off(files: Mapping[str, Iterable[Path]], inputs: Iterable[Path]) -> None:
    """Refuse files that would overwrite one that was read, by whatever name."""
    inputs = list(inputs)
    for option, own in files.items():
        for file in own:
            for read in inputs:
                if same_file(file, read):
                    raise ProblemError(f"{option} {file}: {read} was read for this problem; name another file")


def check_folder(path: Path, names: Iterable[str]) -> None:
    """Refuse an output folder that is a file or could not be made, or where one of the files could not be written."""
    if not os.path.exists(path):  # which takes any name, unlike Path.exists
        _check_parent(path, f"--output {path}")
        _try(path, "--output", "folder")
        return
    if not os.path.isdir(path):
        raise ProblemError(f"--output {path}: this is a file; name a folder")
    if Path.cwd().is_relative_to(os.path.realpath(path)) and not same_file(path, Path.cwd()):
        raise ProblemError(f"--output {path}: it holds the current folder; name one of its own, such as --output out")
    if not os.access(path, os.W_OK | os.X_OK):
        raise ProblemError(f"--output {path}: the folder is write-protected; name another one")
    for name in names:
        _try(path / name, "--output", "folder")


def _check_file(path: Path, option: str) -> None:
    what = f"{option} {path}"
    if os.path.isdir(path):
        raise ProblemError(f"{what}: this is a folder; name a file")
    _check_parent(path, what)
    if os.path.exists(path) and not os.access(path, os.W_OK):
        raise ProblemError(f"{what}: the file is write-protected; name another one")
    _try(path, option, "file")


def _try(path: Path, option: str, what: str) -> None:
    try:
        try_output(path)
    except FileError as error:
        raise ProblemError(f"{option}: {error}; name another {what}") from error


def _check_parent(path: Path, what: str) -> None:
    parent = path.parent
    if not os.path.exists(parent):
        raise ProblemError(f"{what}: the folder '{parent}' does not exist; make it first")
    if not os.path.isdir(parent):
        raise ProblemError(f"{what}: '{parent}' is not a folder; name another place")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise ProblemError(f"{what}: the folder '{parent}' is write-protected; name another one")


# ---- after it --------------------------------------------------------------------------------------------------


class Writer:
    """Writes files one after the other; one that fails does not stop the others.

    What many processes write ``together`` fails on all of them, or ends them.  After Ctrl-C the file in work and all
    further pictures are left out; data are still written, and SIGTERM and SIGHUP do not disturb them.
    """

    def __init__(
        self, inputs: Iterable[Path] = (), units: Mapping[str, str] | None = None, together: Sequence[str] = ()
    ) -> None:
        self.inputs, self.together = list(inputs), together
        self.units = {} if units is None else dict(units)
        self.written: list[Path] = []
        self.failed: list[str] = []
        self.interrupted = False
        self._complained = 0

    def write(self, option: str, path: Path | None, task: Callable[[Path], object], *, picture: bool = False) -> None:
        """Let ``task`` write ``path``, if there is one; it may return the files it wrote, in a list or a tuple."""
        if path is None or (picture and self.interrupted):
            return
        try:
            keep_off({} if option in self.together else files_of({option: path}), self.inputs)
        except ProblemError as error:
            self.failed.append(str(error))
            return
        try:
            with contextlib.nullcontext() if picture else hold_signals(), quiet_logging(), protecting(self.inputs):
                made = task(path)
        except KeyboardInterrupt:
            if self.interrupted:
                raise
            self.interrupted = True
        except Exception as error:
            if option in self.together and not getattr(error, "shared", False):
                raise
            self.failed.append(f"{option}{'' if isinstance(error, FileError) else f' {path}'}: {_why(error, picture)}")
        else:
            several = made if isinstance(made, list | tuple) else [path]
            self.written += [file for file in several if file is not None]

    def write_record(self, path: Path | None, record: Mapping[str, object]) -> None:
        """Write a record of plain numbers, texts and lists as JSON (``--json``), with the units that were stated."""
        record = {**record, "units": self.units} if self.units else record
        self.write("--json", path, lambda path: write_text(path, json.dumps(record, indent=1, allow_nan=False) + "\n"))

    def take(self, option: str, path: Path | None, task: Content) -> None:
        """Write what a command has for an option: a record, what ``task`` writes, or the figure that it draws."""
        if isinstance(task, Mapping):
            self.write_record(path, task)
        elif option.startswith("--plot"):
            self.write(option, path, lambda path: _save(task, path), picture=True)
        else:
            self.write(option, path, task, picture=option in ("--animation", "--output"))

    def print_names(self) -> None:
        """Print the names of the files that were written."""
        if self.written:
            print(f"written           {', '.join(map(shown, self.written))}", flush=True)

    def ended(self, code: int) -> int:
        """The exit code after the files were written: complaints about them come last, and stand before success."""
        if self.complain() and code != Exit.INTERRUPTED:
            return Exit.BAD_INPUT
        return Exit.INTERRUPTED if self.interrupted else code

    def complain(self) -> bool:
        """One line on standard error, once, for each file that could not be written; whether there was one."""
        sys.stdout.flush()
        while self._complained < len(self.failed):
            sys.stderr.write(f"hemivar: error: {one_line(self.failed[self._complained])}\n")
            self._complained += 1
        return bool(self.failed)


def _why(error: Exception, picture: bool) -> str:
    """Why a file could not be written."""
    if isinstance(error, HemivarError):
        return str(error)
    if isinstance(error, MemoryError):
        return "not enough memory to write it"
    if picture and isinstance(error, UnicodeDecodeError):
        return f"matplotlib cannot read its settings ({error}); correct or remove that matplotlibrc"
    return internal_error(error)


def _save(draw: Callable[..., object], path: Path) -> None:
    from hemivar.report import save

    save(draw(), path)  # type: ignore[arg-type]


def one_line(message: str) -> str:
    """A message on one line, free of control characters, its middle cut out where it is very long."""
    line = " ".join("".join(c if c.isprintable() else " " for c in message).split())
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST // 2]} ... {line[-_LONGEST // 2 :]}"


def internal_error(error: BaseException) -> str:
    """What to say about an error that should not occur; HEMIVAR_TRACEBACK=1 shows where it came from."""
    if os.environ.get("HEMIVAR_TRACEBACK"):
        traceback.print_exception(error)
        return "internal error, see above; please report it"
    reason = " ".join(str(error).split())[:300]
    kind = type(error).__name__
    return f"internal error: {kind}{': ' if reason else ''}{reason}; please report it, HEMIVAR_TRACEBACK=1 shows where"
