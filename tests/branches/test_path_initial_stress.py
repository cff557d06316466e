"""The initial stress of a body on a load path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import hemivar as hv
from tests.fem.test_initial_load import on_glue


def test_it_stays_on_a_load_path() -> None:
    """At factor zero the body is that under its initial stress alone, with and without prescribed displacements."""
    for support in ({}, {"right": hv.Prescribed((0.0, -0.002))}):
        stated = on_glue(initial_stress=-20.0, tractions={"top": (0.0, -5.0)})
        stated = replace(stated, supports={**stated.supports, **support})
        bare = replace(stated, tractions={}, supports=dict.fromkeys(stated.supports, "clamped"))
        path = hv.follow_path(stated, (0.0, 1.0))
        for end, problem in ((0, bare), (-1, stated)):
            solved = hv.solve(problem)
            np.testing.assert_allclose(path.local[end], solved.local, atol=1e-8 * np.abs(solved.local).max())
