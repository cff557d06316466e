"""The linear elastic problem behind the survey's data (5.1), solved by whatever is installed.

    python benchmarks/competitors.py --dim 2 --sizes 128 256
    python benchmarks/competitors.py --dim 3 --sizes 16 32 --petsc-python /usr/bin/python3

The unit square (or cube) with lambda = mu = 4, clamped on the left, under the body force (-0.8, -0.8) (or (-0.8, 0,
-0.8)), without a foundation.  NGSolve takes its own structured mesh, made by refining a coarse one, so that its
multigrid is geometric; in 2D it is our ``left`` pattern, so that all solve the same problem, which ``energy`` shows.
In 3D its tetrahedra are others than those of our box.  The solvers that take a matrix take ours.

Every function returns a dict of ``seconds_setup``, ``seconds_solve``, ``iterations`` (0 for a direct solver),
``unknowns``, ``residual`` (relative) and ``energy`` (half the work of the load), or a :class:`Missing` with the reason.
Set-up is all that is done once for a matrix: hierarchy, smoothers, analysis and factorisation.  NGSolve sets its
smoothers up while it assembles, so that its set-up is part of its ``seconds_assembly``.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from common import show

import hemivar as hv

__all__ = ["COMPETITORS", "Missing", "elastic_problem", "hypre", "ngsolve_multigrid", "pardiso", "superlu"]

_LAME = 4.0
_TOLERANCE = 1e-10


@dataclass(frozen=True)
class Missing:
    """Why a competitor was not run."""

    reason: str


Outcome = dict[str, Any] | Missing


def elastic_problem(n: int, dim: int) -> hv.DiscreteProblem:
    """Our own discretisation, with a foundation that does nothing."""
    mesh = hv.rectangle((1.0, 1.0), n, pattern="left") if dim == 2 else hv.box((1.0, 1.0, 1.0), n)
    return hv.discretize(
        hv.ContactProblem(
            mesh=mesh,
            material=hv.Material.lame(_LAME, _LAME),
            supports={"left": hv.Clamped()},
            contact={},
            body_force=_force(dim),
        )
    )


def _force(dim: int) -> tuple[float, ...]:
    return (-0.8, -0.8) if dim == 2 else (-0.8, 0.0, -0.8)


def _outcome(
    K: sp.csr_array, f: np.ndarray, u: np.ndarray, setup: float, solve: float, iterations: int = 0
) -> dict[str, Any]:
    residual = float(np.linalg.norm(f - K @ u) / np.linalg.norm(f))
    return {
        "seconds_setup": setup,
        "seconds_solve": solve,
        "iterations": iterations,
        "unknowns": f.size,
        "residual": residual,
        "energy": 0.5 * float(f @ u),
    }


def superlu(problem: hv.DiscreteProblem) -> Outcome:
    """SciPy's SuperLU with minimum degree."""
    from hemivar.linear.factor_memory import available_bytes, factorisation_bytes

    needed, free = 1.3 * factorisation_bytes(problem.unknowns, problem.contact.components, 0), available_bytes()
    if free is not None and needed > free:
        return Missing(f"needs {needed / 2**30:.1f} GiB, {free / 2**30:.1f} GiB are free")
    K, f = problem.stiffness, problem.load
    began = time.perf_counter()
    factor = spla.splu(
        sp.csc_array(K), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    factored = time.perf_counter()
    u = factor.solve(f)
    return _outcome(K, f, u, factored - began, time.perf_counter() - factored)


def pardiso(problem: hv.DiscreteProblem) -> Outcome:
    """PARDISO of MKL through pypardiso, symmetric positive definite, with all cores."""
    try:
        import pypardiso
    except Exception as error:
        return Missing(f"pypardiso cannot be imported: {error}")
    K, f = problem.stiffness, problem.load
    upper = sp.csr_matrix(sp.triu(K))
    solver = pypardiso.PyPardisoSolver(mtype=2)
    began = time.perf_counter()
    try:
        solver.set_phase(12)
        solver._call_pardiso(upper, f)
        factored = time.perf_counter()
        solver.set_phase(33)
        u = solver._call_pardiso(upper, f)
        solved = time.perf_counter()
    except Exception as error:
        return Missing(f"PARDISO failed: {error}")
    finally:
        solver.free_memory(everything=True)
    return _outcome(K, f, np.asarray(u), factored - began, solved - factored)


def hypre(problem: hv.DiscreteProblem, interpreter: str = sys.executable, ranks: int = 1) -> Outcome:
    """PETSc's conjugate gradients with hypre's BoomerAMG, in a process of the interpreter that has petsc4py.

    More than one rank needs ``mpirun``; the times are those of the slowest one.
    """
    K, f = problem.stiffness, problem.load
    field = problem.field
    assert field is not None
    with tempfile.TemporaryDirectory() as folder:
        given, found = Path(folder) / "given.npz", Path(folder) / "found.npz"
        np.savez(given, indptr=K.indptr, indices=K.indices, data=K.data, load=f, block=problem.contact.components)
        launcher = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
        script = Path(__file__).with_name("competitor_petsc.py")
        command = [*launcher, interpreter, str(script), str(given), str(found), str(_TOLERANCE)]
        try:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
        except OSError as error:
            return Missing(f"{interpreter}: {error.strerror}")
        if done.returncode:
            return Missing((done.stderr.strip().splitlines() or ["no message"])[-1])
        answer = json.loads(done.stdout.strip().splitlines()[-1])
        u = np.load(found)["u"]
    return _outcome(K, f, u, answer["setup"], answer["solve"], answer["iterations"])


def ngsolve_multigrid(n: int, dim: int, threads: int = 2) -> Outcome:
    """NGSolve's geometric multigrid as a preconditioner of conjugate gradients, on its own mesh of the same n.

    The mesh is a structured one of n/2^k cells, refined k times; the hierarchy is that of the refinement.
    """
    try:
        import ngsolve as ng
        from ngsolve.meshes import MakeStructured2DMesh, MakeStructured3DMesh
    except Exception as error:
        return Missing(f"ngsolve cannot be imported: {error}")
    coarsest = 8 if dim == 2 else 4
    cells, levels = n, 0
    while cells % 2 == 0 and cells > coarsest:
        cells, levels = cells // 2, levels + 1
    if cells > 2 * coarsest:
        return Missing(f"n = {n} has too few factors of two for a hierarchy")
    ng.SetNumThreads(threads)
    ng.ngsglobals.msg_level = 0
    if dim == 2:
        mesh = MakeStructured2DMesh(quads=False, nx=cells, ny=cells)
        clamped = "left"
    else:
        mesh = MakeStructured3DMesh(hexes=False, nx=cells, ny=cells, nz=cells)
        clamped = "back"  # x = 0 in NGSolve's names
    with ng.TaskManager():
        began = time.perf_counter()
        space = ng.VectorH1(mesh, order=1, dirichlet=clamped)
        u, v = space.TnT()
        strain = ng.Sym(ng.Grad(u))
        a = ng.BilinearForm(space, symmetric=True)
        a += (2.0 * _LAME * ng.InnerProduct(strain, ng.Grad(v)) + _LAME * ng.div(u) * ng.div(v)) * ng.dx
        f = ng.LinearForm(ng.InnerProduct(ng.CF(_force(dim)), v) * ng.dx)
        preconditioner = ng.preconditioners.MultiGrid(a, smoother="point")
        a.Assemble()
        for _ in range(levels):
            mesh.ngmesh.Refine()
            space.Update()
            a.Assemble()
        f.Assemble()
        assembled = time.perf_counter()
        preconditioner.Update()
        ready = time.perf_counter()
        solution = ng.GridFunction(space)
        free = ng.Projector(space.FreeDofs(), True)
        iterations = _conjugate_gradients(ng, a.mat, preconditioner.mat, f.vec, solution.vec, free)
        solved = time.perf_counter()
        rest, load = f.vec.CreateVector(), f.vec.CreateVector()
        rest.data = f.vec - a.mat * solution.vec
        load.data = f.vec
        free.Project(rest)
        free.Project(load)
        residual = ng.Norm(rest) / ng.Norm(load)
        energy = 0.5 * float(ng.InnerProduct(f.vec, solution.vec))
    return {
        "seconds_setup": ready - assembled,
        "seconds_solve": solved - ready,
        "iterations": iterations,
        "unknowns": int(sum(space.FreeDofs())),
        "residual": float(residual),
        "energy": energy,
        "seconds_assembly": assembled - began,
    }


def _conjugate_gradients(ng: Any, A: Any, C: Any, b: Any, x: Any, free: Any, limit: int = 200) -> int:
    """As NGSolve's own, but stopped by the residual itself instead of by its preconditioned norm."""
    r, z, p, Ap = (b.CreateVector() for _ in range(4))
    x[:] = 0.0
    r.data = b
    free.Project(r)
    goal = _TOLERANCE * ng.Norm(r)
    z.data = C * r
    p.data = z
    rho = ng.InnerProduct(r, z)
    count = 0
    while count < limit:
        count += 1
        Ap.data = A * p
        free.Project(Ap)
        alpha = rho / ng.InnerProduct(p, Ap)
        x.data += alpha * p
        r.data -= alpha * Ap
        if ng.Norm(r) <= goal:
            break
        z.data = C * r
        rho, before = ng.InnerProduct(r, z), rho
        p *= rho / before
        p.data += z
    return count


#: Solvers that take our matrix.
COMPETITORS = {"superlu": superlu, "pardiso": pardiso}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dim", type=int, choices=(2, 3), default=2)
    parser.add_argument("--sizes", type=int, nargs="+", default=[64, 128, 256])
    parser.add_argument("--petsc-python", default=sys.executable, help="a Python that has petsc4py with hypre")
    parser.add_argument("--ranks", type=int, default=1, help="MPI processes for PETSc")
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    options = parser.parse_args()
    rows = []
    for n in options.sizes:
        problem = elastic_problem(n, options.dim)
        outcomes: dict[str, Outcome] = {name: solve(problem) for name, solve in COMPETITORS.items()}
        outcomes["petsc hypre"] = hypre(problem, options.petsc_python, options.ranks)
        for threads in (1, 2):
            outcomes[f"ngsolve multigrid, threads: {threads}"] = ngsolve_multigrid(n, options.dim, threads)
        for name, found in outcomes.items():
            if isinstance(found, Missing):
                print(f"{name}, n = {n}: {found.reason}", file=sys.stderr)
                continue
            keys = ("unknowns", "seconds_setup", "seconds_solve", "iterations", "residual")
            rows.append(
                {"solver": name, "dim": options.dim, "n": n}
                | {key: found[key] for key in keys}
                | {"energy": f"{found['energy']:.12g}"}
            )
    if rows:
        show(rows, options.json)


if __name__ == "__main__":
    main()
