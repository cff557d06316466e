"""
A stack of three blocks under a load cycle
==========================================

Three elastic blocks lie on one another, pressed together. The uppermost is dragged to and fro. Coulomb's friction acts in both
joints; the boundaries there are *against* each other, and their nodes do not match. The march keeps a ledger of
the energy: what the support puts in is stored in the bodies or lost by friction, and nothing else.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.evolution import Save

FRICTION, PRESSURE, DRAG = 0.3, 0.4, 0.12  # MPa, mm
WIDTHS, HEIGHT = {"low": 12.0, "middle": 10.0, "top": 8.0}, 4.0  # mm
CELLS = {"low": (24, 8), "middle": (15, 6), "top": (16, 6)}

parts = {}
for level, (name, width) in enumerate(WIDTHS.items()):
    parts[name] = hv.rectangle((width, HEIGHT), CELLS[name], origin=(-width / 2.0, level * HEIGHT))


def dragged(x: np.ndarray, t: float) -> np.ndarray:
    """The displacement along x of the top: to the right, back to the left, and again, in a period of 1."""
    return np.full(len(x), DRAG * np.sin(2.0 * np.pi * t))


joint = hv.Contact(hv.Signorini(), hv.Coulomb(FRICTION), against="low:top")
problem = hv.ContactProblem(
    mesh=hv.Mesh.assembled(parts),
    material=hv.Material.young(20.0, 0.3),
    contact={"middle:bottom": joint, "top:bottom": hv.Contact(joint.normal, joint.friction, against="middle:top")},
    supports={"low:bottom": hv.Clamped(), "top:top": hv.Fixed(x=dragged)},
    tractions={"top:top": (0.0, -PRESSURE)},
    title="a stack of three blocks (mm, MPa)",
)
history = hv.march(problem, 2.0, step=0.02, save=Save(every=0.02))
print(history.ended, "after", len(history.times) - 1, "steps")

# %%
# The ledger: work of the moved support and of the load, energy of the bodies, heat of the joints.

ledger = {name: float(np.asarray(history[name])[-1]) for name in history.columns if name in history.columns}
print(history)
