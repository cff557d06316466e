r"""
Wear
====

A block is pressed down at once and drawn over a foundation that wears by Archard's law, :math:`w' = k P V`. The worn
depth relieves body and foundation, which in series have the stiffness :math:`S = \kappa p/(\kappa + p)`:

.. math:: P(t) = S D\, e^{-S k V t} .
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.gallery import wearing_block

# %%
# Forty steps; the first one presses the block down.

known = wearing_block(modulus=24.0, stiffness=24.0, coefficient=0.02, speed=0.5, depth=0.1)
history = hv.march(known.evolution, known.until, step=known.until / 40, stops=known.stops)
exact = np.array([known.exact(float(t)) for t in history.times])
error = float(np.abs(history["normal_force"][2:] / exact[2:] - 1.0).max())
print(f"largest relative error of the pressure {error:.2e} with {len(history.times) - 1} steps")

# %%
# Against the closed form.

fig, ax = plt.subplots(figsize=(6.0, 3.2), layout="constrained")
ax.plot(history.times[1:], exact[1:], label="exact")
ax.plot(history.times[1:], history["normal_force"][1:], ".", label="computed")
ax.set(xlabel="t", ylabel="pressure", ylim=(0.0, None))
ax.legend()
plt.show()

# %%
# Wear is a memory of the contact points: the law of each step is that of the worn foundation.

(state,) = history.state.memory.values()
for name, values in state.items():
    print(f"{name}: {np.min(values):.6f} to {np.max(values):.6f} at the end")
