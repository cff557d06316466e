"""Refinement of some cells: red, with green closures that are taken back where they would be refined again.

After Bank, Sherman and Weiser (1983) in the plane and Bey (Computing 55, 1995) in space.  A cell that is refined is cut
at the midpoints of all its edges (red).  Neighbours that are left with cut edges are closed (green): a cut edge halves
the cell, two opposite ones quarter it, a face whose edges are all cut joins its four parts to the opposite node; where
two edges of a face are cut, the third is, too.  Green cells are never cut again: the cell that they are parts of is
refined red instead.  So shapes do not degrade however often a mesh is refined, and the meshes are nested: each is a
:class:`~hemivar.mesh.refine.Refinement` of the one a generation coarser, as multigrid wants it.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from hemivar.basics.arrays import DIGITS, unmasked
from hemivar.basics.memory import mesh_bytes, require
from hemivar.basics.types import BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.checks import index_array
from hemivar.mesh.keys import EDGES, frozen, pair_keys
from hemivar.mesh.kinds import red_tetrahedra
from hemivar.mesh.refine import Refinement

if TYPE_CHECKING:
    from hemivar.mesh.mesh import Mesh

__all__ = ["bisected", "refined_where"]

#: Edges of the faces (of the cell itself in the plane) by dimension, as numbers of :data:`EDGES`.
_FACES = {2: ((0, 1, 2),), 3: ((1, 4, 5), (2, 3, 5), (0, 3, 4), (0, 1, 2))}
_FACET_PARTS = {2: ((0, 2), (2, 1)), 3: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))}


def refined_where(mesh: Mesh, cells: object) -> Mesh:
    """The mesh with some of its cells refined, and with as few others as conformity and good shapes ask for.

    Shapes: ``cells`` (M,). Returned: the same mesh if there are no such cells.
    """
    chosen = _chosen(mesh, cells)
    if chosen.size == 0:
        return mesh
    require(
        mesh_bytes(mesh.dim, mesh.number_of_cells + 2.0**mesh.dim * chosen.size),
        f"a mesh of more than {mesh.number_of_cells:.3g} cells",
        "refine fewer cells",
    )
    family = _Family(mesh)
    family.refine(chosen)
    return family.grown()


def bisected(mesh: Mesh, cells: BoolArray) -> tuple[Mesh, IntArray]:
    """The mesh with the longest edges of some cells (M,) halved; no generation of :func:`refined_where`.

    Cells that are flat, or needles, come nearer to good shapes so.  A neighbour that shares such an edge is halved at
    its own longest one first (Rivara, Int. J. Numer. Meth. Engng. 20, 1984).  With it comes the cell that each of the
    new ones is a part of.
    """
    parent = np.arange(mesh.number_of_cells)
    wanted = mesh.edges[_longest_of(mesh, np.asarray(cells))]
    while len(wanted):
        marked = np.isin(pair_keys(mesh.edges, mesh.number_of_nodes), pair_keys(wanted, mesh.number_of_nodes))
        rank = np.where(marked, _by_length(mesh), -1)[mesh.cell_edges]
        waiting = (rank >= 0) & (rank < rank.max(axis=1, keepdims=True))
        ready = marked.copy()
        ready[mesh.cell_edges[waiting]] = False  # a cell is cut at one edge at a time, the longest
        wanted = mesh.edges[marked & ~ready]
        mesh = _cut(mesh, ready)
        assert mesh.parent is not None
        parent = parent[mesh.parent.cells]
    bare = mesh.trusted(
        mesh.points, mesh.cells, mesh.boundaries, mesh.regions, interfaces=mesh.interfaces, reading=mesh.reading
    )
    return bare, parent


def _by_length(mesh: Mesh) -> IntArray:
    """Places (E,) of the edges in the order of their lengths; of those as long as each other in that of their nodes."""
    ends = mesh.points[mesh.edges]
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    order = np.argsort(np.round(lengths / lengths.max(), DIGITS), kind="stable")
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank


def _longest_of(mesh: Mesh, cells: BoolArray) -> BoolArray:
    """Edges (E,) that are the longest of these cells, and of cells that share one of them."""
    rank = _by_length(mesh)[mesh.cell_edges]
    longest = mesh.cell_edges[np.arange(len(rank)), np.argmax(rank, axis=1)]
    marked, chosen = np.zeros(len(mesh.edges), dtype=bool), np.asarray(cells)
    while chosen.any():
        marked[longest[chosen]] = True
        chosen = marked[mesh.cell_edges].any(axis=1) & ~marked[longest]
    return marked


def _chosen(mesh: Mesh, cells: object) -> IntArray:
    count, given = mesh.number_of_cells, unmasked(cells, "the choice of cells")
    try:
        array = np.asarray(given)
    except ValueError:
        raise ProblemError("the cells to be refined are rows of several lengths; give a list of numbers") from None
    if array.dtype == bool:
        if array.shape != (count,):
            raise ProblemError(
                f"the cells to be refined are a mask of shape {array.shape}; the mesh has {count} cells: give a mask "
                f"of shape ({count},), or their numbers"
            )
        return np.flatnonzero(array)
    if array.size == 0:
        return np.zeros(0, dtype=np.int64)
    if array.ndim != 1:
        raise ProblemError(f"the cells to be refined have shape {array.shape}; give a list of their numbers")
    return np.unique(index_array(array, "the list of cells to be refined", count))


class _Family:
    """The cells that were refined red, from a mesh on whose cells all stem from, and their children.

    A regular cell has a number in the family: those of the first mesh theirs, and the children of a red cell numbers
    one after another.  Cells of closures have none.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.meshes = [mesh]
        many = 2**mesh.dim
        while (parent := self.meshes[0].parent) is not None:
            if (np.bincount(parent.cells, minlength=parent.mesh.number_of_cells) == many).all():
                break  # refined everywhere: here the family begins
            self.meshes.insert(0, parent.mesh)
        self.many = many
        count = self.meshes[0].number_of_cells
        #: First of the children of each member, -1 if there are none.
        self.children = np.full(count, -1, dtype=np.int64)
        #: For each mesh and cell, the member that it is (or is a part of, in a closure), and whether it is that.
        self.member: list[IntArray] = [np.arange(count)]
        self.whole: list[BoolArray] = [np.ones(count, dtype=bool)]
        for finer in self.meshes[1:]:
            assert finer.parent is not None
            self._descend(finer.parent, self._parts(finer.parent) == many)

    def _parts(self, step: Refinement) -> IntArray:
        return np.bincount(step.cells, minlength=step.mesh.number_of_cells)

    def _descend(self, step: Refinement, red: BoolArray) -> None:
        """Members of the next finer mesh."""
        self._refine_members(self.member[-1][red])
        member = self.member[-1][step.cells]
        whole = self.whole[-1][step.cells] & (self._parts(step) == 1)[step.cells]
        cut = red[step.cells]
        # The children of a cell are numbered in the order of their cells.
        order = np.argsort(step.cells[cut], kind="stable")
        child = np.empty(order.size, dtype=np.int64)
        child[order] = np.arange(order.size) % self.many
        member[cut] = self.children[member[cut]] + child
        whole[cut] = True
        self.member.append(member)
        self.whole.append(whole)

    def _refine_members(self, members: IntArray) -> None:
        new = np.unique(members[self.children[members] < 0])
        first = self.children.size + self.many * np.arange(new.size)
        self.children[new] = first
        self.children = np.concatenate([self.children, np.full(self.many * new.size, -1, dtype=np.int64)])

    def refine(self, cells: IntArray) -> None:
        """Cells of the finest mesh, or those that they close, are to be red."""
        self._refine_members(self.member[-1][cells])

    def grown(self) -> Mesh:
        """The finest mesh of the family, with what conformity adds."""
        known = self.meshes
        while True:
            built = self._built(known)
            if built is not None:
                return built
            known = self.meshes  # what is there already is used again

    def _built(self, known: list[Mesh]) -> Mesh | None:
        """The finest mesh; None where a closure had to become red, so that coarser meshes change."""
        first = self.meshes[0]
        self.meshes, self.member, self.whole = [first], self.member[:1], self.whole[:1]
        while True:
            mesh, member, whole = self.meshes[-1], self.member[-1], self.whole[-1]
            wanted = whole & (self.children[member] >= 0)
            if not wanted.any():
                return mesh
            edges = _closed(mesh, wanted)
            cut = edges[mesh.cell_edges]
            broken = ~whole & cut.any(axis=1)
            if broken.any():
                self._refine_members(member[broken])
                return None
            number = len(self.meshes)
            finer = known[number] if number < len(known) else None
            if finer is None or finer.parent is None or not _is_cut(finer.parent, mesh, edges):
                finer = _cut(mesh, edges)
            assert finer.parent is not None
            self.meshes.append(finer)
            self._descend(finer.parent, np.asarray(cut.all(axis=1)))


