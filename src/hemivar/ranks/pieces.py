"""Domain decomposition: each rank holds a piece of the mesh, refines it itself, and knows which nodes it shares.

Every node has a number on which all ranks agree, that of the serial mesh.  Only the unrefined mesh is ever in one
place.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.memory import problem_bytes, refined_cells, require
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.keys import cell_facets, facet_keys
from hemivar.mesh.mesh import Mesh
from hemivar.ranks.ranks import Ranks

__all__ = ["Piece", "distribute", "family", "grid_numbers", "refine", "renumber"]

_CELLS_PER_RANK = 400  # in the coarsest mesh, so that parts are compact, and fewer cycles are needed
_MORE = 2.4  # memory of this engine over that of a serial problem: its matrices stand on several levels


@dataclass(frozen=True, eq=False)
class Piece:
    """The part of a mesh that a rank holds.

    Attributes
    ----------
    mesh : Mesh
        The cells of this rank and their nodes.
    numbers : int array (N,)
        Number of each node in the whole mesh, the same on every rank that has it.
    total : int
        Number of nodes of the whole mesh.
    owner : int array (N,)
        The rank that owns each node: the lowest of those that have it.
    sharing : int array (k, 2)
        Pairs of a node of this piece and another rank that has it.
    ends : int array (N, 2) or None
        The two nodes of the next coarser piece whose midpoint each node is; None if there is no coarser piece.
    parts : int
        Of how many parts, cells joined through facets, the whole mesh consists.
    whole : Mesh or None
        On rank 0 the unrefined mesh, if there are several parts.
    """

    mesh: Mesh
    numbers: IntArray
    total: int
    owner: IntArray
    sharing: IntArray
    ends: IntArray | None = None
    parts: int = 1
    whole: Mesh | None = None

    def owned(self, ranks: Ranks) -> BoolArray:
        """Which nodes this rank owns, (N,)."""
        return np.asarray(self.owner == ranks.rank)

    def summed(self, ranks: Ranks, values: Array) -> Array:
        """Nodal values (N, c), each the sum of those of all ranks that have the node."""
        received, node = self._exchanged(ranks, values, np.ones(len(self.sharing), dtype=bool))
        out = values.copy()
        for c in range(values.shape[1]):
            out[:, c] += np.bincount(node, weights=received[:, c], minlength=len(out))
        return out

    def of_owners(self, ranks: Ranks, values: Array) -> Array:
        """Nodal values (N, c), each that of the rank that owns the node."""
        received, node = self._exchanged(ranks, values, self.owned(ranks)[self.sharing[:, 0]])
        out = values.copy()
        out[node] = received
        return out

    def _exchanged(self, ranks: Ranks, values: Array, which: BoolArray) -> tuple[Array, IntArray]:
        pairs = self.sharing[which]
        rows = np.column_stack([self.numbers[pairs[:, 0]].astype(float), values[pairs[:, 0]]])
        received, _, _ = ranks.exchange(pairs[:, 1], rows)
        order = np.argsort(self.numbers)
        node = order[np.searchsorted(self.numbers, received[:, 0].astype(np.int64), sorter=order)]
        return received[:, 1:], node


def family(
    ranks: Ranks,
    begin: Callable[[int], Mesh],
    halvings: int = 0,
    refine_times: int = 0,
    number: Callable[[Array], IntArray] | None = None,
    crossed: bool = False,
    cells_per_rank: int = _CELLS_PER_RANK,
) -> list[Piece]:
    """Pieces of a mesh and of the coarser ones that it is a refinement of, coarsest first.

    Parameters
    ----------
    ranks : Ranks
    begin : function
        Makes the mesh with sizes of cells doubled so many times; called on rank 0 only.
    halvings : int
        How often they can be doubled.
    refine_times : int
        How often the mesh is refined in the end.
    number : function, optional
        Numbers, in the mesh before these refinements, of points (N, d) of it, if they are not those of refinement.
    crossed : bool
        Whether the triangles of ``begin`` meet in the centres of squares, where they have their last node.
    cells_per_rank : int
        Cells that the coarsest mesh has at least, for each rank.
    """
    mesh: Mesh | None = None

    def make() -> int:
        nonlocal mesh
        if ranks.rank:
            return -1
        for times in range(halvings, -1, -1):
            mesh = begin(times)
            if mesh.number_of_cells >= cells_per_rank * ranks.size:
                break
        return times

    times = int(ranks.mpi.bcast(ranks.agree(make)))
    _check_memory(ranks, mesh, times + refine_times)
    pieces = [distribute(ranks, mesh)]
    for step in range(times + refine_times):
        pieces.append(refine(ranks, pieces[-1], crossed and step < times))
        if step == times - 1 and number is not None:
            pieces[-1] = renumber(ranks, pieces[-1], number(pieces[-1].mesh.points))
    return pieces


def _check_memory(ranks: Ranks, mesh: Mesh | None, times: int) -> None:
    """Refuse a mesh, held by rank 0, that refined so many times does not fit into the memory of the ranks' machines."""
    dim, cells = ranks.mpi.bcast(None if mesh is None else (mesh.dim, mesh.number_of_cells))
    cells = refined_cells(dim, cells, times)
    remedy = "take fewer cells, or more ranks on more machines"
    sharers, needed = ranks.neighbours(), _MORE * problem_bytes(dim, cells, parts=ranks.size)
    what = f"the share of {sharers} of {ranks.size} ranks in a problem on {cells:.3g} cells"
    ranks.agree(lambda: require(needed, what, remedy, sharers=sharers))


