"""Degrees of freedom: which nodal directions supports and contact leave free, and the basis matrix P."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.space import Followers
from hemivar.errors import ProblemError
from hemivar.fem.contact_points import (
    BoundaryContact,
    area_contacts,
    boundary_contact,
    contacts_of_one,
    join,
    merge_corners,
    without_followers,
)
from hemivar.fem.edge_blocks import EdgeBlocks
from hemivar.fem.links import Links, stated_links, tied_nodes
from hemivar.fem.mortar_basis import JumpUnknowns, jump_unknowns
from hemivar.fem.plates import stated_plates
from hemivar.fem.supports import Supports, movable, stated_supports, unit
from hemivar.laws import ContactLaw, NoContact, VectorLaw
from hemivar.mechanics.statement import ContactProblem, Quadrature

__all__ = [
    "NodalConditions",
    "basis_of",
    "nodal_conditions",
]


@dataclass(frozen=True, eq=False)
class NodalConditions:
    """What supports and contact make of the nodes of the boundaries; no cell takes part in it."""

    supports: Supports
    groups: list[BoundaryContact]
    directions: Array  # (nodes, c, c): orthonormal directions of the unknowns at every node
    free: BoolArray  # (nodes, c): which of them are unknowns
    links: list[Links]

    @cached_property
    def _nodal(self) -> sp.csr_array:
        """What nodal values (nodes * c,) are of the components that supports leave free."""
        return basis_of(self.directions, self.free)

    @cached_property
    def basis(self) -> sp.csr_array:
        """The matrix P, shape (nodes * c, n)."""
        jumps = self.jumps
        return self._nodal if jumps is None else sp.csr_array(self._nodal @ jumps.change[:, jumps.kept])

    @cached_property
    def lift(self) -> sp.csr_array | None:
        """A left inverse of P, shape (n, nodes * c); None for its transpose."""
        jumps = self.jumps
        return None if jumps is None else sp.csr_array(jumps.back[jumps.kept] @ self._nodal.T)

    @cached_property
    def jumps(self) -> JumpUnknowns | None:
        """The unknowns that are jumps between two bodies, or means beside a corner, and those that links take away.

        None where there are none.
        """
        links, (linked, node) = self.links, self._linked
        pairs = [group for group in self.groups if group.apart]
        if not pairs and not links:
            return None
        components, empty = self.free.shape[1], [linked[:0]]
        trace = sp.csr_array(sp.vstack([*empty, *(group.points.trace for group in pairs)]) @ self._nodal)
        blocked = np.concatenate([np.zeros((0, components), dtype=bool), *(group.blocked for group in pairs)])
        rows = np.flatnonzero(~blocked.ravel() & (np.diff(trace.indptr) > 0))
        own = np.repeat(np.concatenate([node[:0], *(group.points.node for group in pairs)]), components)[rows]
        first = sp.csr_array(linked @ self._nodal)
        both = sp.csr_array(sp.vstack([first, trace[rows]]))
        of = np.flatnonzero(self.free) // components
        jumps = jump_unknowns(both, np.concatenate([node, own]), of, len(node))
        if links and (jumps is None or (jumps.vanish[np.diff(first.indptr) > 0] < 0).any()):
            raise ProblemError(
                f"{' and '.join(link.name for link in links)}: what is joined hangs together in a circle, so that no "
                "side follows the other one; state slave, or leave one out"
            )
        return jumps

    @cached_property
    def _linked(self) -> tuple[sp.csr_array, IntArray]:
        """The rows (k, nodes * c) of all links, and the nodes (k,) of which a value follows."""
        size = self.free.size
        rows = sp.csr_array(sp.vstack([sp.csr_array((0, size)), *(link.rows for link in self.links)]))
        return rows, np.concatenate([np.zeros(0, dtype=np.int64), *(link.node for link in self.links)])

    @cached_property
    def followers(self) -> Followers | None:
        """What follows by links; None where nothing does."""
        if not self.links:
            return None
        (rows, node), jumps = self._linked, self.jumps
        assert jumps is not None
        able = np.flatnonzero(jumps.vanish >= 0)
        move = sp.csr_array(self._nodal @ jumps.change[:, jumps.vanish[able]])
        of_plates = sum(len(link.node) for link in self.links if link.of_plate)
        return Followers(sp.csr_array(rows[able]), move, node[able], int(np.searchsorted(able, of_plates)))

    def matrix(self, blocks: EdgeBlocks) -> sp.csr_array:
        """The symmetric matrix (n, n) of blocks along the axes, which are used up."""
        return matrix_of(blocks, self.directions, self.free, self.jumps)

    @cached_property
    def prescribed(self) -> Array:
        """The prescribed values u0, shape (nodes * c,), and what follows them by links."""
        stated, followers = self.supports.value.ravel(), self.followers
        if followers is None or self.jumps is None:
            return stated
        values, able = np.concatenate([link.values for link in self.links]), self.jumps.vanish >= 0
        return np.asarray(stated - followers.move @ (followers.rows @ stated - values[able]))

    @property
    def warnings(self) -> tuple[str, ...]:
        """How far points of supports are from their nodes, and what is doubtful about the contact of two bodies."""
        said = [one.warnings for one in self.groups] + [one.notes for one in self.links]
        return (*self.supports.notes, *(sentence for sentences in said for sentence in sentences))

    def contact(self, nodes: BoolArray | None = None) -> tuple[ContactPoints, Array, VectorLaw, float]:
        """Contact points, all or those at the nodes where the mask, shape (nodes,), holds; see :func:`join`."""
        groups = self.groups
        if nodes is not None:
            chosen = ((group, np.flatnonzero(nodes[group.points.node])) for group in groups)
            groups = [group.take(rows) for group, rows in chosen if rows.size]
        if not groups:
            return self._no_points, np.zeros(self._no_points.shape), ContactLaw(NoContact()).at(None), 0.0
        return join(groups, self.basis, self.prescribed)

    @property
    def _no_points(self) -> ContactPoints:
        nodes, components = self.supports.nodes[:0], self.free.shape[1]
        none, frames = np.zeros(0, dtype=np.int64), np.zeros((0, components, nodes.shape[1]))
        return ContactPoints(
            sp.csr_array((0, self.basis.shape[1])), np.zeros(0), nodes, frames if components > 1 else None,
            none, none, none, (), np.zeros(0, dtype=bool), components,
        )  # fmt: skip


def nodal_conditions(problem: ContactProblem, pairs: Mapping[str, BoundaryContact] | None = None) -> NodalConditions:
    """Supports and contact at the nodes of a problem; ``pairs`` are contact points of two bodies that are known."""
    supports, known = stated_supports(problem), {} if pairs is None else pairs
    ties = tied_nodes(problem, supports)
    if problem.kind:
        groups = contacts_of_one(problem, supports, known)
    else:
        groups = [
            known.get(name) or boundary_contact(problem, name, supports)
            for name in problem.contact
            if name not in problem.areas
        ]
        if problem.quadrature is Quadrature.NODAL:
            groups = merge_corners(groups, supports, problem.contact)
        groups += area_contacts(problem, supports, groups)
    joints = [tie.nodes for tie in ties.values()]
    groups = without_followers(groups, [*joints, *(plate.nodes for plate in stated_plates(problem))])
    directions, free = _free_directions(supports, groups)
    links = stated_links(problem, supports, ties, directions, free)
    return NodalConditions(supports, groups, directions, free, links)


def _free_directions(supports: Supports, groups: list[BoundaryContact]) -> tuple[Array, BoolArray]:
    """Orthonormal directions at every node, shape (nodes, c, c), and which of them are free, shape (nodes, c)."""
    count, dim = supports.value.shape
    directions = np.broadcast_to(np.eye(dim), (count, dim, dim)).copy()
    taken = np.zeros(count, dtype=bool)
    for group in groups:
        nodes, frames = group.points.node, group.points.frames
        if frames is not None and frames.shape[1] == dim and (nodes >= 0).all():
            new = ~taken[nodes]
            directions[nodes[new]] = frames[new]
            taken[nodes] = True
    free = np.broadcast_to((supports.count == 0)[:, None], (count, dim)).copy()
    partly = np.flatnonzero((supports.count > 0) & (supports.count < dim))
    if len(partly):
        rest = movable(directions[partly], supports.directions[partly])
        wanted = dim - supports.count[partly]
        chosen = np.zeros(rest.shape)
        used = np.zeros((len(partly), dim), dtype=bool)
        every = np.arange(len(partly))
        for step in range(dim - 1):
            size = np.where(used, -1.0, np.linalg.norm(rest, axis=2))
            pick = np.argmax(size >= (1 - 1e-9) * size.max(axis=1, keepdims=True), axis=1)
            active = step < wanted
            along = np.zeros((len(partly), dim))
            along[active] = unit(rest[every[active], pick[active]])
            chosen[every[active], pick[active]] = along[active]
            used[every[active], pick[active]] = True
            rest -= np.einsum("kcd,kd->kc", rest, along)[:, :, None] * along[:, None, :]
        slots = np.argsort(used, axis=1, kind="stable")  # slots of held directions come first
        for step in range(dim - 1):
            filled = step < supports.count[partly]
            chosen[every[filled], slots[filled, step]] = supports.directions[partly[filled], step]
        directions[partly], free[partly] = chosen, used
    return directions, free


def matrix_of(
    blocks: EdgeBlocks, directions: Array | None, free: BoolArray, jumps: JumpUnknowns | None = None
) -> sp.csr_array:
    """The symmetric matrix (n, n) of blocks along the axes, which are used up, by unknowns.

    ``directions (nodes, c, c)`` are those of the components of every node, ``free (nodes, c)`` those that move.
    """
    if directions is not None:
        blocks.turn(directions)
    nodal = blocks.matrix(free)
    return nodal if jumps is None else jumps.of(nodal)


def basis_of(directions: Array, free: BoolArray) -> sp.csr_array:
    """The matrix P, shape (nodes * c, n); its columns are the free directions, node by node."""
    count, dim = free.shape
    narrow = np.int32 if directions.size < np.iinfo(np.int32).max else np.int64
    dofs = np.flatnonzero(free)
    rows, data = dofs.astype(narrow), np.ones(len(dofs))
    starts = np.arange(len(dofs) + 1, dtype=narrow)
    turned = np.repeat((directions != np.eye(dim)).any(axis=(1, 2)), dim)[dofs]
    if turned.any():  # these columns may have more than one entry
        node, slot = np.divmod(dofs[turned], dim)
        values = directions[node, slot]
        keep = values != 0.0
        many = np.ones(len(dofs), dtype=np.int64)
        many[turned] = keep.sum(axis=1)
        starts[1:] = np.cumsum(many)
        data, rows, at = np.repeat(data, many), np.repeat(rows, many), np.repeat(turned, many)
        data[at], rows[at] = values[keep], (node[:, None] * dim + np.arange(dim))[keep]
    return sp.csr_array(sp.csc_array((data, rows, starts), shape=(count * dim, len(dofs))))
