"""Tractions on facets by their resultants, and those that have none.

On a facet with vertices x_a the moments ``m_k = x_l - x_k = -m_l`` along each of its edges have neither force nor
moment: one field on an edge, three on a triangle. With ``m_a = rho(x_a)``, rho a rigid motion, they make all moments of
a facet, and any force and moment is that of one rho. Quadratic tractions of an edge have two more such fields: equal
moments at its ends, along the edge or across, and twice the opposite one at its midpoint.
"""

from __future__ import annotations

import numpy as np

from hemivar.adapt.patches import Batch, rigid_modes
from hemivar.basics.types import Array, BoolArray
from hemivar.fem.facet_table import FacetTable
from hemivar.mesh.keys import EDGES

__all__ = ["flow_fields", "orientations", "self_balanced", "turning_fields"]


def self_balanced(nodes: Array) -> Array:
    """Moments (k, s, l, d) without force and moment, s = 1 or 3, of facets with these nodes (k, l, d)."""
    count, dim = nodes.shape[1:]
    pairs = ((0, 1),) if dim == 2 else EDGES[2]
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
    """Moments (k, r, l, d) of facets with these nodes (k, l, d): each a unit moment, without force."""
    count, places, dim = nodes.shape
    turns = rigid_modes(nodes - nodes.mean(axis=1, keepdims=True))[:, :, dim:].transpose(0, 2, 1, 3)
    flat = turns.reshape(count, -1, places * dim)
    return np.asarray(np.linalg.inv(flat @ flat.transpose(0, 2, 1)) @ flat).reshape(turns.shape)


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


def orientations(table: FacetTable, batch: Batch) -> tuple[Array, BoolArray]:
    """How a force flows through rings and rows of cells: the sign (k, f) on each facet, and where it can, (k,).

    Through a cell with two facets of the patch what enters by one leaves by the other. A ring is closed; a row needs a
    facet of the patch at both ends.
    """
    count, facets = batch.facets.shape
    cells = batch.cells.shape[1]
    closed = np.asarray(table.interior[batch.facets].all(axis=1) & (facets == cells))
    can = closed | (facets == cells + 1)
    inside = batch.place < facets
    two = inside.sum(axis=2) == 2
    can &= two.all(axis=1)
    first = np.argmax(inside, axis=2)
    second = inside.shape[2] - 1 - np.argmax(inside[:, :, ::-1], axis=2)
    every = np.arange(count)
    sign = table.signs[batch.cells]
    flow = np.zeros((count, facets + 1))
    flow[:, 0] = 1.0
    for _ in range(facets):
        for c in range(cells):
            a, b = batch.place[every, c, first[:, c]], batch.place[every, c, second[:, c]]
            turn = -sign[every, c, first[:, c]] * sign[every, c, second[:, c]]
            forward = two[:, c] & (flow[every, a] != 0.0) & (flow[every, b] == 0.0)
            flow[every[forward], b[forward]] = (turn * flow[every, a])[forward]
            backward = two[:, c] & (flow[every, b] != 0.0) & (flow[every, a] == 0.0)
            flow[every[backward], a[backward]] = (turn * flow[every, b])[backward]
        if (flow[can, :facets] != 0.0).all():
            break
    flow = flow[:, :facets]
    can &= (flow != 0.0).all(axis=1)
    flow[~can] = 0.0
    return flow, can
