r"""
Nested meshes: warm start and orders of convergence
===================================================

A mesh is refined again and again, and the solution on each mesh is the first guess on the next, as in the survey. How
fast the differences between successive meshes shrink, in the norm
:math:`\|v\|_V = (\int \varepsilon(v) : \varepsilon(v))^{1/2}`, shows the order of convergence.
"""

import itertools

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar import gallery
from hemivar.fem import interpolate, v_norm


def orders(errors: list[float]) -> list[float]:
    """log2 of the ratio of the errors on two successive meshes."""
    return [float(np.log2(coarse / fine)) for coarse, fine in itertools.pairwise(errors)]


# %%
# Warm start
# ----------
# The active set method moves a node by one place of its law in a step, so that a good first guess pays.

problem = gallery.survey("5.1", 2)
meshes = [problem.mesh]
for _ in range(5):
    meshes.append(meshes[-1].refined())  # h = 1/2, 1/4, ... 1/64
levels = [hv.discretize(problem.on(mesh)) for mesh in meshes]
sizes = [2 * 2**k for k in range(len(levels))]
workspace = hv.systems.Workspace()
method = hv.survey.PrimalDualActiveSet(sets_from_guess=True)
warm = hv.solvers.solve_nested(levels, method, workspace=workspace)
cold = [hv.solve(level, method, workspace=workspace) for level in levels]
print("steps of the active set method")
for n, w, c in zip(sizes, warm, cold, strict=True):
    print(f"  1/h = {n:>3}: warm {w.steps:>3}, cold {c.steps:>3}")

# %%
# Orders
# ------
# Below 1 for the survey's data (5.1), whose solution has corner singularities.

differences = []
for coarse, fine in itertools.pairwise(warm):
    here, there = coarse.problem.field, fine.problem.field
    assert here is not None
    assert there is not None
    differences.append(v_norm(there, interpolate(here, coarse.displacement, there) - fine.displacement))
found = orders(differences)
print("V-norm of the difference from the next mesh, and its order")
for n, difference, order in zip(sizes, differences, [float("nan"), *found], strict=False):
    print(f"  1/h = {n:>3}: {difference:.4e}  {order:5.2f}")

# %%
# For comparison, the error of a smooth solution that is known exactly, where the order of linear elements is 1.

smooth = []
smooth_sizes = (4, 8, 16, 32)
for n in smooth_sizes:
    known = gallery.manufactured_spring(n)
    solution = hv.solve(known.problem).raise_for_status()
    finer = known.problem.mesh.refined(2)
    lifted = interpolate(known.problem.mesh, solution.displacement, finer)
    smooth.append(v_norm(finer, lifted - known.displacement(finer.points)))
smooth_orders = orders(smooth)
print("orders for a smooth solution known exactly:", " ".join(f"{order:.3f}" for order in smooth_orders))

fig, ax = plt.subplots(figsize=(5.6, 3.4), layout="constrained")
ax.loglog(sizes[:-1], differences, "o-", label="survey, data (5.1)")
ax.loglog(smooth_sizes, smooth, "s-", label="smooth solution")
ax.loglog(sizes[:-1], 0.5 * differences[0] * sizes[0] / np.array(sizes[:-1]), ":", color="0.5", label="order 1")
ax.set(xlabel="1/h", ylabel="difference, error in V")
ax.legend()
plt.show()
