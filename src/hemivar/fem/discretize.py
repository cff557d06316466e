"""From the statement of a contact problem to its discrete energy."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.problem import DiscreteProblem, FieldMap
from hemivar.errors import ProblemError, SupportError
from hemivar.fem.assembly import linear_stiffness, load_vector, stiffness_matrix
from hemivar.fem.free_motion import refuse_free_motion
from hemivar.laws import ContactLaw, NoContact
from hemivar.mechanics.conditions import (
    LARGEST,
    Clamped,
    Fixed,
    Prescribed,
    Roller,
    Support,
    evaluate_scalar,
    evaluate_vector,
)
from hemivar.mechanics.obstacles import obstacle_contact, refuse_inside
from hemivar.mechanics.statement import ContactProblem, Quadrature
from hemivar.mesh.mesh import Mesh

__all__ = [
    "JoinedContact",
    "NodalConditions",
    "discretize",
    "nodal_conditions",
]

_DEPENDENT = 1e-8
_ZERO = 1e-12
_CORNER = np.cos(np.pi / 4)


def discretize(problem: ContactProblem, *, check_coercivity: bool = True) -> DiscreteProblem:
    """Discretise a contact problem by finite elements.

    The displacement is ``U = P u + u0`` with orthonormal columns in ``P``: at the nodes of a contact
    boundary (nodal quadrature) they are the normal and the tangents, so that the trace selects unknowns; at
    inclined rollers the free tangents; elsewhere the Cartesian axes. ``K = P' Kf P``, ``f = P'(F - Kf u0)``;
    gap and slip offset take up ``u0``.

    With nodal quadrature, contact point j is a node; its normal is the normalised sum of the adjacent facet
    normals times facet measures, its weight the integral of its shape function over the contact boundary.
    Where the foundation is an obstacle, normal and gap are those stated in :class:`Contact`; points whose normal misses
    it are no contact points.
    With midpoint quadrature, contact point j is a facet, its displacement the mean over the facet (for
    order 1 that of the midpoint), so that the multiplier is constant on every facet. Contact points that
    the supports hold entirely are dropped and their energy goes into ``constant``. Where a support fixes a
    direction oblique to the contact normal, normal and tangential motion are one: the point keeps its
    normal row, and the dependent tangential row is set to zero (no friction in that direction). A node where
    two contact boundaries meet smoothly is one contact point, with the law and gap of the boundary named
    first, the weights added and the normals averaged; where they meet at more than 45 degrees it is a point of
    both, with their normal laws and without friction. Where friction is left out so, ``without_friction`` and
    ``warnings`` of the discrete problem say it, with the points.

    Parameters
    ----------
    problem : ContactProblem
    check_coercivity : bool
        Refuse problems whose energy is not bounded below or not held along a rigid motion. ``False`` lets
        them pass: a local equilibrium may exist all the same.

    Returns
    -------
    DiscreteProblem

    Raises
    ------
    ProblemError
        If supports contradict each other, data have the wrong shape or are not finite, the material is not
        positive definite, an obstacle lies inside the body, midpoints of contact facets have displacements that
        depend on one another, or the body is free to move.
    """
    if isinstance(problem, DiscreteProblem):
        raise ProblemError("this problem is discrete already; solve it, or discretize its statement")
    remedy = "give a ContactProblem; hemivar.read_problem(path) reads one from a file"
    problem = expect(problem, ContactProblem, "what to discretize", remedy)
    mesh, order = problem.mesh, problem.order
    dim = mesh.dim
    conditions = nodal_conditions(problem)
    supports, groups, basis = conditions.supports, conditions.groups, conditions.basis
    if basis.shape[1] == 0:
        raise SupportError("the supports leave the body no freedom; refine the mesh or remove supports")

    full_load = load_vector(mesh, order, problem.body_force, problem.tractions)
    prescribed = conditions.prescribed
    reaction = np.zeros_like(prescribed)
    if order == 1:
        blocks = linear_stiffness(mesh, problem.material)
        if prescribed.any():
            reaction = blocks.times(supports.value).ravel()
        blocks.turn(conditions.directions)
        stiffness = blocks.matrix(conditions.free)
        del blocks
    else:
        full_stiffness = stiffness_matrix(mesh, problem.material, order)
        if prescribed.any():
            reaction = full_stiffness @ prescribed
        stiffness = _reduce(full_stiffness, basis)
    load = basis.T @ (full_load - reaction)
    constant = float(prescribed @ (0.5 * reaction - full_load))

    if check_coercivity:
        for name, stated in problem.contact.items():
            if stated.obstacle is not None:
                at = mesh.points[np.unique(mesh.boundaries[name])]
                refuse_inside(stated.obstacle, mesh, at, f"contact '{name}'")
    contact = _join(groups, basis, prescribed, dim)
    if problem.quadrature is Quadrature.MIDPOINT:
        _refuse_dependent(contact, groups, list(problem.contact))
    field = FieldMap(mesh, order, basis, prescribed, problem.material)
    discrete = DiscreteProblem._assembled(
        stiffness=stiffness,
        load=load,
        trace=contact.trace,
        weights=contact.weights,
        gap=contact.offset[:, 0],
        law=contact.law,
        constant=constant + contact.energy,
        slip_offset=contact.offset[:, 1:],
        points=contact.points,
        frames=contact.frames,
        field=field,
        statement=problem,
        without_friction=contact.without_friction,
    )
    if check_coercivity:
        for warning in discrete.warnings:
            logging.getLogger("hemivar").info("%s", warning)
        refuse_free_motion(discrete, full_load)
    return discrete


@dataclass(frozen=True, eq=False)
class NodalConditions:
    """What supports and contact make of the nodes of the boundaries; no cell takes part in it.

    Attributes
    ----------
    supports
        Fixed directions and prescribed displacements at every node.
    groups
        Contact points of each boundary, before the supports take effect.
    directions : array, shape (nodes, d, d)
        Orthonormal directions of the unknowns at every node.
    free : bool array, shape (nodes, d)
        Which of them are unknowns.
    """

    supports: _Supports
    groups: list[_ContactGroup]
    directions: Array
    free: BoolArray

    @cached_property
    def basis(self) -> sp.csr_array:
        """The matrix P, shape (nodes * d, n)."""
        return _basis(self.directions, self.free)

    @property
    def prescribed(self) -> Array:
        """The prescribed displacements u0, shape (nodes * d,)."""
        return self.supports.value.ravel()

    def contact(self, nodes: BoolArray) -> tuple[JoinedContact, IntArray, IntArray]:
        """Contact points at the nodes where the mask, shape (nodes,), holds; for nodal quadrature only.

        Returns
        -------
        contact : JoinedContact
        node, boundary : int arrays (m,)
            The node of each contact point, and the place of its boundary in ``groups``.
        """
        groups, owners = [], []
        for number, group in enumerate(self.groups):
            assert group.nodes is not None
            rows = np.flatnonzero(nodes[group.nodes])
            if rows.size:
                owners.append(np.column_stack([group.nodes[rows], np.full(rows.size, number)]))
                groups.append(
                    replace(
                        group,
                        average=sp.csr_array(group.average[rows]),
                        nodes=group.nodes[rows],
                        points=group.points[rows],
                        frames=group.frames[rows],
                        weights=group.weights[rows],
                        gap=group.gap[rows],
                        law=group.law.take(rows),
                        blocked=group.blocked[rows],
                    )
                )
        contact = _join(groups, self.basis, self.prescribed, self.free.shape[1])
        owner = np.concatenate([*owners, np.zeros((0, 2), dtype=np.int64)])[contact.kept]
        return contact, owner[:, 0], owner[:, 1]


def nodal_conditions(problem: ContactProblem) -> NodalConditions:
    """Supports and contact at the nodes of a problem."""
    mesh, order = problem.mesh, problem.order
    supports = _Supports(mesh.nodes(order))
    for name, support in problem.supports.items():
        _impose(supports, mesh, order, name, support)
    groups = _merge_corners([_contact_group(problem, name, supports) for name in problem.contact], supports)
    directions, free = _free_directions(supports, groups)
    return NodalConditions(supports, groups, directions, free)


# ---- supports --------------------------------------------------------------------------------------------


class _Supports:
    """Fixed directions and prescribed displacements at every node, accumulated support by support."""

    def __init__(self, nodes: Array) -> None:
        count, dim = nodes.shape
        self.nodes = nodes
        self.directions = np.zeros((count, dim, dim))
        self.count = np.zeros(count, dtype=np.int64)
        self.value = np.zeros((count, dim))
        self.owner = np.full((count, dim), -1)
        self.names: list[str] = []

    def fix(self, name: str, nodes: IntArray, directions: Array, values: Array) -> None:
        """Demand ``directions . u = values`` at (distinct) nodes; directions (k, d) are unit vectors."""
        if name not in self.names:
            self.names.append(name)
        known = self.directions[nodes]
        along = np.einsum("kqd,kd->kq", known, directions)
        rest = directions - np.einsum("kq,kqd->kd", along, known)
        size = np.linalg.norm(rest, axis=1)
        missing = values - np.einsum("kd,kd->k", directions, self.value[nodes])
        independent = size > _DEPENDENT
        tolerance = 1e-9 * max(float(np.abs(values).max()), float(np.abs(self.value).max()))
        conflict = ~independent & (np.abs(missing) > tolerance)
        if conflict.any():
            bad = int(np.flatnonzero(conflict)[0])
            node = int(nodes[bad])
            other = self.names[int(self.owner[node, int(np.argmax(np.abs(along[bad])))])]
            raise SupportError(
                f"supports '{other}' and '{name}' prescribe different displacements at node {node}, "
                f"x = {_vector(self.nodes[node])}: they differ by {missing[bad]:.3g} along "
                f"{_vector(directions[bad])}; make them agree there or free one of them"
            )
        nodes, rest, size, missing = (
            nodes[independent],
            rest[independent],
            size[independent],
            missing[independent],
        )
        unit = rest / size[:, None]
        unit[np.abs(unit) < 1e-15] = 0.0
        slot = self.count[nodes]
        self.directions[nodes, slot] = unit
        self.owner[nodes, slot] = self.names.index(name)
        self.value[nodes] += unit * (missing / size)[:, None]
        self.count[nodes] += 1


def _impose(supports: _Supports, mesh: Mesh, order: int, name: str, support: Support) -> None:
    facets = mesh.boundaries[name]
    ids = np.unique(mesh.facet_nodes(facets, order))
    points, dim = supports.nodes[ids], mesh.dim
    what = f"supports['{name}']"
    if isinstance(support, Roller):
        for members, normals in _smooth_normals(mesh, facets, order):
            supports.fix(name, members, normals, np.zeros(len(members)))
        return
    if isinstance(support, Fixed):
        columns = {
            axis: evaluate_scalar(value, points, f"{what}, {'xyz'[axis]}")
            for axis, value in enumerate((support.x, support.y, support.z))
            if value is not None
        }
    else:
        values = np.zeros(points.shape) if isinstance(support, Clamped) else _prescribed(support, points, what)
        columns = {axis: values[:, axis] for axis in range(dim)}
    for axis, column in columns.items():
        supports.fix(name, ids, np.broadcast_to(np.eye(dim)[axis], points.shape), column)


def _prescribed(support: Prescribed, points: Array, what: str) -> Array:
    return evaluate_vector(support.value, points, what)


def _smooth_normals(mesh: Mesh, facets: IntArray, order: int) -> list[tuple[IntArray, Array]]:
    """Averaged facet normals at the nodes of a boundary; facets that meet sharply are averaged separately.

    Returns up to d pairs of nodes (distinct in each pair) and unit normals.
    """
    members = mesh.facet_nodes(facets, order)
    normals, measures = mesh.facet_normals(facets)
    ids = members.ravel()
    normal = np.repeat(normals, members.shape[1], axis=0)
    weight = np.repeat(measures, members.shape[1])
    remaining = np.arange(len(ids))
    found = []
    for _ in range(mesh.dim):
        if len(remaining) == 0:
            break
        nodes, first, place = np.unique(ids[remaining], return_index=True, return_inverse=True)
        seed = normal[remaining[first]]
        alike = np.einsum("kd,kd->k", normal[remaining], seed[place]) > _CORNER
        chosen = remaining[alike]
        found.append((nodes, _unit(_sum_by(place[alike], normal[chosen] * weight[chosen, None], len(nodes)))))
        remaining = remaining[~alike]
    return found


def _sum_by(index: IntArray, values: Array, count: int) -> Array:
    return np.column_stack([np.bincount(index, weights=column, minlength=count) for column in values.T])


def _unit(vectors: Array) -> Array:
    unit = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    unit[np.abs(unit) < 1e-15] = 0.0
    return np.asarray(unit)


# ---- contact ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _ContactGroup:
    """Contact points of one boundary, before the supports take effect."""

    average: sp.csr_array  # (k, nodes): displacement of a contact point from nodal displacements
    nodes: IntArray | None  # the node of each contact point, if it is one
    points: Array
    frames: Array
    weights: Array
    gap: Array
    law: ContactLaw
    blocked: BoolArray  # (k, d) rows that supports make dependent on a row before


def _contact_group(problem: ContactProblem, name: str, supports: _Supports) -> _ContactGroup:
    mesh, order, contact = problem.mesh, problem.order, problem.contact[name]
    facets = mesh.boundaries[name]
    members = mesh.facet_nodes(facets, order)
    normals, measures = mesh.facet_normals(facets)
    count, dim = supports.nodes.shape
    nodes: IntArray | None = None
    weights: Array
    share = np.array([1 / 6, 1 / 6, 4 / 6]) if order == 2 else np.full(dim, 1 / dim)
    if problem.quadrature is Quadrature.NODAL:
        nodes, place = np.unique(members.ravel(), return_inverse=True)
        place = place.ravel()
        weights = np.asarray(np.bincount(place, weights=np.outer(measures, share).ravel()), dtype=float)
        summed = _sum_by(place, np.repeat(normals * measures[:, None], members.shape[1], axis=0), len(nodes))
        around = np.bincount(place, weights=np.repeat(measures, members.shape[1]))
        fold = np.linalg.norm(summed, axis=1) <= 1e-8 * around
        if fold.any():
            bad = int(nodes[np.flatnonzero(fold)[0]])
            raise ProblemError(
                f"contact boundary '{name}' folds back on itself at node {bad}, x = "
                f"{_vector(supports.nodes[bad])}, so it has no normal there; split it into two boundaries"
            )
        average = sp.csr_array((np.ones(len(nodes)), nodes, np.arange(len(nodes) + 1)), shape=(len(nodes), count))
        normal, points = _unit(summed), supports.nodes[nodes]
    else:
        rows = np.repeat(np.arange(len(facets)), members.shape[1])
        average = sp.csr_array((np.tile(share, len(facets)), (rows, members.ravel())), shape=(len(facets), count))
        normal, weights, points = _unit(normals), measures, mesh.points[facets].mean(axis=1)
    if contact.obstacle is None:
        gap = evaluate_scalar(contact.gap, points, f"gap of contact '{name}'")
        if not (np.abs(gap) < LARGEST).all():
            raise ProblemError(
                f"gap of contact '{name}': {gap[np.argmax(np.abs(gap))]:g} is beyond the range of numbers"
            )
    else:
        assert contact.normals is not None
        normal, gap = obstacle_contact(contact.obstacle, contact.normals, points, normal, f"contact '{name}'")
        meets = np.isfinite(gap)
        if not meets.all():
            _check_never_touching(contact.law, name, points[~meets])
            average, normal, points, weights, gap = (
                sp.csr_array(average[meets]), normal[meets], points[meets], weights[meets], gap[meets],
            )  # fmt: skip
            nodes = None if nodes is None else nodes[meets]
    frames = _frames(normal)
    blocked = np.zeros((len(points), dim), dtype=bool)
    if nodes is not None:
        frames, blocked = _adapt(frames, supports, nodes)
    return _ContactGroup(average, nodes, points, frames, weights, gap, contact.law.at(points), blocked)


def _check_never_touching(law: ContactLaw, name: str, points: Array) -> None:
    """Refuse laws without opening where the body's normal misses the obstacle."""
    held = np.broadcast_to(np.isfinite(law.at(points).normal.domain.lower), len(points))
    if held.any():
        place = _vector(points[int(np.flatnonzero(held)[0])])
        raise ProblemError(
            f"contact '{name}': its law allows no opening, but the body's normal at x = {place} misses the obstacle; "
            f"take normals = 'obstacle' or a smaller contact boundary"
        )


