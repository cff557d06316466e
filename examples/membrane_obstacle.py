r"""
A membrane on a hill
====================

Scalar problems have one unknown over a mesh: membranes, antiplane shear, heat. Here a membrane of tension T spans the
unit disc and is pressed onto the hill :math:`\psi = H - \rho^2/(2R)` by a load; it lies on a disc whose radius a solves
a transcendental equation, outside of which :math:`T \Delta u = T q`.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.gallery import membrane_obstacle, membrane_radius
from hemivar.report import plot_contact

HEIGHT, RADIUS, LOAD = 0.3, 0.8, 0.5
known = membrane_obstacle(32, height=HEIGHT, radius=RADIUS, load=LOAD)
solution = hv.solve(known.problem).raise_for_status()
solution.plot()

# %%
# The measure of contact is the area; the exact one is that of the disc.

radius = membrane_radius(HEIGHT, RADIUS, LOAD)
print(f"area in contact {solution.contact_length:.4f}, exact {np.pi * radius**2:.4f}")
plot_contact(solution)

# %%
# The error falls as it should: half of the mesh width, a quarter of the error at the nodes.

sizes, errors = (8, 16, 32, 64), []
for n in sizes:
    case = membrane_obstacle(n, height=HEIGHT, radius=RADIUS, load=LOAD)
    u = hv.solve(case.problem).raise_for_status().displacement[:, 0]
    errors.append(float(np.sqrt(np.mean((u - case.solution(case.problem.mesh.points)) ** 2))))
    print(f"n = {n:>3}: mean square error {errors[-1]:.2e}")
fig, ax = plt.subplots(figsize=(5.0, 3.2), layout="constrained")
ax.loglog(sizes, errors, "o-", label="error")
ax.loglog(sizes, 0.7 * errors[0] * (sizes[0] / np.array(sizes)) ** 2, ":", color="0.5", label="order 2")
ax.set(xlabel="cells along a side", ylabel="mean square error at the nodes")
ax.legend()
plt.show()
