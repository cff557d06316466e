"""Work that yields events and returns a value, run to its end."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from hemivar.basics.generators import each_as, result_of


def counting(limit: int, closed: list[bool] | None = None) -> Generator[int, bool | None, str]:
    try:
        for number in range(limit):
            if (yield number):
                return f"stopped at {number}"
    except KeyboardInterrupt:
        return "interrupted"
    finally:
        if closed is not None:
            closed.append(True)
    return "done"


def test_the_value_and_every_event_in_order() -> None:
    seen: list[int] = []
    assert result_of(counting(3), seen.append) == "done"
    assert seen == [0, 1, 2]
    assert result_of(counting(3)) == "done"
    assert result_of(counting(0)) == "done"


def test_what_is_returned_reaches_the_work() -> None:
    assert result_of(counting(9), lambda number: number == 4) == "stopped at 4"


def test_an_interruption_outside_the_work_is_one_inside_it() -> None:
    def interrupt(number: int) -> None:
        if number == 1:
            raise KeyboardInterrupt

    assert result_of(counting(3), interrupt) == "interrupted"


def test_another_error_ends_the_work() -> None:
    closed: list[bool] = []
    with pytest.raises(ZeroDivisionError) as caught:
        result_of(counting(3, closed), lambda number: bool(1 // number))
    assert closed == [True]
    assert caught.type is ZeroDivisionError


def test_an_end_of_iteration_outside_is_no_result() -> None:
    with pytest.raises(StopIteration):
        result_of(counting(3), lambda _: next(iter([])))


def test_work_told_as_other_events_gets_answers_and_interruptions_and_is_closed() -> None:
    seen: list[str] = []
    assert result_of(each_as(counting(3), str), seen.append) == "done"
    assert seen == ["0", "1", "2"]
    assert result_of(each_as(counting(9), str), lambda text: text == "4") == "stopped at 4"
    assert result_of(each_as(counting(0), str)) == "done"
    closed: list[bool] = []
    work = each_as(counting(3, closed), str)
    next(work)
    work.close()
    assert closed == [True]
    work = each_as(counting(3), str)
    next(work)
    with pytest.raises(StopIteration, match="interrupted"):
        work.throw(KeyboardInterrupt)
