"""The evolutions of the survey's authors: they converge, each step has one solution, the ledger closes."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, History, march
from hemivar.gallery import screwed_arch, viscoelastic_beam
from hemivar.gallery.evolution_examples import SCREWED_ARCH_DATA, ScrewedArchData
from tests.samples import slow


def sound(history: History, single: bool = True) -> None:
    """What every run must show."""
    assert history.finished
    assert history.margin > 0.0 or not single
    assert abs(history.ledger["gap"]) < 1e-8 * history.state.ledger.elastic
    assert history.residual < 1e-8


def distance(one: History, other: History) -> float:
    """In the energy norm."""
    stiffness = one.discrete.stiffness
    return math.sqrt(2.0 * stiffness.energy(one.state.body.displacement - other.state.body.displacement))


@pytest.mark.parametrize("data", list(SCREWED_ARCH_DATA))
def test_the_screwed_arch(data: str) -> None:
    history = march(screwed_arch(data, 4), 0.25, step=1 / 32)
    sound(history, data != "friction")  # a bound of 300 u_nu couples too strongly for so long a step
    assert 0.0 < history["penetration"][-1] < 0.1
    assert history.time_error.norm == ""  # no theorem: the bound of friction depends on the solution
    pressed = SCREWED_ARCH_DATA[data].stiffness * np.maximum(history.state.local.displacement[:, 0], 0.0)
    assert history.state.multiplier[:, 0] == pytest.approx(pressed, abs=1e-7 * pressed.max())
    bound = SCREWED_ARCH_DATA[data].friction * np.maximum(history.state.local.displacement[:, 0], 0.0)
    assert (np.abs(history.state.multiplier[:, 1]) <= bound * (1.0 + 1e-6) + 1e-9).all()


def test_a_hard_foundation_lets_the_arch_sink_less() -> None:
    deep = {data: march(screwed_arch(data, 4), 0.125, step=1 / 32)["penetration"][-1] for data in ("one screw", "hard")}
    assert deep["hard"] < 0.5 * deep["one screw"]


def test_the_arch_is_the_one_of_the_paper() -> None:
    for n in (4, 8, 13):
        mesh = screwed_arch("hard", n).problem.mesh
        corners = mesh.points[mesh.cells]
        a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        areas = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
        holes = math.pi * (0.5 * 0.3**2 + 4 * 0.05**2)
        assert areas.sum() == pytest.approx(0.72 - holes, rel=0.05)
        sides = ((corners - corners[:, [1, 2, 0]]) ** 2).sum(axis=(1, 2))
        assert (4.0 * math.sqrt(3.0) * areas / sides).min() > 0.3  # 1 is equilateral
        feet = mesh.points[np.unique(mesh.boundaries["feet"])]
        assert ((feet[:, 0] <= 0.3 + 1e-9) | (feet[:, 0] >= 0.9 - 1e-9)).all()
        lengths = [
            np.linalg.norm(np.diff(mesh.points[mesh.boundaries[name]], axis=1), axis=2).sum()
            for name in ("feet", "top", "right", "screw 1", "screw 4")
        ]
        assert lengths[:3] == pytest.approx([0.6, 1.2, 0.6])
        assert lengths[3:] == pytest.approx([0.1 * math.pi] * 2, rel=0.05)
    held = screwed_arch("four screws", 4).problem.supports
    assert len(held) == 4
    assert list(screwed_arch("hard", 4).problem.supports) == ["screw 1"]


def test_data_of_the_arch_are_refused() -> None:
    with pytest.raises(ProblemError, match="four screws"):
        screwed_arch("five screws")
    with pytest.raises(ProblemError, match="1 or 4"):
        screwed_arch(ScrewedArchData(300.0, 3.0, 2))
    with pytest.raises(ProblemError, match="4 or more"):
        screwed_arch("hard", 3)


@pytest.mark.parametrize("inertia", [True, False], ids=["dynamic", "quasistatic"])
@pytest.mark.parametrize("friction", [None, hv.laws.Logarithmic(0.02, of="rate")], ids=["smooth", "rubbing"])
def test_the_beam(inertia: bool, friction: hv.laws.Friction | None) -> None:
    """Order one in the step; friction that weakens with its rate loses energy."""
    steps = (0.1, 0.05, 0.025, 0.00625)
    ends = [march(viscoelastic_beam(inertia, friction=friction), 0.8, step=step) for step in steps]
    for history in ends:
        sound(history)
    errors = [distance(history, ends[-1]) for history in ends[:-1]]
    assert np.log2(errors[0] / errors[1]) > 0.8
    assert np.log2(errors[1] / errors[2]) > 0.8
    assert (ends[0].ledger["friction"] > 0.0) == (friction is not None)


def test_the_beam_comes_to_rest_where_statics_says() -> None:
    evolution = viscoelastic_beam(False)
    history = march(evolution, 40.0, step=0.5)
    static = hv.solve(hv.discretize(evolution.problem)).raise_for_status()
    at_rest = history.state.body.displacement - static.unknowns
    scale = history.discrete.stiffness.energy(static.unknowns)
    assert history.discrete.stiffness.energy(at_rest) < 1e-12 * scale


@pytest.mark.parametrize("inertia", [True, False], ids=["dynamic", "quasistatic"])
def test_the_beam_on_finer_meshes(inertia: bool) -> None:
    """The energy norm of the solution has twice the order of the error in it, which the clamp keeps below one."""
    norms = []
    for n in (2, 4, 8):
        history = march(viscoelastic_beam(inertia, n, friction=hv.laws.Logarithmic(0.02, of="rate")), 0.8, step=0.1)
        sound(history)
        norms.append(math.sqrt(2.0 * history.state.ledger.elastic))
    gone = np.diff(norms)
    assert (gone > 0.0).all()  # softer on finer meshes
    assert np.log2(gone[0] / gone[1]) > 1.5


@pytest.mark.parametrize("data", ["hard", slow("four screws")])
def test_the_arch_has_order_one_in_the_step(data: str) -> None:
    ends = [march(screwed_arch(data, 4), 0.25, step=step) for step in (1 / 16, 1 / 32, 1 / 128)]
    errors = [distance(history, ends[-1]) for history in ends[:-1]]
    assert np.log2(errors[0] / errors[1]) > 0.9


def test_a_state_of_the_arch_can_start_another_march() -> None:
    """Half of the time twice is the whole."""
    whole = march(screwed_arch("four screws", 4), 0.125, step=1 / 32)
    half = march(screwed_arch("four screws", 4), 0.0625, step=1 / 32)
    problem = screwed_arch("four screws", 4).problem
    rest = Evolution(problem, displacement=half.frames[-1].displacement, start=0.0625)
    again = march(rest, 0.125, step=1 / 32)
    assert distance(again, whole) < 1e-6 * math.sqrt(2.0 * whole.state.ledger.elastic)
    assert dataclasses.asdict(SCREWED_ARCH_DATA["hard"]) == {"stiffness": 3000.0, "friction": 3.0, "screws": 1}
