"""The motions that deform no part of a body: what a stiffness matrix cannot resist.

Cells that share a facet move as one where they do not deform; cells that share no more than a node or, in space, an
edge turn about it.  So the motions without deformation are the rigid motions of the parts (cells joined through
facets) that agree at the nodes which parts share, and that the supports admit: the kernel of the stiffness matrix, told
by the mesh and by the supports alone, whatever the rounding of the matrix.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.parts import Parts

__all__ = [
    "Mechanism",
    "RigidModes",
    "admitted",
    "free_motions",
    "joined",
    "linked_motions",
    "no_motions",
    "rigid_basis",
]

#: Motions of parts that hang together at nodes only, up to which they are sorted out.
_LARGEST = 1200
#: Part of a motion of size one that links take away by rounding: of sums over the facets around a node.
_ROUNDED = 1e-12


@dataclass(frozen=True, eq=False)
class Mechanism:
    """Parts that hang together or touch one another, and the motions without deformation that are left to them."""

    parts: IntArray  # (p,): their numbers
    columns: slice  # of :attr:`RigidModes.motions`
    coefficients: Array  # (p, 3 or 6, a)
    hinges: IntArray  # nodes that the parts share with one another or with parts that are held


@dataclass(frozen=True, eq=False)
class RigidModes:
    """A basis of the motions that deform nothing and that the supports admit."""

    motions: sp.csc_array  # (nodes * d, a): nodal displacements, of size one
    groups: tuple[Mechanism, ...]  # parts that move independently of one another
    parts: Parts  # all of the body

    @property
    def count(self) -> int:
        """How many there are; the stiffness matrix is positive definite if there is none."""
        return int(self.motions.shape[1])


def rigid_basis(nodes: Array, corners: tuple[Array, Array] | None = None) -> tuple[Array, list[str]]:
    """Translations and rotations about the middle, scaled to size one; shape (nodes * d, 3 or 6), and their names.

    ``corners`` are the lowest and the highest of the body, shape (d,), where the nodes are not all of them.
    """
    count, dim = nodes.shape
    lowest, highest = (nodes.min(axis=0), nodes.max(axis=0)) if corners is None else corners
    middle = 0.5 * (highest + lowest)
    arm = (nodes - middle) / (0.5 * np.linalg.norm(highest - lowest))
    motions, names = [], []
    for axis in range(dim):
        motions.append(np.broadcast_to(np.eye(dim)[axis], nodes.shape).ravel())
        names.append("(" + ", ".join(f"{value:g}" for value in np.eye(dim)[axis]) + ")")
    for i, j in itertools.combinations(range(dim), 2):
        turn = np.zeros((count, dim))
        turn[:, i], turn[:, j] = -arm[:, j], arm[:, i]
        motions.append(turn.ravel())
        names.append("" if dim == 2 else f" about the {'zyx'[i + j - 1]} axis")
    return np.column_stack(motions), names


def admitted(moved: Array) -> Array:
    """Orthonormal coefficients of the motions that move no support: ``moved`` is (conditions, motions)."""
    if not len(moved):
        return np.eye(moved.shape[1])
    triangle = np.linalg.qr(moved, mode="r")
    return np.asarray(scipy.linalg.null_space(triangle, rcond=SAME))


def free_motions(
    mesh: Mesh, order: int, basis: sp.csr_array, lift: sp.csr_array, own: sp.csc_array, ring: bool,
    resisted: tuple[IntArray, Array] | None = None,
) -> RigidModes:  # fmt: skip
    """The motions without deformation that a body has left, by its mesh, its supports and their springs.

    All but the mesh is of :class:`hemivar.discrete.Field`.
    """
    stopped = _stopped(mesh.dim, basis, lift, own)
    if resisted is not None:
        stopped = _sums(stopped, resisted)
    able = _able(mesh.dim, ring)
    return (_of_one if mesh.parts.count == 1 else _of_many)(mesh, order, stopped, able)


def linked_motions(
    mesh: Mesh,
    order: int,
    basis: sp.csr_array,
    lift: sp.csr_array,
    ring: bool,
    resisted: tuple[IntArray, Array] | None = None,
) -> RigidModes:
    """The same of bodies some nodes of which follow others: all parts are one group."""
    body, able, dim = _Body(mesh, order), _able(mesh.dim, ring), mesh.dim
    width, count = able.shape[1], body.all.count
    if width * count > _LARGEST:
        raise ProblemError(f"the body has {count} parts, more than can be linked; join their cells through facets")

    def rows(of: IntArray) -> IntArray:
        return (of[:, None] * dim + np.arange(dim)).ravel()

    moved = np.concatenate([body.motions(part, body.nodes_of(part)) @ able for part in range(count)])
    columns = np.repeat(body.owner[:, None] * width + np.arange(width), dim, axis=0)
    shape = (len(body.node) * dim, width * count)
    each = sp.csr_array((moved.ravel(), columns.ravel(), np.arange(0, moved.size + 1, width)), shape=shape)
    motions = sp.csr_array(each[rows(np.unique(body.node, return_index=True)[1])])
    conditions = [each - motions[rows(body.node)], motions - basis @ (lift @ motions)]
    if resisted is not None:
        conditions.append(sp.block_diag(resisted[1]) @ motions[rows(resisted[0])])
    stops = sp.csr_array(sp.vstack(conditions))
    stops.data[np.abs(stops.data) < _ROUNDED] = 0.0
    stops.eliminate_zeros()
    left = admitted(stops[np.diff(stops.indptr) > 0].toarray())
    if not left.shape[1]:
        return no_motions(mesh, motions.shape[0])
    coefficients = np.einsum("kw,pwa->pka", able, left.reshape(count, width, -1))
    group = Mechanism(np.arange(count), slice(0, left.shape[1]), coefficients, np.flatnonzero(body.shared))
    return RigidModes(sp.csc_array(motions @ left), (group,), mesh.parts)


def _able(dim: int, ring: bool) -> Array:
    """Which of the rigid motions deform nothing: of rings that along the axis."""
    return np.eye(3)[:, [1]] if ring else np.eye(3 if dim == 2 else 6)


def _sums(one: tuple[IntArray, Array], other: tuple[IntArray, Array]) -> tuple[IntArray, Array]:
    """Matrices at nodes, summed where both are: what neither of two stops is in the kernel of the sum."""
    nodes, number = np.unique(np.concatenate([one[0], other[0]]), return_inverse=True)
    sums = np.zeros((len(nodes), *other[1].shape[1:]))
    np.add.at(sums, number, np.concatenate([one[1], other[1]]))
    return nodes, sums


def no_motions(mesh: Mesh, size: int) -> RigidModes:
    """None at all, of so many nodal values, for a body that something resists at every place."""
    return RigidModes(sp.csc_array((size, 0)), (), mesh.parts)


def _stopped(dim: int, basis: sp.csr_array, lift: sp.csr_array, own: sp.csc_array) -> tuple[IntArray, Array]:
    """Nodes that supports act on, and the projections (k, d, d) on what they fix there."""
    column_node = own.indices[own.indptr[:-1]] // dim
    nodes = np.flatnonzero(np.bincount(column_node, minlength=basis.shape[0] // dim) < dim)
    rows = (nodes[:, None] * dim + np.arange(dim)).ravel()
    product = sp.csr_array(basis[rows] @ lift.tocsc()[:, rows]).tocoo()
    same = product.row // dim == product.col // dim  # all but rounding
    row, column = product.row[same], product.col[same]
    projection = np.tile(np.eye(dim), (len(nodes), 1, 1))
    np.subtract.at(projection, (row // dim, row % dim, column % dim), product.data[same])
    projection[np.abs(projection) < 1e-14] = 0.0
    return nodes, projection


def joined(motions: RigidModes, trace: sp.csr_array) -> RigidModes:
    """The same motions, with the parts in one group that touch one another.

    Each of two parts may be held as long as the other rests, and both be free to move together.

    Shapes: ``trace`` (q, nodes * d).
    """
    groups = motions.groups
    if len(groups) < 2:
        return motions
    widths = [group.coefficients.shape[2] for group in groups]
    of = sp.csr_array((np.ones(sum(widths)), (np.arange(sum(widths)), np.repeat(np.arange(len(groups)), widths))))
    seen = abs(trace @ motions.motions) @ of
    count, label = connected_components(seen.T @ seen, directed=False)
    if count == len(groups):
        return motions
    touching = [[groups[k] for k in np.flatnonzero(label == piece)] for piece in range(count)]
    columns = np.concatenate([np.arange(one.columns.start, one.columns.stop) for every in touching for one in every])
    ends = np.cumsum([0] + [sum(one.coefficients.shape[2] for one in every) for every in touching]).tolist()
    made = tuple(_merged(every, slice(*span)) for every, span in zip(touching, itertools.pairwise(ends), strict=True))
    return RigidModes(sp.csc_array(motions.motions[:, columns]), made, motions.parts)


def _merged(groups: list[Mechanism], columns: slice) -> Mechanism:
    """Groups as one, of the given columns."""
    if len(groups) == 1:
        return replace(groups[0], columns=columns)
    blocks = [one.coefficients for one in groups]
    kinds = blocks[0].shape[1]
    coefficients = scipy.linalg.block_diag(*(block.reshape(-1, block.shape[2]) for block in blocks))
    parts, hinges = (np.concatenate([getattr(one, what) for one in groups]) for what in ("parts", "hinges"))
    return Mechanism(parts, columns, coefficients.reshape(len(parts), kinds, -1), hinges)


def _of_one(mesh: Mesh, order: int, stopped: tuple[IntArray, Array], admissible: Array) -> RigidModes:
    """The motions of a body of one part, among those (3 or 6, q) that deform nothing."""
    nodes, dim = mesh.nodes(order), mesh.dim
    corners = (nodes.min(axis=0), nodes.max(axis=0))
    where, stop = stopped
    count = 3 if dim == 2 else 6
    if len(where):
        moved = rigid_basis(nodes[where], corners)[0].reshape(len(where), dim, count)
        admissible = admissible @ admitted(
            np.einsum("kij,kjr->kir", stop, moved @ admissible).reshape(-1, admissible.shape[1])
        )
    left = admissible.shape[1]
    if not left:
        return no_motions(mesh, nodes.size)
    motions = rigid_basis(nodes, corners)[0] @ admissible
    group = Mechanism(np.zeros(1, dtype=np.int64), slice(0, left), admissible[None], np.zeros(0, dtype=np.int64))
    return RigidModes(sp.csc_array(motions), (group,), mesh.parts)


class _Body:
    """The nodes of every part, and the rigid motions of it there."""

    def __init__(self, mesh: Mesh, order: int) -> None:
        self.dim, self.nodes = mesh.dim, mesh.nodes(order)
        self.all = mesh.parts
        cells = mesh.cell_nodes(order)
        pairs = np.unique(np.repeat(self.all.cell, cells.shape[1]) * np.int64(len(self.nodes)) + cells.ravel())
        self.owner, self.node = pairs // len(self.nodes), pairs % len(self.nodes)
        self.start = np.searchsorted(self.owner, np.arange(self.all.count + 1))
        shared = np.bincount(self.node, minlength=len(self.nodes))
        self.shared = shared > 1
        self.kinds = 3 if self.dim == 2 else 6

    def nodes_of(self, part: int) -> IntArray:
        return np.asarray(self.node[self.start[part] : self.start[part + 1]])

    def motions(self, part: int, nodes: IntArray) -> Array:
        """Rigid motions of a part at nodes, (k, d, 3 or 6)."""
        own = self.nodes[self.nodes_of(part)]
        made = rigid_basis(self.nodes[nodes], (own.min(axis=0), own.max(axis=0)))[0]
        return made.reshape(len(nodes), self.dim, self.kinds)


def _of_many(mesh: Mesh, order: int, stopped_at: tuple[IntArray, Array], able: Array) -> RigidModes:
    """The motions of a body of several parts: first the parts that supports hold, then what hangs on them."""
    body = _Body(mesh, order)
    dim, count = body.dim, body.all.count
    where, projection = stopped_at
    stop = np.zeros((len(body.nodes), dim, dim))
    stop[where] = projection
    stopped = np.zeros(len(body.nodes), dtype=bool)
    stopped[where] = True
    left = [able] * count
    held = np.zeros(count, dtype=bool)
    sharing = sp.csr_array(
        (np.ones(len(body.node), dtype=np.int8), (body.node, body.owner)), shape=(len(body.nodes), count)
    )
    waiting = list(range(count))
    while waiting:  # what hangs on parts that are held by enough nodes is held as well
        part = waiting.pop()
        if held[part]:
            continue
        nodes = body.nodes_of(part)
        on = nodes[stopped[nodes]]
        moved = np.einsum("kij,kjr->kir", stop[on], body.motions(part, on) @ able).reshape(-1, able.shape[1])
        left[part] = able @ admitted(moved)
        if left[part].shape[1] == 0:
            held[part] = True
            joints = nodes[body.shared[nodes]]
            stop[joints], stopped[joints] = np.eye(dim), True
            waiting.extend(int(p) for p in np.unique(sharing[joints].indices) if not held[p])
    return _clusters(body, left, held, stop, sharing)


def _clusters(body: _Body, left: list[Array], held: BoolArray, stop: Array, sharing: sp.csr_array) -> RigidModes:
    """Motions of the parts that are not held, those that hang together being taken together."""
    dim, kinds = body.dim, body.kinds
    joints = np.flatnonzero(body.shared & ~stop[:, range(dim), range(dim)].all(axis=1))
    among = sharing[joints].astype(float)
    _, label = connected_components(sp.csr_array(among.T @ among), directed=False)
    data: list[Array] = [np.zeros(0)]
    rows_of: list[IntArray] = [np.zeros(0, dtype=np.int64)]
    columns_of: list[IntArray] = [np.zeros(0, dtype=np.int64)]
    groups: list[Mechanism] = []
    total = 0
    for cluster in np.unique(label[~held]):
        members: IntArray = np.flatnonzero((label == cluster) & ~held)
        width = sum(left[p].shape[1] for p in members)
        if width > _LARGEST:
            centre = ", ".join(f"{x:.6g}" for x in body.nodes[body.nodes_of(int(members[0]))].mean(axis=0))
            raise ProblemError(
                f"{len(members)} parts of the body, one of them around x = ({centre}), are connected at nodes or "
                f"edges only; join their cells through common facets"
            )
        offset = np.concatenate([[0], np.cumsum([left[p].shape[1] for p in members])])
        place_of = {int(p): i for i, p in enumerate(members)}
        rows: list[Array] = []
        for joint in joints[np.asarray(among[:, members].sum(axis=1)).ravel() > 1.0] if len(members) > 1 else []:
            owners = [int(p) for p in sharing[[joint]].indices if int(p) in place_of]
            first = owners[0]
            mine = (body.motions(first, np.array([joint]))[0]) @ left[first]
            for other in owners[1:]:
                row = np.zeros((dim, width))
                i, k = place_of[first], place_of[other]
                row[:, offset[i] : offset[i + 1]] = mine
                row[:, offset[k] : offset[k + 1]] = -body.motions(other, np.array([joint]))[0] @ left[other]
                rows.append(row)
        own = admitted(np.concatenate([*rows, np.zeros((0, width))]))
        if own.shape[1] == 0:
            continue
        coefficients = np.zeros((len(members), kinds, own.shape[1]))
        nodes_done: list[IntArray] = []
        values: list[Array] = []
        for i, p in enumerate(members):
            coefficients[i] = left[p] @ own[offset[i] : offset[i + 1]]
            nodes = body.nodes_of(int(p))
            nodes_done.append(nodes)
            values.append(body.motions(int(p), nodes) @ coefficients[i])
        every, first_of = np.unique(np.concatenate(nodes_done), return_index=True)
        moved = np.concatenate(values)[first_of].reshape(-1, own.shape[1])
        entries = (every[:, None] * dim + np.arange(dim)).ravel()
        data.append(moved.ravel())
        rows_of.append(np.repeat(entries, own.shape[1]).astype(np.int64))
        columns_of.append(np.tile(total + np.arange(own.shape[1]), len(entries)))
        hinges = every[body.shared[every]]
        groups.append(Mechanism(members, slice(total, total + own.shape[1]), coefficients, hinges))
        total += own.shape[1]
    entries_at = (np.concatenate(rows_of), np.concatenate(columns_of))
    motions = sp.csc_array((np.concatenate(data), entries_at), shape=(len(body.nodes) * dim, total))
    return RigidModes(motions, tuple(groups), body.all)
