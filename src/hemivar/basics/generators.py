"""Work as a generator: it yields events (progress) and returns a value."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from typing import TypeVar

from hemivar.basics.arguments import described
from hemivar.errors import ProblemError

__all__ = ["each_as", "result_of"]

Value = TypeVar("Value")
Event = TypeVar("Event")
Result = TypeVar("Result")


def result_of(
    work: Generator[Event, bool | None, Result], on_event: Callable[[Event], bool | None] | None = None
) -> Result:
    """Run work to its end and return its value.

    Parameters
    ----------
    work : generator
        Yields events, returns the result.
    on_event : function, optional
        Called with every event; what it returns goes to the work, which ends early, with what it has, where that is
        True after a step.  Ctrl-C while it runs reaches the work as if it had come there.

    Returns
    -------
    Result

    Raises
    ------
    ProblemError
        ``work`` is no generator.
    """
    if not isinstance(work, Generator):
        raise ProblemError(
            f"the work is {described(work)}; give what a workflow returns, such as workflows.run(problem)"
        )
    with closing(work):
        try:
            event = next(work)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
        while True:
            answer, interrupted = None, None
            try:
                answer = None if on_event is None else on_event(event)
            except KeyboardInterrupt as error:
                interrupted = error
            try:
                event = work.send(answer) if interrupted is None else work.throw(interrupted)
            except StopIteration as end:
                return end.value  # type: ignore[no-any-return]


def each_as(
    work: Generator[Value, bool | None, Result], event: Callable[[Value], Event]
) -> Generator[Event, bool | None, Result]:
    """The same work, which yields an event made of each of its values; answers and Ctrl-C reach it."""
    with closing(work):
        try:
            value = next(work)
            while True:
                try:
                    answer = yield event(value)
                except KeyboardInterrupt as error:
                    value = work.throw(error)
                else:
                    value = work.send(answer)
        except StopIteration as end:
            return end.value  # type: ignore[no-any-return]
