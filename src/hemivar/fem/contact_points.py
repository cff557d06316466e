"""Contact points (collocation at nodes or midpoints, trace operator B): from the boundaries of a statement."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.basics.arrays import LARGEST, ROUNDED, SAME
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.errors import ProblemError, SupportError
from hemivar.fem.bulge import arcs_of_pair, bulge
from hemivar.fem.contact_basis import contact_weights, seen_gap, seen_values
from hemivar.fem.mortar import Mortar, mortar
from hemivar.fem.mortar_basis import OWN
from hemivar.fem.pairing import Pairing, paired
from hemivar.fem.supports import DEPENDENT, SHARP, Supports, in_words, movable, unit
from hemivar.laws import ContactLaw, NoContact, VectorLaw, join_laws
from hemivar.laws.vector_law import frozen_at
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.foundation import Contact, Side
from hemivar.mechanics.instants import error_context
from hemivar.mechanics.obstacles import Normals, obstacle_contact
from hemivar.mechanics.statement import ContactProblem, Geometry, Quadrature
from hemivar.mesh.boundary_rule import BoundaryRule, boundary_rule
from hemivar.mesh.mesh import Mesh

__all__ = [
    "BoundaryContact",
    "adapted",
    "area_contacts",
    "boundary_contact",
    "contacts_of_one",
    "frames_of",
    "join",
    "local_components",
    "merge_corners",
    "pair_projection",
    "refuse_dependent",
    "seen_apart",
    "shares",
    "without_followers",
]

#: What rounding makes of a gap, and may put a held point beyond the end of a law by, of the size of the mesh or the
#: largest value; and what that of coordinates makes of it.
_ROUNDED, _EPSILONS = 1e-12, 8.0 * np.finfo(float).eps
#: Degrees between facets that a projection can bear.
_TURNED = 30.0


@dataclass(frozen=True, eq=False)
class BoundaryContact:
    """Contact points of one boundary with their law, before the supports take effect."""

    points: ContactPoints  # with the trace of nodal values (nodes * c,)
    gap: Array  # (m,)
    belt: Array  # (m, d): displacement of the foundation, of which the tangential part counts
    law: VectorLaw
    blocked: BoolArray  # (m, components): rows that supports or another boundary make dependent on a row before
    pair: bool = False  # whether another body is touched, and no foundation
    warnings: tuple[str, ...] = ()

    @property
    def apart(self) -> bool:
        """Whether its points are at nodes and see more than what these do."""
        mean = self.points.mean
        return self.pair or (mean is not None and mean.nnz > len(self.gap) and bool((self.points.node >= 0).all()))

    def take(self, index: IntArray) -> BoundaryContact:
        """The contact points of the given numbers."""
        return replace(
            self,
            points=self.points.take(index),
            gap=self.gap[index],
            belt=self.belt[index],
            law=self.law.take(index),
            blocked=self.blocked[index],
        )


def boundary_contact(problem: ContactProblem, name: str, supports: Supports) -> BoundaryContact:
    """The contact points of a boundary; rows of their trace are taken of nodal displacements (nodes * d,)."""
    mesh, order, contact = problem.mesh, problem.order, problem.contact[name]
    if contact.against:
        return _pair(problem, name, supports)
    rule = boundary_rule(mesh, name, order)
    count, dim = supports.nodes.shape
    if problem.quadrature is Quadrature.NODAL:
        nodes, normal = _nodal_normals(problem, name, rule, supports)
        weights, none = contact_weights(mesh, rule, problem.kinematics)
        seen = ~none[nodes]
        if not seen.any():
            raise ProblemError(
                f"contact boundary '{name}' lies on the axis of the body of revolution, where nothing can touch it; "
                "name another boundary"
            )
        nodes, normal = nodes[seen], normal[seen]
        weights = weights[nodes]
        average, facet, points = _seen(mesh, order, nodes, supports), np.full(len(nodes), -1), supports.nodes[nodes]
    else:
        number, share = len(rule.facets), shares(order, dim)
        nodes, facet = np.full(number, -1), np.arange(number)
        rows = np.repeat(facet, share.size)
        average = sp.csr_array((np.tile(share, number), (rows, rule.nodes.ravel())), shape=(number, count))
        normal, weights, points = unit(rule.normals), rule.weights, mesh.points[rule.facets].mean(axis=1)
    if contact.obstacle is None:
        gap = _stated_gap(problem, average, nodes, points, f"gap of contact '{name}'", contact.gap)
    else:
        assert contact.normals is not None
        places = points + _to_arcs(problem, name, nodes)
        normal, gap = obstacle_contact(contact.obstacle, contact.normals, places, normal, f"contact '{name}'")
        alone = np.diff(average.indptr) == 1
        gap = seen_gap(mesh, order, nodes, alone, gap, np.hstack([places, normal]), _gaps_along(contact))
        meets = np.isfinite(gap)
        if not meets.all():
            with error_context(f"contact '{name}'", contact.normal, contact.friction):
                law = contact.law.at(points[~meets])
            _check_never_touching(law, name, points[~meets])
            average, normal, points = sp.csr_array(average[meets]), normal[meets], points[meets]
            weights, gap, nodes, facet = weights[meets], gap[meets], nodes[meets], facet[meets]
    belt = DataField(contact.belt, f"belt of contact '{name}'", dim).at(points)
    frames = frames_of(normal)
    blocked = np.zeros((len(points), dim), dtype=bool)
    if problem.quadrature is Quadrature.NODAL:
        frames, blocked = adapted(frames, supports.directions[nodes], supports.count[nodes])
        blocked |= _fixed_alone(average, nodes, frames, supports)
    names = tuple(problem.contact)
    boundary = np.full(len(points), names.index(name))
    trace = local_components(average, frames)
    contact_points = ContactPoints(trace, weights, points, frames, nodes, facet, boundary, names, mean=average)
    with error_context(f"contact '{name}'", contact.normal, contact.friction):
        return BoundaryContact(contact_points, gap, belt, contact.law.at(points), blocked)


def _seen(mesh: Mesh, order: int, nodes: IntArray, supports: Supports) -> sp.csr_array:
    """What contact points at nodes (k,) see; where supports hold all of it the node alone, whose law must bear it."""
    average, free = seen_values(mesh, order, nodes), (supports.count < mesh.dim).astype(float)
    moves = (abs(average) @ free > 0.0).astype(float)
    alone = sp.csr_array((1.0 - moves, (np.arange(len(nodes)), nodes)), shape=average.shape)
    matrix = sp.csr_array(sp.diags_array(moves) @ average + alone)
    matrix.eliminate_zeros()
    return matrix


def _stated_gap(
    problem: ContactProblem, average: sp.csr_array, nodes: IntArray, points: Array, where: str, value: object
) -> Array:
    """A gap or level as contact sees it at nodes (k,), or that at points (k, d) of facets."""
    field = DataField(value, where)
    gap = field.at(points)
    _refuse_beyond(gap, where, "unit" if problem.kind else "unit of length")
    if field.alike:
        return gap
    return seen_gap(problem.mesh, problem.order, nodes, np.diff(average.indptr) == 1, gap, points, field.at)


def _gaps_along(contact: Contact) -> Callable[[Array], Array]:
    """The gap (q,) of an obstacle by places and normals of a body side by side, (q, 2 d)."""
    obstacle = contact.obstacle
    assert obstacle is not None
    if contact.normals is not Normals.BODY:
        return lambda rows: obstacle.distance(np.hsplit(rows, 2)[0])
    return lambda rows: obstacle.along(np.hsplit(rows, 2)[0], unit(np.hsplit(rows, 2)[1]))


def _to_arcs(problem: ContactProblem, name: str, nodes: IntArray) -> Array:
    """Ways (k, d) from nodes to the arcs that the facets of a boundary stand for, of quadratic tetrahedra."""
    mesh, offsets = problem.mesh, np.zeros((len(nodes), problem.mesh.dim))
    if problem.order == 2 and mesh.dim == 3 and problem.geometry is Geometry.CURVED:
        offsets[np.searchsorted(nodes, boundary_rule(mesh, name, 2).nodes)] = bulge(mesh, name).arcs
    return offsets


def _fixed_alone(average: sp.csr_array, nodes: IntArray, frames: Array, supports: Supports) -> BoolArray:
    """Directions (k, d) in which supports hold the node of a contact point, and not the others that it sees."""
    entries = average.tocoo()
    moves = np.linalg.norm(movable(frames[entries.row], supports.directions[entries.col]), axis=2) > DEPENDENT
    own = entries.col == nodes[entries.row]
    fixed = np.zeros(frames.shape[:2], dtype=bool)
    fixed[entries.row[own]] = ~moves[own]
    others = np.zeros(fixed.shape, dtype=bool)
    np.logical_or.at(others, entries.row, moves)
    return fixed & others


def _nodal_normals(
    problem: ContactProblem, name: str, rule: BoundaryRule, supports: Supports, share: Array | float = 1.0
) -> tuple[IntArray, Array]:
    """Nodes (k,) of facets, and unit normals (k, d) there: see :meth:`BoundaryRule.summed_normals`."""
    nodes, number, summed = rule.summed_normals(share)
    size = np.bincount(number, np.broadcast_to(rule.weights[:, None] * share, rule.nodes.shape).ravel())
    # on the axis of a body of revolution the other half of the section is the mirror image
    middle = problem.kinematics.on_axis(supports.nodes)[nodes] & (np.abs(summed[:, 1]) > np.abs(summed[:, 0]))
    summed[middle, 0] = 0.0
    fold = np.linalg.norm(summed, axis=1) <= 1e-8 * size
    if fold.any():
        bad = int(nodes[np.flatnonzero(fold)[0]])
        raise ProblemError(
            f"contact boundary '{name}' folds back on itself at node {bad}, x = "
            f"{in_words(supports.nodes[bad])}, so it has no normal there; split it into two boundaries"
        )
    return nodes, unit(summed)


def pair_projection(problem: ContactProblem, name: str, supports: Supports) -> tuple[Mortar, Array]:
    """The mortar projection of a contact of two bodies, and the normals (m, d) of the slave at its nodes.

    Normals are those of the facets that meet the master.
    """
    title, sides = _called(problem, name), problem.pair(name)
    pieces = _facing(problem, sides, title)
    touching, away = np.flatnonzero(pieces.touches), pieces.beyond_corners
    counted = pieces.covered[touching, None] * ~away[touching]
    nodes, normal = _nodal_normals(problem, sides[0], pieces.sides[0].take(touching), supports, counted)
    free = movable(normal[:, None], supports.directions[nodes])[:, 0]
    fixed = np.zeros(len(supports.nodes), dtype=bool)
    fixed[nodes] = np.linalg.norm(free, axis=1) <= DEPENDENT
    given_up = np.flatnonzero(pieces.touches & away.all(axis=1))
    pieces = replace(pieces, lost=np.union1d(pieces.lost, given_up))
    projection = mortar(problem.mesh, pieces, away | fixed[pieces.sides[0].nodes], problem.kinematics)
    if not projection.nodes.size:
        raise ProblemError(f"{title}: supports hold all nodes of '{sides[0]}'; give slave = '{sides[1]}'")
    return projection, normal[np.searchsorted(nodes, projection.nodes)]


def _facing(problem: ContactProblem, sides: tuple[str, str], title: str) -> Pairing:
    slave, master = (boundary_rule(problem.mesh, side, problem.order) for side in sides)
    return paired(problem.mesh, (slave, master), title)


def _called(problem: ContactProblem, name: str) -> str:
    return f"contact '{name}' against '{problem.contact[name].against}'"


def _pair(problem: ContactProblem, name: str, supports: Supports) -> BoundaryContact:
    """The contact points of two bodies: nodes of the slave, with the jump that the mortar projection gives."""
    contact, title = problem.contact[name], _called(problem, name)
    projection, normal = pair_projection(problem, name, supports)
    points = supports.nodes[projection.nodes]
    stated = _stated_gap(problem, projection.jump, projection.nodes, points, f"gap of {title}", contact.gap)
    arcs = arcs_of_pair(problem, name, projection, normal, title)
    nodes = supports.nodes - points[0]
    apart = arcs.apart - np.einsum("kd,kd->k", normal, projection.jump @ nodes)
    rounding = _ROUNDED * np.abs(nodes).max() + _EPSILONS * np.abs(supports.nodes).max()
    apart[np.abs(apart) <= rounding] = 0.0  # a rigid law would be met beyond its end
    fixed = supports.directions[projection.nodes]
    frames, blocked = adapted(frames_of(normal), fixed, supports.count[projection.nodes])
    moves = np.linalg.norm(movable(frames, fixed), axis=2) > DEPENDENT
    names, count = tuple(problem.contact), len(points)
    trace, boundary = local_components(projection.jump, frames), np.full(count, names.index(name))
    kept = moves.ravel()
    kept[~kept] = seen_apart(sp.csr_array(trace[~kept]), np.repeat(supports.count == 0, supports.nodes.shape[1]))
    trace = sp.csr_array(sp.diags_array(kept.astype(float)) @ trace)
    pairs = {name: problem.pair(name)}
    at = ContactPoints(
        trace,
        projection.weights,
        points,
        frames,
        projection.nodes,
        boundary=boundary,
        names=names,
        mean=projection.jump,
        pairs=pairs,
    )
    warnings = _pair_warnings(title, arcs.overlap(apart, problem, name, projection), supports.nodes, projection.turned)
    warnings += _lost(title, supports.nodes, projection.pieces)
    with error_context(title, contact.normal, contact.friction):
        law, still = contact.law.at(points), np.zeros(points.shape)
        return BoundaryContact(at, stated + apart, still, law, blocked, True, (*warnings, *arcs.warnings))


def seen_apart(rows: sp.csr_array, free: BoolArray) -> BoolArray:
    """Of directions (k,) in which supports hold the slave: those whose jump sees the master, each its own part of it.

    Friction acts there between the master and the slave that is held.  Without it the master would miss that share of
    a shear that goes through.
    """
    seen, independent = sp.csc_array(rows[:, free]), np.zeros(rows.shape[0], dtype=bool)
    seen = seen[:, np.diff(seen.indptr) > 0]
    if min(seen.shape):
        _, corner, order = la.qr(seen.toarray().T, mode="economic", pivoting=True)
        size = np.abs(np.diagonal(corner))
        independent[order[: size.size][size > OWN]] = True
    return independent


def _pair_warnings(title: str, overlap: float, nodes: Array, turned: float) -> tuple[str, ...]:
    warnings = []
    if overlap > SAME * float(np.ptp(nodes, axis=0).max()):
        warnings.append(
            f"{title}: the meshes overlap by up to {overlap:.3g}, which is taken for an interference; if it is not "
            "meant, move one of the bodies"
        )
    if turned > _TURNED:
        warnings.append(
            f"{title}: facets that touch are up to {turned:.0f} degrees from parallel; beyond {_TURNED:.0f} degrees "
            "the projection of one on the other is inaccurate: refine both boundaries there"
        )
    return tuple(warnings)


def _lost(title: str, nodes: Array, pieces: Pairing) -> tuple[str, ...]:
    """A sentence on facets of the slave that do not touch what their normals meet, where there are some."""
    if not len(pieces.lost):
        return ()
    point = in_words(nodes[pieces.sides[0].facets[pieces.lost[0]]].mean(axis=0))
    return (
        f"{title}: facets do not touch what their normals meet, {len(pieces.lost)} of them, the first at x = {point}; "
        "another part of the mesh is in between, the overlap is deeper than the body, or their corners belong to "
        "nearer sides: name the boundary that they meet first, or move one of the bodies",
    )


# ---- areas, and one component -----------------------------------------------------------------------------


def area_contacts(problem: ContactProblem, supports: Supports, others: list[BoundaryContact]) -> list[BoundaryContact]:
    """The contact points of areas of a plane body: nodes that slide, with two tangents and no normal."""
    nodes, dim = supports.nodes, problem.mesh.dim
    names, free = tuple(problem.contact), supports.count < dim
    beside = [group.points for group in others if group.points.count]
    taken = [(points.names[points.boundary[0]], np.unique(points.seen // dim)) for points in beside]
    groups = []
    for site in _sites(problem, len(nodes), list(problem.areas)):
        for name, own in taken:
            _refuse_shared(name, own, site, nodes, free)
        contact, at, count = site.contact, nodes[site.nodes], len(site.nodes)
        frames = np.zeros((count, dim + 1, dim))
        frames[:, 1:] = _tangents(supports, site.nodes)
        with error_context(f"contact '{site.name}'", contact.normal, contact.friction):
            law = contact.law.at(at)
        mean = seen_values(problem.mesh, 1, site.nodes)
        boundary = np.full(count, names.index(site.name))
        trace = local_components(mean, frames)
        points = ContactPoints(trace, site.weights, at, frames, site.nodes, boundary=boundary, names=names, mean=mean)
        belt = DataField(contact.belt, f"belt of contact '{site.name}'", dim).at(at)
        groups.append(BoundaryContact(points, np.zeros(count), belt, law, np.zeros((count, dim + 1), dtype=bool)))
    return groups


def _tangents(supports: Supports, nodes: IntArray) -> Array:
    """Axes (k, 2, 2) at nodes of the plane; where a support holds one direction it is the second of them."""
    axes = np.broadcast_to(np.eye(2), (len(nodes), 2, 2)).copy()
    once = np.flatnonzero(supports.count[nodes] == 1)
    fixed = supports.directions[nodes[once], 0]
    axes[once] = np.stack([np.column_stack([fixed[:, 1], -fixed[:, 0]]), fixed], axis=1)
    return axes


def contacts_of_one(
    problem: ContactProblem, supports: Supports, known: Mapping[str, BoundaryContact]
) -> list[BoundaryContact]:
    """The contact points of each boundary and area: nodes, with the lumped weights of boundary or area.

    Where two bodies touch they are the nodes of the slave, with the jump that the mortar projection gives: the value on
    the boundary that states the contact less that on the other one.  ``known`` are such points that are known.

    A law of the penetration has one local component. If any law is friction, contact points have two: friction acts on
    the second one, laws of the penetration on the first, and the other one is not there.
    """
    nodes = supports.nodes
    pairs = [name for name, contact in problem.contact.items() if contact.against]
    boundaries = [name for name in problem.contact if name not in problem.areas and name not in pairs]
    sites = _sites(problem, len(nodes), boundaries) + _sites(problem, len(nodes), list(problem.areas))
    for first in sites[: len(boundaries)]:
        for second in sites[len(boundaries) :]:
            _refuse_shared(first.name, first.nodes, second, nodes, supports.count == 0)
    names = (*(site.name for site in sites), *pairs)
    taken = np.zeros(len(nodes), dtype=bool)
    for site in sites:
        taken[site.nodes] = True
    sites += [_joint(problem, name, supports.count > 0, taken) for name in pairs if name not in known]
    components = 2 if any(contact.rubs for contact in problem.contact.values()) else 1
    groups = dict(known)
    for site in sites:
        contact, at, count = site.contact, nodes[site.nodes], len(site.nodes)
        where = f"level of contact '{site.name}'"
        sign = 1.0 if contact.side is Side.ABOVE and (site.sides is None or site.sides[0] == site.name) else -1.0
        with error_context(f"contact '{site.name}'", contact.normal, contact.friction):
            law = contact.law.at(at)
        column = int(contact.rubs)
        mean = seen_values(problem.mesh, problem.order, site.nodes) if site.jump is None else site.jump
        level = _stated_gap(problem, mean, site.nodes, at, where, contact.gap)
        entries = mean.tocoo()
        rows = entries.row * components + column
        trace = sp.csr_array((sign * entries.data, (rows, entries.col)), shape=(count * components, len(nodes)))
        points = ContactPoints(
            trace, site.weights, at, node=site.nodes, boundary=np.full(count, names.index(site.name)), names=names,
            mean=mean,
            pairs={site.name: site.sides} if site.sides else {},
        )  # fmt: skip
        offset = np.zeros((count, components))
        offset[:, column] = sign * level
        blocked = np.zeros((count, components), dtype=bool)
        pair = site.sides is not None
        groups[site.name] = BoundaryContact(points, offset[:, 0], offset[:, 1:], law, blocked, pair, site.warnings)
    return [groups[name] for name in names]


@dataclass(frozen=True, eq=False)
class _Site:
    """The nodes of one contact, with their weights; of two bodies the slave and the master, and the jump there."""

    name: str
    contact: Contact
    nodes: IntArray
    weights: Array
    sides: tuple[str, str] | None = None
    jump: sp.csr_array | None = None
    warnings: tuple[str, ...] = ()


def _joint(problem: ContactProblem, name: str, fixed: BoolArray, taken: BoolArray) -> _Site:
    """The nodes of the slave of two bodies.

    ``fixed (nodes,)`` are those whose values supports prescribe, ``taken (nodes,)`` those of contact with foundations:
    both leave the joint to the nodes beside them, where there are some.
    """
    mesh, sides, title = problem.mesh, problem.pair(name), _called(problem, name)
    slave = mesh.boundaries[sides[0]]
    if fixed[slave].all(axis=1).any():
        raise ProblemError(
            f"{title}: supports prescribe the values along facets of '{sides[0]}'; prescribe them on a smaller "
            f"boundary, or give slave = '{sides[1]}' if they do so there alone"
        )
    without, alone = fixed | taken, slave[(fixed | taken)[slave].all(axis=1)]
    without[alone] = fixed[alone]
    pieces = _facing(problem, sides, title)
    projection = mortar(mesh, pieces, without[pieces.sides[0].nodes], problem.kinematics)
    warnings = _lost(title, problem.mesh.points, projection.pieces)
    return _Site(name, problem.contact[name], projection.nodes, projection.weights, sides, projection.jump, warnings)


def _sites(problem: ContactProblem, count: int, names: list[str]) -> list[_Site]:
    """Contacts on boundaries, or over areas; a node of two of them belongs to the first entirely."""
    sites: list[_Site] = []
    for name in names:
        summed = _weights(problem, name, count)
        for k, other in enumerate(sites):
            sites[k] = replace(other, weights=other.weights + summed[other.nodes])
            summed[other.nodes] = 0.0
        nodes = np.flatnonzero(summed)
        if not len(nodes):
            raise ProblemError(f"every node of contact '{name}' belongs to another one; join the two")
        sites.append(_Site(name, problem.contact[name], nodes, np.asarray(summed[nodes], dtype=float)))
    return sites


def _weights(problem: ContactProblem, name: str, count: int) -> Array:
    """The weights (nodes,) of all nodes in a contact on a boundary or over an area."""
    mesh = problem.mesh
    if name not in problem.areas:
        return contact_weights(mesh, boundary_rule(mesh, name, problem.order), problem.kinematics)[0]
    cells, often = problem.areas[name], mesh.dim + 1
    parts = np.repeat(mesh.volumes[cells] * (1.0 / often), often)
    return np.asarray(np.bincount(mesh.cells[cells].ravel(), parts, count), dtype=float)


def _refuse_shared(boundary: str, own: IntArray, area: _Site, nodes: Array, free: BoolArray) -> None:
    """Refuse contact over an area at free nodes of a contact boundary: two laws would act on one unknown."""
    shared = np.intersect1d(own, area.nodes)
    shared = shared[free[shared]]
    if len(shared):
        raise ProblemError(
            f"contacts '{boundary}' (boundary) and '{area.name}' (area) share {len(shared)} nodes, the first at x = "
            f"{in_words(nodes[shared[0]])}; restrict the area to a region without the cells at '{boundary}'"
        )


# ---- boundaries together ----------------------------------------------------------------------------------


def shares(order: int, dim: int) -> Array:
    """Shares of the nodes of a facet in its measure, vertices first."""
    if order == 1:
        return np.full(dim, 1 / dim)
    return np.array([1 / 6, 1 / 6, 4 / 6] if dim == 2 else [0.0, 0.0, 0.0, 1 / 3, 1 / 3, 1 / 3])


def _refuse_beyond(values: Array, where: str, unit: str) -> None:
    """Refuse places of a foundation whose products are no numbers."""
    if not (np.abs(values) < LARGEST).all():
        far = values[np.argmax(np.abs(values))]
        raise ProblemError(f"{where}: {far:g} is beyond the range of numbers; take another {unit}")


def _check_never_touching(law: VectorLaw, name: str, points: Array) -> None:
    """Refuse laws without opening where the body's normal misses the obstacle."""
    closed = np.broadcast_to(np.isfinite(law.penetrations.lower), len(points))
    if closed.any():
        point = in_words(points[int(np.flatnonzero(closed)[0])])
        raise ProblemError(
            f"contact '{name}': its law allows no opening, but the body's normal at x = {point} misses the obstacle; "
            f"take normals = 'obstacle' or a smaller contact boundary"
        )


