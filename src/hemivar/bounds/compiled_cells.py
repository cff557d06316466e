"""Cells in the compiled kernels, which keep no stress: what these read is checked here."""

from __future__ import annotations

import ctypes
from ctypes import c_double, c_int64, c_void_p
from functools import cache

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.cell_kinds import CellKinds
from hemivar.bounds.split_element import SplitElement
from hemivar.bounds.vertex_moments import Tractions
from hemivar.kernels import kernels
from hemivar.kernels.read_arrays import given, numbers
from hemivar.mesh.keys import EDGES

__all__ = ["bubble_square", "cell_sums"]


class _Element(ctypes.Structure):
    """``CellElement`` of cells.hpp."""

    _fields_ = [
        *((name, c_int64) for name in ("dim", "nodes", "inner", "degrees", "piece_nodes")),
        *((name, c_void_p) for name in ("values", "mass", "loading", "ways", "energies")),
    ]


class _Stresses(ctypes.Structure):
    """``CellStresses`` of cells.hpp."""

    _fields_ = [
        *((name, c_int64) for name in ("cells", "facets", "own_nodes")),
        *((name, c_void_p) for name in ("compliance", "alike", "gradients", "signs", "cell_facets", "moments", "own")),
        ("sense", c_double),
        *((name, c_void_p) for name in ("loads", "defect", "energies", "slopes")),
    ]


class _Bubbles(ctypes.Structure):
    """``CellBubbles`` of cells.hpp."""

    _fields_ = [
        *((name, c_int64) for name in ("dim", "cells", "edges", "facets", "matrices")),
        *((name, c_void_p) for name in ("stiffness", "gradients", "sizes", "stress", "loads")),
        *((name, c_void_p) for name in ("cell_edges", "cell_facets", "ends", "interior")),
    ]


@cache
def _tables(element: SplitElement) -> tuple[Array, ...]:
    """The arrays of an element, in the order of the structure."""
    inner = element.energies[:, element.moments :, element.moments :]
    return tuple(map(np.ascontiguousarray, (element.values, element.mass, element.loading, element.ways, inner)))


def cell_sums(
    data: BodyData, tractions: Tractions, element: SplitElement, kinds: CellKinds, slopes: bool
) -> tuple[Array, Array] | None:
    """What :attr:`AdmissibleStress.difference` is for; None where there are no kernels.

    Shapes: returns ``energies`` (M,), ``slopes`` (M, k). Returned: ``energies``: ``int s : D s`` of the difference s,
    with the least energy that has these tractions and loads; ``slopes``: half its derivatives by the moments, on the
    reference simplex; empty where they are not wanted.
    """
    library = kernels()
    if library is None:
        return None
    table, dim, at = data.table, data.table.dim, library.address
    count, corners, facets, nodes = len(table.cells), dim + 1, len(table.facets), element.block // dim
    own, sense, loads = data.forces, -1.0, data.loads
    defect: tuple[Array, ...] = (tractions.defect,)
    if data.order > 1:
        own, sense, loads, defect = data.cell_moments, 1.0, data.linear(data.loads + tractions.defect), ()
    out = np.empty(count), np.empty((count if slopes else 0, element.moments))
    arrays = (
        given("compliance", kinds.compliance, (len(kinds.compliance), len(element.upper[0]))),
        numbers("alike", kinds.number, (count,), len(kinds.compliance)),
        given("gradients", table.gradients, (count, corners, dim)),
        given("signs", table.signs, (count, corners)),
        numbers("cell_facets", table.cell_facets, (count, corners), facets),
        given("moments", tractions.moments, (facets, nodes, dim)),
        given("own", own, (count, corners, nodes, dim) if data.order > 1 else (count, corners, dim)),
        *(
            given(name, array, (count, corners, dim))
            for name, array in zip(("loads", "defect"), (loads, *defect), strict=False)
        ),
    )
    tables = _tables(element)
    inner = element.ways.shape[1] - element.moments
    of = _Element(dim, nodes, inner, len(element.loading), len(element.mass), *map(at, tables))
    before, behind = [at(array) for array in arrays[:7]], [at(array) for array in arrays[7:]]
    body = _Stresses(
        count, facets, 1 if data.order == 1 else nodes, *before, sense, *behind, *([] if defect else [None]),
        at(out[0]), at(out[1]) if slopes else None,
    )  # fmt: skip
    library.check(library.call.hv_cells(ctypes.addressof(of), ctypes.addressof(body)))
    return out


def bubble_square(data: BodyData, edges: IntArray, ends: IntArray) -> float | None:
    """The square of :func:`hemivar.bounds.conjugate_sweeps.unresolved`; None without kernels.

    ``edges`` are the edges of the cells, (M, e); ``ends`` are their ends in a cell, (e, 2).
    """
    library = kernels()
    if library is None:
        return None
    table, dim = data.table, data.table.dim
    count, corners, facets, number = len(table.cells), dim + 1, len(table.facets), dim * (dim + 1) // 2
    matrices = 1 if len(data.compliance) == 1 else count
    last = int(edges.max(initial=-1)) + 1
    interior = np.ascontiguousarray(table.interior)
    arrays = (
        given("stiffness", np.asarray(np.linalg.inv(data.compliance), dtype=float), (matrices, number, number)),
        given("gradients", table.gradients, (count, corners, dim)),
        given("sizes", table.sizes, (count,)),
        given("stress", data.stress, (count, dim, dim)),
        given("loads", data.loads, (count, corners, dim)),
        numbers("edges", edges, (count, len(ends)), last),
        numbers("cell_facets", table.cell_facets, (count, corners), len(interior)),
        numbers("ends", ends, (len(EDGES[dim]), 2), corners),
        interior,
    )
    body, out = _Bubbles(dim, count, last, facets, matrices, *map(library.address, arrays)), np.empty(1)
    library.check(library.call.hv_unresolved(ctypes.addressof(body), library.address(out)))
    return float(out[0])
