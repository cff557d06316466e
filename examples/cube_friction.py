"""
A cube that slips in two directions
===================================

In space friction is a vector in the tangent plane of the contact boundary: it opposes the slip, and its length is
bounded. Laws, methods and certificates are those of the plane.
"""

import numpy as np

import hemivar as hv
from hemivar.report import plot_contact

problem = hv.ContactProblem(
    mesh=hv.box((1.0, 1.0, 1.0), 8),
    material=hv.Material.lame(4.0, 4.0),
    supports={"left": hv.Clamped()},
    contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(q_max=0.3, p_const=2.0), hv.Tresca(0.4))},
    body_force=(-0.2, 0.5, -0.8),
    title="cube with friction",
)
solution = hv.solve(problem).raise_for_status()
print(f"{solution.problem.unknowns} unknowns, {solution.steps} steps, {solution.status.value}")

# %%
# The deformed cube, coloured by the von Mises stress.

solution.plot()

# %%
# Maps of the contact boundary: pressure, friction, penetration, and the states with arrows for the slip.

plot_contact(solution)

# %%
# Where it slips, friction has its full length and points against the slip; and the forces on the body balance.

slip, friction = solution.slip, solution.friction
slipping = solution.tangential_state == hv.solvers.TangentialState.SLIP
length = np.linalg.norm(friction, axis=1)
along = np.einsum("ij,ij->i", slip, friction) / np.maximum(np.linalg.norm(slip, axis=1) * length, 1e-300)
balance = np.array([-0.2, 0.5, -0.8]) + solution.on("bottom").force + solution.reactions["left"]
print(f"{np.count_nonzero(slipping)} of {slipping.size} points slip")
print(
    f"friction there {length[slipping].min():.9f} to {length[slipping].max():.9f}, "
    f"cosine to the slip {along[slipping].min():.9f}"
)
print(f"sum of forces {np.abs(balance).max():.1e}")
print(solution.certify())
