"""A pool of processes that begin anew (spawned): work shared out, on every system alike."""

from __future__ import annotations

import itertools
import multiprocessing
import os
import pickle
import signal
import threading
import time
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import connection
from pathlib import Path
from typing import TypeVar

from hemivar.basics.signals import handled
from hemivar.basics.user_code import load_file, loaded_files
from hemivar.errors import MethodError, ProblemError

__all__ = ["results"]

#: Tasks for each process from which the first one is a small part.
_MANY = 8
#: Work that is left, in what all processes take to begin, for which they do.  A sweep of 2.2 s that was left took 6.6 s
#: of two processors instead of 3.3, 1.7 for each process to begin.  From 3 on these figures predict less time.
_GAIN = 3.0

Task = TypeVar("Task")
Result = TypeVar("Result")


def results(
    function: Callable[[Task], Result], tasks: Sequence[Task], jobs: int, here: float = 0.0
) -> Generator[Result, None, None]:
    """What a function makes of each task: one after the other here, or as they come from processes.

    ``here``: seconds of work that this process does first where there are many tasks, which do not wait for one
    another; and all of it where what is left looks like little beside what processes take to begin, each as much.
    When the generator is closed, or Ctrl-C comes while it waits, the processes end; they end with this one, too.
    """
    jobs = min(jobs, len(tasks))
    if jobs <= 1:
        yield from map(function, tasks)
        return
    try:
        pickle.dumps(tasks[0])
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise ProblemError(
            f"other processes cannot get the work ({error}); write its function with def at the top level of "
            "a module, or take jobs = 1"
        ) from error
    began, here = time.process_time(), here if len(tasks) >= _MANY * jobs else 0.0
    for count, task in enumerate(tasks):
        spent = time.process_time() - began
        if spent >= here and spent * (len(tasks) - count) >= _GAIN * jobs * here * count:
            break
        yield function(task)
    else:
        return
    before = {child.pid for child in multiprocessing.active_children()}
    most, anew = min(jobs, len(tasks) - count), multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(most, anew, _prepare, (loaded_files(),))
    left, running, finished = iter(tasks[count:]), set[Future[Result]](), False
    try:
        while True:
            with handled(signal.SIG_IGN, "SIGINT"):  # processes are deaf to Ctrl-C from their first moment
                running |= {pool.submit(function, task) for task in itertools.islice(left, 2 * jobs - len(running))}
            if not running:
                break
            done, running = wait(running, return_when=FIRST_COMPLETED)
            yield from (one.result() for one in done)
        finished = True
    except BrokenProcessPool as error:
        raise MethodError(
            "a process ended before its work was done, perhaps because memory ran out; use fewer jobs, and in a "
            'script start them below if __name__ == "__main__":'
        ) from error
    finally:
        pipes = _ends_of_processes(pool)
        pool.shutdown(wait=finished, cancel_futures=True)
        for child in [] if finished else multiprocessing.active_children():
            if child.pid not in before:
                child.terminate()
                child.join(5.0)
        for pipe in [] if finished else pipes:
            pipe.close()


def _ends_of_processes(pool: ProcessPoolExecutor) -> list[connection.Connection]:
    """The ends of a pool's pipes that its processes use, which are open here as well.

    While they are, a thread that reads half a result of a process that was ended, or writes a task that nobody takes
    any more, waits for ever, and the interpreter for it. The attributes are private ones of Python; where they are
    not there, nothing is closed.
    """
    ends = (("_result_queue", "_writer"), ("_call_queue", "_reader"))
    pipes = (getattr(getattr(pool, queue, None), end, None) for queue, end in ends)
    return [pipe for pipe in pipes if pipe is not None]


def _prepare(files: Sequence[Path]) -> None:
    """Let a process end with the one that started it, leave Ctrl-C to that, and load the user's files that it has."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_end_with, args=(parent.sentinel,), daemon=True).start()
    for file in files:
        load_file(file)


def _end_with(sentinel: int) -> None:
    connection.wait([sentinel])
    os._exit(1)
