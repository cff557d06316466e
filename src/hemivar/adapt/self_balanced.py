"""Tractions on facets by their resultants, and those that have none.

On a facet with vertices x_a the moments ``m_k = x_l - x_k = -m_l`` along each of its edges have neither force nor
moment: one field on an edge, three on a triangle. With ``m_a = rho(x_a)``, rho a rigid motion, they make all moments of
a facet, and any force and moment is that of one rho. Quadratic tractions of an edge have two more such fields: equal
moments at its ends, along the edge or across, and twice the opposite one at its midpoint.
"""

from __future__ import annotations

import numpy as np

from hemivar.adapt.patches import rigid_modes
from hemivar.basics.types import Array
from hemivar.mesh.keys import EDGES

__all__ = ["FACET_EDGES", "flow_fields", "self_balanced", "turning_fields"]

#: The edges of a facet by its vertices, in the plane and in space.
FACET_EDGES = {2: ((0, 1),), 3: EDGES[2]}

#: Facets whose fields are made at a time: they fit a cache.
_FACETS = 1 << 12


def self_balanced(nodes: Array) -> Array:
    """Moments (k, s, l, d) without force and moment, s = 1 or 3, of facets with these nodes (k, l, d)."""
    count, dim = nodes.shape[1:]
    pairs = FACET_EDGES[dim]
    fields = np.zeros((len(nodes), len(pairs) + 2 * (count - dim), count, dim))
    for number, (k, m) in enumerate(pairs):
        along = nodes[:, m] - nodes[:, k]
        fields[:, number, k], fields[:, number, m] = along, -along
    if count > dim:
        along = nodes[:, 1] - nodes[:, 0]
        for number, way in ((1, along), (2, np.stack([-along[:, 1], along[:, 0]], axis=1))):
            fields[:, number] = way[:, None] * np.array([0.5, 0.5, -1.0])[:, None]
    return fields


def turning_fields(nodes: Array) -> Array:
    """Moments (k, r, l, d) of facets with these nodes (k, l, d): each a unit moment, without force.

    On a triangle with sides a and b from vertex 0, and ``n = a x b``, that is w for ``m_1 = (w.n b / 2 - w.b n) / n.n``
    and ``m_2 = (w.a n - w.n a / 2) / n.n``. There are others; but for self-balanced fields they are the same.
    """
    dim = nodes.shape[2]
    if dim == 2:
        turns = rigid_modes(nodes - nodes.mean(axis=1, keepdims=True))[:, :, dim:].transpose(0, 2, 1, 3)
        return np.asarray(turns / np.sum(turns * turns, axis=(2, 3), keepdims=True))
    out = np.empty((len(nodes), dim, dim, dim))
    for start in range(0, len(nodes), _FACETS):
        part = slice(start, start + _FACETS)
        a, b = nodes[part, 1] - nodes[part, 0], nodes[part, 2] - nodes[part, 0]
        n = np.stack([a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
        unit = n / np.sum(n * n, axis=1, keepdims=True)  # w.n / n.n and n / n.n
        out[part, :, 1] = 0.5 * unit[:, :, None] * b[:, None] - b[:, :, None] * unit[:, None]
        out[part, :, 2] = a[:, :, None] * unit[:, None] - 0.5 * unit[:, :, None] * a[:, None]
        out[part, :, 0] = -out[part, :, 1] - out[part, :, 2]
    return out


def flow_fields(turning: Array, middle: Array) -> Array:
    """Moments (k, d + r, l, d) of facets: each a unit force at the origin, or a moment about it.

    Parameters
    ----------
    turning : array (k, r, l, d)
        :func:`turning_fields`.
    middle : array (k, d)
        Middles of the facets, where a force that is the same at all nodes acts.
    """
    count, turns, places, dim = turning.shape
    flat = turning.reshape(count, turns, -1)
    fields = np.empty((count, dim + turns, places * dim))
    fields[:, :dim] = np.tile(np.eye(dim), places) / places - rigid_modes(middle)[:, dim:].transpose(0, 2, 1) @ flat
    fields[:, dim:] = flat
    return fields.reshape(count, -1, places, dim)
