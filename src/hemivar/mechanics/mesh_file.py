"""Mesh files of any format, made into meshes."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from hemivar._typing import IntArray
from hemivar.errors import ProblemError
from hemivar.mechanics.mesh import Mesh

__all__ = ["mesh_from_file"]

_CELL_DIMENSION = {"vertex": 0, "line": 1, "triangle": 2, "tetra": 3}


def mesh_from_file(path: str | Path) -> Mesh:
    """Read a mesh file (Gmsh 2.2 and 4.1, and whatever meshio reads).

    Physical groups of Gmsh and cell sets become boundaries (groups of facets) and regions (groups of cells).
    Nodes that no cell uses are dropped, as is the third coordinate of plane meshes; inverted cells are
    turned.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    ProblemError
        If the file is missing or cannot be read, or holds cells other than straight triangles or tetrahedra.
    """
    raw = _read_silently(Path(path))
    foreign = sorted({block.type for block in raw.cells} - set(_CELL_DIMENSION))
    if foreign:
        raise ProblemError(
            f"'{path}' holds cells of type {', '.join(foreign)}; only straight-sided triangles and "
            f"tetrahedra are supported: mesh with simplices of order 1 (no recombination)"
        )
    dims = [_CELL_DIMENSION[block.type] for block in raw.cells]
    dim = max(dims, default=0)
    if dim < 2:
        raise ProblemError(
            f"'{path}' holds no triangles or tetrahedra; if it comes from Gmsh, put the body into a physical group"
        )
    points = np.asarray(raw.points, dtype=float)
    cells = np.vstack([np.asarray(block.data) for block in raw.cells if block.type == _SIMPLEX[dim]])
    used = np.unique(cells)
    if dim == 2 and points.shape[1] == 3:
        height = points[used, 2]
        extent = np.ptp(points[used], axis=0).max()
        if np.ptp(height) > 1e-10 * max(extent, 1e-300):
            raise ProblemError(
                f"'{path}' is a surface in space (z from {height.min():g} to {height.max():g}); a plane "
                f"mesh must have constant z, a solid one needs tetrahedra"
            )
        points = points[:, :2]
    number = np.full(len(points), -1, dtype=np.int64)
    number[used] = np.arange(len(used))
    boundaries: dict[str, IntArray] = {}
    regions: dict[str, IntArray] = {}
    for (group_dim, name), members in _groups(raw, dims).items():
        if group_dim == dim - 1:
            facets = [np.asarray(raw.cells[block].data)[ids] for block, ids in members]
            facets_now = number[np.vstack(facets)]
            if np.any(facets_now < 0):
                raise ProblemError(f"'{path}': group '{name}' has facets that belong to no cell; remove them")
            boundaries[name] = facets_now
        elif group_dim == dim:
            starts = _block_starts(raw, _SIMPLEX[dim])
            regions[name] = np.unique(np.concatenate([starts[block] + ids for block, ids in members]))
    return Mesh.oriented(points[used], number[cells], boundaries, regions)


_SIMPLEX = {2: "triangle", 3: "tetra"}


def _read_silently(path: Path) -> Any:
    """The meshio mesh of a file; meshio's printing is swallowed and its failures reported in one line."""
    import meshio

    if not path.is_file():
        raise ProblemError(f"mesh file '{path}' does not exist; check the path")
    noise = io.StringIO()
    try:
        with contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise):
            return meshio.read(path)
    except (Exception, SystemExit) as error:
        reason = " ".join(str(error).split()) or type(error).__name__
        if isinstance(error, SystemExit):
            reason = " ".join(noise.getvalue().split()) or "unknown format"
        raise ProblemError(
            f"mesh file '{path}' cannot be read ({reason[:200]}); save it as Gmsh 2.2 or 4.1 or VTU"
        ) from error


def _block_starts(raw: Any, kind: str) -> dict[int, int]:
    """Number of the first cell of each block of one kind, counting only that kind."""
    starts, total = {}, 0
    for number, block in enumerate(raw.cells):
        if block.type == kind:
            starts[number] = total
            total += len(block.data)
    return starts


def _groups(raw: Any, dims: Iterable[int]) -> dict[tuple[int, str], list[tuple[int, IntArray]]]:
    """Named groups of a meshio mesh: (dimension, name) to a list of (block, cells of the block)."""
    block_dims = list(dims)
    found: dict[tuple[int, str], list[tuple[int, IntArray]]] = {}
    for name, blocks in raw.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        for number, ids in enumerate(blocks):
            if ids is not None and len(ids) > 0:
                index = np.asarray(ids, dtype=np.int64)
                found.setdefault((block_dims[number], name), []).append((number, index))
    names = {(int(value[1]), int(value[0])): str(key) for key, value in raw.field_data.items() if len(value) == 2}
    tagged: dict[tuple[int, str], list[tuple[int, IntArray]]] = {}
    for number, tags in enumerate(raw.cell_data.get("gmsh:physical", [])):
        for tag in np.unique(tags):
            if tag == 0:
                continue
            key = (block_dims[number], names.get((block_dims[number], int(tag)), str(int(tag))))
            if key not in found:
                tagged.setdefault(key, []).append((number, np.flatnonzero(np.asarray(tags) == tag)))
    return found | tagged