def _closed(mesh: Mesh, wanted: BoolArray) -> BoolArray:
    """Edges (E,) that are cut if these cells (M,) are refined red: no face has two of them."""
    marked = np.zeros(len(mesh.edges), dtype=bool)
    marked[mesh.cell_edges[wanted]] = True
    while True:
        before = np.count_nonzero(marked)
        for face in _FACES[mesh.dim]:
            edges = mesh.cell_edges[:, face]
            two = marked[edges].sum(axis=1) == 2
            marked[edges[two]] = True
        if np.count_nonzero(marked) == before:
            return marked


def _is_cut(step: Refinement, mesh: Mesh, edges: BoolArray) -> bool:
    """Whether a refinement is that of this mesh at these edges."""
    return step.mesh is mesh and np.array_equal(step.ends[mesh.number_of_nodes :], mesh.edges[edges])


def _cut(mesh: Mesh, edges: BoolArray) -> Mesh:
    """The mesh cut at the midpoints of edges (E,); nodes keep their numbers, children lie in the order of the cells."""
    dim, count = mesh.dim, mesh.number_of_nodes
    ends = mesh.edges[edges]
    points = np.vstack([mesh.points, mesh.points[ends].mean(axis=1)])
    middle = np.full(len(edges), -1, dtype=np.int64)
    middle[edges] = count + np.arange(len(ends))
    nodes = np.hstack([mesh.cells, middle[mesh.cell_edges]])
    width = mesh.cell_edges.shape[1]
    codes = edges[mesh.cell_edges] @ (1 << np.arange(width))
    owners, children = [], []
    for code in np.unique(codes):
        ids = np.flatnonzero(codes == code)
        if dim == 3 and code == (1 << width) - 1:
            parts = red_tetrahedra(points, nodes[ids, :4], nodes[ids, 4:]).reshape(8, ids.size, 4).swapaxes(0, 1)
        else:
            parts = nodes[ids][:, _parts_of(dim, int(code))]
        owners.append(np.repeat(ids, parts.shape[1]))
        children.append(parts.reshape(-1, dim + 1))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    owner, cells = owner[order], np.concatenate(children)[order]
    boundaries, interfaces = (
        {name: _facets(mesh, facets, middle) for name, facets in groups.items()}
        for groups in (mesh.boundaries, mesh.interfaces)
    )
    regions = {}
    for name, ids in mesh.regions.items():
        inside = np.zeros(mesh.number_of_cells, dtype=bool)
        inside[ids] = True
        regions[name] = np.flatnonzero(inside[owner])
    own = np.repeat(np.arange(count)[:, None], 2, axis=1)
    step = Refinement(mesh, frozen(np.vstack([own, ends])), frozen(owner))
    return mesh.trusted(
        points, cells, boundaries, regions, step, interfaces=interfaces, reading=mesh.reading.onto(step.ends)
    )


