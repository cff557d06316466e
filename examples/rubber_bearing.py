r"""
An incompressible bearing: glued above, rubbing below
=====================================================

A rubber strip of width b and height h is glued to a plate that comes down by D. Rubber keeps its volume: Poisson's
ratio is 1/2, and a pressure is computed beside the displacement (P2/P1, plane strain). A thin strip is squeezed out
like a viscous film. With friction of the bound g below, it sticks up to :math:`x_s = g h^2/(6 \mu D)` from the middle,
slips beyond, and

.. math:: -p' = 12 \mu D x/h^3 \quad (x < x_s), \qquad -p' = 3 \mu D x/h^3 + 3 g/(2h) \quad (x > x_s).
"""

import matplotlib.pyplot as plt
import numpy as np
import skfem
from skfem.helpers import ddot, div, sym_grad

import hemivar as hv

MU, HEIGHT, DOWN, BOUND = 1.0, 1.0, 0.01, 0.12  # MPa, mm, mm, MPa

rubber = skfem.BilinearForm(lambda u, p, v, q, w: 2.0 * MU * ddot(sym_grad(u), sym_grad(v)) - div(u) * q - div(v) * p)


def film(x: np.ndarray, width: float) -> np.ndarray:
    """Pressure of the thin film at distances x from the middle; it falls to zero at the free side."""
    sticks, slope = BOUND * HEIGHT**2 / (6.0 * MU * DOWN), 1.5 * MU * DOWN / HEIGHT**3

    def fallen(s: np.ndarray | float) -> np.ndarray:
        inside, outside = np.minimum(s, sticks), np.maximum(s, sticks)
        return slope * (4.0 * inside**2 + outside**2 - sticks**2) + 1.5 * BOUND / HEIGHT * (outside - sticks)

    return fallen(0.5 * width) - fallen(np.abs(x))


# %%
# The body
# --------
# One half, from the plane of symmetry x = 0 on. The contact is stated as for a body of hemivar: nonpenetration and
# friction. ``FormBody`` keeps the pressure, which :func:`hemivar.solve` does not see.


def bearing(width: float, up: int = 8) -> tuple[hv.fem.FormBody, hv.DiscreteProblem]:
    """The bearing with ``up`` cells over its height."""
    across = np.linspace(0.0, 0.5 * width, round(0.5 * width / HEIGHT * up) + 1)
    mesh = skfem.MeshTri.init_tensor(across, np.linspace(0.0, HEIGHT, up + 1)).with_boundaries(
        {"top": lambda x: x[1] > HEIGHT - 1e-9, "bottom": lambda x: x[1] < 1e-9, "middle": lambda x: x[0] < 1e-9}
    )
    basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP2()) * skfem.ElementTriP1(), intorder=4)
    held = {"top": {"u^1^1": 0.0, "u^2^1": -DOWN}, "middle": {"u^1^1": 0.0}}
    body = hv.fem.FormBody(basis, rubber, supports=held)
    return body, body.problem({"bottom": hv.Contact(hv.Signorini(), hv.Tresca(BOUND))})


# %%
# Thinner and thinner strips
# --------------------------
# The film neglects what happens within h of the free side: forces differ by 7.6 % for b/h = 8, and by less than 0.5 %
# from 32 on.

forces = {}
for width in (64.0, 32.0, 16.0, 8.0):
    body, problem = bearing(width)
    solution = hv.solve(problem).raise_for_status()
    x = np.linspace(0.0, 0.5 * width, 20001)
    exact = float(np.trapezoid(film(x, width), x))
    forces[width] = solution.normal_force, exact
    off = solution.normal_force / exact - 1.0
    print(f"b/h = {width:2g}: force {solution.normal_force:9.5f}, film {exact:9.5f}, {off:+.2%}")
print(solution.certify())

# %%
# The pressure in the rubber, displacements 15 times enlarged, and what the ground has to bear.

whole, mesh = body.full(problem, solution.unknowns), body.basis.mesh
*displacement, pressure = whole[body.basis.nodal_dofs]
x, y = mesh.p + 15.0 * np.array(displacement)
edge = mesh.facets[:, np.setdiff1d(mesh.boundary_facets(), mesh.boundaries["middle"])]
fig, (above, below) = plt.subplots(2, 1, figsize=(8.0, 4.2), sharex=True, layout="constrained")
for side in (1.0, -1.0):
    image = above.tripcolor(side * x, y, mesh.t.T, pressure, shading="gouraud", cmap="viridis", vmin=0.0)
    above.plot(side * x[edge], y[edge], color="black", linewidth=0.8)
above.axhline(0.0, color="0.3", linewidth=2.0)
above.set(aspect="equal", ylabel="y (mm)")
fig.colorbar(image, ax=above, label="pressure (MPa)", aspect=8, shrink=0.5)
at = np.argsort(solution.contact.points[:, 0])
place = np.concatenate([-solution.contact.points[at[::-1], 0], solution.contact.points[at, 0]])
friction = np.concatenate([-solution.multiplier[at[::-1], 1], solution.multiplier[at, 1]])
below.plot(place, np.concatenate([solution.pressure[at[::-1]], solution.pressure[at]]), label="pressure")
below.plot(place, film(place, width), "--", color="black", label="pressure of the film")
below.plot(place, friction, color="tab:red", label="friction")
below.set(xlabel="x (mm)", ylabel="on the ground (MPa)")
below.legend()
plt.show()
