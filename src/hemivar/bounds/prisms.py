"""Prisms and frusta above facets in space: where they have room, and what of a trace on the facet they do not see.

``kappa^2 = sup |v - Pi_1 v|_F^2 / |v|_{a,R}^2`` is known for some prisms R of isotropic materials, proved by
``prism_constants`` of the tests.  A prism of another shape and material is compared with them.  With A the map from a
known prism and ``v^ = A' v`` strains are related by ``eps^ = A' eps A``.  So with ``S^ = (A'SA) / |det A|`` the
compliance that is pulled back, and C the stiffness of the known prism,

    kappa^2 <= |F| / |F^| |A^-1|^2 c kappa^2(R^),      c the largest eigenvalue of ``C^1/2 S^ C^1/2``.

Where facets meet at an angle prisms overlap.  A frustum does not: its upper side is half as large, above the middle.
Parts of it are similar to it as well, and so is the map.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import permutations

import numpy as np

from hemivar.basics.arrays import DIGITS, SAME
from hemivar.basics.types import Array, IntArray
from hemivar.bounds.facet_table import FacetTable
from hemivar.bounds.split_element import pulled_back

__all__ = [
    "KINDS",
    "RATIOS",
    "SQUARES",
    "TRIANGLES",
    "Solids",
    "prism_squares",
    "prisms",
    "room",
    "tolerance",
]

#: Upper sides of known prisms and frusta, the lower one being one, and their heights in terms of the root of twice the
#: area of the facet.
KINDS = ((1.0, 0.5), (1.0, 0.25), (1.0, 0.125), (0.5, 0.5), (0.5, 0.25))
#: Their Poisson's ratios; Young's modulus is one.
RATIOS = (0.0, 0.2, 0.4)
#: Their triangles: the longest edge is from (0, 0) to (1, 0), and here is the third corner. They are scaled to twice
#: their area one.
TRIANGLES = (
    (0.5, 0.75**0.5),
    (0.65, 0.75),
    (0.5, 0.65),
    (0.7, 0.6),
    (0.5, 0.5),
    (0.65, 0.5),
    (0.8, 0.5),
    (0.5, 0.4),
    (0.65, 0.4),
    (0.8, 0.4),
    (0.5, 0.3),
    (0.7, 0.3),
    (0.85, 0.3),
    (0.5, 0.2),
    (0.7, 0.2),
    (0.9, 0.2),
)
#: ``kappa^2`` by kind, triangle and ratio, rounded up.
SQUARES = (
    (
        (1.0766, 1.1703, 1.2657),
        (1.2660, 1.3664, 1.4646),
        (1.2371, 1.3376, 1.4369),
        (1.7871, 1.9151, 2.0344),
        (1.6823, 1.8049, 1.9210),
        (2.1044, 2.2488, 2.3812),
        (2.8935, 3.0786, 3.2432),
        (2.3551, 2.6817, 3.0996),
        (3.0697, 3.2664, 3.4447),
        (4.3561, 4.6125, 4.8342),
        (3.8364, 4.0572, 4.2524),
        (6.0679, 6.4012, 6.6852),
        (9.0938, 9.5592, 9.9489),
        (8.8250, 9.2405, 9.5929),
        (14.9839, 15.6765, 16.2514),
        (27.0704, 28.2085, 29.1453),
    ),
    (
        (1.5817, 1.7303, 1.8802),
        (1.8735, 1.9094, 1.9657),
        (1.9562, 2.0282, 2.1288),
        (2.6153, 2.6613, 2.7273),
        (2.8243, 2.9291, 3.0526),
        (3.1567, 3.2375, 3.3436),
        (3.9838, 4.0664, 4.2639),
        (11.8526, 14.0596, 16.2452),
        (13.0864, 15.3107, 17.4892),
        (5.8998, 6.1973, 6.4791),
        (12.5726, 14.9104, 17.2244),
        (14.9814, 17.4295, 19.7884),
        (20.5403, 23.3316, 25.9521),
        (14.2038, 16.8424, 19.4502),
        (22.0471, 22.7774, 23.4705),
        (41.1271, 42.2411, 43.2817),
    ),
    (
        (9.0986, 8.5816, 8.1578),
        (11.9233, 11.9128, 11.9738),
        (12.5304, 12.5972, 12.7606),
        (17.4655, 17.5710, 17.6517),
        (19.0180, 19.2941, 19.5889),
        (21.5129, 21.7189, 21.8941),
        (27.7989, 27.9406, 27.9926),
        (84.0360, 99.6602, 115.1303),
        (93.2009, 108.9793, 124.4158),
        (40.6655, 40.8539, 40.9281),
        (86.7598, 102.8485, 118.7615),
        (104.3481, 121.3036, 137.6172),
        (145.4626, 165.0672, 183.4155),
        (97.2558, 109.8855, 126.8528),
        (121.2794, 132.2016, 150.1632),
        (186.2979, 211.2996, 234.5544),
    ),
    (
        (1.7457, 1.8651, 1.9936),
        (2.4024, 2.5221, 2.6467),
        (2.2835, 2.4037, 2.5310),
        (3.6811, 3.8255, 3.9681),
        (3.3100, 3.4440, 3.5794),
        (4.4719, 4.6303, 4.7838),
        (6.5821, 6.7807, 6.9657),
        (4.8894, 5.0498, 5.2045),
        (6.9272, 7.1311, 7.3207),
        (10.6569, 10.9214, 11.1587),
        (8.7660, 8.9778, 9.1684),
        (15.4929, 15.8248, 16.1148),
        (24.7640, 25.2115, 25.5896),
        (22.9002, 23.2737, 23.5862),
        (43.6548, 44.2994, 44.8264),
        (84.9375, 85.9398, 86.7244),
    ),
    (
        (4.2892, 4.3923, 4.5023),
        (5.1370, 5.2698, 5.4082),
        (5.1720, 5.2982, 5.4322),
        (7.0483, 7.1913, 7.3351),
        (7.1625, 7.2896, 7.4212),
        (8.4375, 8.5866, 8.7343),
        (11.5930, 11.8582, 12.1206),
        (16.0231, 18.2192, 20.2954),
        (19.1576, 21.6119, 23.8707),
        (19.0691, 19.4079, 19.7363),
        (18.0574, 20.2420, 22.5731),
        (28.4127, 28.9851, 30.0364),
        (45.3613, 45.9249, 46.4770),
        (43.6690, 44.0267, 44.3582),
        (81.5240, 82.2380, 82.9008),
        (159.6780, 160.7071, 161.6476),
    ),
)


def prism_squares(kind: IntArray, corners: Array, inward: Array, compliance: Array) -> Array:
    """Upper bounds of ``kappa^2`` (k,) of the triangles (k, 3, 3) for the prisms between them and their shifts (k, 3).

    Shapes: ``kind`` (k,), ``corners`` (k, 3, 3) and (k, 3), ``inward`` (k, 3, 3) and (k, 3), ``compliance`` (k or 1, 6,
    6).
    """
    known, roots = _known()
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
    gram = edges.transpose(0, 2, 1) @ edges
    area = np.sqrt(np.linalg.det(gram))  # twice that of the triangle
    flat = np.linalg.cholesky(gram).transpose(0, 2, 1)
    off = np.sum((flat[:, None, None] @ known) ** 2, axis=(3, 4)) / area[:, None, None]
    off = np.round(off, DIGITS)  # of triangles that are alike the first is taken, not what rounding says
    shift = np.argmin(off, axis=2)
    nearest = np.argsort(off.min(axis=2), axis=1, kind="stable")[:, :3]
    count = nearest.shape[1]
    chosen = known[nearest, np.take_along_axis(shift, nearest, axis=1)]
    change: Array = np.empty((len(corners), count, 3, 3))
    change[:, :, :, :2] = edges[:, None] @ chosen
    change[:, :, :, 2] = (inward / np.array(KINDS)[kind, 1:])[:, None]
    change = change.reshape(-1, 3, 3)
    full = np.broadcast_to(compliance, (len(corners), 6, 6))
    pulled = pulled_back(np.repeat(full, count, axis=0), change, np.abs(np.linalg.det(change)))
    worst = np.linalg.eigvalsh(roots.transpose(0, 2, 1) @ pulled[:, None] @ roots)[..., -1]
    shrunk = np.linalg.svd(change, compute_uv=False)[:, -1] ** -2
    squares = (shrunk[:, None] * worst).reshape(len(corners), count, len(RATIOS))
    return np.asarray(area * (squares * np.array(SQUARES)[kind[:, None], nearest]).min(axis=(1, 2)))


@cache
def _known() -> tuple[Array, Array]:
    """Inverse maps (t, 6, 2, 2) from known triangles, corners in any order, and roots (r, 6, 6) of stiffness."""
    inverses = []
    for x, y in TRIANGLES:
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [x, y]]) / np.sqrt(y)
        orders = (corners[list(order)] for order in permutations(range(3)))
        inverses.append([np.linalg.inv((turned[1:] - turned[0]).T) for turned in orders])
    stiffness = []
    for ratio in RATIOS:
        compliance = np.full((6, 6), -ratio)
        compliance[3:], compliance[:, 3:] = 0.0, 0.0
        np.fill_diagonal(compliance, np.repeat([1.0, 2.0 * (1.0 + ratio)], 3))
        stiffness.append(np.linalg.inv(compliance))
    return np.array(inverses), np.linalg.cholesky(np.array(stiffness))


@dataclass(frozen=True, eq=False)
class Solids:
    """Convex bodies or flat pieces, by what tells them apart."""

    points: Array  # (k, p, 3)
    #: Of their faces.
    normals: Array  # (k, n, 3)
    #: Directions of their edges.
    ribs: Array  # (k, e, 3)

    def __getitem__(self, some: IntArray) -> Solids:
        return Solids(self.points[some], self.normals[some], self.ribs[some])

    @staticmethod
    def simplices(corners: Array) -> Solids:
        """Triangles (k, 3, 3) or tetrahedra (k, 4, 3)."""
        first, second = np.triu_indices(corners.shape[1], 1)
        ribs = corners[:, second] - corners[:, first]
        across = [(0, 1)] if corners.shape[1] == 3 else [(0, 1), (0, 2), (1, 2), (3, 4)]
        return Solids(corners, np.stack([np.cross(ribs[:, a], ribs[:, b]) for a, b in across], axis=1), ribs)

    def meeting(self, other: Solids, tolerance: float) -> tuple[IntArray, IntArray]:
        """Pairs that have inner points in common, by separating axes; up to a length that is rounding."""
        low, high = self.points.min(axis=1) + tolerance, self.points.max(axis=1) - tolerance
        below, above = other.points.min(axis=1), other.points.max(axis=1)
        near = ((high[:, None] > below) & (low[:, None] < above)).all(axis=2)
        first, second = np.nonzero(near)
        mine, theirs = self[first], other[second]
        number = self.ribs.shape[1] * other.ribs.shape[1]
        crossed = np.cross(mine.ribs[:, :, None], theirs.ribs[:, None]).reshape(len(first), number, 3)
        axes = np.concatenate([mine.normals, theirs.normals, crossed], axis=1)
        length = np.linalg.norm(axes, axis=2, keepdims=True)
        some = length > 0.0
        axes = np.where(some, axes / np.where(some, length, 1.0), 0.0)
        one, two = mine.points @ axes.transpose(0, 2, 1), theirs.points @ axes.transpose(0, 2, 1)
        apart = one.max(axis=1) <= two.min(axis=1) + tolerance
        apart |= one.min(axis=1) >= two.max(axis=1) - tolerance
        common = ~(apart & some[:, :, 0]).any(axis=1)
        return first[common], second[common]


def prisms(corners: Array, inward: Array, top: Array | float = 1.0) -> Solids:
    """Prisms between triangles (k, 3, 3) and their shifts (k, 3), or frusta with an upper side of another size."""
    sides = corners[:, [1, 2, 0]] - corners
    middle = corners.mean(axis=1, keepdims=True)
    above = middle + np.reshape(top, (-1, 1, 1)) * (corners - middle) + inward[:, None]
    normals = np.concatenate([np.cross(sides[:, :1], sides[:, 1:2]), np.cross(sides, above - corners)], axis=1)
    return Solids(np.concatenate([corners, above], axis=1), normals, np.concatenate([sides, above - corners], axis=1))


def room(table: FacetTable, facets: IntArray, walls: IntArray, kinds: tuple[int, ...]) -> IntArray:
    """The first of some kinds (k,) that has no wall in it above facets; -1 where all have one.

    Shapes: ``facets`` (k,) and (m,), ``walls`` (k,) and (m,).
    """
    corners = table.mesh.points[table.facets[facets]]
    barrier = Solids.simplices(table.mesh.points[table.facets[walls]])
    up = -np.sqrt(2.0 * table.measures[facets])[:, None] * table.normals_of(facets)
    first = np.full(len(facets), -1)
    for kind in kinds:
        waiting, (top, height) = np.flatnonzero(first < 0), KINDS[kind]
        tried = prisms(corners[waiting], height * up[waiting], top)
        blocked, _ = tried.meeting(barrier, tolerance(table.mesh.points))
        first[np.delete(waiting, np.unique(blocked))] = kind
    return first


def tolerance(points: Array) -> float:
    """A length up to which solids of a mesh overlap by rounding."""
    return SAME * float(np.ptp(points, axis=0).max())
