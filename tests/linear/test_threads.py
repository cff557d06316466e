"""One BLAS thread for multigrid, given back whoever leaves last."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from threadpoolctl import ThreadpoolController

from hemivar.linear.threads import one_thread


def counts() -> list[int]:
    return [library.num_threads for library in ThreadpoolController().select(user_api="blas").lib_controllers]


@pytest.fixture(autouse=True)
def two_threads() -> Iterator[None]:
    """BLAS with two threads, whatever the machine has."""
    with ThreadpoolController().limit(limits=2, user_api="blas"):
        pass  # a limit that is held belongs to this thread
    before = counts()
    for library in ThreadpoolController().select(user_api="blas").lib_controllers:
        library.set_num_threads(2)
        getattr(type(library), "clear_controlling_thread", lambda: None)()
    assert set(counts()) == {2}
    yield
    for library, count in zip(ThreadpoolController().select(user_api="blas").lib_controllers, before, strict=True):
        library.set_num_threads(count)
        getattr(type(library), "clear_controlling_thread", lambda: None)()


class Worker:
    """A thread that enters the context, and leaves it when it is told to."""

    def __init__(self) -> None:
        self.inside, self.leave = threading.Event(), threading.Event()
        self.done, self.end = threading.Event(), threading.Event()
        self.thread = threading.Thread(target=self.run)
        self.thread.start()
        assert self.inside.wait(10)

    def run(self) -> None:
        with one_thread():
            self.inside.set()
            self.leave.wait(10)
        self.done.set()
        self.end.wait(10)  # alive still, as the threads of a pool are

    def out(self) -> None:
        self.leave.set()
        assert self.done.wait(10)


@pytest.mark.parametrize("order", [(0, 1), (1, 0)], ids=["first in, first out", "first in, last out"])
def test_threads_leave_in_any_order(order: tuple[int, int]) -> None:
    workers = [Worker(), Worker()]
    try:
        assert set(counts()) == {1}
        workers[order[0]].out()
        assert set(counts()) == {1}, "the other is at work"
        workers[order[1]].out()
        assert set(counts()) == {2}
    finally:
        for worker in workers:
            worker.leave.set()
            worker.end.set()
            worker.thread.join()
    assert set(counts()) == {2}


def test_it_is_entered_twice_and_left_by_an_error() -> None:
    with one_thread(), one_thread():
        assert set(counts()) == {1}
    assert set(counts()) == {2}
    with pytest.raises(ZeroDivisionError), one_thread():
        _ = 1 / 0
    assert set(counts()) == {2}
    with one_thread(wanted=False):
        assert set(counts()) == {2}


def test_what_the_user_set_in_the_meantime_is_not_forgotten() -> None:
    with ThreadpoolController().limit(limits=1, user_api="blas"):
        with one_thread():
            assert set(counts()) == {1}
        assert set(counts()) == {1}
    assert set(counts()) == {2}