def merge_corners(
    groups: list[BoundaryContact], supports: Supports, contacts: Mapping[str, Contact]
) -> list[BoundaryContact]:
    """Make the displacements of contact points independent at nodes of two boundaries (nodal quadrature)."""
    groups = _left_to_glue(groups, contacts)
    for later in range(1, len(groups)):
        for earlier in range(later):
            first, second = groups[earlier].points, groups[later].points
            assert first.frames is not None
            assert second.frames is not None
            _, mine, theirs = np.intersect1d(first.node, second.node, assume_unique=True, return_indices=True)
            if mine.size == 0:
                continue
            alike = np.einsum("kd,kd->k", first.frames[mine, 0], second.frames[theirs, 0]) > SHARP
            # A sharp corner touches both foundations with its normals; two frictions would share its unknowns.
            blocked, other_blocked = groups[earlier].blocked.copy(), groups[later].blocked.copy()
            blocked[mine[~alike], 1:] = True
            other_blocked[theirs[~alike], 1:] = True
            mine, theirs = mine[alike], theirs[alike]
            if groups[earlier].pair or groups[later].pair:
                mine = theirs = mine[:0]  # each sees nodes of its own on the other side
            if mine.size:
                weights, frames = first.weights.copy(), first.frames.copy()
                normal = first.frames[mine, 0] * first.weights[mine, None]
                normal += second.frames[theirs, 0] * second.weights[theirs, None]
                weights[mine] += second.weights[theirs]
                nodes = first.node[mine]
                frames[mine], blocked[mine] = adapted(
                    frames_of(unit(normal)), supports.directions[nodes], supports.count[nodes]
                )
                assert first.mean is not None
                trace = local_components(first.mean, frames)
                first = replace(first, trace=trace, weights=weights, frames=frames)
            groups[earlier] = replace(groups[earlier], points=first, blocked=blocked)
            rest = np.setdiff1d(np.arange(second.count), theirs)
            if rest.size == 0:
                raise ProblemError("every node of a contact boundary belongs to another one; join the two")
            groups[later] = replace(groups[later], blocked=other_blocked).take(rest)
    return groups


