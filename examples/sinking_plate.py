r"""
A plate on a foundation that gives way
======================================

A long plate, clamped at both ends, is pressed into the ground by a pressure q. The ground is a spring up to a limit
and then loses its strength. The deflection w is one unknown of fourth order: Morley's element, with contact over the
area. With no rotation about its long edges the plate is a beam of stiffness :math:`D = E t^3/(12 (1 - \nu^2))`,

.. math:: D w'''' + j'(w) = q.
"""

import matplotlib.pyplot as plt
import numpy as np
import skfem
from scipy.integrate import solve_bvp
from scipy.optimize import brentq, minimize_scalar
from skfem.helpers import dd, ddot

import hemivar as hv

POISSON, RIGIDITY, LOAD, WIDTH = 0.3, 0.02, 0.5, 0.25  # the length is 1
BED, LIMIT, SOFTENING = 40.0, 0.01, 60.0

# %%
# The plate
# ---------
# A region of the mesh is the contact. ``u_n`` is scikit-fem's name of the normal derivative.


def moment(w: skfem.DiscreteField) -> np.ndarray:
    """Bending moments of a deflection."""
    bent = dd(w)
    return RIGIDITY * ((1.0 - POISSON) * bent + POISSON * (bent[0, 0] + bent[1, 1]) * np.eye(2)[:, :, None, None])


def plate(cells: int) -> hv.DiscreteProblem:
    """The plate with so many cells along it."""
    along, across = np.linspace(0.0, 1.0, cells + 1), np.linspace(0.0, WIDTH, cells // 8 + 1)
    mesh = (
        skfem.MeshTri.init_tensor(along, across)
        .with_boundaries({"ends": lambda x: abs(x[0] - 0.5) > 0.499, "long": lambda x: abs(x[1] / WIDTH - 0.5) > 0.499})
        .with_subdomains({"plate": lambda x: x[0] > 0.0})
    )
    return hv.DiscreteProblem.of_forms(
        skfem.Basis(mesh, skfem.ElementTriMorley(), intorder=4),
        skfem.BilinearForm(lambda w, v, _: ddot(moment(w), dd(v))),
        load=skfem.LinearForm(lambda v, _: LOAD * v),
        supports={"ends": 0.0, "long": {"u_n": 0.0}},
        contact={"plate": hv.Contact(hv.Softening(BED, LIMIT, SOFTENING))},
    )


# %%
# The beam
# --------
# Collocation with the deflection of the middle prescribed: the load is an unknown, so that it may fall.


def beam(middle: float) -> float:
    """Load factor at which the middle of the beam sinks so far."""

    def slopes(x: np.ndarray, y: np.ndarray, q: np.ndarray) -> np.ndarray:
        answer = np.maximum(np.minimum(BED * y[0], BED * LIMIT - SOFTENING * (y[0] - LIMIT)), 0.0)
        return np.vstack([y[1], y[2], y[3], (LOAD * q[0] - answer) / RIGIDITY])

    def ends(a: np.ndarray, b: np.ndarray, q: np.ndarray) -> np.ndarray:
        return np.array([a[0], a[1], b[0] - middle, b[1], b[3]])

    x = np.linspace(0.0, 0.5, 33)
    guess = np.zeros((4, x.size))
    guess[0] = middle * (4.0 * x * (1.0 - x)) ** 2
    return float(solve_bvp(slopes, ends, x, guess, [1.0], tol=1e-5).p[0])


# %%
# The path
# --------
# It folds where the ground gives way under the middle, and again where the plate alone takes over. At loads in between
# there are three states. The path is a polygon, which knows them all.

top = -float(minimize_scalar(lambda d: -beam(d), bounds=(0.9 * LIMIT, 1.5 * LIMIT), method="bounded").fun)
valley = float(minimize_scalar(beam, bounds=(1.5 * LIMIT, 3.0 * LIMIT), method="bounded").fun)
folds = {}
for cells in (16, 32):
    path = hv.follow_path(plate(cells), (0.0, 1.0))
    loads = [fold.load_factor for fold in path.folds]
    folds[cells] = max(loads), min(loads)
    print(f"{cells} cells: folds at {max(loads):.4f} and {min(loads):.4f} of the load, beam {top:.4f} and {valley:.4f}")

points = path.problem.contact.points
middle = int(np.argmin(abs(points - (0.5, 0.5 * WIDTH)).sum(axis=1)))
states = path.at(0.7)
known = [brentq(lambda d: beam(d) - 0.7, *near) for near in ((0.001, 0.01), (0.011, 0.02), (0.025, 0.06))]
for (local, stable), exact in zip(states, known, strict=True):
    which = "stable" if stable else "unstable"
    print(f"at 0.7 of the load: deflection {local[middle, 0]:.5f}, beam {exact:.5f}, {which}")

# %%
# Load over the deflection of the middle, and the deep state at 0.7 of the load.

fig = plt.figure(figsize=(9.0, 3.8), layout="constrained")
left, right = fig.add_subplot(1, 2, 1), fig.add_subplot(1, 2, 2, projection="3d")
sunk = np.linspace(0.001, 0.06, 60)
left.plot(path.local[:, middle, 0], path.load_factor, color="tab:blue", label="plate, 32 cells")
left.plot(sunk, [beam(d) for d in sunk], "--", color="black", label="beam")
left.plot([local[middle, 0] for local, _ in states], [0.7] * len(states), "o", color="tab:red", label="three states")
left.set(xlabel="deflection of the middle", ylabel="load factor", xlim=(0.0, 0.06), ylim=(0.0, 1.0))
left.legend(loc="lower right")
deflection = states[-1][0][:, 0]
surface = right.plot_trisurf(*points.T, -deflection, cmap="viridis_r", edgecolor="none")
right.set(xlabel="x", ylabel="y", zlabel="-w", yticks=(0.0, WIDTH))
right.set_box_aspect((1.0, 0.35, 0.45))
right.view_init(elev=28, azim=-60)
plt.show()
