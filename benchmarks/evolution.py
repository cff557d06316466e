"""What a step of an evolution costs beside a linear implicit step of the same body.

    python benchmarks/evolution.py
    python benchmarks/evolution.py --parts direct overhead --steps 50 --json rows.json

Each row marches a body with mass and viscosity by implicit Euler, with a fixed step and a constant load, and beside it,
in turn, the same body without its foundation: the same matrices, scheme and step, started from the same prediction, to
the same tolerance.  ``linear_ms`` is a step of the latter: one back-substitution with a factorisation of the same
matrix by the same library, or conjugate gradients around a cycle of the same hierarchy, and the products with stiffness
and viscosity that make its load.  ``swept_ms`` is the same where the back-substitution is that of the march: with
SuperLU the march sweeps through factors that are laid out for it, which is faster than SuperLU's own solve.
``step_ms`` is a step of the march, with its residual, margin, ledger and row.  What is paid once (mesh, matrices,
factors, levels) is in neither.  Every step does the same work in every repeat: of each the shortest time counts, and
the mean of these is printed.  BLAS takes one thread if ``OMP_NUM_THREADS=1`` is set.

``strip`` is the body with a quarter of its height: what is left of ``beyond_ms`` where the body is small.

``direct`` condenses the body onto its contact points, ``multigrid`` works on all unknowns.  ``overhead`` is about the
direct rows: ``beyond_ms`` is a step without the time that passes inside of sparse solves.  ``memory`` holds what Python
and NumPy have allocated in a march of many steps against one of few, no frames being saved.  ``coulomb`` marches a body
under Coulomb's law and, in turn, under Tresca's: ``ratio`` is that of their steps, and ``newton`` and ``fallbacks`` are
those of Coulomb's.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import json
import sys
import time
import tracemalloc
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from common import show

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.evolution.discrete import DiscreteEvolution, StepMatrices, discretize_evolution
from hemivar.evolution.march import March, marching
from hemivar.evolution.save import Save
from hemivar.evolution.schemes import ImplicitEuler
from hemivar.linear import factorisation
from hemivar.linear.factorisation import factorise
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import LevelMatrix, Preconditioner
from hemivar.linear.pardiso import pardiso_available
from hemivar.linear.threads import one_thread
from hemivar.systems.body_on_levels import ElasticMultigrid

STEP = 0.01
RTOL = 1e-9
#: Marks: step over linear step, milliseconds beyond the solves, and a step of Coulomb's law over one of Tresca's.
MULTIGRID, SUPERLU, HALVES, BEYOND, COULOMB = 1.3, 2.2, 1.3, 2.0, 4.0
LAWS = {
    (2, "survey"): lambda n: gallery.survey("5.1", n, "right"),
    (2, "softening"): lambda n: gallery.survey_logarithmic(0.3, n, "right"),
    (2, "survey, strip"): lambda n: strip(gallery.survey("5.1", n, "right"), n),
    (2, "softening, strip"): lambda n: strip(gallery.survey_logarithmic(0.3, n, "right"), n),
    (3, "survey"): lambda n: gallery.survey_cube("5.1", n),
    (3, "softening"): lambda n: gallery.survey_cube_logarithmic(0.3, n),
}


def strip(problem: hv.ContactProblem, n: int) -> hv.ContactProblem:
    """A quarter of the height: as many contact points on a quarter of the unknowns."""
    return replace(problem, mesh=hv.rectangle((1.0, 0.25), (n, n // 4), pattern="right"))


def statement(dim: int, law: str, n: int) -> hv.Evolution:
    """One of the survey's bodies with mass and viscosity; ``bonding`` is its first with glue that breaks."""
    stated = LAWS[dim, "survey" if law == "bonding" else law](n)
    problem = replace(stated, material=replace(stated.material, density=1.0, viscosity=(0.4, 0.4)))
    if law == "bonding":
        glue = hv.Contact(hv.Compliance(50.0), hv.Tresca(0.05), memory=(hv.laws.Bonding(40.0, 1e-6, 1e-4),))
        problem = replace(problem, contact=dict.fromkeys(problem.contact, glue))
    return hv.Evolution(problem, inertia=True)


