r"""
Impact of a bar
===============

A bar that is let go stretched by 1/2 hits a rigid wall at t = 1 (Doyen, Ern, Piperno 2011). Its end stays at the wall
with the pressure 1/2 until t = 2 and goes back by t = 3; no energy is lost.
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.gallery import bar_on_wall

# %%
# Two ways to do without oscillations: the law of impact of Moreau and Jean, or Newmark's scheme with the mass of the
# contact nodes given to their neighbours.

CELLS = 48
runs = {
    "Newmark, redistributed mass": hv.march(bar_on_wall(CELLS), 3.0, step=1 / 192, scheme=hv.evolution.Newmark()),
    "Moreau-Jean": hv.march(bar_on_wall(CELLS, "consistent"), 3.0, step=1 / 192, scheme=hv.evolution.MoreauJean()),
}
means = {}
for name, history in runs.items():
    pressure, t = history["normal_force"] * CELLS, history.times
    inside = (t > 1.1) & (t < 1.9)
    means[name] = float(pressure[inside].mean())
    kept = history.state.ledger.stored / history.state.ledger.start
    print(f"{name:<28} mean pressure at the wall {means[name]:.4f} (exact 0.5), energy kept {kept:.4f}")

# %%
# Pressure at the wall.

fig, ax = plt.subplots(figsize=(6.4, 3.4), layout="constrained")
for name, history in runs.items():
    ax.plot(history.times, history["normal_force"] * CELLS, linewidth=0.9, label=name)
exact_times = np.array([0.0, 1.0, 1.0, 2.0, 2.0, 3.0])
ax.plot(exact_times, [0.0, 0.0, 0.5, 0.5, 0.0, 0.0], color="black", linestyle=":", label="exact")
ax.set(xlabel="t", ylabel="pressure at the wall", ylim=(-0.1, 1.2))
ax.legend()
plt.show()