def _merge_corners(groups: list[_ContactGroup], supports: _Supports) -> list[_ContactGroup]:
    """Make the displacements of contact points independent at nodes of two boundaries (nodal quadrature)."""
    for later in range(1, len(groups)):
        for earlier in range(later):
            first, second = groups[earlier], groups[later]
            if first.nodes is None or second.nodes is None:
                continue
            _, mine, theirs = np.intersect1d(first.nodes, second.nodes, assume_unique=True, return_indices=True)
            if mine.size == 0:
                continue
            alike = np.einsum("kd,kd->k", first.frames[mine, 0], second.frames[theirs, 0]) > _CORNER
            # A sharp corner touches both foundations with its normals; two frictions would share its unknowns.
            blocked, other_blocked = first.blocked.copy(), second.blocked.copy()
            blocked[mine[~alike], 1:] = True
            other_blocked[theirs[~alike], 1:] = True
            mine, theirs = mine[alike], theirs[alike]
            weights, frames = first.weights.copy(), first.frames.copy()
            normal = first.frames[mine, 0] * first.weights[mine, None]
            normal += second.frames[theirs, 0] * second.weights[theirs, None]
            weights[mine] += second.weights[theirs]
            if mine.size:
                frames[mine], blocked[mine] = _adapt(_frames(_unit(normal)), supports, first.nodes[mine])
            groups[earlier] = replace(first, weights=weights, frames=frames, blocked=blocked)
            rest = np.setdiff1d(np.arange(len(second.weights)), theirs)
            if rest.size == 0:
                raise ProblemError("every node of a contact boundary belongs to another one; join the two")
            groups[later] = replace(
                second,
                average=sp.csr_array(second.average[rest]),
                nodes=second.nodes[rest],
                points=second.points[rest],
                frames=second.frames[rest],
                weights=second.weights[rest],
                gap=second.gap[rest],
                law=second.law.take(rest),
                blocked=other_blocked[rest],
            )
    return groups


