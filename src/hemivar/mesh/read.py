"""Mesh files of any format, made into meshes."""

from __future__ import annotations

import contextlib
import io
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.disk import first_bytes, read_bytes, regular_file, shown
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.memory import require
from hemivar.basics.types import IntArray
from hemivar.errors import FileError, ProblemError
from hemivar.mesh.keys import cell_facets, facet_keys, shared_facets
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.msh import is_msh, parse_msh
from hemivar.mesh.raw import RawMesh
from hemivar.mesh.recipe import MeshRecipe
from hemivar.mesh.vtu_grid import read_vtu

if TYPE_CHECKING:
    import meshio

__all__ = ["read_mesh"]

#: Bytes of memory for each byte of a file that is read.
_FACTOR = 6.0
_DIMENSION = {"vertex": 0, "line": 1, "triangle": 2, "tetra": 3}


def read_mesh(path: str | Path) -> Mesh:
    """Read a mesh file: Gmsh (.msh), or a format that meshio reads.

    Physical groups of Gmsh and cell sets become boundaries (groups of facets), interfaces (groups of facets between
    cells) and regions (groups of cells).
    Nodes that no cell uses are dropped, as is the third coordinate of plane meshes; inverted cells are
    turned.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Mesh

    Raises
    ------
    ProblemError
        If the file is missing or cannot be read, does not fit into memory, or holds cells other than straight
        triangles or tetrahedra.
    """
    try:
        name = regular_file(path, "mesh file", 2**62)
    except FileError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            raise FileError(f"{_named(path)} does not exist; check the path") from error
        raise
    size = name.stat().st_size
    require(
        _FACTOR * size,
        f"reading {_named(path)} of {size / 2**20:.0f} MiB",
        "take a coarser mesh",
    )
    head = first_bytes(name, 64, "mesh file")
    if is_msh(head):
        raw = parse_msh(read_bytes(name, "mesh file", max(size, 1)), shown(str(path)))
    elif name.suffix == ".msh" and not head.lstrip().startswith(b"("):
        raise ProblemError(f"{_named(path)} cannot be read: it does not begin like a file of Gmsh ($MeshFormat)")
    else:
        raw = _by_meshio(name)
    try:
        return _mesh(raw).made_by(MeshRecipe(Path(path).absolute()))
    except ProblemError as error:
        raise ProblemError(f"{_named(path)}: {error}") from error


def _mesh(raw: RawMesh) -> Mesh:
    """The mesh of a file: groups of cells are regions, groups of facets boundaries."""
    dim = max(raw.cells, default=0)
    if dim < 2:
        raise ProblemError(
            "it holds no triangles or tetrahedra; if it comes from Gmsh, put the body into a physical group"
        )
    cells, points = raw.cells[dim], raw.points
    used = np.zeros(len(points), dtype=bool)
    used[cells] = True
    if points.shape[1] < dim:
        raise ProblemError(f"its points have {points.shape[1]} coordinates, but it holds tetrahedra; save it again")
    if dim == 2 and points.shape[1] == 3:
        height = points[used, 2]
        with np.errstate(over="ignore"):
            extent = np.ptp(points[used], axis=0).max()
            bent = np.ptp(height) > 1e-10 * max(extent, 1e-300)
        if bent:
            raise ProblemError(
                f"it is a surface in space (z from {height.min():g} to {height.max():g}); a plane mesh must have "
                f"constant z, a solid one needs tetrahedra"
            )
        points = points[:, :2]
    number = np.where(used, np.cumsum(used) - 1, -1)
    boundaries: dict[str, IntArray] = {}
    regions: dict[str, IntArray] = {}
    for (group_dim, name), rows in raw.groups.items():
        if group_dim == dim - 1:
            boundaries[name] = number[raw.cells[group_dim][rows]]
            if (boundaries[name] < 0).any():
                raise ProblemError(f"group '{name}' has facets that belong to no cell; remove them")
        elif group_dim == dim:
            regions[name] = rows
    inner = _between_cells(number[cells], boundaries, int(used.sum()))
    interfaces = {name: boundaries.pop(name) for name in inner}
    return Mesh.oriented(points[used], number[cells], boundaries, regions, interfaces)


