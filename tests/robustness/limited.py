"""One run of the command in a process of its own, with limits of time, memory and size of files."""

from __future__ import annotations

import contextlib
import faulthandler
import os
import resource
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.robustness.case import Case

__all__ = ["LIMITS", "Limits", "Run", "run_case", "run_limited", "warm_up"]


@dataclass(frozen=True)
class Limits:
    """Limits of one run.

    Attributes
    ----------
    processor : int
        Seconds of processor time.
    idle : float
        Seconds after which a process that does not work is taken to wait for ever.
    memory : int
        Bytes of address space beyond what the interpreter takes with the library.
    file_size : int
        Bytes of a file that is written.
    """

    processor: int = 15
    idle: float = 6.0
    memory: int = 1536 << 20
    file_size: int = 256 << 20


LIMITS = Limits()


@dataclass(frozen=True)
class Run:
    """How a run ended.

    Attributes
    ----------
    code : int or None
        Exit code; None if a signal ended it.
    signal : int or None
    hung : bool
        Ended by a limit of time.
    stdout, stderr : bytes
    seconds : float
        Of processor time.
    peak : int
        Bytes of memory that were in use at once, beside those of this process that a copy of it has.
    stack : str
        Where a run that hung was at the end.
    """

    code: int | None
    signal: int | None
    hung: bool
    stdout: bytes
    stderr: bytes
    seconds: float
    peak: int
    stack: str


