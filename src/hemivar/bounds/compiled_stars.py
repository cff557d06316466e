"""Tractions in equilibrium around vertices by the compiled kernels: what these read is checked here."""

from __future__ import annotations

import ctypes
from ctypes import c_int64, c_void_p

import numpy as np

from hemivar.basics.types import AnyArray, Array, IntArray
from hemivar.bounds.body_data import BodyData
from hemivar.kernels import kernels
from hemivar.kernels.library import Kernels
from hemivar.kernels.read_arrays import given, numbers, rising

__all__ = ["CompiledStars"]

_SIZES = ("dim", "of_facet", "of_cell", "vertices", "nodes", "cells", "facets")
_ARRAYS = (
    "cell_nodes", "cell_facets", "owners", "interior", "contact", "measures", "volumes", "dear", "forces", "loads",
    "own", "outer", "given", "unknown", "pressures", "missed", "start", "pairs", "place",
)  # fmt: skip
#: Of those that are neither numbers of float64 nor of int64.
_KINDS: dict[str, type] = {"interior": np.bool_, "contact": np.bool_, "place": np.int32}


class _Body(ctypes.Structure):
    """``StarBody`` of stars.hpp."""

    _fields_ = [*((name, c_int64) for name in _SIZES), *((name, c_void_p) for name in _ARRAYS)]


class CompiledStars:
    """What is around the vertices of one body.

    The names and shapes of the arrays are those of ``StarBody`` in stars.hpp; ``own``, ``pressures`` and ``missed`` may
    be left out.
    """

    def __init__(self, library: Kernels, nodes: int, arrays: dict[str, AnyArray]) -> None:
        (cells, of_cell), (of_facet, dim) = arrays["cell_nodes"].shape, arrays["given"].shape[1:]
        facets, corners, vertices = len(arrays["owners"]), dim + 1, len(arrays["start"]) - 1
        if (dim, of_facet, of_cell) not in ((2, 2, 3), (2, 3, 6), (3, 3, 4)):
            raise ValueError(f"there are no elements with {of_facet} nodes on facets and {of_cell} on cells")
        on_cells, on_facets = (cells, of_cell, dim), (facets, of_facet, dim)
        outer = len(arrays["given"]), *on_facets[1:]
        shapes = {
            "cell_nodes": on_cells[:2], "cell_facets": (cells, corners), "owners": (facets, 2), "interior": (facets,),
            "contact": (facets,), "measures": (facets,), "volumes": (cells,), "dear": (cells,), "forces": on_cells,
            "loads": on_cells, "own": (cells, corners, *on_facets[1:]), "outer": (facets,),
            "given": outer, "unknown": (outer[0], dim, dim), "pressures": outer, "missed": (nodes, dim),
            "start": (vertices + 1,), "pairs": (cells * corners,), "place": (cells * corners,),
        }  # fmt: skip
        ends = {"cell_nodes": nodes, "cell_facets": facets, "owners": cells, "pairs": cells * corners, "start": None}
        ends["outer"] = outer[0]
        self._arrays: dict[str, AnyArray] = {}
        for name, one in arrays.items():
            if name in ends:
                self._arrays[name] = numbers(name, one, shapes[name], ends[name], -1 if name == "owners" else 0)
            elif name in _KINDS:
                self._arrays[name] = _exactly(name, one, _KINDS[name], shapes[name])
            else:
                self._arrays[name] = given(name, one, shapes[name])
        rising("start", self._arrays["start"], cells * corners)
        if (self._arrays["owners"][:, 0] < 0).any():
            raise ValueError("every facet must have a first owner")
        if (self._arrays["interior"] & (self._arrays["owners"][:, 1] < 0)).any():
            raise ValueError("facets inside must have two owners")
        self._library, self._vertices = library, vertices
        self._shapes = on_facets, on_cells
        pointers = (library.address(self._arrays[name]) if name in self._arrays else None for name in _ARRAYS)
        self._body = _Body(dim, of_facet, of_cell, vertices, nodes, cells, facets, *pointers)

    def __reduce__(self) -> str:
        raise TypeError("compiled stars belong to this process")

    @classmethod
    def of(cls, data: BodyData, dear: Array, pressures: Array | None = None) -> CompiledStars | None:
        """Those of a body; None where the kernels are not there.

        ``dear`` is (M,): what the square of a moment costs, times the square of the measure of its facet. ``pressures``
        is (F, k, d).
        """
        library, table = kernels(), data.table
        if library is None:
            return None
        start, pairs, rank = table.stars
        arrays = {
            "cell_nodes": data.cell_nodes, "cell_facets": table.cell_facets, "owners": table.owners,
            "interior": table.interior, "contact": data.contact >= 0, "measures": table.measures,
            "volumes": table.volumes, "dear": dear, "forces": data.forces, "loads": data.loads,
            "outer": table.outer_places, "given": data.outer_loads, "unknown": data.freed(table.outer),
            "start": start, "pairs": pairs, "place": rank,
        }  # fmt: skip
        if data.order > 1:
            arrays["own"] = data.cell_moments
        if pressures is not None:
            arrays["pressures"] = pressures[table.outer]
        if data.varying.missed.any():
            arrays["missed"] = data.varying.missed
        return cls(library, len(data.displacement), arrays)

    def settled(self) -> tuple[int, Array, Array, Array]:
        """A vertex whose cells do not share facets, or -1; moments (F, k, d); defect and missed loads (M, l, d)."""
        on_facets, on_cells = self._shapes
        moments, defect = np.empty(on_facets), np.empty(on_cells)
        lost = np.empty(on_cells) if "missed" in self._arrays else None
        at, pinched = self._library.address, ctypes.c_int64(-1)
        self._check(
            self._library.call.hv_settle_stars(
                ctypes.addressof(self._body), at(moments), at(defect), None if lost is None else at(lost),
                ctypes.addressof(pinched),
            )
        )  # fmt: skip
        return pinched.value, moments, defect, np.broadcast_to(0.0, on_cells) if lost is None else lost

    def on_contact(self, vertices: IntArray) -> Array:
        """Moments (F, k, d) that share the forces of the nodes on contact facets at these vertices; zero elsewhere."""
        some = numbers("vertices", vertices, (len(vertices),), self._vertices)
        moments, at = np.zeros(self._shapes[0]), self._library.address
        call = self._library.call.hv_share_on_contact
        self._check(call(ctypes.addressof(self._body), len(some), at(some), at(moments)))
        return moments

    def _check(self, status: int) -> None:
        if status == 2:
            raise ValueError("facets, owners and pairs of a vertex must be those of one mesh")
        self._library.check(status)


def _exactly(name: str, array: AnyArray, kind: type, shape: tuple[int, ...]) -> AnyArray:
    if array.dtype != kind or array.shape != shape:
        raise ValueError(f"{name} must be an array of {np.dtype(kind)} of shape {shape}")
    return np.require(array, kind, ["C", "A"])
