"""Everyday problems in time, loads and prescribed displacements growing from zero, and their load paths."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from tests.solvers import test_solve_everyday as everyday

PROBLEMS = {kind.__name__: kind for kind in everyday.KINDS}
KINDS = list(PROBLEMS)


def drawn(kind: str, seed: int, cells: int | None = None) -> hv.ContactProblem:
    draw = everyday.Draw.of(seed)
    return PROBLEMS[kind](draw if cells is None else replace(draw, cells=cells))


def grows(value: object) -> Callable[[Array, float], Array]:
    return lambda x, t: np.tile(np.asarray(value, dtype=float) * min(t, 1.0), (len(x), 1))


def ramped(problem: hv.ContactProblem) -> hv.ContactProblem:
    """The problem with what is applied to boundaries growing from zero to what it is at t = 1."""
    supports = {
        name: hv.Prescribed(grows(support.value)) if isinstance(support, hv.Prescribed) else support
        for name, support in problem.supports.items()
    }
    tractions = {name: grows(load) for name, load in problem.tractions.items()}
    return replace(problem, supports=supports, tractions=tractions)


def marches(problem: hv.ContactProblem, inertia: bool) -> None:
    """It goes to its end, where a body without mass is in the equilibrium that statics finds, if there is but one."""
    if inertia:
        problem = replace(problem, material=replace(problem.material, density=1.0))
    step = 0.05 if inertia else 0.1
    history = hv.march(hv.Evolution(ramped(problem), inertia=inertia), until=1.5, step=step)
    assert history.finished, (history.ended, history.messages)
    slips = any(contact.friction.acts for contact in problem.contact.values())
    if not inertia and not slips and history.margin > 0.0:
        still = hv.solve(problem).displacement
        assert np.abs(history.frames[-1].displacement - still).max() <= 1e-6 * np.abs(still).max()


def seeds(kind: str) -> Iterator[int]:
    """A dozen of each kind, others than those of the problems in statics."""
    first = 100 * (1 + KINDS.index(kind))
    yield from range(first, first + 12)


@pytest.mark.parametrize("kind", KINDS)
def test_an_everyday_problem_marches_from_zero(kind: str) -> None:
    marches(drawn(kind, 50, cells=4), inertia=False)


def test_small_steps_downhill_may_end_above_their_own_tolerance() -> None:
    """Those from rest to a strip that is pulled at once: a point lies beside a knot by 1e-12 of the way."""
    marches(drawn("peel", 804), inertia=False)


@pytest.mark.slow
@pytest.mark.parametrize("inertia", [False, True], ids=["at rest", "with mass"])
@pytest.mark.parametrize("kind", KINDS)
def test_everyday_problems_march_from_zero(kind: str, inertia: bool) -> None:
    for seed in seeds(kind):
        marches(drawn(kind, seed), inertia)
