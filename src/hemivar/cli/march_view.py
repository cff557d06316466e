"""A march (time integration) as it is shown: its steps while it goes, a bar on a terminal, and the summary."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import TYPE_CHECKING

from hemivar.cli.options import Exit
from hemivar.cli.outputs import one_line
from hemivar.cli.printing import Bar, unread
from hemivar.errors import FileError

if TYPE_CHECKING:
    from hemivar.evolution import History
    from hemivar.evolution.discrete import DiscreteEvolution
    from hemivar.files.series import Series
    from hemivar.workflows import Event, ProgressEvent

__all__ = ["MarchView", "code_of"]


class MarchView:
    """Shows a march while it goes, and writes its frames as they come."""

    def __init__(
        self,
        head: Callable[[DiscreteEvolution], None],
        begin: Callable[[DiscreteEvolution], Series | None],
        failed: list[str],
        quiet: bool,
    ) -> None:
        self.quiet, self.failed = quiet, failed
        self.series: Series | None = None
        self._head, self._begin_series = head, begin
        self._bar = Bar(quiet)
        self._printed = -math.inf
        self._warned = False

    def __enter__(self) -> MarchView:
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.close()

    def __call__(self, event: Event) -> bool:
        """Show an event; returns whether to stop."""
        from hemivar.workflows import ProgressEvent, ReadyEvent

        if isinstance(event, ReadyEvent):
            self._begin(event.discrete)
        elif isinstance(event, ProgressEvent):
            self._frames(event)
            if not self.quiet:
                self._step(event)
            return unread()
        return False

    def _begin(self, discrete: DiscreteEvolution) -> None:
        self._head(discrete)
        self.series = self._begin_series(discrete)

    def _frames(self, event: ProgressEvent) -> None:
        """Write a frame at once, so that a march that is killed leaves what it had."""
        stepped = event.stepped
        if self.series is None or not (stepped.frame or stepped.earlier):
            return
        index = stepped.state.index
        new = [] if stepped.frame is None else [(index, stepped.frame)]
        try:
            self.series.add([*stepped.earlier, *new])
        except FileError as error:  # the march is worth more than its frames: they are tried again in the end
            self.failed.append(f"--fields: {error}")
            self.series = None

    def _step(self, event: ProgressEvent) -> None:
        row, done = event.stepped.row, event.stepped.done
        if event.stepped.unkept and not self._warned:
            self._warned = True
            self._bar.say(f"the run continues without its checkpoint and will try again: {event.stepped.unkept}")
        left = _duration(event.left)
        what = f"{row.time:.6g}   length {row.step:.3g}   residual {row.residual:.1e}   left {left}"
        if self._bar.drawn:
            self._bar.show(f"t {what}", done)
        # without a terminal a line for each twentieth of the time
        elif done - self._printed >= 0.05 or event.stepped.happened or row.jumped or done >= 1.0:
            if self._printed < 0.0:
                head = f"{'step':>7}  {'time':>11}  {'length':>9}  {'residual':>9}  {'margin':>8}  {'normal force':>13}"
                print(f"\n{head}  left")
            self._printed = done
            force = row.values["normal_force"]
            line = f"{event.stepped.state.index:>7}  {row.time:>11.6g}  {row.step:>9.3g}  {row.residual:>9.2e}"
            happened = ", ".join((*event.stepped.happened, *(("jumped",) if row.jumped else ())))
            print(f"{line}  {row.margin:>8.3g}  {force:>13.6g}  {left:<8} {happened}".rstrip(), flush=True)


def _duration(seconds: float) -> str:
    """A time that is left, in words."""
    if not math.isfinite(seconds):
        return "-"
    if seconds < 60.0:
        return f"{seconds:.0f} s"
    if seconds < 3600.0:
        return f"{seconds / 60.0:.0f} min"
    return f"{seconds / 3600.0:.1f} h"


def code_of(history: History, name: str) -> Exit:
    """The exit code of a march of a problem file; says on standard error where and why it ended too early."""
    if history.finished:
        return Exit.CONVERGED
    if history.ended == "interrupted":
        return Exit.INTERRUPTED
    sys.stdout.flush()
    if history.ended == "refused":
        why = history.messages[-1].removeprefix(f"{name}: ")
        sys.stderr.write(f"hemivar: error: {one_line(f'{name}: after t = {history.state.time:g}: {why}')}\n")
        return Exit.BAD_INPUT
    sys.stderr.write(f"hemivar: not finished: {history.ended} at t = {history.state.time:g}\n")
    return Exit.NOT_CONVERGED
