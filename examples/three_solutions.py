r"""
Three solutions of one load, and the path through them
======================================================

A bar meets a foundation that pushes back with stiffness 2 up to the penetration 0.1 and then gives way with slope
:math:`-0.9`, while the bar itself is only as stiff as :math:`\kappa = 1/2`. Equilibrium is
:math:`\kappa (r_0 - r) = j'(r)`: a straight line that may cut the graph of the law three times.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.gallery import elastic_bar
from hemivar.report import plot_path

law = hv.Softening(2.0, 0.1, 0.9)
problem = elastic_bar(law, length=2.0, load=0.225)  # kappa = 1/2, r0 = 0.45
kappa, r0 = 0.5, 0.45

# %%
# All solutions
# -------------
# The law is piecewise quadratic and there is one contact point, so that all combinations of its pieces are tried: the
# search is exhaustive, and says so.

found = hv.find_solutions(problem)
for one in found:
    print(f"r = {one.penetration[0]:.12f}  E = {one.energy:+.8f}  {one.kind}")
print(found.searched, "| exhaustive:", found.exhaustive)
depths = sorted(float(one.penetration[0]) for one in found)

# %%
# By hand: on the rising piece :math:`\kappa r_0/(\kappa + 2)`, on the falling one
# :math:`(\kappa r_0 - 0.29)/(\kappa - 0.9)`, and :math:`r_0` where the foundation has given way.

by_hand = sorted([kappa * r0 / (kappa + 2.0), (kappa * r0 - 0.29) / (kappa - 0.9), r0])
print("by hand", by_hand)
r = np.array([-0.05, 0.0, 0.1, 0.1 + 0.2 / 0.9, 0.5])
fig, ax = plt.subplots(figsize=(6.0, 3.4), layout="constrained")
ax.plot(r, [0.0, 0.0, 0.2, 0.0, 0.0], label="j'(r)")
ax.plot(r, kappa * (r0 - r), label=r"$\kappa (r_0 - r)$")
ax.plot(depths, [kappa * (r0 - depth) for depth in depths], "o", color="black")
ax.set(xlabel="penetration r", ylabel="force")
ax.legend()
plt.show()

# %%
# The path over the load
# ----------------------
# The three belong to one path, which folds twice: where the law begins to give way, and where it has nothing left. The
# path is a polygon, and its corners are exact.

path = hv.follow_path(problem, (0.0, 1.5))
folds = sorted(fold.load_factor for fold in path.folds)
print("folds at the load factors", folds, "|", path.ended)
plot_path(path)
