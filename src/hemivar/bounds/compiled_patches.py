"""Patches in the compiled kernels: what these read is checked here."""

from __future__ import annotations

import ctypes
from ctypes import c_int64, c_void_p
from dataclasses import dataclass

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.patches import priorities
from hemivar.bounds.split_element import SplitElement
from hemivar.kernels import kernels
from hemivar.kernels.library import Kernels
from hemivar.kernels.read_arrays import given, numbers, rising

__all__ = ["CompiledPatches", "PatchOrder", "Prices"]

#: Colours that the kernels know.
_COLOURS = 256


@dataclass(frozen=True, eq=False)
class Prices:
    """What contact tractions cost: for moments m of a facet ``m'P m / 2 + p'm``."""

    #: Where facets stand below; -1 for others.
    rows: IntArray  # (F,)
    #: P.
    matrices: Array  # (c, n, n)
    #: p.
    offsets: Array  # (c, n)

    def slope(self, moments: Array) -> Array:
        """``P m + p`` on the facets that have a price, (c, n), in their order, of the moments (F, k, d) of all."""
        return np.asarray(self.bent(moments) + self.offsets[self.rows[self._facets]])

    def bent(self, moments: Array) -> Array:
        """``P m`` there."""
        facets = self._facets
        near = moments[facets].reshape(len(facets), -1)
        return np.asarray(np.einsum("fpq,fq->fp", self.matrices[self.rows[facets]], near))

    def work(self, moments: Array, slope: Array) -> float:
        """``m . s`` for slopes s (c, n) there."""
        return float(np.vdot(moments[self._facets], slope))

    @cached_property
    def _facets(self) -> IntArray:
        return np.flatnonzero(self.rows >= 0)


@dataclass(frozen=True, eq=False)
class PatchOrder:
    """Patches with their cells, colour after colour.

    A cell is seen at q places, its vertices, edges or facets, which are numbered ``q cell + place``.
    """

    #: Where the cells of each patch begin.
    start: IntArray  # (P + 1,)
    #: Cells, each with the place at which the patch sees it.
    seen: IntArray  # (s,)
    #: The patches.
    order: IntArray  # (p,)
    #: Where those of each colour begin.
    bounds: IntArray  # (colours + 1,)

    def touching(self, touched: BoolArray) -> PatchOrder:
        """Those alone that see a cell at a place (M, q) that is touched."""
        patch = np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))
        some = np.zeros(len(self.start) - 1, dtype=bool)
        some[patch[touched.ravel()[self.seen[: len(patch)]]]] = True
        kept = some[self.order]
        bounds = np.concatenate([[0], np.cumsum(kept)])[self.bounds]
        return PatchOrder(self.start, self.seen, self.order[kept], bounds)


class _Body(ctypes.Structure):
    """``PatchBody`` of patches.hpp."""

    _fields_ = [
        *((name, c_int64) for name in ("dim", "nodes", "inner", "cells", "facets")),
        *((name, c_void_p) for name in ("energies", "compliance", "gradients", "signs", "points")),
        *((name, c_void_p) for name in ("cell_facets", "facet_nodes", "alike")),
    ]


class _Sweep(ctypes.Structure):
    """``PatchSweep`` of patches.hpp."""

    _fields_ = [
        *((name, c_int64) for name in ("seen_of_cell", "sides_of_seen", "patches", "colours")),
        *((name, c_void_p) for name in ("sides", "start", "seen", "order", "bounds", "free")),
        *((name, c_void_p) for name in ("rows", "matrices", "offsets", "slope", "moments")),
    ]


