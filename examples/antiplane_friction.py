r"""
Antiplane shear: a block that slips on one half of its base
===========================================================

A block is sheared across its plane. In polar coordinates about the middle of its base,

.. math:: u = \frac{g}{\mu}\, y + k\, r^{3/2} \cos\frac{3\varphi}{2}

is harmonic, sticks for x < 0, and slips by :math:`k\,x^{3/2}` for x > 0, where friction is at its bound g.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.gallery import antiplane_friction

# %%
# The problem with this solution prescribed on its other sides.

OPENING = 0.2
known = antiplane_friction(32, modulus=2.0, bound=1.0, opening=OPENING)
solution = hv.solve(known.problem).raise_for_status()
solution.plot()

# %%
# Slip and friction along the base.

assert solution.problem.contact.points is not None
x = solution.problem.contact.points[:, 0]
order = np.argsort(x)
x, slip, friction = x[order], solution.slip[order, 0], solution.friction[order, 0]
exact = OPENING * np.maximum(x, 0.0) ** 1.5
error = float(np.abs(slip - exact).max())
print(f"largest error of the slip {error:.2e}; largest friction {np.abs(friction).max():.9f}, bound 1")
fig, (above, below) = plt.subplots(2, 1, figsize=(6.0, 4.2), sharex=True, layout="constrained")
above.plot(x, exact, label="exact")
above.plot(x, slip, "o", markersize=3, label="computed")
above.set_ylabel("slip")
above.legend()
below.plot(x, np.abs(friction), "o", markersize=3)
below.plot(x, np.where(x < 0.0, 1.0 - 1.5 * 2.0 * OPENING * np.sqrt(np.maximum(-x, 0.0)), 1.0))
below.set(xlabel="x", ylabel="friction")
plt.show()
