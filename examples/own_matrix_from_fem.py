r"""
A matrix from another finite element code
=========================================

Here plain scikit-fem with quadrilaterals, which hemivar itself does not have; FEniCS or NGSolve work alike. What
hemivar needs of such a code: the stiffness matrix and the load on the free unknowns, and where in the vector of
unknowns the normal and tangential displacement of each contact node stand.

A block is pressed onto the foundation by moving its top down by D; the solution by hand is linear,
:math:`s = (\kappa D - q)/(\kappa + p)`, :math:`\kappa = \lambda + 2\mu`.
"""

import matplotlib.pyplot as plt
import numpy as np
import scipy.sparse as sp
import skfem
from skfem.models.elasticity import linear_elasticity

import hemivar as hv

LAM, MU, DOWN, Q_MAX, P_CONST = 4.0, 4.0, 0.1, 0.3, 2.0

# %%
# The other code
# --------------
# A matrix without boundary conditions, the unknowns that are held, and their values.

mesh = skfem.MeshQuad.init_tensor(np.linspace(0, 1, 9), np.linspace(0, 1, 7)).with_defaults()
basis = skfem.Basis(mesh, skfem.ElementVector(skfem.ElementQuad1()))
full = sp.csr_array(linear_elasticity(LAM, MU).assemble(basis))
value = np.zeros(full.shape[0])
top = basis.get_dofs("top").all("u^2")
value[top] = -DOWN
held = np.union1d(basis.get_dofs({"left", "right"}).all("u^1"), top)
free = np.setdiff1d(np.arange(full.shape[0]), held)

# %%
# The contact nodes
# -----------------
# Penetration is displacement along the outward normal (0, -1), slip along (1, 0), the normal turned by +90 degrees. The
# weight of a node is half of the adjacent facets.

nodes = np.unique(mesh.facets[:, mesh.boundaries["bottom"]])
nodes = nodes[np.argsort(mesh.p[0, nodes])]
m = nodes.size
spacing = np.diff(mesh.p[0, nodes])
weights = 0.5 * (np.append(spacing, 0.0) + np.insert(spacing, 0, 0.0))
rows, columns = np.arange(2 * m), basis.nodal_dofs[::-1, nodes].T.ravel()  # u_y, u_x of node 1, u_y, u_x of ...
trace = sp.csr_array((np.tile([-1.0, 1.0], m), (rows, columns)), shape=(2 * m, full.shape[0]))

# %%
# The problem
# -----------
# Rows of the trace at the two corners are zero along x, for the walls hold them. The constant makes E the whole elastic
# energy.

problem = hv.DiscreteProblem.of_arrays(
    stiffness=full[free][:, free],
    load=-(full @ value)[free],
    trace=trace[:, free],
    weights=weights,
    gap=np.zeros(m),
    law=hv.laws.ContactLaw(hv.laws.ThresholdCompliance(Q_MAX, P_CONST), hv.Tresca(0.1)).at(mesh.p[:, nodes].T),
    constant=0.5 * float(value @ (full @ value)),
)
solution = hv.solve(problem).raise_for_status()
displacement = value.copy()
displacement[free] = solution.unknowns

kappa = LAM + 2.0 * MU
sunk = (kappa * DOWN - Q_MAX) / (kappa + P_CONST)
penetration, spread = float(solution.penetration.mean()), float(np.ptp(solution.penetration))
print(f"penetration {penetration:.15f} (by hand {sunk:.15f}), its spread over the nodes {spread:.1e}")
print(f"energy {solution.energy:.12f}, normal force {solution.normal_force:.12f}")

# %%
# Drawn by the other code's mesh, displacements as they are.

moved = mesh.translated((0.0, 0.0)).p + displacement[basis.nodal_dofs]
fig, ax = plt.subplots(figsize=(4.5, 4.0), layout="constrained")
for points, colour in ((mesh.p, "0.8"), (moved, "tab:blue")):
    for facet in mesh.facets.T:
        ax.plot(*points[:, facet], color=colour, linewidth=0.8)
ax.axhline(0.0, color="black")
ax.set(aspect="equal", xlabel="x", ylabel="y")
plt.show()
