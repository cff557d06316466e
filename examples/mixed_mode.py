r"""
Glue pulled and sheared at once
===============================

A stiff tile is glued to a rigid ground, and its top is moved away at an angle. The glue has one fracture energy: the
work to tear the tile off is the same at every angle, while the largest tractions lie on an ellipse with the strength in
opening and the strength in shear as its axes.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

STRENGTH, ENERGY, STIFFNESS, RATIO = 30.0, 0.5, 1e4, 1.5
ANGLES = (0.0, 30.0, 60.0, 90.0)
glue = hv.laws.MixedMode(hv.laws.BilinearCohesion(STRENGTH, ENERGY, STIFFNESS), RATIO)
print(glue.at(None).describe())


def tile(opening: float, slip: float) -> hv.ContactProblem:
    """The tile, its top moved up and to the right; mm and MPa."""
    return hv.ContactProblem(
        mesh=hv.rectangle((1.0, 0.02), (20, 2)),
        material=hv.Material.young(70e3, 0.3),
        supports={"top": hv.Prescribed((slip, opening))},
        contact={"bottom": hv.Contact(glue)},
    )


# %%
# From nothing to broken
# ----------------------
# The tile is so stiff that each step has one solution; the mean traction over the way of the top is the work.

last = 2.0 * ENERGY / STRENGTH
curves, peaks, works = {}, {}, {}
for angle in ANGLES:
    way = np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    far = 1.15 * last / np.hypot(way[0], RATIO * way[1])
    places = np.linspace(0.0, far, 47)
    pulls = []
    for place in places:
        solution = hv.solve(hv.discretize(tile(*(place * way)))).raise_for_status()
        weights = solution.problem.contact.weights
        pulls.append(weights @ solution.multiplier / weights.sum())
    pull = np.array(pulls) * [-1.0, 1.0]
    curves[angle] = places, pull @ way
    peaks[angle] = pull[np.argmax(np.linalg.norm(pull / [1.0, RATIO], axis=1))]
    works[angle] = float(np.trapezoid(pull @ way, places))
    print(f"at {angle:g} degrees the work is {works[angle]:.4f}, the largest traction {peaks[angle].round(2)}")
margin = hv.certificates.smallness(hv.discretize(tile(last, 0.0)), trace_constant=False).margin
print(f"the margin is {margin:.3f}: each step has one solution")

# %%
# Tractions over the way of the top, and the largest ones on the ellipse of the strengths.

fig, (left, right) = plt.subplots(1, 2, figsize=(8.4, 3.4), layout="constrained")
for angle, (places, pull) in curves.items():
    left.plot(places, pull, label=f"{angle:g} degrees")
left.set(xlabel="way of the top (mm)", ylabel="traction along it (MPa)")
left.legend(frameon=False)
turn = np.linspace(0.0, 0.5 * np.pi, 100)
right.plot(STRENGTH * np.cos(turn), RATIO * STRENGTH * np.sin(turn), color="0.6", label="ellipse of the strengths")
right.plot(*np.array(list(peaks.values())).T, "o", color="tab:red", label="largest tractions")
right.set(xlabel="normal traction (MPa)", ylabel="shear traction (MPa)", xlim=(-1.0, None), ylim=(-1.0, None))
right.legend(frameon=False, loc="lower left")
plt.show()