def grid_numbers(points: Array, origin: Sequence[float], extent: Sequence[float], counts: Sequence[int]) -> IntArray:
    """Numbers of the nodes of a built-in mesh at these points, (N,): corners along x, y, z, then centres."""
    size = np.asarray(counts)
    half = np.rint(2.0 * (points - np.asarray(origin)) / np.asarray(extent) * size).astype(np.int64)
    centre = (half % 2 == 1).any(axis=1)
    stride, cell = np.cumprod([1, *(size[:-1] + 1)]), np.cumprod([1, *size[:-1]])
    return np.asarray(np.where(centre, int(np.prod(size + 1)) + (half // 2) @ cell, (half // 2) @ stride))


#: Points, cells, numbers, boundaries, regions and the number of nodes of the mesh.
Packet = tuple[Array, IntArray, IntArray, dict[str, IntArray], dict[str, IntArray], int]


def distribute(ranks: Ranks, mesh: Mesh | None) -> Piece:
    """Cut a mesh that rank 0 holds into pieces of connected cells, by the partitioner of PETSc."""
    packets: list[Packet] | None = None
    own = _partition(ranks, mesh)
    wanted = ranks.mpi.gather(own)
    if mesh is not None and ranks.rank == 0:
        packets = [_packet(mesh, cells) for cells in wanted]
    points, cells, numbers, boundaries, regions, total = ranks.mpi.scatter(packets)
    reading = ranks.mpi.bcast(mesh.reading if mesh is not None and ranks.rank == 0 else None)
    piece = Mesh.trusted(points, cells, boundaries, regions, reading=reading)
    count = int(ranks.mpi.bcast(mesh.parts.count if mesh is not None and ranks.rank == 0 else None))
    whole = mesh if ranks.rank == 0 and count > 1 else None
    return replace(_shared(ranks, piece, numbers, total, None), parts=count, whole=whole)


def _partition(ranks: Ranks, mesh: Mesh | None) -> IntArray:
    """Numbers of the cells that this rank gets, rising."""
    from petsc4py import PETSc

    shape = ranks.mpi.bcast(None if mesh is None else (mesh.number_of_cells, mesh.dim))
    if ranks.size == 1:
        return np.arange(shape[0])
    dim = shape[1]
    if ranks.rank == 0:
        assert mesh is not None
        cells, points = np.asarray(mesh.cells, dtype=PETSc.IntType), np.asarray(mesh.points)
    else:
        cells, points = np.zeros((0, dim + 1), dtype=PETSc.IntType), np.zeros((0, dim))
    os.environ.setdefault("SCOTCH_PTHREAD_NUMBER", "1")  # with several threads no two of its partitions are alike
    plex = PETSc.DMPlex().createFromCellList(dim, cells, points, interpolate=False, comm=ranks.comm)
    migration = plex.distribute(overlap=0)
    _, end = plex.getHeightStratum(0)
    _, leaves, roots = migration.getGraph()
    number = np.arange(len(roots)) if leaves is None else np.asarray(leaves)
    chosen = np.asarray(roots).reshape(-1, 2)[number < end, 1]
    migration.destroy()
    plex.destroy()
    return np.sort(chosen).astype(np.int64)


def _packet(mesh: Mesh, cells: IntArray) -> Packet:
    """What a rank needs to hold these cells: points, cells, numbers, boundaries, regions, number of nodes."""
    connectivity = mesh.cells[cells]
    numbers, local = np.unique(connectivity, return_inverse=True)
    _, keys, owner = cell_facets(mesh.cells, mesh.number_of_nodes)
    order = np.argsort(keys)
    mine = np.zeros(mesh.number_of_cells, dtype=bool)
    mine[cells] = True
    boundaries = {}
    for name, facets in mesh.boundaries.items():
        at = order[np.searchsorted(keys, facet_keys(facets, mesh.number_of_nodes), sorter=order)]
        boundaries[name] = np.searchsorted(numbers, facets[mine[owner[at]]])
    regions = {name: np.searchsorted(cells, ids[mine[ids]]) for name, ids in mesh.regions.items()}
    connectivity = local.reshape(connectivity.shape).astype(np.int64)
    return mesh.points[numbers], connectivity, numbers, boundaries, regions, mesh.number_of_nodes


def _shared(ranks: Ranks, mesh: Mesh, numbers: IntArray, total: int, ends: IntArray | None) -> Piece:
    """Find out which nodes other ranks have as well, by asking the rank that keeps the record of each number."""
    skin = np.unique(mesh.boundary_facets) if mesh.number_of_cells else np.zeros(0, dtype=np.int64)
    asked, source, back = ranks.exchange(_home(ranks, numbers[skin], total), numbers[skin, None])
    order = np.lexsort((source, asked[:, 0]))
    ids, who = asked[order, 0], source[order]
    first = np.flatnonzero(np.diff(ids, prepend=-1))
    count = np.diff(np.append(first, len(ids)))
    lowest = np.empty(len(ids), dtype=np.int64)
    lowest[order] = np.repeat(who[first], count)
    owner = np.full(len(numbers), ranks.rank, dtype=np.int64)
    owner[skin] = back.answer(lowest[:, None])[:, 0]
    # all pairs of ranks that have the same node
    group = np.repeat(np.arange(len(first)), count)
    rows = np.repeat(np.arange(len(ids)), count[group])
    within = np.arange(len(rows)) - np.repeat(np.cumsum(count[group]) - count[group], count[group])
    partner = who[first[group[rows]] + within]
    other = partner != who[rows]
    received, _, _ = ranks.exchange(who[rows][other], np.column_stack([ids[rows][other], partner[other]]))
    by_number = np.argsort(numbers)
    node = by_number[np.searchsorted(numbers, received[:, 0], sorter=by_number)]
    return Piece(mesh, numbers, total, owner, np.column_stack([node, received[:, 1]]), ends)


def _home(ranks: Ranks, numbers: IntArray, total: int) -> IntArray:
    """The rank that keeps the record of each number: blocks of consecutive numbers."""
    return np.asarray(numbers * ranks.size // max(total, 1))


def refine(ranks: Ranks, piece: Piece, crossed: bool = False) -> Piece:
    """The piece with every cell cut as :meth:`Mesh.refined` cuts it; midpoints are numbered as there.

    If it is ``crossed``, triangles meet in the centres of squares, where they have their last node, and do so after it.
    PETSc's own refinement is not used: in space it cuts along other diagonals than the serial mesh does.
    """
    mesh = piece.mesh
    edges = mesh.edges if mesh.number_of_cells else np.zeros((0, 2), dtype=np.int64)
    number, count = _edge_numbers(ranks, np.sort(piece.numbers[edges], axis=1), piece.total)
    numbers = np.concatenate([piece.numbers, piece.total + number])
    own = np.repeat(np.arange(mesh.number_of_nodes)[:, None], 2, axis=1)
    finer = mesh.refined() if mesh.number_of_cells else mesh
    if crossed:
        finer = _crossed(finer)
    result = _shared(ranks, finer, numbers, piece.total + count, np.vstack([own, edges]))
    return replace(result, parts=piece.parts, whole=piece.whole)


def _crossed(mesh: Mesh) -> Mesh:
    """Refined triangles with the two children next to the last node cut along their other diagonal."""
    first, second, outer, inner = np.split(mesh.cells, 4)
    centre, (low, right, left) = outer[:, 2], inner.T
    third, fourth = np.column_stack([centre, low, right]), np.column_stack([low, centre, left])
    cells = np.concatenate([first, second, third, fourth])
    return Mesh.trusted(mesh.points, cells, mesh.boundaries, mesh.regions)


def _edge_numbers(ranks: Ranks, pairs: IntArray, total: int) -> tuple[IntArray, int]:
    """Place of each edge, a pair of node numbers with the lower one first, among all edges sorted; and their count."""
    asked, _, back = ranks.exchange(_home(ranks, pairs[:, 0], total), pairs)
    keys = asked[:, 0] * total + asked[:, 1]
    distinct, row = np.unique(keys, return_inverse=True)
    before, count = ranks.offset(len(distinct))
    return back.answer((before + row.reshape(-1, 1)).astype(np.int64))[:, 0], count


def renumber(ranks: Ranks, piece: Piece, numbers: IntArray) -> Piece:
    """The piece with other numbers for its nodes; all ranks must agree on them."""

    def check() -> None:
        if np.unique(numbers).size < numbers.size or (numbers >= piece.total).any():
            raise ProblemError(
                "two nodes of the mesh got the same number; move the body nearer to the origin, or take fewer cells"
            )

    ranks.agree(check)
    result = _shared(ranks, piece.mesh, numbers, piece.total, piece.ends)
    return replace(result, parts=piece.parts, whole=piece.whole)