def _frames(normal: Array) -> Array:
    """Normal and tangents, shape (k, d, d): in 2D the tangent is the normal turned by +90 degrees."""
    if normal.shape[1] == 2:
        return np.stack([normal, np.column_stack([-normal[:, 1], normal[:, 0]])], axis=1)
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = _unit(np.cross(axis, normal))
    return np.stack([normal, first, _unit(np.cross(normal, first))], axis=1)


def _adapt(frames: Array, supports: _Supports, nodes: IntArray) -> tuple[Array, BoolArray]:
    """Turn tangents to what the supports leave free, and mark rows that depend on a row before them."""
    frames = frames.copy()
    held, count = supports.directions[nodes], supports.count[nodes]
    normal = frames[:, 0]
    if frames.shape[1] == 3:
        across = np.cross(held[:, 0], normal)
        single = (count == 1) & (np.linalg.norm(across, axis=1) > _DEPENDENT)
        last = _unit(across[single])
        frames[single, 1:] = np.stack([np.cross(last, normal[single]), last], axis=1)
        way = np.cross(held[:, 0], held[:, 1])
        double = (count == 2) & (np.abs(np.einsum("kd,kd->k", way, normal)) <= _DEPENDENT)
        first = _unit(way[double])
        frames[double, 1:] = np.stack([first, np.cross(normal[double], first)], axis=1)
    movable = _movable(frames, held)
    rest = movable.copy()
    blocked = np.zeros(frames.shape[:2], dtype=bool)
    for c in range(frames.shape[1]):
        size = np.linalg.norm(rest[:, c], axis=1)
        independent = size > _DEPENDENT
        blocked[:, c] = ~independent & (np.linalg.norm(movable[:, c], axis=1) > _DEPENDENT)
        unit = np.where(independent[:, None], rest[:, c] / np.where(independent, size, 1.0)[:, None], 0.0)
        rest -= np.einsum("kcd,kd->kc", rest, unit)[:, :, None] * unit[:, None, :]
    return frames, blocked


