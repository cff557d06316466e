"""Assembly, condensation and solve on the survey's square, data (5.1): seconds and memory for each stage.

    python benchmarks/condensation.py --sizes 64 128 256

``factor_s`` is the plain sparse factorisation of the same matrix by the same library (SuperLU, minimum degree), without
any Schur complement: what one linear elastic solve costs at least.  Assembly includes the mesh and the supports.
``contact_ratio`` is all that follows the assembly (condensation, Newton steps, recovery), divided by ``factor_s``.
"""

from __future__ import annotations

import time

import scipy.sparse as sp
import scipy.sparse.linalg as spla
from common import arguments, peak_mib, show

import hemivar as hv
from hemivar.gallery import survey
from hemivar.linear.pardiso import pardiso_available


def main() -> None:
    options = arguments(__doc__ or "", (64, 128, 256))
    rows = []
    for n in options.sizes:
        began = time.perf_counter()
        problem = survey("5.1", n)
        meshed = time.perf_counter()
        discrete = hv.discretize(problem)
        assembled = time.perf_counter()
        solution = hv.solve(discrete)
        solved = time.perf_counter()
        memory = peak_mib()
        K = sp.csc_array(discrete.stiffness)
        start = time.perf_counter()
        spla.splu(K, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        factor = time.perf_counter() - start
        rows.append(
            {
                "n": n,
                "unknowns": discrete.unknowns,
                "mesh_s": meshed - began,
                "assembly_s": assembled - meshed,
                "condense_s": solution.timings["condense"],
                "iterate_s": solution.timings["iterate"],
                "recover_s": solution.timings["recover"],
                "factor_s": factor,
                "contact_ratio": (solved - assembled) / factor,
                "steps": solution.steps,
                "residual": solution.residual.relative,
                "peak_mib": memory,
                "factorisation": "pardiso" if pardiso_available() else "superlu",
            }
        )
    show(rows, options.json)


if __name__ == "__main__":
    main()
