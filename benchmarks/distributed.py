"""Contact against a linear solve over ranks, strong and weak scaling, and what PETSc sends; run it by mpirun.

    mpirun -n 2 python benchmarks/distributed.py --cells 64              # one line of the table in docs/evidence.md
    mpirun -n 2 python benchmarks/distributed.py --cells 64 --log log.txt  # with PETSc's own account of messages

The linear problem is the same body under the same load and supports without a foundation, from zero, by PETSc's
conjugate gradients with the same multigrid. Both times are from assembled matrices to the end, set-up of
multigrid included; that of contact includes the coarser meshes that it starts from.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from typing import Any

import numpy as np
from petsc4py import PETSc

import hemivar as hv
from hemivar.mesh.mesh import Mesh
from hemivar.ranks import assemble, family, solve_distributed, world
from hemivar.ranks.body_on_ranks import BodyOnRanks
from hemivar.ranks.preconditioner import Multigrid
from hemivar.ranks.ranks import Ranks
from hemivar.solvers import Controls


def statement(mesh: Mesh) -> hv.ContactProblem:
    """The cube of examples/problems/cube_friction.toml."""
    return hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.lame(4.0, 4.0),
        supports={"left": hv.Clamped()},
        contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(q_max=0.3, p_const=2.0), hv.Tresca(0.5))},
        body_force=(-0.8, -0.4, -0.8),
    )


def linear(body: BodyOnRanks, rtol: float) -> dict[str, Any]:
    """PETSc's conjugate gradients with the multigrid of the contact solver."""
    body.ranks.mpi.Barrier()
    began = time.perf_counter()
    cycle = Multigrid(body)
    cycle.build(np.zeros(body.unknown.size, dtype=bool), np.zeros((*body.active.shape, body.dim)))
    ready = time.perf_counter()
    iterations, _ = _conjugate_gradients(body, cycle.pc, rtol, 200)
    end = time.perf_counter()
    cycle.release()
    return {"linear": end - began, "linear_setup": ready - began, "linear_iterations": iterations}


def _conjugate_gradients(body: BodyOnRanks, pc: Any, rtol: float, limit: int) -> tuple[int, float]:
    began = time.perf_counter()
    ksp = PETSc.KSP().create(body.ranks.comm)
    ksp.setOptionsPrefix("linear_")
    ksp.setType("cg")
    ksp.setOperators(body.K)
    ksp.setPC(pc)
    ksp.setNormType(PETSc.KSP.NormType.UNPRECONDITIONED)
    ksp.setTolerances(rtol=rtol, atol=1e-300, max_it=limit)
    ksp.solve(body.vector(body.load), body.vector())
    iterations = ksp.getIterationNumber()
    ksp.destroy()
    return iterations, time.perf_counter() - began


def plain(body: BodyOnRanks, iterations: int = 50) -> float:
    """Seconds of an iteration of conjugate gradients with the diagonal: what the memory bandwidth allows."""
    pc = PETSc.PC().create(body.ranks.comm)
    pc.setType("jacobi")
    pc.setOperators(body.K)
    pc.setUp()
    body.ranks.mpi.Barrier()
    done, seconds = _conjugate_gradients(body, pc, 1e-300, iterations)
    return seconds / max(done, 1)


def measure(ranks: Ranks, cells: tuple[int, int, int], rtol: float) -> dict[str, Any]:
    """One line: the box with these numbers of cells."""
    extent = tuple(n / max(cells[1:]) for n in cells)

    def begin(times: int) -> Mesh:
        a, b, c = (n >> times for n in cells)
        return hv.box((extent[0], extent[1], extent[2]), (a, b, c))

    halvings = 0
    while all(n % 2 ** (halvings + 1) == 0 and n >> (halvings + 1) >= 2 for n in cells):
        halvings += 1
    began = time.perf_counter()
    pieces = family(ranks, begin, halvings)
    meshed = time.perf_counter()
    bodies: list[BodyOnRanks] = []
    for piece in pieces:
        bodies.append(assemble(ranks, piece, statement, coarser=bodies[-1] if bodies else None))
    assembled = time.perf_counter()
    line: dict[str, Any] = {"ranks": ranks.size, "cells": cells, "unknowns": bodies[-1].unknowns}
    line |= {"mesh": meshed - began, "assemble": assembled - meshed}
    line["plain_iteration"] = plain(bodies[-1])
    line |= linear(bodies[-1], rtol)
    before = dict(ranks.counts)
    ranks.mpi.Barrier()
    began = time.perf_counter()
    solution = solve_distributed(bodies[-1], None, Controls(rtol=rtol))
    line["contact"] = time.perf_counter() - began
    line |= {
        "status": solution.status.value,
        "steps": solution.steps,
        "cycles": solution.evaluations,
        "energy": solution.energy,
    }
    line["overhead"] = line["contact"] / line["linear"]
    line["reductions"] = ranks.counts["reductions"] - before["reductions"]
    line["exchanges"] = ranks.counts["exchanges"] - before["exchanges"]
    line["peak_GiB"] = float(ranks.total(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20)[0])
    line["residual"] = solution.residual.relative
    return line


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, nargs="+", default=[32], help="one number, or three")
    parser.add_argument("--rtol", type=float, default=1e-9)
    parser.add_argument("--log", help="file for PETSc's account of the whole run")
    given = parser.parse_args()
    a, b, c = given.cells if len(given.cells) == 3 else given.cells[:1] * 3
    if given.log:
        PETSc.Log.begin()
    ranks = world()
    line = measure(ranks, (a, b, c), given.rtol)
    if given.log:
        PETSc.Log.view(PETSc.Viewer().createASCII(given.log, comm=ranks.comm))
    if ranks.rank == 0:
        print(json.dumps({k: round(v, 4) if isinstance(v, float) and v > 1e-4 else v for k, v in line.items()}))


if __name__ == "__main__":
    main()