def _between_cells(cells: IntArray, groups: dict[str, IntArray], count: int) -> list[str]:
    """Names of the groups of facets (k, d) that lie between two cells, all of them."""
    if not groups:
        return []
    _, keys, _ = cell_facets(cells, count)
    inner = keys[shared_facets(keys)[0]]
    return [name for name, facets in groups.items() if np.isin(facet_keys(facets, count), inner).all()]


# ---- meshio ------------------------------------------------------------------------------------------------------


def _by_meshio(path: Path) -> RawMesh:
    found = read_vtu(path, "mesh file") if path.suffix.lower() == ".vtu" else _read_silently(path)
    foreign = sorted({block.type for block in found.cells} - set(_DIMENSION))
    if foreign:
        raise ProblemError(
            f"{_named(path)}: it holds cells of type {', '.join(foreign)}; only straight-sided triangles and "
            f"tetrahedra are supported: mesh with simplices of order 1 (no recombination)"
        )
    try:
        points = np.asarray(found.points, dtype=np.float64)
        if points.ndim != 2 or not np.isfinite(points).all():
            raise ProblemError(f"{_named(path)}: its points are not finite coordinates; save it again")
        cells: dict[int, IntArray] = {}
        starts = []
        for block in found.cells:
            dim, data = _DIMENSION[block.type], np.asarray(block.data)
            if data.dtype.kind not in "iu" or data.ndim != 2 or (data.size and not _within(data, len(points))):
                raise ProblemError(f"{_named(path)}: a cell refers to a node that is not in it; save it again")
            starts.append(len(cells.get(dim, ())))
            if dim:
                known = cells.get(dim, np.zeros((0, dim + 1), dtype=np.int64))
                cells[dim] = np.vstack([known, data.astype(np.int64)])
        return RawMesh(points, {dim: rows for dim, rows in cells.items() if len(rows)}, _groups(found, starts))
    except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
        if isinstance(error, ProblemError):
            raise
        raise ProblemError(
            f"{_named(path)} cannot be read: what it holds does not fit together; save it again"
        ) from error


def _within(data: IntArray, count: int) -> bool:
    return bool(data.min() >= 0 and data.max() < count)


def _read_silently(path: Path) -> meshio.Mesh:
    """The meshio mesh of a file; meshio's printing is swallowed and its failures reported in one line."""
    with IMPORTS:
        import meshio

    noise = io.StringIO()
    try:
        with contextlib.redirect_stdout(noise), contextlib.redirect_stderr(noise), np.errstate(all="ignore"):
            return meshio.read(path)
    except MemoryError as error:
        raise ProblemError(f"{_named(path)} needs more memory than there is; take a coarser mesh") from error
    except (Exception, SystemExit) as error:
        raise ProblemError(
            f"{_named(path)} cannot be read as {_format(path)}; save it as Gmsh 2.2 or 4.1 or VTU"
        ) from error


def _format(path: Path) -> str:
    if not path.suffix:
        return "a mesh: its name has no suffix"
    return f"a mesh of the format that '{shown(path.suffix)}' stands for"


def _named(path: str | Path) -> str:
    return f"mesh file '{shown(str(path))}'"


def _groups(found: meshio.Mesh, starts: list[int]) -> dict[tuple[int, str], IntArray]:
    """Named groups of a meshio mesh; ``starts`` are the numbers of the first cell of each block in its dimension."""
    dims = [_DIMENSION[block.type] for block in found.cells]
    sets: dict[tuple[int, str], list[IntArray]] = {}
    for name, blocks in found.cell_sets.items():
        if name.startswith("gmsh:"):
            continue
        for number, ids in enumerate(blocks):
            if ids is not None and len(ids) > 0:
                rows = np.asarray(ids, dtype=np.int64)
                if not _within(rows, len(found.cells[number].data)):
                    raise ProblemError(f"group '{name}' refers to a cell that is not there; save the mesh again")
                sets.setdefault((dims[number], name), []).append(starts[number] + rows)
    names = {(int(value[1]), int(value[0])): str(key) for key, value in found.field_data.items() if len(value) == 2}
    tagged: dict[tuple[int, str], list[IntArray]] = {}
    for number, tags in enumerate(found.cell_data.get("gmsh:physical", [])):
        for tag in np.unique(tags):
            key = (dims[number], names.get((dims[number], int(tag)), str(int(tag))))
            if tag and key not in sets:
                tagged.setdefault(key, []).append(starts[number] + np.flatnonzero(np.asarray(tags) == tag))
    return {key: np.concatenate(rows) for key, rows in (sets | tagged).items()}
