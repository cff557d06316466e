"""Validity of meshes (conformity, orientation, quality); each check refuses by a ProblemError that names the place."""

from __future__ import annotations

import math
from collections.abc import ItemsView, Mapping

import numpy as np
from numpy.typing import ArrayLike

from hemivar.basics.arguments import expect, name_of, quoted
from hemivar.basics.arrays import real_array, unmasked
from hemivar.basics.memory import mesh_bytes, require
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.keys import EDGES, cell_facets, cell_parts, facet_keys, frozen, shared_facets, signed_volumes

__all__ = [
    "check_cells",
    "check_coordinates",
    "check_grid",
    "check_order",
    "checked_arrays",
    "checked_boundaries",
    "checked_interfaces",
    "checked_regions",
    "coincident",
    "index_array",
    "is_whole",
]

#: Volume of a cell, of the power of its longest edge, up to which it counts as none: a thousand times the rounding of a
#: product of edges.
_FLAT = 1e-13
#: Coordinates are below this and cells larger than its inverse, so that volumes and energies are numbers.
_LARGEST = 1e90
#: Part of the size of a cell by which its coordinates may be rounded.
_ROUNDING = 1e-6


def is_whole(value: float | str, least: int) -> bool:
    """Whether a value is a whole number, of whatever type, and not less than ``least``."""
    try:
        return not isinstance(value, bool | str) and bool(int(value) == value and value >= least)
    except (TypeError, ValueError, OverflowError, np.ma.MaskError):
        return False


def check_grid(size: tuple[float, ...], cells: tuple[int, ...], origin: tuple[float, ...], simplices: int) -> None:
    """Refuse a grid that does not fit into memory, or whose nodes its coordinates cannot tell apart."""
    try:
        number = float(simplices * math.prod(cells))
    except OverflowError:
        number = math.inf
    require(mesh_bytes(len(size), number), f"a mesh of {number:.3g} cells")
    steps = np.array([extent / count for extent, count in zip(size, cells, strict=True)])
    with np.errstate(over="ignore"):
        lowest = np.array(origin)
        corners = np.maximum(np.abs(lowest), np.abs(lowest + np.array(size)))
    _check_range(float(corners.max()))
    where = f"size = {list(size)}, cells = {list(cells)}, origin = {list(origin)}"
    _check_sizes(corners, steps, where)
    shape = steps / steps.max()
    if shape.prod() / simplices <= _FLAT * float(np.linalg.norm(shape)) ** len(size):
        raise ProblemError(
            f"{where}: this makes cells without volume, {steps.max():.3g} long and {steps.min():.3g} wide; "
            "take other sizes"
        )


def check_coordinates(points: Array, cells: IntArray) -> Array:
    """Refuse coordinates in which cells lose their shapes; returns the square of the longest edge of each cell."""
    reach = np.abs(points).max(axis=1)
    _check_range(float(reach.max()))
    longest = np.zeros(len(cells))
    for a, b in EDGES[points.shape[1]]:
        np.maximum(longest, np.sum((points[cells[:, a]] - points[cells[:, b]]) ** 2, axis=1), out=longest)
    size = np.sqrt(longest)
    some = size > 0.0  # the others are degenerate
    if some.any():
        _check_sizes(reach[cells].max(axis=1)[some], size[some], f"points near {_at(points, cells, some)}")
    return longest


def _check_range(largest: float) -> None:
    if not 1.0 / _LARGEST < largest < _LARGEST:
        raise ProblemError(
            f"the largest coordinate of the mesh is {largest:.3g}, whose powers are beyond the range of numbers; take "
            f"another unit of length, so that it lies between {1.0 / _LARGEST:.0e} and {_LARGEST:.0e}"
        )