def warm_up() -> None:
    """Import what the command imports, so that copies of this process start at once."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot
    import meshio
    import skfem

    import hemivar.branches
    import hemivar.certificates
    import hemivar.cli
    import hemivar.evolution
    import hemivar.files.problem_file
    import hemivar.report
    import hemivar.solvers
    import hemivar.workflows

    _ = (matplotlib.pyplot, meshio, skfem, hemivar.solvers)


def run_case(case: Case, folder: Path, limits: Limits = LIMITS) -> Run:
    """Run a case in its folder."""

    def command() -> int:
        from hemivar.cli import main

        sys.argv = ["hemivar", *case.arguments]
        return main()

    words = [sys.executable, "-m", "hemivar", *case.arguments] if case.fresh else None
    return run_limited(command, folder, limits, words, case.environment, case.streams, case.file_size)


def run_limited(
    command: Callable[[], int],
    folder: Path,
    limits: Limits = LIMITS,
    words: list[str] | None = None,
    environment: dict[str, str] | None = None,
    streams: str = "file",
    file_size: int | None = None,
) -> Run:
    """Call a function, or start a command, in a process of its own."""
    # pipes, for a limit of the size of files would cut off what is printed into files
    told, stack_file = _Pipes(), folder.parent / f"{folder.name}.stack"
    sys.stdout.flush()
    sys.stderr.flush()
    begun = _size(1)
    pid = os.fork()
    if pid == 0:
        code = 1
        try:
            code = _child(command, folder, limits, words, environment or {}, streams, file_size, told, stack_file)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(code)
    told.begin()
    status, usage, hung = _wait(pid, limits, told)
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(pid, signal.SIGKILL)
    ended = os.WTERMSIG(status) if os.WIFSIGNALED(status) else None
    stdout, stderr = told.end()
    stack = stack_file.read_bytes() if stack_file.exists() else b""
    stack_file.unlink(missing_ok=True)
    seconds = usage.ru_utime + usage.ru_stime
    late = ended in (signal.SIGXCPU, signal.SIGKILL) and seconds > limits.processor - 0.5
    return Run(
        code=None if ended is not None else os.WEXITSTATUS(status),
        signal=ended,
        hung=hung or late,
        stdout=stdout,
        stderr=stderr,
        seconds=seconds,
        peak=_own(usage.ru_maxrss << 10, begun, words is not None),
        stack=stack.decode(errors="replace"),
    )


def _own(peak: int, begun: int, fresh: bool) -> int:
    """What a process took itself, of which the system tells the larger of that and of what it began with."""
    if fresh:
        return peak if peak > begun else 0
    return max(peak - begun, 0)


def _child(
    command: Callable[[], int],
    folder: Path,
    limits: Limits,
    words: list[str] | None,
    environment: dict[str, str],
    streams: str,
    file_size: int | None,
    told: _Pipes,
    stack_file: Path,
) -> int:
    faulthandler.disable()
    os.setsid()
    out, err = told.ends
    stack = os.open(stack_file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    null = os.open(os.devnull, os.O_RDONLY)
    os.dup2(null, 0)
    os.dup2(err, 2)
    if streams == "full":
        out = os.open("/dev/full", os.O_WRONLY)
    elif streams == "gone":
        reader, out = os.pipe()
        os.close(reader)
    os.dup2(out, 1)
    if streams == "closed":
        os.close(1)
    os.environ.update({"HEMIVAR_TRACEBACK": "1", **environment})  # an internal error is to show where it was
    os.chdir(folder)
    size = limits.file_size if file_size is None else file_size
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    resource.setrlimit(resource.RLIMIT_CPU, (limits.processor, limits.processor + 2))
    space = (600 << 20 if words else _size(0)) + limits.memory
    resource.setrlimit(resource.RLIMIT_AS, (space, space))
    if words is not None:
        for number in (out, *told.ends, *told.readers, stack, null):
            if number > 2:
                with contextlib.suppress(OSError):
                    os.set_inheritable(number, False)
        try:
            os.execv(words[0], words)
        except ValueError:  # a NUL in an argument: the system would not even start it
            return 2
    faulthandler.enable(file=stack)
    faulthandler.register(signal.SIGXCPU, file=stack)
    faulthandler.register(signal.SIGUSR1, file=stack)
    if streams != "closed":
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(2, "w", encoding="utf-8", errors="backslashreplace", closefd=False)  # noqa: SIM115
    try:
        code = command()
    except SystemExit as stop:
        code = stop.code if isinstance(stop.code, int) else 1
    except BaseException:
        traceback.print_exc()
        code = 1
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    sys.stderr.flush()
    return code


class _Pipes:
    """Standard output and standard error of a process, read while it runs."""

    _MOST = 8 << 20

    def __init__(self) -> None:
        first, second = os.pipe(), os.pipe()
        self.readers, self.ends = (first[0], second[0]), (first[1], second[1])
        self.parts: tuple[list[bytes], list[bytes]] = ([], [])

    def begin(self) -> None:
        """Leave the ends for writing to the process alone."""
        for number in self.ends:
            os.close(number)
        for number in self.readers:
            os.set_blocking(number, False)

    def read(self) -> None:
        """Take what there is."""
        for number, parts in zip(self.readers, self.parts, strict=True):
            with contextlib.suppress(BlockingIOError):
                while part := os.read(number, 1 << 16):
                    if len(parts) < self._MOST >> 16:
                        parts.append(part)

    def end(self) -> tuple[bytes, bytes]:
        """Everything that was written."""
        self.read()
        for number in self.readers:
            os.close(number)
        return b"".join(self.parts[0]), b"".join(self.parts[1])


def _size(column: int) -> int:
    """Bytes of this process: 0 of its addresses, 1 of what is in memory, with which a copy of it begins."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[column]) * resource.getpagesize()


def _wait(pid: int, limits: Limits, told: _Pipes) -> tuple[int, resource.struct_rusage, bool]:
    """Wait for a process; end it if it works too long, or waits too long for something."""
    begun, worked = time.monotonic(), 0.0
    pause = 0.002
    while True:
        told.read()
        done, status, usage = os.wait4(pid, os.WNOHANG)
        if done:
            return status, usage, False
        now = time.monotonic()
        time.sleep(pause)
        pause = min(pause * 1.2, 0.05)
        if now - begun < limits.idle:
            continue
        seconds, running = _work(pid)
        if running or seconds > worked:
            begun, worked = now, seconds
            if seconds < limits.processor + 1:
                continue
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGUSR1 if seconds < limits.processor else signal.SIGXCPU)
            time.sleep(0.3)
            os.killpg(pid, signal.SIGKILL)
        _, status, usage = os.wait4(pid, 0)
        return status, usage, True


def _work(pid: int) -> tuple[float, bool]:
    """Seconds of processor time of a process, and whether it is running now."""
    try:
        with open(f"/proc/{pid}/stat", encoding="utf-8", errors="replace") as file:
            fields = file.read().rpartition(")")[2].split()
    except OSError:
        return 0.0, False
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"), fields[0] in "RD"
