"""
Any consistent units
====================

hemivar has no units of its own. Lengths, forces per area and what is made of them (force per volume, stiffness of a
foundation in force per area and length) have to fit together, and results come in the same units. Inside, methods work
on scaled unknowns, and tolerances are relative to the load, so that they take the same steps in all systems.
"""

import numpy as np

import hemivar as hv
from hemivar.report import plot_solution


def bracket(length: float, pressure: float) -> hv.ContactProblem:
    """A rubber bracket 0.2 m x 0.1 m on a bed; ``length`` is a metre and ``pressure`` a pascal in the units used."""
    return hv.ContactProblem(
        mesh=hv.rectangle((0.2 * length, 0.1 * length), (40, 20), pattern="cross"),
        material=hv.Material.young(5e6 * pressure, 0.4, plane="stress"),
        supports={"left": hv.Clamped()},
        contact={
            "bottom": hv.Contact(
                hv.laws.ThresholdCompliance(q_max=1e4 * pressure, p_const=2e7 * pressure / length),
                hv.Tresca(6e3 * pressure),
                gap=0.5e-3 * length,
            )
        },
        body_force=(0.0, -1.2e4 * pressure / length),
        tractions={"top": hv.Pressure(2.0e4 * pressure), "right": (1.5e4 * pressure, 0.0)},
        title="bracket",
    )


# %%
# In metres and pascals, and in millimetres and megapascals.

si = hv.solve(bracket(length=1.0, pressure=1.0)).raise_for_status()
mm = hv.solve(bracket(length=1e3, pressure=1e-6)).raise_for_status()
for name, found in (("m, Pa", si), ("mm, MPa", mm)):
    largest = float(np.abs(found.displacement).max())
    print(f"{name}: displacement {largest:.6e}, pressure {found.pressure.max():.6e}, {found.steps} steps")

# %%
# The differences are those of rounding. Energies are force times length per thickness: Pa m² and MPa mm².

displacement = float(np.abs(mm.displacement / 1e3 - si.displacement).max() / np.abs(si.displacement).max())
pressure = float(np.abs(mm.multiplier / 1e-6 - si.multiplier).max() / np.abs(si.multiplier).max())
energy = abs(mm.energy / (1e-6 * 1e6) / si.energy - 1.0)
print(f"relative differences: displacement {displacement:.1e}, multiplier {pressure:.1e}, energy {energy:.1e}")

# %%
# Part of the bracket touches its bed, half a millimetre below it.

touching = np.count_nonzero(si.states.closed)
slipping = np.count_nonzero(si.tangential_state == hv.solvers.TangentialState.SLIP)
print(f"{touching} of {si.normal_state.size} nodes touch, {slipping} slip")
plot_solution(mm, unit="mm", stress_unit="MPa", scale="auto")
