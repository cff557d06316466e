"""How far the arcs deviate from the facets that stand for them.

Where facets follow each other at small angles the mesh replaces a curve by its chords.  Along an edge of length h an
arc of curvature k is off by ``k h^2 xi (1 - xi)/2``.  The curvature at a node is that of the parabola, in space of the
paraboloid, through the nodes around: in the plane what the curve turns there over the mean length of both facets.
Along an edge the harmonic mean of its ends counts: none where the turn changes its sign, and none beside a straight
part, so that a kink between straight parts stays one.  Across angles above 30 degrees nothing is an arc.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.fem.contact_basis import nodal_values
from hemivar.fem.elements import shape_values
from hemivar.fem.mortar import Mortar
from hemivar.fem.supports import sum_by, unit
from hemivar.mechanics.statement import ContactProblem, Geometry
from hemivar.mesh.boundary_rule import BoundaryRule, boundary_rule
from hemivar.mesh.keys import facet_keys
from hemivar.mesh.mesh import Mesh
from hemivar.mesh.smooth_chains import BEND, Chains, chains

__all__ = ["Arcs", "Bulge", "arcs_of_pair", "bulge"]

#: Share of a normal matrix below which nodes do not fix a paraboloid.
_FLAT = 1e-8
#: Changes of distances that are rounding, of the size of the mesh, and share of a bulge that it may be off by.
_ROUNDED, _INEXACT = 1e-9, 1e-2
#: How much lower psi-weighted means of a parabola are than its values, by how much these are than the next ones, by
#: dimension; in space on regular triangles.
_LOWER = {2: 1.0 / 6.0, 3: 0.25}


@dataclass(frozen=True, eq=False)
class Bulge:
    """Ways from facets to arcs, quadratic on each facet: by its nodes of order 2, shape (f, n, d)."""

    arcs: Array
    left: Array  # more where the larger curvature of both ends of an edge is the right one


def bulge(mesh: Mesh, name: str) -> Bulge:
    """The bulge of a boundary.

    A refined mesh keeps the facets of its coarsest one, whose nodes are those of the curve.
    """
    root, number, places = _coarsest(mesh, name)
    rule = boundary_rule(root, name)
    of, local = chains(rule), _sides(mesh.dim)
    arcs = np.zeros((2, len(rule.facets), mesh.dim + len(local), mesh.dim))
    on = np.flatnonzero(of.curved)
    if on.size:
        arcs[:, on, mesh.dim :] = _Net.of(root, rule, of).ways()
    if root is not mesh:
        middle = [0.5 * (places[:, a] + places[:, b]) for a, b in local]
        shape = shape_values(2, np.concatenate([places, np.stack(middle, axis=1)], axis=1))
        arcs = np.einsum("fnm,sfmd->sfnd", shape, arcs[:, number])
    return Bulge(arcs[0], arcs[1])


@dataclass(frozen=True, eq=False)
class Arcs:
    """What the arcs of two bodies change of their distance."""

    apart: Array  # (m,), psi-weighted means at contact points
    inexact: float  # what these may be off by
    warnings: tuple[str, ...]

    def overlap(self, apart: Array, problem: ContactProblem, name: str, projection: Mortar) -> float:
        """The largest overlap of two bodies at distances (m,), arcs included, by the nodes of the slave.

        Of a parabola the psi-weighted means of linear elements are lower than its values, by a share of how much lower
        these are than those next to them.
        """
        if self.inexact and problem.order == 1:
            first, second = _neighbours(problem, name, projection)
            far = np.bincount(first, apart[second] - apart[first], apart.size)
            apart = apart + _LOWER[problem.mesh.dim] * far / np.maximum(np.bincount(first, minlength=apart.size), 1)
        apart = nodal_values(problem.mesh, problem.order, projection.nodes, apart)
        return -float(apart.min()) - self.inexact


def arcs_of_pair(problem: ContactProblem, name: str, projection: Mortar, normal: Array, title: str) -> Arcs:
    """How much farther apart the arcs of two bodies are than their facets, along normals (m, d) at contact points.

    Where the body is meant as meshed, and where facets look curved but lie on no arc, a warning says what stress that
    makes: half of Young's modulus times the slope of the ripple.
    """
    own, other = (bulge(problem.mesh, side) for side in problem.pair(name))
    fields = ((own.arcs, other.arcs), (own.left, other.left))
    if not any(part.any() for both in fields for part in both):
        return Arcs(np.zeros(projection.nodes.size), 0.0, ())
    arcs, left = (-np.einsum("kd,kd->k", normal, projection.mean(*both)) for both in fields)
    size, off = (max(float(np.linalg.norm(part, axis=2).max()) for part in both) for both in fields)
    seen, more = (float(np.abs(part).max()) > _ROUNDED * problem.mesh.size for part in (arcs, left))
    warnings: tuple[str, ...] = ()  # so it stays where sides are flat, or the facets of both coincide
    if problem.geometry is Geometry.AS_MESHED:
        if seen:
            warnings = (
                f"{title}: arcs through the nodes are up to {size:.3g} off the facets, but the geometry is as meshed: "
                f"the pressure ripples by about {_ripple(problem, name, projection, arcs):g}",
            )
        return Arcs(np.zeros_like(arcs), 0.0, warnings)
    if seen:
        warnings = (
            f"{title}: the facets stand for arcs that are up to {size:.3g} off them, and the gap is that of the arcs; "
            'geometry = "as-meshed" keeps that of the facets',
        )
    if more and off > size:
        warnings += (
            f"{title}: the sides look curved, but their nodes lie on no arcs; facets that are {off:.3g} off or so let "
            f"the pressure ripple by about {_ripple(problem, name, projection, left):g}: mesh them anew, with nodes "
            "on the curve",
        )
    return Arcs(arcs, _INEXACT * size, warnings)


def _ripple(problem: ContactProblem, name: str, projection: Mortar, apart: Array) -> float:
    """The size of the stress, to two digits, that distances (m,) make if they should be the same."""
    first, second = _neighbours(problem, name, projection)
    points = problem.mesh.nodes(problem.order)[projection.nodes]
    slope = np.abs(apart[first] - apart[second]) / np.linalg.norm(points[first] - points[second], axis=1)
    soft = sum(1.0 / problem.stiffness_at(side) for side in problem.pair(name))
    return float(f"{slope.max(initial=0.0) / soft:.2g}")


def _neighbours(problem: ContactProblem, name: str, projection: Mortar) -> tuple[IntArray, IntArray]:
    """Contact points (c,) and (c,) of one facet of the slave, each pair as often as it has facets, both ways."""
    mesh, number = problem.mesh, np.full(projection.jump.shape[1], -1)
    number[projection.nodes] = np.arange(projection.nodes.size)
    ends = number[boundary_rule(mesh, problem.pair(name)[0], problem.order).nodes]
    first, second = (ends[:, part].ravel() for part in np.nonzero(~np.eye(ends.shape[1], dtype=bool)))
    both = (first >= 0) & (second >= 0)
    return first[both], second[both]


def _sides(dim: int) -> tuple[tuple[int, int], ...]:
    """Ends of the edges of a facet, in the order of its nodes of order 2."""
    return ((0, 1),) if dim == 2 else ((0, 1), (1, 2), (0, 2))


def _coarsest(mesh: Mesh, name: str) -> tuple[Mesh, IntArray, Array]:
    """The mesh that a boundary (f, d) stems from, the facet there of each, and its corners (f, d, d) in that."""
    facets = mesh.boundaries[name]
    count, dim = facets.shape
    if mesh.parent is None:
        return mesh, np.arange(count), np.broadcast_to(np.eye(dim), (count, dim, dim))
    corners = facets.ravel()
    rows = sp.csr_array(
        (np.ones(corners.size), corners, np.arange(corners.size + 1)), shape=(corners.size, mesh.number_of_nodes)
    )
    while mesh.parent is not None:
        rows, mesh = sp.csr_array(rows @ mesh.parent.interpolation), mesh.parent.mesh
    together = sp.csr_array(sp.kron(sp.eye_array(count), np.ones((1, dim))) @ rows)
    together.sort_indices()
    nodes, coarse = together.indices.reshape(count, dim).astype(np.int64), mesh.boundaries[name]
    keys = facet_keys(coarse, mesh.number_of_nodes)
    order = np.argsort(keys)
    number = order[np.searchsorted(keys[order], facet_keys(nodes, mesh.number_of_nodes))]
    columns = np.broadcast_to(coarse[number][:, None], (count, dim, dim))
    at = np.arange(corners.size).reshape(count, dim, 1)
    places = rows[np.broadcast_to(at, columns.shape).ravel(), columns.ravel()]
    return mesh, number, np.asarray(places).reshape(count, dim, dim)


@dataclass(frozen=True, eq=False)
class _Net:
    """Facets (k, d) of curves by their nodes: one of two chains counts in each of them."""

    points: Array  # (n, d)
    normals: Array  # (n, d), of the facets
    edges: IntArray  # (e, 2)
    edge: IntArray  # (k, s), of each side of the facets
    border: BoolArray  # (n,), where the chain ends
    sharp: BoolArray  # (n,), where it meets itself at a larger angle

    @classmethod
    def of(cls, mesh: Mesh, rule: BoundaryRule, of: Chains) -> _Net:
        """That of the curved facets of a boundary."""
        facets, count, dim = rule.facets, mesh.number_of_nodes, mesh.dim
        keys = of.chain[:, None] * count + facets
        known, own = np.unique(keys[of.curved], return_inverse=True)
        own = own.reshape(-1, dim)
        ends = np.sort(np.stack([own[:, pair] for pair in _sides(dim)], axis=1).reshape(-1, 2), axis=1)
        edges, edge, often = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
        border = np.zeros(len(known), dtype=bool)
        border[edges[often == 1] if dim == 3 else np.flatnonzero(np.bincount(own.ravel()) == 1)] = True
        one, other = of.pairs[(of.angle > BEND) & (of.chain[of.pairs[:, 0]] == of.chain[of.pairs[:, 1]])].T
        met = (facets[one][:, :, None] == facets[other][:, None]).any(axis=2)
        sharp = np.isin(known, keys[one][met])
        weighted = (rule.normals * rule.weights[:, None])[of.curved]
        summed = sum_by(own.ravel(), np.repeat(weighted, dim, axis=0), len(known))
        summed[sharp] = np.eye(dim)[0]  # they may cancel there, where nothing is an arc
        return cls(mesh.points[known % count], unit(summed), edges, edge.reshape(len(own), -1), border, sharp)

    def ways(self) -> Array:
        """Ways (2, k, s, d) from the middles of the sides of all facets to the arcs, and what may be left."""
        surface, (edge, node) = self._surface(), self._beside()
        limited = _harmonic(edge, self._turns(surface, edge, node), len(self.edges))
        each = np.arange(len(self.edges))
        ends = np.stack([self._turns(surface, each, node) for node in self.edges.T])
        largest = np.take_along_axis(ends, np.argmax(np.abs(ends), axis=0)[None], axis=0)[0]
        out = unit(self.normals[self.edges].sum(axis=1)) / 8.0
        offsets = np.stack([limited[:, None] * out, (largest - limited)[:, None] * out])
        return np.asarray(offsets[:, self.edge])

    def _turns(self, surface: tuple[Array, Array], edge: IntArray, node: IntArray) -> Array:
        """Curvature at nodes (c,) along edges (c,), times the square of their lengths, (c,)."""
        normal, tensor = surface
        chord = self.points[self.edges[edge, 1]] - self.points[self.edges[edge, 0]]
        square = (chord**2).sum(axis=1)
        along = np.maximum(square - np.einsum("cd,cd->c", chord, normal[node]) ** 2, 1e-3 * square)
        return np.asarray(np.einsum("cd,cde,ce->c", chord, tensor[node], chord) * square / along)

    def _graph(self) -> sp.csr_array:
        """Which nodes (n, n) an edge joins."""
        ends, count = np.concatenate([self.edges, self.edges[:, ::-1]]), len(self.points)
        return sp.csr_array((np.ones(len(ends)), ends.T), shape=(count, count))

    def _beside(self) -> tuple[IntArray, IntArray]:
        """Edges and nodes (c,), (c,) whose curvature counts for them: both ends, at borders all next to these."""
        each, count = np.arange(len(self.edges)), len(self.points)
        at = np.repeat(each, 2), self.edges.ravel()
        ends = sp.csr_array((np.ones(at[0].size), at), shape=(each.size, count))
        wide = self.border[self.edges].any(axis=1)
        among = sp.coo_array(sp.diags_array(wide.astype(float)) @ (ends @ self._graph()) + ends)
        among.eliminate_zeros()
        return among.row.astype(np.int64), among.col.astype(np.int64)

    def _surface(self) -> tuple[Array, Array]:
        """Normals (n, d) and curvatures (n, d, d), of convex bodies positive, of paraboloids through the nodes around.

        Where the next nodes are too few for one, as at ends, it goes through those next to them too.
        """
        graph, dim = self._graph(), self.points.shape[1]
        wide = np.diff(graph.indptr) < (dim - 1) * (dim + 2) // 2
        far = sp.coo_array(sp.diags_array(wide.astype(float)) @ (graph @ graph) + graph)
        near = (far.row != far.col) & (far.data > 0.0)
        node, other = far.row[near].astype(np.int64), far.col[near].astype(np.int64)
        normals, _ = self._fitted(self.normals, node, other)
        return normals, self._fitted(normals, node, other)[1]

    def _fitted(self, normals: Array, node: IntArray, other: IntArray) -> tuple[Array, Array]:
        """Normals (n, d) and curvatures (n, d, d) at nodes (c,) by others (c,), of heights along normals (n, d).

        ``height (t . t)/(way . way) = slope . t + curvature (t . t)/2``: along their own normals nodes of a circle or a
        sphere have its curvature exactly.
        """
        chord, (count, dim) = self.points[other] - self.points[node], normals.shape
        tangents = np.linalg.svd(normals[:, None])[2][:, 1:]
        square = (chord**2).sum(axis=1)
        scale = np.sqrt(np.bincount(node, square, count) / np.bincount(node, minlength=count))
        t = np.einsum("cd,cad->ca", chord, tangents[node])
        flat = np.maximum(np.linalg.norm(t, axis=1), np.finfo(float).tiny)
        t, height = t / flat[:, None], flat * np.einsum("cd,cd->c", chord, normals[node]) / square
        pairs = [(a, b) for a in range(dim - 1) for b in range(a, dim - 1)]
        bends = np.column_stack([t[:, a] * t[:, b] * (0.5 if a == b else 1.0) for a, b in pairs])
        row = np.hstack([t, bends * (flat / scale[node])[:, None]])
        both = np.concatenate([row[:, :, None] * row[:, None, :], (row * height[:, None])[:, None]], axis=1)
        summed = sum_by(node, both.reshape(len(node), -1), count).reshape(count, *both.shape[1:])
        fit = np.einsum("nij,nj->ni", np.linalg.pinv(summed[:, :-1], rcond=_FLAT, hermitian=True), summed[:, -1])
        fit[self.sharp] = 0.0
        bent = np.zeros((count, dim - 1, dim - 1))
        for k, (a, b) in enumerate(pairs, dim - 1):
            bent[:, a, b] = bent[:, b, a] = -fit[:, k] / scale
        turned = unit(normals - np.einsum("na,nad->nd", fit[:, : dim - 1], tangents))
        return turned, np.asarray(np.einsum("nai,nab,nbj->nij", tangents, bent, tangents))


def _harmonic(group: IntArray, values: Array, count: int) -> Array:
    """Harmonic means (count,) of the values of each group, zero where their signs differ."""
    with np.errstate(divide="ignore", over="ignore"):
        inverse = np.bincount(group, 1.0 / np.abs(values), count)
    signs, number = np.bincount(group, np.sign(values), count), np.bincount(group, minlength=count)
    return np.asarray(np.where(np.abs(signs) == number, np.sign(signs) * number / inverse, 0.0))
