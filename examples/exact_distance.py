r"""
How far from the exact solution?
================================

A certificate bounds the distance to the *discrete* solution. The distance to the solution of the *continuous* problem,
:math:`|u - u_h|_a^2 = \int C\varepsilon(u - u_h) : \varepsilon(u - u_h)`, is bounded by a stress in equilibrium with
the loads, made from the computed one, and by a lower bound of the trace constant of the body.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.tri import Triangulation

import hemivar as hv
from hemivar import gallery
from hemivar.bounds import exact_distance
from hemivar.bounds.trace_bounds import guaranteed_trace_bounds
from hemivar.fem import interpolate

# %%
# The survey's body on three meshes. The constants belong to the body: they are computed once.

sizes = (4, 8, 16)
problems = {n: gallery.survey("5.1", n) for n in sizes}
solutions = {n: hv.solve(problem).raise_for_status() for n, problem in problems.items()}
constants = guaranteed_trace_bounds(solutions[8].problem)
bounds = {n: exact_distance(problems[n], solutions[n].displacement, constants) for n in sizes}

# %%
# Against the distance to a solution on a much finer mesh that contains the coarse ones.

fine = gallery.survey("5.1", 64)
best = hv.solve(fine).raise_for_status()
field = best.problem.field
assert field is not None
errors = {}
for n in sizes:
    lifted = interpolate(problems[n].mesh, solutions[n].displacement, fine.mesh)
    difference = field.restrict(lifted) - best.unknowns
    errors[n] = float(np.sqrt(difference @ (best.problem.stiffness @ difference)))
    print(
        f"1/h = {n:>2}: bound {bounds[n].distance:.4f} ({bounds[n].relative:.1%}), guaranteed: "
        f"{bounds[n].guaranteed}, distance to the fine solution {errors[n]:.4f}"
    )

fig, ax = plt.subplots(figsize=(5.4, 3.2), layout="constrained")
ax.loglog(sizes, [bounds[n].distance for n in sizes], "o-", label="bound")
ax.loglog(sizes, [errors[n] for n in sizes], "s-", label="distance to the solution for 1/h = 64")
ax.set(xlabel="1/h", ylabel="energy norm")
ax.legend()
plt.show()

# %%
# Cell by cell the bound shows where the error is made: at the corners of the clamped side.

mesh = problems[16].mesh
fig, ax = plt.subplots(figsize=(4.6, 3.8), layout="constrained")
drawn = ax.tripcolor(Triangulation(*mesh.points.T, mesh.cells), np.sqrt(bounds[16].cells), cmap="magma_r")
ax.set(aspect="equal", xlabel="x", ylabel="y")
fig.colorbar(drawn, label="share of the bound")
plt.show()
