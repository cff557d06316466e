"""The command line interface ``hemivar``."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
from collections.abc import Sequence

from hemivar.basics.signals import handled

__all__ = ["main"]


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code, as :func:`hemivar.cli.app.main` does.

    While the modules of a process of its own load, an interruption ends it at once: there is nothing to be kept, and
    libraries that are interrupted while they load complain of anything else.
    """
    own = ("SIGINT", "SIGTERM", "SIGHUP") if argv is None else ()
    if argv is None:
        gc.disable()  # modules make much and drop little: the command looks for garbage once they are there
    with handled(_leave, *own, taken=lambda before: before in (signal.SIG_DFL, signal.default_int_handler)):
        from hemivar.cli.app import main as run
    try:
        return run(argv)
    finally:
        if argv is None:
            gc.enable()


def _leave(*_: object) -> None:
    with contextlib.suppress(OSError):
        os.write(2, b"hemivar: interrupted\n")
    os._exit(130)
