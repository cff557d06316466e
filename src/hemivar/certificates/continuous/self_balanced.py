"""Tractions on facets by their resultants, and those that have none.

On a facet with vertices x_a the moments ``m_k = x_l - x_k = -m_l`` along each of its edges have neither force nor
moment: one field on an edge, three on a triangle. With ``m_a = rho(x_a)``, rho a rigid motion, they make all moments of
a facet, and any force and moment is that of one rho. Quadratic tractions of an edge have two more such fields: equal
moments at its ends, along the edge or across, and twice the opposite one at its midpoint.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.types import Array
from hemivar.certificates.continuous.patches import rigid_modes
from hemivar.mesh.keys import EDGES

__all__ = ["FACET_EDGES", "across_fields", "edge_fields", "flow_fields", "with_resultants"]

#: The edges of a facet by its vertices, in the plane and in space.
FACET_EDGES = {2: ((0, 1),), 3: EDGES[2]}


def edge_fields(nodes: Array) -> Array:
    """Moments (k, e, l, d) along the edges of facets with these nodes (k, l, d): without force and moment."""
    pairs = FACET_EDGES[nodes.shape[2]]
    fields = np.zeros((len(nodes), len(pairs), *nodes.shape[1:]))
    for number, (i, j) in enumerate(pairs):
        along = nodes[:, j] - nodes[:, i]
        fields[:, number, i], fields[:, number, j] = along, -along
    return fields


def across_fields(nodes: Array) -> Array:
    """The other moments (k, s, l, d) without force and moment, s = 0 or 2, of facets with these nodes (k, l, d)."""
    count, dim = nodes.shape[1:]
    if count == dim:
        return np.empty((len(nodes), 0, count, dim))
    along = nodes[:, 1] - nodes[:, 0]
    ways = np.stack([along, np.stack([-along[:, 1], along[:, 0]], axis=1)], axis=1)
    return np.asarray(ways[:, :, None] * np.array([0.5, 0.5, -1.0])[:, None])


def with_resultants(nodes: Array, force: Array, couple: Array) -> Array:
    """Moments (k, l, d) of facets with these nodes (k, l, d) that have a force (k, d), and a moment (k, r) about 0.

    They are forces that are the same at all nodes, and a moment without force. On a triangle with sides a and b from
    vertex 0, and ``n = a x b``, the latter is w for ``m_1 = (w.n b / 2 - w.b n) / n.n`` and ``m_2 = (w.a n - w.n a / 2)
    / n.n``. There are others; but for self-balanced fields they are the same.
    """
    middle = nodes.mean(axis=1)
    left = couple - (rigid_modes(middle)[:, nodes.shape[2] :] @ force[:, :, None])[:, :, 0]
    return np.asarray(force[:, None] / nodes.shape[1] + _turning(nodes, left[:, None])[:, 0])


def flow_fields(nodes: Array) -> Array:
    """Moments (k, d + r, l, d) of facets with these nodes (k, l, d): each a unit force, or a unit moment about 0.

    Those of :func:`with_resultants`.
    """
    count, places, dim = nodes.shape
    modes = dim * (dim + 1) // 2
    turns = np.broadcast_to(np.eye(modes - dim), (count, modes - dim, modes - dim))
    flat = _turning(nodes, turns).reshape(count, modes - dim, -1)
    fields = np.empty((count, modes, places * dim))
    fields[:, :dim] = np.tile(np.eye(dim), places) / places
    fields[:, :dim] -= rigid_modes(nodes.mean(axis=1))[:, dim:].transpose(0, 2, 1) @ flat
    fields[:, dim:] = flat
    return fields.reshape(count, modes, places, dim)


def _turning(nodes: Array, couple: Array) -> Array:
    """Moments (k, q, l, d) without force that have these moments (k, q, r)."""
    dim = nodes.shape[2]
    if dim == 2:
        turns = rigid_modes(nodes - nodes.mean(axis=1, keepdims=True))[:, :, 2]
        turns /= np.sum(turns * turns, axis=(1, 2))[:, None, None]
        return np.asarray(couple[:, :, :, None] * turns[:, None])
    a, b = nodes[:, 1] - nodes[:, 0], nodes[:, 2] - nodes[:, 0]
    n = np.stack([a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=1)
    unit = n / np.sum(n * n, axis=1, keepdims=True)
    turn, along, across = np.moveaxis(couple @ np.stack([0.5 * unit, a, b], axis=2), 2, 0)[..., None]
    out = np.empty((*couple.shape[:2], dim, dim))
    out[:, :, 1] = turn * b[:, None] - across * unit[:, None]
    out[:, :, 2] = along * unit[:, None] - turn * a[:, None]
    out[:, :, 0] = -out[:, :, 1] - out[:, :, 2]
    return out
