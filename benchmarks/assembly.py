"""What it takes to set up a problem, beside the linear elastic solve that follows.

    python benchmarks/assembly.py --dim 2 --sizes 512 1024
    python benchmarks/assembly.py --dim 3 --sizes 32 64 --library --json rows.json

``mesh_s`` is the built-in mesh with its edges; ``discretize_s`` all of ``hv.discretize`` on it, of which
``stiffness_s`` goes into the stiffness, ``load_s`` into the load and ``held_s`` into the check that something holds the
body, and the rest into supports and contact points.  ``hierarchy_s`` covers meshes and matrices of all coarser levels,
and the blocks of the compiled kernels.  All seconds are those of the processor.
``linear_s`` is the body without its foundation by conjugate gradients around the multigrid cycle, to a relative
residual of 1e-10.  Of ``--repeats`` runs the smallest times count, and ``ratio`` is all of the set-up over
``linear_s``; ``first_ratio`` is the same of the first run, which also pays for fresh memory: seconds of the operating
system, up to three quarters of all on a virtual machine that has to get it first.  ``peak_mib`` is the
memory of the process after the first run, ``base_mib`` that of its libraries.

``--library`` adds the time of the same stiffness by scikit-fem (``library_s``), measured after everything else.
"""

from __future__ import annotations

import argparse
import gc
import json
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import skfem
from common import peak_mib, show
from skfem.models.elasticity import linear_elasticity

import hemivar as hv
from hemivar import gallery
from hemivar.fem.edge_blocks import EdgeBlocks
from hemivar.systems.body_on_levels import ElasticMultigrid

TOLERANCE = 1e-10
PROBLEMS = {2: lambda n: gallery.survey("5.1", n, "right"), 3: lambda n: gallery.survey_cube("5.1", n)}
DISCRETIZE = sys.modules["hemivar.fem.discretize"]
PARTS = {
    "stiffness_s": ((DISCRETIZE, "body_blocks"), (EdgeBlocks, "matrix"), (EdgeBlocks, "turn")),
    "load_s": ((DISCRETIZE, "stated_load"),),
    "held_s": ((DISCRETIZE, "refuse_free_motion"),),
}


@contextmanager
def watched(spent: dict[str, float]) -> Any:
    """Count the seconds spent in the functions of ``PARTS``."""
    originals = []

    def timed(function: Callable[..., Any], name: str) -> Callable[..., Any]:
        def call(*given: Any, **named: Any) -> Any:
            start = time.process_time()
            try:
                return function(*given, **named)
            finally:
                spent[name] = spent.get(name, 0.0) + time.process_time() - start

        return call

    for name, places in PARTS.items():
        for owner, attribute in places:
            originals.append((owner, attribute, getattr(owner, attribute)))
            setattr(owner, attribute, timed(getattr(owner, attribute), name))
    try:
        yield spent
    finally:
        for owner, attribute, function in originals:
            setattr(owner, attribute, function)


def measure(dim: int, n: int, repeats: int, library: bool) -> dict[str, Any]:
    """One row of the table."""
    small = hv.discretize(PROBLEMS[dim](8))
    ElasticMultigrid.of(small).solve(small.load)  # loads all libraries
    base = peak_mib()
    best: dict[str, float] = {}
    first: dict[str, float] = {}
    for _ in range(repeats):
        gc.collect()
        spent: dict[str, float] = {}
        start = time.process_time()
        statement = PROBLEMS[dim](n)
        _ = statement.mesh.edges
        meshed = time.process_time()
        with watched(spent):
            problem = hv.discretize(statement)
        discretized = time.process_time()
        hierarchy = ElasticMultigrid.of(problem)
        _ = hierarchy.levels.compiled
        ready = time.process_time()
        _, cycles = hierarchy.solve(problem.load, TOLERANCE)
        spent |= {
            "mesh_s": meshed - start,
            "discretize_s": discretized - meshed,
            "hierarchy_s": ready - discretized,
            "linear_s": time.process_time() - ready,
        }
        best = {name: min(value, best.get(name, value)) for name, value in spent.items()}
        if not first:
            first, peak, unknowns = spent, peak_mib(), problem.unknowns
        del statement, problem, hierarchy
    total, at_first = (run["mesh_s"] + run["discretize_s"] + run["hierarchy_s"] for run in (best, first))
    order = ("mesh_s", "discretize_s", *PARTS, "hierarchy_s", "linear_s")
    row: dict[str, Any] = {"dim": dim, "n": n, "unknowns": unknowns} | {name: best[name] for name in order}
    row |= {"setup_s": total, "ratio": total / best["linear_s"], "first_ratio": at_first / first["linear_s"]}
    row["cycles"] = cycles
    row |= {"base_mib": base, "peak_mib": peak, "bytes_per_unknown": (peak - base) * 1024**2 / unknowns}
    if library:
        statement = PROBLEMS[dim](n)
        start = time.process_time()
        mesh, kinds = statement.mesh, {2: (skfem.MeshTri, skfem.ElementTriP1), 3: (skfem.MeshTet, skfem.ElementTetP1)}
        theirs = kinds[dim][0](np.ascontiguousarray(mesh.points.T), np.ascontiguousarray(mesh.cells.T))
        linear_elasticity(4.0, 4.0).assemble(skfem.Basis(theirs, skfem.ElementVector(kinds[dim][1]())))
        row["library_s"] = time.process_time() - start
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dim", type=int, choices=(2, 3), default=3)
    parser.add_argument("--sizes", type=int, nargs="+", default=None, help="cells along a side, 1/h")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--library", action="store_true", help="time scikit-fem's own assembly as well")
    parser.add_argument("--json", type=Path, default=None)
    parser.add_argument("--row", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    sizes = options.sizes or ((512, 1024) if options.dim == 2 else (32, 64))
    if options.row:
        print(json.dumps(measure(options.dim, sizes[0], options.repeats, options.library)))
        return
    rows = []
    for n in sizes:  # a process each, so that the peak of one does not hide that of the next
        command = [sys.executable, __file__, "--row", "--dim", str(options.dim), "--sizes", str(n)]
        command += ["--repeats", str(options.repeats)] + ["--library"] * options.library
        rows.append(json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout))
    show(rows, options.json)


if __name__ == "__main__":
    main()
