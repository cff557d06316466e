"""Delamination under dead loads, through its peak: corrected beam theory, the J integral and the energy by hand.

``benchmarks/delamination.py`` prints the figures.
"""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.branches.path import PathEnd
from hemivar.systems import condense
from tests.samples import slow

from . import bent_arms
from .bent_arms import CRACK, HALF, Bending, beside_theory, growing, j_integrals, marched

MODES = [slow(0.0), slow(0.2), slow(0.5), slow(0.8), slow(1.0)]


@pytest.mark.parametrize("mode", MODES)
def test_load_and_opening_are_those_of_corrected_beam_theory(mode: float) -> None:
    """By the compliance the crack is as long as the arms say; at this length its load is that of the theory."""
    found, (seen, off) = marched(mode, 60.0), beside_theory(mode, 60.0)
    assert found.finished
    assert not found["jumped"].any()
    factor, grows = found["load_factor"], growing(seen)
    assert grows.sum() > 3
    assert np.abs(off[grows]).max() < 0.03
    assert 0.92 < factor.max() < 1.0
    assert factor[-1] < 0.92 * factor.max()


@pytest.mark.parametrize("mode", MODES)
def test_a_stronger_layer_is_nearer_to_a_crack_without_a_process_zone(mode: float) -> None:
    weak, strong = (30.0, 60.0) if mode == 1.0 else (60.0, 120.0)  # in shear 320 leave a zone of less than a cell
    assert marched(mode, weak)["load_factor"].max() < marched(mode, strong)["load_factor"].max() < 1.0


@pytest.mark.parametrize("mode", MODES)
def test_what_the_glue_has_dissipated_is_what_forces_and_displacements_say(mode: float) -> None:
    """From one equilibrium to the next, F_0 u_1/2 - F_1 u_0/2 on straight lines between them.

    These lines cut the peaks of points that soften in a step: at most 1.2 %, and 0.44 % with steps half as long.
    """
    found, forces = marched(mode, 60.0), Bending(mode).forces
    moved = np.stack([found[f"{name}.u_y"] for name in ("upper", "lower", "middle")], axis=1) @ forces
    factor = found["load_factor"]
    lost = 0.5 * (factor[:-1] * moved[1:] - factor[1:] * moved[:-1]).sum()
    assert found["memory"][-1] == pytest.approx(lost, rel=0.015)


@pytest.mark.parametrize("mode", MODES)
def test_the_j_integral_of_the_loads_is_that_of_the_glue(mode: float) -> None:
    """On the average of the frames in growth: from frame to frame the points of the zone make it scatter by 1.7 %."""
    outside, inside = j_integrals(mode, 60.0)
    assert outside[-10:].mean() == pytest.approx(inside[-10:].mean(), rel=0.01)


@pytest.mark.parametrize(
    ("mode", "until"),
    [
        slow(0.0, {"max-opening": 0.075}),
        slow(0.2, {"max-opening": 0.08}),
        slow(0.5, {"max-opening": 0.08}),
        slow(0.8, {"max-opening": 0.08}),
        slow(1.0, {"max-slip": 0.05}),
    ],
)
def test_load_and_opening_on_the_path_are_those_of_corrected_beam_theory(mode: float, until: dict[str, float]) -> None:
    """As in time, in less than 1000 points: steps grow with the openings, from those of stiff glue to its break."""
    test = Bending(mode)
    problem = hv.discretize(test.problem(60.0).at_time(1.0))
    path = hv.follow_path(problem, (0.0, 1.3), until=until, max_points=1000)
    assert path.ended is PathEnd.UNTIL
    system, factor = condense(problem), path.load_factor
    moved = np.array([
        problem.load @ system.for_problem(path.line.at(t)).recover(r, lam)[0]
        for t, r, lam in zip(factor, path.local, path.multiplier, strict=True)
    ])  # fmt: skip
    cracks = np.linspace(CRACK, 1.9 * HALF, 4000)
    seen = np.interp(moved[1:] / (factor[1:] * test.unit**2), test.compliance(cracks), cracks)
    off = factor[1:] * test.unit / np.interp(seen, cracks, test.theory(cracks)[0]) - 1.0
    assert seen.max() > CRACK + 6.0
    grows = seen > CRACK + 2.0
    assert np.abs(off[grows]).max() < 0.03
    assert 0.92 < factor.max() < 1.0


@pytest.mark.parametrize("mode", [slow(0.0), slow(0.2)])
def test_a_path_passes_the_break_of_every_point_of_a_coarse_mesh(mode: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """There the path turns sharply, while the derivative of the stiff chart jumps by less than a thousandth."""
    monkeypatch.setattr(bent_arms, "CELLS", 50)
    problem = hv.discretize(Bending(mode).problem(60.0).at_time(1.0))
    path = hv.follow_path(problem, (0.0, 1.3), until={"max-opening": 0.2})
    assert path.ended is PathEnd.UNTIL
    assert len(path) < 1000
