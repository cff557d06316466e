"""A worker for one page: it takes the newest request, leaves what is older, and hands messages on."""

from __future__ import annotations

import atexit
import logging
import threading
import weakref
from collections.abc import Callable

from hemivar.studio.binary_message import Message
from hemivar.studio.jobs import Bench
from hemivar.studio.requests import Request

__all__ = ["Desk"]

#: One solve at a time in a process: the pages of one server take turns.
_TURN = threading.Lock()
#: Workers of this process, which end before it does.
_WORKERS: weakref.WeakSet[Desk] = weakref.WeakSet()
#: Seconds that the end of the process waits for a step.
_PATIENCE = 5.0
#: Seconds after which a page that waits for its turn looks whether it was asked for something else.
_LOOK = 0.1


class Desk:
    """Works on the requests of one page in a thread of its own, one at a time, the newest first.

    A request that arrives ends the work on the one before it: after its current step, or at its next message.
    """

    def __init__(self, bench: Bench, send: Callable[[Message], None]) -> None:
        self._bench, self._send = bench, send
        self._changed = threading.Condition()
        self._pending: Request | None = None
        self._newest = -1
        self._closed = False
        self._thread = threading.Thread(target=self._work, name="hemivar studio", daemon=True)
        _WORKERS.add(self)
        self._thread.start()

    def put(self, request: Request) -> None:
        """Take a request; those before it that wait are dropped."""
        with self._changed:
            self._newest += 1
            self._pending = None if request.kind == "cancel" else request
            self._changed.notify()

    def close(self) -> None:
        """End the work at its next step; no message follows."""
        with self._changed:
            self._newest += 1
            self._closed = True
            self._pending = None
            self._changed.notify()

    def join(self, seconds: float) -> None:
        """Wait for the worker to end."""
        self._thread.join(seconds)

    def _work(self) -> None:
        while True:
            with self._changed:
                while self._pending is None and not self._closed:
                    self._changed.wait()
                if self._closed or self._pending is None:
                    return
                request, self._pending = self._pending, None
                number = self._newest
            announced: Request | None = None
            while not _TURN.acquire(timeout=_LOOK if announced else 0.0):
                with self._changed:
                    if self._closed:
                        return
                    if self._pending is not None:
                        request, self._pending, number = self._pending, None, self._newest
                if announced is not request:
                    announced = request
                    self._send(_waiting(request))
            try:
                self._answer(request, number)
            finally:
                _TURN.release()

    def _answer(self, request: Request, number: int) -> None:
        def stopped() -> bool:
            return self._newest != number

        if stopped():
            return
        try:
            for message in self._bench.answer(request, stopped):
                if stopped():
                    return
                self._send(message)
        except Exception:
            logging.getLogger("hemivar").exception("the studio could not answer a request")
            words = "an error that should not occur; see the terminal of the studio, and report it"
            self._send(
                Message(
                    {
                        "type": "error",
                        "generation": request.generation,
                        "message": words,
                        "key": None,
                        "of": request.kind,
                    }
                )
            )


def _waiting(request: Request) -> Message:
    words = "waiting for another page of this program to finish its computation …"
    head = {"type": "progress", "generation": request.generation, "of": request.kind}
    return Message({**head, "done": None, "words": words})


@atexit.register
def _end() -> None:
    """Let no worker compute while the interpreter is taken down, which would make that fail."""
    workers = list(_WORKERS)
    for worker in workers:
        worker.close()
    for worker in workers:
        worker.join(_PATIENCE)