def _check_sizes(coordinates: Array, sizes: Array, where: str) -> None:
    """Refuse cells of sizes (k,) that coordinates as large as these (k,) describe too coarsely."""
    if not (sizes > 1.0 / _LARGEST).all():
        raise ProblemError(
            f"{where}: a cell of size {sizes.min():.3g} has a volume below the range of numbers; take another unit of "
            f"length, so that cells are larger than {1.0 / _LARGEST:.0e}"
        )
    rounding = np.finfo(float).eps * coordinates
    if (rounding > _ROUNDING * sizes).any():
        bad = int(np.argmax(coordinates / sizes))
        raise ProblemError(
            f"{where}: coordinates of {coordinates[bad]:.3g} are rounded to {rounding[bad]:.2g}, which "
            f"spoils the shape of cells of size {sizes[bad]:.3g}; move the body nearer to the origin"
        )


def check_cells(points: Array, cells: IntArray) -> None:
    """Refuse cells without volume, inverted ones, and nodes of no cell."""
    longest = check_coordinates(points, cells)
    volume = signed_volumes(points, cells)
    flat = np.abs(volume) <= _FLAT * np.sqrt(longest) ** points.shape[1]
    if flat.any():
        raise ProblemError(
            f"{np.count_nonzero(flat)} cells are degenerate (no volume): cells {_some(flat)}, the first at "
            f"{_at(points, cells, flat)}; remove them or separate their nodes"
        )
    if np.any(volume < 0):
        raise ProblemError(
            f"{np.count_nonzero(volume < 0)} cells are inverted: cells {_some(volume < 0)}, the first at "
            f"{_at(points, cells, volume < 0)}; swap two of their nodes or build the mesh with Mesh.oriented(...)"
        )
    lonely = np.bincount(cells.ravel(), minlength=len(points)) == 0
    if lonely.any():
        raise ProblemError(
            f"{np.count_nonzero(lonely)} nodes belong to no cell: nodes {_some(lonely)}, the first at "
            f"{_coordinates(points[np.argmax(lonely)])}; remove them from points"
        )


