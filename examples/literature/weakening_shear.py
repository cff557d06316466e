"""A block that slips on friction that weakens.

A block of the shear modulus 4 on a floor with friction 0.5 (0.7 + 0.3 exp(-s)) at the slip s, under a body force
that slips it by 0.3 without friction. Where it slips, s = c + W(-(0.3 h/kappa) exp(-c)), W Lambert's function.
"""

import hemivar as hv

SOURCE = "Lambert's W"
PRINTED = {"slip": 0.181215413909818}
REASON = "rounding: a column of squares is exact in shear"
WITHIN = 1e-6


def computed(fine: bool = False) -> dict[str, float]:
    """The block of the gallery."""
    known = hv.gallery.shear_block()
    solution = hv.solve(known.statement).raise_for_status()
    return {"slip": float(abs(solution.slip).mean())}
