"""Quadratic traces that leave the domain of a rigid law between nodes, brought back by what they lack at midpoints.

On an edge with ends at distances p and q from the end of the domain, and its midpoint beyond the chord by b,

    (chord) + 4 b t (1 - t)  stays inside    if and only if    4 b <= min p / t + q / (1 - t) = (sqrt p + sqrt q)^2.

The function of the midpoint, which vanishes on all other edges, takes away what b is too large.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.certificates.continuous.body_data import BodyData
from hemivar.certificates.continuous.contact_traces import local_traces

__all__ = ["admissible_displacement"]

#: Part of the unit normal along which supports hold an edge, so that its trace is left as it is.
_HELD = 1e-10


def admissible_displacement(data: BodyData) -> Array:
    """The displacement (nodes, d) with the midpoints of contact edges moved as far as their penetration asks for.

    Gaps are taken quadratic along edges, as the displacement is. Linear elements need nothing.
    """
    u = data.displacement
    if data.order == 1:
        return u
    moved = u.copy()
    at_nodes = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]])
    for number, name in enumerate(data.problem.contact):
        facets = np.flatnonzero(data.contact == number)
        local, frames, places = local_traces(data, name, facets, np.broadcast_to(at_nodes, (len(facets), 3, 2)))
        domain = data.problem.contact[name].law.at(places[:, 2]).penetrations
        first, last, middle = local[..., 0].T
        beyond = middle - 0.5 * (first + last)
        normal = frames[:, 2, 0]
        held = np.einsum("fi,fij,fj->f", normal, data.unknown[facets], normal) > _HELD
        for end, sign in ((domain.upper, 1.0), (domain.lower, -1.0)):
            reach = (np.sqrt(np.maximum(sign * (end - value), 0.0)) for value in (first, last))
            excess = np.maximum(sign * beyond - 0.25 * sum(reach) ** 2, 0.0)
            excess[held | ~np.isfinite(excess)] = 0.0
            moved[data.facet_nodes[facets, 2]] -= (sign * excess)[:, None] * normal
    return moved
