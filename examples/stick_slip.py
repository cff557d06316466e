r"""
Stick and slip
==============

A mass on a spring on a belt. Friction falls from Fs to Fk as soon as it slips: it sticks until the spring pulls with
Fs, shoots forward, and sticks again. Period and peak of the slip rate are known:

.. math::

   T = \frac{2 \Delta F}{k V} + \frac{2}{\omega} \Bigl( \pi - \arctan \frac{\Delta F}{V \sqrt{k m}} \Bigr), \qquad
   v_{\max} = V + \sqrt{V^2 + \Delta F^2/(k m)} .
"""

import matplotlib.pyplot as plt
import numpy as np

import hemivar as hv
from hemivar.gallery import StickSlip

belt = StickSlip()
until = belt.begins + 2.2 * (belt.sticks + belt.slips)
history = hv.march(belt.evolution(decay=0.02), until, step=0.03, save=hv.evolution.Save(probes={"mass": (0.5, 0.0)}))
period = belt.sticks + belt.slips
print(f"period {period:.4f}, largest slip rate {belt.peak:.4f}, heat of a period {belt.loss:.4f}")

# %%
# Friction force and displacement of the mass.

fig, (above, below) = plt.subplots(2, 1, figsize=(6.4, 4.4), sharex=True, layout="constrained")
above.plot(history.times, np.abs(history["friction_force"]))
above.axhline(belt.static, color="0.6", linestyle=":")
above.axhline(belt.kinetic, color="0.6", linestyle=":")
above.set_ylabel("friction force")
below.plot(history.times, history["mass.u_x"])
below.set(xlabel="t", ylabel="displacement")
plt.show()

# %%
# The slip rate passes half of its peak once in a period, upwards.

rate = np.abs(np.diff(history["mass.u_x"]) / np.diff(history.times))
fast = rate > 0.5 * belt.peak
starts = history.times[2:][fast[1:] & ~fast[:-1]]
print("it shoots forward at", np.round(starts, 2), "with at most", round(float(rate.max()), 4))
