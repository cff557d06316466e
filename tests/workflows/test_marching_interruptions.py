"""Whenever Ctrl-C comes, the work ends with KeyboardInterrupt, or what it returns says that it was interrupted."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics import deadline
from hemivar.basics.types import Array
from hemivar.identification import Measurements
from hemivar.workflows import study_levels
from tests import bodies
from tests.samples import sampled

#: How often each is interrupted, and those that take long.
PLACES, FEW = 12, 3


def glued_square() -> hv.ContactProblem:
    return bodies.square(hv.Adhesive(20.0, 1.0, 5.0), 3, supports={"top": hv.Fixed(x=0.0, y=0.02)})


def sliding_square() -> hv.ContactProblem:
    contact = hv.Contact(hv.laws.ThresholdCompliance(0.3, 2.0), hv.Coulomb(0.4))
    return bodies.square(contact, 3, body_force=(-0.8, -0.8))


def lifted() -> hv.Evolution:
    """It jumps in its second step, and goes downhill."""

    def up(points: Array, t: float) -> Array:
        return np.column_stack([np.zeros(len(points)), np.full(len(points), 0.2 * t)])

    return hv.Evolution(
        bodies.square(hv.FormulaLaw("1 - exp(-(r / 0.03)^2)", reach=1.0), 2, supports={"top": hv.Prescribed(up)})
    )


def fitted() -> object:
    def state(values: dict[str, float]) -> hv.ContactProblem:
        return bodies.square(hv.Compliance(values["k"]), 2, supports={"top": hv.Fixed(x=0.0, y=-values["push"])})

    curve = Measurements({"push": [0.01, 0.02, 0.03]}, {"support.top.force.y": [-0.029, -0.062, -0.089]})
    return hv.identification.identify(state, curve, {"k": (1.0, 50.0)})


WORK: dict[str, Callable[[], object]] = {
    "solve": lambda: hv.solve(sliding_square()),
    "identify": fitted,
    "study": lambda: hv.study(sliding_square(), 1),
    "study_levels": lambda: study_levels(
        lambda level: hv.discretize(bodies.square(hv.Compliance(3.0), 2 * 2**level, body_force=(0.0, -1.0))),
        refine=2,
        measure=lambda solution, _: {"energy": solution.energy},
    ),
    "downhill": lambda: hv.march(lifted(), until=1.0, step=0.5),
    "arc-length": lambda: hv.march(lifted(), until=1.0, step=0.5, jump="arc-length"),
    "solutions": lambda: hv.find_solutions(glued_square()),
    "path": lambda: hv.follow_path(glued_square()),
    "bracket": lambda: hv.branches.load_bracket(bodies.square(hv.Adhesive(20.0, 1.0), 3, body_force=(0.0, 2.0))),
}

LONG = ("downhill", "identify", "arc-length")


class Clock:
    """A clock that is looked at in every piece of work; Ctrl-C comes when it is looked at for the last time."""

    def __init__(self, last: float) -> None:
        self.looks, self.last, self.pressed = 0, last, False

    def perf_counter(self) -> float:
        self.looks += 1
        if self.looks == self.last:
            self.pressed = True
            raise KeyboardInterrupt
        return time.perf_counter()


@pytest.mark.parametrize("name", sampled(WORK, sorted(WORK.keys() - {"arc-length"})))
def test_an_interruption_is_never_lost(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def run(last: float) -> tuple[object, Clock]:
        clock = Clock(last)
        monkeypatch.setattr(deadline, "time", clock)
        return WORK[name](), clock

    _, undisturbed = run(np.inf)
    for last in np.unique(np.linspace(1, undisturbed.looks, FEW if name in LONG else PLACES).astype(int)):
        try:
            found, clock = run(last)
        except KeyboardInterrupt:
            continue
        told = getattr(found, "status", None) or getattr(found, "ended", None) or getattr(found, "interrupted", None)
        assert not clock.pressed or told in (True, "interrupted") or getattr(told, "value", "") == "interrupted"
