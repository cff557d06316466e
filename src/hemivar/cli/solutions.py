"""The command ``hemivar solutions``: all solutions of a problem that can be found."""

from __future__ import annotations

import json as json_module
from pathlib import Path

from hemivar.basics.disk import write_text
from hemivar.branches import SolutionSet, find_solutions
from hemivar.cli.outputs import Writer
from hemivar.discrete.problem import DiscreteProblem
from hemivar.files import solution_record
from hemivar.report.tables import Table
from hemivar.solvers import Controls

__all__ = ["run_solutions", "solutions_table"]


def run_solutions(
    name: str,
    problem: DiscreteProblem,
    controls: Controls,
    json: Path | None,
    writer: Writer,
    *,
    starts: int,
    max_solutions: int,
    seed: int,
) -> SolutionSet:
    """Search, and write the solutions if a file is given."""
    found = find_solutions(problem, starts=starts, max_solutions=max_solutions, seed=seed, controls=controls)
    if json is not None:
        record = {
            "problem": name,
            "exhaustive": found.exhaustive,
            "searched": found.searched,
            "starts": found.starts,
            "solutions": [{"kind": s.kind, **solution_record(s)} for s in found],
        }
        text = json_module.dumps(record, indent=1, allow_nan=False) + "\n"
        writer.write("--json", json, lambda path: write_text(path, text))
    return found


def solutions_table(found: SolutionSet) -> Table:
    """One line for each solution."""
    columns = ("", "kind", "energy", "max penetration", "normal force", "contact", "residual")
    rows = tuple(
        (
            i + 1,
            s.kind,
            f"{s.energy:.10g}",
            f"{s.penetration.max(initial=0.0):.6g}",
            f"{s.normal_force:.6g}",
            f"{s.contact_length:.6g}",
            s.residual.relative,
        )
        for i, s in enumerate(found)
    )
    return Table(columns, rows)
