r"""
A sphere and a flat punch on a half space
=========================================

Rigid indenters are pressed by d into an elastic block, which is large beside the contact. Half of a section is meshed,
around the axis x = 0; forces are those of the whole body. Hertz's sphere of radius R and Sneddon's flat punch of
radius a have

.. math:: F = \tfrac43 E^* \sqrt{R d^3}, \quad p = \frac{3F}{2\pi a^2}\sqrt{1 - \frac{r^2}{a^2}}, \quad a = \sqrt{R d}
          \qquad\text{and}\qquad F = 2 E^* a d, \quad p = \frac{F}{2\pi a^2}\Big/\sqrt{1 - \frac{r^2}{a^2}}.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

YOUNG, POISSON = 200.0, 0.3  # MPa
STAR = YOUNG / (1.0 - POISSON**2)
RADIUS, DEPTH = 8.0, 0.01485066667  # mm; of the sphere
FLAT, DOWN = 1.0, 0.01  # mm; of the punch


def block(under: np.ndarray, size: float) -> hv.Mesh:
    """Half of a section of a block, with nodes ``under`` the indenter, and ever larger cells outside of it."""
    first, reach = np.diff(under)[-1], under[-1]
    away = first * np.cumsum(1.15 ** np.arange(1, 80))
    r = np.append(under, reach + away[away < 0.9 * size])
    z = np.append(0.0, away[away < 0.9 * size])
    r[-1], z[-1] = size, size
    square = hv.rectangle((len(r) - 1, len(z) - 1), (len(r) - 1, len(z) - 1), pattern="right")
    i, j = np.rint(square.points).astype(int).T
    return hv.Mesh(np.column_stack([r[i], -z[::-1][j]]), square.cells).with_boundaries(
        {
            "under": lambda p: (p[:, 1] > -1e-9) & (p[:, 0] < reach + 1e-9),
            "base": lambda p: p[:, 1] < 1e-9 - size,
        }
    )


def pressed(mesh: hv.Mesh, contact: hv.Contact, down: float) -> hv.Solution:
    """The block, its base lifted towards the indenter."""
    problem = hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.young(YOUNG, POISSON, plane="axisymmetric"),
        contact={"under": contact},
        supports={"base": hv.Prescribed((0.0, down))},
        order=2,
    )
    return hv.solve(problem).raise_for_status()


# %%
# Larger and larger blocks
# ------------------------
# A block of finite size is stiffer than the half space: the excess halves where the size doubles.

sphere = hv.Contact(hv.Signorini(), gap=lambda x: x[:, 0] ** 2 / (2.0 * RADIUS))
radius = float(np.sqrt(RADIUS * DEPTH))
exact = {"sphere": 4.0 / 3.0 * STAR * radius * DEPTH, "punch": 2.0 * STAR * FLAT * DOWN}
finer = FLAT * np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, 33))  # towards the edge of the punch
excess: dict[str, list[float]] = {name: [] for name in exact}
for size in (16.0, 32.0, 64.0):
    found = {
        "sphere": pressed(block(np.linspace(0.0, 0.5, 61), size), sphere, DEPTH),
        "punch": pressed(block(finer, size), hv.Contact(hv.Signorini()), DOWN),
    }
    for name, solution in found.items():
        excess[name].append(solution.normal_force / exact[name] - 1.0)
        print(f"block of {size:g} mm, {name}: {solution.normal_force:.4f} N, {excess[name][-1]:+.2%}")
print(f"half space: sphere {exact['sphere']:.4f} N, punch {exact['punch']:.4f} N")

# %%
# Von Mises stresses in the section: the sphere's are largest below the surface, the punch's at its edge. Below them the
# pressures.

fig, axes = plt.subplots(2, 2, figsize=(9.0, 5.0), layout="constrained")
off = {}
for (name, one), (above, below), reach in zip(found.items(), axes.T, (radius, FLAT), strict=True):
    r, weights, mean = one.contact.points[:, 0] / reach, one.contact.weights, one.normal_force / (np.pi * reach**2)
    root = np.sqrt(np.maximum(1.0 - r**2, 0.0))
    inside = r < 0.95
    theory = 1.5 * root[inside] if name == "sphere" else 0.5 / root[inside]
    wrong = one.pressure[inside] / mean - theory
    off[name] = float(np.sqrt(weights[inside] @ wrong**2 / (weights[inside] @ theory**2)))
    print(f"{name}: pressures are {off[name]:.2%} off in the mean square, up to 95 % of the radius")
    (x, y), mises = one.problem.field.mesh.points.T / reach, one.von_mises() / mean
    for side in (1.0, -1.0):
        image = above.tripcolor(
            side * x, y, one.problem.field.mesh.cells, facecolors=mises, cmap="inferno", vmin=0.0, vmax=1.2
        )
    above.set(title=name, xlim=(-2.0, 2.0), ylim=(-1.6, 0.0), aspect="equal", xlabel="r / a", ylabel="z / a")
    below.plot(r, one.pressure / mean, ".", color="tab:blue", label="computed")
    below.plot(np.sort(r[inside]), theory[np.argsort(r[inside])], color="black", label="half space")
    below.set(xlim=(0.0, 1.2), ylim=(0.0, 2.5), xlabel="r / a", ylabel="pressure / mean")
below.legend()
fig.colorbar(image, ax=axes[0], label="von Mises / mean pressure")
plt.show()