def without_followers(groups: list[BoundaryContact], nodes: list[IntArray]) -> list[BoundaryContact]:
    """Boundaries without the points at nodes that follow others: the nearest other has the weight of what leaves."""
    kept = []
    for group in groups:
        leaves = np.isin(group.points.node, np.concatenate([*nodes, np.zeros(0, dtype=np.int64)]))
        kept.append(_handed_on(group, leaves) if leaves.any() and not leaves.all() else group)
    return kept


def _left_to_glue(groups: list[BoundaryContact], contacts: Mapping[str, Contact]) -> list[BoundaryContact]:
    """Boundaries without the points at nodes where others hold or touch a second body, which need all displacements.

    Glue between bodies comes first, then their contact in its order, then foundations, which leave to glue alone: what
    leaves is left to the point beside it.  Friction that a pressure brings with it is no glue.
    """
    remaining = list(groups)

    def glues(k: int) -> bool:
        contact = contacts[groups[k].points.names[int(groups[k].points.boundary[0])]]
        coupled = contact.law is contact.normal
        return coupled or (contact.friction.acts and not contact.friction.state_dependent)

    pairs = sorted(
        (k for k, group in enumerate(groups) if group.pair), key=lambda k: (not groups[k].law.remembers, not glues(k))
    )
    for first, k in enumerate(pairs):
        keeps = remaining[k].points
        others = [other for other in range(len(groups)) if not groups[other].pair] if glues(k) else []
        for other in (*pairs[first + 1 :], *others):
            group = remaining[other]
            leaves = _shared(group.points, keeps) if group.pair else np.isin(group.points.node, keeps.node)
            if group.pair and leaves.all():
                raise ProblemError("every node of a contact boundary belongs to another one; join the two")
            if leaves.any() and not leaves.all():
                remaining[other] = _handed_on(group, leaves)
    return remaining