def _movable(vectors: Array, held: Array) -> Array:
    """Part of vectors (k, c, d) orthogonal to the orthonormal rows of held (k, q, d), which may be zero."""
    along = np.einsum("kcd,kqd->kcq", vectors, held)
    return np.asarray(vectors - np.einsum("kcq,kqd->kcd", along, held))


def _free_directions(supports: _Supports, groups: list[_ContactGroup]) -> tuple[Array, BoolArray]:
    """Orthonormal directions at every node, shape (nodes, d, d), and which of them are free, shape "
    "(nodes, d)."""
    count, dim = supports.nodes.shape
    directions = np.broadcast_to(np.eye(dim), (count, dim, dim)).copy()
    taken = np.zeros(count, dtype=bool)
    for group in groups:
        if group.nodes is not None:
            new = ~taken[group.nodes]
            directions[group.nodes[new]] = group.frames[new]
            taken[group.nodes] = True
    free = np.broadcast_to((supports.count == 0)[:, None], (count, dim)).copy()
    partly = np.flatnonzero((supports.count > 0) & (supports.count < dim))
    if len(partly):
        rest = _movable(directions[partly], supports.directions[partly])
        wanted = dim - supports.count[partly]
        chosen = np.zeros(rest.shape)
        used = np.zeros((len(partly), dim), dtype=bool)
        every = np.arange(len(partly))
        for step in range(dim - 1):
            size = np.where(used, -1.0, np.linalg.norm(rest, axis=2))
            pick = np.argmax(size >= (1 - 1e-9) * size.max(axis=1, keepdims=True), axis=1)
            active = step < wanted
            unit = np.zeros((len(partly), dim))
            unit[active] = _unit(rest[every[active], pick[active]])
            chosen[every[active], pick[active]] = unit[active]
            used[every[active], pick[active]] = True
            rest -= np.einsum("kcd,kd->kc", rest, unit)[:, :, None] * unit[:, None, :]
        directions[partly], free[partly] = chosen, used
    return directions, free


