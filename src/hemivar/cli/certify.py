"""``hemivar certify``: what is known about a solution, whoever computed it."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hemivar.basics.disk import shown, write_text
from hemivar.cli.outputs import Writer
from hemivar.errors import ProblemError

if TYPE_CHECKING:
    from hemivar.basics.types import Array
    from hemivar.certify import Certificate
    from hemivar.discrete.problem import DiscreteProblem
    from hemivar.solvers import Solution

__all__ = ["certificate_of", "check_solution_file", "run_certify"]

_TOLERANCE = 1e-8


def run_certify(
    name: str,
    discrete: DiscreteProblem,
    solution_file: Path | None,
    output: Path | None,
    tolerance: float,
    solve: Callable[[], Solution],
    writer: Writer,
    max_time: float = math.inf,
) -> bool:
    """Certify what a file holds, or a solve; print it, write it, and say whether it fulfils the tolerance."""
    from hemivar.certify import certify

    if solution_file is None:
        solution = solve()
        source = f"solved here by {solution.method} ({solution.status.value})"
        unknowns: Array = solution.unknowns
        multiplier: Array | None = solution.multiplier
    else:
        from hemivar.files.results import read_solution

        unknowns, multiplier = read_solution(solution_file, discrete)
        source = str(solution_file)
    certificate = certify(discrete, unknowns, multiplier, tolerance=tolerance, max_time=max_time)
    print(f"solution          {shown(source)}")
    if solution_file is not None:
        origin = "recomputed from equilibrium" if multiplier is None else "read from the file"
        print(f"multiplier        {origin}")
    for line in certificate.lines(whole=True):
        print(line)
    if output is not None:
        record = {
            "problem": name,
            "solution": None if solution_file is None else str(solution_file),
            "fulfilled": certificate.stationary,
            "certificate": certificate.record(),
        }
        text = json.dumps(record, indent=1, allow_nan=False) + "\n"
        writer.write("--json", output, lambda path: write_text(path, text))
        writer.tell()
    return certificate.stationary


def certificate_of(solution: Solution, rtol: float = 0.0, max_time: float = math.inf) -> Certificate | None:
    """The certificate of a solve to ``rtol``, in its own time; None if it ended with numbers that are not finite.

    Where multigrid serves, it leaves out the survey's trace constant, which needs a hierarchy of its own.
    """
    import numpy as np

    from hemivar.certify import certify, factorises

    if not (np.isfinite(solution.unknowns).all() and np.isfinite(solution.multiplier).all()):
        return None
    problem = solution.problem
    return certify(
        problem,
        solution.unknowns,
        solution.multiplier,
        # what has converged to the tolerance that was asked for is stationary to that tolerance
        tolerance=max(rtol, _TOLERANCE),
        trace_constant=factorises(problem),
        max_time=max_time,
    )


def check_solution_file(path: Path | None) -> None:
    """Refuse a solution file that cannot be one."""
    if path is None:
        return
    if path.suffix.lower() not in (".json", ".vtu"):
        raise ProblemError(f"--solution {path}: the name must end in .json or .vtu")
    if not path.is_file():
        raise ProblemError(f"--solution {path}: there is no such file")
