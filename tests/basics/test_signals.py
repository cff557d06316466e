"""Signals are handled for a while, and then as they were before."""

from __future__ import annotations

import os
import signal
import threading

from hemivar.basics.signals import handled


def test_handlers_are_those_of_before_again() -> None:
    heard: list[int] = []
    before = signal.getsignal(signal.SIGUSR1)
    with handled(lambda number, _: heard.append(number), "SIGUSR1", "NO SUCH SIGNAL"):
        os.kill(os.getpid(), signal.SIGUSR1)
    assert heard == [signal.SIGUSR1]
    assert signal.getsignal(signal.SIGUSR1) == before


def test_what_is_set_otherwise_is_left_alone() -> None:
    """Whoever started the process with nohup keeps what it has asked for."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with handled(lambda *_: None, "SIGHUP", taken=lambda now: now is signal.SIG_DFL):
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_other_threads_handle_none() -> None:
    before, seen = signal.getsignal(signal.SIGTERM), []

    def work() -> None:
        with handled(lambda *_: None, "SIGTERM"):
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [before]