def _basis(directions: Array, free: BoolArray) -> sp.csr_array:
    """The matrix P, shape (nodes * d, n); its columns are the free directions, node by node."""
    count, dim = free.shape
    node, slot = np.nonzero(free)
    data = directions[node, slot]
    rows = node[:, None] * dim + np.arange(dim)
    columns = np.broadcast_to(np.arange(len(node))[:, None], rows.shape)
    keep = data != 0.0
    return sp.csr_array((data[keep], (rows[keep], columns[keep])), shape=(count * dim, len(node)))


def _reduce(matrix: sp.csr_array, basis: sp.csr_array) -> sp.csr_array:
    """``P' K P``; where every column of P has one entry, rows and columns are picked instead."""
    size = basis.shape[1]
    if basis.nnz == size:
        picked = basis.tocoo()
        dof, sign = np.empty(size, dtype=np.int64), np.empty(size)
        dof[picked.col], sign[picked.col] = picked.row, picked.data
        reduced = matrix[dof][:, dof].tocsr()
        if np.any(sign != 1.0):
            rows = np.repeat(np.arange(size), np.diff(reduced.indptr))
            reduced.data *= sign[rows] * sign[reduced.indices]
    else:
        reduced = (basis.T @ matrix @ basis).tocsr()
    reduced.sort_indices()
    return sp.csr_array(reduced)


