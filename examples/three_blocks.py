"""
A stack of three blocks under a load cycle
==========================================

Three rubber blocks lie on one another, pressed together; the uppermost is dragged to and fro. Coulomb's friction acts
in both joints. The boundaries there are *against* each other, and their nodes do not match. The load grows from
zero, and before it presses nothing but its mass holds the block in the middle: its density is stated. The march keeps a
ledger of the energy: what support and load put in is stored or lost, and nothing else.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.evolution import Save

FRICTION, PRESSURE, DRAG = 0.2, 0.4, 0.5  # MPa, mm
WIDTHS, HEIGHT = {"low": 12.0, "middle": 10.0, "top": 8.0}, 4.0  # mm
CELLS = {"low": (24, 8), "middle": (15, 6), "top": (16, 6)}

parts = {}
for level, (name, width) in enumerate(WIDTHS.items()):
    parts[name] = hv.rectangle((width, HEIGHT), CELLS[name], origin=(-width / 2.0, level * HEIGHT))


def pressed(x: np.ndarray, t: float) -> np.ndarray:
    """The load on the top: it grows until t = 0.2."""
    return np.full((len(x), 2), (0.0, -PRESSURE * min(t / 0.2, 1.0)))


def drag(t: np.ndarray) -> np.ndarray:
    """From t = 0.2 on the top is dragged to the right, back to the left, and again, in a period of 1."""
    return DRAG * np.sin(2.0 * np.pi * np.maximum(t - 0.2, 0.0))


joint = hv.Contact(hv.Signorini(), hv.Coulomb(FRICTION), against="low:top")
problem = hv.ContactProblem(
    mesh=hv.Mesh.assembled(parts),
    material=hv.Material.young(20.0, 0.3, density=1.1e-9),
    contact={"middle:bottom": joint, "top:bottom": hv.Contact(joint.normal, joint.friction, against="middle:top")},
    supports={"low:bottom": hv.Clamped(), "top:top": hv.Fixed(x=lambda x, t: np.full(len(x), drag(t)))},
    tractions={"top:top": pressed},
    title="a stack of three blocks (mm, MPa)",
)
history = hv.march(hv.Evolution(problem, inertia=True), 2.2, step=0.02, save=Save(every=0.02))
print(history.ended, "after", len(history.times) - 1, "steps")

# %%
# The energy balance at the end. Its gap is the balance error, which is rounding.

put_in = history["work"] + history["moved"]
stored = history["elastic"] + history["kinetic"] + history["contact"]
lost = history["friction"] + history["numerical"]
gap = float(np.abs(put_in - (stored - stored[0]) - lost).max() / np.abs(put_in).max())
print(f"put in {put_in[-1]:.4f} N mm per mm, stored {stored[-1]:.4f}, lost by friction {history['friction'][-1]:.4f}")
print(f"lost by the scheme {history['numerical'][-1]:.4f}, left over {gap:.1e} of the largest entry")

# %%
# The joints carry what Coulomb's law allows and no more: the friction coefficient times the force of the load.

limit = FRICTION * PRESSURE * WIDTHS["top"]
shown = {"top on middle": "top:bottom", "middle on low": "middle:bottom"}
most = {words: float(np.abs(history[f"{name}.friction_force"]).max()) for words, name in shown.items()}
print(f"friction at most {max(most.values()):.4f} N per mm; Coulomb's law allows {limit:.4f}")

# %%
# Left: the friction of the joints over the displacement of the top, a loop whose area is heat. Right: the ledger.

fig, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.4), layout="constrained")
for words, name in shown.items():
    left.plot(drag(history.times), history[f"{name}.friction_force"], label=words)
left.axhline(limit, color="0.6", linestyle=":")
left.axhline(-limit, color="0.6", linestyle=":")
left.set(xlabel="displacement of the top (mm)", ylabel="friction force (N/mm)")
left.legend()
right.plot(history.times, put_in, color="black", label="put in")
right.stackplot(history.times, stored, history["friction"], history["numerical"], alpha=0.6,
                labels=("stored", "lost by friction", "lost by the scheme"))  # fmt: skip
right.set(xlabel="t", ylabel="energy (N mm/mm)")
right.legend(loc="upper left")
plt.show()

# %%
# The stack where it is farthest to the right, and to the left; displacements are drawn three times as large.

fig, axes = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained", sharey=True)
for panel, time in zip(axes, (0.46, 0.96), strict=True):
    frame = history.at(time)
    moved = problem.mesh.points + 3.0 * frame.displacement
    stress = hv.fem.von_mises(problem.at_time(time), frame.displacement)
    image = panel.tripcolor(*moved.T, problem.mesh.cells, facecolors=stress, cmap="cividis", edgecolor="#00000030")
    panel.set(aspect="equal", title=f"t = {frame.time:.2f}", xlabel="x (mm)")
axes[0].set_ylabel("y (mm)")
fig.colorbar(image, ax=axes, label="von Mises stress (MPa)")
plt.show()
