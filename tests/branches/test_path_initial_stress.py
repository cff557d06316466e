"""The initial stress of a body on a load path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

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


@pytest.mark.parametrize("constant", [(), ("top",)])
def test_it_grows_on_a_load_path_if_it_is_asked_to(constant: tuple[str, ...]) -> None:
    """At each factor the body is that under this part of its stress, with constant loads and moved supports."""
    for support in (0.0, -0.002):

        def part(factor: float, support: float = support) -> hv.ContactProblem:
            stated = on_glue(
                initial_stress=-20.0 * factor, initial_strain={}, initial_scaled=True,
                tractions={"top": (0.0, -5.0 * (1.0 if constant else factor))},
            )  # fmt: skip
            return replace(
                stated,
                supports={**stated.supports, "right": hv.Prescribed((-0.5 * support * factor, support * factor))},
            )

        path = hv.follow_path(part(1.0), (0.0, 1.0), constant=constant)
        line = hv.fem.LoadLine.to(hv.discretize(part(1.0)), constant)
        for end, factor in ((0, 0.0), (-1, 1.0)):
            solved = hv.solve(part(factor))
            np.testing.assert_allclose(path.local[end], solved.local, atol=1e-8 * np.abs(path.local).max())
        half, own = hv.solve(line.at(0.5)), hv.solve(part(0.5))
        np.testing.assert_allclose(half.stress(), own.stress(), atol=1e-8 * np.abs(own.stress()).max())
        assert half.energy == pytest.approx(own.energy, rel=1e-9)


def test_energy_half_way_is_that_of_half_the_load() -> None:
    """The work of the initial stress on prescribed displacements grows with these, and is counted once."""
    stated, half = (
        on_glue(initial_stress=-20.0, tractions={"top": (0.0, -5.0 * part)}) for part in (1.0, 0.5)
    )  # fmt: skip
    stated, half = (
        replace(one, supports={**one.supports, "right": hv.Prescribed((0.001 * part, -0.002 * part))})
        for one, part in ((stated, 1.0), (half, 0.5))
    )
    found = hv.solve(hv.fem.LoadLine.of(stated).at(0.5))
    assert found.energy == pytest.approx(hv.solve(half).energy, rel=1e-9)
