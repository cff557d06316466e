"""
Meshes that adapt to a guaranteed accuracy
==========================================

Solve, bound the distance to the exact solution, refine the cells that hold half of it, and again, until the relative
distance that was asked for is guaranteed.
"""

import matplotlib.pyplot as plt
from matplotlib.tri import Triangulation

from hemivar import gallery
from hemivar.bounds import solve_adaptive

found = solve_adaptive(gallery.survey("5.1", 4), rtol=0.1)
for level in found.levels:
    print(f"{level.unknowns:>6} unknowns: {level.distance.relative:.2%}, guaranteed: {level.distance.guaranteed}")
print("ended:", found.ended)

# %%
# The bound over the unknowns, and what the first mesh would need if all of it were refined.

unknowns = [level.unknowns for level in found.levels]
relative = [level.distance.relative for level in found.levels]
fig, ax = plt.subplots(figsize=(5.4, 3.2), layout="constrained")
ax.loglog(unknowns, relative, "o-", label="adaptive")
ax.loglog(unknowns, [relative[0] * (unknowns[0] / n) ** 0.5 for n in unknowns], ":", color="0.5", label="rate 1/2")
ax.set(xlabel="unknowns", ylabel="relative distance, guaranteed")
ax.legend()
plt.show()

# %%
# The last mesh is fine where the solution is singular.

origin = found.solution.problem.field
assert origin is not None
fig, ax = plt.subplots(figsize=(4.4, 4.2), layout="constrained")
ax.triplot(Triangulation(*origin.mesh.points.T, origin.mesh.cells), linewidth=0.5, color="tab:blue")
ax.set(aspect="equal", xlabel="x", ylabel="y")
plt.show()