def _facets(mesh: Mesh, facets: IntArray, middle: IntArray) -> IntArray:
    """The parts of facets (k, d) after the cut, in their order, outward oriented as they were."""
    dim = mesh.dim
    nodes = mesh.facet_nodes(facets, 2).copy()
    nodes[:, dim:] = middle[nodes[:, dim:] - mesh.number_of_nodes]
    codes = (nodes[:, dim:] >= 0) @ (1 << np.arange(nodes.shape[1] - dim))
    owners, parts = [], []
    for code in np.unique(codes):
        ids = np.flatnonzero(codes == code)
        if code == 0:
            table: tuple[tuple[int, ...], ...] = (tuple(range(dim)),)
        elif code == (1 << (nodes.shape[1] - dim)) - 1:
            table = _FACET_PARTS[dim]
        else:
            table = _halves(tuple(range(3)), 3 + int(code).bit_length() - 1, EDGES[2][int(code).bit_length() - 1])
        owners.append(np.repeat(ids, len(table)))
        parts.append(nodes[ids][:, table].reshape(-1, dim))
    owner = np.concatenate(owners)
    return np.asarray(np.concatenate(parts)[np.argsort(owner, kind="stable")])


def _halves(cell: tuple[int, ...], middle: int, edge: tuple[int, int]) -> tuple[tuple[int, ...], ...]:
    """A simplex cut at a node on one of its edges: an end of that is replaced by the node."""
    return tuple(tuple(middle if node == end else node for node in cell) for end in reversed(edge))


@cache
def _parts_of(dim: int, code: int) -> tuple[tuple[int, ...], ...]:
    """Children of a cell whose edges with these bits are cut: its corners, then the midpoints of its edges."""
    corners = tuple(range(dim + 1))
    cut = [k for k in range(len(EDGES[dim])) if code >> k & 1]
    if not cut:
        return (corners,)
    if dim == 2 and len(cut) == 3:
        return _FACET_PARTS[3]
    if len(cut) < 3:
        parts: tuple[tuple[int, ...], ...] = (corners,)
        for k in cut:
            parts = tuple(half for part in parts for half in _halves(part, dim + 1 + k, EDGES[dim][k]))
        return parts
    # A face (a, b, c) of a tetrahedron with all its edges cut: the four parts of it, joined to the node opposite.
    middle = {frozenset(EDGES[dim][k]): dim + 1 + k for k in cut}
    a, b, c = sorted({node for k in cut for node in EDGES[dim][k]})
    ab, bc, ca = (middle[frozenset(pair)] for pair in ((a, b), (b, c), (c, a)))
    tops = ({a: a, b: ab, c: ca}, {a: ab, b: b, c: bc}, {a: ca, b: bc, c: c}, {a: ab, b: bc, c: ca})
    return tuple(tuple(top.get(node, node) for node in corners) for top in tops)
