"""What the certificate costs, against the solve that it is about.

    python benchmarks/certificate.py --dim 2 --sizes 128 256 512 1024
    python benchmarks/certificate.py --dim 3 --sizes 16 32 48 --law weakening --json rows.json

``solve_s`` is all of ``hv.solve`` by nonsmooth multigrid to a relative residual of 1e-10, ``certify_s`` all of
``hemivar.certify`` for its solution, without the survey's trace constant.  The hierarchy serves both and is in
neither.  Both run in turn on one thread, and the smallest time of each counts, in seconds of the processor, which a
busy machine disturbs little.  ``cycles`` are those of the certificate on any level;
``bound`` is the bound of the distance to the exact discrete solution, relative to the solution.
"""

from __future__ import annotations

import argparse
import gc
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

from common import peak_mib, show
from overhead import PROBLEMS, TOLERANCE

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.certificates import certify
from hemivar.linear.levels import Truncated


@contextmanager
def counted() -> Iterator[list[int]]:
    """The levels of all cycles that are done meanwhile."""
    seen: list[int] = []
    cycle, fast = Truncated.cycle, Truncated.fast_cycle

    def noted(self: Truncated, k: int, right: Array) -> Array:
        seen.append(k)
        return cycle(self, k, right)

    def noted_fast(self: Truncated, k: int, right: Array) -> Array:
        seen.extend([k] if self.single and k else [])  # else it is the other
        return fast(self, k, right)

    with patch.object(Truncated, "cycle", noted), patch.object(Truncated, "fast_cycle", noted_fast):
        yield seen


def measure(dim: int, law: str, n: int, repeats: int) -> dict[str, Any]:
    """One row of the table."""
    problem = hv.discretize(PROBLEMS[dim, law](n))
    workspace = hv.systems.Workspace()
    method, controls = hv.solvers.NonsmoothMultigrid(tolerance=TOLERANCE / 2), hv.Controls(rtol=TOLERANCE)
    solves, certificates = [], []
    for _ in range(repeats):
        gc.collect()
        start = time.process_time()
        solution = hv.solve(problem, method, controls, workspace=workspace)
        middle = time.process_time()
        with counted() as cycles:
            certificate = certify(
                problem, solution.unknowns, solution.multiplier, trace_constant=False, workspace=workspace
            )
        solves.append(middle - start)
        certificates.append(time.process_time() - middle)
    return {
        "dim": dim,
        "law": law,
        "n": n,
        "unknowns": problem.unknowns,
        "solve_s": min(solves),
        "certify_s": min(certificates),
        "ratio": min(certificates) / min(solves),
        "by": certificate.method,
        "cycles": len(cycles),
        "margin": certificate.margin,
        "kind": certificate.kind.value,
        "bound": certificate.error_bound_relative,
        "status": solution.status.value,
        "peak_mib": peak_mib(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dim", type=int, choices=(2, 3), default=2)
    parser.add_argument("--sizes", type=int, nargs="+", default=None, help="cells along a side, 1/h")
    parser.add_argument("--law", choices=("survey", "weakening"), nargs="+", default=["survey", "weakening"])
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    sizes = options.sizes or ((128, 256, 512) if options.dim == 2 else (16, 32, 48))
    rows = [measure(options.dim, law, n, options.repeats) for n in sizes for law in options.law]
    show(rows, options.json)


if __name__ == "__main__":
    main()
