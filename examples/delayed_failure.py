"""
Glue that fails late
====================

A strip of a creeping polymer, clamped at the left and glued below, is pulled up at its right end. With a small force it
creeps to rest. With a little more the strip creeps, the glue softens, and after a long time it tears off.
Lengths in mm, stresses in MPa, times in s.
"""

import matplotlib.pyplot as plt

import hemivar as hv


def strip(force: float) -> hv.ContactProblem:
    """Kelvin-Voigt strip on glue that unloads along the secant."""
    return hv.ContactProblem(
        mesh=hv.rectangle((3.0, 1.0), (18, 5)),
        material=hv.Material.young(100.0, 0.3, viscosity=(288.0, 192.0)),
        tractions={"right": (0.0, force)},
        supports={"left": hv.Clamped()},
        contact={
            "bottom": hv.Contact(
                hv.Adhesive(stiffness=50.0, strength=0.25, softening=2.5, compression=500.0), memory=(hv.laws.Secant(),)
            )
        },
    )


# %%
# Two forces.

histories = {}
for force in (0.2, 0.28):
    histories[force] = hv.march(
        hv.Evolution(strip(force)), until=80.0, step=1.6, save=hv.evolution.Save(every=8.0, probes={"tip": (3.0, 0.0)})
    )
    print(
        f"force {force:g}: the tip opens to {histories[force]['tip.u_y'][-1]:.4f} mm, "
        f"least margin {histories[force].margin:.3f}"
    )

# %%
# Creep to rest, and failure.

fig, ax = plt.subplots(figsize=(6.0, 3.4), layout="constrained")
for force, history in histories.items():
    ax.semilogy(history.times[1:], history["tip.u_y"][1:], label=f"{force:g} MPa")
ax.set(xlabel="t (s)", ylabel="opening of the tip (mm)")
ax.legend()
plt.show()

# %%
# The ledger of the strip that fails: what the glue and the viscosity took.

histories[0.28].plot("ledger")