def _shared(points: ContactPoints, others: ContactPoints) -> BoolArray:
    """Which points (m,) of a pair see the jump of a point of another one: at its node, or at that on its other side.

    At a sharp corner each sees its own.
    """
    assert points.frames is not None
    assert others.frames is not None
    assert points.mean is not None
    assert others.mean is not None
    both = sp.coo_array(points.mean[:, others.node].multiply(others.mean[:, points.node].T))
    alike = np.abs(np.einsum("kd,kd->k", points.frames[both.row, 0], others.frames[both.col, 0])) > SHARP
    return np.asarray(np.isin(np.arange(points.count), both.row[alike & (np.abs(both.data) > DEPENDENT)]))


def _handed_on(group: BoundaryContact, leaves: BoolArray) -> BoundaryContact:
    """A boundary without some of its contact points, whose weights the nearest others have."""
    assert group.points.points is not None
    places, rest = group.points.points, np.flatnonzero(~leaves)
    with IMPORTS:
        from scipy.spatial import cKDTree
    nearest = rest[cKDTree(places[rest]).query(places[leaves])[1]]
    weights = group.points.weights + np.bincount(nearest, group.points.weights[leaves], group.points.count)
    return replace(group, points=replace(group.points, weights=weights)).take(rest)


def frames_of(normal: Array) -> Array:
    """Normal and tangents, shape (k, d, d): in 2D the tangent is the normal turned by +90 degrees."""
    if normal.shape[1] == 2:
        return np.stack([normal, np.column_stack([-normal[:, 1], normal[:, 0]])], axis=1)
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = unit(np.cross(axis, normal))
    return np.stack([normal, first, unit(np.cross(normal, first))], axis=1)