def _check_sides(points: Array, facets: IntArray, order: IntArray, first: IntArray, counts: IntArray) -> None:
    """Refuse facets of more than two cells, and two cells on the same side of a facet.

    ``order`` sorts all facets of positively oriented cells by their keys; those of one key are ``counts`` facets from
    place ``first`` on.  Two cells on the two sides of a facet run round it in opposite senses.
    """
    corners = facets.shape[1] + 1
    if counts.max(initial=0) > 2:
        worst = int(np.argmax(counts))
        members = order[first[worst] : first[worst] + counts[worst]]
        bad = facets[members[0]]
        raise ProblemError(
            f"the facet with nodes {bad.tolist()} at {_coordinates(points[bad].mean(axis=0))} belongs to "
            f"{counts[worst]} cells ({', '.join(map(str, np.sort(members // corners)[:6].tolist()))}); at most two "
            f"cells may share a facet: remove overlapping cells"
        )
    shared = first[counts == 2]
    one, other = order[shared], order[shared + 1]
    alike = _sense(facets[one]) == _sense(facets[other])
    if alike.any():
        worst = int(np.argmax(alike))
        bad, cells = facets[one[worst]], sorted((int(one[worst]) // corners, int(other[worst]) // corners))
        raise ProblemError(
            f"cells {cells[0]} and {cells[1]} lie on the same side of the facet with nodes {bad.tolist()} at "
            f"{_coordinates(points[bad].mean(axis=0))}: they overlap, or are one cell twice; remove one of them"
        )


def _sense(facets: IntArray) -> BoolArray:
    """Whether the nodes of facets (k, 2 or 3) are an odd permutation of sorted ones."""
    odd: BoolArray = facets[:, 0] > facets[:, 1]
    if facets.shape[1] == 3:
        odd = odd ^ (facets[:, 0] > facets[:, 2]) ^ (facets[:, 1] > facets[:, 2])
    return odd


def coincident(points: Array, facets: IntArray) -> BoolArray:
    """Which of the facets (k, d) lie where another one lies, with nodes of its own."""
    corners = _places(points, facets)
    return np.zeros(len(facets), dtype=bool) if corners is None else _several(corners)


def _places(points: Array, facets: IntArray) -> IntArray | None:
    """Numbers of the places of the corners of facets (k, d), sorted in each; None where each node has its own."""
    nodes, local = np.unique(facets, return_inverse=True)
    places, number = np.unique(points[nodes], axis=0, return_inverse=True)
    return None if len(places) == len(nodes) else np.sort(number.ravel()[local.reshape(facets.shape)], axis=1)


def _several(rows: IntArray) -> BoolArray:
    """Which rows occur more than once."""
    _, which, counts = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(counts[which.ravel()] > 1)


def _check_cuts(points: Array, cells: IntArray, outer: IntArray, owner: IntArray, named: IntArray) -> None:
    """Refuse outer facets (k, d) of one part at one place, with nodes of their own, unless ``named`` (m,) lists both.

    There the part is cut: by a crack, whose faces have names, or because it was not joined.
    """
    corners = _places(points, outer)
    if corners is None:
        return
    bare = _several(np.column_stack([corners, cell_parts(cells, len(points))[1][owner]]))
    bare[named] = False
    if bare.any():
        bad = int(np.argmax(bare))
        raise ProblemError(
            f"the body is cut at {_coordinates(points[outer[bad]].mean(axis=0))}: {np.count_nonzero(bare)} "
            f"facets coincide (first nodes {outer[bad].tolist()}); join coincident nodes, or name both faces of a "
            f"crack as boundaries"
        )


def index_array(value: object, name: str, count: int) -> IntArray:
    """An array of whole numbers from 0 to ``count - 1``; of its own, unless what was given is read-only."""
    value = unmasked(value, name)
    try:
        array = np.asarray(value)
    except ValueError:
        raise ProblemError(f"{name} must hold whole numbers in rows of one length") from None
    if array.size == 0:
        return np.zeros((0, 0), dtype=np.int64)
    if array.dtype.kind not in "iu":
        raise ProblemError(f"{name} must hold whole numbers, not {array.dtype}")
    lowest, highest = int(array.min()), int(array.max())
    if lowest < 0 or highest >= count:
        raise ProblemError(
            f"{name} refers to number {lowest if lowest < 0 else highest}; valid numbers are 0 to {count - 1}"
        )
    return array.astype(np.int64, copy=bool(array.flags.writeable))


def checked_arrays(points: ArrayLike, cells: object) -> tuple[Array, IntArray]:
    """Points and cells of the right shapes, read-only, of their own."""
    nodes = np.array(real_array(points, "points"))
    if nodes.ndim != 2 or nodes.shape[1] not in (2, 3) or len(nodes) == 0:
        raise ProblemError(f"points has shape {nodes.shape}; it must be (N, 2) or (N, 3)")
    connectivity = index_array(cells, "cells", len(nodes))
    dim = nodes.shape[1]
    if connectivity.ndim != 2 or connectivity.shape[1] != dim + 1 or len(connectivity) == 0:
        kind = "triangles" if dim == 2 else "tetrahedra"
        raise ProblemError(f"cells has shape {connectivity.shape}; {kind} need shape (M, {dim + 1})")
    require(mesh_bytes(dim, len(connectivity), checked=True), f"a mesh of {len(connectivity)} cells")
    return frozen(nodes), frozen(connectivity)


def checked_boundaries(points: Array, cells: IntArray, boundaries: Mapping[str, object]) -> dict[str, IntArray]:
    """Named facets of the outer boundary, each once and outward oriented."""
    dim, count = points.shape[1], len(points)
    facets, keys, _ = cell_facets(cells, count)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    start = np.flatnonzero(np.concatenate([[True], ordered[1:] != ordered[:-1]]))
    counts = np.diff(start, append=len(ordered))
    sorted_keys, first = ordered[start], order[start]
    _check_sides(points, facets, order, start, counts)
    result, named = {}, []
    for name, value in _by_name(boundaries, "boundaries"):
        given = index_array(value, f"boundary '{name}'", count)
        if given.size == 0:
            raise ProblemError(f"boundary '{name}' holds no facets; remove it or fill it")
        if given.ndim != 2 or given.shape[1] != dim:
            raise ProblemError(
                f"boundary '{name}' has shape {given.shape}; it must list {dim} nodes per facet, shape (k, {dim})"
            )
        wanted = facet_keys(given, count)
        slot = np.minimum(np.searchsorted(sorted_keys, wanted), len(sorted_keys) - 1)
        known = sorted_keys[slot] == wanted
        outer = known & (counts[slot] == 1)
        if not outer.all():
            bad = int(np.flatnonzero(~outer)[0])
            what = "lies between two cells" if known[bad] else "is not a facet of any cell"
            raise ProblemError(
                f"boundary '{name}': the facet with nodes {given[bad].tolist()} {what} "
                f"({np.count_nonzero(~outer)} such facets); list facets of the outer boundary only"
            )
        _, unique = np.unique(wanted, return_index=True)
        result[str(name)] = frozen(facets[first[slot[np.sort(unique)]]])
        named.append(first[slot])
    if named:
        alone = np.sort(first[counts == 1])
        _check_cuts(points, cells, facets[alone], alone // (dim + 1), np.searchsorted(alone, np.concatenate(named)))
    return result


def checked_interfaces(
    points: Array, cells: IntArray, interfaces: Mapping[str, object], boundaries: Mapping[str, IntArray]
) -> dict[str, IntArray]:
    """Named facets between two cells, each once, outward oriented from the cell with the smaller number."""
    named = _by_name(interfaces, "interfaces")
    if not named:
        return {}
    dim, count = points.shape[1], len(points)
    facets, keys, _ = cell_facets(cells, count)
    inner, _ = shared_facets(keys)
    result = {}
    for name, value in named:
        if name in boundaries:
            raise ProblemError(f"'{name}' names a boundary and an interface; give them different names")
        given = index_array(value, f"interface '{name}'", count)
        if given.size == 0:
            raise ProblemError(f"interface '{name}' holds no facets; remove it or fill it")
        if given.ndim != 2 or given.shape[1] != dim:
            raise ProblemError(
                f"interface '{name}' has shape {given.shape}; it must list {dim} nodes per facet, shape (k, {dim})"
            )
        wanted = facet_keys(given, count)
        outside = ~np.isin(wanted, keys[inner])
        if outside.any():
            bad = given[int(np.argmax(outside))]
            raise ProblemError(
                f"interface '{name}': the facet with nodes {bad.tolist()} does not lie between two cells; list facets "
                "inside the body only"
            )
        result[str(name)] = frozen(facets[inner[np.isin(keys[inner], wanted)]])
    return result


def _by_name(parts: Mapping[str, object], what: str) -> ItemsView[str, object]:
    expect(parts, Mapping, what, "give a dict of numbers by names")  # type: ignore[type-abstract]
    for name in parts:
        name_of(str(name), f"a name of {what}", "give one that conditions and results can use, such as 'left'")
    return parts.items()


def checked_regions(regions: Mapping[str, object], count: int) -> dict[str, IntArray]:
    """Named parts of ``count`` cells, each by sorted numbers."""
    result = {}
    for name, value in _by_name(regions, "regions"):
        ids = index_array(value, f"region '{name}'", count)
        if ids.size == 0:
            raise ProblemError(f"region '{name}' holds no cells; remove it or fill it")
        if ids.ndim != 1:
            raise ProblemError(f"region '{name}' has shape {ids.shape}; it must list cell numbers, shape (k,)")
        mask = np.zeros(count, dtype=bool)
        mask[ids] = True
        result[str(name)] = frozen(np.flatnonzero(mask))
    return result


def _at(points: Array, cells: IntArray, mask: BoolArray) -> str:
    """The centre of the first cell where ``mask`` holds, for messages."""
    return _coordinates(points[cells[int(np.argmax(mask))]].mean(axis=0))


def _coordinates(point: Array) -> str:
    return "(" + ", ".join(f"{value:.6g}" for value in point) + ")"


def _some(mask: BoolArray, limit: int = 5) -> str:
    """The first few numbers where ``mask`` holds, for messages."""
    numbers = np.flatnonzero(mask)
    return ", ".join(str(int(i)) for i in numbers[:limit]) + (", ..." if len(numbers) > limit else "")


def check_order(order: object) -> None:
    """Refuse an order of the nodes that is neither 1 nor 2."""
    if isinstance(order, bool) or not isinstance(order, int | np.integer) or order not in (1, 2):
        raise ProblemError(f"order = {quoted(order)}; give 1 or 2")
