"""Changes of the tractions of patches that keep the equilibrium of every cell.

A facet with vertices x_a has moments without force and without moment about any point, its own fields
(:mod:`hemivar.certificates.continuous.self_balanced`). All others carry a force and a moment from the cell on one side
to that on the other. In equilibrium they flow round circuits of the graph whose nodes are the cells of the patch, and
what is outside of the body, and whose edges are the facets: one circuit around a vertex in the plane or an edge in
space, none through a single facet. Facets of rollers take up forces along some directions only: their fields are found
numerically, and are few.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.continuous.patches import rigid_modes
from hemivar.certificates.continuous.self_balanced import (
    FACET_EDGES,
    across_fields,
    edge_fields,
    flow_fields,
    with_resultants,
)

__all__ = ["PatchFields", "patch_fields"]

#: Part of the largest work on free facets below which a rigid motion does none.
_FREE = 1e-10


@dataclass(frozen=True, eq=False)
class PatchFields:
    """Fields of k patches with f facets each, q for each patch: those of the facets, of the circuits, of rollers.

    Where a patch has fewer than others the rest vanish.
    """

    #: Places of the nodes of the facets about the middle of the patch.
    nodes: Array  # (k, f, l, d)
    #: Facets all of whose components are free.
    whole: BoolArray  # (k, f)
    #: 1 where a circuit leaves the first cell of a facet through it, -1 where it enters that cell, else 0.
    circuits: Array  # (k, w, f)
    #: Moments of the fields with rollers.
    partly: Array  # (k, r, f, l, d)

    def take(self, chosen: IntArray) -> PatchFields:
        """Of some patches."""
        return PatchFields(self.nodes[chosen], self.whole[chosen], self.circuits[chosen], self.partly[chosen])

    def matrix(self) -> Array:
        """Moments (k, f, l, d, q)."""
        count, facets, places, dim = self.nodes.shape
        flat = self.nodes.reshape(-1, places, dim)
        own = np.concatenate([edge_fields(flat), across_fields(flat)], axis=1)
        own = own.reshape(count, facets, -1, places, dim) * self.whole[:, :, None, None, None]
        number, width, modes = own.shape[2], self.circuits.shape[1], dim * (dim + 1) // 2
        out = np.zeros((count, facets, places, dim, facets * number + width * modes + self.partly.shape[1]))
        for j in range(facets):
            out[:, j, :, :, j * number : (j + 1) * number] = np.moveaxis(own[:, j], 1, 3)
        if width:
            flow = np.moveaxis(self._flows().reshape(count, facets, modes, places, dim), 2, 4)
            signs = self.circuits.transpose(0, 2, 1)[:, :, None, None, :, None]
            both = (flow[:, :, :, :, None] * signs).reshape(count, facets, places, dim, -1)
            out[..., facets * number : facets * number + width * modes] = both
        out[..., facets * number + width * modes :] = np.moveaxis(self.partly, 1, 4)
        return out

    def moments(self, numbers: Array) -> Array:
        """Moments (k, f, l, d) of so much of each field, (k, q)."""
        count, facets, places, dim = self.nodes.shape
        pairs, flat = FACET_EDGES[dim], self.nodes.reshape(-1, places, dim)
        across = across_fields(flat)
        number = len(pairs) + across.shape[1]
        own = (numbers[:, : facets * number].reshape(count, facets, number) * self.whole[:, :, None]).reshape(
            -1, number
        )
        out = np.zeros(flat.shape)
        for column, (i, j) in enumerate(pairs):
            couple = own[:, column, None] * (flat[:, j] - flat[:, i])
            out[:, i] += couple
            out[:, j] -= couple
        if number > len(pairs):
            out = np.asarray(out + np.einsum("kn,knad->kad", own[:, len(pairs) :], across))
        width, modes = self.circuits.shape[1], dim * (dim + 1) // 2
        if width:
            flow = numbers[:, facets * number : facets * number + width * modes].reshape(count, width, modes)
            through = (self.circuits.transpose(0, 2, 1) @ (flow * self._sizes[:, None])).reshape(-1, modes)
            out += with_resultants(flat, through[:, :dim], through[:, dim:])
        moved = out.reshape(self.nodes.shape)
        if self.partly.shape[1]:
            moved = moved + np.einsum("kr,krfad->kfad", numbers[:, -self.partly.shape[1] :], self.partly)
        return np.asarray(moved)

    @property
    def _sizes(self) -> Array:
        """Forces and moments (k, d + m) of a unit of flow, for fields as large as the patch."""
        dim = self.nodes.shape[3]
        reach = np.abs(self.nodes).max(axis=(1, 2, 3))
        powers = np.where(np.arange(dim * (dim + 1) // 2) < dim, 1.0, 2.0)
        return np.asarray(reach[:, None] ** powers)

    def _flows(self) -> Array:
        """Moments (k, f, modes, l d) of flows through facets."""
        count, facets, places, dim = self.nodes.shape
        flows = flow_fields(self.nodes.reshape(-1, places, dim)).reshape(count, facets, -1, places * dim)
        return np.asarray(flows * self._sizes[:, None, :, None])


def patch_fields(places: Array, ends: IntArray, whole: BoolArray, cells: int, freed: Array) -> PatchFields:
    """All fields of patches.

    ``places`` is (k, f, l, d); ``ends`` is (k, f, 2); ``whole`` is (k, f); ``freed`` is (k, f, d, d).
    """
    count, facets, at, dim = places.shape
    nodes = places - places.mean(axis=(1, 2))[:, None, None]
    circuits, path, label = _circuits(ends, whole, cells)
    fields = PatchFields(nodes, whole, circuits, np.zeros((count, 0, facets, at, dim)))
    if whole.all():
        return fields
    return PatchFields(nodes, whole, circuits, _partly(fields, ends, path, label, freed))


def _circuits(ends: IntArray, usable: BoolArray, cells: int) -> tuple[Array, Array, IntArray]:
    """Independent circuits (k, w, f), and for each cell and the outside (k, c + 1, f) a path to the root of its tree.

    Paths and circuits are facets with the sign of the way in which they are passed. Trees have numbers (k, c + 1).
    """
    count, facets = usable.shape
    every = np.arange(count)
    label = np.tile(np.arange(cells + 1), (count, 1))
    path, found = np.zeros((count, cells + 1, facets)), np.zeros((count, facets, facets))
    closed = np.zeros((count, facets), dtype=bool)
    for j in range(facets):
        one, two = ends[:, j].T
        first, second = label[every, one], label[every, two]
        step = path[every, two] - path[every, one]  # from two to the roots, and back to one
        step[:, j] += 1.0
        closed[:, j] = usable[:, j] & (first == second)
        found[:, j] = step
        joins = usable[:, j] & (first != second)
        moved = (label == second[:, None]) & joins[:, None]
        path -= moved[:, :, None] * step[:, None]
        label = np.where(moved, first[:, None], label)
    width = int(closed.sum(axis=1).max(initial=0))
    order = np.argsort(~closed, axis=1, kind="stable")[:, :width]
    circuits = np.take_along_axis(found * closed[:, :, None], order[:, :, None], axis=1)
    return circuits, path, label


def _partly(fields: PatchFields, ends: IntArray, path: Array, label: IntArray, freed: Array) -> Array:
    """Fields (k, r, f, l, d) that have moments on facets of the boundary not all of whose components are free.

    Each such moment has a resultant, which flows on through the cells: outside where a facet lets it, else against
    those of others, which is a condition on all of them.
    """
    count, facets, places, dim = fields.nodes.shape
    modes, cells = dim * (dim + 1) // 2, path.shape[1] - 1
    shut = ~fields.whole
    slots = int(shut.sum(axis=1).max())
    facet = np.argsort(~shut, axis=1, kind="stable")[:, :slots]
    there = np.take_along_axis(shut, facet, axis=1)
    every = np.arange(count)[:, None]
    size, axes = np.linalg.eigh(freed[every, facet])
    axes = axes.transpose(0, 1, 3, 2) * (there[:, :, None] & (size > 0.5))[..., None]  # one way after the other
    moments = np.zeros((count, slots, places, dim, facets, places, dim))
    for slot in range(slots):
        for a in range(places):
            moments[every[:, 0], slot, a, :, facet[:, slot], a] = axes[:, slot]
    reach = np.abs(fields.nodes).max(axis=(1, 2, 3))
    rigid = rigid_modes(fields.nodes[every, facet] / reach[:, None, None, None])  # (k, s, l, modes, d)
    resultants = np.einsum("ksamd,ksid->ksaim", rigid, axes).reshape(count, slots, -1, modes)

    root = label[every, ends[every, facet, 0]]
    outside = label[:, -1:]
    way = path[every, ends[every, facet, 0]]
    way = way - (root == outside)[:, :, None] * path[:, -1:]  # on from the root
    carried = resultants * np.where(np.arange(modes) < dim, 1.0, reach[:, None, None, None])
    through = flow_fields(fields.nodes.reshape(-1, places, dim)).reshape(count, facets, modes, places, dim)
    moments = moments.reshape(count, slots, places * dim, facets, places, dim)
    moments -= np.einsum("ksf,ksnm,kfmad->ksnfad", way, carried, through, optimize=True)

    width = slots * places * dim
    tree = (root[:, :, None] == np.arange(cells + 1)) & (root[:, :, None] != outside[:, :, None])
    conditions = np.einsum("kst,ksnm->ktmsn", tree.astype(float), resultants).reshape(count, -1, width)
    idle = np.repeat(~np.asarray(axes.any(axis=3)), places, axis=1).reshape(count, width)
    conditions = np.concatenate([conditions, idle[:, :, None] * np.eye(width)], axis=1)
    _, size, ways = np.linalg.svd(conditions)
    kept = np.ones((count, width), dtype=bool)
    kept[:, : size.shape[1]] = size <= _FREE
    ways = ways * kept[:, :, None]
    return np.asarray(np.einsum("krn,knfad->krfad", ways, moments.reshape(count, width, facets, places, dim)))
