"""Table 1 of the survey for every method, beside the numbers that it prints.

    python benchmarks/survey_table.py --sizes 8 16 32 64 128 --json survey_table.json

Data (5.1), the survey's warm start: every method begins at h = 1/2 from zero and goes on from its own solution on the
coarser mesh.  Seconds are those of the iteration, as in the survey without assembly and without what is done once for a
mesh (``once_s``: the condensation, which the methods share, or the levels of multigrid); ``difference`` is relative, in
the energy norm, to the default method.  A method that exceeds the limit of time takes its best iterate along.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from common import show

import hemivar as hv
from hemivar.gallery import survey
from hemivar.report.tables import PAPER_TABLE_1
from hemivar.solvers import METHODS, Controls, Solution, solve, transfer_solution
from hemivar.solvers.solve import suited
from hemivar.survey.survey_runs import SURVEY_METHODS
from hemivar.systems import Workspace, condense
from hemivar.workflows.comparison import energy_norm_difference

_DEFAULT = "newton"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=int, nargs="+", default=[8, 16, 32, 64, 128], help="cells along a side, 1/h")
    parser.add_argument("--methods", nargs="+", choices=list(METHODS), default=list(METHODS))
    parser.add_argument("--max-time", type=float, default=60.0, help="limit of each solve in seconds")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    options = parser.parse_args()
    if any(n < 2 or n & (n - 1) for n in options.sizes):
        parser.error("the meshes are halved from 1/h = 2 on: give powers of two")
    names = [_DEFAULT, *(name for name in options.methods if name != _DEFAULT)]
    controls = Controls(max_time=options.max_time)
    rows: list[dict[str, Any]] = []
    solutions: dict[str, Solution] = {}
    n = 2
    while n <= max(options.sizes):
        problem = hv.discretize(survey("5.1", n))
        condensed = condense(problem)
        for name in names:
            method = suited(METHODS[name], problem)
            if method.refuse(problem) is not None:
                continue
            guess = transfer_solution(solutions[name], problem) if name in solutions else None
            solutions[name] = solve(problem, method, controls, initial=guess, workspace=Workspace.holding(condensed))
        if n in options.sizes:
            default = solutions[_DEFAULT]
            rows += [_row(n, name, found, default) for name, found in solutions.items()]
        n *= 2
    rows.sort(key=lambda row: (names.index(row["method"]), row["n"]))
    show(rows, options.json)


def _row(n: int, name: str, found: Solution, default: Solution) -> dict[str, Any]:
    label = next((label for label, method in SURVEY_METHODS.items() if method == name), None)
    paper = None if label is None else PAPER_TABLE_1[label]
    return {
        "method": name,
        "n": n,
        "unknowns": found.problem.unknowns,
        "iterate_s": found.timings["iterate"],
        "survey_s": _number(paper.seconds, n) if paper is not None else "",
        "steps": found.steps,
        "evaluations": found.evaluations,
        "survey_count": _number(paper.counts, n) if paper is not None and paper.count_name else "",
        "counted": paper.count_name if paper is not None and paper.count_name else "",
        "status": found.status.value,
        "residual": found.residual.relative,
        "difference": energy_norm_difference(found, default),
        "once_s": sum(found.timings.get(stage, 0.0) for stage in ("condense", "levels")),
    }


def _number(values: Sequence[Any], n: int) -> Any:
    return dict(zip((8, 16, 32, 64, 128), values, strict=True)).get(n, "")


if __name__ == "__main__":
    main()
