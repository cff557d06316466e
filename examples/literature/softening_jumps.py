"""A spring that softens faster than the body: jumps.

A body of stiffness 1 on springs 2 that soften by 2 from 0.1 on is pushed slowly to and fro. It jumps at 0.3 on the
way in and at 0.2 on the way out, and loses 1/60. The global minimum would switch at sqrt(0.06).
"""

import numpy as np

import hemivar as hv

SOURCE = "Mielke, Rossi, Savare 2012; closed form"
PRINTED = {"jump in": 0.3, "jump out": 0.2, "lost": 1 / 60, "jump of global minima": 0.244948974}
REASON = "a jump is seen in the step in which it happens"
WITHIN = 0.051


def jumps(history: hv.evolution.History) -> tuple[float, float]:
    """How far it was pushed when the force vanished, and when it came back."""
    pushed, held = np.minimum(history.times, 0.8 - history.times), history["normal_force"] > 0.05
    inward = history.times <= 0.4
    return pushed[inward & held].max(), pushed[~inward & held].max()


def computed(fine: bool = False) -> dict[str, float]:
    """Steps of 0.01, or a tenth of it."""
    known, step = hv.gallery.jumping_block(), 1e-3 if fine else 1e-2
    local, best = (
        hv.march(known.evolution, 0.8, step=step, stops=known.stops, jump=jump) for jump in ("local", "global")
    )
    inward, outward = jumps(local)
    found = (inward, outward, local.ledger["jumps"], jumps(best)[0])
    return dict(zip(PRINTED, map(float, found), strict=True))
