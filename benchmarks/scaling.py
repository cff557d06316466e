"""Time and memory of a whole contact solve, from a file to a certified answer, against the number of unknowns.

    python benchmarks/scaling.py --dim 2 --sizes 128 256 512 1024
    python benchmarks/scaling.py --dim 3 --sizes 16 32 48 64 --json rows.json

Each size runs in a process of its own: a problem file of the survey's data (5.1) is read and its mesh made, matrix and
hierarchy are set up, the solution is found and certified, and its results are written as JSON.  ``whole_s`` is all of
that.  ``peak_mib`` is what that size takes up to its solution, less ``base_mib``, the memory of the program before it
starts.  The last lines give the exponents of time in the number of unknowns, fitted by least squares.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from common import peak_mib, show

import hemivar as hv
from hemivar import gallery


def one(dim: int, n: int) -> dict[str, Any]:
    """One size, in this process."""
    hv.solve(hv.discretize(gallery.survey("5.1", 4, "right")), hv.solvers.NonsmoothMultigrid())  # imports are done
    base = peak_mib()
    with tempfile.TemporaryDirectory() as folder:
        statement = gallery.survey("5.1", n, "right") if dim == 2 else gallery.survey_cube("5.1", n)
        file = hv.write_problem(statement, Path(folder) / "problem.toml")
        del statement
        workspace = hv.systems.Workspace()
        began = time.perf_counter()
        read = hv.read_problem(file)
        made = time.perf_counter()
        problem = hv.discretize(read)
        assembled = time.perf_counter()
        solution = hv.solve(problem, hv.solvers.NonsmoothMultigrid(), workspace=workspace)
        ended, peak = time.perf_counter(), peak_mib()
        certificate = hv.certify(solution, trace_constant=False, workspace=workspace)
        certified = time.perf_counter()
        solution.to_json(Path(folder) / "result.json")
        written = time.perf_counter()
    return {
        "dim": dim,
        "n": n,
        "unknowns": problem.unknowns,
        "read_s": made - began,
        "assembly_s": assembled - made,
        "levels_s": solution.timings["levels"],
        "contact_s": solution.timings["iterate"] + solution.timings["recover"],
        "certify_s": certified - ended,
        "write_s": written - certified,
        "whole_s": written - began,
        "steps": solution.steps,
        "cycles": solution.evaluations,
        "status": solution.status.value,
        "residual": solution.residual.relative,
        "certificate": certificate.kind.value,
        "base_mib": base,
        "peak_mib": peak,
        "kib_per_unknown": 1024.0 * (peak - base) / problem.unknowns,
    }


def exponent(rows: list[dict[str, Any]], column: str) -> float:
    """Slope of the logarithm of a column over that of the number of unknowns."""
    size = np.log([row["unknowns"] for row in rows])
    return float(np.polyfit(size, np.log([row[column] for row in rows]), 1)[0])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dim", type=int, choices=(2, 3), default=2)
    parser.add_argument("--sizes", type=int, nargs="+", default=None, help="cells along a side, 1/h")
    parser.add_argument("--json", type=Path, default=None)
    parser.add_argument("--one", type=int, default=None, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one is not None:
        print(json.dumps(one(options.dim, options.one)))
        return
    sizes = options.sizes or ((128, 256, 512, 1024) if options.dim == 2 else (16, 24, 32, 48, 64))
    rows = []
    for n in sizes:
        command = [sys.executable, __file__, "--dim", str(options.dim), "--one", str(n)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        if run.returncode:
            print(f"n = {n} failed: {run.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
            continue
        rows.append(json.loads(run.stdout))
        print(json.dumps(rows[-1]), file=sys.stderr)
    show(rows, options.json)
    if len(rows) > 1:
        print(f"contact_s grows like unknowns^{exponent(rows, 'contact_s'):.3f}")
        print(f"whole_s   grows like unknowns^{exponent(rows, 'whole_s'):.3f}")


if __name__ == "__main__":
    main()
