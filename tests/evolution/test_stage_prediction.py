"""Contact points are told where they will be before a stage is solved by multigrid: how well, and what that spares."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.basics.types import Array
from hemivar.evolution import Evolution, Newmark, march, stage_solver
from hemivar.evolution.history import History
from hemivar.evolution.stage import Stage
from hemivar.evolution.stage_solver import predicted_contact
from hemivar.systems.body import Body
from hemivar.systems.newton_equation import smooth_components
from tests import bodies

TIGHT = hv.Controls(rtol=1e-10)


def survey(n: int) -> Evolution:
    """The survey's body with mass and viscosity, on a load that begins at once."""
    made = gallery.survey("5.1", n, "right")
    return Evolution(replace(made, material=replace(made.material, density=1.0, viscosity=(0.4, 0.4))), inertia=True)


def falling_block(n: int = 16) -> Evolution:
    """A block that falls towards its foundation."""
    contact = hv.Contact(hv.Compliance(2000.0), gap=0.1)
    problem = bodies.square(contact, n, lame=(40.0, 40.0), density=1.0, supports={}, body_force=(0.3, -2.0))
    return Evolution(problem, inertia=True)


@dataclass
class Told:
    """What was expected of each stage, on which body."""

    stages: list[tuple[Stage, Body, Array | None]] = field(default_factory=list)

    def __call__(self, stage: Stage, body: Body) -> Array | None:
        self.stages.append((stage, body, predicted_contact(stage, body)))
        return self.stages[-1][2]


def marched_steps(evolution: Evolution, steps: int, **given: object) -> History:
    options = {"step": 0.01, "method": hv.solvers.NonsmoothMultigrid(), "controls": TIGHT}
    return march(evolution, steps * float(given.get("step", 0.01)), **options | given)  # type: ignore[arg-type]


def at_a_kink(body: Body, x: Array) -> Array:
    """Components of the contact points that lie at a kink."""
    return body.active & ~smooth_components(body.law.linearise(body.local(x)), body.active)


def ends(told: Told, history: History) -> list[Array]:
    """Displacements at the end of each stage."""
    return [stage.before.body.displacement for stage, _, _ in told.stages[1:]] + [history.state.body.displacement]


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> Told:
    found = Told()
    monkeypatch.setattr(stage_solver, "predicted_contact", found)
    return found


def test_a_body_that_keeps_its_acceleration_is_where_it_was_expected(told: Told) -> None:
    # Free fall: after the first step each step adds tau^2 g to the one before, at every point.
    history = marched_steps(falling_block(), 5)
    assert history.steps[-1].values["contact"] == 0.0
    assert told.stages[0][2] is None
    for (stage, body, start), end in zip(told.stages[1:], ends(told, history)[1:], strict=True):
        assert start is not None
        fallen = body.local(start) - body.local(np.zeros(start.shape))
        np.testing.assert_allclose(fallen[:, 0], 2.0e-4, rtol=1e-7)
        np.testing.assert_allclose(np.abs(fallen[:, 1]), 0.3e-4, rtol=1e-7)
        np.testing.assert_allclose(body.local(start), body.local(end - stage.prediction), atol=1e-9)
        assert np.count_nonzero(start) == body.unknown.size  # all else stays where the linear step starts from


def test_most_points_that_change_their_piece_are_foreseen_and_fewer_equations_solved(
    told: Told, monkeypatch: pytest.MonkeyPatch
) -> None:
    history = marched_steps(survey(32), 24)
    wrong = changed = 0
    before = None
    for (stage, body, start), end in zip(told.stages, ends(told, history), strict=True):
        found = at_a_kink(body, end - stage.prediction)
        if start is not None and before is not None:
            wrong += int(np.count_nonzero(at_a_kink(body, start) != found))
            changed += int(np.count_nonzero(before != found))
        before = found
    assert changed >= 20
    assert wrong < 0.5 * changed

    monkeypatch.setattr(stage_solver, "predicted_contact", lambda stage, body: None)
    alone = marched_steps(survey(32), 24)
    spared = [sum(row.solver_steps for row in one.steps) for one in (history, alone)]
    assert spared[0] < spared[1]
    size = np.abs(alone.state.body.displacement).max()
    np.testing.assert_allclose(history.state.body.displacement, alone.state.body.displacement, atol=1e-8 * size)


def test_what_was_expected_wrongly_changes_no_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    # As if every point went far the other way.
    def contrary(stage: Stage, body: Body) -> Array | None:
        start = predicted_contact(stage, body)
        return None if start is None else body.moved(0.0 * start, body.fixed - 0.1 - body.local(start))

    usual = marched_steps(survey(16), 10)
    monkeypatch.setattr(stage_solver, "predicted_contact", contrary)
    other = marched_steps(survey(16), 10)
    assert all(row.residual <= 5e-10 for row in other.steps[1:])
    size = np.abs(usual.state.body.displacement).max()
    np.testing.assert_allclose(other.state.body.displacement, usual.state.body.displacement, atol=1e-8 * size)


def test_nothing_is_expected_where_accelerations_swing(told: Told) -> None:
    marched_steps(survey(16), 4, scheme=Newmark())
    assert len(told.stages) == 1 + 4  # what holds it at the start is looked for, too
    assert all(start is None for _, _, start in told.stages)
