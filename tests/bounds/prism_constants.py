"""Constants of prisms, proved by the energies of their parts: what ``hemivar.bounds.prisms`` has.

A prism or a frustum above a triangle F has parts, N along each edge of F, similar to it and to that above F turned
round.  They do not overlap.  With ``mu_N`` as in :mod:`hemivar.bounds.facet_constants`, and the
larger one of both,

    kappa^2 <= mu_N / (1 - 1 / N).

Turned round, and seen in the mirror of F, one that stands upright is itself: of an isotropic material both have one
constant.

    python -m tests.bounds.prism_constants    # prints the table, in some minutes
"""

from __future__ import annotations

import numpy as np

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds.facet_constants import _without_linear_part
from hemivar.bounds.prisms import KINDS, RATIOS, TRIANGLES
from hemivar.mesh.build import box
from hemivar.mesh.mesh import Mesh

#: How often prisms of the table are cut in halves.
HALVINGS = 3


def prism(base: Array, up: Array) -> Mesh:
    """A prism above a triangle (3, 3), cut into three tetrahedra, the triangle called loaded."""
    cube = box((1.0, 1.0, 1.0), 1)
    at = cube.points[cube.cells]
    half = cube.cells[(at[:, :, 1] <= at[:, :, 0]).all(axis=1)]
    used, cells = np.unique(half, return_inverse=True)
    x = cube.points[used]
    across = x[:, :1] * (base[1] - base[0]) + x[:, 1:2] * (base[2] - base[1])
    mesh = Mesh.oriented(base[0] + across + x[:, 2:] * up, cells.reshape(-1, 4))
    floor = (x[mesh.boundary_facets][:, :, 2] == 0.0).all(axis=1)
    return mesh.with_boundaries({"loaded": mesh.boundary_facets[floor]})


def narrowed(mesh: Mesh, top: float) -> Mesh:
    """A prism of base z = 0 that is cut evenly, with an upper side of this size above the middle: a frustum."""
    points, height = mesh.points.copy(), mesh.points[:, 2:].max()
    middle = points[mesh.boundaries["loaded"]].mean(axis=(0, 1))[:2]
    points[:, :2] = middle + (points[:, :2] - middle) * (1.0 - (1.0 - top) * points[:, 2:] / height)
    return Mesh.trusted(points, mesh.cells, mesh.boundaries, {})


def prism_constant(base: Array, up: Array, compliance: Array, halvings: int = HALVINGS) -> float:
    """``kappa^2`` of a prism of any material: the worse of it and of that turned round."""
    both = (prism(corners, up).refined(halvings) for corners in (base, -base))
    return max(_without_linear_part(mesh, compliance) for mesh in both) / (1.0 - 0.5**halvings)


def triangle(number: int) -> Array:
    """Corners (3, 3) of a triangle of the table."""
    x, y = TRIANGLES[number]
    return np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [x, y, 0.0]]) / np.sqrt(y)


def solid(kind: int, number: int, halvings: int) -> Mesh:
    """A prism or a frustum of the table."""
    top, height = KINDS[kind]
    return narrowed(prism(triangle(number), np.array([0.0, 0.0, height])).refined(halvings), top)


def known(kind: int, number: int, ratio: int, halvings: int = HALVINGS) -> float:
    """An entry of the table, not rounded."""
    compliance = np.linalg.inv(hv.Material.young(1.0, RATIOS[ratio]).stiffness_tensor(np.zeros((1, 3)))[0])
    return _without_linear_part(solid(kind, number, halvings), compliance) / (1.0 - 0.5**halvings)


def main() -> None:
    for kind in range(len(KINDS)):
        for number in range(len(TRIANGLES)):
            row = [known(kind, number, ratio) for ratio in range(len(RATIOS))]
            print("(" + ", ".join(f"{np.ceil(1e4 * value) / 1e4:.4f}" for value in row) + "),", flush=True)


if __name__ == "__main__":
    main()
