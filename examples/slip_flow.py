r"""
Stokes flow that slips at a wall
================================

A viscous fluid between two plates a distance H = 1 apart. The drag :math:`\tau(s)` of a wall grows with the slip s of
the fluid, and drops beyond a limit. What touches in the contact law is a velocity here.

Couette: the upper plate moves by U, and :math:`\mu (U - s)/H = \tau(s)`. Poiseuille: a pressure gradient G drives the
fluid. The walls bear G H together, and the flux is :math:`\bar s H + G H^3/(12 \mu)` with the mean slip of both.
"""

import matplotlib.pyplot as plt
import numpy as np
import skfem
from skfem.helpers import ddot, div, sym_grad

import hemivar as hv

MU, SPEED, PUSH = 0.8, 1.0, 1.6
DRAG = hv.Contact(hv.Softening(stiffness=20.0, limit=0.1, softening=4.0))

# %%
# The body
# --------
# Velocities are quadratic and pressures linear (P2/P1). ``u^1^1`` and ``u^2^1`` are scikit-fem's names of the two
# velocities, ``u^2`` is that of the pressure. No fluid leaves, so one pressure is fixed.

stokes = skfem.BilinearForm(lambda u, p, v, q, w: 2.0 * MU * ddot(sym_grad(u), sym_grad(v)) - div(u) * q - div(v) * p)
mesh = skfem.MeshTri.init_tensor(np.array([0.0, 1.0]), np.linspace(0.0, 1.0, 9)).with_boundaries(
    {"top": lambda x: x[1] > 0.99, "bottom": lambda x: x[1] < 0.01, "ends": lambda x: abs(x[0] - 0.5) > 0.49}
)
basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementTriP2()) * skfem.ElementTriP1(), intorder=4)
one_pressure = basis.get_dofs("top").all(["u^2"])[:1]
straight = {side: {"u^2^1": 0.0} for side in ("top", "bottom", "ends")}

# %%
# Couette: three states of one flow
# ---------------------------------
# The search tries all combinations of the pieces of the drag, and finds the three roots of the scalar equation.

moving = straight | {"top": {"u^1^1": SPEED, "u^2^1": 0.0}}
couette = hv.fem.FormBody(basis, stokes, supports=moving, fixed=one_pressure)
problem = couette.problem({"bottom": DRAG}, trace=lambda u, p: u[0])
states = sorted(hv.find_solutions(problem), key=lambda one: float(one.unknowns.mean()))
pieces = ((20.0, 0.0), (-4.0, 2.4), (0.0, 0.0))  # the drag is a s + b
roots = sorted((MU * SPEED - b) / (MU + a) for a, b in pieces)
for one, root in zip(states, roots, strict=True):
    print(f"slip {one.unknowns.mean():.12f}, by hand {root:.12f}: {one.kind}")

# %%
# Poiseuille: walls in different states
# -------------------------------------
# Eight states, and three of them are stable. In two of these one wall slides freely and the other one bears the whole
# push. The flux of each agrees with the closed form.

push = skfem.LinearForm(lambda v, q, w: PUSH * v[0])
poiseuille = hv.fem.FormBody(basis, stokes, load=push, supports=straight, fixed=one_pressure)
channel = poiseuille.problem({"bottom": DRAG, "top": DRAG}, trace=lambda u, p: u[0])
flows = hv.find_solutions(channel)
print(flows.searched)
through = skfem.LinearForm(lambda v, q, w: v[0]).assemble(basis)
fluxes = []
for one in flows:
    flux = float(through @ poiseuille.full(channel, one.unknowns))
    exact = float(one.contact.weights @ one.penetration) / 2.0 + PUSH / (12.0 * MU)
    print(f"slip {one.penetration.min():.4f} and {one.penetration.max():.4f}: ", end="")
    print(f"flux {flux:.12f}, by hand {exact:.12f}, walls bear {one.normal_force:.12f}; {one.kind}")
    fluxes.append((flux, exact))

# %%
# Velocities between the plates. Black walls hold the fluid, grey ones give way, and along dotted ones it slides
# freely.

stable = [one for one in flows if "minimiser" in str(one.kind)]
fig, axes = plt.subplots(2, 3, figsize=(8.4, 4.6), sharex=True, sharey=True, layout="constrained")
y = mesh.p[1, mesh.p[0] < 0.01]
for body, stated, row, some in ((couette, problem, axes[0], states), (poiseuille, channel, axes[1], stable)):
    for ax, one in zip(row, some, strict=True):
        speed = body.full(stated, one.unknowns)[basis.nodal_dofs[0]][mesh.p[0] < 0.01]
        ax.fill_betweenx(y, speed, color="tab:blue", alpha=0.15)
        ax.plot(speed, y, color="tab:blue")
        still = np.zeros_like(y)
        ax.quiver(still, y, speed, still, angles="xy", scale_units="xy", scale=1.0, width=0.007, color="tab:blue")
        for height in (0.0, 1.0):
            slip = speed[y == height][0] if body is poiseuille or height == 0.0 else 0.0
            style = ("black", "-") if slip <= 0.1 else ("0.5", "-") if slip < 0.6 else ("black", ":")
            ax.axhline(height, color=style[0], linestyle=style[1], linewidth=3.0)
        ax.set_title(str(one.kind))
axes[0, 0].set_ylabel("Couette")
axes[1, 0].set_ylabel("Poiseuille")
for ax in axes[1]:
    ax.set_xlabel("velocity")
plt.show()
