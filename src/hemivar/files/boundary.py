"""Contact boundaries on the mesh: the facets, nodes and contact points of the trace of a discrete problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, IntArray
from hemivar.discrete.contact import ContactPoints
from hemivar.discrete.problem import DiscreteProblem
from hemivar.discrete.space import Field
from hemivar.errors import ProblemError
from hemivar.mesh.boundary_rule import boundary_rule
from hemivar.mesh.mesh import Mesh

__all__ = ["ContactBoundary", "TouchedSide", "contact_boundaries", "polylines"]


@dataclass(frozen=True, eq=False)
class TouchedSide:
    """The side of a contact of two bodies that has no contact points of its own."""

    side: str  # the boundary of the mesh
    members: IntArray  # (k, q): displacement nodes of its facets, vertices first
    nodes: IntArray  # (p,): those of its nodes that contact points see
    share: sp.csr_array  # (p, m): how much each contact point of the problem counts there

    @classmethod
    def of(cls, side: str, field: Field, contact: ContactPoints, index: IntArray) -> TouchedSide:
        """The side of that name, touched by the contact points ``index``: where nodes press on it with which part."""
        assert contact.mean is not None
        members = boundary_rule(field.mesh, side, field.order).nodes
        nodes = np.unique(members)
        seen = abs(sp.csr_array(contact.mean[index])[:, nodes]).T @ sp.diags_array(contact.weights[index])
        total = np.asarray(seen.sum(axis=1)).ravel()
        met = np.flatnonzero(total > 0.0)
        pick = sp.csr_array((np.ones(len(index)), (np.arange(len(index)), index)), shape=(len(index), contact.count))
        return cls(
            side, members, nodes[met], sp.csr_array(sp.diags_array(1.0 / total[met]) @ sp.csr_array(seen)[met] @ pick)
        )

    def at_nodes(self, values: Array, fill: float, whole: bool = False) -> Array:
        """Values (m, ...) of contact points at its nodes, ``fill`` at those that see none; of ``whole`` numbers those
        of the contact point that counts most."""
        used = np.unique(self.members)
        out = np.full((len(used), *values.shape[1:]), fill, dtype=float)
        most = np.asarray(self.share.argmax(axis=1)).ravel() if whole else None
        at = np.searchsorted(used, self.nodes)
        out[at] = self.share @ values if most is None else values[most]
        return out


@dataclass(frozen=True, eq=False)
class ContactBoundary:
    """One named contact boundary and its contact points; of two bodies, that of the side that has them."""

    name: str
    mesh: Mesh
    members: IntArray  # (k, q): displacement nodes of the facets, vertices first
    index: IntArray  # (p,): contact points of the discrete problem on this boundary
    nodes: IntArray | None  # (p,): their displacement nodes
    facets: IntArray | None  # (p,): facets whose midpoints they are, in that case
    side: str  # the boundary of the mesh that it is
    touched: TouchedSide | None = None  # what it touches, if that is another body

    @property
    def title(self) -> str:
        """Its name; of two bodies that of the side with the contact points, and of the other one."""
        return self.name if self.touched is None else f"{self.side} against {self.touched.side}"

    @property
    def corners(self) -> IntArray:
        """Vertices of the facets, (k, d)."""
        return self.members[:, : self.mesh.dim]

    @cached_property
    def used_nodes(self) -> IntArray:
        """Displacement nodes of the boundary, sorted."""
        return np.unique(self.members)

    def at_nodes(self, values: Array, fill: float = 0.0, whole: bool = False) -> Array:
        """Values (m, ...) of contact points at :attr:`used_nodes`; ``fill`` where there is no contact point.

        Where contact points are midpoints of facets, a node gets the mean of its facets; of ``whole`` numbers, which
        name something, that of one of them.
        """
        values = np.asarray(values)
        out = np.full((len(self.used_nodes), *values.shape[1:]), fill, dtype=float)
        if self.nodes is not None:
            out[np.searchsorted(self.used_nodes, self.nodes)] = values[self.index]
            return out
        assert self.facets is not None
        node_index = np.searchsorted(self.used_nodes, self.members[self.facets])
        if whole:
            out[node_index] = values[self.index][:, None]
            return out
        total = np.zeros_like(out)
        count = np.zeros(len(out))
        for k in range(node_index.shape[1]):
            np.add.at(total, node_index[:, k], values[self.index])
            np.add.at(count, node_index[:, k], 1.0)
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
        along, start = np.empty(len(self.mesh.nodes(2))), 0.0
        for line in self.lines:
            length = np.linalg.norm(np.diff(self.mesh.points[line], axis=0), axis=1)
            reached = start + np.concatenate([[0.0], np.cumsum(length)])
            along[line[::-1]] = reached[::-1]  # a closed line begins where it ends
            start = reached[-1]
        ends = self.mesh.points[self.corners]
        middle = along[self.corners[:, 0]] + 0.5 * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        if self.nodes is None:
            return middle[self.facets], "arc length"
        along[self.members[:, 2:]] = middle[:, None]
        return along[self.nodes], "arc length"


def contact_boundaries(problem: DiscreteProblem) -> list[ContactBoundary]:
    """The contact boundaries of a problem with a mesh that have contact points, in the order of these.

    A contact over an area is none, and contact points of own arrays that are no nodes are on none.
    """
    contact, field = problem.contact, problem.field
    if field is None:
        raise ProblemError("this problem was made of arrays and has no mesh; give one, of_arrays(..., mesh=...)")
    if contact.points is None or (contact.boundary < 0).any():
        return []
    boundaries = []
    for name in contact.names:
        index = contact.on(name)
        side, other = contact.pairs.get(name, (name, ""))
        if not index.size or side not in field.mesh.boundaries:
            continue
        members = boundary_rule(field.mesh, side, field.order).nodes
        nodes, facets = contact.node[index], contact.facet[index]
        at_nodes = bool((nodes >= 0).all())
        touched = TouchedSide.of(other, field, contact, index) if other else None
        boundaries.append(
            ContactBoundary(
                name,
                field.mesh,
                members,
                index,
                nodes if at_nodes else None,
                None if at_nodes else facets,
                side,
                touched,
            )
        )
    return sorted(boundaries, key=lambda boundary: int(boundary.index[0]))


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
