r"""
A foundation that breaks: two answers to one load
=================================================

The pressure rises with the penetration s up to s = 0.1 and vanishes beyond, and the friction bound grows with s, so
that the functional has two arguments, J(w, v) (Jureczka and Ochal 2019). At the given load there is a solution that the
foundation supports, reached by loading the body from zero, and one that has broken through, reached from below.
"""

import numpy as np

import hemivar as hv
from hemivar.fem import LoadLine
from hemivar.gallery import broken_foundation
from hemivar.laws import NoContact
from hemivar.report import plot_solution
from hemivar.solvers import FixedPoint, Search

# %%
# A method that walks downhill only stays on the branch on which it starts.

STAY = FixedPoint(hv.solvers.NonsmoothNewton(search=Search.DOWNHILL))
LIMIT = 0.1
N = 16

# %%
# Supported
# ---------
# From zero, in four steps of the load.

line, guess = LoadLine(hv.discretize(broken_foundation(N))), None
for factor in (0.25, 0.5, 0.75, 1.0):
    supported = hv.solve(line.at(factor), STAY, initial=guess).raise_for_status()
    guess = supported.unknowns
print(
    f"energy {supported.energy:.6f}, largest penetration {supported.penetration.max():.6f}, "
    f"contraction {supported.contraction:.3f}"
)
plot_solution(supported, title="supported")

# %%
# Broken through
# --------------
# From below: the start is the body without a foundation.

problem = broken_foundation(N)
without = hv.ContactProblem(
    mesh=problem.mesh,
    material=problem.material,
    supports=problem.supports,
    contact={"bottom": hv.Contact(NoContact())},
    body_force=problem.body_force,
)
free = hv.solve(without).raise_for_status()
broken = hv.solve(problem, STAY, initial=free.unknowns).raise_for_status()
gone = np.count_nonzero(broken.penetration > LIMIT)
print(f"energy {broken.energy:.6f}, {gone} of {broken.penetration.size} points broken")
plot_solution(broken, title="broken through")


# %%
# Where the supported branch ends
# -------------------------------
# The largest penetration grows smoothly up to 0.1, where the branch ends, so that the load is extrapolated from the
# last two points, and approached in steps that shrink: a large one would overshoot, as the friction bound follows the
# penetration and holds part of the load.


def breaking_load(n: int, tolerance: float = 1e-7) -> float:
    """Load factor at which the supported branch ends.

    The largest penetration grows smoothly up to 0.1, where the branch ends, so that the load is extrapolated from the
    last two points, and approached in steps that shrink: a large one would overshoot, as the friction bound follows
    the penetration and holds part of the load.
    """
    problem = hv.discretize(broken_foundation(n))
    line, workspace = LoadLine(problem), hv.systems.Workspace()

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


loads = {}
for n in (4, 8):
    loads[n] = breaking_load(n)
    print(f"1/h = {n}: the foundation gives way at {loads[n]:.6f} of the load")
