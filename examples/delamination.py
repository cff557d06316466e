r"""
A strip torn off its ground
===========================

The tension of a glue drops three times as it opens, at 0.5, 1 and 2 mm (after Makela et al. 1998). Where the tip passes
these openings the equilibrium path has its corners: each point of the glue in turn has three, so that on a mesh the
path is a zigzag of folds. Under a prescribed load the strip jumps over them.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.fem import LoadLine
from hemivar.gallery import delamination

TEETH = (0.5e-3, 1e-3, 2e-3)
FACTORS = np.round(np.arange(0.02, 1.3001, 0.02), 2)
problem = hv.discretize(delamination(2))
assert problem.contact.points is not None
tip = int(np.argmax(problem.contact.points[:, 0]))

# %%
# Under a prescribed load
# -----------------------
# Each solution is computed from the last one; twice in m and kN, and in mm and N.


def under_load(problem: hv.DiscreteProblem) -> np.ndarray:
    """Tip opening at each of the load factors."""
    line, workspace = LoadLine(problem), hv.systems.Workspace()
    guess, opening = None, []
    for factor in FACTORS:
        solution = hv.solve(line.at(float(factor)), initial=guess, workspace=workspace).raise_for_status()
        guess = solution.unknowns
        opening.append(-solution.penetration[tip])
    return np.array(opening)


opening = under_load(problem)
again = under_load(hv.discretize(delamination(2, length=1e3, stress=1e-3))) / 1e3
units = float(np.abs(again / opening - 1.0).max())
print(f"m, kN against mm, N: relative difference of the tip opening {units:.1e}")
growth = (opening[1:] / opening[:-1]) / (FACTORS[1:] / FACTORS[:-1])
jumps = np.flatnonzero(growth > 1.3) + 1
for i in jumps:
    print(
        f"between {FACTORS[i - 1]:g} and {FACTORS[i]:g} of the load the tip jumps from "
        f"{opening[i - 1] * 1e3:.3f} to {opening[i] * 1e3:.3f} mm"
    )

# %%
# The path of equilibria
# ----------------------
# A polygon, followed from corner to corner without a step size.

path = hv.follow_path(problem, (0.0, 1.5))
along = -path.local[:, tip, 0]
teeth = []
for tooth in TEETH:
    i = int(np.argmax(along >= tooth * (1.0 - 1e-9)))
    part = (tooth - along[i - 1]) / (along[i] - along[i - 1])
    teeth.append(float(path.load_factor[i - 1] + part * (path.load_factor[i] - path.load_factor[i - 1])))
    print(f"the tip opens {tooth * 1e3:g} mm at {teeth[-1]:.4f} of the load")
print(f"{len(path)} corners, {len(path.folds)} folds; {path.ended}")

# %%
# Load over the opening of the tip.

fig, panels = plt.subplots(1, 2, figsize=(9.0, 3.6), sharey=True, layout="constrained")
for ax, right in zip(panels, (2.5, 14.0), strict=True):
    ax.plot(along * 1e3, path.load_factor, color="0.6", linewidth=1.0, label="equilibrium path")
    ax.plot(opening * 1e3, FACTORS, ".", color="tab:blue", markersize=5, label="load prescribed")
    ax.plot([t * 1e3 for t in TEETH], teeth, "o", color="tab:red", markersize=5, label="tooth of the tip breaks")
    ax.set(xlim=(0.0, right), ylim=(0.0, 1.35), xlabel="opening of the tip (mm)")
panels[0].set(ylabel="load factor", title="the three teeth")
panels[1].set_title("the whole path")
panels[1].legend(loc="lower right", frameon=False)
plt.show()