def adapted(frames: Array, fixed: Array, count: IntArray) -> tuple[Array, BoolArray]:
    """Turn tangents to what supports leave free, and mark rows that depend on a row before them.

    ``fixed (k, d, d)`` are orthonormal directions that supports hold, of which ``count (k,)`` are not zero.
    """
    frames = frames.copy()
    normal = frames[:, 0]
    if frames.shape[1] == 3:
        across = np.cross(fixed[:, 0], normal)
        single = (count == 1) & (np.linalg.norm(across, axis=1) > DEPENDENT)
        last = unit(across[single])
        frames[single, 1:] = np.stack([np.cross(last, normal[single]), last], axis=1)
        direction = np.cross(fixed[:, 0], fixed[:, 1])
        double = (count == 2) & (np.abs(np.einsum("kd,kd->k", direction, normal)) <= DEPENDENT)
        first = unit(direction[double])
        frames[double, 1:] = np.stack([first, np.cross(normal[double], first)], axis=1)
    free = movable(frames, fixed)
    rest = free.copy()
    blocked = np.zeros(frames.shape[:2], dtype=bool)
    for c in range(frames.shape[1]):
        size = np.linalg.norm(rest[:, c], axis=1)
        independent = size > DEPENDENT
        blocked[:, c] = ~independent & (np.linalg.norm(free[:, c], axis=1) > DEPENDENT)
        along = np.where(independent[:, None], rest[:, c] / np.where(independent, size, 1.0)[:, None], 0.0)
        rest -= np.einsum("kcd,kd->kc", rest, along)[:, :, None] * along[:, None, :]
    return frames, blocked


