"""What stands between the command and the terminal: harmless output that may fail, signals, warnings."""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import signal
import sys
import time
import warnings
from collections.abc import Iterator
from typing import TextIO

from hemivar.basics.disk import shown
from hemivar.basics.signals import handled

__all__ = [
    "COALESCE",
    "Stream",
    "guarded_streams",
    "hold_signals",
    "interrupted",
    "one_voice",
    "quiet_logging",
    "quiet_warnings",
    "signals_as_interrupts",
]

_SUSPECT = re.compile(r"[^\n\t\x20-\x7e]+")
#: Seconds within which several signals are one: senders that end a job send SIGTERM and SIGHUP together.
COALESCE = 2.0


class Stream(io.TextIOBase):
    """Standard output or error: control characters are escaped, and a failure is remembered rather than raised.

    Colours and bars come from rich, which finds the stream without the filter under ``rich_proxied_file``; both are one
    stream in all else.
    """

    def __init__(
        self,
        under: TextIO | None,
        filtered: bool = True,
        failures: list[Exception] | None = None,
        terminal: bool | None = None,
    ) -> None:
        self._under, self._filtered, self._terminal = under, filtered, terminal
        self._failures: list[Exception] = [] if failures is None else failures

    @property
    def failed(self) -> Exception | None:
        """The first error of writing; nothing is written after it."""
        return self._failures[0] if self._failures else None

    @property
    def reader_left(self) -> bool:
        """Whether the other end of the pipe, or the terminal, has gone."""
        return isinstance(self.failed, BrokenPipeError)

    @property
    def rich_proxied_file(self) -> Stream:
        """The same stream without the filter."""
        return Stream(self._under, False, self._failures, self._terminal)

    @property
    def plain(self) -> Stream:
        """The same stream, as if it were no terminal."""
        return Stream(self._under, self._filtered, self._failures, False)

    def write(self, text: str, /) -> int:
        """Write a text; returns its length."""
        if self._under is not None and not self._failures:
            if self._filtered:
                text = _SUSPECT.sub(lambda match: shown(match.group().replace("\xa0", " ")), text)
            try:
                self._under.write(text)
            except (OSError, ValueError) as error:
                self._failures.append(error)
        return len(text)

    def flush(self) -> None:
        """Flush, if it is still possible."""
        if self._under is not None and not self._failures:
            try:
                self._under.flush()
            except (OSError, ValueError) as error:
                self._failures.append(error)

    def isatty(self) -> bool:
        """Whether it is a terminal."""
        return self._under is not None and bool(self._under.isatty() if self._terminal is None else self._terminal)

    def writable(self) -> bool:
        """Always."""
        return True

    def fileno(self) -> int:
        """Of the stream below."""
        if self._under is None:
            raise io.UnsupportedOperation("fileno")
        return int(self._under.fileno())

    @property
    def encoding(self) -> str:  # type: ignore[override]
        """Of the stream below."""
        return str(getattr(self._under, "encoding", None) or "utf-8")

    @property
    def errors(self) -> str | None:  # type: ignore[override]
        """Of the stream below."""
        return getattr(self._under, "errors", None)

    def seal(self) -> None:
        """After a failure, lead the descriptor to nowhere, so that Python's flush at exit cannot fail again."""
        if not self._failures:
            return
        with contextlib.suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)


@contextlib.contextmanager
def guarded_streams() -> Iterator[tuple[Stream, Stream]]:
    """Standard output and error as :class:`Stream` inside the block.

    Descriptors that the process was started without lead to nowhere, so that no file gets their numbers.
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            with contextlib.suppress(OSError):
                os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError, OSError):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]
    before = sys.stdout, sys.stderr
    out, err = Stream(sys.stdout), Stream(sys.stderr)
    sys.stdout, sys.stderr = out, err
    try:
        yield out, err
    finally:
        for stream in (out, err):
            stream.flush()
            stream.seal()
        sys.stdout, sys.stderr = before


@contextlib.contextmanager
def one_voice(speaks: bool) -> Iterator[None]:
    """Inside the block this process of several is heard, and by no terminal, or it is not."""
    out, err = (stream.plain if isinstance(stream, Stream) else stream for stream in (sys.stdout, sys.stderr))
    with (
        contextlib.redirect_stdout(out if speaks else Stream(None)),
        contextlib.redirect_stderr(err if speaks else Stream(None)),
    ):
        yield


# ---- signals ---------------------------------------------------------------------------------------------------

#: How many blocks hold signals now, and when the last one came.
_holding = 0
_last = -math.inf


_pressed = False


@contextlib.contextmanager
def signals_as_interrupts() -> Iterator[None]:
    """SIGTERM and SIGHUP end the block as Ctrl-C does, by KeyboardInterrupt; several at once count as one.

    Those that whoever started the process has set otherwise (nohup) stay as they are.
    """
    global _pressed
    _pressed = False
    with (
        handled(_press, "SIGINT", taken=lambda before: before is signal.default_int_handler),
        handled(_interrupt, "SIGTERM", "SIGHUP", taken=lambda before: before is signal.SIG_DFL),
    ):
        yield


def interrupted() -> bool:
    """Whether an interruption has come: libraries that it meets while they load make another error of it."""
    return _pressed


def _press(*_: object) -> None:
    global _pressed
    _pressed = True
    raise KeyboardInterrupt


def _interrupt(*_: object) -> None:
    global _last
    now = time.monotonic()
    if _holding or now - _last < COALESCE:
        return
    _last = now
    _press()


@contextlib.contextmanager
def hold_signals() -> Iterator[None]:
    """SIGTERM and SIGHUP are of no effect inside the block, where the last files are written (Ctrl-C is)."""
    global _holding
    _holding += 1
    try:
        yield
    finally:
        _holding -= 1


# ---- warnings --------------------------------------------------------------------------------------------------


@contextlib.contextmanager
def quiet_warnings() -> Iterator[None]:
    """No warning of a library reaches the user raw: what matters is said in the results.

    ``python -W`` and PYTHONWARNINGS show them.
    """
    with warnings.catch_warnings():
        if not sys.warnoptions:
            warnings.simplefilter("ignore")
        yield


@contextlib.contextmanager
def quiet_logging() -> Iterator[None]:
    """The same for what libraries log while they draw, such as fonts and folders that they miss."""
    import logging

    disabled = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(disabled)