@dataclass
class Counted:
    """Sparse solves of condensed bodies, and cycles of multigrid."""

    newton: int = 0
    cycles: int = 0
    solves: float = 0.0
    seconds: float = 0.0
    factors: int = 0
    fallbacks: float = 0.0
    depth: int = field(default=0, repr=False)


@contextlib.contextmanager
def counting() -> Iterator[Counted]:
    """Count factorisations, and time what they are asked for, in this block."""
    counted = Counted()
    kinds: tuple[Any, ...] = (factorisation.PardisoFactorisation, factorisation.SuperLUFactorisation)
    names = ("solve_interior", "reduce", "extend", "__init__")
    kept = {(kind, name): getattr(kind, name) for kind in kinds for name in names if hasattr(kind, name)}

    def timed(original: Any) -> Any:
        def call(self: Any, *given: Any) -> Any:
            began = time.perf_counter()
            counted.depth += 1
            try:
                return original(self, *given)
            finally:
                counted.depth -= 1
                if not counted.depth:
                    counted.seconds += time.perf_counter() - began
                    counted.solves += 1

        return call

    def made(original: Any) -> Any:
        def call(self: Any, *given: Any) -> None:
            counted.factors += 1
            original(self, *given)

        return call

    for (kind, name), original in kept.items():
        setattr(kind, name, (made if name == "__init__" else timed)(original))
    cycle = Preconditioner.__call__

    def cycled(self: Any, *given: Any) -> Any:
        counted.cycles += 1
        return cycle(self, *given)

    Preconditioner.__call__ = cycled  # type: ignore[method-assign]
    try:
        yield counted
    finally:
        for (kind, name), original in kept.items():
            setattr(kind, name, original)
        Preconditioner.__call__ = cycle  # type: ignore[method-assign]


def stepped(discrete: DiscreteEvolution, steps: int, solver: hv.Solver | None) -> tuple[Array, Array, Counted]:
    """Seconds of every step of a march but the first, those outside of sparse solves, and what else is counted."""
    plan = March((steps + 1) * STEP, step=STEP, save=Save(every=10.0 * steps * STEP), method=solver,
                 controls=hv.Controls(rtol=RTOL))  # fmt: skip
    whole, beyond = [], []
    with counting() as counted:
        run = marching(discrete, plan)
        next(run)
        counted.solves = counted.factors = counted.cycles = 0
        gc.collect()
        gc.disable()
        for _ in range(steps):
            counted.seconds, began = 0.0, time.perf_counter()
            row = next(run).row
            whole.append(time.perf_counter() - began)
            beyond.append(whole[-1] - counted.seconds)
            counted.newton += row.solver_steps
            counted.fallbacks += row.values.get("fallbacks", 0.0)
        gc.enable()
    return np.array(whole), np.array(beyond), counted


