r"""
Hertz: a half disc on a rigid plane
===================================

The flat top of the half disc (radius R, plane strain) is moved down by D; its round side may touch the plane y = 0.
The mesh comes from Gmsh. Hertz's formulas for line contact take the resulting force P per length:

.. math:: a = \sqrt{\frac{4 P R}{\pi E^*}}, \qquad p_0 = \frac{2P}{\pi a}, \qquad p(x)^2 = p_0^2 (1 - x^2/a^2).

They are for a half space and neglect tangential displacements, a term of order :math:`(1 - 2\nu)\,a/R`: agreement in
per cent is what can be expected.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

RADIUS, YOUNG, POISSON, DOWN = 1.0, 1.0, 0.3, 0.002
here = Path(__file__).parent if "__file__" in globals() else Path()

# %%
# The foundation is met along the outward normal of the body, so the gap at a node of height y is y / cos(angle).


def gap(x: np.ndarray) -> np.ndarray:
    """Distance to the plane y = 0 along the normal of the disc, at points of shape (k, 2)."""
    return x[:, 1] / (1.0 - x[:, 1] / RADIUS)


problem = hv.ContactProblem(
    mesh=hv.read_mesh(here / "meshes" / "half_disc.msh"),
    material=hv.Material.young(YOUNG, POISSON, plane="strain"),
    supports={"top": hv.Prescribed((0.0, -DOWN))},
    contact={"contact": hv.Contact(hv.Signorini(), gap=gap)},
    title="half disc on a rigid plane",
)
solution = hv.solve(problem).raise_for_status()
solution.plot()

# %%
# The load is the vertical part of the nodal forces. In Hertz's law p² is linear in x²: a straight line through the
# computed values gives p0 and a.

contact = solution.problem.contact
x, pressure = contact.points[:, 0], solution.pressure
load = -float((contact.weights * pressure) @ contact.frames[:, 0, 1])
half_width = float(np.sqrt(4.0 * load * RADIUS * (1.0 - POISSON**2) / (np.pi * YOUNG)))
peak = 2.0 * load / (np.pi * half_width)
touching = pressure > 0.3 * pressure.max()
slope, at_zero = np.polyfit(x[touching] ** 2, pressure[touching] ** 2, 1)
found_peak, found_width = float(np.sqrt(at_zero)), float(np.sqrt(-at_zero / slope))
print(f"{solution.status.value} in {solution.steps} steps; load P = {load:.6e}")
print(f"p0: computed {found_peak:.6e}, Hertz {peak:.6e}, relative error {found_peak / peak - 1:+.2%}")
print(f"a:  computed {found_width:.6e}, Hertz {half_width:.6e}, relative error {found_width / half_width - 1:+.2%}")

# %%
# Pressure over the half width.

s = np.linspace(-1.0, 1.0, 200)
fig, ax = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
ax.plot(s * half_width, peak * np.sqrt(1.0 - s**2), label="Hertz")
near = np.abs(x) < 2.0 * half_width
ax.plot(x[near], pressure[near], "o", markersize=4, label="computed")
ax.set(xlabel="x", ylabel="pressure")
ax.legend()
plt.show()
