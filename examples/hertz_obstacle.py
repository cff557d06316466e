r"""
Hertz: a steel block on a rigid cylinder
========================================

Instead of a gap a foundation may have the shape of a rigid plane, sphere or cylinder, or of any signed distance. A
block is pressed onto a cylinder of radius 200 mm; the left side is the plane of symmetry. Units: mm, N, MPa.

Hertz: :math:`a = \sqrt{4 P R/(\pi E^*)}` and :math:`p_0 = 2P/(\pi a)`, P being twice the normal force of the half.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

YOUNG, POISSON, RADIUS = 210e3, 0.3, 200.0
problem = hv.ContactProblem(
    mesh=hv.rectangle((20.0, 20.0), (80, 80), pattern="cross"),
    material=hv.Material.young(YOUNG, POISSON),
    supports={"left": hv.Fixed(x=0.0), "top": hv.Prescribed((0.0, -0.04))},
    contact={
        "bottom": hv.Contact(
            hv.Signorini(), obstacle=hv.mechanics.Sphere((0.0, -RADIUS), RADIUS), normals=hv.mechanics.Normals.BODY
        )
    },
    title="steel block on a rigid cylinder",
)
solution = hv.solve(problem).raise_for_status()

# %%
# Hertz's numbers for the force that was computed.

force = 2.0 * solution.normal_force
half_width = float(np.sqrt(4.0 * force * RADIUS * (1.0 - POISSON**2) / (np.pi * YOUNG)))
peak = 2.0 * force / (np.pi * half_width)
assert solution.problem.contact.points is not None
x = solution.problem.contact.points[:, 0]
found_peak = float(solution.pressure.max())
print(f"P = {force:.1f} N/mm: half width {half_width:.3f} mm, p0 {peak:.0f} MPa; computed p0 {found_peak:.0f} MPa")

# %%
# Pressure along the bottom; the mesh width is 0.25 mm.

s = np.linspace(0.0, 1.0, 100)
fig, ax = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
ax.plot(s * half_width, peak * np.sqrt(1.0 - s**2), label="Hertz")
near = x < 2.0 * half_width
ax.plot(x[near], solution.pressure[near], "o", markersize=4, label="computed")
ax.set(xlabel="x (mm)", ylabel="pressure (MPa)")
ax.legend()
plt.show()

# %%
# The stress below the contact: the largest von Mises stress is inside the body, not at its surface.

from matplotlib.tri import Triangulation  # noqa: E402

from hemivar.fem import von_mises  # noqa: E402

cells = von_mises(problem, solution.displacement)
mesh = problem.mesh
centres = mesh.points[mesh.cells].mean(axis=1)
fig, ax = plt.subplots(figsize=(5.0, 4.0), layout="constrained")
drawn = ax.tripcolor(Triangulation(*mesh.points.T, mesh.cells), cells, cmap="viridis")
ax.set(xlim=(0.0, 8.0), ylim=(0.0, 8.0), aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
fig.colorbar(drawn, label="von Mises stress (MPa)")
deepest = centres[np.argmax(np.where(centres[:, 1] < 8.0, cells, 0.0))]
print(f"largest at ({deepest[0]:.2f}, {deepest[1]:.2f}) mm, {deepest[1] / half_width:.2f} half widths deep")
plt.show()
