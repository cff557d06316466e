"""Tractions are improved patch by patch: less misfit, the same equilibrium.

A change ``dm`` of the moments on the free facets of a patch whose force and moment vanish on every cell, ``C dm = 0``,
changes the stress by one without divergence. The best one minimises the misfit, ``1/2 dm'H dm + b'dm``:

    dm = -H^-1 (b + C'mu),     C H^-1 C' mu = -C H^-1 b.

Rigid motions common to all cells of the patch, as far as free facets on the boundary leave them (``P``, a projection
on them), are the only ones in the kernel of ``C'``; there the second equation is completed.

Patches of one colour share no cell and are improved at once. Every patch lowers the misfit, in sum with the price of
contact tractions that leave what the law allows.

Around vertices in the plane and edges in space cells make rings and rows, which
:mod:`hemivar.certificates.continuous.ring_sweeps` improves where all their facets are wholly free. With linear elements
in the plane the vertices inside, which are nearly all, are left to :mod:`hemivar.certificates.continuous.vertex_rings`.
Those of the boundary come before them and once more behind them:
they are few, and settle contact tractions last.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.certificates.continuous.admissible_stress import AdmissibleStress
from hemivar.certificates.continuous.congruence import congruent_cells
from hemivar.certificates.continuous.patches import Batch, PatchKind, lowering, patch_batches, rigid_modes
from hemivar.certificates.continuous.ring_sweeps import RingSweeps
from hemivar.certificates.continuous.rings import Rings, ring_batches
from hemivar.certificates.continuous.split_element import facet_mass
from hemivar.certificates.continuous.vertex_rings import VertexRings

__all__ = ["ContactPenalty", "PatchSmoother"]

#: How often balance is asked of a change again, and what it may lack of it to be made.
_AGAIN, _BALANCED = 2, 1e-13
#: Part of the largest work on free facets below which a rigid motion does none.
_FREE = 1e-10
#: Numbers of the matrices that are held at a time; in the plane fewer, for they fit a cache.
_ENTRIES = {2: 1 << 20, 3: 1 << 22}


@dataclass(frozen=True, eq=False)
class ContactPenalty:
    """What tractions of contact facets pay: ``price |xi - zeta|^2`` on each, or less where zeta follows xi.

    Attributes
    ----------
    facets : int array, shape (c,)
        Numbers of the contact facets.
    wanted : array, shape (c, k, d)
        Moments of zeta, the force of the foundation per area as its law allows it (acting by ``-zeta``).
    price : float
        Of the square of the distance, in the units of a misfit.
    mass : array, shape (c, k, d, k, d), optional
        On each ``int w phi_a phi_b`` with the part w, in each direction, of a change of xi that zeta does not follow.
        The price then has the slope of ``price |xi - zeta|^2`` at ``start`` and this curvature. By default w = 1.
    start : array, shape (c, k, d), optional
        Moments of tractions at which zeta was taken.
    """

    facets: IntArray
    wanted: Array
    price: float
    mass: Array | None = None
    start: Array | None = None

    def rows(self, facets: IntArray) -> IntArray:
        """Where facets stand among those of the price."""
        order = np.argsort(self.facets)
        return np.asarray(order[np.searchsorted(self.facets, facets, sorter=order)])


class PatchSmoother:
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
        self.data = stress.data
        self._now: AdmissibleStress | None = stress  # where it is known
        # changed in place, and its own: nothing of the stress is held
        self._moments = stress.tractions.moments.copy()
        self._start = AdmissibleStress(stress.data, stress.tractions).with_moments(self._moments)
        self._difference = AdmissibleStress(stress.data, stress.tractions).difference
        self._batches: dict[tuple[PatchKind, bool], tuple[list[Batch | Rings], RingSweeps]] = {}

    @property
    def stress(self) -> AdmissibleStress:
        """The stress as it is now."""
        if self._now is None:
            self._now = self._start.with_moments(self._moments.copy())
        return self._now

    @property
    def moments(self) -> Array:
        """The moments (F, k, d) of its tractions, which the next sweep changes."""
        return self._moments

    @property
    def misfit(self) -> float:
        """``int (s - C eps) : C^-1 (s - C eps)`` over the body, for the mean of C on each cell."""
        return float(self._start.element.energy_of(self._difference, self.data.reference_compliance).sum())

    def sweep(self, kind: PatchKind, contact: ContactPenalty | None = None, only_contact: bool = False) -> None:
        """Improve all patches of a kind once.

        Parameters
        ----------
        kind : PatchKind
        contact : ContactPrice, optional
            Frees the tractions of contact facets at a price; None leaves them as they are.
        only_contact : bool
            Improve those patches alone that have a contact facet.
        """
        self._now = None
        closed = kind is PatchKind.VERTEX and self.data.table.dim == 2 and self.data.order == 1
        key = (kind, contact is not None)
        if key not in self._batches:
            others = ~self._rings.vertices if closed else None
            rings = RingSweeps(self.data, self._start.element)  # knows the kinds of these
            self._batches[key] = self._patches(kind, contact is not None, others), rings
        self._improve_batches(*self._batches[key], contact, only_contact)
        if closed and not only_contact:
            self._improve_closed()
            self._improve_batches(*self._batches[key], contact, only_contact)

    def _patches(self, kind: PatchKind, contact: bool, some: BoolArray | None) -> list[Batch | Rings]:
        """Patches of any shape, then rings and rows; of some vertices, edges or facets, or of all."""
        table, dim = self.data.table, self.data.table.dim
        free = np.asarray(self.data.unknown.any(axis=(1, 2)))
        if contact:
            free |= self.data.contact >= 0
        if kind is not (PatchKind.VERTEX if dim == 2 else PatchKind.EDGE):
            return [*patch_batches(table, kind, free, some)]
        rings, rest = ring_batches(
            table, kind, free, ~self._partly(contact), some, None if self.general else self._alike
        )
        others = patch_batches(table, kind, free, rest) if rest.any() else []
        return [*others, *([ring.as_batch(table) for ring in rings] if self.general else rings)]

    def _improve_closed(self) -> None:
        """Improve the rings of cells around vertices inside."""
        if self.general:
            self._improve_batches(self._rings.as_batches(), None, None, False)
            return
        self._rings.improve(self.data.reference_compliance, self._difference, self._moments)

    @cached_property
    def _alike(self) -> IntArray:
        return congruent_cells(self.data)

    @cached_property
    def _rings(self) -> VertexRings:
        return VertexRings.of(self.data.table)

    def _improve_batches(
        self,
        batches: Sequence[Batch | Rings],
        rings: RingSweeps | None,
        contact: ContactPenalty | None,
        only_contact: bool,
    ) -> None:
        """Improve patches that share no cell within a batch, one batch after the other."""
        element, entries = self._start.element, _ENTRIES[self.data.table.dim]
        partly = self._partly(contact is not None)
        touching = np.asarray(self.data.contact >= 0)
        for patches in batches:
            if only_contact:
                patches = patches.take(np.asarray(touching[patches.facets].any(axis=1)))
            size = patches.facets.shape[1] * element.block
            step = max(entries // (size * size + patches.cells.shape[1] * element.moments**2), 1)
            for start in range(0, len(patches.facets), step):
                part = patches.take(slice(start, start + step))
                if isinstance(part, Rings):
                    assert rings is not None
                    prices = [] if contact is None else self._prices(part.facets, contact)
                    rings.improve(part, self._difference, self._moments, prices)
                else:
                    self._improve(part, partly, contact)

    def _freed(self, facets: IntArray, contact: bool) -> Array:
        """Projections (..., d, d) on the components of their tractions that may change."""
        freed = self.data.unknown[facets]
        if contact:
            freed[self.data.contact[facets] >= 0] = np.eye(self.data.table.dim)
        return freed

    def _partly(self, contact: bool) -> BoolArray:
        """Facets (F,) not all of whose components may change."""
        partly = np.asarray((self.data.unknown != np.eye(self.data.table.dim)).any(axis=(1, 2)))
        return np.asarray(partly & (self.data.contact < 0)) if contact else partly

    def _improve(self, batch: Batch, partly: BoolArray, contact: ContactPenalty | None) -> None:
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
        places = self.data.places(table.cell_facets[batch.cells])
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
        loose = self._confine(batch, contact is not None, partly, H, b, C, centre, reach)

        change = _balanced_change(H, b, C, loose)
        if change is not None:
            self._apply(batch, self._confined(batch, contact is not None, partly, change))

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

    def _prices(self, facets: IntArray, contact: ContactPenalty) -> list[tuple[IntArray, IntArray, Array, Array]]:
        """Contact facets of patches, by patch and place, with the matrices and half the slopes of their price."""
        data, dim = self.data, self.data.table.dim
        patch, place = np.nonzero(data.contact[facets] >= 0)
        if not len(patch):
            return []
        facet = facets[patch, place]
        loose = np.eye(dim) - data.unknown[facet]
        inverse = np.linalg.inv(facet_mass(dim, data.order))
        size, block = contact.price / data.table.measures[facet], self._start.element.block
        whole = np.einsum("f,ab,fij->faibj", size, inverse, loose).reshape(len(facet), block, block)
        row = contact.rows(facet)
        zeta = contact.wanted[row] - data.facet_loads[facet]
        if contact.mass is None or contact.start is None:
            off = (self._moments[facet] + zeta).reshape(len(facet), -1)
            return [(patch, place, whole, np.einsum("fpq,fq->fp", whole, off))]
        matrix = whole @ (contact.mass[row].reshape(whole.shape) / contact.price) @ whole
        off = (contact.start[row] + zeta).reshape(len(facet), -1)
        moved = (self._moments[facet] - contact.start[row]).reshape(len(facet), -1)
        slope = np.einsum("fpq,fq->fp", whole, off) + np.einsum("fpq,fq->fp", matrix, moved)
        return [(patch, place, matrix, slope)]

    def _charge(self, batch: Batch, contact: ContactPenalty, H: Array, b: Array) -> None:
        """Add the price of contact tractions to the misfit of patches, in place."""
        block = self._start.element.block
        for patch, place, matrix, slope in self._prices(batch.facets, contact):
            at = place[:, None] * block + np.arange(block)
            H[patch[:, None, None], at[:, :, None], at[:, None, :]] += matrix
            b[patch[:, None], at] += slope

    def _confine(
        self, batch: Batch, contact: bool, partly: BoolArray, H: Array, b: Array, C: Array, centre: Array, reach: Array
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
        x = (self.data.places(facet) - centre[patch, None]) / reach[patch, None, None]
        freed = self._freed(facet, contact)
        rigid = np.einsum("fij,farj->frai", freed, rigid_modes(x)).reshape(len(facet), modes, -1)
        gram = np.zeros(loose.shape)
        np.add.at(gram, patch, rigid @ rigid.transpose(0, 2, 1))
        some = np.unique(patch)
        size, axes = np.linalg.eigh(gram[some])
        idle = (size < _FREE * dim).astype(float)
        loose[some] = np.einsum("kin,kn,kjn->kij", axes, idle, axes)
        shut = partly[facet]
        patch, place, freed = patch[shut], place[shut], freed[shut]
        scale = np.trace(H, axis1=1, axis2=2) / H.shape[1]
        for a in range(x.shape[1]):  # facets of one patch one after the other, for each is only there once
            at = place[:, None] * self._start.element.block + a * dim + np.arange(dim)
            for turn in range(int(np.bincount(patch).max(initial=0))):
                now = _turn(patch) == turn
                p, rows, D = patch[now], at[now], freed[now]
                H[p[:, None], rows] = D @ H[p[:, None], rows]
                columns = H.transpose(0, 2, 1)
                columns[p[:, None], rows] = D @ columns[p[:, None], rows]
                H[p[:, None, None], rows[:, :, None], rows[:, None, :]] += scale[p, None, None] * (np.eye(dim) - D)
                b[p[:, None], rows] = np.einsum("fij,fj->fi", D, b[p[:, None], rows])
                of_columns = C.transpose(0, 2, 1)
                of_columns[p[:, None], rows] = D @ of_columns[p[:, None], rows]
        return loose

    def _confined(self, batch: Batch, contact: bool, partly: BoolArray, change: Array) -> Array:
        """Changes (k, n) without what is not free, which is rounding."""
        if not partly[batch.facets].any():
            return change
        dim = self.data.table.dim
        split = change.reshape(*batch.facets.shape, -1, dim)
        return np.asarray(np.einsum("kfij,kfaj->kfai", self._freed(batch.facets, contact), split).reshape(change.shape))


def _balanced_change(H: Array, b: Array, C: Array, loose: Array) -> Array | None:
    """The x (k, n) that minimise ``x'H x / 2 + b'x`` under ``C x = 0``, zero where rounding leaves that out of balance.

    ``loose (k, r, r)`` are the rigid motions in the kernel of ``C'``, the same on every cell. None if one of the
    matrices is singular.
    """
    count, modes = len(H), loose.shape[1]
    cells = C.shape[1] // modes
    try:
        solved = np.linalg.solve(H, np.concatenate([b[:, :, None], C.transpose(0, 2, 1)], axis=2))
        work, through = solved[:, :, 0], solved[:, :, 1:]
        S = C @ through
        scale = np.trace(S, axis1=1, axis2=2) / (cells * modes)
        completed = S.reshape(count, cells, modes, cells, modes)
        completed += (scale[:, None, None] * loose / cells)[:, None, :, None, :]
        change = -work - (through @ np.linalg.solve(S, -(C @ work[:, :, None])))[:, :, 0]
        for _ in range(_AGAIN):  # what flat cells have left of the balance
            change -= (through @ np.linalg.solve(S, C @ change[:, :, None]))[:, :, 0]
    except np.linalg.LinAlgError:
        return None
    off, size = (C @ change[:, :, None])[:, :, 0], (np.abs(C) @ np.abs(change)[:, :, None])[:, :, 0]
    balanced = np.abs(off).max(axis=1) <= _BALANCED * size.max(axis=1)
    return np.where((balanced & lowering(H, b, change))[:, None], change, 0.0)


def _turn(patch: IntArray) -> IntArray:
    """How many entries before it name the same patch, for sorted entries."""
    first = np.searchsorted(patch, patch, side="left")
    return np.asarray(np.arange(len(patch)) - first)
