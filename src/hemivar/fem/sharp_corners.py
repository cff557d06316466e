"""Nodes at sharp corners of a boundary that touches on both sides of them: they belong to the side that is nearer.

One normal cannot stand for both sides.  The other side hands the share of the node on to its other nodes.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import BoolArray
from hemivar.fem.pairing import Pairing

__all__ = ["handed_on"]

#: Cosine of the angle of two facets from which a corner is sharp.
_SHARP = np.cos(np.radians(40.0))


def handed_on(pieces: Pairing) -> BoolArray:
    """Which nodes (f, n) of the slave's facets belong to nearer facets beyond a sharp corner."""
    members, normal = pieces.sides[0].nodes, pieces.sides[0].normals
    facet, column = np.nonzero(np.broadcast_to(pieces.touches[:, None], members.shape))
    node, distance = members[facet, column], pieces.distance[facet]
    ordered = np.lexsort((distance, node))
    _, first, group = np.unique(node[ordered], return_index=True, return_inverse=True)
    nearest = np.empty(len(node), dtype=np.int64)
    nearest[ordered] = ordered[first[group]]
    sharp = np.einsum("kd,kd->k", normal[facet], normal[facet[nearest]]) < _SHARP
    away = np.zeros(members.shape, dtype=bool)
    away[facet, column] = sharp & (distance > distance[nearest] + pieces.slack[facet])
    return away
