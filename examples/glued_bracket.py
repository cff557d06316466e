r"""
A bracket of hexahedra on adhesive tape
=======================================

A steel bracket hangs on a wall by foam tape, and a force F pulls its arm down. It is meshed with hexahedra of 27 nodes.
The bracket is stiff beside the tape, so that its base stays plane. On a base of height H and width W, with the lever e,

.. math:: \tau = \frac{F}{H W}, \qquad \sigma(y) = \frac{12 F e}{W H^3} \Bigl(y - \frac{H}{2}\Bigr),

and the tape begins to tear at its upper edge where :math:`\sqrt{\sigma^2 + \tau^2}` is its strength.
"""

import matplotlib.pyplot as plt
import numpy as np
import skfem
from matplotlib.cm import ScalarMappable
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from skfem.helpers import ddot, div, sym_grad

import hemivar as hv

HEIGHT, WIDTH, THICK, LEVER = 60.0, 40.0, 8.0, 48.0  # mm
YOUNG, POISSON = 210e3, 0.3  # MPa
STIFFNESS, STRENGTH, ENERGY = 1.0, 0.3, 0.3  # N/mm^3, MPa, N/mm
LAM, MU = YOUNG * POISSON / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)), YOUNG / (2.0 * (1.0 + POISSON))

# %%
# The body
# --------
# x leads away from the wall, and y up. Cells of a grid that are neither base nor arm are removed. A rule of degree 5 is
# enough for the integrals. scikit-fem's own choice for these elements, degree 12, is 15 times as slow.

grid = np.r_[0.0, THICK, 18.0:LEVER:4j], np.r_[0.0, THICK:HEIGHT:8j], np.linspace(0.0, WIDTH, 6)
block = skfem.MeshHex.init_tensor(*grid)
middle = block.p[:, block.t].mean(axis=1)
mesh = block.remove_elements(np.flatnonzero((middle[0] > THICK) & (middle[1] > THICK))).with_boundaries(
    {"wall": lambda x: x[0] < 1e-9, "end": lambda x: x[0] > LEVER - 1e-9}
)
basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementHex2()), intorder=5)
elastic = skfem.BilinearForm(lambda u, v, w: LAM * div(u) * div(v) + 2.0 * MU * ddot(sym_grad(u), sym_grad(v)))
one_newton = skfem.LinearForm(lambda v, w: -v[1] / (THICK * WIDTH)).assemble(basis.boundary("end"))
tape = hv.laws.MixedMode(hv.laws.BilinearCohesion(STRENGTH, ENERGY, STIFFNESS), compression=hv.Compliance(STIFFNESS))


def hung(force: float) -> tuple[hv.fem.FormBody, hv.Solution]:
    """The bracket under a force; nothing but the tape holds it."""
    body = hv.fem.FormBody(basis, elastic, load=force * one_newton)
    return body, hv.solve(body.problem({"wall": hv.Contact(tape)})).raise_for_status()


# %%
# Where the tape is elastic
# -------------------------
# The penetration is negative where the tape opens, and so is the pressure.

_, light = hung(1.0)
y, weights = light.contact.points[:, 1], light.contact.weights
plane = 12.0 * LEVER / (WIDTH * HEIGHT**3) * (y - 0.5 * HEIGHT)
off = float(np.abs(-light.pressure - plane).max() / plane.max())
print(f"tension at most {-light.pressure.min():.6f} MPa per N, by hand {plane.max():.6f}; {off:.1%} off at most")
tears = STRENGTH / float(np.linalg.norm(light.multiplier[light.pressure < 0.0], axis=1).max())
by_hand = STRENGTH / float(np.hypot(plane.max(), 1.0 / (HEIGHT * WIDTH)))
print(f"the tape begins to tear at {tears:.2f} N, by hand {by_hand:.2f}")

# %%
# Beyond
# ------
# At 1.4 times this force the upper part of the tape has passed its strength. What it bears no more the rest takes over:
# the moment about the wall is still F e.

force = 1.4 * by_hand
body, solution = hung(force)
moment = float(weights @ (-solution.pressure * y))
broken = float(weights[solution.penetration < -STRENGTH / STIFFNESS].sum() / weights.sum())
print(f"{force:.1f} N: moment {moment:.4f} Nmm, F e {force * LEVER:.4f}; {broken:.0%} of the tape past its strength")
print(solution.certify().kind)

# %%
# The tractions along the tape, and von Mises stresses on the surface; displacements are 10 times enlarged.

displacement = body.full(solution.problem, solution.unknowns)
facets = mesh.boundary_facets()
surface = skfem.FacetBasis(mesh, basis.elem, facets=facets, quadrature=(np.array([[0.5], [0.5]]), np.array([1.0])))
strain = sym_grad(surface.interpolate(displacement))[..., 0]
deviator = strain - np.trace(strain) / 3.0 * np.eye(3)[:, :, None]
mises = 2.0 * MU * np.sqrt(1.5 * (deviator**2).sum(axis=(0, 1)))
moved = mesh.p + 10.0 * displacement[basis.nodal_dofs]
fig = plt.figure(figsize=(9.0, 4.2), layout="constrained")
left, right = fig.add_subplot(1, 2, 1), fig.add_subplot(1, 2, 2, projection="3d")
left.plot(-light.pressure * tears, y, ".", color="tab:blue", label=f"{tears:.0f} N")
left.plot(plane * tears, y, color="tab:blue", label="by hand")
left.plot(-solution.pressure, y, ".", color="tab:red", label=f"{force:.0f} N")
left.set(xlabel="tension of the tape (MPa)", ylabel="y (mm)")
left.legend()
colour = ScalarMappable(plt.Normalize(0.0, mises.max()), "viridis")
corners = moved[:, mesh.facets[:, facets]][[0, 2, 1]].transpose(2, 1, 0)
right.add_collection3d(Poly3DCollection(corners, facecolors=colour.to_rgba(mises), edgecolor="0.2", linewidth=0.4))
right.set(xlim=(0, 60), ylim=(0, 40), zlim=(0, 60), xlabel="x (mm)", zlabel="y (mm)", yticks=())
right.view_init(elev=22, azim=-50)
right.set_box_aspect((60, 40, 60))
fig.colorbar(colour, ax=right, label="von Mises stress (MPa)", shrink=0.7, pad=0.14)
plt.show()
