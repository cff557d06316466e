"""Minimal support: single components at a few nodes that hold a body and hinder no strain."""

from __future__ import annotations

import numpy as np

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import SAME
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics.conditions import Fixed
from hemivar.mesh.mesh import Mesh

__all__ = ["minimal_support"]


def minimal_support(mesh: Mesh, *, axisymmetric: bool = False) -> dict[str, Fixed]:
    """Supports that hold a body and nothing more: 3 components at 2 nodes of a plane body, 6 at 3 nodes in space.

    Their reactions are zero where the loads are in balance, so that the stress is that of the free body; else they tell
    what is missing.  Of a body of revolution one component along the axis is held.

    >>> import hemivar as hv
    >>> hv.mechanics.minimal_support(hv.rectangle((2.0, 1.0), 4))["minimal 2"]
    Fixed(y=0.0, at=((2.0, 1.0),))

    Parameters
    ----------
    mesh : Mesh
        Of one part.  Nodes of the coarsest mesh that it is a refinement of are taken.
    axisymmetric : bool
        Whether the body is one of revolution.

    Raises
    ------
    ProblemError
        The mesh has several parts.
    """
    whole = expect(mesh, Mesh, "the mesh to support", "give a hemivar Mesh")
    if whole.parts.count > 1:
        raise ProblemError(
            f"the mesh has {whole.parts.count} parts; give minimal_support the mesh of the part that is to be held"
        )
    while whole.parent is not None:
        whole = whole.parent.mesh
    points = whole.points
    first = _corner(points)
    if axisymmetric:
        return _named([(points[first], "y")])
    arms = points - points[first]
    second = _farthest(np.einsum("kd,kd->k", arms, arms))
    along = int(np.argmax(np.abs(arms[second]) > (1.0 - SAME) * np.abs(arms[second]).max()))
    rest = "xyz"[: mesh.dim].replace("xyz"[along], "")
    if mesh.dim == 2:
        return _named([(points[first], "xy"), (points[second], rest)])
    turned = np.abs(np.cross(arms[second], arms))  # what a turn about the first two nodes moves
    third = _farthest(np.einsum("kd,kd->k", turned, turned))
    last = int(np.argmax(turned[third] > (1.0 - SAME) * turned[third].max()))
    return _named([(points[first], "xyz"), (points[second], rest), (points[third], "xyz"[last])])


def _corner(points: Array) -> int:
    """The node with the least sum of coordinates, the first one of several."""
    sums = points.sum(axis=1)
    return int(np.argmax(sums <= sums.min() + SAME * np.ptp(points, axis=0).max()))


def _farthest(sizes: Array) -> int:
    """The first of the largest numbers but for rounding."""
    return int(np.argmax(sizes >= (1.0 - SAME) * sizes.max()))


def _named(held: list[tuple[Array, str]]) -> dict[str, Fixed]:
    return {
        f"minimal {number}": Fixed(at=point, **dict.fromkeys(axes, 0.0))
        for number, (point, axes) in enumerate(held, start=1)
    }
