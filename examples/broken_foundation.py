"""A foundation that breaks where it is pressed in too far (Jureczka and Ochal 2019): two answers to one load.

The pressure rises with the penetration s up to s = 0.1 and vanishes beyond, and the friction bound grows with s, so
that the functional has two arguments, J(w, v). At the given load there is a solution that the foundation supports,
reached by loading the body from zero, and one that has broken through, reached from below. The supported one ends
where its largest penetration is 0.1: at 2.32 times the load, found here for several meshes.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import hemivar as hv
from hemivar.fem import LoadLine
from hemivar.gallery import broken_foundation
from hemivar.laws import NoContact
from hemivar.solvers import FixedPoint, Search

#: Walks downhill only, and so stays on the branch on which it starts.
STAY = FixedPoint(hv.NonsmoothNewton(search=Search.DOWNHILL))
LIMIT = 0.1


def supported(n: int) -> hv.Solution:
    """The solution reached from zero load."""
    line, guess = LoadLine(hv.discretize(broken_foundation(n))), None
    for factor in (0.25, 0.5, 0.75, 1.0):
        solution = hv.solve(line.at(factor), STAY, initial=guess).raise_for_status()
        guess = solution.unknowns
    return solution


def broken_through(n: int) -> hv.Solution:
    """The solution reached from below: the start is the body without a foundation."""
    problem = broken_foundation(n)
    without = hv.ContactProblem(
        mesh=problem.mesh,
        material=problem.material,
        supports=problem.supports,
        contact={"bottom": hv.Contact(NoContact())},
        body_force=problem.body_force,
    )
    free = hv.solve(hv.discretize(without)).raise_for_status()
    return hv.solve(hv.discretize(problem), STAY, initial=free.unknowns).raise_for_status()


def breaking_load(n: int, tolerance: float = 1e-7) -> float:
    """Load factor at which the supported branch ends.

    The largest penetration grows smoothly up to 0.1, where the branch ends, so that the load is extrapolated from the
    last two points, and approached in steps that shrink: a large one would overshoot, as the friction bound follows
    the penetration and holds part of the load.
    """
    problem = hv.discretize(broken_foundation(n))
    line, workspace = LoadLine(problem), hv.Workspace()

    def at(factor: float, guess: np.ndarray | None) -> hv.Solution:
        partial = line.at(factor)
        return hv.solve(partial, STAY, initial=guess, workspace=workspace)

    factor, solution = 1.0, at(1.0, None).raise_for_status()
    depth, slope, share = float(solution.penetration.max()), float(solution.penetration.max()), 0.7
    while (end := factor + (LIMIT - depth) / slope) - factor > tolerance * factor and share > 1e-6:
        new = factor + share * (end - factor)
        found = at(new, solution.unknowns)
        deeper = float(found.penetration.max())
        if found.status is hv.Status.CONVERGED and depth < deeper <= LIMIT:
            slope = (deeper - depth) / (new - factor)
            factor, solution, depth = new, found, deeper
        else:
            share *= 0.5
    beyond = at(end * (1.0 + 10.0 * tolerance), solution.unknowns)
    if share <= 1e-6 or beyond.penetration.max() < 2.0 * LIMIT:
        raise RuntimeError(f"the end of the supported branch was not found beyond {factor:g}")
    return end


def main(out: Path | None = None) -> dict[str, float]:
    """Both solutions, and where the supported one ends."""
    n = 16
    answers = {"supported": supported(n), "broken through": broken_through(n)}
    for name, solution in answers.items():
        broken = np.count_nonzero(solution.penetration > LIMIT)
        print(
            f"{name}: energy {solution.energy:.6f}, largest penetration {solution.penetration.max():.6f}, "
            f"{broken} of {solution.penetration.size} points broken, contraction {solution.contraction:.3f}"
        )
    print(f"{'1/h':>6}{'load factor':>16}")
    loads = {}
    for m in (4, 8, 16):
        loads[m] = breaking_load(m)
        print(f"{m:>6}{loads[m]:>16.6f}")
    if out is not None:
        from hemivar.files import write_json
        from hemivar.report import plot_solution, save

        for name, solution in answers.items():
            stem = f"jureczka_ochal_{name.replace(' ', '_')}"
            save(plot_solution(solution, title=name), out / f"{stem}.png")
            write_json(solution, out / f"{stem}.json")
    return {
        "supported": answers["supported"].energy,
        "broken": answers["broken through"].energy,
        "penetration": float(answers["supported"].penetration.max()),
        "penetration_broken": float(answers["broken through"].penetration.max()),
        **{f"load_{m}": load for m, load in loads.items()},
    }


if __name__ == "__main__":
    from _command import run

    run(main)
