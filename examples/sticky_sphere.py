r"""
A sphere that sticks: the pull-off force of Johnson, Kendall and Roberts
========================================================================

A rigid sphere of radius R touches an elastic block, and surfaces that are close attract one another: w is the work
to separate them, per area. For a range that is short beside the elastic neck at the edge of contact

.. math:: a^3 = \frac{3R}{4 E^*} \Bigl(F + 3 \pi w R + \sqrt{6 \pi w R F + (3 \pi w R)^2}\Bigr),
          \qquad F_{\min} = -\tfrac32 \pi w R.

The sphere is pulled off step by step. Half of a section is meshed, around the axis x = 0.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

RADIUS, YOUNG, POISSON, WORK, STRENGTH = 8.0, 200.0, 0.3, 0.01, 14.0  # mm, MPa, -, N/mm, MPa
STAR = YOUNG / (1.0 - POISSON**2)
PULL_OFF, AT_REST = 1.5 * np.pi * WORK * RADIUS, float(np.cbrt(4.5 * np.pi * WORK * RADIUS**2 / STAR))
RANGE = 2.0 * WORK / STRENGTH

# %%
# The law
# -------
# The attraction falls from its strength to zero over the range 2 w / strength. Tabor's number compares the neck with
# the range. Large numbers are the theory's; for small ones the force is a third larger (Derjaguin, Muller, Toporov).

tabor = float(np.cbrt(RADIUS * WORK**2 / STAR**2)) * STRENGTH / WORK
law = hv.Adhesive(stiffness=10.0 * STRENGTH / RANGE, strength=STRENGTH, energy=WORK)
print(f"Tabor's number is {tabor:.1f}")


def block(cells: int, fine: float = 0.4, size: float = 6.0) -> hv.Mesh:
    """Half of a section of a block, with so many cells below a surface of radius ``fine``."""
    outer = fine + (size - fine) * np.linspace(0.0, 1.0, cells // 4)[1:] ** 3
    r, depth = np.append(np.linspace(0.0, fine, cells + 1), outer), np.cumsum(fine / cells * 1.2 ** np.arange(40))
    z = np.append(0.0, depth[depth < size])
    square = hv.rectangle((len(r) - 1, len(z) - 1), (len(r) - 1, len(z) - 1), pattern="right")
    i, j = np.rint(square.points).astype(int).T
    return hv.Mesh(np.column_stack([r[i], -z[::-1][j]]), square.cells).with_boundaries(
        {"near": lambda p: (p[:, 1] > -1e-9) & (p[:, 0] < fine + 1e-9), "base": lambda p: p[:, 1] < -z[-1] + 1e-9}
    )


def held(mesh: hv.Mesh, up: float) -> hv.ContactProblem:
    """The block with its base moved; the sphere stays where it is."""
    return hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.young(YOUNG, POISSON, plane="axisymmetric"),
        contact={"near": hv.Contact(law, gap=lambda x: x[:, 0] ** 2 / (2.0 * RADIUS))},
        supports={"base": hv.Prescribed((0.0, up))},
    )


# %%
# Pulled off
# ----------
# Each step begins at the last one, and stays in contact as long as there is such a state. The edge of contact is taken
# where the surfaces are a fifth of the range apart.

mesh, guess, workspace, curve = block(100), None, hv.systems.Workspace(), []
for up in np.linspace(4e-3, -5e-3, 28):
    solution = hv.solve(held(mesh, float(up)), initial=guess, workspace=workspace).raise_for_status()
    guess, near = solution.unknowns, solution.penetration > -0.2 * RANGE
    if not near.any():
        print(f"it lets go where the block has been moved by {up * 1e3:.2f} um")
        break
    curve.append((solution.normal_force, float(np.sqrt(solution.contact.weights[near].sum() / np.pi)), solution))
force, radius = np.array([pair[:2] for pair in curve]).T
exact = 4.0 * STAR * radius**3 / (3.0 * RADIUS) - np.sqrt(8.0 * np.pi * WORK * STAR * radius**3)
off = float(np.abs(force - exact).max() / PULL_OFF)
above = float(-force.min() / PULL_OFF - 1.0)
print(f"pull-off force {-force.min():.4f} N, theory {PULL_OFF:.4f} N: {above:+.1%}")
print(f"forces over the radius of contact are {off:.1%} of it off at most")

# %%
# Force over the radius, and the stress along the axis where the force is least: pressure in the middle, and a ring of
# tension at the edge, where the surface is drawn up into a neck. Displacements are 15 times enlarged.

fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained", width_ratios=(2, 3))
a = np.linspace(0.05, 1.0, 100) * AT_REST
left.plot(a, 4.0 * STAR * a**3 / (3.0 * RADIUS) - np.sqrt(8.0 * np.pi * WORK * STAR * a**3), "k", label="theory")
left.plot(radius, force, "o", color="tab:blue", markersize=4, label="computed")
left.axhline(-PULL_OFF, color="0.6", linewidth=0.8)
left.set(xlabel="radius of contact (mm)", ylabel="force (N)")
left.legend()
least = curve[int(np.argmin(force))][2]
(x, y), tension = (mesh.points + 15.0 * least.displacement).T, least.stress()[:, 1, 1]
for side in (1.0, -1.0):
    image = right.tripcolor(side * x, y, mesh.cells, facecolors=tension, cmap="RdBu_r", vmin=-8, vmax=8)
r = np.linspace(-0.4, 0.4, 200)
right.fill_between(r, 15.0 * r**2 / (2.0 * RADIUS), 1.0, color="0.75")
right.set(xlim=(-0.4, 0.4), ylim=(-0.3, 0.15), xlabel="r (mm)", ylabel="z (mm)")
fig.colorbar(image, ax=right, label="stress along the axis (MPa)")
plt.show()