def join(
    groups: list[BoundaryContact], basis: sp.csr_array, prescribed: Array
) -> tuple[ContactPoints, Array, VectorLaw, float]:
    """Contact points of all boundaries in terms of the unknowns; points held entirely are dropped.

    Shapes: ``basis`` (nodes * c, n), ``prescribed`` (nodes * c,); returns ``offset`` (m, components). Returned:
    ``offset``: gap and way of the belt, less what supports prescribe; ``law``: at these points; ``energy``: that of the
    points that supports hold.
    """
    components = max(group.points.components for group in groups)
    laws = [(_turned(group), group.points.count) for group in groups]
    groups = [_widened(group, components) for group in groups]
    blocked = np.concatenate([group.blocked for group in groups])
    rough = np.concatenate([np.broadcast_to(group.law.rubs, (group.points.count,)) for group in groups])
    law = join_laws(laws)
    full = sp.csr_array(sp.vstack([group.points.trace for group in groups]))
    offset = np.concatenate([_foundation(group) for group in groups])
    moved = np.asarray(full @ prescribed).reshape(-1, components)
    rounding = _ROUNDED * max(float(np.abs(part).max()) for part in (offset, moved))
    offset -= moved
    offset[blocked] = 0.0

    trace = sp.csr_array(full @ basis)
    rows = np.repeat(np.arange(trace.shape[0]), np.diff(trace.indptr))
    small = np.abs(trace.data) < ROUNDED * np.abs(full.data).max(initial=0.0)
    trace.data[small | blocked.ravel()[rows]] = 0.0
    whole = np.abs(np.abs(trace.data) - 1.0) < 1e-14
    trace.data[whole] = np.sign(trace.data[whole])
    trace.eliminate_zeros()
    trace.sort_indices()

    points, means = [group.points for group in groups], [group.points.mean for group in groups]
    frames = [one.frames for one in points if one.frames is not None]
    pairs = {name: sides for one in points for name, sides in one.pairs.items()}
    contact = ContactPoints(
        trace,
        np.concatenate([one.weights for one in points]),
        np.concatenate([one.points for one in points if one.points is not None]),
        np.concatenate(frames) if frames else None,
        np.concatenate([one.node for one in points]),
        np.concatenate([one.facet for one in points]),
        np.concatenate([one.boundary for one in points]),
        names=groups[0].points.names,
        without_friction=rough & blocked[:, 1:].any(axis=1),
        mean=None if any(one is None for one in means) else sp.csr_array(sp.vstack(means)),
        pairs=pairs,
    )
    moving = np.diff(trace.indptr).reshape(-1, components).any(axis=1)
    if moving.all():
        return contact, offset, law, 0.0
    fixed, keep = np.flatnonzero(~moving), np.flatnonzero(moving)
    energy = _fixed_energy(contact.take(fixed), law.take(fixed), -offset[fixed], rounding)
    kept = law.take(keep) if len(keep) else ContactLaw(NoContact()).at(None)
    return contact.take(keep), offset[keep], kept, energy


