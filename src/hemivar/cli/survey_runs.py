"""``hemivar survey``: the survey's numerical section, recomputed."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from hemivar.basics.disk import shown
from hemivar.cli.options import Exit, MaxTime, check_limits
from hemivar.cli.outputs import Writer, check_folder
from hemivar.cli.printing import StageView, console, print_table
from hemivar.cli.terminal import quiet_logging
from hemivar.errors import ProblemError

__all__ = ["survey"]

_SECONDS = 60.0


def survey(
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="DIR", help="Write figures, tables and report.html in a folder.")
    ] = Path("survey-output"),
    max_n: Annotated[int, typer.Option(metavar="N", help="Finest mesh size is 1/N; a power of two.")] = 128,
    max_time: MaxTime = None,
    bounds: Annotated[bool, typer.Option(help="Bound the distance to the exact solution in Figure 5.")] = True,
) -> int:
    """Reproduce the survey's numerical section: its Figures 1 to 5 and its Table 1.

    A method ends after 60 s on each mesh unless --max-time says otherwise.
    """
    limit = _SECONDS if max_time is None else max_time
    check_limits(max_time=limit)
    if not 8 <= max_n <= 1024 or max_n & (max_n - 1):
        raise ProblemError(f"--max-n is {max_n}; it must be a power of two, at least 8 and at most 1024")
    from hemivar.report.survey import FILES, run_survey

    check_folder(output, FILES)
    terminal = console()
    with StageView(terminal) as stages, quiet_logging():
        result = run_survey(output, max_n=max_n, method_time_limit=limit, bounds=bounds, progress=stages)
    table, runs = result.table1(), result.runs
    if table.rows:
        print_table(terminal, table)
    if runs.orders:
        print("observed orders of convergence in the V-norm (reference, method)")
        for (reference, method), order in runs.orders.items():
            print(f"    {order:5.2f}   {reference}, {method}")
    if runs.bounds:
        kind = "estimates" if runs.not_guaranteed else "guaranteed bounds"
        print(f"{kind} of the distance to the exact solution in the V-norm, h = 1/{max_n}; over the errors of Figure 5")
        for method, found in runs.bounds.items():
            ratios = [found[-2] / errors[-2] for (_, of), errors in runs.errors.items() if of == method]
            print(f"    {found[-1]:.3g}   {method}, at h = 1/{max_n // 2} {min(ratios):.2f} to {max(ratios):.2f}")
    report = output / "report.html"
    others = len(result.files) - (report in result.files)
    print(f"\nwritten           {f'{shown(report)} and ' if report in result.files else ''}{others} other files")
    print(f"time              {time.perf_counter() - result.started:.3g} s")
    if runs.interrupted:
        print("interrupted: the report holds what was done until then")
    writer = Writer()
    writer.failed += result.failed.values()
    return writer.ended(Exit.INTERRUPTED if runs.interrupted else Exit.CONVERGED)
