r"""
A block under its own weight, against the solution by hand
==========================================================

On :math:`(0, a) \times (0, b)` with :math:`u_x = 0` at both sides, the top fixed and the body force
:math:`(0, -g)`, everything depends on y alone. With :math:`M = \lambda + 2\mu`, :math:`\kappa = M/b` and
:math:`r_0 = g b^2/(2M)` the penetration s of the bottom solves

.. math:: \kappa (r_0 - s) \in \partial j(s), \qquad\text{so}\qquad s = \frac{\max(\kappa r_0 - q,\, 0)}{\kappa + p}

for the survey's law. A light block hangs from its fixed top and presses with less than q without sinking in; a heavy
one sinks in.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv

WIDTH, HEIGHT, LAM, MU, Q_MAX, P_CONST = 1.5, 1.0, 4.0, 4.0, 0.3, 2.0


def block(weight: float) -> hv.ContactProblem:
    """Pattern "cross" shares the weight of a cell evenly, so that linear elements give the solution to rounding."""
    return hv.ContactProblem(
        mesh=hv.rectangle((WIDTH, HEIGHT), (12, 8), pattern="cross"),
        material=hv.Material.lame(LAM, MU),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Clamped()},
        contact={"bottom": hv.Contact(hv.laws.ThresholdCompliance(Q_MAX, P_CONST))},
        body_force=(0.0, -weight),
        title=f"block of weight {weight:g}",
    )


# %%
# Several weights, and what is known by hand.

modulus = LAM + 2.0 * MU
kappa = modulus / HEIGHT
found: dict[float, tuple[float, float]] = {}
print(f"{'weight':>8}{'penetration':>16}{'by hand':>16}{'pressure':>16}{'by hand':>16}")
for weight in (0.3, 0.6, 1.0, 3.0, 10.0):
    solution = hv.solve(block(weight)).raise_for_status()
    free = weight * HEIGHT**2 / (2.0 * modulus)
    sunk = max(kappa * free - Q_MAX, 0.0) / (kappa + P_CONST)
    s, pressure = float(solution.penetration.mean()), float(solution.pressure.mean())
    print(f"{weight:>8g}{s:>16.12f}{sunk:>16.12f}{pressure:>16.12f}{kappa * (free - sunk):>16.12f}")
    found[weight] = (s, pressure)

# %%
# The pressure follows half of the weight up to q = 0.3; from there on part of the load goes into the foundation.

weights = np.linspace(0.0, 10.0, 200)
free = weights * HEIGHT**2 / (2.0 * modulus)
sunk = np.maximum(kappa * free - Q_MAX, 0.0) / (kappa + P_CONST)
fig, (left, right) = plt.subplots(1, 2, figsize=(7.0, 3.0), layout="constrained")
left.plot(weights, sunk, label="by hand")
left.plot(list(found), [pair[0] for pair in found.values()], "o", label="computed")
left.set(xlabel="weight", ylabel="penetration")
left.legend()
right.plot(weights, kappa * (free - sunk))
right.plot(list(found), [pair[1] for pair in found.values()], "o")
right.set(xlabel="weight", ylabel="pressure")
plt.show()
