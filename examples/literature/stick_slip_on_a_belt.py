"""A mass on a spring on a belt: stick and slip.

m = 1, k = 4, the belt runs at 0.1; friction is 1 at rest and 0.6 in slip. The mass sticks for 2 dF/(k V), and slips
for 2 sqrt(m/k) (pi - atan(dF/(V sqrt(k m)))).
"""

import numpy as np

import hemivar as hv

SOURCE = "closed form"
PRINTED = {"period": 4.034443, "largest slip rate": 0.323606798}
REASON = "friction falls over slip rates up to the length of a step, not at once"
WITHIN = 0.08


def computed(fine: bool = False) -> dict[str, float]:
    """Steps of 0.04, or of 0.01; the period is that at which slip begins, by the slip rate at half of its peak."""
    known, step = hv.gallery.StickSlip(), 0.01 if fine else 0.04
    until = known.begins + 2.2 * (known.sticks + known.slips)
    save = hv.evolution.Save(probes={"mass": (0.5, 0.0)})
    scheme = hv.evolution.GeneralizedAlpha(0.0)
    history = hv.march(known.evolution(decay=step), until, step=step, scheme=scheme, save=save)
    rate = np.abs(np.diff(history["mass.u_x"]) / np.diff(history.times))
    fast = rate > 0.5 * known.peak
    starts = history.times[2:][fast[1:] & ~fast[:-1]]
    return {"period": float(starts[-1] - starts[-2]), "largest slip rate": float(rate.max())}
