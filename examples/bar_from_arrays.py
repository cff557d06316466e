r"""
A problem made of arrays: a bar
===============================

An elastic bar, :math:`-EA\,u'' = b` on (0, L), :math:`u(0) = 0`, meets a foundation at x = L. Linear elements are exact
at the nodes, and the displacement r of its end solves the scalar inclusion

.. math:: \kappa (r_0 - r) \in \partial j(r), \qquad \kappa = EA/L, \qquad r_0 = b L^2/(2 EA) - g .

A bar has no tangential direction, so there is one row of the trace for its one contact point.
"""

import matplotlib.pyplot as plt
import numpy as np
import scipy.sparse as sp

import hemivar as hv

ELEMENTS, RIGIDITY, LENGTH, LOAD, GAP = 8, 2.0, 0.5, 6.0, 0.01

# %%
# Stiffness, load and trace by hand; the node at x = 0 is left out because it does not move.

h = LENGTH / ELEMENTS
stiffness = RIGIDITY / h * sp.diags_array([-1.0, 2.0, -1.0], offsets=(-1, 0, 1), shape=(ELEMENTS, ELEMENTS)).tolil()
stiffness[-1, -1] = RIGIDITY / h
load = np.full(ELEMENTS, LOAD * h)
load[-1] = 0.5 * LOAD * h
trace = sp.csr_array(([1.0], ([0], [ELEMENTS - 1])), shape=(1, ELEMENTS))  # penetration: u at x = L, less the gap


def bar(law: hv.laws.Superpotential) -> hv.DiscreteProblem:
    """With a weight of one the multiplier is a force."""
    return hv.DiscreteProblem.of_arrays(
        stiffness=stiffness,
        load=load,
        trace=trace,
        weights=np.ones(1),
        gap=np.array([GAP]),
        law=hv.laws.ContactLaw(law).at(None),
    )


# %%
# Three laws, and the solution by hand.

kappa = RIGIDITY / LENGTH
r0 = LOAD * LENGTH**2 / (2.0 * RIGIDITY) - GAP
q, p, k = 0.3, 2.0, 5.0
cases = {
    "survey": (hv.laws.ThresholdCompliance(q, p), max(kappa * r0 - q, 0.0) / (kappa + p)),
    "compliance": (hv.Compliance(k), kappa * r0 / (kappa + k)),
    "signorini": (hv.Signorini(), 0.0),
}
found: dict[str, tuple[float, float]] = {}
solutions = {}
print(f"{'law':<12}{'penetration':>14}{'by hand':>14}{'reaction':>14}{'by hand':>14}")
for name, (law, exact) in cases.items():
    solution = solutions[name] = hv.solve(bar(law)).raise_for_status()
    r, force = float(solution.penetration[0]), float(solution.pressure[0])
    print(f"{name:<12}{r:>14.10f}{exact:>14.10f}{force:>14.10f}{kappa * (r0 - exact):>14.10f}")
    found[name] = (r, force)

# %%
# Displacements along the bar.

fig, ax = plt.subplots(figsize=(6.0, 3.0), layout="constrained")
for name, solution in solutions.items():
    ax.plot(np.linspace(0.0, LENGTH, ELEMENTS + 1), np.append(0.0, solution.unknowns), ".-", label=name)
ax.axhline(GAP, color="0.6", linestyle=":")
ax.annotate("the gap", (0.0, GAP), xytext=(2, 3), textcoords="offset points", color="0.4")
ax.set(xlabel="x", ylabel="u")
ax.legend()
plt.show()
