"""``hemivar compare``: several methods in one table."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from hemivar.cli.options import Csv, Exit, Given, Json, MaxSteps, MaxTime, ProblemPath, Rtol, controls_of, method_named
from hemivar.cli.outputs import one_line
from hemivar.cli.printing import StageView, console, print_head, print_table
from hemivar.cli.session import Session

if TYPE_CHECKING:
    from hemivar.files.problem_file import ProblemFile
    from hemivar.workflows import Attempt, Comparison, Event

__all__ = ["compare"]

_SECONDS = 60.0
_COLUMNS = ("method", "status", "time (s)", "steps", "evaluations", "residual", "energy", "difference")
_KEYS = ("method", "status", "seconds", "steps", "evaluations", "residual", "energy", "difference")


def compare(
    problem: ProblemPath,
    methods: Annotated[str | None, typer.Option(metavar="A,B,...", help="Methods to compare (all).")] = None,
    json: Json = None,
    csv: Csv = None,
    rtol: Rtol = None,
    max_time: MaxTime = None,
    max_steps: MaxSteps = None,
    given: Given = None,
) -> int:
    """Solve a contact problem by several methods and compare them in one table.

    A method ends after 60 s unless --max-time says otherwise. The reference is newton, or multigrid where no
    factorisation fits into the memory. Exit code 0 if it converged,
    whatever the others did.
    """
    from hemivar.report.tables import Table
    from hemivar.solvers import METHODS
    from hemivar.workflows import CompareOptions, Condensed, result_of
    from hemivar.workflows import compare as compared

    names = list(METHODS) if methods is None else [name.strip() for name in methods.split(",")]
    solvers = {name: method_named(name) for name in names}
    session = Session(problem, {"--json": json, "--csv": csv}, rtol, max_time, max_steps, given=given)
    stated, writer = session.stated, session.writer
    controls = controls_of(stated, rtol, max_time or stated.solver.max_time or _SECONDS, max_steps)
    discrete = session.discrete()
    print_head(stated, discrete)
    terminal = console()
    with StageView(terminal) as stages:

        def show(event: Event) -> None:
            match event:
                case Condensed(seconds, reason):
                    if seconds is None:
                        print(f"condensation      none: {reason}")
                    else:
                        print(f"condensation      {seconds:.3g} s, shared by all methods, not in the times below")
                    limits = f"{controls.max_time:g} s for each method, relative residual {controls.rtol:.0e}"
                    print(f"limits            {limits}\n")
                case _:
                    stages(event)

        found = result_of(compared(discrete, CompareOptions(solvers, controls)), show)
    columns = tuple(stated.units.head(name, "energy" if name == "energy" else "") for name in _COLUMNS)
    table = Table(columns, tuple(_row(tried) for tried in found.attempts))
    print_table(terminal, table)
    if found.reference is not None:
        print(f"difference: relative, in the energy norm, to {found.reference.name}")
    for tried in found.attempts:
        if tried.note:
            print(f"{tried.name}: {tried.note}")
    writer.write("--csv", csv, table.write_csv)
    writer.write_record(json, _record(stated, found))
    if found.interrupted:
        return writer.ended(Exit.INTERRUPTED)
    first = found.attempts[0]
    if first.status != "converged":
        sys.stderr.write(f"hemivar: the reference method {first.name} did not converge: {one_line(first.note)}\n")
        return writer.ended(Exit.NOT_CONVERGED)
    return writer.ended(Exit.CONVERGED)


def _row(tried: Attempt) -> tuple[str | float | None, ...]:
    s = tried.solution
    if s is None:
        return (tried.name, tried.status, *[None] * 6)
    return (
        tried.name, tried.status, tried.seconds, s.steps, s.evaluations, s.residual.relative, f"{s.energy:.10g}",
        tried.difference,
    )  # fmt: skip


def _record(stated: ProblemFile, found: Comparison) -> dict[str, object]:
    def plain(value: str | float | None) -> str | float | None:
        return None if isinstance(value, float) and not math.isfinite(value) else value

    records = []
    for tried in found.attempts:
        record = dict(zip(_KEYS, map(plain, _row(tried)), strict=True))
        record["energy"] = None if tried.solution is None else plain(tried.solution.energy)
        records.append({**record, "note": tried.note})
    return {
        "problem": stated.name,
        "title": stated.problem.title,
        "unknowns": found.problem.unknowns,
        "contact_points": found.problem.contact_points,
        "reference": None if found.reference is None else found.reference.name,
        "methods": records,
    }
