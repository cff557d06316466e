"""A march (time integration) as it is shown: its steps while it goes, a bar on a terminal, and the summary."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

from hemivar.basics.disk import shown
from hemivar.cli.options import Exit
from hemivar.cli.outputs import one_line
from hemivar.cli.printing import Bar, console, unread
from hemivar.errors import FileError

if TYPE_CHECKING:
    from hemivar.evolution import History
    from hemivar.evolution.discrete import DiscreteEvolution
    from hemivar.files.series import Series
    from hemivar.workflows import Event, ProgressEvent

__all__ = ["MarchView", "code_of", "print_history"]

#: Events and messages that are printed, so that the summary stays on one screen; --json has all.
_SHOWN = 8


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


def print_history(history: History) -> None:
    """The summary of a march."""
    out = console()
    steps = len(history.taken)
    out.print("\nstatus            ", end="")
    out.print(history.ended, style="bold green" if history.finished else "bold red", end="")
    taken = int(history["solver_steps"].sum())
    others = int(history["fallbacks"].sum()) if "fallbacks" in history.columns else 0
    solved = f"{taken} of the solver" + (f", {others} fallbacks" if others else "")
    out.print(f" at t = {history.state.time:g} after {steps} steps ({solved}), {len(history.frames)} frames")
    if not steps:
        return
    _print_load_steps(history)
    print(f"worst residual    {history.residual:.1e}")
    print(f"least margin      {history.margin:.6g}{'; ' if history.margin <= 0.0 else ', '}{history.uniqueness}")
    if "load_factor" in history.columns:
        factors = history["load_factor"]
        print(f"load factor       {factors[-1]:.6g} at the end, at most {factors.max():.6g}")
    ledger = history.ledger
    given = [f"{ledger['work']:.6g} by loads", f"{ledger['moved']:.6g} by moved supports"]
    given += [f"{ledger['thermal']:.6g} by thermal stress"] if ledger.get("thermal") else []
    given += [f"{history.state.ledger.start:.6g} at the start"] if history.state.ledger.start else []
    print(f"external work     {', '.join(given)}")
    kinds = {
        "stored": ("elastic", "branches", "contact", "kinetic"),
        "dissipated": ("viscous", "branch_loss", "friction", "damping", "memory", "numerical", "jumps"),
    }
    for label, names in kinds.items():
        parts = [f"{name.replace('_', ' ')} {ledger[name]:.6g}" for name in names if ledger[name] != 0.0]
        print(f"{label:<18}{', '.join(parts) or 'nothing'}")
    largest = max(abs(value) for name, value in ledger.items() if name != "gap")
    part = abs(ledger["gap"]) / largest if largest > 0.0 else 0.0
    print(f"balance error     {ledger['gap']:.1e}, {part:.0e} of the largest entry")
    print(f"error in time     {history.time_error.words}")
    if "error_sum" in history.columns:
        sums = history["error_sum"][-1], history["contact_error_sum"][-1]
        print(f"errors of steps   add up to {sums[0]:.2g} in the energy norm, {sums[1]:.2g} at the contact points")
    for when, name in history.events[:_SHOWN]:
        print(f"event             {name} at t = {when:.6g}")
    if len(history.events) > _SHOWN:
        print(f"                  (of {len(history.events)} events; --json FILE holds all)")
    for message in history.messages[:_SHOWN]:
        print(f"note              {shown(message)}")
    sys.stdout.flush()


def _print_load_steps(history: History) -> None:
    """What contact bears at the end of each load step."""
    ends = {row.time: row for row in history.rows}
    label = "load steps"
    for number, step in enumerate(history.discrete.evolution.steps, start=1):
        if (row := ends.get(float(number))) is not None:
            print(f"{label:<18}{number} {step.name}: {_forces(row.values)}; residual {row.residual:.1e}")
            label = ""


def _forces(values: Mapping[str, float]) -> str:
    """Normal force and friction, on each boundary where there are several."""
    ends = ("normal_force", "friction_force")
    names = [name.removesuffix(f".{ends[0]}") for name in values if name.endswith(f".{ends[0]}")]
    if not names:
        return f"normal force {values[ends[0]]:.6g}, friction {values[ends[1]]:.6g}"
    parts = (f"{name} {values[f'{name}.{ends[0]}']:.6g}, {values[f'{name}.{ends[1]}']:.6g}" for name in names)
    return f"normal force and friction of {'; '.join(parts)}"


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
