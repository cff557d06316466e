"""Archard's punch on a belt.

A block of modulus M = 24 is pressed down by D = 0.1 onto a foundation k = 24, and drawn over it at V = 0.5. Wear by
w' = K p V relieves it: p = p0 exp(-C K V t), 1/C = 1/M + 1/k, K = 0.02.
"""

import hemivar as hv

SOURCE = "Archard's law; closed form"
PRINTED = {"pressure at t = 0": 1.2, "at t = 4": 0.742540070}
REASON = "implicit Euler: order one in the step"
WITHIN = 1e-2


def computed(fine: bool = False) -> dict[str, float]:
    """16 steps, or 256."""
    known = hv.gallery.wearing_block(modulus=24.0, stiffness=24.0, coefficient=0.02, speed=0.5, depth=0.1)
    history = hv.march(known.evolution, 4.0, step=4.0 / (256 if fine else 16), stops=known.stops)
    return {"pressure at t = 0": history["normal_force"][1], "at t = 4": history["normal_force"][-1]}
