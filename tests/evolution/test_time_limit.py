"""The time limit of a march holds within a step."""

from __future__ import annotations

import itertools
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics import deadline
from hemivar.basics.types import Array
from hemivar.errors import MethodError
from tests import bodies


def falling() -> hv.Evolution:
    """A block that is drawn off a foundation that lets go: its second step jumps, which takes many solves."""

    def lifted(points: Array, t: float) -> Array:
        return np.column_stack([np.zeros(len(points)), np.full(len(points), 0.2 * t)])

    law = hv.FormulaLaw("1 - exp(-(r / 0.03)^2)", reach=1.0)
    problem = bodies.square(law, 2, supports={"top": hv.Prescribed(lifted)})
    return hv.Evolution(problem)


def test_a_long_step_is_left_in_the_middle(monkeypatch: pytest.MonkeyPatch) -> None:
    ticks = itertools.count()
    monkeypatch.setattr(deadline, "time", SimpleNamespace(perf_counter=lambda: float(next(ticks))))
    whole = hv.march(falling(), until=1.0, step=0.5)
    asked = next(ticks)
    assert whole.finished
    assert asked > 20  # the clock goes on by one second whenever it is looked at
    limited = hv.march(falling(), until=1.0, step=0.5, max_time=0.8 * asked)
    assert limited.ended == "max_time"
    assert len(limited.steps) == 2
    assert next(ticks) - asked < 0.95 * asked
    assert limited.steps[1].values == whole.steps[1].values
    assert not any("could not be solved" in message for message in limited.messages)


def test_a_limit_of_one_solve_is_not_that_of_the_march() -> None:
    history = hv.march(falling(), until=1.0, step=0.5, controls=hv.Controls(max_time=1e-9))
    assert history.ended != "max_time" or history.messages


def test_the_limit_holds_in_laws_that_are_made_of_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wear, glue and creep one after the other, several times: the law of a step is nested that deep."""
    memory = (hv.laws.Wear(1e-3), hv.laws.Secant(), hv.laws.ViscousFoundation(50.0)) * 5
    contact = hv.Contact(hv.laws.Compliance(400.0, 1.5), memory=hv.laws.MemoryChain(memory))
    material = hv.Material.lame(400.0, 400.0, viscosity=(0.2, 0.2))
    problem = hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 1), material=material, supports={"top": "clamped"}, contact={"bottom": contact}
    )
    evolution, spent = hv.Evolution(problem), -time.process_time()
    assert hv.march(evolution, until=0.1, step=0.02, max_time=0.1).ended == "max_time"
    assert spent + time.process_time() < 2.0
    monkeypatch.setattr(sys.modules["hemivar.evolution.march"], "_BEGIN", 0.0)
    with pytest.raises(MethodError, match="was over before the state at the start was known; give more time"):
        hv.march(evolution, until=0.1, step=0.02, max_time=1e-9)