@dataclass(frozen=True, eq=False)
class JoinedContact:
    """Contact points of all boundaries that can move.

    ``kept`` are their numbers among all points; ``energy`` is that of the points that supports hold;
    ``without_friction`` tells where friction of the law had to be left out.
    """

    trace: sp.csr_array
    weights: Array
    offset: Array
    points: Array
    frames: Array
    law: ContactLaw
    energy: float
    kept: IntArray
    without_friction: BoolArray


def _join(groups: list[_ContactGroup], basis: sp.csr_array, prescribed: Array, dim: int) -> JoinedContact:
    """Contact points of all boundaries in terms of the unknowns; points held entirely are dropped."""
    if not groups:
        return _empty_contact(basis.shape[1], dim)
    weights = np.concatenate([group.weights for group in groups])
    frames = np.concatenate([group.frames for group in groups])
    points = np.concatenate([group.points for group in groups])
    blocked = np.concatenate([group.blocked for group in groups])
    rough = np.concatenate([_rough(group.law, len(group.weights)) for group in groups])
    without = rough & blocked[:, 1:].any(axis=1)
    law = ContactLaw.concatenate([(group.law, len(group.weights)) for group in groups])
    average = sp.csr_array(sp.vstack([group.average for group in groups]))
    full = _local_components(average, frames)
    offset = -(full @ prescribed).reshape(-1, dim)
    offset[:, 0] += np.concatenate([group.gap for group in groups])
    offset[blocked] = 0.0

    trace = sp.csr_array(full @ basis)
    rows = np.repeat(np.arange(trace.shape[0]), np.diff(trace.indptr))
    trace.data[(np.abs(trace.data) < _ZERO) | blocked.ravel()[rows]] = 0.0
    whole = np.abs(np.abs(trace.data) - 1.0) < 1e-14
    trace.data[whole] = np.sign(trace.data[whole])
    trace.eliminate_zeros()
    trace.sort_indices()

    moving = np.diff(trace.indptr).reshape(-1, dim).any(axis=1)
    energy = 0.0
    if not moving.all():
        held = np.flatnonzero(~moving)
        values = law.take(held).frozen_at(-offset[held]).value(-offset[held])
        if not np.all(np.isfinite(values)):
            bad = int(held[np.flatnonzero(~np.isfinite(values))[0]])
            raise SupportError(
                f"the supports hold the contact point x = {_vector(points[bad])} at penetration "
                f"{-offset[bad, 0]:.3g}, which its law forbids; change the support or the gap"
            )
        energy = float(weights[held] @ np.broadcast_to(values, held.shape))
    keep = np.flatnonzero(moving)
    if len(keep) == 0:
        empty = _empty_contact(basis.shape[1], dim)
        return replace(empty, energy=energy)
    rows_kept = (keep[:, None] * dim + np.arange(dim)).ravel()
    return JoinedContact(
        sp.csr_array(trace[rows_kept]), weights[keep], offset[keep], points[keep], frames[keep],
        law if moving.all() else law.take(keep), energy, keep, without[keep],
    )  # fmt: skip


