r"""
A block that bounces
====================

In time every step is one static problem, with its residual and margin, and all energy is booked. A block falls on a
compliant foundation, bounces, rubs and comes to rest.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar import gallery

problem = hv.ContactProblem(
    mesh=hv.rectangle((2.0, 1.0), (8, 4)),
    material=hv.Material.lame(400.0, 400.0, density=1.0, viscosity=(0.2, 0.2)),
    contact={"bottom": hv.Contact(hv.Compliance(400.0), hv.Coulomb(0.3), gap=0.05)},
    body_force=(0.0, -1.0),
    title="a block that bounces",
)
evolution = hv.Evolution(problem, inertia=True, velocity=(0.2, 0.0))
history = hv.march(
    evolution,
    until=0.8,
    step=0.01,
    scheme=hv.evolution.GeneralizedAlpha(0.8),
    save=hv.evolution.Save(every=0.05, probes={"corner": (0.0, 0.0)}),
    events=[hv.evolution.Touch()],
)
print(history)
print(f"it touches first at t = {history.events[0][0]:.3f}; a free fall of 0.05 takes {np.sqrt(0.1):.3f}")

# %%
# The ledger: energies that are stored, and all that has been lost, against what was put in.

history.plot("ledger")

# %%
# Force of the foundation, and height of a corner.

fig, (above, below) = plt.subplots(2, 1, figsize=(6.4, 4.2), sharex=True, layout="constrained")
above.plot(history.times, history["normal_force"])
above.set_ylabel("normal force")
below.plot(history.times, history["corner.u_y"])
below.axhline(-0.05, color="0.5", linestyle=":")
below.set(xlabel="t", ylabel="height of the corner")
plt.show()

# %%
# A bounce with a closed form
# ---------------------------
# A mass 1 on a spring k and a damper c that cannot pull leaves with a part of its speed that is known.

known = gallery.bouncing_block(stiffness=100.0, damping=4.0)
duration, restitution = gallery.bounce(100.0, 4.0)
hit = hv.march(known.evolution, known.until, step=4e-3, scheme=hv.evolution.Midpoint())
up = float(np.abs(hit.state.body.velocity).max())
print(f"speed after the bounce {up:.6f}, exact {known.exact(known.until):.6f}; restitution {restitution:.4f}")