class CompiledPatches:
    """What improves the patches of one body.

    ``compliance`` is (k, v (v + 1) / 2), the upper triangles of each kind of cells; ``gradients`` is (M, d + 1, d);
    ``signs`` and ``cell_facets`` are (M, d + 1); ``facet_nodes`` is (F, l); ``points`` is (N, d); ``alike`` is (M,),
    the kinds.
    """

    def __init__(
        self,
        library: Kernels,
        element: SplitElement,
        compliance: Array,
        gradients: Array,
        signs: Array,
        cell_facets: IntArray,
        facet_nodes: IntArray,
        points: Array,
        alike: IntArray,
    ) -> None:
        dim, corners = element.dim, element.dim + 1
        count, facets, places = len(cell_facets), len(facet_nodes), element.block // dim
        self._library, self._element = library, element
        self._arrays = (  # in the order of the structure
            np.ascontiguousarray(element.energies.transpose(1, 0, 2)),
            given("compliance", compliance, (len(compliance), len(element.energies))),
            given("gradients", gradients, (count, corners, dim)),
            given("signs", signs, (count, corners)),
            given("points", points, (len(points), dim)),
            numbers("cell_facets", cell_facets, (count, corners), facets),
            numbers("facet_nodes", facet_nodes, (facets, places), len(points)),
            numbers("alike", alike, (count,), min(len(compliance), count)),
        )
        inner = element.energies.shape[1] - element.moments
        self._body = _Body(dim, places, inner, count, facets, *map(library.address, self._arrays))

    def __reduce__(self) -> str:
        raise TypeError("compiled patches belong to this process")

    @classmethod
    def of(cls, data: BodyData, element: SplitElement) -> CompiledPatches | None:
        """Those of a body; None where the kernels are not there."""
        library, table = kernels(), data.table
        if library is None:
            return None

        def made() -> CompiledPatches:
            return cls(
                library, element, data.kinds.compliance, table.gradients, table.signs, table.cell_facets,
                data.facet_nodes, data.problem.mesh.nodes(data.order), data.kinds.number,
            )  # fmt: skip

        return made() if data.stored is not None else data.once("patches", made)

    def ordered(self, patches: IntArray, chosen: BoolArray, first: IntArray | None = None) -> PatchOrder | None:
        """The chosen ones of the patches (M, q) of cells; None where they need more colours than the kernels know.

        Their colours are those of :func:`hemivar.bounds.patches.coloured`.
        """
        count, of_cells = len(chosen), numbers("patches", patches, (self._body.cells, patches.shape[-1]), len(chosen))
        if chosen.dtype != bool or chosen.ndim != 1:
            raise ValueError("which patches are chosen must be an array of bool")
        if not chosen.all():
            of_cells = np.where(chosen[of_cells], of_cells, -1)
        ranked = np.empty(count, dtype=np.int64)
        ranked[count - 1 - priorities(count, first=first)] = np.arange(count)
        start, seen = np.empty(count + 1, dtype=np.int64), np.empty(of_cells.size, dtype=np.int64)
        order, bounds = np.empty(count, dtype=np.int64), np.empty(_COLOURS + 1, dtype=np.int64)
        at = self._library.address
        colours = self._library.call.hv_patch_order(
            *of_cells.shape, at(of_cells), count, at(ranked), at(start), at(seen), at(order), at(bounds)
        )
        if colours < -1:
            raise MemoryError("no memory for the compiled kernels")
        if colours < 0:
            return None
        bounds = bounds[: colours + 1]
        return PatchOrder(start, seen[: start[-1]], order[: bounds[-1]], bounds)

    def improve(
        self,
        order: PatchOrder,
        sides: IntArray,
        free: BoolArray,
        slope: Array,
        moments: Array,
        prices: Prices | None = None,
    ) -> None:
        """Lower the misfit on patches, colour after colour.

        ``sides`` is (q, p); ``free`` is (F,); ``slope`` is (M, n); ``moments`` is (F, l, d).
        """
        body, element = self._body, self._element
        count, facets, block = body.cells, body.facets, element.block
        for name, array, shape in (
            ("slope", slope, (count, element.moments)), ("moments", moments, (facets, body.nodes, body.dim))
        ):  # fmt: skip
            if array.dtype != float or array.shape != shape or not array.flags.carray:
                raise ValueError(f"{name} must be an array of float64 of shape {shape}, contiguous and writeable")
        sides = numbers("sides", sides, (len(sides), sides.shape[-1]), body.dim + 1)
        if free.dtype != bool or free.shape != (facets,):
            raise ValueError(f"which facets are free must be an array of {facets} bool")
        mask = np.ascontiguousarray(free).view(np.uint8)
        start, colours = np.ascontiguousarray(order.start), len(order.bounds) - 1
        seen = numbers("seen", order.seen, (len(order.seen),), count * len(sides))
        start = rising("start", start, len(seen))
        patches = numbers("order", order.order, (len(order.order),), len(start) - 1)
        bounds = rising("bounds", order.bounds, len(patches))
        if np.bincount(patches, minlength=1).max() > 1:
            raise ValueError("a patch must not be named twice")
        at = self._library.address
        costs: tuple[np.ndarray, ...] = ()
        if prices is not None:
            number = len(prices.matrices)
            costs = (
                numbers("rows", prices.rows, (facets,), number, least=-1),
                given("matrices", prices.matrices, (number, block, block)),
                given("offsets", prices.offsets, (number, block)),
            )
        sweep = _Sweep(
            len(sides), sides.shape[1], len(start) - 1, colours,
            at(sides), at(start), at(seen), at(patches), at(bounds), at(mask),
            *(map(at, costs) if costs else [None] * 3), at(slope), at(moments),
        )  # fmt: skip
        status = self._library.call.hv_improve_patches(ctypes.addressof(body), ctypes.addressof(sweep))
        if status == 2:
            raise ValueError("patches of one colour must not share a cell")
        self._library.check(status)
