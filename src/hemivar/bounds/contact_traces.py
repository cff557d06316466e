"""Where the body may touch: its local displacement and the law, at the points of a rule on every contact facet.

In the plane facets are cut at the kinks of the law and into a number of equal parts, in space into sixteen. A facet in
space that has kinks of the normal law inside is cut along their level sets, which are straight, in place of that.
On each part the rule is one of Gauss. Where a law couples opening and slip the corners of the part belong to it.
A local displacement that misses a kink by rounding is put there.

Quadratic traces that leave the domain of a rigid law between nodes are brought back by what they lack at midpoints.
On an edge with ends at distances p and q from the end of the domain, and its midpoint beyond the chord by b,

    (chord) + 4 b t (1 - t)  stays inside    if and only if    4 b <= min p / t + q / (1 - t) = (sqrt p + sqrt q)^2.

The function of the midpoint, which vanishes on all other edges, takes away what b is too large.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.bounds.body_data import BodyData
from hemivar.bounds.roundings import FREE, KINK
from hemivar.bounds.split_element import facet_mass
from hemivar.bounds.varying_gaps import gap_ranges
from hemivar.fem.contact_points import shares
from hemivar.fem.elements import shape_values
from hemivar.fem.quadrature import quadrature_rule
from hemivar.laws import ContactLaw, VectorLaw
from hemivar.laws.coupled.joined import join_laws
from hemivar.laws.scalar_graph import is_straight
from hemivar.laws.vector_law import frozen_at, lengths, snapped, splits
from hemivar.mechanics.conditions import DataField
from hemivar.mechanics.obstacles import obstacle_contact

__all__ = [
    "PART_RULES",
    "ContactTraces",
    "PartRule",
    "admissible_displacement",
    "beyond_domain",
    "contact_traces",
    "cut_triangle",
    "local_traces",
    "radial_parts",
]

#: Parts of an edge, and of each side of a triangle, besides those between kinks; of an edge with a quadratic trace, on
#: which the multiplier between force and law has kinks of its own, or with a curved law.
_PARTS, _MORE_PARTS = 4, 32
#: Kinks of the normal law inside a facet in space up to which it is cut along all of them.
_LEVELS = 24
#: Gap, over the extent of the body, where its normal misses the obstacle.
_FAR = 1e3


@dataclass(frozen=True, eq=False)
class PartRule:
    """A rule whose first d points are the corners; exact for the squares of what is linear on the part.

    On edges, where tractions may be quadratic, it is exact for the squares of those.
    """

    points: Array  # (n, d), barycentric
    weights: Array  # (n,), of sum 1

    @property
    def corners(self) -> int:
        """d."""
        return int(self.points.shape[1])


_INNER = 0.5 * (1.0 - 1.0 / np.sqrt(5.0))  # of the rule of Lobatto with four points
_MIDDLES = 0.5 * (1.0 - np.eye(3))
#: By dimension of the body.
PART_RULES: Mapping[int, PartRule] = MappingProxyType(
    {
        2: PartRule(
            np.array([[1.0, 0.0], [0.0, 1.0], [1.0 - _INNER, _INNER], [_INNER, 1.0 - _INNER]]),
            np.array([1.0, 1.0, 5.0, 5.0]) / 12.0,
        ),
        3: PartRule(np.vstack([np.eye(3), _MIDDLES]), np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0]) / 3.0),
    }
)


def cut_triangle(parts: int, rule: PartRule | None) -> tuple[Array, Array]:
    """Barycentric coordinates (q, 3) and weights (q,) of a rule on the parts of a triangle, by default of degree 4.

    That of degree 3 has negative weights, which may make squares with kinks too small.  The corners of the triangle are
    there, too.
    """
    point, weight = quadrature_rule(2, 4) if rule is None else (rule.points, rule.weights)
    points = []
    for i in range(parts):
        for j in range(parts - i):
            corner = np.array([[i, j], [i + 1, j], [i, j + 1]], dtype=float)
            points.append(point @ corner)
            if i + j < parts - 1:
                points.append(point @ np.array([[i + 1, j + 1], [i, j + 1], [i + 1, j]], dtype=float))
    at, shares = np.concatenate(points) / parts, np.tile(weight, parts**2) / parts**2
    if rule is None:  # the corners take no part in integrals, but constants must hold there too
        at = np.vstack([at, [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])
        shares = np.append(shares, np.zeros(3))
    return np.column_stack([1.0 - at.sum(axis=1), at]), shares


@dataclass(frozen=True, eq=False)
class ContactTraces:
    """Points of a rule on the contact facets."""

    data: BodyData
    #: Numbers of the facets.
    facets: IntArray  # (k,)
    #: Coordinates of the points on each facet.
    barycentric: Array  # (k, q, d)
    #: Values there of the functions of the nodes of the facet.
    shapes: Array  # (k, q, l)
    #: They sum to the measures of the facets, and are not negative. The corners of the facet, and along quadratic
    #: traces the places of extreme displacements, are there with none: constants of the law must hold there too.
    weights: Array  # (k, q)
    #: Normal and tangents at the points; one set for each facet where they are the same all over it.
    axes: Array  # (k, q or 1, d, d)
    #: Penetration and slip; what misses a kink by rounding is put there.
    local: Array  # (k, q, d)
    #: At the k q points; what depends on the state is taken there.
    law: VectorLaw
    #: The same as it was stated: what its constants are, and whether they are sampled.
    stated: VectorLaw
    #: By how much a penetration leaves the domain of the law, where it is more than rounding; it is cut off.
    beyond: float
    #: Whether a facet in space has more kinks of the normal law inside than it is cut along.
    uncut: BoolArray  # (k,)

    @property
    def rule(self) -> PartRule | None:
        """That of every part, of which the points are those of one part after the other; None where the law splits."""
        return None if splits(self.law) else PART_RULES[self.data.table.dim]

    @property
    def frames(self) -> Array:
        """Normal and tangents at the points, shape (k, q, d, d)."""
        return np.broadcast_to(self.axes, (*self.weights.shape, *self.axes.shape[2:]))

    @cached_property
    def loose(self) -> Array:
        """Projections (k, d, d) on the components that no support holds."""
        return np.asarray(np.eye(self.data.table.dim) - self.data.freed(self.facets))

    @cached_property
    def values(self) -> tuple[Array, Array]:
        """Of a law that splits, j of the penetration and of the size of the slip at the points, (k q,) each."""
        assert isinstance(self.law, ContactLaw)
        r = self.local.reshape(-1, self.local.shape[-1])
        return self.law.normal.value(r[:, 0]), self.law.tangential.value(lengths(r[:, 1:]))

    @cached_property
    def rough(self) -> ContactTraces:
        """The same facets with fewer points in space: to look for a choice, never to judge it."""
        if self.data.table.dim == 2 or self.weights.shape[1] <= len(cut_triangle(1, self.rule)[1]):
            return self
        traces = contact_traces(self.data, 1)
        assert traces is not None
        return traces

    def forces(self, moments: Array) -> Array:
        """Force of the foundation on the body, reversed, at the points: xi in local components, shape (k, q, d).

        ``moments`` is (F, l, d).
        """
        data = self.data
        left = data.loads_on(self.facets) - moments[self.facets]
        inverse = np.linalg.inv(facet_mass(data.table.dim, data.order))
        return self._at_points(inverse @ left / data.table.measures[self.facets, None, None])

    def interpolated(self, moments: Array) -> Array:
        """Force of the foundation, reversed, interpolated between nodal values, in local components (k, q, d).

        ``moments`` is (F, l, d).
        """
        data = self.data
        left = data.loads_on(self.facets) - moments[self.facets]
        share = shares(data.order, data.table.dim)[:, None] * data.table.measures[self.facets][:, None, None]
        nodal = left / share
        held = np.zeros(len(data.displacement), dtype=bool)
        outer = np.flatnonzero(~data.table.interior & (data.contact < 0))
        held[data.facet_nodes[outer[data.freed(outer).any(axis=(1, 2))]]] = True
        known = ~held[data.facet_nodes[self.facets]]
        count = np.maximum(known.sum(axis=1), 1)[:, None]
        mean = np.einsum("fa,fai->fi", known.astype(float), nodal) / count
        return self._at_points(np.where(known[:, :, None], nodal, mean[:, None]))

    def _at_points(self, nodal: Array) -> Array:
        """Local components (k, q, d) at the points of fields with these values (k, l, d) at the nodes."""
        if self.axes.shape[1] == 1:
            return np.asarray(self.shapes @ (nodal @ self.axes[:, 0].transpose(0, 2, 1)))
        return np.asarray(np.einsum("fqi,fqci->fqc", self.shapes @ nodal, self.axes))

    def moments(self, forces: Array) -> Array:
        """Moments (k, l, d) of forces in local components (k, q, d), in the coordinates of the mesh."""
        weighted, shapes = self.weights[:, :, None] * forces, self.shapes.transpose(0, 2, 1)
        if self.axes.shape[1] == 1:
            return np.asarray(shapes @ weighted @ self.axes[:, 0])
        return np.asarray(shapes @ np.einsum("fqc,fqci->fqi", weighted, self.axes))

    def on_facets(self, moments: Array) -> Array:
        """Moments (F, l, d) of all facets: these (k, l, d) on contact facets, zero on others."""
        out = np.zeros((len(self.data.table.facets), *moments.shape[1:]))
        out[self.facets] = moments
        return out

    def mass(self, parts: Array) -> Array:
        """``int w phi_a phi_b`` (k, l, d, l, d) for parts w (k, q, 2) along the normal and along tangents."""
        dim = self.data.table.dim
        if self.axes.shape[1] == 1:
            shapes, axes = self.shapes, self.axes[:, 0]
            weighted = (self.weights[:, :, None] * parts).transpose(2, 0, 1)
            normal, tangential = (shapes.transpose(0, 2, 1) @ (part[:, :, None] * shapes) for part in weighted)
            along, across = (one.transpose(0, 2, 1) @ one for one in (axes[:, :1], axes[:, 1:]))
            pairs = (normal, along), (tangential, across)
            return np.asarray(sum(one[:, :, None, :, None] * two[:, None, :, None, :] for one, two in pairs))
        every = np.concatenate([parts[..., :1], np.repeat(parts[..., 1:], dim - 1, axis=2)], axis=2)
        mass = np.einsum(
            "fq,fqc,fqa,fqb,fqci,fqcj->faibj",
            self.weights, every, self.shapes, self.shapes, self.frames, self.frames, optimize=True,
        )  # fmt: skip
        return np.asarray(mass)

    def allowed(self, forces: Array) -> Array:
        """The elements of dj(r) nearest to forces in local components, shape (k, q, d)."""
        flat = self.law.nearest_multiplier(*(values.reshape(-1, values.shape[-1]) for values in (self.local, forces)))
        return flat.reshape(forces.shape)

    def coupling(self) -> Array:
        """By how much the force of the law changes with the state at the points, (k, q); inf where it may jump.

        Friction grows with the penetration by ``L G``.
        """
        return np.broadcast_to(self.stated.steering, self.weights.size).reshape(self.weights.shape)

    @cached_property
    def unseen(self) -> Array:
        """What the normal and the tangential force of a law that splits may leave between the points, (k, 2).

        Between two displacements that are ``delta`` apart, and next to each other among those at the points, a law
        leaves the range of its forces at both by no more than ``alpha delta``, and one that depends on the penetration
        by ``L delta`` more. Nothing is left where all kinks are at points, with straight pieces between them.
        """
        unseen = np.zeros((len(self.facets), 2))
        if not isinstance(self.stated, ContactLaw):
            return unseen
        law, friction, shape = self.stated.normal, self.stated.friction, self.weights.shape
        hidden = self.uncut | (not is_straight(law))
        apart = np.diff(np.sort(self.local[..., 0], axis=1), axis=1).max(axis=1, initial=0.0)
        normal, tangential = (np.broadcast_to(part, self.weights.size) for part in self.law.weak_convexity)

        def steepest(values: Array) -> Array:
            finite = np.where(np.isfinite(values), values, 0.0)  # where it is not, there is no bound
            return np.asarray(finite.reshape(shape).max(axis=1))

        unseen[:, 0] = np.where(hidden, steepest(normal) * apart, 0.0)
        unseen[:, 1] = np.where(self.uncut | (not friction.straight_bound), steepest(self.coupling()) * apart, 0.0)
        curved = not is_straight(friction.profile)
        if curved or (self.data.table.dim == 3 and (friction.profile.knots > 0.0).any()):
            sizes = np.sort(lengths(self.local[..., 1:].reshape(-1, self.local.shape[-1] - 1)).reshape(shape), axis=1)
            unseen[:, 1] += steepest(tangential) * np.diff(sizes, axis=1).max(axis=1, initial=0.0)
        return unseen

    def square(self, off: Array) -> tuple[Array, Array]:
        """Integrals (k,) of the squares of the normal and of the tangential part of forces (k, q, d).

        Components along which supports hold the body do not count.
        """
        if (self.loose != np.eye(self.loose.shape[-1])).any():
            vectors = np.einsum("fqc,fqci->fqi", off, self.frames)
            off = np.einsum("fij,fqj,fqci->fqc", self.loose, vectors, self.frames, optimize=True)
        parts = off**2
        return (
            np.asarray(np.einsum("fq,fq->f", self.weights, parts[..., 0])),
            np.asarray(np.einsum("fq,fqc->f", self.weights, parts[..., 1:])),
        )

    def with_unseen(self, *squares: Array) -> list[Array]:
        """Integrals (k,) of the squares of normal and tangential parts, as large as what is unseen may make them."""
        root = np.sqrt(self.data.table.measures[self.facets])
        return [
            (np.sqrt(seen) + more * root) ** 2 if more.any() else seen
            for seen, more in zip(squares, self.unseen.T, strict=True)
        ]

    def integral(self, values: Array) -> Array:
        """Integrals (k,) over the facets of values (k, q) at the points."""
        return np.asarray(np.einsum("fq,fq->f", self.weights, np.where(self.weights > 0.0, values, 0.0)))


def radial_parts(slip: Array, force: Array) -> tuple[Array, Array]:
    """Sizes (m,) of slips (m, t), and the forces (m, t) along them; the whole size of a force where nothing slips."""
    size = np.sqrt(np.einsum("mi,mi->m", slip, slip))
    along = np.einsum("mi,mi->m", slip, force) / np.where(size > 0.0, size, 1.0)
    return size, np.where(size > 0.0, along, np.sqrt(np.einsum("mi,mi->m", force, force)))


def contact_traces(data: BodyData, parts: int = _PARTS) -> ContactTraces | None:
    """The points of all contact facets; None if there is no contact. In space edges are cut into so many parts."""
    if not data.problem.contact:
        return None
    table, dim = data.table, data.table.dim
    rule = None if all(splits(one.law) for one in data.problem.contact.values()) else PART_RULES[dim]
    pieces, uncut = [], []
    for number, name in enumerate(data.problem.contact):
        facets = np.flatnonzero(data.contact == number)
        uncut.append(np.zeros(len(facets), dtype=bool))
        if dim == 2:
            barycentric, share = _between_kinks(data, name, facets, rule)
        else:
            points, weights = cut_triangle(parts, rule)
            barycentric = np.broadcast_to(points, (len(facets), *points.shape))
            share = np.broadcast_to(weights, (len(facets), len(weights)))
            if rule is None and parts > 1:
                barycentric, share, uncut[-1] = _along_levels(data, name, facets, barycentric, share)
        local, frames, places = local_traces(data, name, facets, barycentric)
        law = data.problem.contact[name].law.at(places.reshape(-1, dim))
        law = law.in_frames(np.broadcast_to(frames, (*places.shape, dim)).reshape(-1, dim, dim))
        pieces.append((facets, barycentric, share * table.measures[facets, None], frames, local, law))
    one = all(part[3].shape[1] == 1 for part in pieces)
    width = max(part[1].shape[1] for part in pieces)
    law = join_laws([(part[5].take(_filled(part, width)), len(part[0]) * width) for part in pieces])
    facets = np.concatenate([part[0] for part in pieces])
    barycentric = _joined([_padded(part[1], width) for part in pieces])
    shapes = shape_values(data.order, barycentric)
    weights = _joined([_padded(part[2], width, 0.0) for part in pieces])
    axes = _joined([part[3] if one else _padded(part[3], width) for part in pieces])
    local = np.concatenate([_padded(part[4], width) for part in pieces]).reshape(-1, dim)
    near = KINK * _scale(data, local)
    local = snapped(law, local, near)
    inside = law.admissible(local)
    beyond = float(np.abs(inside - local).max(initial=0.0))
    return ContactTraces(
        data, facets, barycentric, shapes, weights, axes, inside.reshape(*weights.shape, dim), frozen_at(law, inside),
        law, beyond, np.concatenate(uncut),
    )  # fmt: skip


def _joined(parts: list[Array]) -> Array:
    """Arrays one behind the other; a single one as it is, which may repeat its numbers without a copy."""
    return parts[0] if len(parts) == 1 else np.concatenate(parts)


def _filled(part: tuple[IntArray, Array, Array, Array, Array, VectorLaw], width: int) -> IntArray:
    """Numbers of the points of a boundary, its last points repeated up to a width."""
    count, own = part[1].shape[:2]
    return np.asarray((np.arange(count)[:, None] * own + np.minimum(np.arange(width), own - 1)).ravel())


def beyond_domain(traces: ContactTraces) -> float:
    """By how much penetrations leave the domain of the law, between the points too where gaps are known there."""
    excesses = [np.maximum(part.above, part.below).max(initial=0.0) for part in gap_ranges(traces.data)]
    most = max([traces.beyond, *map(float, excesses)])
    return most if most > KINK * _scale(traces.data, traces.local) else 0.0


def _padded(values: Array, width: int, fill: float | None = None) -> Array:
    """Values (k, q, ...) with the last point repeated up to a width, or filled up with a number."""
    short = width - values.shape[1]
    if short == 0:
        return values
    tail = np.repeat(values[:, -1:], short, axis=1)
    return np.concatenate([values, tail if fill is None else np.full(tail.shape, fill)], axis=1)


def _scale(data: BodyData, local: Array) -> float:
    """Size of what may cancel in the local displacement."""
    near = np.abs(local[np.abs(local) < _extent(data)]).max(initial=0.0)
    return max(float(np.abs(data.displacement).max(initial=0.0)), float(near))


def _extent(data: BodyData) -> float:
    points = data.problem.mesh.points
    return float((points.max(axis=0) - points.min(axis=0)).max())


def local_traces(data: BodyData, name: str, facets: IntArray, barycentric: Array) -> tuple[Array, Array, Array]:
    """Penetration and slip (k, q, d), frames and places (k, q, d) of points (k, q, d) on facets.

    Frames are (k, q, d, d), or (k, 1, d, d) where those of a facet are the same at all of its points.
    """
    table, contact = data.table, data.problem.contact[name]
    dim = table.dim
    places = barycentric @ table.mesh.points[table.facets[facets]]
    moved = shape_values(data.order, barycentric) @ data.jump(data.displacement, facets)
    normals = table.normals_of(facets)[:, None]
    flat = places.reshape(-1, dim)
    if contact.obstacle is None:
        gap = DataField(contact.gap, f"gap of contact '{name}'").at(flat)
    else:
        assert contact.normals is not None
        turned, gap = obstacle_contact(
            contact.obstacle,
            contact.normals,
            flat,
            np.broadcast_to(normals, places.shape).reshape(-1, dim),
            f"contact '{name}'",
        )
        normals = turned.reshape(places.shape)
        gap = np.where(np.isfinite(gap), gap, _FAR * _extent(data))
    frames = _frames(normals.reshape(-1, dim)).reshape(*normals.shape, dim)

    def components(vectors: Array) -> Array:
        if frames.shape[1] == 1:
            return np.asarray(vectors @ frames[:, 0].transpose(0, 2, 1))
        return np.asarray(np.einsum("fqci,fqi->fqc", frames, vectors))

    local = components(moved)
    local[..., 0] -= gap.reshape(local.shape[:2])
    belt = DataField(contact.belt, f"belt of contact '{name}'", dim).at(flat).reshape(places.shape)
    if belt.any():
        local[..., 1:] -= components(belt)[..., 1:]
    return local, frames, places


def _frames(normal: Array) -> Array:
    """Normal and tangents, shape (k, d, d)."""
    if normal.shape[1] == 2:
        return np.stack([normal, np.column_stack([-normal[:, 1], normal[:, 0]])], axis=1)
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(axis, normal)
    first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([normal, first, np.cross(normal, first)], axis=1)


def _between_kinks(data: BodyData, name: str, facets: IntArray, rule: PartRule | None) -> tuple[Array, Array]:
    """Barycentric coordinates (k, q, 2) and shares (k, q) of points between the kinks on edges."""
    at_nodes = np.broadcast_to([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]], (len(facets), 3, 2))
    ends, frames, places = local_traces(data, name, facets, at_nodes)
    law = data.problem.contact[name].law.at(places.mean(axis=1)).in_frames(frames[:, -1])
    parts = _PARTS if data.order == 1 and not _is_curved(law) else _MORE_PARTS
    first, last, middle = ends.transpose(1, 0, 2)
    bend = np.zeros(first.shape) if data.order == 1 else 2.0 * (first + last - 2.0 * middle)
    kinks = [law.kinks_along(first, last, bend)]
    turn = np.zeros((len(facets), 0))
    if data.order == 2:
        with np.errstate(all="ignore"):
            turn = (0.75 * first + 0.25 * last - middle) / (first + last - 2.0 * middle)
        turn = np.clip(np.where(np.isfinite(turn), turn, 0.0), 0.0, 1.0)
        kinks += [] if rule is None else [turn[:, :1]]  # a penetration that rises or falls on each part
    inner = np.concatenate(kinks, axis=1)
    inner = np.sort(np.where((inner > 0.0) & (inner < 1.0), inner, 0.0), axis=1)
    even = np.broadcast_to(np.arange(parts + 1) / parts, (len(facets), parts + 1))
    cut = np.sort(np.concatenate([even, inner[:, inner.any(axis=0)]], axis=1), axis=1)
    length = np.diff(cut, axis=1)
    if rule is not None:
        at, share = cut[:, :-1, None] + length[:, :, None] * rule.points[:, 1], length[:, :, None] * rule.weights
        flat = at.reshape(len(facets), -1)
        return np.stack([1.0 - flat, flat], axis=2), share.reshape(len(facets), -1)
    point, weight = quadrature_rule(1, 5)
    at = cut[:, :-1, None] + length[:, :, None] * point[:, 1]
    share = (length[:, :, None] * weight).reshape(len(facets), -1)
    extremes = np.hstack([np.broadcast_to([0.0, 1.0], (len(facets), 2)), turn])
    flat = np.hstack([at.reshape(len(facets), -1), extremes])
    share = np.hstack([share, np.zeros(extremes.shape)])
    return np.stack([1.0 - flat, flat], axis=2), share


def _is_curved(law: VectorLaw) -> bool:
    """Whether a law that splits is not quadratic between its kinks."""
    if not isinstance(law, ContactLaw):
        return False
    return not (is_straight(law.normal) and is_straight(law.friction.profile) and law.friction.straight_bound)


def _along_levels(
    data: BodyData, name: str, facets: IntArray, barycentric: Array, share: Array
) -> tuple[Array, Array, BoolArray]:
    """Other points (k, q, 3) and shares (k, q) on triangles that have kinks of the normal law inside.

    And which of them (k,) have too many; these keep their points.
    """
    corners = np.broadcast_to(np.eye(3), (len(facets), 3, 3))
    local, _, places = local_traces(data, name, facets, corners)
    r, knots = local[..., 0], data.problem.contact[name].law.at(places.mean(axis=1)).penetration_knots
    order, near = np.argsort(r, axis=1), KINK * _scale(data, local)
    low, middle, high = np.take_along_axis(r, order, axis=1).T[:, :, None]
    inside = (knots > low + near) & (knots < high - near)
    count = inside.sum(axis=1)
    some = np.flatnonzero((count > 0) & (count <= _LEVELS))
    if not len(some):
        return barycentric, share, count > 0
    every = np.sort(np.where(inside, knots, high)[some], axis=1)[:, : count[some].max()]
    low, middle, high = low[some], middle[some], high[some]
    levels = np.sort(np.concatenate([low, middle, high, 0.5 * (low + high), every], axis=1), axis=1)
    own, own_share = _slices(levels, low, middle, high, np.eye(3)[order[some]])
    width = max(own.shape[1], barycentric.shape[1])
    points, shares_ = _padded(barycentric, width).copy(), _padded(share, width, 0.0).copy()
    points[some], shares_[some] = _padded(own, width), _padded(own_share, width, 0.0)
    return points, shares_, count > _LEVELS


def _slices(levels: Array, low: Array, middle: Array, high: Array, corners: Array) -> tuple[Array, Array]:
    """Points (k, q, 3) and shares (k, q) on triangles that are cut along levels (k, n), and their corners.

    A function is linear, with the values (k, 1) at the corners (k, 3, 3), by which these stand; the middle one is among
    the levels.  Each slice is halved along the levels.
    """
    first, second, third = corners.transpose(1, 0, 2)[:, :, None]

    def fraction(start: Array, end: Array) -> Array:
        return np.clip((levels - start) / np.where(end > start, end - start, 1.0), 0.0, 1.0)[:, :, None]

    one = first + fraction(low, high) * (third - first)
    bent = np.where(
        (levels < middle)[:, :, None],
        first + fraction(low, middle) * (second - first),
        second + fraction(middle, high) * (third - second),
    )
    rows = np.stack([one, 0.5 * (one + bent), bent], axis=1)  # (k, 3, n, 3)
    a, b, c, d = rows[:, :-1, :-1], rows[:, 1:, :-1], rows[:, :-1, 1:], rows[:, 1:, 1:]
    triangles = np.stack([np.stack([a, b, c], axis=3), np.stack([b, c, d], axis=3)], axis=3)
    triangles = triangles.reshape(len(levels), -1, 3, 3)
    point, weight = quadrature_rule(2, 4)
    at = point @ triangles
    share = np.abs(np.linalg.det(triangles))[:, :, None] * weight
    points = np.concatenate([at.reshape(len(levels), -1, 3), corners], axis=1)
    return points, np.concatenate([share.reshape(len(levels), -1), np.zeros((len(levels), 3))], axis=1)


def _out_of_curved_gaps(data: BodyData) -> Array:
    """The displacement (nodes, d) with the nodes of facets moved along their normals by what penetrates too far."""
    moved = data.displacement.copy()
    for part in gap_ranges(data):
        for excess, sign in ((part.above, 1.0), (part.below, -1.0)):
            _move_corners(data, moved, part.facets, np.tile(excess[:, None], data.table.dim), sign)
    return moved


def _out_at_corners(data: BodyData) -> Array:
    """The displacement (nodes, d) with the ends of edges moved: where a boundary is bent, two edges disagree there."""
    moved = data.displacement.copy()
    ends = np.eye(2)
    for number, name in enumerate(data.problem.contact):
        facets = np.flatnonzero(data.contact == number)
        local, _, places = local_traces(data, name, facets, np.broadcast_to(ends, (len(facets), 2, 2)))
        domains = [data.problem.contact[name].law.at(places[:, k]).penetrations for k in range(2)]
        upper, lower = (np.stack([np.broadcast_to(d, len(facets)) for d in e], axis=1) for e in zip(
            *((one.upper, one.lower) for one in domains), strict=True))  # fmt: skip
        for excess, sign in ((local[..., 0] - upper, 1.0), (lower - local[..., 0], -1.0)):
            _move_corners(data, moved, facets, excess, sign)
    return moved


def _move_corners(data: BodyData, moved: Array, facets: IntArray, excess: Array, sign: float) -> None:
    """Move corners of facets (k,) along their normals by ``excess (k, d)``, in place; not what supports hold."""
    table = data.table
    near = KINK * _scale(data, data.displacement)
    if not (excess > near).any():
        return
    outer = np.flatnonzero(~table.interior)
    outer = outer[data.freed(outer).any(axis=(1, 2))]
    normals, nodes = table.normals_of(facets), table.facets[facets]
    held = np.zeros((len(moved), table.dim, table.dim))
    for corner in table.facets[outer].T:
        np.add.at(held, corner, data.freed(outer))
    most, normal = np.zeros(len(moved)), np.zeros(moved.shape)
    for corner, much in zip(nodes.T, excess.T, strict=True):
        order = np.argsort(much)  # of all facets of a node the one that penetrates most decides
        np.maximum.at(most, corner, np.where(much > near, much, 0.0))
        worst = order[much[order] >= most[corner[order]]]
        normal[corner[worst]] = normals[worst]
    loose = np.abs(np.einsum("nij,nj->ni", held, normal)).max(axis=1) <= FREE
    cut = facets[table.cut[facets]]
    mine, theirs = table.facets[cut].ravel(), table.others[cut].ravel()
    softer = np.repeat(_second_is_softer(data, cut), table.dim)
    free = np.abs(np.einsum("nij,nj->ni", held[theirs], normal[mine])).max(axis=1, initial=0.0) <= FREE
    gives = free & (softer | ~loose[mine])
    loose[mine[gives]] = False  # the other body gives way there
    back = sign * most[:, None] * normal
    moved -= back * loose[:, None]
    moved[theirs[gives]] += back[mine[gives]]


def admissible_displacement(data: BodyData) -> Array:
    """The displacement (nodes, d) with the midpoints of contact edges moved as far as their penetration asks for.

    Gaps are taken quadratic along edges, as the displacement is. With linear elements all nodes of a facet are moved
    that penetrates beyond the domain because its gap is curved.
    """
    if data.order == 1:
        return _out_of_curved_gaps(data)
    moved = _out_at_corners(data)
    data = data.at(moved)
    at_nodes = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.5]])
    for number, name in enumerate(data.problem.contact):
        facets = np.flatnonzero(data.contact == number)
        local, frames, places = local_traces(data, name, facets, np.broadcast_to(at_nodes, (len(facets), 3, 2)))
        domain = data.problem.contact[name].law.at(places[:, 2]).penetrations
        first, last, middle = local[..., 0].T
        beyond = middle - 0.5 * (first + last)
        normal = frames[:, -1, 0]
        held = np.einsum("fi,fij,fj->f", normal, data.freed(facets), normal) > FREE
        for end, sign in ((domain.upper, 1.0), (domain.lower, -1.0)):
            reach = (np.sqrt(np.maximum(sign * (end - value), 0.0)) for value in (first, last))
            excess = np.maximum(sign * beyond - 0.25 * sum(reach) ** 2, 0.0)
            excess[held | ~np.isfinite(excess)] = 0.0
            back, softer = (sign * excess)[:, None] * normal, _second_is_softer(data, facets)
            moved[data.facet_nodes[facets[~softer], 2]] -= back[~softer]
            moved[data.opposite[facets[softer], 2]] += back[softer]
    return moved


def _second_is_softer(data: BodyData, facets: IntArray) -> BoolArray:
    """Where two bodies touch (k,): whether the second one costs less energy to bend."""
    stiffness = np.broadcast_to(np.einsum("mqvv->m", data.tensors), len(data.table.cells))
    first, second = stiffness[data.table.owners[facets]].T
    return np.asarray(data.table.cut[facets] & (second < first))