class Linear:
    """The same body without its foundation."""

    def __init__(self, discrete: DiscreteEvolution, multigrid: bool) -> None:
        self.discrete = discrete
        rule = ImplicitEuler().rules(STEP)[0]
        problem = StepMatrices(discrete).body(rule.rate.difference, rule.acceleration.difference)
        self.matrix = problem.stiffness
        self.load = discrete.data_at(0.0).load[: discrete.unknowns]
        self.levels = ElasticMultigrid.of(problem) if multigrid else None
        none = np.zeros(0, dtype=np.int64)
        self.factor = None if multigrid else factorise(self.matrix, none)
        self.swept = None if multigrid else factorise(self.matrix, none, many=True)
        self.cycles = 0

    def march(self, steps: int, swept: bool = False) -> Array:
        """Seconds of every step but the first; by the sweeps of the march if ``swept``."""
        factor = self.swept if swept else self.factor
        n = self.discrete.unknowns
        u, v = np.zeros(n), np.zeros(n)
        K, C = self.discrete.stiffness.inner, self.discrete.viscosity.inner  # type: ignore[union-attr]
        size = float(np.linalg.norm(self.load))
        seconds = []
        for step in range(steps + 1):
            if step < 2:
                self.cycles = 0
            began = time.perf_counter()
            place = u + STEP * v
            rest = self.load - K @ place - C @ v
            if factor is not None:
                change = factor.solve_interior(rest)
            else:
                change = self._cycled(rest, RTOL * (size + float(np.linalg.norm(rest))))
            new = place + change
            u, v = new, (new - u) / STEP
            seconds.append(time.perf_counter() - began)
        return np.array(seconds[1:])

    def _cycled(self, rest: Array, tolerance: float) -> Array:
        assert self.levels is not None
        levels = self.levels.levels
        top = len(levels.levels) - 1
        with one_thread():
            cycle = levels.preconditioner(top)
            found = conjugate_gradients(
                LevelMatrix(levels, top), levels.diagonal(top), rest, cycle, tolerance, 100, flexible=cycle.flexible
            )
        self.cycles += found.iterations
        return found.solution


def compared(dim: int, law: str, n: int, steps: int, repeats: int, multigrid: bool) -> dict[str, Any]:
    """One row of the table."""
    discrete = discretize_evolution(statement(dim, law, n))
    linear = Linear(discrete, multigrid)
    solver: hv.Solver = hv.solvers.NonsmoothMultigrid() if multigrid else hv.solvers.NonsmoothNewton()
    alone, swept, whole, beyond = (np.full(steps, np.inf) for _ in range(4))
    for _ in range(repeats):  # every step does the same work in every repeat: of each the shortest
        alone = np.minimum(alone, linear.march(steps))
        if not multigrid:
            swept = np.minimum(swept, linear.march(steps, swept=True))
        all_of_it, rest, counted = stepped(discrete, steps, solver)
        whole, beyond = np.minimum(whole, all_of_it), np.minimum(beyond, rest)
    linear_ms, swept_ms, step_ms, beyond_ms = (1e3 * float(times.mean()) for times in (alone, swept, whole, beyond))
    ratio = step_ms / linear_ms
    mark = MULTIGRID if multigrid else HALVES if pardiso_available() else SUPERLU
    row = {
        "method": "multigrid" if multigrid else "PARDISO" if pardiso_available() else "SuperLU",
        "dim": dim,
        "law": law,
        "n": n,
        "unknowns": discrete.unknowns,
        "contact": discrete.problem.contact.trace.nnz,
        "linear_ms": linear_ms,
        "swept_ms": "" if multigrid else swept_ms,
        "step_ms": step_ms,
        "ratio": ratio,
        "mark": mark if multigrid or (n in (64, 128) and "strip" not in law) else "",
        "newton": counted.newton / steps,
        "solves": "" if multigrid else counted.solves / steps,
        "factors": "" if multigrid else counted.factors,
        "cycles": counted.cycles / steps if multigrid else "",
        "linear_cycles": linear.cycles / steps if multigrid else "",
        "beyond_ms": "" if multigrid else beyond_ms,
    }
    row["met"] = "" if row["mark"] == "" else "yes" if ratio <= mark else "no"
    if not multigrid and discrete.problem.contact.trace.nnz <= 256:
        row["met"] += (", " if row["met"] else "") + ("beyond " + ("yes" if beyond_ms <= BEYOND else "no"))
    print(json.dumps(row), file=sys.stderr)
    return row


def rubbing(dim: int, n: int, normal: hv.laws.Superpotential, friction: hv.laws.Friction) -> DiscreteEvolution:
    """One of the survey's bodies with mass and viscosity that rubs on a foundation."""
    stated = LAWS[dim, "survey"](n)
    material = replace(stated.material, density=1.0, viscosity=(0.4, 0.4))
    contact = dict.fromkeys(stated.contact, hv.Contact(normal, friction))
    return discretize_evolution(hv.Evolution(replace(stated, material=material, contact=contact), inertia=True))


