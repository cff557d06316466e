"""
A warm body that nothing clamps
===============================

Pushed harder from the left than from the right a body slides on a foundation whose friction weakens with the slip rate,
and warms where it is squeezed and where it rubs (Bartman, Bartosz, Jureczka, Szafraniec, arXiv:1901.07845). Deformation
and friction make heat; the foundation takes and gives it.
"""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.tri import Triangulation

import hemivar as hv
from hemivar.gallery import thermoviscoelastic

# %%
# The motion until t = 1. Every step solves for the motion and the heat in turn.

body = thermoviscoelastic(16)
evolution = hv.Evolution(body.problem, inertia=True, heat=body.heat)
history = hv.march(evolution, body.until, step=1.0 / 32.0, save=hv.evolution.Save(every=1.0 / 32.0))
print(f"at most {history['rounds'].max():.0f} rounds of motion and heat in a step; least margin {history.margin:.3f}")

# %%
# Two balances
# ------------
# Momentum along the foundation, from tractions and friction on the one hand and from the velocities on the other; and
# the book of heat. The steps ask for neither.

frame, discrete = history.frames[-1], history.discrete
assert discrete.mass is not None
speed = discrete.restrict(frame.velocity, np.zeros(0))
rigid = discrete.restrict(np.tile([1.0, 0.0], (len(frame.velocity), 1)), np.zeros(0))
momentum = float(rigid @ discrete.mass.times(speed))
step, friction = history["step"], history["friction_force"]
pushed = float(np.sum(step * (48.0 / 6.0 - 44.0 / 6.0))) - abs(float(np.sum(step * friction)))
assert history.state.heat is not None
heat = history.state.heat.book
print(f"momentum {momentum:.6f}, pushed {pushed:.6f}; heat {heat.content:.6f}, gap of its book {heat.gap:.1e}")

# %%
# Temperatures on the deformed body
# ---------------------------------

mesh = discrete.field.mesh
temperature = frame.temperature
assert temperature is not None
print(f"at the end {temperature.min():.4f} to {temperature.max():.4f}")
fig, panels = plt.subplots(1, 3, figsize=(10.5, 3.0), sharey=True, layout="constrained")
for ax, time in zip(panels, (0.0625, 0.25, 1.0), strict=True):
    then = history.at(time)
    place = Triangulation(*(mesh.points + then.displacement).T, mesh.cells)
    drawn = ax.tripcolor(place, then.temperature, shading="gouraud", cmap="inferno", vmin=0.25, vmax=0.28)
    ax.axhline(0.0, color="0.4", linewidth=1.0)
    ax.set(aspect="equal", title=f"t = {time:g}", xlabel="x", xlim=(-0.1, 1.75), ylim=(-0.05, 1.2))
panels[0].set_ylabel("y")
fig.colorbar(drawn, ax=panels, label="temperature", shrink=0.9)
plt.show()
