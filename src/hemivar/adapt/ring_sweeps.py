"""Rings and rows of cells are improved: fields that balance on single facets, and what flows through all of them.

A cell with two facets in the patch sees stresses that balance on these two. They have a basis on the reference simplex
that is the same for all cells: moments along the edges of a facet, which map as the edges do, and others. So the energy
in it is a product of the compliance with numbers that are known, and what flows is only named in it.

Unknown are, on each facet, moments without force and moment, then the force and the moment that flow. Fields are as
large as the edges of the patch are long.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.linalg as la

from hemivar.adapt.body_data import BodyData
from hemivar.adapt.patches import lowering, rigid_modes
from hemivar.adapt.rings import Rings
from hemivar.adapt.self_balanced import FACET_EDGES, flow_fields, self_balanced
from hemivar.basics.types import Array, IntArray
from hemivar.fem.facet_table import facet_vertices
from hemivar.fem.split_element import MomentSpace, SplitElement

__all__ = ["RingSweeps"]


@dataclass(frozen=True, eq=False)
class RingSweeps:
    """What improves rings and rows of one body.

    Attributes
    ----------
    data : BodyData
    element : SplitElement
    places : array, shape (F, l, d)
        Of the nodes of the facets.
    turning : array, shape (F, r, l, d)
        :func:`hemivar.adapt.self_balanced.turning_fields`.
    """

    data: BodyData
    element: SplitElement
    places: Array
    turning: Array

    def improve(
        self,
        rings: Rings,
        difference: Array,
        moments: Array,
        prices: list[tuple[IntArray, IntArray, Array, Array]],
    ) -> None:
        """Lower the misfit of a stress on rings or rows that share no cell.

        Parameters
        ----------
        rings : Rings
        difference : array, shape (M, n)
            Degrees of freedom of the difference to the stress that is to be met, changed in place.
        moments : array, shape (F, l, d)
            Of the tractions, changed in place.
        prices : list
            Contact facets by patch and slot (p,), with matrices (p, l d, l d) and half the slopes (p, l d) of what
            changes of their moments cost.
        """
        table, element = self.data.table, self.element
        dim, block = table.dim, element.block
        count, slots = rings.facets.shape
        cells = rings.cells.shape[1]
        along, modes = len(FACET_EDGES[dim]), dim * (dim + 1) // 2
        own = block - modes  # fields of a facet, those along its edges first
        loose, through = own - along, modes * rings.flows
        moving = self._moving(rings)

        # cells with the same facets in the patch one after the other
        kind = (rings.sides[:, :, 0] * (dim + 1) + rings.sides[:, :, 1]).ravel()
        order = np.argsort(kind, kind="stable")
        starts = np.flatnonzero(np.diff(kind[order], prepend=-1))
        cell, sides = rings.cells.ravel()[order], rings.sides.reshape(-1, 2)[order]
        patch, place = np.divmod(order, cells)
        at = patch[:, None] * slots + np.stack([place, (place + 1) % slots], axis=1)
        sign = table.signs[cell[:, None], sides]
        outward = np.repeat(sign * rings.free.ravel()[at], along, axis=1)

        # moving fields as the cells see them
        seen = np.zeros((len(cell), 2 * loose + through, 2 * block))
        back = table.inverse[cell].transpose(0, 2, 1)
        for side in range(2):
            turned = moving.reshape(count * slots, -1, dim)[at[:, side]] @ (back * sign[:, side, None, None])
            turned = turned.reshape(len(cell), loose + through, block)
            there = slice(side * block, (side + 1) * block)
            seen[:, side * loose : (side + 1) * loose, there] = turned[:, :loose]
            seen[:, 2 * loose :, there] = turned[:, loose:]

        size = 2 * own + through
        compliance, degrees = self.data.reference_compliance[cell], difference[cell]
        named, energy = np.empty((*seen.shape[:2], size)), np.empty((len(cell), size, size))
        slope = np.empty((len(cell), size))
        ends = np.append(starts, len(cell)).tolist()
        alike = [
            (slice(first, last), _between(element, tuple(sides[first].tolist()), rings.flows))
            for first, last in itertools.pairwise(ends)
        ]
        for some, (space, naming) in alike:
            rows = slice(some.start * seen.shape[1], some.stop * seen.shape[1])
            named.reshape(-1, size)[rows] = seen.reshape(-1, 2 * block)[rows] @ naming
            energy[some] = space.matrix(compliance[some])
            slope[some] = space.slope(degrees[some], compliance[some])
        weighed = named @ energy
        edges = 2 * along
        parts: tuple[Array, ...] = (
            energy[:, :edges, :edges] * (outward[:, :, None] * outward[:, None]),
            weighed[:, :, :edges] * outward[:, None],
            weighed @ named.transpose(0, 2, 1),
            slope[:, :edges] * outward,
            (named @ slope[:, :, None])[:, :, 0],
        )
        if loose:
            parts = _sorted_by_facet(parts, along, loose)
        H, b = _joined([_put(part, order, count, cells) for part in parts], slots)

        missing, slot = np.nonzero(~rings.free)
        for field in range(own):
            H[missing, slot * own + field, slot * own + field] = 1.0
        for ring, slot, price, half in prices:
            on = np.zeros((len(ring), H.shape[1], block))
            fields = self_balanced(self.places[rings.facets[ring, slot]]).reshape(len(ring), -1, block)
            for field in range(along):
                on[np.arange(len(ring)), slot * own + field] = fields[:, field]
            for field in range(loose):
                on[np.arange(len(ring)), slot * own + along + field] = moving[ring, slot, field]
            on[:, slots * own :] = moving[ring, slot, loose:]
            np.add.at(H, ring, on @ price @ on.transpose(0, 2, 1))
            np.add.at(b, ring, (on @ half[:, :, None])[:, :, 0])
        try:
            change = np.asarray(-np.linalg.solve(H, b[:, :, None])[:, :, 0], dtype=float)
        except np.linalg.LinAlgError:
            return  # of cells without volume; nothing but the sharpness depends on it
        change[~lowering(H, b, change)] = 0.0

        numbers, flow = change[:, : slots * own].reshape(count, slots, own), change[:, slots * own :]
        both = np.concatenate([numbers[:, :, along:], np.broadcast_to(flow[:, None], (count, slots, through))], axis=2)
        moved = (both[:, :, None] @ moving).reshape(*rings.facets.shape, -1, dim)
        nodes = self.places[rings.facets]
        for number, (i, j) in enumerate(FACET_EDGES[dim]):
            couple = numbers[:, :, number, None] * (nodes[:, :, j] - nodes[:, :, i])
            moved[:, :, i] += couple
            moved[:, :, j] -= couple
        moments[rings.facets] += moved
        numbers = numbers.reshape(count * slots, own)[at]
        coefficients = np.concatenate([numbers[:, 0, along:], numbers[:, 1, along:], flow[patch]], axis=1)
        local = (coefficients[:, None] @ named)[:, 0]
        local[:, :edges] += numbers[:, :, :along].reshape(len(cell), -1) * outward
        for some, (space, _) in alike:
            difference[cell[some]] = degrees[some] + local[some] @ space.summing.T

    def _moving(self, rings: Rings) -> Array:
        """Moments (k, s, fields, l d) without force and moment across edges, and of what flows through all facets."""
        dim = self.data.table.dim
        count, slots = rings.facets.shape
        nodes = self.places[rings.facets]
        flat = (nodes - nodes.mean(axis=(1, 2))[:, None, None]).reshape(-1, *nodes.shape[2:])
        fields = (
            self_balanced(flat)[:, len(FACET_EDGES[dim]) :]
            if self.data.order == 2
            else np.empty((len(flat), 0, dim, dim))
        )
        fields = fields * rings.free.reshape(-1, 1, 1, 1)
        if rings.flows:
            size = np.repeat(np.abs(flat).reshape(count, -1).max(axis=1), slots)
            flows = flow_fields(self.turning[rings.facets].reshape(len(flat), -1, *flat.shape[1:]), flat.mean(axis=1))
            flows[:, :dim] *= (size * rings.flow.ravel())[:, None, None, None]
            flows[:, dim:] *= (size**2 * rings.flow.ravel())[:, None, None, None]
            fields = np.concatenate([fields, flows], axis=1) if fields.size else flows
        return np.asarray(fields.reshape(count, slots, fields.shape[1], flat.shape[1] * dim))


@cache
def _between(element: SplitElement, facets: tuple[int, int], flows: bool) -> tuple[MomentSpace, Array]:
    """Stresses of the reference simplex that balance on two facets, and what takes moments there to their numbers.

    First come moments along the edges of both facets, then others; without ``flows`` each facet balances by itself.
    """
    dim, block = element.dim, element.block
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    members = facet_vertices(dim)[list(facets)]
    nodes = corners[members]
    if element.order == 2:
        nodes = np.concatenate([nodes, nodes.mean(axis=1, keepdims=True)], axis=1)
    along = np.zeros((2, len(FACET_EDGES[dim]), 2, block))
    modes = np.zeros((2, dim * (dim + 1) // 2, 2, block))
    for side in range(2):
        along[side, :, side] = self_balanced(nodes[side][None])[0, : along.shape[1]].reshape(-1, block)
        modes[side, :, side] = np.moveaxis(rigid_modes(nodes[side]), 1, 0).reshape(-1, block)
    conditions = (modes.sum(axis=0) if flows else modes).reshape(-1, 2 * block)
    edges = along.reshape(-1, 2 * block)
    rest = la.null_space(np.vstack([conditions, edges]))
    balanced = np.hstack([edges.T, rest])
    fields = np.zeros((element.moments, balanced.shape[1]))
    fields.reshape(dim + 1, block, -1)[list(facets)] = balanced.reshape(2, block, -1)
    return MomentSpace(element, fields), np.ascontiguousarray(np.linalg.pinv(balanced).T)


def _put(part: Array, order: IntArray, count: int, cells: int) -> Array:
    """Numbers of cells that come in this order by patch and cell."""
    out = np.empty_like(part)
    out[order] = part
    return out.reshape(count, cells, *part.shape[1:])


def _sorted_by_facet(parts: tuple[Array, ...], along: int, loose: int) -> tuple[Array, ...]:
    """Fields of the first facet, those of the second, what flows; before, those along edges come first."""
    edges, across, both, slope, rest = parts
    whole = np.concatenate([
        np.concatenate([edges, across.transpose(0, 2, 1)], axis=2), np.concatenate([across, both], axis=2)
    ], axis=1)  # fmt: skip
    sides = (
        [*range(side * along, (side + 1) * along), *range(2 * along + side * loose, 2 * along + (side + 1) * loose)]
        for side in range(2)
    )
    own = np.array([number for side in sides for number in side])
    flow = np.arange(len(own), whole.shape[1])
    force = np.concatenate([slope, rest], axis=1)
    return (
        whole[:, own[:, None], own], whole[:, flow[:, None], own], whole[:, flow[:, None], flow],
        force[:, own], force[:, flow],
    )  # fmt: skip


def _joined(parts: list[Array], slots: int) -> tuple[Array, Array]:
    """Matrices and vectors of rings and rows of those of their cells (k, c, ...).

    Numbers of a cell are those of the facet it begins with, of the facet it ends with, and of what flows: the matrices
    are given by the parts among facets, of what flows with facets, and of what flows; the vectors by both parts.
    """
    facets, across, flows, force, rest = parts
    count, cells, through, width = across.shape
    own = width // 2
    end = slots * own
    H, b = np.zeros((count, end + through, end + through)), np.zeros((count, end + through))
    for c in range(min(cells, slots - 1)):
        both = slice(c * own, (c + 2) * own)
        H[:, both, both] += facets[:, c]
        H[:, end:, both] += across[:, c]
        b[:, both] += force[:, c]
    if slots == cells:  # the last cell ends with the first facet
        last, first = slice(end - own, end), slice(own)
        for rows, seen in ((last, slice(own)), (first, slice(own, width))):
            for columns, beside in ((last, slice(own)), (first, slice(own, width))):
                H[:, rows, columns] += facets[:, -1, seen, beside]
            H[:, end:, rows] += across[:, -1, :, seen]
            b[:, rows] += force[:, -1, seen]
    H[:, :end, end:] = H[:, end:, :end].transpose(0, 2, 1)
    H[:, end:, end:] = flows.sum(axis=1)
    b[:, end:] = rest.sum(axis=1)
    return H, b
