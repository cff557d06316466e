"""What the law adds to the energy, and the forces by which a pair misses its graph: the same for every system."""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws import VectorLaw

__all__ = ["contact_energy", "law_forces"]


def contact_energy(law: VectorLaw, weights: Array, r: Array, close: float) -> float:
    """``sum_j w_j j_j(r_j)`` of local displacements (m, d).

    Where a law ends (a rigid foundation), a penetration beyond its end by no more than ``close`` counts as being at the
    end; beyond that the energy is +inf.

    Shapes: ``weights`` (m,), ``r`` (m, d).
    """
    domain = law.penetrations
    inside = np.clip(r[:, 0], domain.lower, domain.upper)
    if (inside != r[:, 0]).any():
        r = r.copy()
        r[:, 0] = np.where(np.abs(inside - r[:, 0]) <= close, inside, r[:, 0])
    return float(weights @ law.value(r))


def law_forces(law: VectorLaw, weights: Array, r: Array, lam: Array, compliance: Array) -> Array:
    """Forces (m,) by which pairs of local displacement and multiplier (m, d) miss the graph of the law.

    A bound that depends on the solution is taken at the pair itself.

    Shapes: ``weights`` (m,), ``r`` (m, d), ``lam`` (m, d), ``compliance`` (m, 2).
    """
    return np.asarray(weights * law.frozen(r, lam).graph_distance(r, lam, compliance))
