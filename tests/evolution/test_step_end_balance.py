"""A step whose balance of energy does not close to what the residual allows is not solved."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import hemivar as hv
from hemivar.evolution import Evolution, History, Scheme, march
from hemivar.evolution.discrete import discretize_evolution
from hemivar.evolution.initial import initial_state
from hemivar.evolution.jumps import SelectionRule
from hemivar.evolution.stage import Stage
from hemivar.evolution.stage_solver import StageSolution, StageSolver
from hemivar.evolution.stepper import TimeStepper
from hemivar.solvers import Controls, Solution, Status
from tests import bodies


def two_layers(ratio: float = 1.0) -> Evolution:
    """A column on springs under a sudden load, its lower half lighter by a factor."""
    mesh = hv.rectangle((1.0, 1.0), (1, 4))
    high = mesh.points[mesh.cells].mean(axis=1)[:, 1] > 0.5
    regions = {"upper": np.flatnonzero(high), "lower": np.flatnonzero(~high)}
    problem = bodies.body(
        dataclasses.replace(mesh, parent=None, regions=regions),
        hv.Compliance(5.0),
        material=hv.Material.by_region(
            {"upper": hv.Material.lame(4, 4, density=1.0), "lower": hv.Material.lame(4, 4, density=ratio)}
        ),
        supports={"left": hv.Roller(), "right": hv.Roller(), "top": hv.Clamped()},
        tractions={"bottom": (0.0, -1.0)},
    )
    return Evolution(problem, inertia=True)


def closes(found: History) -> bool:
    """Whether the gap is small beside the work."""
    return bool(np.abs(found["gap"]).max() < 1e-4 * np.abs(found["work"]).max())


@pytest.mark.parametrize(
    "scheme", [hv.evolution.Newmark(), hv.evolution.GeneralizedAlpha(0.8)], ids=lambda scheme: scheme.name
)
@pytest.mark.parametrize("ratio", [1.0, 1e-6, 1e-12, 1e-15])
def test_a_march_that_finishes_closes_its_balance(scheme: Scheme, ratio: float) -> None:
    found = march(two_layers(ratio), 0.1, step=0.01, scheme=scheme)
    if found.ended == "finished":
        assert closes(found)
        assert found["numerical"].min() > -0.5 * np.abs(found["work"]).max()
    elif found.ended == "energy made":
        assert (scheme.name, ratio) in {("generalized-alpha", 1e-6), ("generalized-alpha", 1e-12)}
        assert "made energy" in found.messages[-1]
    else:
        assert ratio < 1e-6
        assert found.ended == "inaccurate"
        assert "the energy balance does not close" in found.messages[-1]
        assert "implicit-euler" in found.messages[-1]


def test_next_to_no_mass_is_reported() -> None:
    """The scheme as it is, without shorter steps, is twice as far off as it goes."""
    found = march(two_layers(1e-12), 0.1, step=hv.evolution.FixedStep(0.01, halvings=0), scheme=hv.evolution.Newmark())
    assert found.ended == "inaccurate"


@pytest.mark.parametrize("rtol", [1e-2, 1e-4, 1e-8])
def test_what_the_residual_allows_is_no_alarm(rtol: float) -> None:
    for scheme in (hv.evolution.ImplicitEuler(), hv.evolution.Midpoint(), hv.evolution.Newmark()):
        found = march(two_layers(), 0.1, step=0.01, scheme=scheme, controls=Controls(rtol=rtol))
        assert found.ended == "finished"
        assert len(found.times) == 11


@pytest.mark.parametrize(("off", "status"), [(1e-3, Status.INACCURATE), (1e-11, Status.CONVERGED)])
def test_a_solution_that_is_wrong_does_not_close(off: float, status: Status, monkeypatch: pytest.MonkeyPatch) -> None:
    """Said to be converged, and off by a part of its size."""
    discrete = discretize_evolution(two_layers())
    advance = TimeStepper.of(discrete, hv.evolution.Newmark(), None, Controls())
    first = advance.take(initial_state(advance, 0.01), 0.01).state

    class Wrong(StageSolver):
        def solution(self, stage: Stage, initial: Solution | None, jump: SelectionRule, size: float) -> StageSolution:
            found = super().solution(stage, initial, jump, size).solution
            return StageSolution(dataclasses.replace(found, unknowns=found.unknowns * (1.0 + off)))

    right = advance.stages
    stages = Wrong(discrete, right.bodies, right.solver, right.controls, right.workspace)
    advance = dataclasses.replace(advance, stages=stages)
    taken = advance.take(first, 0.01)
    assert taken.status is status
    assert ("does not close" in taken.remedy) == (status is Status.INACCURATE)


@pytest.mark.parametrize("step", [0.5, 0.25, 0.05])
def test_equilibria_on_both_sides_of_a_softening_are_no_energy_that_was_made(step: float) -> None:
    """A block is pushed through its foundation: each point takes s^2/2k + s^2/2h with it, whatever the steps."""
    law = hv.Softening(10.0, 0.01, 10.0)
    down = hv.Prescribed(lambda x, t: np.tile([0.0, -0.1 * t], (len(x), 1)))
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), (2, 2)), hv.Material.lame(400.0, 400.0), {"bottom": hv.Contact(law)}, {"top": down}
    )
    found = march(Evolution(problem), 1.0, step=step)
    assert found.ended == "finished"
    assert found.ledger["contact"] == pytest.approx(1e-3, rel=1e-9)
    assert found["normal_force"][-1] == 0.0
    missed = [message for message in found.messages if "misses" in message]
    assert len(missed) == (step > 0.1)
    assert all("equilibria" in message and "implicit-euler" not in message for message in missed)
