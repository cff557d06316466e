r"""
A piezoelectric sensor on an insulating foundation
==================================================

A wafer of PZT-5H, polarised along y, is pressed onto an elastic, insulating ground. Stress and electric displacement
depend on the strain and on the gradient of the potential:

.. math:: \sigma = C\varepsilon + e^T \nabla\varphi, \qquad D = e\,\varepsilon - \epsilon \nabla\varphi.

Between smooth walls it is a spring of modulus :math:`c_{33}` if both faces are short-circuited. In an open circuit the
modulus is :math:`c_{33} + e_{33}^2/\epsilon_{33}`, and the potential measures the strain:
:math:`\varphi' = \varepsilon\,e_{33}/\epsilon_{33}`.
"""

import matplotlib.pyplot as plt
import numpy as np
import skfem
from skfem.helpers import grad

import hemivar as hv

C11, C13, C33, C44 = 126e9, 84.1e9, 117e9, 23e9  # Pa
E31, E33, E15 = -6.5, 23.3, 17.0  # C/m^2
EPS11, EPS33 = 1.505e-8, 1.302e-8  # F/m
WIDTH, HEIGHT, DOWN, BED = 10e-3, 2e-3, 1e-7, 8e13  # m, m, m, Pa/m

# %%
# The body
# --------
# The law acts on (strains, gradient of the potential). Its matrix has negative numbers on the diagonal, and entries
# between 1e-8 and 1e11: units are taken as they are.

LAW = np.array(
    [
        [C11, C13, 0.0, 0.0, E31],
        [C13, C33, 0.0, 0.0, E33],
        [0.0, 0.0, C44, E15, 0.0],
        [0.0, 0.0, E15, -EPS11, 0.0],
        [E31, E33, 0.0, 0.0, -EPS33],
    ]
)


def state(u: skfem.DiscreteField, phi: skfem.DiscreteField) -> np.ndarray:
    """Strains xx, yy, 2 xy and the gradient of the potential."""
    a, g = grad(u), grad(phi)
    return np.array([a[0, 0], a[1, 1], a[0, 1] + a[1, 0], g[0], g[1]])


form = skfem.BilinearForm(lambda u, phi, v, psi, w: np.einsum("i...,ij,j...", state(v, psi), LAW, state(u, phi)))
grid = np.linspace(-0.5 * WIDTH, 0.5 * WIDTH, 41), np.linspace(0.0, HEIGHT, 9)
mesh = skfem.MeshQuad.init_tensor(*grid).with_boundaries(
    {
        "top": lambda x: x[1] > 0.99 * HEIGHT,
        "bottom": lambda x: x[1] < 0.01 * HEIGHT,
        "sides": lambda x: abs(x[0]) > 0.499 * WIDTH,
    }
)
basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad2()) * skfem.ElementQuad2())
electrode = {"top": {"u^1^1": 0.0, "u^2^1": -DOWN, "u^2": 0.0}}

# %%
# Two circuits
# ------------
# ``u^2`` is scikit-fem's name of the potential. Where nothing is prescribed no charge is.

found = {}
for circuit, modulus in (("short", C33), ("open", C33 + E33**2 / EPS33)):
    walls = {"sides": {"u^1^1": 0.0}} | ({"bottom": {"u^2": 0.0}} if circuit == "short" else {})
    body = hv.fem.FormBody(basis, form, supports=electrode | walls)
    problem = body.problem({"bottom": hv.Contact(hv.Compliance(BED))})
    solution = hv.solve(problem).raise_for_status()
    pressure, exact = solution.pressure, DOWN / (HEIGHT / modulus + 1.0 / BED)
    print(f"{circuit:5s} circuit: pressure {pressure.mean():.6f} Pa, by hand {exact:.6f}")
    found[circuit] = pressure, exact
signal = float(body.full(problem, solution.unknowns)[basis.get_dofs("bottom").all(["u^2"])].mean())
by_hand = (DOWN - exact / BED) * E33 / EPS33
print(f"signal {signal:.6f} V, by hand {by_hand:.6f}")

# %%
# A bump below
# ------------
# On a round ground the wafer touches in the middle alone, and the potential shows where. Displacements are 5000 times
# enlarged, and so is the ground.

RADIUS, LARGER = 40.0, 5000.0
body = hv.fem.FormBody(basis, form, supports=electrode)
bump = hv.Contact(hv.Compliance(BED), gap=lambda x: x[:, 0] ** 2 / (2.0 * RADIUS))
problem = body.problem({"bottom": bump})
solution = hv.solve(problem).raise_for_status()
print(solution.certify())
*displacement, potential = body.full(problem, solution.unknowns)[basis.nodal_dofs]
x, y = 1e3 * (mesh.p + LARGER * np.array(displacement))
cells = mesh.to_meshtri().t.T
fig, ax = plt.subplots(figsize=(8.0, 2.8), layout="constrained")
ax.fill_between(1e3 * grid[0], -2.0, -1e3 * LARGER * grid[0] ** 2 / (2.0 * RADIUS), color="0.8")
image = ax.tripcolor(x, y, cells, potential, shading="gouraud", cmap="plasma")
ax.tricontour(x, y, cells, potential, 12, colors="white", linewidths=0.6)
ax.set(aspect="equal", xlabel="x (mm)", ylabel="y (mm)", ylim=(-1.5, 1.8))
fig.colorbar(image, ax=ax, label="potential (V)", shrink=0.9)
plt.show()
