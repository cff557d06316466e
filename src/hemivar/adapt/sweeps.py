"""Tractions are improved patch by patch: less misfit, the same equilibrium.

A change ``dm`` of the moments on the free facets of a patch whose force and moment vanish on every cell, ``C dm = 0``,
changes the stress by one without divergence. The best one minimises the misfit, ``1/2 dm'H dm + b'dm``:

    dm = -H^-1 (b + C'mu),     C H^-1 C' mu = -C H^-1 b.

Rigid motions common to all cells of the patch, as far as free facets on the boundary leave them (``P``, a projection
on them), are the only ones in the kernel of ``C'``; there the second equation is completed.

Patches of one colour share no cell and are improved at once. Every patch lowers the misfit, in sum with the price of
contact tractions that leave what the law allows.

With linear elements in the plane the vertices inside, which are nearly all, are left to
:mod:`hemivar.adapt.vertex_rings`. Those of the boundary come before them and once more behind them: they are few, and
settle contact tractions last.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hemivar.adapt.admissible_stress import AdmissibleStress
from hemivar.adapt.patches import Batch, PatchKind, patch_batches, rigid_modes
from hemivar.adapt.self_balanced import flow_fields, orientations, self_balanced, turning_fields
from hemivar.adapt.vertex_rings import VertexRings
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.split_element import facet_mass

__all__ = ["ContactPrice", "Sweeper"]

#: Part of the largest work on free facets below which a rigid motion does none.
_FREE = 1e-10
#: Numbers of the matrices that are held at a time; in the plane fewer, for they fit a cache.
_ENTRIES = {2: 1 << 20, 3: 1 << 22}


@dataclass(frozen=True, eq=False)
class ContactPrice:
    """What tractions of contact facets pay: ``price |xi - zeta|^2`` on each, or less where zeta follows xi.

    Attributes
    ----------
    wanted : array, shape (F, k, d)
        Moments of zeta, the force of the foundation per area as its law allows it (acting by ``-zeta``).
    price : float
        Of the square of the distance, in the units of a misfit.
    mass : array, shape (F, k, d, k, d), optional
        ``int w phi_a phi_b`` with the part w, in each direction, of a change of xi that zeta does not follow. The price
        then has the slope of ``price |xi - zeta|^2`` at ``start`` and this curvature. By default w = 1.
    start : array, shape (F, k, d), optional
        Moments of tractions at which zeta was taken.
    """

    wanted: Array
    price: float
    mass: Array | None = None
    start: Array | None = None


class Sweeper:
    """Improves a stress by sweeps over patches.

    Parameters
    ----------
    stress : AdmissibleStress
        To start from.
    general : bool
        Solve all patches as those of any shape are, which takes longer and gives the same.
    """

    def __init__(self, stress: AdmissibleStress, general: bool = False) -> None:
        self.general = general
        self._start = stress
        self.data = stress.data
        self._moments = stress.tractions.moments.copy()
        self._now: AdmissibleStress | None = stress  # where it is known
        self._difference = stress.difference.copy()
        self._batches: dict[tuple[PatchKind, bool], list[Batch]] = {}

    @property
    def stress(self) -> AdmissibleStress:
        """The stress as it is now."""
        if self._now is None:
            self._now = self._start.with_moments(self._moments.copy())
        return self._now

    @cached_property
    def _places(self) -> Array:
        """Places of the nodes of the facets, shape (F, k, d)."""
        return np.asarray(self.data.problem.mesh.nodes(self.data.order)[self.data.facet_nodes])

    def sweep(self, kind: PatchKind, contact: ContactPrice | None = None, only_contact: bool = False) -> None:
        """Improve all patches of a kind once.

        Parameters
        ----------
        kind : PatchKind
        contact : ContactPrice, optional
            Frees the tractions of contact facets at a price; None leaves them as they are.
        only_contact : bool
            Improve those patches alone that have a contact facet.
        """
        freed = self._freed(contact is not None)
        closed = kind is PatchKind.VERTEX and self.data.table.dim == 2 and self.data.order == 1
        key = (kind, contact is not None)
        if key not in self._batches:
            others = ~self._rings.vertices if closed else None
            free = np.asarray(freed.any(axis=(1, 2)))
            self._batches[key] = patch_batches(self.data.table, kind, free, others)
        self._improve_batches(self._batches[key], kind, freed, contact, only_contact)
        if closed and not only_contact:
            self._improve_closed(kind, freed)
            self._improve_batches(self._batches[key], kind, freed, contact, only_contact)

    def _improve_closed(self, kind: PatchKind, freed: Array) -> None:
        """Improve the rings of cells around vertices inside."""
        if self.general:
            self._improve_batches(self._rings.as_batches(), kind, freed, None, False)
            return
        self._now = None
        self._rings.improve(self.data.reference_compliance, self._difference, self._moments)

    @cached_property
    def _turning(self) -> Array:
        """Unit moments about the middle of each facet."""
        return turning_fields(self._places)

    @cached_property
    def _rings(self) -> VertexRings:
        return VertexRings.of(self.data.table)

    def _improve_batches(
        self, batches: list[Batch], kind: PatchKind, freed: Array, contact: ContactPrice | None, only_contact: bool
    ) -> None:
        """Improve patches that share no cell within a batch, one batch after the other."""
        self._now = None
        partly = np.asarray((freed != np.eye(self.data.table.dim)).any(axis=(1, 2)))
        rings = kind is not PatchKind.VERTEX or self.data.table.dim == 2
        for whole in batches:
            if only_contact:
                whole = whole.take(np.asarray((self.data.contact[whole.facets] >= 0).any(axis=1)))
            plain = np.zeros(len(whole.facets), dtype=bool)
            if rings and not self.general:
                plain[:] = ~partly[whole.facets].any(axis=1)
            for batch, ring in ((whole.take(plain), True), (whole.take(~plain), False)):
                size = batch.facets.shape[1] * self._start.element.block
                entries = _ENTRIES[self.data.table.dim]
                step = max(entries // (size * size + batch.cells.shape[1] * self._start.element.moments**2), 1)
                for start in range(0, len(batch.facets), step):
                    part = batch.take(slice(start, start + step))
                    if ring:
                        self._improve_rings(part, contact)
                    else:
                        self._improve(part, freed, partly, contact)

    def _freed(self, contact: bool) -> Array:
        """Projections (F, d, d) on the components of tractions that may change."""
        freed = self.data.unknown
        if contact:
            freed = freed.copy()
            freed[self.data.contact >= 0] = np.eye(self.data.table.dim)
        return freed

    def _improve(self, batch: Batch, freed: Array, partly: BoolArray, contact: ContactPrice | None) -> None:
        """Improve patches that share no cell."""
        table, element = self.data.table, self._start.element
        dim = table.dim
        count, facets = batch.facets.shape
        cells = batch.cells.shape[1]
        block = element.block
        number = facets * block
        flat = batch.cells.ravel()

        # in the moments of each cell, outward, then in those of the facets
        compliance = self.data.reference_compliance[flat]
        back = table.inverse[flat]
        sign = table.signs[flat].reshape(count, cells, dim + 1)
        energy = element.matrix(compliance).reshape(len(flat), -1, dim)
        energy = (energy @ back).reshape(len(flat), element.moments, -1).transpose(0, 2, 1)
        energy = (energy.reshape(len(flat), -1, dim) @ back).reshape(len(flat), element.moments, -1)
        slope = element.slope(self._difference[flat], compliance)
        slope = (slope.reshape(len(flat), -1, dim) @ back).reshape(count, cells, dim + 1, block)
        slope *= sign[..., None]
        signs = np.repeat(sign, block, axis=2)
        energy = energy.reshape(count, cells, element.moments, element.moments) * signs[..., None] * signs[:, :, None]

        own = (batch.place[..., None] * block + np.arange(block)).reshape(count, cells, -1)
        own = np.minimum(own, number)  # facets of no patch go where nobody looks
        H, b = np.zeros((count, number + 1, number + 1)), np.zeros((count, number + 1))
        modes = dim * (dim + 1) // 2
        C = np.zeros((count, cells * modes, number + 1))
        every = np.arange(count)
        places = self._places[table.cell_facets[batch.cells]]
        centre = places.mean(axis=(1, 2, 3))
        reach = np.abs(places - centre[:, None, None, None]).max(axis=(1, 2, 3, 4))
        rigid = rigid_modes((places - centre[:, None, None, None]) / reach[:, None, None, None, None])
        rigid *= sign[..., None, None, None]
        rigid = rigid.transpose(0, 1, 4, 2, 3, 5).reshape(count, cells, modes, -1)
        for c in range(cells):
            H[every[:, None, None], own[:, c, :, None], own[:, c, None, :]] += energy[:, c]
            b[every[:, None], own[:, c]] += slope[:, c].reshape(count, -1)
            row = c * modes + np.arange(modes)
            C[every[:, None, None], row[:, None], own[:, c, None, :]] = rigid[:, c]
        H, b, C = H[:, :number, :number], b[:, :number], C[:, :, :number]
        if contact is not None:
            self._charge(batch, contact, H, b)
        loose = self._confine(batch, freed, partly, H, b, C, centre, reach)

        solved = np.linalg.solve(H, np.concatenate([b[:, :, None], C.transpose(0, 2, 1)], axis=2))
        work, through = solved[:, :, 0], solved[:, :, 1:]
        S = C @ through
        scale = np.trace(S, axis1=1, axis2=2) / (cells * modes)
        completed = S.reshape(count, cells, modes, cells, modes)
        completed += (scale[:, None, None] * loose / cells)[:, None, :, None, :]
        mu = np.linalg.solve(S, -(C @ work[:, :, None]))
        change = -work - (through @ mu)[:, :, 0]
        change = self._confined(batch, freed, partly, change)

        self._apply(batch, change)

    def _apply(self, batch: Batch, change: Array) -> None:
        """Change the moments of patches that share no cell by (k, f d d)."""
        table, element = self.data.table, self._start.element
        dim = table.dim
        count, facets = batch.facets.shape
        split = change.reshape(count, facets, -1, dim)
        self._moments[batch.facets] += split
        padded = np.concatenate([split.reshape(count, facets, -1), np.zeros((count, 1, element.block))], axis=1)
        flat = batch.cells.ravel()
        on_cells = padded[np.arange(count)[:, None, None], batch.place] * table.signs[batch.cells][..., None]
        on_cells = on_cells.reshape(len(flat), -1, dim) @ table.inverse[flat].transpose(0, 2, 1)
        self._difference[flat] += on_cells.reshape(len(flat), -1) @ element.summing.T

    def _improve_rings(self, batch: Batch, contact: ContactPrice | None) -> None:
        """Improve patches whose cells make rings or rows, all of whose facets are wholly free.

        What balances there are fields of single facets without force and moment, and one force and moment that flows
        through all of them.
        """
        table, element = self.data.table, self._start.element
        dim = table.dim
        count, facets = batch.facets.shape
        sides = min(facets, 2)
        flow, flows = orientations(table, batch)
        nodes = self._places[batch.facets]
        centre = nodes.mean(axis=(1, 2))
        x = nodes - centre[:, None, None]
        size = np.abs(x).max(axis=(1, 2, 3))[:, None, None, None]
        x /= size
        middle = x.mean(axis=2).reshape(-1, dim)
        x = x.reshape(-1, *nodes.shape[2:])
        fields = self_balanced(x)
        if flows.any():
            turning = (self._turning[batch.facets] * size[..., None]).reshape(len(x), -1, *x.shape[1:])
            fields = np.concatenate([fields, flow_fields(turning, middle) * flow.reshape(-1, 1, 1, 1)], axis=1)
        block = element.block
        own = block - dim * (dim + 1) // 2  # fields of a facet
        through = fields.shape[1] - own  # forces and moments
        fields = fields.reshape(count, facets, own + through, block)
        number = facets * own + through

        H, b = np.zeros((count, number + 1, number + 1)), np.zeros((count, number + 1))
        places = np.argsort(batch.place >= facets, axis=2, kind="stable")[
            :, :, :sides
        ]  # local facets of the patch first
        every = np.arange(count)
        padded = np.concatenate([fields, np.zeros((count, 1, own + through, block))], axis=1)
        last = facets * own + np.arange(through)
        cells, local = batch.cells.ravel(), places.reshape(-1, sides)
        at = np.take_along_axis(batch.place, places, axis=2).reshape(-1, sides)
        patch = np.repeat(every, batch.cells.shape[1])
        signed = padded[patch[:, None], at] * table.signs[cells[:, None], local][:, :, None, None]
        back = signed.reshape(len(cells), -1, dim) @ table.inverse[cells].transpose(0, 2, 1)
        back = back.reshape(len(cells), sides, own + through, block)
        wide = np.zeros((len(cells), sides, block, sides * own + through))
        for side in range(sides):
            on = back[:, side].transpose(0, 2, 1)
            wide[:, side, :, side * own : (side + 1) * own] = on[:, :, :own]
            wide[:, side, :, sides * own :] = on[:, :, own:]
        basis = wide.reshape(len(cells), sides * block, -1)
        compliance = self.data.reference_compliance[cells]
        every_slope = element.slope(self._difference[cells], compliance)
        every_slope = every_slope.reshape(len(cells), dim + 1, block)
        slope = np.take_along_axis(every_slope, local[:, :, None], axis=1).reshape(len(cells), -1)
        energy = np.empty((len(cells), sides * block, sides * block))
        order = np.lexsort(local.T)
        other = (local[order[1:]] != local[order[:-1]]).any(axis=1)
        for some in np.split(order, np.flatnonzero(other) + 1):  # cells with the same facets in the patch
            energy[some] = element.matrix_of(tuple(local[some[0]].tolist()), compliance[some])
        matrix = basis.transpose(0, 2, 1) @ energy @ basis
        force = np.einsum("kpn,kp->kn", basis, slope)
        ends = np.broadcast_to(last, (len(cells), through))
        index = np.concatenate([(at[:, :, None] * own + np.arange(own)).reshape(len(cells), -1), ends], axis=1)
        index[:, : sides * own] = np.where(np.repeat(at >= facets, own, axis=1), number, index[:, : sides * own])
        shape = (count, batch.cells.shape[1], index.shape[1])
        index, force, matrix = index.reshape(shape), force.reshape(shape), matrix.reshape(*shape, shape[2])
        rows = every[:, None] * (number + 1)
        flat_H, flat_b = H.reshape(-1), b.reshape(-1)
        for c in range(shape[1]):  # numbers of a cell are not repeated, except those that nobody looks at
            row = rows + index[:, c]
            flat_H[(row * (number + 1))[:, :, None] + index[:, c, None, :]] += matrix[:, c]
            flat_b[row] += force[:, c]
        H, b = H[:, :number, :number], b[:, :number]
        all_fields = np.zeros((count, facets, block, number))
        for f in range(facets):
            all_fields[:, f, :, f * own : (f + 1) * own] = fields[:, f, :own].transpose(0, 2, 1)
            all_fields[:, f, :, facets * own :] = fields[:, f, own:].transpose(0, 2, 1)
        if contact is not None:
            for patch, place, matrix, slope in self._prices(batch, contact):
                on = all_fields[patch, place]
                np.add.at(H, patch, on.transpose(0, 2, 1) @ matrix @ on)
                np.add.at(b, patch, np.einsum("kpn,kp->kn", on, slope))
        H[np.flatnonzero(~flows)[:, None], last, last] = 1.0
        change = -np.linalg.solve(H, b[:, :, None])
        self._apply(batch, (all_fields.reshape(count, -1, number) @ change)[:, :, 0])

    def _prices(self, batch: Batch, contact: ContactPrice) -> list[tuple[IntArray, IntArray, Array, Array]]:
        """Contact facets of patches, by patch and place, with the matrices and half the slopes of their price."""
        data, dim = self.data, self.data.table.dim
        patch, place = np.nonzero(data.contact[batch.facets] >= 0)
        if not len(patch):
            return []
        facet = batch.facets[patch, place]
        loose = np.eye(dim) - data.unknown[facet]
        inverse = np.linalg.inv(facet_mass(dim, data.order))
        size, block = contact.price / data.table.measures[facet], self._start.element.block
        whole = np.einsum("f,ab,fij->faibj", size, inverse, loose).reshape(len(facet), block, block)
        if contact.mass is None or contact.start is None:
            off = self._moments[facet] - data.facet_loads[facet] + contact.wanted[facet]
            return [(patch, place, whole, np.einsum("fpq,fq->fp", whole, off.reshape(len(facet), -1)))]
        off = contact.start[facet] - data.facet_loads[facet] + contact.wanted[facet]
        mass = contact.mass[facet].reshape(whole.shape) / contact.price
        matrix = whole @ mass @ whole
        moved = (self._moments[facet] - contact.start[facet]).reshape(len(facet), -1)
        slope = np.einsum("fpq,fq->fp", whole, off.reshape(len(facet), -1)) + np.einsum("fpq,fq->fp", matrix, moved)
        return [(patch, place, matrix, slope)]

    def _charge(self, batch: Batch, contact: ContactPrice, H: Array, b: Array) -> None:
        """Add the price of contact tractions to the misfit of patches, in place."""
        block = self._start.element.block
        for patch, place, matrix, slope in self._prices(batch, contact):
            at = place[:, None] * block + np.arange(block)
            H[patch[:, None, None], at[:, :, None], at[:, None, :]] += matrix
            b[patch[:, None], at] += slope

    def _confine(
        self, batch: Batch, freed: Array, partly: BoolArray, H: Array, b: Array, C: Array, centre: Array, reach: Array
    ) -> Array:
        """Restrict changes on the boundary to what is free there, in place.

        Returns
        -------
        array, shape (k, r, r)
            Projections on the rigid motions of the whole patch that do no work on its free facets of the boundary.
        """
        table, dim = self.data.table, self.data.table.dim
        modes = dim * (dim + 1) // 2
        loose = np.broadcast_to(np.eye(modes), (len(H), modes, modes)).copy()
        patch, place = np.nonzero(~table.interior[batch.facets])
        if not len(patch):
            return loose
        facet = batch.facets[patch, place]
        x = (self._places[facet] - centre[patch, None]) / reach[patch, None, None]
        rigid = np.einsum("fij,farj->frai", freed[facet], rigid_modes(x)).reshape(len(facet), modes, -1)
        gram = np.zeros(loose.shape)
        np.add.at(gram, patch, rigid @ rigid.transpose(0, 2, 1))
        some = np.unique(patch)
        size, axes = np.linalg.eigh(gram[some])
        idle = (size < _FREE * dim).astype(float)
        loose[some] = np.einsum("kin,kn,kjn->kij", axes, idle, axes)
        shut = partly[facet]
        patch, place, facet = patch[shut], place[shut], facet[shut]
        scale = np.trace(H, axis1=1, axis2=2) / H.shape[1]
        for a in range(x.shape[1]):  # facets of one patch one after the other, for each is only there once
            at = place[:, None] * self._start.element.block + a * dim + np.arange(dim)
            for turn in range(int(np.bincount(patch).max(initial=0))):
                now = _turn(patch) == turn
                p, rows, D = patch[now], at[now], freed[facet[now]]
                H[p[:, None], rows] = D @ H[p[:, None], rows]
                columns = H.transpose(0, 2, 1)
                columns[p[:, None], rows] = D @ columns[p[:, None], rows]
                H[p[:, None, None], rows[:, :, None], rows[:, None, :]] += scale[p, None, None] * (np.eye(dim) - D)
                b[p[:, None], rows] = np.einsum("fij,fj->fi", D, b[p[:, None], rows])
                of_columns = C.transpose(0, 2, 1)
                of_columns[p[:, None], rows] = D @ of_columns[p[:, None], rows]
        return loose

    def _confined(self, batch: Batch, freed: Array, partly: BoolArray, change: Array) -> Array:
        """Changes (k, n) without what is not free, which is rounding."""
        if not partly[batch.facets].any():
            return change
        dim = self.data.table.dim
        split = change.reshape(*batch.facets.shape, -1, dim)
        return np.asarray(np.einsum("kfij,kfaj->kfai", freed[batch.facets], split).reshape(change.shape))


def _turn(patch: IntArray) -> IntArray:
    """How many entries before it name the same patch, for sorted entries."""
    first = np.searchsorted(patch, patch, side="left")
    return np.asarray(np.arange(len(patch)) - first)
