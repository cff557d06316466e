r"""
A double cantilever beam, three ways
====================================

Two arms are glued together and pulled apart at their ends: the standard test for the fracture energy in mode I. By
symmetry one arm is enough, on glue that is twice as stiff. The load over the opening of a beam on a bilinear cohesive
zone has a closed form. Beam elements from your own arrays reproduce it, and so does a plane-stress body. Lengths are in
mm, forces in N, stresses in MPa.
"""

import matplotlib.pyplot as plt
import numpy as np
import scipy.sparse as sp
from scipy.optimize import brentq

import hemivar as hv
from hemivar.fem import LoadLine

young, width, height, crack, bond = 70e3, 25.0, 3.0, 50.0, 40.0
stiffness, strength, energy = 1e4, 10.0, 0.5  # MPa/mm, MPa, N/mm of the whole joint
bending = young * width * height**3 / 12.0
first, last = 0.5 * strength / stiffness, energy / strength  # half the openings of first damage and of the break
fall = strength / (last - first)
GLUE = hv.Adhesive(stiffness=2.0 * stiffness, strength=strength, softening=fall, compression=2.0 * stiffness)

# %%
# The exact beam
# --------------
# Ahead of the softening zone the beam lies on springs, behind it the arm is free. For a given length of the zone the
# equations are linear: continuity at the end of the zone, moment and shear force of the arm.

decay, wave = (2.0 * stiffness * width / (4.0 * bending)) ** 0.25, (width * fall / bending) ** 0.25
SPRINGS = np.array([[1.0, 0.0], [-decay, decay], [0.0, -2.0 * decay**2], [2.0 * decay**3, 2.0 * decay**3]])


def softened(x: float) -> np.ndarray:
    """Deflection, slope, curvature and its slope of the four solutions in the softening zone."""
    c, s, C, S = np.cos(wave * x), np.sin(wave * x), np.cosh(wave * x), np.sinh(wave * x)
    return np.array([[C, S, c, s], [S, C, -s, c], [C, S, -c, -s], [S, C, s, -c]]) * wave ** np.arange(4)[:, None]


def exact(arm: float, zone: float) -> tuple[float, float, float]:
    """Load, opening at the load, and half the opening at the end of the free arm."""
    rows = np.zeros((7, 7))
    rows[:4, :4], rows[:4, 4:6], rows[4, 4] = softened(zone), -SPRINGS, 1.0
    rows[5, :4], rows[6, :4] = bending * softened(0.0)[2:]
    rows[5:, 6] = -arm, -1.0
    *inside, load = np.linalg.solve(rows, [-last, 0.0, 0.0, 0.0, first, 0.0, 0.0])
    deflection, slope = last + softened(0.0)[0] @ inside[:4], softened(0.0)[1] @ inside[:4]
    return load, 2.0 * (deflection - slope * arm + load * arm**3 / (3.0 * bending)), deflection


def grown(growth: float) -> tuple[float, float]:
    """Load and opening where the crack has grown by some length."""
    zone = brentq(lambda z: exact(crack + growth, z)[2] - last, 0.1, 12.0)
    return exact(crack + growth, zone)[:2]


zones = np.linspace(0.0, brentq(lambda z: exact(crack, z)[2] - last, 0.1, 12.0), 400)
curve = np.array([(0.0, 0.0)] + [exact(crack, z)[:2] for z in zones] + [grown(g) for g in np.linspace(0.1, 21.0, 100)])
peak = curve[:, 0].max()
print(f"exact: damage begins at {curve[1, 0]:.4g} N, the peak is {peak:.5g} N")

# %%
# Beam elements
# -------------
# Stiffness matrix, trace and weights are arrays. The load factor is the opening, and the end of the arm moves by half.


