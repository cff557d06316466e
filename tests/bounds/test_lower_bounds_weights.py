"""Bounds of the trace with weights that differ from facet to facet."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds.lower_bounds import TraceFlexibility
from hemivar.mesh import Mesh
from tests import bodies

#: Weight of the body that counts, beside a weight of one on a body so stiff that it hardly moves.
SMALL = 1e-3


def squares(count: int) -> hv.ContactProblem:
    """Squares side by side that share nothing, clamped at the top; all but the first are a million times stiffer."""
    one = hv.rectangle((1.0, 1.0), (3, 3))
    nodes = one.number_of_nodes
    mesh = Mesh.oriented(
        np.vstack([one.points + np.array([2.0 * k, 0.0]) for k in range(count)]),
        np.vstack([one.cells + k * nodes for k in range(count)]),
    ).with_boundaries({"bottom": lambda p: p[:, 1] < 1e-9, "top": lambda p: p[:, 1] > 1.0 - 1e-9})

    def modulus(points: np.ndarray) -> np.ndarray:
        return np.where(points[:, 0] < 1.5, 4.0, 4e6)

    return bodies.body(
        mesh, hv.Signorini(), lame=(modulus, modulus), supports={"top": hv.Clamped()}, body_force=(0.0, -1.0)
    )


def test_a_small_weight_beside_a_large_one_has_the_bounds_of_that_weight_alone() -> None:
    """``c`` is linear in the weight, and a stiff body that shares nothing with the other adds nothing to it."""
    alone = TraceFlexibility(squares(1)).bound(SMALL, SMALL)
    both = TraceFlexibility(squares(2))
    first = both.facets[:, 0] < squares(1).mesh.number_of_nodes
    beside = both.bound(np.where(first, SMALL, 1.0), np.where(first, SMALL, 1.0))
    assert alone.lower <= alone.upper < 1.1 * alone.lower
    for name in ("lower", "upper", "simple"):
        assert getattr(beside, name) == pytest.approx(getattr(alone, name), rel=1e-7)
