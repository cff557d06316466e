r"""
A wheel on a rail, from a Gmsh file
===================================

One mesh file holds two bodies, which share no node: the physical groups ``wheel`` and ``rail``, and on their boundaries
``hub``, ``tread``, ``head`` and ``foot``. The tread is *against* the head. The wheel hangs on its hub, which may go up
and down; the contact holds it. Hertz's formulas for a cylinder of radius R on a plane of the same material are

.. math:: a = \sqrt{\frac{4 P R}{\pi E_*}}, \qquad p_0 = \frac{2P}{\pi a}, \qquad E_* = \frac{E}{2(1 - \nu^2)}.

The problem file is ``examples/problems/wheel_on_rail.toml``.
"""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

RADIUS, YOUNG, POISSON = 460.0, 210e3, 0.3  # mm, MPa
here = Path(__file__).parent if "__file__" in globals() else Path()
problem = hv.read_problem(here / "problems" / "wheel_on_rail.toml")
mesh = problem.mesh
print(f"{mesh.parts.count} parts; contact points on {' against '.join(problem.pair('tread'))}")
solution = hv.solve(problem).raise_for_status()
force = solution.normal_force
wheel, rail = (solution.contact_forces[name][1] for name in ("tread", "head"))
print(f"force along y on the wheel {wheel:.3f} N/mm, on the rail {rail:.3f} N/mm")

# %%
# Where p² is linear in x², a straight line through the pressures gives half width and peak.

x, pressure = solution.contact.points[:, 0], solution.pressure
half_width = float(np.sqrt(8.0 * force * RADIUS * (1.0 - POISSON**2) / (np.pi * YOUNG)))
peak = 2.0 * force / (np.pi * half_width)
near = pressure > 0.3 * pressure.max()
slope, at_zero = np.polyfit(x[near] ** 2, pressure[near] ** 2, 1)
found_width, found_peak = float(np.sqrt(-at_zero / slope)), float(np.sqrt(at_zero))
print(f"a:  computed {found_width:.3f} mm, Hertz {half_width:.3f} mm")
print(f"p0: computed {found_peak:.1f} MPa, Hertz {peak:.1f} MPa")

# %%
# The whole, and what happens where they touch: the stress is largest below the surfaces.

fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 4.2), layout="constrained")
moved, stress = mesh.points + solution.displacement, solution.von_mises()
for panel in (left, right):
    image = panel.tripcolor(
        *moved.T, mesh.cells, facecolors=stress, cmap="cividis", edgecolor="#00000030", linewidth=0.2
    )
    panel.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
right.set(xlim=(-16.0, 16.0), ylim=(-16.0, 16.0))
fig.colorbar(image, ax=right, label="von Mises stress (MPa)")
plt.show()

# %%
# The pressures against Hertz's.

fig, ax = plt.subplots(figsize=(6.0, 3.0), layout="constrained")
s = np.linspace(-1.0, 1.0, 200)
ax.plot(s * half_width, peak * np.sqrt(1.0 - s**2), label="Hertz")
ax.plot(x, pressure, "o", markersize=3, label="computed")
ax.set(xlim=(-10.0, 10.0), xlabel="x (mm)", ylabel="pressure (MPa)")
ax.legend()
plt.show()
