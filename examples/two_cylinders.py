r"""
Hertz: two equal cylinders pressed together
===========================================

Two steel cylinders (radius R, plane strain) are pressed together by a force P per length. There is no foundation: the
boundary of the upper one is *against* that of the lower one. Nothing but this contact holds the upper one vertically.
Hertz's formulas are

.. math:: a = \sqrt{\frac{4 P R_*}{\pi E_*}}, \qquad p_0 = \frac{2P}{\pi a}, \qquad p(x) = p_0 \sqrt{1 - x^2/a^2},

with :math:`R_* = R/2` and :math:`E_* = E/(2(1 - \nu^2))`. They are for half spaces; here :math:`a/R` is 0.023.
A map makes the cells small where the bodies touch. The nodes of the two meshes do not match.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

RADIUS, YOUNG, POISSON, FORCE = 10.0, 210e3, 0.3, 1000.0  # mm, MPa, N/mm
WIDTH, HEIGHT = 4.0, 6.0  # of the part of each cylinder that is meshed: half its width, and its height
HALF_WIDTH = float(np.sqrt(8.0 * FORCE * (RADIUS / 2.0) * (1.0 - POISSON**2) / (np.pi * YOUNG)))
PEAK = 2.0 * FORCE / (np.pi * HALF_WIDTH)

# %%
# A rectangle becomes a part of a cylinder: its lower side is bent to the circle, and its cells shrink to the origin.


def cylinder(across: int, up: int, side: float) -> hv.Mesh:
    """The part of a cylinder above the origin, or below it where ``side`` is -1."""
    plain = hv.rectangle((2.0, 1.0), (across, up), origin=(-1.0, 0.0))
    s, t = plain.points.T
    x = WIDTH * np.sinh(4.0 * s) / np.sinh(4.0)
    low = RADIUS - np.sqrt(RADIUS**2 - x**2)
    y = low + (HEIGHT - low) * np.expm1(5.0 * t) / np.expm1(5.0)
    points = np.column_stack([x, side * y])
    cells = plain.cells if side > 0.0 else plain.cells[:, ::-1]
    turned = {name: facets if side > 0.0 else facets[:, ::-1] for name, facets in plain.boundaries.items()}
    return hv.Mesh(points, cells, turned)


def problem(across: int) -> hv.ContactProblem:
    """Two cylinders, the lower one with three cells for four of the upper one."""
    upper, lower = cylinder(across, across // 2, 1.0), cylinder(3 * across // 4, 3 * across // 8, -1.0)
    return hv.ContactProblem(
        mesh=hv.Mesh.assembled({"upper": upper, "lower": lower}),
        material=hv.Material.young(YOUNG, POISSON, plane="strain"),
        contact={"upper:bottom": hv.Contact(hv.Signorini(), against="lower:bottom")},
        supports={"lower:top": hv.Clamped(), "upper:top": hv.Fixed(x=0.0)},
        tractions={"upper:top": (0.0, -FORCE / (2.0 * WIDTH))},
        title="two cylinders pressed together (mm, N, MPa)",
    )


# %%
# On finer meshes the pressures come nearer to Hertz's. Where p² is linear in x², a straight line gives p0 and a.


def fitted(solution: hv.Solution) -> tuple[float, float]:
    """Half width and largest pressure by a straight line through p² over x²."""
    x, p = solution.contact.points[:, 0], solution.pressure
    near = p > 0.3 * p.max()
    slope, at_zero = np.polyfit(x[near] ** 2, p[near] ** 2, 1)
    return float(np.sqrt(-at_zero / slope)), float(np.sqrt(at_zero))


def off(solution: hv.Solution) -> float:
    """Distance of the pressures from Hertz's, relative, in the mean square over the boundary."""
    x, p, w = solution.contact.points[:, 0], solution.pressure, solution.contact.weights
    exact = PEAK * np.sqrt(np.maximum(1.0 - (x / HALF_WIDTH) ** 2, 0.0))
    return float(np.sqrt(w @ (p - exact) ** 2 / (w @ exact**2)))


solutions = {across: hv.solve(problem(across)).raise_for_status() for across in (40, 80, 160)}
widths, peaks = (np.array(values) for values in zip(*map(fitted, solutions.values()), strict=True))
errors = np.array([off(one) for one in solutions.values()])
for across, width, peak, error in zip(solutions, widths, peaks, errors, strict=True):
    found = f"a = {width:.5f} ({width / HALF_WIDTH - 1:+.2%}), p0 = {peak:.1f} ({peak / PEAK - 1:+.2%})"
    print(f"{across:4d} cells across: {found}, pressures {error:.2%} off")
print(f"Hertz:             a = {HALF_WIDTH:.5f},           p0 = {PEAK:.1f}")
order = float(np.log2(errors[0] / errors[-1]) / 2.0)
print(f"order of convergence of the pressures: {order:.2f}")

# %%
# The forces on the two sides are opposite, to rounding.

finest = solutions[160]
for name, force in finest.contact_forces.items():
    print(f"force on {name}: ({force[0]:.3g}, {force[1]:.6f}) N/mm")

# %%
# The pressures of both sides of the contact, and the stress below it.

fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
s = np.linspace(-1.0, 1.0, 200)
left.plot(s * HALF_WIDTH, PEAK * np.sqrt(1.0 - s**2), label="Hertz")
for across, one in solutions.items():
    x, pressure = one.contact.points[:, 0], one.pressure
    near = np.abs(x) < 1.5 * HALF_WIDTH
    left.plot(x[near], pressure[near], "o", markersize=3, label=f"{across} cells")
left.set(xlabel="x (mm)", ylabel="pressure (MPa)")
left.legend()
mesh = finest.problem.field.mesh
moved = mesh.points + finest.displacement
stress = finest.von_mises()
image = right.tripcolor(*moved.T, mesh.cells, facecolors=stress, cmap="cividis")
right.set(xlim=(-0.8, 0.8), ylim=(-0.8, 0.8), aspect="equal", xlabel="x (mm)", ylabel="y (mm)")
fig.colorbar(image, ax=right, label="von Mises stress (MPa)")
plt.show()
