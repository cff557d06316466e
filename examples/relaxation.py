r"""
Relaxation: a body that forgets its strain
==========================================

A standard solid, a spring beside a spring with a dashpot, is pushed at once onto a compliant foundation. The pressure
falls from :math:`k_0 p D/(k_0 + p)` to :math:`k p D/(k + p)`, with the time :math:`T (k_0 + p)/(k + p)`.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.gallery import relaxing_block

# %%
# Three lengths of step, against the closed form.

known = relaxing_block(modulus=6.0, branch=6.0, time=0.5, stiffness=2.0, depth=0.1)
errors = {}
for steps in (10, 20, 40):
    history = hv.march(known.evolution, 1.0, step=1.0 / steps, stops=known.stops)
    errors[steps] = abs(float(history["normal_force"][-1]) - known.exact(1.0))
    print(f"{steps:>3} steps: error at t = 1 {errors[steps]:.2e}, gap of the ledger {history.ledger['gap']:.1e}")

# %%
# Branches are integrated exactly for displacements that go straight within a step: the error falls like the square of
# the step.

times = np.linspace(0.01, 1.0, 100)
fig, ax = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
ax.plot(times, [known.exact(float(t)) for t in times], label="exact")
ax.plot(history.times[1:], history["normal_force"][1:], ".", label="computed")
ax.set(xlabel="t", ylabel="normal force")
ax.legend()
plt.show()

# %%
# Where the energy is, and where it went.

history.plot("ledger")