def _widened(group: BoundaryContact, components: int) -> BoundaryContact:
    """The same contact points with more local components, along which nothing moves."""
    count, old = group.points.shape
    if old == components:
        return group
    trace = sp.coo_array(group.points.trace)
    point, row = np.divmod(trace.row, old)
    rows, size = point.astype(np.int64) * components + row, (count * components, trace.shape[1])
    wide = sp.csr_array((trace.data, (rows, trace.col)), shape=size)
    assert group.points.frames is not None
    frames = np.pad(group.points.frames, ((0, 0), (0, components - old), (0, 0)))
    points = replace(group.points, trace=wide, frames=frames)
    return replace(group, points=points, blocked=np.pad(group.blocked, ((0, 0), (0, components - old))))


def _foundation(group: BoundaryContact) -> Array:
    """Where the foundation stands in the frames of contact points, (m, components)."""
    frames = group.points.frames
    along = group.belt if frames is None else np.einsum("ktd,kd->kt", frames[:, 1:], group.belt)
    return np.column_stack([group.gap, along])


def _fixed_energy(contact: ContactPoints, law: VectorLaw, r: Array, rounding: float) -> float:
    """Energy of contact points that supports hold at penetration and slip (m, components)."""
    allowed = law.penetrations
    inside = np.clip(r[:, 0], allowed.lower, allowed.upper)
    r[:, 0] = np.where(np.abs(inside - r[:, 0]) <= rounding, inside, r[:, 0])
    values = np.broadcast_to(frozen_at(law, r).value(r), contact.count)
    if not np.all(np.isfinite(values)):
        bad = int(np.flatnonzero(~np.isfinite(values))[0])
        assert contact.points is not None
        raise SupportError(
            f"the supports hold the contact point x = {in_words(contact.points[bad])} at penetration {r[bad, 0]:.3g}, "
            f"which its law forbids (contact '{contact.names[contact.boundary[bad]]}'); change the support or the "
            "gap"
        )
    return float(contact.weights @ values)


