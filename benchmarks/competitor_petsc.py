"""PETSc's conjugate gradients with hypre on a matrix from a file; started by competitors.py, also under mpirun.

    python competitor_petsc.py GIVEN.npz FOUND.npz TOLERANCE

Needs petsc4py with hypre and numpy only.  Prints a line of JSON: seconds of set-up and solve, and iterations.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
from petsc4py import PETSc


def main() -> None:
    given, found, tolerance = sys.argv[1], sys.argv[2], float(sys.argv[3])
    data = np.load(given)
    indptr, indices, values, load = (data[key] for key in ("indptr", "indices", "data", "load"))
    n, block = load.size, int(data["block"])
    nodes = n // block
    comm = PETSc.COMM_WORLD
    own = [nodes * rank // comm.size * block for rank in range(comm.size + 1)]
    own[-1] = n
    low, high = own[comm.rank], own[comm.rank + 1]
    start = indptr[low : high + 1] - indptr[low]
    part = slice(indptr[low], indptr[high])
    csr = (start.astype(PETSc.IntType), indices[part].astype(PETSc.IntType), values[part])
    size = ((high - low, n), (high - low, n))
    matrix = PETSc.Mat().createAIJ(size=size, bsize=block, csr=csr, comm=comm)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    b = PETSc.Vec().createMPI((high - low, n), comm=comm)
    b.setArray(load[low:high])
    x = b.duplicate()
    solver = PETSc.KSP().create(comm)
    solver.setOperators(matrix)
    solver.setType("cg")
    solver.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    solver.setTolerances(rtol=tolerance, max_it=500)
    preconditioner = solver.getPC()
    preconditioner.setType("hypre")
    preconditioner.setHYPREType("boomeramg")
    options = PETSc.Options()
    options["pc_hypre_boomeramg_numfunctions"] = block
    options["pc_hypre_boomeramg_strong_threshold"] = 0.25
    solver.setFromOptions()
    comm.barrier()
    began = time.perf_counter()
    solver.setUp()
    comm.barrier()
    ready = time.perf_counter()
    solver.solve(b, x)
    comm.barrier()
    solved = time.perf_counter()
    scatter, whole = PETSc.Scatter.toZero(x)
    scatter.scatter(x, whole)
    if comm.rank == 0:
        np.savez(found, u=whole.getArray())
        record = {"setup": ready - began, "solve": solved - ready, "iterations": solver.getIterationNumber()}
        print(json.dumps(record))


if __name__ == "__main__":
    main()
