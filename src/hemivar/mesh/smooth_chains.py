"""Which facets of a surface follow each other at small angles, and so stand for a curve."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.mesh.boundary_rule import BoundaryRule

__all__ = ["BEND", "STRAIGHT", "Chains", "chains", "facet_angles"]

#: Angle that is rounding, in radians.
STRAIGHT = 1e-6
#: Angle between neighbouring facets up to which they are taken for those of a curve, in radians.
BEND = np.pi / 6.0 + STRAIGHT


def facet_angles(rule: BoundaryRule) -> tuple[IntArray, Array]:
    """Pairs (p, 2) of facets (k, d) that have a side in common, by their places in the list, and their angles (p,)."""
    facets, normals = rule.facets, rule.normals
    dim = facets.shape[1]
    owner = np.repeat(np.arange(len(facets)), dim)
    sides = np.stack([np.delete(facets, i, axis=1) for i in range(dim)], axis=1).reshape(-1, dim - 1)
    sides = np.sort(sides, axis=1)
    order = np.lexsort(sides.T)
    sides, owner = sides[order], owner[order]
    same = np.flatnonzero((sides[1:] == sides[:-1]).all(axis=1))
    pairs = np.column_stack([owner[same], owner[same + 1]])
    apart = np.linalg.norm(normals[pairs[:, 0]] - normals[pairs[:, 1]], axis=1)
    return pairs, 2.0 * np.arcsin(np.clip(0.5 * apart, 0.0, 1.0))


@dataclass(frozen=True, eq=False)
class Chains:
    """Facets (k, d) in chains that turn by 30 degrees or less from facet to facet."""

    pairs: IntArray  # (p, 2), facets with a side in common
    angle: Array  # (p,)
    chain: IntArray  # (k,), of each facet
    curved: BoolArray  # (k,), whether its chain has facets of three directions or more

    @property
    def turning(self) -> BoolArray:
        """Pairs (p,) of a chain that are no parts of one plane."""
        return np.asarray((self.angle > STRAIGHT) & (self.angle <= BEND))


def chains(rule: BoundaryRule) -> Chains:
    """The chains of facets (k, d)."""
    pairs, angle = facet_angles(rule)
    smooth = pairs[angle <= BEND]
    graph = sp.coo_array((np.ones(len(smooth)), smooth.T), shape=2 * (len(rule.facets),))
    chain = sp.csgraph.connected_components(graph, directed=False)[1]
    at = np.unique(pairs[(angle > STRAIGHT) & (angle <= BEND)])
    directions = np.round(rule.normals[at] / STRAIGHT / 10.0)
    different = np.unique(np.column_stack([chain[at], directions]), axis=0)[:, 0].astype(int)
    several = np.bincount(different, minlength=len(rule.facets)) > 2
    return Chains(pairs, angle, chain, several[chain])
