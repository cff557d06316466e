"""Memory of the condensation: measured against the model of ``hemivar.linear.factor_memory``.

    python benchmarks/factor_memory.py --json factor_memory.json
    python benchmarks/factor_memory.py --dim 3 --sizes 8 16 24

Every row is a process of its own: the survey's square with data (5.1), a clamped cube on a foundation, and thin
plates whose contact takes most of the unknowns.  ``condense_mib`` and ``solve_mib`` are the growth of the resident
memory from the assembled problem to the largest during the factorisation with its Schur complement, and to the largest
until the end of the solve; ``model_mib`` is what ``factorisation_bytes`` predicts.  At the end, the coefficients that
the rows ask for.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from common import show

_MIB = 2.0**20


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--dim", type=int, nargs="+", choices=(2, 3), default=[2, 3], help="dimensions")
    parser.add_argument("--sizes", type=int, nargs="+", default=None, help="cells along a side")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    parser.add_argument("--row", nargs=4, default=None, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.row is not None:
        shape, dim, cells, layers = options.row
        print(json.dumps(_row(shape, int(dim), int(cells), int(layers))))
        return
    cases: list[tuple[str, int, int, int]] = []
    if 2 in options.dim:
        cases += [("square", 2, n, n) for n in options.sizes or (32, 64, 128, 256)]
    if 3 in options.dim:
        cases += [("cube", 3, n, n) for n in options.sizes or (6, 8, 12, 16, 20, 24)]
        cases += [] if options.sizes else [("plate", 3, n, 2) for n in (16, 24, 32)]
    rows = []
    for case in cases:
        command = [sys.executable, __file__, "--row", *map(str, case)]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"{case}: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
            continue
        rows.append(json.loads(done.stdout.splitlines()[-1]))
    show(rows, options.json)
    _fit(rows)


def _row(shape: str, dim: int, cells: int, layers: int) -> dict[str, Any]:
    import hemivar as hv
    from hemivar.gallery import survey
    from hemivar.linear.factor_memory import factorisation_bytes
    from hemivar.linear.factorisation import SuperLUFactorisation
    from hemivar.linear.pardiso import pardiso_available
    from hemivar.systems import condense

    problem = survey("5.1", cells) if dim == 2 else _block(cells, layers)
    discrete = hv.discretize(problem)
    contact = int(np.unique(discrete.contact.trace.indices).size)
    base = _status("VmRSS")
    Path("/proc/self/clear_refs").write_text("5")  # the largest memory so far is forgotten
    began = time.perf_counter()
    condensed = condense(discrete)
    seconds = time.perf_counter() - began
    condensing = _status("VmHWM") - base
    hv.solve(discrete, workspace=hv.systems.Workspace.holding(condensed))
    solving = _status("VmHWM") - base
    factor = condensed.body.factor
    fill = factor._factor.nnz if isinstance(factor, SuperLUFactorisation) else 0
    return {
        "shape": shape,
        "dim": dim,
        "n": cells,
        "unknowns": discrete.unknowns,
        "contact": contact,
        "fill": fill,
        "condense_s": seconds,
        "condense_mib": condensing / _MIB,
        "solve_mib": solving / _MIB,
        "model_mib": factorisation_bytes(discrete.unknowns, dim, contact) / _MIB,
        "factorisation": "pardiso" if pardiso_available() else "superlu",
    }


def _block(cells: int, layers: int) -> Any:
    import hemivar as hv

    mesh = hv.box((1.0, 1.0, layers / cells), (cells, cells, layers))
    return hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Clamped()},
        contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(q_max=0.3, p_const=2.0), hv.Tresca(0.5))},
        body_force=(-0.8, 0.0, -0.8),
    )


def _status(key: str) -> float:
    """A line of /proc/self/status, in bytes."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024.0 * float(line.split()[1]) for line in lines if line.startswith(f"{key}:"))


def _fit(rows: Sequence[dict[str, Any]]) -> None:
    """Least squares, relative: factors over n log2 n (2D) or n^1.5 (3D), the rest over the square of the contact."""
    for dim in (2, 3):
        chosen = [row for row in rows if row["dim"] == dim]
        if len(chosen) < 3:
            continue
        n = np.array([row["unknowns"] for row in chosen], dtype=float)
        k = np.array([row["contact"] for row in chosen], dtype=float)
        growth = n * np.log2(n) if dim == 2 else n**1.5
        used = _MIB * np.array([row["solve_mib"] for row in chosen])
        columns = np.stack([growth, 8.0 * k**2], axis=1) / used[:, None]
        (factor, dense), *_ = np.linalg.lstsq(columns, np.ones(len(chosen)), rcond=None)
        worst = 100.0 * float(np.abs(columns @ np.array([factor, dense]) - 1.0).max())
        print(f"{dim}D: {factor:.3g} bytes x growth + {dense:.3g} dense matrices; off by at most {worst:.0f} %")
        ratios = (f"{_MIB * row['model_mib'] / size:.2f}" for row, size in zip(chosen, used, strict=True))
        print(f"    model / measured: {', '.join(ratios)}")


if __name__ == "__main__":
    main()
