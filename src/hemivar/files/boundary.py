"""Where the contact points of a discrete problem lie on its mesh."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial import KDTree

from hemivar.basics.types import Array, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.mechanics.obstacles import Normals
from hemivar.mesh.mesh import Mesh

__all__ = ["ContactBoundary", "contact_boundaries", "global_vectors", "polylines"]


@dataclass(frozen=True, eq=False)
class ContactBoundary:
    """One named contact boundary and its contact points.

    Attributes
    ----------
    name : str
    mesh : Mesh
    members : int array (k, q)
        Displacement nodes of the facets, vertices first.
    index : int array (p,)
        Contact points of the discrete problem on this boundary.
    nodes : int array (p,) or None
        Their displacement nodes; None if they are the midpoints of facets without nodes of their own.
    facets : int array (p,) or None
        Facets whose midpoints they are, in that case.
    """

    name: str
    mesh: Mesh
    members: IntArray
    index: IntArray
    nodes: IntArray | None
    facets: IntArray | None

    @property
    def corners(self) -> IntArray:
        """Vertices of the facets, (k, d)."""
        return self.members[:, : self.mesh.dim]

    @cached_property
    def used_nodes(self) -> IntArray:
        """Displacement nodes of the boundary, sorted."""
        return np.unique(self.members)

    def at_nodes(self, values: Array, fill: float = 0.0) -> Array:
        """Values (m, ...) of contact points at :attr:`used_nodes`; ``fill`` where there is no contact point.

        Where contact points are midpoints of facets, a node gets the mean of its facets.
        """
        values = np.asarray(values)
        out = np.full((len(self.used_nodes), *values.shape[1:]), fill, dtype=float)
        if self.nodes is not None:
            out[np.searchsorted(self.used_nodes, self.nodes)] = values[self.index]
            return out
        assert self.facets is not None
        place = np.searchsorted(self.used_nodes, self.members[self.facets])
        total = np.zeros_like(out)
        count = np.zeros(len(out))
        for k in range(place.shape[1]):
            np.add.at(total, place[:, k], values[self.index])
            np.add.at(count, place[:, k], 1.0)
        seen = count > 0
        out[seen] = total[seen] / count[seen].reshape(-1, *(1,) * (values.ndim - 1))
        return out

    @cached_property
    def lines(self) -> list[IntArray]:
        """The boundary as polylines of vertices (2D)."""
        return polylines(self.corners)

    def position(self, points: Array) -> tuple[Array, str]:
        """Coordinate along the boundary (2D) of its contact points (p,), and the name of that coordinate."""
        vertices = self.mesh.points[np.unique(self.corners)]
        extent = np.ptp(vertices, axis=0)
        own = points[self.index]
        for axis, name in ((0, "x"), (1, "y")):
            if extent[1 - axis] <= 1e-9 * extent[axis]:
                return own[:, axis], name
        where = np.empty(len(own))
        best = np.full(len(own), np.inf)
        start = 0.0
        for line in self.lines:
            corner = self.mesh.points[line]
            step = np.diff(corner, axis=0)
            length = np.linalg.norm(step, axis=1)
            reached = start + np.concatenate([[0.0], np.cumsum(length)])
            middle = 0.5 * (corner[1:] + corner[:-1])
            _, candidates = KDTree(middle).query(own, k=min(3, len(middle)))
            for edge in np.reshape(candidates, (len(own), -1)).T:
                along = np.einsum("kd,kd->k", own - corner[edge], step[edge]) / length[edge] ** 2
                along = np.clip(along, 0.0, 1.0)
                off = np.linalg.norm(own - corner[edge] - along[:, None] * step[edge], axis=1)
                closer = off < best - 1e-12 * reached[-1]
                where[closer] = (reached[edge] + along * length[edge])[closer]
                best[closer] = off[closer]
            start = reached[-1]
        return where, "arc length"


def contact_boundaries(problem: DiscreteProblem) -> list[ContactBoundary]:
    """The contact boundaries of a problem with a mesh, found by the places and normals of its contact points.

    Raises
    ------
    ProblemError
        The problem was made of arrays, or a contact point lies on no named boundary.
    """
    if problem.field is None or problem.points is None or problem.frames is None:
        raise ProblemError(
            "this problem was made of arrays and has no mesh; use discretize(), or give it points, frames and field"
        )
    if problem.contact_points == 0:
        return []
    mesh, order = problem.field.mesh, problem.field.order
    nodes = mesh.nodes(order)
    tolerance = 1e-9 * float(np.ptp(mesh.points, axis=0).max())
    stated = {} if problem.statement is None else problem.statement.contact
    turned = {name for name, contact in stated.items() if contact.normals is Normals.OBSTACLE}
    candidates = []
    for name, corners in mesh.boundaries.items():
        members = mesh.facet_nodes(corners, order)
        normals, measures = mesh.facet_normals(corners)
        used, place = np.unique(members.ravel(), return_inverse=True)
        summed = np.zeros((len(used), mesh.dim))
        np.add.at(summed, place.ravel(), np.repeat(normals * measures[:, None], members.shape[1], axis=0))
        nodal = summed / np.maximum(np.linalg.norm(summed, axis=1), 1e-300)[:, None]
        for at_nodes in (True, False):
            places = nodes[used] if at_nodes else mesh.points[corners].mean(axis=1)
            direction = nodal if at_nodes else normals
            gap, found = KDTree(places).query(problem.points)
            along = np.linalg.norm(direction[found] - problem.frames[:, 0], axis=1) < 1e-6
            hit = (gap <= tolerance) & (along | (name in turned))
            if hit.any():
                share = np.count_nonzero(hit) / len(places)
                candidates.append((share, name, members, hit, used[found] if at_nodes else None, found))
    candidates.sort(key=lambda item: -item[0])
    free = np.ones(problem.contact_points, dtype=bool)
    boundaries = []
    for _, name, members, hit, at, found in candidates:
        mine = _first_at(np.flatnonzero(hit & free), found)
        if len(mine):
            free[mine] = False
            boundaries.append(
                ContactBoundary(
                    name, mesh, members, mine, None if at is None else at[mine], None if at is not None else found[mine]
                )
            )
    if free.any():
        bad = problem.points[np.flatnonzero(free)[0]].tolist()
        raise ProblemError(f"the contact point at {bad} lies on no named boundary of the mesh")
    return sorted(boundaries, key=lambda boundary: int(boundary.index[0]))


def _first_at(index: IntArray, place: IntArray) -> IntArray:
    """The first of the contact points at each place."""
    _, first = np.unique(place[index], return_index=True)
    return index[np.sort(first)]


def global_vectors(problem: DiscreteProblem, local: Array, *, normal: bool = True, tangential: bool = True) -> Array:
    """Vectors (m, d) in global components from local ones (m, d)."""
    assert problem.frames is not None
    chosen = local.copy()
    if not normal:
        chosen[:, 0] = 0.0
    if not tangential:
        chosen[:, 1:] = 0.0
    return np.asarray(np.einsum("mc,mcd->md", chosen, problem.frames))


def polylines(edges: IntArray) -> list[IntArray]:
    """Directed edges (k, 2) joined to polylines of nodes; closed ones end where they begin."""
    following: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        following.setdefault(a, []).append(b)
    ends = set(edges[:, 1].tolist())
    lines = []
    starts = [a for a in following if a not in ends] + list(following)
    for start in starts:
        while following.get(start):
            line = [start]
            while following.get(line[-1]):
                line.append(following[line[-1]].pop())
            lines.append(np.array(line))
    return lines
