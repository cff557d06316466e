"""Tractions are improved patch by patch: less misfit, the same equilibrium.

A change x of the fields of a patch (:mod:`hemivar.bounds.patches`) changes the stress by one
without divergence and without tractions on the other facets. The best one minimises the misfit, ``x'H x / 2 + b'x``.
H are energies of the cells in the moments of their facets, and b what the slope of the misfit in these, which is kept
for each cell, is in the fields. Contact facets add the price of tractions that leave what the law allows.

Patches of one colour share no cell and are improved at once. Every patch lowers the sum of misfit and price.

The compiled kernels improve patches one by one, and solve once for those that are translates of each other; where they
are not there, NumPy improves those of one shape together. A patch with rollers is left to NumPy always.

With linear elements in the plane the vertices of the boundary come before those inside and once more behind them: they
are few, and settle contact tractions last.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.admissible_stress import AdmissibleStress
from hemivar.bounds.compiled_patches import CompiledPatches, PatchOrder, Prices
from hemivar.bounds.patches import (
    Batch,
    PatchFields,
    PatchKind,
    cell_patches,
    lowering,
    patch_batches,
    patch_fields,
    patch_sides,
)
from hemivar.bounds.split_element import facet_mass

__all__ = ["ContactPenalty", "PatchSmoother"]

#: Numbers of the matrices that are held at a time; in the plane fewer, for they fit a cache.
_ENTRIES = {2: 1 << 18, 3: 1 << 20}


@dataclass(frozen=True, eq=False)
class ContactPenalty:
    """What tractions of contact facets pay: ``price |xi - zeta|^2`` on each, or less where zeta follows xi."""

    #: Numbers of the contact facets.
    facets: IntArray  # (c,)
    #: Moments of zeta, the force of the foundation per area as its law allows it (acting by ``-zeta``).
    wanted: Array  # (c, k, d)
    #: Of the square of the distance, in the units of a misfit.
    price: float
    #: On each ``int w phi_a phi_b`` with the part w, in each direction, of a change of xi that zeta does not follow.
    #: The price then has the slope of ``price |xi - zeta|^2`` at ``start`` and this curvature. By default w = 1.
    mass: Array | None = None  # (c, k, d, k, d)
    #: Moments of tractions at which zeta was taken.
    start: Array | None = None  # (c, k, d)


class PatchSmoother:
    """Improves a stress by sweeps over patches; of its moments it changes a copy unless the stress is its ``own``."""

    def __init__(self, stress: AdmissibleStress, compiled: bool = True, own: bool = False) -> None:
        self.data = stress.data
        self._compiled = CompiledPatches.of(self.data, stress.element) if compiled else None
        self._now = stress
        self._slope = stress.slopes()
        self._seen = not own  # by others, so that the next sweep must leave its moments as they are

    @property
    def stress(self) -> AdmissibleStress:
        """The stress as it is now."""
        self._seen = True
        return self._now

    @property
    def moments(self) -> Array:
        """The moments (F, k, d) of its tractions, which the next sweep changes."""
        return self._now.tractions.moments

    @property
    def slopes(self) -> Array:
        """Half the derivatives (M, n) of the misfit by the moments on cells, which the next sweep changes."""
        return self._slope

    def move(self, moments: Array, slopes: Array) -> None:
        """Go on with other moments and the slopes that belong to them."""
        self._now, self._slope, self._seen = self._now.with_moments(moments), slopes, False

    @property
    def misfit(self) -> float:
        """``int (s - C eps) : C^-1 (s - C eps)`` over the body, for the mean of C on each cell."""
        return float(self._now.mean_square.sum())

    def sweep(
        self, kind: PatchKind, contact: ContactPenalty | Prices | None = None, only_contact: bool = False
    ) -> None:
        """Improve all patches of a kind once."""
        self._now = self._now.with_moments(self.moments.copy() if self._seen else self.moments)
        self._seen = False
        allowed = self._allowed(self.prices(contact) if isinstance(contact, ContactPenalty) else contact)
        key = (kind, self._compiled is None, allowed.free.tobytes(), allowed.partly.tobytes())
        groups = self.data.once(key, lambda: self._grouped(kind, allowed.free, allowed.partly))
        outer = [group for group in groups if group.outer]
        inner = [group for group in groups if not group.outer]
        for group in outer if only_contact and outer else [*outer, *inner, *outer]:
            self._improve(group, allowed, only_contact)

    def _grouped(self, kind: PatchKind, free: BoolArray, partly: BoolArray) -> list[_Group]:
        """All patches, those with rollers apart; with linear elements in the plane those of the boundary, too."""
        table = self.data.table
        patches, sides = cell_patches(table, kind), patch_sides(table.dim, kind)
        count = int(patches.max(initial=-1)) + 1

        def seen(facets: BoolArray) -> BoolArray:
            out = np.zeros(count, dtype=bool)
            out[patches[facets[table.cell_facets][:, sides].any(axis=2)]] = True
            return out

        some = seen(free)
        apart = some & seen(free & partly)

        def group(
            chosen: BoolArray, rollers: bool = False, outer: bool = False, first: IntArray | None = None
        ) -> _Group:
            order = None
            if self._compiled is not None and not rollers and chosen.any():
                order = self._compiled.ordered(patches, chosen, first)
            batches = patch_batches(table, kind, free, chosen, first) if order is None and chosen.any() else []
            return _Group(sides, order, batches, outer)

        if kind is not PatchKind.VERTEX or table.dim == 3 or self.data.order == 2:
            return [group(apart, rollers=True), group(some & ~apart)]
        outer = np.zeros(count, dtype=bool)
        outer[table.places[table.facets[~table.interior]]] = True
        size = np.bincount(patches.ravel(), minlength=count)
        return [
            group(apart, rollers=True, outer=True),
            group(some & outer & ~apart, outer=True),
            group(some & ~outer, first=size),
        ]

    def _improve(self, group: _Group, allowed: _Allowed, only_contact: bool) -> None:
        """Improve patches of a group that share no cell together, one colour after the other."""
        touching = np.asarray(self.data.contact >= 0)
        if self._compiled is not None and group.order is not None:
            order = group.order
            if only_contact:
                near = touching[self.data.table.cell_facets][:, group.sides]
                order = order.touching(np.asarray(near.any(axis=2)))
            self._compiled.improve(order, group.sides, allowed.free, self._slope, self.moments, allowed.prices)
        for batch in group.batches:
            some = batch.take(np.asarray(touching[batch.facets].any(axis=1))) if only_contact else batch
            self._improve_batch(some, allowed)

    def _allowed(self, prices: Prices | None) -> _Allowed:
        free, partly = self._unknown
        if prices is None:
            return _Allowed(free, partly, None)
        touching = self.data.contact >= 0
        return _Allowed(free | touching, partly & ~touching, prices)

    @cached_property
    def _unknown(self) -> tuple[BoolArray, BoolArray]:
        """Facets whose tractions may change without contact, and those on which some components are given."""
        free, given = self.data.table.interior.copy(), ~self.data.table.interior
        outer = np.flatnonzero(given)
        unknown = self.data.freed(outer)
        free[outer] = unknown.any(axis=(1, 2))
        given[outer] = (unknown != np.eye(self.data.table.dim)).any(axis=(1, 2))
        return free, given

    def prices(self, contact: ContactPenalty) -> Prices:
        """What contact tractions cost, for their moments."""
        data, dim = self.data, self.data.table.dim
        facet = contact.facets
        inverse = np.linalg.inv(facet_mass(dim, data.order))
        size, block = contact.price / data.table.measures[facet], self._now.element.block
        loose = np.eye(dim) - data.freed(facet)
        whole = np.einsum("f,ab,fij->faibj", size, inverse, loose).reshape(len(facet), block, block)
        wanted = contact.wanted - data.loads_on(facet)
        rows = np.full(len(data.table.facets), -1, dtype=np.int64)
        rows[facet] = np.arange(len(facet))
        if contact.mass is None or contact.start is None:
            return Prices(rows, whole, np.einsum("fpq,fq->fp", whole, wanted.reshape(len(facet), -1)))
        matrix = whole @ (contact.mass.reshape(whole.shape) / contact.price) @ whole
        start = contact.start.reshape(len(facet), -1)
        half = np.einsum("fpq,fq->fp", whole, start + wanted.reshape(len(facet), -1))
        return Prices(rows, matrix, half - np.einsum("fpq,fq->fp", matrix, start))

    # ---- by NumPy ----------------------------------------------------------------------------------------------

    def _improve_batch(self, batch: Batch, allowed: _Allowed) -> None:
        """Improve patches that share no cell."""
        facets, cells = batch.facets.shape[1], batch.cells.shape[1]
        element, dim = self._now.element, self.data.table.dim
        width = max(2 * facets, 12) * element.block
        step = max(_ENTRIES[dim] // (cells * element.moments * (element.moments + width)), 1)
        for start in range(0, len(batch.facets), step):
            part = batch.take(slice(start, start + step))
            system = self._system(part, allowed.partly)
            slope = np.einsum("kpq,kp->kq", system.seen, self._slope[part.cells].reshape(len(part.facets), -1))
            H = system.matrix
            if allowed.prices is not None:
                self._charge(part, system.fields, allowed.prices, H, slope)
            change = _least(H, slope)
            self.moments[part.facets] += system.fields.moments(change)
            bent = np.einsum("kpq,kq->kp", system.bent, change)
            self._slope[part.cells] += bent.reshape(*part.cells.shape, -1)

    def _system(self, batch: Batch, partly: BoolArray) -> _System:
        """The misfit of patches in their fields."""
        table, element, dim = self.data.table, self._now.element, self.data.table.dim
        (count, facets), cells = batch.facets.shape, batch.cells.shape[1]
        signs = table.signs[batch.cells]
        ends = np.full((count, facets + 1, 2), cells)
        at = np.broadcast_to(np.arange(cells)[:, None], batch.local.shape[1:])
        every = np.arange(count)[:, None, None]
        ends[every, batch.local, (signs < 0.0).astype(np.int64)] = at
        whole = ~partly[batch.facets]
        freed = self.data.freed(batch.facets)
        fields = patch_fields(self.data.places(batch.facets), ends[:, :facets], whole, cells, freed)
        N = fields.matrix()
        N = np.concatenate([N, np.zeros((count, 1, *N.shape[2:]))], axis=1)
        flat = batch.cells.ravel()
        seen = N[every, batch.local] * signs[..., None, None, None]
        seen = table.inverse[flat][:, None] @ seen.reshape(len(flat), -1, dim, N.shape[-1])
        seen = seen.reshape(len(flat), element.moments, -1)
        bent = element.matrix(self.data.reference_compliance[flat]) @ seen
        H = (seen.transpose(0, 2, 1) @ bent).reshape(count, cells, *[N.shape[-1]] * 2).sum(axis=1)
        width = N.shape[-1]
        return _System(fields, seen.reshape(count, -1, width), bent.reshape(count, -1, width), H)

    def _charge(self, batch: Batch, fields: PatchFields, prices: Prices, H: Array, slope: Array) -> None:
        """Add the price of contact tractions to the misfit of patches, in place."""
        patch, local = np.nonzero(prices.rows[batch.facets] >= 0)
        if not len(patch):
            return
        facet, some = batch.facets[patch, local], np.unique(patch)
        row = prices.rows[facet]
        N = np.zeros((len(H), *fields.nodes.shape[1:], H.shape[1]))
        N[some] = fields.take(some).matrix()
        on = N[patch, local].reshape(len(patch), -1, H.shape[1])
        half = prices.offsets[row]
        half = half + np.einsum("fpq,fq->fp", prices.matrices[row], self.moments[facet].reshape(len(facet), -1))
        np.add.at(H, patch, on.transpose(0, 2, 1) @ prices.matrices[row] @ on)
        np.add.at(slope, patch, np.einsum("fpq,fp->fq", on, half))


@dataclass(frozen=True, eq=False)
class _Allowed:
    """Facets (F,) whose tractions may change, those of them not in all components, and what contact tractions cost."""

    free: BoolArray
    partly: BoolArray
    prices: Prices | None


@dataclass(frozen=True, eq=False)
class _Group:
    """Patches of a kind that are improved together."""

    #: Local facets of a cell that are of the patch that sees it.
    sides: IntArray  # (q, p)
    #: For the kernels.
    order: PatchOrder | None
    #: For NumPy; empty where the kernels serve.
    batches: list[Batch]
    #: Whether they are improved before the others, and once more behind them.
    outer: bool


@dataclass(frozen=True, eq=False)
class _System:
    """The misfit of k patches of c cells in their q fields."""

    fields: PatchFields
    #: Moments of the fields on the facets of the cells, outward, on the reference simplex.
    seen: Array  # (k, c n, q)
    #: What they add to the slopes of the cells.
    bent: Array  # (k, c n, q)
    matrix: Array  # (k, q, q)


def _least(H: Array, b: Array) -> Array:
    """The x (k, q) that minimise ``x'H x / 2 + b'x``; zero for fields that are none, and where rounding decides."""
    none = np.diagonal(H, axis1=1, axis2=2) == 0.0
    if none.any():
        patch, number = np.nonzero(none)
        H = H.copy()
        H[patch, number, number] = 1.0
    try:
        change = np.asarray(-np.linalg.solve(H, b[:, :, None])[:, :, 0], dtype=float)
    except np.linalg.LinAlgError:
        return np.zeros(b.shape)  # of cells without volume; nothing but the sharpness depends on it
    change[none] = 0.0
    change[~lowering(H, b, change)] = 0.0
    return change
