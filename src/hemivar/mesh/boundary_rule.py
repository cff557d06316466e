"""Boundary rule: the facets of a boundary with nodes, weights and normals, made once for each boundary of a mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from hemivar.basics.types import Array, IntArray
from hemivar.mesh.keys import frozen
from hemivar.mesh.mesh import Mesh

__all__ = ["BoundaryRule", "boundary_rule"]


@dataclass(frozen=True, eq=False)
class BoundaryRule:
    """Facets with what integrals over them, and means at their nodes, ask for."""

    facets: IntArray  # (f, d), corners
    nodes: IntArray  # (f, n), displacement nodes: corners first, then middles of edges
    weights: Array  # (f,), lengths or areas
    normals: Array  # (f, d), outward

    @staticmethod
    def of(mesh: Mesh, facets: IntArray, order: int = 1) -> BoundaryRule:
        """That of facets (f, d) of a mesh, and of nodes of an order."""
        normals, weights = mesh.facet_normals(facets)
        return BoundaryRule(facets, mesh.facet_nodes(facets, order), frozen(weights), frozen(normals))

    @property
    def order(self) -> int:
        """The order of its nodes."""
        return 1 if self.nodes.shape == self.facets.shape else 2

    @property
    def widths(self) -> Array:
        """Lengths (f,) of the facets, in space roots of their areas."""
        return self.weights if self.facets.shape[1] == 2 else np.sqrt(self.weights)

    def take(self, some: IntArray) -> BoundaryRule:
        """Some of the facets."""
        return BoundaryRule(self.facets[some], self.nodes[some], self.weights[some], self.normals[some])

    def summed_normals(self, share: Array | float = 1.0) -> tuple[IntArray, IntArray, Array]:
        """Its nodes (k,), the number among them of each node of a facet (f n,), and sums (k, d) of weighted normals.

        At a node those of the facets around it are summed, of whose weights the ``share`` (f, n) counts.
        """
        nodes, number = np.unique(self.nodes, return_inverse=True)
        number, parts = number.ravel(), self.normals[:, None] * (self.weights[:, None] * share)[..., None]
        parts = np.broadcast_to(parts, (*self.nodes.shape, self.normals.shape[1])).reshape(number.size, -1)
        return nodes, number, np.column_stack([np.bincount(number, part, len(nodes)) for part in parts.T])


def boundary_rule(mesh: Mesh, name: str | None, order: int = 1) -> BoundaryRule:
    """That of a boundary of a mesh, which keeps it; without a name of the whole outer boundary."""
    known = mesh._rules.get((name, order))
    if isinstance(known, BoundaryRule):
        return known
    if order > 1:
        plain = boundary_rule(mesh, name)
        rule = replace(plain, nodes=frozen(mesh.facet_nodes(plain.facets, order)))
    else:
        rule = BoundaryRule.of(mesh, mesh.boundary_facets if name is None else mesh.boundaries[name])
    mesh._rules[name, order] = rule
    return rule