def coulomb(dim: int, n: int, normal: hv.laws.Superpotential, steps: int, repeats: int) -> dict[str, Any]:
    """One row about Coulomb's law: its steps beside those of Tresca's."""
    bodies = [rubbing(dim, n, normal, hv.Tresca(bound)) for bound in (0.05, hv.laws.CoulombBound(0.3))]
    times = [np.full(steps, np.inf) for _ in bodies]
    for _ in range(repeats):
        for k, discrete in enumerate(bodies):
            found, _, counted = stepped(discrete, steps, None)
            times[k] = np.minimum(times[k], found)
    tresca_ms, coulomb_ms = (1e3 * float(found.mean()) for found in times)
    ratio = coulomb_ms / tresca_ms
    row = {
        "law": f"coulomb, {normal.name}",
        "dim": dim,
        "n": n,
        "contact": bodies[0].problem.contact.trace.nnz,
        "tresca_ms": tresca_ms,
        "coulomb_ms": coulomb_ms,
        "ratio": ratio,
        "mark": COULOMB,
        "newton": counted.newton / steps,
        "fallbacks": int(counted.fallbacks),
        "met": "yes" if ratio <= COULOMB else "no",
    }
    print(json.dumps(row), file=sys.stderr)
    return row


def allocated(n: int, steps: int) -> float:
    """KiB that a march of so many steps has allocated at the most after its first steps, beyond what it had then."""
    discrete = discretize_evolution(statement(2, "survey", n))
    plan = March(steps * STEP, step=STEP, save=Save(every=10.0 * steps * STEP), method=hv.solvers.NonsmoothNewton())
    run = marching(discrete, plan)
    for _ in range(10):
        next(run)
    gc.collect()
    tracemalloc.start()
    with contextlib.suppress(StopIteration):
        while True:
            next(run)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1024.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parts = ("direct", "overhead", "multigrid", "coulomb", "memory")
    parser.add_argument("--parts", nargs="+", choices=parts, default=parts)
    parser.add_argument("--steps", type=int, default=40, help="steps of each march")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--plane", type=int, default=256, help="1/h of the multigrid rows in 2D")
    parser.add_argument("--solid", type=int, default=32, help="1/h of the multigrid rows in 3D")
    parser.add_argument("--json", type=Path, default=None)
    options = parser.parse_args()
    rows = []
    if "overhead" in options.parts:
        for n in (16, 32):
            rows.append(compared(2, "survey", n, options.steps, options.repeats, False))
        rows.append(compared(3, "survey", 8, options.steps, options.repeats, False))
        rows.append(compared(2, "bonding", 32, options.steps, options.repeats, False))
        rows += [
            compared(2, f"{law}, strip", 128, options.steps, options.repeats, False) for law in ("survey", "softening")
        ]
    if "direct" in options.parts:
        rows += [
            compared(2, law, n, options.steps, options.repeats, False)
            for n in (64, 128)
            for law in ("survey", "softening")
        ]
    if "multigrid" in options.parts:
        few = max(options.steps // 4, 4)
        rows += [
            compared(dim, law, options.plane if dim == 2 else options.solid, few, options.repeats, True)
            for dim in (2, 3)
            for law in ("survey", "softening")
        ]
    if rows:
        show(rows, options.json)
    if "coulomb" in options.parts:
        kinds = [(2, 16), (2, 32), (3, 8)]
        laws: tuple[hv.laws.Superpotential, ...] = (hv.Compliance(50.0), hv.Signorini())
        show([coulomb(*kind, law, options.steps, options.repeats) for kind in kinds for law in laws], None)
    if "direct" in options.parts and not pardiso_available():
        print("PARDISO, whose half sweeps the mark of 1.3 is for, is not installed: nothing was run")
    if "memory" in options.parts:
        few, many = allocated(32, 100), allocated(32, 400)
        print(f"memory after ten steps: {few:.0f} KiB more in a march of 100 steps, {many:.0f} KiB in one of 400")


if __name__ == "__main__":
    main()
