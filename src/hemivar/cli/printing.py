"""What the commands print: events of a use case as they come, tables, the head and the summary of a problem."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Self

from hemivar.basics.disk import shown
from hemivar.cli.outputs import one_line
from hemivar.cli.terminal import Stream

if TYPE_CHECKING:
    from rich.console import Console
    from rich.progress import Progress
    from rich.table import Table as RichTable

    from hemivar.basics.units import Units
    from hemivar.certificates import Certificate
    from hemivar.files.changes import Change
    from hemivar.files.problem_file import ProblemFile
    from hemivar.mesh import Mesh
    from hemivar.report.tables import Table
    from hemivar.solvers import Progress as Step
    from hemivar.solvers import Solution
    from hemivar.workflows import Event

__all__ = [
    "Bar",
    "SolveView",
    "StageView",
    "console",
    "print_changes",
    "print_claims",
    "print_not_converged",
    "print_notes",
    "print_step",
    "print_step_head",
    "print_summary",
    "print_table",
    "print_title",
    "print_unsaid",
    "unread",
]


def console() -> Console:
    """A console without colours unless it is a terminal."""
    from rich.console import Console

    return Console(file=sys.stdout, highlight=False, markup=False, emoji=False)


def unread() -> bool:
    """Whether standard output has failed: nobody follows the work any more, and it ends as by Ctrl-C."""
    return isinstance(sys.stdout, Stream) and sys.stdout.failed is not None


def print_step_head(level: str = "") -> None:
    """Print what stands in the lines for the steps."""
    print(f"\n{'step':>6}  {'residual':>9}  {'energy':>18}  {'changed points':>14}{level}", flush=True)


def print_step(now: Step) -> bool:
    """Print a line for a step; returns whether nobody reads it."""
    print(f"{now.step:>6}  {now.residual:>9.2e}  {now.energy:>18.10g}  {now.changed:>14}", flush=True)
    return unread()


class SolveView:
    """Shows a solve: its method, if ``verbose`` with predicted costs, and, unless ``quiet``, every step."""

    def __init__(self, quiet: bool = False, verbose: bool = False) -> None:
        self.quiet, self.verbose = quiet, verbose
        self.solution: Solution | None = None

    def __call__(self, event: Event) -> bool:
        """Show an event; returns whether to stop."""
        from hemivar.solvers import Progress, Status
        from hemivar.workflows import FoundEvent, MethodEvent, StartEvent

        match event:
            case MethodEvent(solver, reason):
                print(f"method            {solver.name}")
                if reason:
                    reason_shown = reason if self.verbose else reason.partition("; predicted:")[0]
                    print(f"chosen            {reason_shown}", flush=True)
            case StartEvent(problem, _, count) if not self.quiet:
                level = ""
                if count > 1 and problem.field is not None:
                    level = f"   mesh with h = {problem.field.mesh.size:.3g}, {problem.unknowns} unknowns"
                print_step_head(level)
            case Progress() if not self.quiet:
                return print_step(event)
            case FoundEvent(solution):
                self.solution = solution
                if solution.status is Status.INTERRUPTED:
                    print("\ninterrupted       the best iterate follows; Ctrl-C again leaves its certificate out")
                    sys.stdout.flush()
            case _:
                pass
        return False


class Bar:
    """A bar on a terminal, with the part that is done or the time that has gone; nothing elsewhere."""

    def __init__(self, quiet: bool = False, timed: bool = False, out: Console | None = None) -> None:
        self._console = console() if out is None else out
        self.drawn = self._console.is_terminal and not quiet
        self._context = contextlib.ExitStack()
        self._bar: Progress | None = None
        self._timed = timed

    def show(self, text: str, done: float = 0.0, total: float | None = 1.0) -> None:
        """Show a text and how much is done; without a total only that the work goes on."""
        if not self.drawn:
            return
        from rich import progress

        if self._bar is None:
            part = progress.TimeElapsedColumn() if self._timed else progress.TaskProgressColumn()
            columns = (progress.BarColumn(), part, progress.TextColumn("{task.description}", markup=False))
            own = progress.Progress(*columns, console=self._console, transient=True)
            self._bar = self._context.enter_context(own)
            self._bar.add_task("", total=total)
        self._bar.update(progress.TaskID(0), description=text, completed=done, total=total)

    def say(self, text: str) -> None:
        """A line above the bar, or where none is drawn."""
        if self._bar is None:
            print(text, flush=True)
        else:
            self._bar.console.print(text, markup=False)

    def close(self) -> None:
        """Take it away."""
        self._context.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class StageView(Bar):
    """Shows how far long work is: by a bar on a terminal; elsewhere by a line for each stage."""

    def __init__(self, console: Console) -> None:
        super().__init__(timed=True, out=console)
        self._began = time.monotonic()

    def __call__(self, event: Event) -> None:
        """Show a stage, a start of a search, a point of a path or a load factor of a bracket."""
        from hemivar.branches import PathProgress, Reached, SearchProgress
        from hemivar.workflows import Phase

        match event:
            case Phase(name, number, count):
                if not self.drawn:
                    print(name, flush=True)
                self.show(name, number, count)
            case SearchProgress(starts, count, planned):
                tried = f"{starts} of {planned} starts" if starts < planned else f"{starts} starts" if starts else ""
                parts = (tried, f"{count} solution{'' if count == 1 else 's'}", self._left(starts, planned))
                self.show(", ".join(part for part in parts if part), starts, planned or None)
            case PathProgress(points, load_factor):
                self.show(f"{points} points, load factor {load_factor:.4g}", total=None)
            case Reached(tried=tried):
                self.show(f"{tried} load factors, carried {event.carried:.4g}", total=None)
        if unread():
            raise KeyboardInterrupt

    def _left(self, done: int, count: int) -> str:
        """About how long it takes yet, once some parts of the whole are done; from a hundred seconds on in minutes."""
        if not 4 <= done < count:
            return ""
        seconds = (time.monotonic() - self._began) / done * (count - done)
        return f"about {seconds:.0f} s left" if seconds < 100.0 else f"about {seconds / 60.0:.0f} min left"


def print_table(console: Console, table: Table, keys: int = 1) -> None:
    """Print a table with all its columns.

    On a terminal that is too narrow for them they stand in several tables, each with the first ``keys`` columns, which
    tell the rows apart; elsewhere lines are as long as they must be.
    """
    drawn, whole = _drawn(console, table)
    if not console.is_terminal or whole <= console.width:
        return _print_whole(console, drawn, whole)
    first, rest = list(range(keys)), list(range(keys, len(table.columns)))
    while rest:
        taken = [rest.pop(0)]
        while rest and _drawn(console, _columns(table, [*first, *taken, rest[0]]))[1] <= console.width:
            taken.append(rest.pop(0))
        _print_whole(console, *_drawn(console, _columns(table, [*first, *taken])))
        table = replace(table, title="")
    return None


def _columns(table: Table, kept: Sequence[int]) -> Table:
    """A table of some columns."""
    rows = tuple(tuple(row[k] for k in kept) for row in table.rows)
    return replace(table, columns=tuple(table.columns[k] for k in kept), rows=rows)


def _drawn(console: Console, table: Table) -> tuple[RichTable, int]:
    """A table as it is printed, and how wide it is."""
    from rich import box

    drawn = table.rich()
    drawn.box = box.SIMPLE_HEAD
    for column in drawn.columns:
        column.no_wrap = True
    return drawn, console.measure(drawn, options=console.options.update(width=10_000)).maximum


def _print_whole(console: Console, drawn: RichTable, whole: int) -> None:
    width = console.width
    console.width = max(width, whole)
    console.print(drawn, crop=False)
    console.width = width


def print_title(stated: ProblemFile, changes: Sequence[Change] = ()) -> None:
    """Print what the problem is in one line, and what was changed."""
    print(one_line(stated.problem.title) or shown(stated.name))
    print_changes(changes)
    print_notes(stated.problem.mesh)


def print_notes(mesh: Mesh) -> None:
    """Print how a mesh file was read: cells that were converted, and what could not be taken."""
    for note in mesh.notes:
        print(f"mesh file         {shown(note)}")


def print_changes(changes: Sequence[Change]) -> None:
    """Print what was changed in a problem file."""
    for change in changes:
        print(f"set               {shown(change)}")


def print_not_converged(solution: Solution) -> None:
    """Say on standard error how a solve ended, and what to do."""
    sys.stdout.flush()
    sys.stderr.write(
        f"hemivar: not converged: {solution.status.value} after {solution.steps} steps, relative residual "
        f"{solution.residual.relative:.1e}: {solution.remedy}\n"
    )


def print_summary(
    console: Console,
    solution: Solution,
    certificate: Certificate | None,
    units: Units,
    printed: Sequence[str] = (),
) -> None:
    """Print what was found, without the warnings that were said before."""
    from hemivar.report.summary import summary_of
    from hemivar.solvers import Status

    lines = summary_of(solution, certificate, units).lines()
    print_claims(console, lines, solution.status.value, solution.status is Status.CONVERGED, printed)


def print_claims(
    console: Console, lines: Iterable[str], status: str, reached: bool, printed: Sequence[str] = ()
) -> None:
    """Print lines, the status in the first of them in colour, without the warnings that were said before."""
    first, *others = lines
    label, _, rest = first.partition(status)
    console.print(f"\n{label}", end="")
    console.print(status, style="bold green" if reached else "bold red", end="")
    console.print(rest, soft_wrap=True)
    print_unsaid(others, printed)


def print_unsaid(lines: Iterable[str], printed: Sequence[str]) -> None:
    """Print lines without the warnings that were said before."""
    print("\n".join(line for line in lines if line.removeprefix("warning").strip() not in printed))