def stiffness_of(lengths: np.ndarray) -> np.ndarray:
    """Stiffness of a chain of beam elements: deflection and slope of each node."""
    K = np.zeros((2 * lengths.size + 2, 2 * lengths.size + 2))
    for i, c in enumerate(lengths):
        first_two = [[12.0, 6.0 * c, -12.0, 6.0 * c], [6.0 * c, 4.0 * c**2, -6.0 * c, 2.0 * c**2]]
        last_two = [[-12.0, -6.0 * c, 12.0, -6.0 * c], [6.0 * c, 2.0 * c**2, -6.0 * c, 4.0 * c**2]]
        K[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += bending / c**3 * np.array(first_two + last_two)
    return K


def beam(cells: int, dead: bool = False) -> tuple[hv.DiscreteProblem, np.ndarray]:
    """The arm, its far end clamped and its near end displaced; or its far end free and its near end pulled by 1 N."""
    lengths = np.concatenate([np.full(10, crack / 10), np.full(cells, bond / cells)])
    K, nodes = stiffness_of(lengths), lengths.size + 1
    glued = np.arange(10, nodes if dead else nodes - 1)
    free = np.arange(0, 2 * nodes) if dead else np.arange(1, 2 * nodes - 2)
    weights = np.full(glued.size, width * bond / cells)
    weights[[0, -1] if dead else 0] *= 0.5
    places = (np.arange(glued.size), 2 * glued - free[0])
    trace = sp.csr_array((-np.ones(glued.size), places), shape=(glued.size, free.size))
    load = np.eye(free.size)[0] if dead else -0.5 * K[free, 0]
    law, gap = hv.laws.ContactLaw(GLUE).at(None), np.zeros(glued.size)
    return hv.DiscreteProblem.of_arrays(K[np.ix_(free, free)], load, trace, weights, gap, law), K[0]


def by_beams(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Load and opening along the path."""
    problem, row = beam(cells)
    path = hv.follow_path(problem, (0.0, 7.2))
    answer = problem.contact.trace.T @ (problem.contact.weights[:, None] * path.multiplier[:, :, 0].T)
    moved = np.linalg.solve(problem.stiffness.toarray(), np.outer(problem.load, path.load_factor) - answer)
    return 0.5 * row[0] * path.load_factor + row[1:-2] @ moved, path.load_factor


beams = by_beams(80)

# %%
# A plane-stress arm
# ------------------
# Quadratic triangles, two across the arm. The glue balances the load, so its resultant is the load.


def plane_arm(cells: int) -> hv.ContactProblem:
    """The arm as a body, its near end moved by half a millimetre of opening."""
    mesh = hv.rectangle((crack + bond, height), (cells, 2)).with_boundaries(
        {
            "end": lambda x: x[:, 0] < 1e-9,
            "far": lambda x: x[:, 0] > crack + bond - 1e-9,
            "glue": lambda x: (x[:, 1] < 1e-9) & (x[:, 0] > crack),
        }
    )
    return hv.ContactProblem(
        mesh=mesh,
        order=2,
        material=hv.Material.young(young, 0.3, plane="stress"),
        supports={"end": hv.Fixed(y=0.5), "far": "roller"},
        contact={"glue": hv.Contact(GLUE)},
    )


line = LoadLine.of(plane_arm(90))
path = hv.follow_path(line.loaded, (0.0, 7.2), unloaded=line.unloaded)
plane = -width * path.normal_force, path.load_factor

# %%
# Under a dead load
# -----------------
# A weight cannot be lowered while the crack grows, so the joint fails at the peak. Its bracket needs no path.

bracket = hv.branches.load_bracket(beam(80, dead=True)[0], upto=200.0)
print(f"dead load: {bracket}")

# %%
# Load over opening, and how far the models are from the exact beam.
# The plane arm shears, so it is softer before the glue is damaged.

fig, (ax, off) = plt.subplots(1, 2, figsize=(9.6, 3.8), layout="constrained")
ax.plot(curve[:, 1], curve[:, 0], color="0.7", linewidth=5.0, label="exact beam")
ax.axhspan(bracket.carried, bracket.not_carried, color="tab:green", alpha=0.4, label="bracket of the dead load")
for (load, opening), colour, name in ((beams, "tab:blue", "beam elements"), (plane, "tab:red", "plane stress")):
    ax.plot(opening, load, color=colour, linewidth=1.0, label=name)
    beyond = opening > 0.1
    known = np.interp(opening[beyond], curve[:, 1], curve[:, 0])
    off.plot(opening[beyond], 100.0 * (load[beyond] / known - 1.0), color=colour, linewidth=1.0, label=name)
ax.set(xlabel="opening at the load (mm)", ylabel="load (N)", xlim=(0.0, 7.2), ylim=(0.0, 140.0))
off.set(xlabel="opening at the load (mm)", ylabel="load against the exact beam (%)", xlim=(0.0, 7.2))
ax.legend(loc="lower right", frameon=False)
off.legend(loc="lower right", frameon=False)
plt.show()