def _turned(group: BoundaryContact) -> VectorLaw:
    """The law of a boundary with its directions in the frames of the contact points."""
    points = group.points
    if points.frames is None:
        return group.law
    with error_context(f"contact '{points.names[int(points.boundary[0])]}'"):
        return group.law.in_frames(points.frames)


def refuse_dependent(contact: ContactPoints) -> None:
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
    name = contact.names[int(contact.boundary[rows[first] // contact.components])]
    raise ProblemError(
        f"contact '{name}': midpoint quadrature has more pressures than displacements (the boundary is closed or "
        f"supported at both ends); take quadrature 'nodal', or leave out an end facet"
    )


def _singular_row(gram: sp.csc_array) -> int:
    """A row at which a Gram matrix is singular, -1 if it is not."""
    with IMPORTS:
        from scipy.sparse.linalg import splu

    try:
        pivots = np.abs(splu(gram, diag_pivot_thresh=0.0, options={"SymmetricMode": True}).U.diagonal())
    except RuntimeError:
        return 0
    return int(np.argmin(pivots)) if pivots.min() <= 1e-12 * pivots.max() else -1


def local_components(average: sp.csr_array, frames: Array) -> sp.csr_array:
    """Local components of the averaged displacement in frames (k, c, d): rows ``j c + i``, columns ``node d + i``."""
    count, local, dim = frames.shape
    entries = average.tocoo()
    component, axis = np.meshgrid(np.arange(local), np.arange(dim), indexing="ij")
    rows = entries.row[:, None, None] * local + component
    columns = entries.col[:, None, None].astype(np.int64) * dim + axis
    data = entries.data[:, None, None] * frames[entries.row]
    shape = (count * local, average.shape[1] * dim)
    return sp.csr_array((data.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