def _rough(law: ContactLaw, count: int) -> BoolArray:
    """Where a law has friction, or may have it in some state."""
    if law.state_dependent:
        return np.ones(count, dtype=bool)
    return np.broadcast_to(law.friction.bounds > 0.0, (count,))


def _refuse_dependent(contact: JoinedContact, groups: list[_ContactGroup], names: list[str]) -> None:
    """Refuse contact points whose displacements depend on one another, as midpoints between held ends do."""
    rows = np.flatnonzero(np.diff(contact.trace.indptr))
    if not rows.size:
        return
    trace = sp.csr_array(contact.trace[rows])
    _, part = sp.csgraph.connected_components(sp.csr_array(abs(trace) @ abs(trace).T), directed=False)
    count = np.bincount(part)
    used = sp.csc_array(trace)
    owner = part[used.indices[used.indptr[:-1][np.diff(used.indptr) > 0]]]
    short = np.bincount(owner, minlength=len(count)) < count
    first = int(np.argmax(short[part])) if short.any() else _singular_row(sp.csc_array(trace @ trace.T))
    if first < 0:
        return
    point = int(contact.kept[rows[first] // contact.points.shape[1]])
    group = int(np.searchsorted(np.cumsum([len(one.weights) for one in groups]), point, side="right"))
    raise ProblemError(
        f"contact '{names[group]}': its midpoints have more pressures than displacements can tell apart, for both ends "
        f"of the boundary are held, or it is closed; take quadrature 'nodal', or leave the facets at one end out"
    )


def _singular_row(gram: sp.csc_array) -> int:
    """A row at which a Gram matrix is singular, -1 if it is not."""
    from scipy.sparse.linalg import splu

    try:
        pivots = np.abs(splu(gram, diag_pivot_thresh=0.0, options={"SymmetricMode": True}).U.diagonal())
    except RuntimeError:
        return 0
    return int(np.argmin(pivots)) if pivots.min() <= 1e-12 * pivots.max() else -1


def _empty_contact(unknowns: int, dim: int) -> JoinedContact:
    return JoinedContact(
        sp.csr_array((0, unknowns)), np.zeros(0), np.zeros((0, dim)), np.zeros((0, dim)), np.zeros((0, dim,
        dim)), ContactLaw(NoContact()).at(None), 0.0, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=bool),
    )  # fmt: skip


def _local_components(average: sp.csr_array, frames: Array) -> sp.csr_array:
    """Local components of the averaged displacement: rows ``j d + c``, columns ``node d + i``."""
    count, dim = frames.shape[:2]
    entries = average.tocoo()
    component, axis = np.meshgrid(np.arange(dim), np.arange(dim), indexing="ij")
    rows = entries.row[:, None, None] * dim + component
    columns = entries.col[:, None, None].astype(np.int64) * dim + axis
    data = entries.data[:, None, None] * frames[entries.row]
    shape = (count * dim, average.shape[1] * dim)
    return sp.csr_array((data.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def _vector(values: Array) -> str:
    return "(" + ", ".join(f"{value + 0.0:.6g}" for value in values) + ")"
