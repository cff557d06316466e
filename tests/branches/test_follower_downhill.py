"""The way downhill from a kink at which the law has the slope zero but for rounding."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

import hemivar as hv
from tests.laws.test_scalar_graph_local_minimiser import GLUE


def beam(cells: int) -> hv.DiscreteProblem:
    """A cantilever of Hermite elements, glued to the ground along its length and lifted at its tip."""
    h = 1.0 / cells
    own = np.array(
        [[12, 6 * h, -12, 6 * h], [6 * h, 4 * h * h, -6 * h, 2 * h * h],
         [-12, -6 * h, 12, -6 * h], [6 * h, 2 * h * h, -6 * h, 4 * h * h]]
    ) / h**3  # fmt: skip
    whole = np.zeros((2 * cells + 2, 2 * cells + 2))
    for first in range(0, 2 * cells, 2):
        whole[first : first + 4, first : first + 4] += own
    load = np.zeros(2 * cells)
    load[-2] = 1.0
    rows, weights = np.arange(cells), np.full(cells, h)
    weights[-1] = 0.5 * h
    return hv.DiscreteProblem.of_arrays(
        stiffness=sp.csr_array(whole[2:, 2:]),
        load=load,
        trace=sp.csr_array((-np.ones(cells), (rows, 2 * rows)), shape=(cells, 2 * cells)),
        weights=weights,
        gap=np.zeros(cells),
        law=hv.laws.ContactLaw(GLUE).at(None),
    )


def test_a_glued_beam_of_arrays_is_followed_from_rest() -> None:
    """Its forces vanish at all contact points but the last; the path began with 'unbounded' there."""
    problem = beam(20)
    found = hv.solve(problem, hv.solvers.LoadStepping()).raise_for_status()
    path = hv.follow_path(problem, (0.0, 4.0))
    assert path.first_instability is not None
    assert path.first_instability > 1.0
    first, stable = path.at(1.0)[0]
    assert stable
    assert np.abs(first - found.local).max() < 1e-9
