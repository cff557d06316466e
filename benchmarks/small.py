"""What small problems cost: a time step, a static solve, and the first answer of a process.

    OMP_NUM_THREADS=1 python benchmarks/small.py

``bounce`` is a step of ``examples/problems/bounce.toml`` (Coulomb, 17 contact points), ``survey`` one of the survey's
first law at 1/h = 32 with mass and viscosity, ``static`` a solve of 32 contact points from a ``DiscreteProblem`` whose
stiffness is condensed already, ``condensed`` the same with its condensation, ``answer`` a process that imports the
library, states that problem and solves it, and ``libraries`` one that imports NumPy, SciPy and scikit-fem only.
``loads`` is a solve of a loop over a thousand loads of many directions on 144 unknowns with one workspace, of a rigid
foundation with given friction, and ``coulomb loads`` the same under Coulomb's law.
Milliseconds are those of the processor.  Of each step the smallest time of some repeats counts; the mean of these is
printed, and the median of all other rows.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from common import show

import hemivar as hv
from hemivar import gallery
from hemivar.evolution.discrete import DiscreteEvolution, discretize_evolution
from hemivar.evolution.march import March, marching
from hemivar.files.problem_file import read_problem_file
from hemivar.workflows.marching import evolution_of, plan_of

#: Milliseconds that are asked for.
MARKS = {"bounce": 1.0, "survey": 0.5, "static": 2.0, "loads": 0.5, "coulomb loads": 1.5, "answer": 600.0}
BOUNCE = Path(__file__).parent.parent / "examples" / "problems" / "bounce.toml"
LIBRARIES = "import numpy, scipy.sparse.linalg, scipy.linalg, skfem"
ANSWER = """
import hemivar as hv
problem = hv.ContactProblem(
    mesh=hv.rectangle((1.0, 1.0), 32, pattern="right"), material=hv.Material.lame(4.0, 4.0),
    supports={"left": hv.Clamped()}, body_force=(-0.8, -0.8),
    contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.laws.Tresca(0.5))},
)
assert hv.solve(problem).status is hv.Status.CONVERGED
"""


def of_steps(discrete: DiscreteEvolution, plan: March, repeats: int) -> float:
    """Mean of the smallest seconds of each step."""
    runs = []
    for _ in range(repeats):
        workspace, seconds = hv.systems.Workspace(), []
        gc.collect()
        began = time.process_time()
        for _ in marching(discrete, plan, workspace=workspace):
            now = time.process_time()
            seconds.append(now - began)
            began = now
        runs.append(seconds[1:])  # the first step factorises
    return float(np.mean(np.min(runs, axis=0)))


def bounce(repeats: int) -> float:
    stated = read_problem_file(BOUNCE)
    return of_steps(discretize_evolution(evolution_of(stated)), plan_of(stated, until=0.5), repeats)


def survey(repeats: int) -> float:
    stated = gallery.survey("5.1", 32, "right")
    problem = replace(stated, material=replace(stated.material, density=1.0, viscosity=(0.4, 0.4)))
    plan = March(1.0, step=0.01, controls=hv.Controls(rtol=1e-9), save=hv.evolution.Save(every=1.0))
    return of_steps(discretize_evolution(hv.Evolution(problem, inertia=True)), plan, repeats)


def static(repeats: int, kept: bool = True) -> float:
    problem = hv.discretize(gallery.survey("5.1", 32, "right"))
    workspace, seconds = hv.systems.Workspace(), []
    for _ in range(20 * repeats):
        began = time.process_time()
        hv.solve(problem, workspace=workspace if kept else hv.systems.Workspace())
        seconds.append(time.process_time() - began)
    return statistics.median(seconds)


def loads(repeats: int, friction: hv.laws.Friction) -> float:
    stated = gallery.survey("5.1", 8, "right")
    problem = hv.discretize(replace(stated, contact={"bottom": hv.Contact(hv.Signorini(), friction)}))
    rng, size = np.random.default_rng(1), float(np.abs(problem.load).max())
    turned = problem.load.reshape(-1, 2) * rng.uniform(-0.5, 1.5, (1000, 1, 2))
    many = (turned + size * rng.uniform(-0.5, 0.5, turned.shape)).reshape(1000, -1)
    workspace, seconds = hv.systems.Workspace(), []
    for _ in range(repeats + 1):
        began = time.process_time()
        for load in many:
            hv.solve(problem.with_(load=load), workspace=workspace).raise_for_status()
        seconds.append((time.process_time() - began) / len(many))
    return min(seconds)


def process(code: str, repeats: int) -> float:
    """Of a process, whose libraries use one thread."""
    seconds = []
    for _ in range(repeats + 1):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        environment = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
        subprocess.run([sys.executable, "-c", code], check=True, env=environment | {"OMP_NUM_THREADS": "1"})
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return statistics.median(seconds[1:])


PARTS: dict[str, Callable[[int], float]] = {
    "bounce": bounce,
    "survey": survey,
    "static": static,
    "condensed": lambda repeats: static(repeats, kept=False),
    "loads": lambda repeats: loads(repeats, hv.Tresca(0.5)),
    "coulomb loads": lambda repeats: loads(repeats, hv.Coulomb(0.3)),
    "answer": lambda repeats: process(ANSWER, repeats),
    "libraries": lambda repeats: process(LIBRARIES, repeats),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--parts", nargs="+", choices=list(PARTS), default=list(PARTS))
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", type=Path, default=None, help="also write the rows to this file")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    for name in options.parts:
        rows.append({"part": name, "ms": 1e3 * PARTS[name](options.repeats), "mark_ms": MARKS.get(name, "")})
        print(json.dumps(rows[-1]), file=sys.stderr)
    show(rows, options.json)


if __name__ == "__main__":
    main()
