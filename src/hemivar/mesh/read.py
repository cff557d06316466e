"""Mesh files of any format, made into meshes."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from hemivar.basics.disk import first_bytes, read_bytes, regular_file, shown
from hemivar.basics.memory import require
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import FileError, ProblemError
from hemivar.mesh.abaqus import is_abaqus, parse_abaqus
from hemivar.mesh.by_meshio import format_of, read_by_meshio
from hemivar.mesh.checks import check_order
from hemivar.mesh.exodus import parse_exodus
from hemivar.mesh.keys import cell_facets, facet_keys
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.msh import is_msh, parse_msh
from hemivar.mesh.nastran import is_nastran, parse_nastran
from hemivar.mesh.netgen import parse_netgen
from hemivar.mesh.raw import RawMesh
from hemivar.mesh.reading import Reading
from hemivar.mesh.recipe import MeshRecipe
from hemivar.mesh.simplices import Simplices, simplices
from hemivar.mesh.su2 import parse_su2
from hemivar.mesh.unv import is_unv, parse_unv

__all__ = ["read_mesh"]

#: Bytes of memory for each byte of a file that is read, at least; of texts that are split into words; of fields.
_FACTOR, _OF_WORDS, _OF_FIELDS = 6.0, 12.0, 28.0
_NETGEN, _SU2 = re.compile(rb"\s*(?:#[^\n]*\n\s*)*mesh3d\b"), re.compile(rb"^\s*NDIME\s*=", re.MULTILINE)
#: What formats are called, and their suffixes, by which a file is known that does not begin like any of them.
_FORMATS = {
    "gmsh": ("Gmsh", (".msh",)),
    "abaqus": ("Abaqus", (".inp",)),
    "nastran": ("Nastran", (".bdf", ".nas", ".fem", ".blk")),
    "exodus": ("Exodus", (".e", ".exo", ".ex2")),
    "netgen": ("Netgen", (".vol",)),
    "su2": ("SU2", (".su2",)),
    "unv": ("I-DEAS", (".unv",)),
    "med": ("MED", (".med",)),
    "medit": ("Medit", (".mesh",)),
    "vtk": ("VTK", (".vtk",)),
    "vtu": ("VTU", (".vtu",)),
    "tecplot": ("Tecplot", (".tec",)),
}
#: What elements of a dimension are called.
_ELEMENTS = ("points", "lines", "surfaces", "cells")


def read_mesh(path: str | Path, order: int | None = None) -> Mesh:
    """Read a mesh file: Gmsh, Abaqus and CalculiX, Nastran, SU2, VTU, or a format that meshio reads.

    Groups become boundaries (groups of facets), interfaces (groups of facets between cells) and regions (groups of
    cells); a group of nodes is the boundary of the outer facets between them, and a set of nodes where there are none.
    Other cells than triangles and tetrahedra are split, see :attr:`Mesh.notes`. Tetrahedra of second order suggest
    order 2 (:attr:`Mesh.suggested_order`), and so do cells of second order with straight edges in a plane mesh; others
    are cut once. Nodes that no cell uses are dropped, as is the third coordinate of plane meshes; inverted cells are
    turned.

    Parameters
    ----------
    path : str or Path
    order : int, optional
        1 for linear elements: tetrahedra of second order are cut at the middles of their edges.

    Returns
    -------
    Mesh

    Raises
    ------
    ProblemError
        If the file is missing or cannot be read, does not fit into memory, or holds cells that are of another kind or
        too distorted to be split; if the order is neither 1 nor 2.

    Examples
    --------
    >>> import hemivar as hv
    >>> mesh = hv.read_mesh("bracket.msh")  # doctest: +SKIP
    >>> sorted(mesh.boundaries)  # doctest: +SKIP
    ['back', 'hole', 'shelf']
    """
    if order is not None:
        check_order(order)
    try:
        name = regular_file(path, "mesh file", 2**62)
    except FileError as error:
        if isinstance(error.__cause__, FileNotFoundError):
            raise FileError(f"{_named(path)} does not exist; check the path") from error
        raise
    size = name.stat().st_size
    _require(_FACTOR, path, size)
    start = first_bytes(name, 1 << 16, "mesh file").removeprefix(b"\xef\xbb\xbf")
    try:
        return _mesh(_raw(name, start, size), MeshRecipe(Path(path).absolute(), order=1 if order == 1 else None))
    except (AttributeError, IndexError, KeyError, OverflowError, TypeError, ValueError) as error:
        if not isinstance(error, ProblemError):
            reason = "cannot be read: what it holds does not fit together; save it again"
            raise ProblemError(f"{_named(path)} {reason}") from error
        if str(error).startswith("mesh file '"):
            raise
        between = " " if str(error).startswith("cannot be read") else ": "
        raise ProblemError(f"{_named(path)}{between}{error}") from error


def _require(factor: float, path: str | Path, size: int) -> None:
    require(factor * size, f"reading {_named(path)} of {size / 2**20:.0f} MiB", "take a coarser mesh")


def _named(path: str | Path) -> str:
    return f"mesh file '{shown(str(path))}'"


def _raw(path: Path, start: bytes, size: int) -> RawMesh:
    """What a file holds, by how it begins; by what it is called where that tells nothing."""
    suffix = path.suffix.lower()
    called = next((name for name, (_, suffixes) in _FORMATS.items() if suffix in suffixes), "")
    held = _held(path, start)
    raw = _parsed(held or called, path, start, size)
    if held and called and held != called:
        stands_for, holds = _FORMATS[called][0], _FORMATS[held][0]
        raw.notes.append(f"its suffix '{suffix}' stands for {stands_for}, but it holds {holds} and was read so")
    return raw


def _held(path: Path, start: bytes) -> str:
    """The format of a file that begins so; empty if that does not tell."""
    signs: dict[str, Callable[[bytes], object]] = {
        "gmsh": is_msh,
        "abaqus": is_abaqus,
        "netgen": _NETGEN.match,
        "su2": _SU2.search,
        "unv": is_unv,
    }
    own = next((name for name, holds in signs.items() if holds(start)), "") or format_of(path, start)
    return own or ("nastran" if is_nastran(start) else "")


def _parsed(form: str, path: Path, start: bytes, size: int) -> RawMesh:
    """What a file of a format holds."""

    def text(factor: float = _OF_WORDS) -> str:
        _require(factor, path, size)
        return read_bytes(path, "mesh file", max(size, 1)).decode("utf-8-sig", "replace")

    match form:
        case "gmsh" if is_msh(start):
            return parse_msh(read_bytes(path, "mesh file", max(size, 1)))
        case "gmsh" if not start.lstrip().startswith(b"("):  # that of ANSYS has the same suffix
            raise ProblemError("cannot be read: it does not begin like a Gmsh file ($MeshFormat)")
        case "abaqus":
            return parse_abaqus(text(), path)
        case "netgen":
            return parse_netgen(text())
        case "su2":
            return parse_su2(text())
        case "unv":
            return parse_unv(text(_OF_FIELDS))
        case "nastran":
            return parse_nastran(text(_OF_FIELDS), path)
        case "exodus":
            return parse_exodus(path, start)
    sign = format_of(path, start)
    return read_by_meshio(path, [sign] if sign else [])


def _mesh(raw: RawMesh, recipe: MeshRecipe) -> Mesh:
    """The mesh of a file: groups of cells are regions, groups of facets boundaries."""
    dim = max(raw.cells, default=0)
    if dim < 2:
        what = f"it holds {_ELEMENTS[1]} only, and" if dim else "it holds"
        raise ProblemError(f"{what} no cells of a body; if it comes from Gmsh, put the body into a physical group")
    flat = RawMesh(_flat(raw, dim), raw.cells, raw.kinds, raw.groups, raw.at_nodes, raw.notes)
    split = simplices(flat, recipe.order)
    cells = split.cells[dim]
    used = np.zeros(len(split.points), dtype=bool)
    used[cells] = True
    number = np.where(used, np.cumsum(used) - 1, -1)
    groups = _Groups(raw, split, dim, number)
    mesh = Mesh.oriented(split.points[used], number[cells], groups.boundaries, groups.regions, groups.interfaces)
    return mesh.made_by(recipe, Reading((*split.notes, *raw.notes, *groups.notes), split.order, groups.node_sets))


def _flat(raw: RawMesh, dim: int) -> Array:
    """The points, two coordinates of those of plane meshes."""
    points = raw.points
    if points.shape[1] < dim:
        raise ProblemError(f"its points have {points.shape[1]} coordinates, but it holds solids; save it again")
    if dim == 2 and points.shape[1] == 3:
        own = points[np.unique(raw.cells[2])]
        height = own[:, 2]
        with np.errstate(over="ignore"):
            bent = np.ptp(height) > 1e-10 * max(np.ptp(own, axis=0).max(), 1e-300)
        if bent:
            raise ProblemError(
                f"it is a surface in 3D (z from {height.min():g} to {height.max():g}); a plane mesh must have "
                f"constant z, a solid one needs tetrahedra or hexahedra"
            )
    return points[:, :dim]


class _Groups:
    """The named groups of a file, in the numbers of the mesh."""

    def __init__(self, raw: RawMesh, split: Simplices, dim: int, number: IntArray) -> None:
        self.boundaries: dict[str, IntArray] = {}
        self.interfaces: dict[str, IntArray] = {}
        self.regions: dict[str, IntArray] = {}
        self.node_sets: dict[str, IntArray] = {}
        self.notes: list[str] = []
        count = int(number.max()) + 1
        facets, keys, _ = cell_facets(number[split.cells[dim]], count)
        ordered, first, counts = np.unique(keys, return_index=True, return_counts=True)
        inner = counts > 1
        for (of, name), rows in raw.groups.items():
            mask = np.zeros(len(raw.kinds[of]), dtype=bool)
            mask[rows] = True
            own = np.flatnonzero(mask[split.origin[of]])
            if of == dim:
                self.regions[name] = own
            elif of == dim - 1:
                self._facets(name, number[split.cells[of][own]], lambda one: facet_keys(one, count), ordered, inner)
            else:
                self._set(name, number[split.cells[of][own]], _ELEMENTS[of])
        outer = facets[first[counts == 1]] if split.at_nodes else facets[:0]
        for name, at in split.at_nodes.items():
            self._nodes(name, outer, at[number >= 0])

    def _facets(
        self, name: str, facets: IntArray, keys_of: Callable[[IntArray], IntArray], known: IntArray, inner: BoolArray
    ) -> None:
        """A group of facets: those between two cells are an interface; ``known`` are the keys of all, in order."""
        apart = np.asarray((facets < 0).any(axis=1))
        keys = keys_of(np.where(apart[:, None], 0, facets))
        at = np.minimum(np.searchsorted(known, keys), len(known) - 1)
        apart |= known[at] != keys
        if apart.all():
            self.notes.append(f"group '{name}' belongs to no cell of the body; it was ignored")
            return
        if apart.any():
            raise ProblemError(
                f"group '{name}' has facets that belong to no cell ({np.count_nonzero(apart)} of {len(facets)}); "
                "remove them"
            )
        within = inner[at]
        if not within.all():
            self.boundaries[name] = facets[~within]
        if within.any():
            inside = name if within.all() else f"{name}:inside"
            self.interfaces[inside] = facets[within]
            if not within.all():
                self.notes.append(f"group '{name}' lies partly inside the body; that part is the interface '{inside}'")

    def _nodes(self, name: str, outer: IntArray, at: BoolArray) -> None:
        """A group of nodes is a boundary if outer facets lie between them."""
        chosen = outer[at[outer].all(axis=1)]
        if name in self.boundaries or name in self.interfaces:
            return  # the facets of that name say it better
        if at.all():
            self.notes.append(f"'{name}' is a group of all nodes; it was ignored")
        elif len(chosen):
            self.boundaries[name] = chosen
        else:
            self._set(name, np.flatnonzero(at), "nodes")

    def _set(self, name: str, nodes: IntArray, what: str) -> None:
        """A group of nodes that is no boundary; those of none of the cells are left out."""
        own = np.unique(nodes[nodes >= 0])
        if len(own):
            self.node_sets[name] = own
        does = "it is a set of nodes, which supports may name" if len(own) else "it belongs to no cell and was ignored"
        self.notes.append(f"group '{name}' holds {what} only; {does}")
