"""Rings and rows of cells are improved: fields that balance on single facets, and what flows through all of them.

A cell with two facets in the patch sees stresses that balance on these two. They have a basis on the reference simplex
that is the same for all cells: moments along the edges of a facet, which map as the edges do, and others. So the energy
in it is a product of the compliance with numbers that are known, and what flows is only named in it.

Unknown are, on each facet, moments without force and moment, then the force and the moment that flow, counted as they
leave the cell before the facet. Fields are as large as the edges of the patch are long.

Rings and rows of one kind have one system: what they do to a difference is found once, and is a product with it. Fields
on facets are those of their own nodes, so that equilibrium does not depend on how alike they are.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array, IntArray
from hemivar.certificates.continuous.body_data import BodyData
from hemivar.certificates.continuous.facet_table import facet_vertices
from hemivar.certificates.continuous.patches import lowering, lowering_inverse, rigid_modes
from hemivar.certificates.continuous.rings import Rings
from hemivar.certificates.continuous.self_balanced import (
    FACET_EDGES,
    across_fields,
    edge_fields,
    flow_fields,
    with_resultants,
)
from hemivar.certificates.continuous.split_element import MomentSpace, SplitElement

__all__ = ["RingSweeps"]


@dataclass(frozen=True, eq=False)
class RingSweeps:
    """What improves rings and rows of one body.

    Attributes
    ----------
    data : BodyData
    element : SplitElement
    """

    data: BodyData
    element: SplitElement
    _answers: dict[int, _Answer] = field(default_factory=dict, repr=False)

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
        nodes = self.data.places(rings.facets)
        if rings.kind < 0 or prices:
            system = self._system(rings, nodes)
            degrees = difference[system.cells]
            change = system.best(degrees, prices)
            difference[system.cells] = degrees + system.degrees(change)
        else:
            answer, degrees = self._answer(rings), difference[rings.cells]
            flat = degrees.reshape(len(degrees), -1)
            change = flat @ answer.numbers
            difference[rings.cells] = (flat + change @ answer.degrees).reshape(degrees.shape)
        moments[rings.facets] += _moments(rings, nodes, change)

    def _answer(self, rings: Rings) -> _Answer:
        """That of all rings or rows of their kind."""
        if rings.kind not in self._answers:
            one = rings.take(slice(1))
            self._answers[rings.kind] = self._system(one, self.data.places(one.facets)).answer()
        return self._answers[rings.kind]

    def _system(self, rings: Rings, nodes: Array) -> _System:
        """The least misfit of rings or rows, their facets with these nodes (k, s, l, d)."""
        data, element = self.data, self.element
        dim, block = data.table.dim, element.block
        (count, slots), cells = rings.facets.shape, rings.cells.shape[1]
        along, moving = len(FACET_EDGES[dim]), _moving(rings, nodes)
        loose = block - dim * (dim + 1) // 2 - along
        through = moving.shape[2] - loose

        # cells with the same facets in the patch one after the other
        kind = (rings.sides[:, :, 0] * (dim + 1) + rings.sides[:, :, 1]).ravel()
        order = np.argsort(kind, kind="stable")
        starts = np.flatnonzero(np.diff(kind[order], prepend=-1))
        cell, sides = rings.cells.ravel()[order], rings.sides.reshape(-1, 2)[order]
        patch, place = np.divmod(order, cells)
        at = patch[:, None] * slots + np.stack([place, (place + 1) % slots], axis=1)
        outward = np.repeat(np.array([-1.0, 1.0]) * rings.free.ravel()[at], along, axis=1)

        # moving fields as the cells see them
        seen = np.zeros((len(cell), 2 * loose + through, 2 * block))
        back = data.table.inverse[cell].transpose(0, 2, 1)
        for side, sign in enumerate((-1.0, 1.0)):
            fields = moving.reshape(count * slots, moving.shape[2] * block // dim, dim)[at[:, side]]
            turned = (fields @ (sign * back)).reshape(len(cell), loose + through, block)
            there = slice(side * block, (side + 1) * block)
            seen[:, side * loose : (side + 1) * loose, there] = turned[:, :loose]
            seen[:, 2 * loose :, there] = turned[:, loose:]

        size = 2 * (along + loose) + through
        compliance = data.reference_compliance[cell]
        named, energy = np.empty((*seen.shape[:2], size)), np.empty((len(cell), size, size))
        spaces = []
        for first, last in itertools.pairwise(np.append(starts, len(cell)).tolist()):
            some, rows = slice(first, last), slice(first * seen.shape[1], last * seen.shape[1])
            space, naming = _between(element, tuple(sides[first].tolist()), rings.flows)
            named.reshape(-1, size)[rows] = seen.reshape(-1, 2 * block)[rows] @ naming
            energy[some] = space.matrix(compliance[some])
            spaces.append((some, space))
        return _System(rings, order, nodes, moving, loose, compliance, spaces, outward, named, energy)


@dataclass(frozen=True, eq=False)
class _Answer:
    """What all rings or rows of a kind, of c cells each, do to a difference.

    Attributes
    ----------
    numbers : array, shape (c n, q)
        Takes its degrees of freedom to the numbers of the fields that are best.
    degrees : array, shape (q, c n)
        Takes these to what the degrees of freedom change by.
    """

    numbers: Array
    degrees: Array


@dataclass(frozen=True, eq=False)
class _System:
    """The misfit of k rings or rows of c cells in their q fields: those on facets, slot by slot, then what flows.

    Attributes
    ----------
    rings : Rings
    order : int array, shape (k c,)
        Cells, patch by patch, in the order of what follows.
    nodes : array, shape (k, s, l, d)
        Of the facets.
    moving : array, shape (k, s, m, l d)
        :func:`_moving`.
    loose : int
        How many of these belong to single facets.
    compliance : array, shape (k c, v, v)
        On the reference simplex.
    spaces : list of slice and MomentSpace
        Stresses of cells with the same facets in the patch.
    outward : array, shape (k c, e)
        Signs of the fields along the edges of both facets; 0 where these are not free.
    named : array, shape (k c, f, p)
        The moving fields of both facets, and what flows, in these stresses.
    energy : array, shape (k c, p, p)
        Of the stresses.
    """

    rings: Rings
    order: IntArray
    nodes: Array
    moving: Array
    loose: int
    compliance: Array
    spaces: list[tuple[slice, MomentSpace]]
    outward: Array
    named: Array
    energy: Array

    @property
    def cells(self) -> IntArray:
        """Their numbers, in this order."""
        return np.asarray(self.rings.cells.ravel()[self.order])

    def best(self, degrees: Array, prices: list[tuple[IntArray, IntArray, Array, Array]]) -> Array:
        """Numbers (k, q) of the least misfit and price for degrees of freedom (k c, n) of the difference."""
        slopes = np.empty(self.energy.shape[:2])
        for some, space in self.spaces:
            slopes[some] = space.slope(degrees[some], self.compliance[some])
        H, b = self._matrix(), self._loads(slopes[:, :, None])[:, :, 0]
        slots, along, own = self._sizes
        for ring, slot, price, half in prices:
            on, every = np.zeros((len(ring), H.shape[1], price.shape[1])), np.arange(len(ring))
            fields = edge_fields(self.nodes[ring, slot]).reshape(len(ring), along, -1)
            for number in range(along):
                on[every, slot * own + number] = fields[:, number]
            for number in range(self.loose):
                on[every, slot * own + along + number] = self.moving[ring, slot, number]
            on[:, slots * own :] = self.moving[ring, slot, self.loose :]
            on *= self.rings.turn[ring, slot][:, None, None]
            np.add.at(H, ring, on @ price @ on.transpose(0, 2, 1))
            np.add.at(b, ring, (on @ half[:, :, None])[:, :, 0])
        try:
            change = np.asarray(-np.linalg.solve(H, b[:, :, None])[:, :, 0], dtype=float)
        except np.linalg.LinAlgError:
            return np.zeros(b.shape)  # of cells without volume; nothing but the sharpness depends on it
        change[~lowering(H, b, change)] = 0.0
        return change

    def degrees(self, change: Array) -> Array:
        """What degrees of freedom (k c, n) change by, for numbers (k, q)."""
        slots, along, own = self._sizes
        edges, (count, cells) = 2 * along, self.rings.cells.shape
        patch, place = np.divmod(self.order, cells)
        at = patch[:, None] * slots + np.stack([place, (place + 1) % slots], axis=1)
        numbers = change[:, : slots * own].reshape(count * slots, own)[at]
        loose = numbers[:, :, along:].reshape(len(at), -1)
        coefficients = np.concatenate([loose, change[:, slots * own :][patch]], axis=1)
        local = (coefficients[:, None] @ self.named)[:, 0]
        local[:, :edges] += numbers[:, :, :along].reshape(len(at), -1) * self.outward
        return np.concatenate([local[some] @ space.summing.T for some, space in self.spaces])

    def answer(self) -> _Answer:
        """That of the kind of a single ring or row."""
        H, (count, size) = self._matrix()[0], self.energy.shape[:2]
        ways = self._loads(np.eye(count * size).reshape(count, size, -1))[0].reshape(-1, count, size)
        n = len(self.spaces[0][1].summing)
        slopes, degrees = np.empty((count, n, len(H))), np.empty((len(H), count, n))
        for some, space in self.spaces:
            for cell in range(some.start, some.stop):
                place = int(self.order[cell])
                compliance = np.broadcast_to(self.compliance[cell], (n, *self.compliance.shape[1:]))
                slopes[place] = space.slope(np.eye(n), compliance) @ ways[:, cell].T
                degrees[:, place] = ways[:, cell] @ space.summing.T
        return _Answer(-slopes.reshape(-1, len(H)) @ lowering_inverse(H), degrees.reshape(len(H), -1))

    @property
    def _sizes(self) -> tuple[int, int, int]:
        """Numbers of slots, of fields along the edges of a facet, and of all fields of a facet."""
        along = self.outward.shape[1] // 2
        return self.rings.facets.shape[1], along, along + self.loose

    def _matrix(self) -> Array:
        """The matrices (k, q, q)."""
        slots, along, own = self._sizes
        edges, outward = 2 * along, self.outward
        weighed = self.named @ self.energy
        parts = [
            self.energy[:, :edges, :edges] * (outward[:, :, None] * outward[:, None]),
            weighed[:, :, :edges] * outward[:, None],
            weighed @ self.named.transpose(0, 2, 1),
        ]
        if self.loose:
            facets, across, both = parts
            whole = np.concatenate([
                np.concatenate([facets, across.transpose(0, 2, 1)], axis=2), np.concatenate([across, both], axis=2)
            ], axis=1)  # fmt: skip
            ours, flow = self._by_facet(whole.shape[1])
            parts = [whole[:, ours[:, None], ours], whole[:, flow[:, None], ours], whole[:, flow[:, None], flow]]
        H = _joined_matrices([self._by_patch(part) for part in parts], slots)
        missing, slot = np.nonzero(~self.rings.free)
        for number in range(own):
            H[missing, slot * own + number, slot * own + number] = 1.0
        return H

    def _loads(self, slopes: Array) -> Array:
        """Slopes (k, q, r) of the misfit for those (k c, p, r) by the stresses of the cells."""
        edges = self.outward.shape[1]
        parts = [slopes[:, :edges] * self.outward[:, :, None], self.named @ slopes]
        if self.loose:
            whole = np.concatenate(parts, axis=1)
            ours, flow = self._by_facet(whole.shape[1])
            parts = [whole[:, ours], whole[:, flow]]
        force, rest = (self._by_patch(part) for part in parts)
        return _joined_loads(force, rest, self.rings.facets.shape[1])

    def _by_facet(self, count: int) -> tuple[IntArray, IntArray]:
        """Fields of the first facet of a cell and those of the second; what flows. Before, edges of both come first."""
        along, loose = self.outward.shape[1] // 2, self.loose
        sides = (
            [*range(side * along, (side + 1) * along), *range(2 * along + side * loose, 2 * along + (side + 1) * loose)]
            for side in range(2)
        )
        ours = np.array([number for side in sides for number in side])
        return ours, np.arange(len(ours), count)

    def _by_patch(self, part: Array) -> Array:
        """Numbers of the cells, patch by patch and cell by cell."""
        out = np.empty_like(part)
        out[self.order] = part
        return out.reshape(*self.rings.cells.shape, *part.shape[1:])


def _around(nodes: Array) -> tuple[Array, Array]:
    """Nodes (k, s, l, d) seen from the middle of each patch, and how far they reach (k,)."""
    local = nodes - nodes.mean(axis=(1, 2))[:, None, None]
    return local, np.asarray(np.abs(local).max(axis=(1, 2, 3)))


def _moving(rings: Rings, nodes: Array) -> Array:
    """Moments (k, s, m, l d) without force and moment across edges, and of what flows through all facets."""
    (count, slots), dim = rings.facets.shape, nodes.shape[3]
    local, reach = _around(nodes)
    flat = local.reshape(-1, *nodes.shape[2:])
    fields = across_fields(flat) * rings.free.reshape(-1, 1, 1, 1)
    if rings.flows:
        size = np.repeat(reach, slots)[:, None, None, None]
        flows = flow_fields(flat)
        flows[:, :dim] *= size
        flows[:, dim:] *= size**2
        fields = np.concatenate([fields, flows], axis=1) if fields.size else flows
    return np.asarray(fields.reshape(count, slots, fields.shape[1], flat[0].size))


def _moments(rings: Rings, nodes: Array, change: Array) -> Array:
    """What the moments of the facets, with these nodes (k, s, l, d), change by for numbers (k, q) of the fields."""
    slots, dim, flat = rings.facets.shape[1], nodes.shape[3], nodes.reshape(-1, *nodes.shape[2:])
    along, flows = len(FACET_EDGES[dim]), dim * (dim + 1) // 2 if rings.flows else 0
    own = (change.shape[1] - flows) // slots
    numbers, flow = change[:, : slots * own].reshape(-1, own), change[:, slots * own :]
    moved = np.zeros(flat.shape)
    for number, (i, j) in enumerate(FACET_EDGES[dim]):
        couple = numbers[:, number, None] * (flat[:, j] - flat[:, i])
        moved[:, i] += couple
        moved[:, j] -= couple
    if own > along:
        moved += np.einsum("kn,knad->kad", numbers[:, along:], across_fields(flat))
    if flows:
        local, reach = _around(nodes)
        force, turn = flow[:, :dim] * reach[:, None], flow[:, dim:] * reach[:, None] ** 2
        moved += with_resultants(
            local.reshape(flat.shape), np.repeat(force, slots, axis=0), np.repeat(turn, slots, axis=0)
        )
    return np.asarray(moved.reshape(nodes.shape) * rings.turn[:, :, None, None])


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
        along[side, :, side] = edge_fields(nodes[side][None])[0].reshape(-1, block)
        modes[side, :, side] = np.moveaxis(rigid_modes(nodes[side]), 1, 0).reshape(-1, block)
    conditions = (modes.sum(axis=0) if flows else modes).reshape(-1, 2 * block)
    edges = along.reshape(-1, 2 * block)
    rest = la.null_space(np.vstack([conditions, edges]))
    balanced = np.hstack([edges.T, rest])
    fields = np.zeros((element.moments, balanced.shape[1]))
    fields.reshape(dim + 1, block, -1)[list(facets)] = balanced.reshape(2, block, -1)
    return MomentSpace(element, fields), np.ascontiguousarray(np.linalg.pinv(balanced).T)


def _joined_matrices(parts: list[Array], slots: int) -> Array:
    """Matrices of rings and rows of those of their cells (k, c, ...).

    Numbers of a cell are those of the facet it begins with, of the facet it ends with, and of what flows: the matrices
    are given by the parts among facets, of what flows with facets, and of what flows.
    """
    facets, across, flows = parts
    count, cells, through, width = across.shape
    own = width // 2
    end = slots * own
    H = np.zeros((count, end + through, end + through))
    for c in range(min(cells, slots - 1)):
        both = slice(c * own, (c + 2) * own)
        H[:, both, both] += facets[:, c]
        H[:, end:, both] += across[:, c]
    if slots == cells:  # the last cell ends with the first facet
        last, first = slice(end - own, end), slice(own)
        for rows, seen in ((last, slice(own)), (first, slice(own, width))):
            for columns, beside in ((last, slice(own)), (first, slice(own, width))):
                H[:, rows, columns] += facets[:, -1, seen, beside]
            H[:, end:, rows] += across[:, -1, :, seen]
    H[:, :end, end:] = H[:, end:, :end].transpose(0, 2, 1)
    H[:, end:, end:] = flows.sum(axis=1)
    return H


def _joined_loads(force: Array, rest: Array, slots: int) -> Array:
    """Vectors (k, q, r) of rings and rows, of the parts of their cells (k, c, ..., r) on facets and for what flows."""
    count, cells, width, columns = force.shape
    own = width // 2
    end = slots * own
    b = np.zeros((count, end + rest.shape[2], columns))
    for c in range(min(cells, slots - 1)):
        b[:, c * own : (c + 2) * own] += force[:, c]
    if slots == cells:
        b[:, end - own : end] += force[:, -1, :own]
        b[:, :own] += force[:, -1, own:]
    b[:, end:] = rest.sum(axis=1)
    return b
