r"""
Hertz: two equal spheres, as bodies of revolution
=================================================

Two steel spheres are pressed together by a force F. Half of their section is meshed; x is the radius. Hertz's formulas
are

.. math:: a = \sqrt[3]{\frac{3 F R_*}{4 E_*}}, \qquad p_0 = \frac{3F}{2\pi a^2}, \qquad p(r) = p_0 \sqrt{1 - r^2/a^2},

with :math:`R_* = R/2` and :math:`E_* = E/(2(1 - \nu^2))`.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

RADIUS, YOUNG, POISSON, FORCE = 10.0, 210e3, 0.3, 1000.0  # mm, MPa, N
WIDTH, HEIGHT = 4.0, 6.0
SUM = YOUNG / (2.0 * (1.0 - POISSON**2))
HALF_WIDTH = float(np.cbrt(3.0 * FORCE * (RADIUS / 2.0) / (4.0 * SUM)))
PEAK = 1.5 * FORCE / (np.pi * HALF_WIDTH**2)


def sphere(across: int, up: int, side: float) -> hv.Mesh:
    """Half of a section through a part of a sphere above the origin, or below it where ``side`` is -1."""
    plain = hv.rectangle((1.0, 1.0), (across, up))
    s, t = plain.points.T
    x = WIDTH * np.sinh(4.0 * s) / np.sinh(4.0)
    low = RADIUS - np.sqrt(RADIUS**2 - x**2)
    y = low + (HEIGHT - low) * np.expm1(5.0 * t) / np.expm1(5.0)
    turn = slice(None) if side > 0.0 else slice(None, None, -1)
    turned = {name: facets[:, turn] for name, facets in plain.boundaries.items()}
    return hv.Mesh(np.column_stack([x, side * y]), plain.cells[:, turn], turned)


def problem(across: int) -> hv.ContactProblem:
    """Two spheres, the lower one with three cells for four of the upper one."""
    upper, lower = sphere(across, across, 1.0), sphere(3 * across // 4, 3 * across // 4, -1.0)
    return hv.ContactProblem(
        mesh=hv.Mesh.assembled({"upper": upper, "lower": lower}),
        material=hv.Material.young(YOUNG, POISSON, plane="axisymmetric"),
        contact={"upper:bottom": hv.Contact(hv.Signorini(), against="lower:bottom")},
        supports={"lower:top": hv.Clamped()},
        tractions={"upper:top": (0.0, -FORCE / (np.pi * WIDTH**2))},
        title="two spheres pressed together (mm, N, MPa)",
    )


# %%
# The boundary of contact is a circle between two nodes; the pressures are compared in the mean square over the surface.


def off(solution: hv.Solution) -> float:
    """Distance of the pressures from Hertz's, relative, in the mean square."""
    r, p, w = solution.contact.points[:, 0], solution.pressure, solution.contact.weights
    exact = PEAK * np.sqrt(np.maximum(1.0 - (r / HALF_WIDTH) ** 2, 0.0))
    return float(np.sqrt(w @ (p - exact) ** 2 / (w @ exact**2)))


solutions = {across: hv.solve(problem(across)).raise_for_status() for across in (24, 48, 96)}
errors = np.array([off(one) for one in solutions.values()])
for across, one in solutions.items():
    radius = float(np.sqrt(one.contact_length / np.pi))
    found = f"radius {radius:.4f}, largest pressure {one.pressure.max():.1f}"
    print(f"{across:3d} cells: {found}, pressures {off(one):.2%} off")
print(f"Hertz:    radius {HALF_WIDTH:.4f}, largest pressure {PEAK:.1f}")
finest = solutions[96]

# %%
# The sections, turned to the left as well, and the pressures.

fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
s = np.linspace(0.0, 1.0, 200)
left.plot(s * HALF_WIDTH, PEAK * np.sqrt(1.0 - s**2), label="Hertz")
for across, one in solutions.items():
    r, near = one.contact.points[:, 0], one.contact.points[:, 0] < 1.5 * HALF_WIDTH
    left.plot(r[near], one.pressure[near], "o", markersize=3, label=f"{across} cells")
left.set(xlabel="r (mm)", ylabel="pressure (MPa)")
left.legend()
mesh, stress = finest.problem.field.mesh, finest.von_mises()
moved = mesh.points + finest.displacement
for side in (1.0, -1.0):
    image = right.tripcolor(side * moved[:, 0], moved[:, 1], mesh.cells, facecolors=stress, cmap="cividis")
right.set(xlim=(-1.0, 1.0), ylim=(-1.0, 1.0), aspect="equal", xlabel="r (mm)", ylabel="z (mm)")
fig.colorbar(image, ax=right, label="von Mises stress (MPa)")
plt.show()
