"""
Every method on one problem
===========================

The survey compares direct optimization, augmented Lagrangian and primal-dual active sets. All of them are here, beside
nonsmooth Newton and multigrid, and work on the same discrete problem; so do the residual and the stopping rule.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar import gallery

# %%
# One workspace keeps what the body costs (its condensation) for all methods.

problem = hv.discretize(gallery.survey("5.1", 16))
workspace = hv.systems.Workspace()
controls = hv.Controls(max_time=20.0)
reference = hv.solve(problem, workspace=workspace)


def energy_norm(u: np.ndarray) -> float:
    return float(np.sqrt(u @ (problem.stiffness @ u)))


# %%
# Status, cost, residual, and the distance from the default in the energy norm. Powell's method stops short of the
# minimiser at the survey's tolerance, and is called inaccurate.

rows: dict[str, dict[str, float | str]] = {}
print(f"{'method':<28}{'status':<12}{'steps':>6}{'eval.':>8}{'seconds':>10}{'residual':>11}{'difference':>12}")
for name, method in hv.solvers.METHODS.items():
    solution = hv.solve(problem, method, controls, workspace=workspace)
    difference = energy_norm(solution.unknowns - reference.unknowns) / energy_norm(reference.unknowns)
    seconds = solution.timings["iterate"]
    print(
        f"{name:<28}{solution.status.value:<12}{solution.steps:>6}{solution.evaluations:>8}{seconds:>10.4f}"
        f"{solution.residual.relative:>11.1e}{difference:>12.1e}"
    )
    rows[name] = {"status": solution.status.value, "energy": solution.energy, "difference": difference}
    rows[name] |= {"residual": solution.residual.relative, "seconds": seconds}

# %%
# Seconds of iteration (without the condensation, which they share).

names = sorted(rows, key=lambda name: float(rows[name]["seconds"]))
fig, ax = plt.subplots(figsize=(7.0, 3.2), layout="constrained")
ax.barh(names, [float(rows[name]["seconds"]) for name in names])
ax.set(xscale="log", xlabel="seconds")
plt.show()
