"""How a command that many ranks run ends: on all of them, with one message and one exit code."""

from __future__ import annotations

import math
import os
import sys
import time
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import NoReturn

from hemivar.basics.disk import shown
from hemivar.cli.outputs import one_line
from hemivar.engines.petsc.ranks import NO_MEMORY, Ranks
from hemivar.errors import HemivarError

__all__ = ["all_or_none"]


def _one_line(error: Exception) -> str:
    """What an error says, with escapes for what cannot be printed."""
    return one_line(shown(" ".join(str(error).split())))


@contextmanager
def all_or_none(ranks: Ranks) -> Iterator[None]:
    """Whatever ends the work on one rank ends it on all, with one message and exit code 2 for bad input, or 70.

    With HEMIVAR_TRACEBACK=1 in the environment an error that should not occur is shown with its traceback.
    """
    try:
        yield
    except HemivarError as error:
        if getattr(error, "shared", False):
            if ranks.rank == 0:
                _say(f"hemivar: error: {_one_line(error)}")
            ranks.mpi.Barrier()
            raise SystemExit(2) from None
        _end_all(ranks, 2, f"hemivar: error: {_one_line(error)} (rank {ranks.rank} of {ranks.size})")
    except KeyboardInterrupt:
        _end_all(ranks, 130, "hemivar: interrupted")
    except MemoryError:
        _end_all(ranks, 2, f"hemivar: error: {NO_MEMORY} (rank {ranks.rank} of {ranks.size})")
    except Exception as error:
        reason = f"{type(error).__name__}: {_one_line(error)[:300]}{_place(error)}"
        line = f"hemivar: error: rank {ranks.rank} of {ranks.size} failed ({reason}); all ranks end"
        _end_all(ranks, 70, line, error)


def _place(error: Exception) -> str:
    """Where in the code it was raised."""
    frames = traceback.extract_tb(error.__traceback__)
    return f", {frames[-1].filename.rpartition('/')[2]}:{frames[-1].lineno}" if frames else ""


def _say(line: str) -> None:
    """One line on standard error, whatever has become of the streams."""
    for stream, text in ((sys.stdout, ""), (sys.stderr, f"{line}\n")):
        with suppress(OSError, ValueError):
            stream.write(text)
            stream.flush()


def _end_all(ranks: Ranks, code: int, line: str, error: Exception | None = None) -> NoReturn:
    """End every rank; ranks that fail together leave the word to the lowest of them, whose end is that of all."""
    time.sleep(0.5 * math.log2(1 + ranks.rank))
    if error is not None and os.environ.get("HEMIVAR_TRACEBACK"):
        traceback.print_exception(error)
    _say(line)
    if ranks.size > 1:
        ranks.mpi.Abort(code)
    raise SystemExit(code)
