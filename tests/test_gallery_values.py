"""One contract for all functions of the gallery: what they return can be given wherever a problem is asked for."""

from __future__ import annotations

import inspect
from collections.abc import Callable

import numpy as np
import pytest

import hemivar as hv
from hemivar import gallery
from hemivar.basics.known_statement import ManufacturedProblem
from hemivar.discrete import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution
from hemivar.gallery.known import KnownProblem, weighted_block
from hemivar.mechanics.statement import ContactProblem

#: What a function needs that has no standard value.
NEEDED: dict[str, dict[str, object]] = {name: {"cells": 8} for name in ("moving_bar", "bar_on_wall", "thrown_bar")}
#: Functions that answer a question about a problem, in numbers.
ANSWERS = {"elastic_bar_penetrations", "shear_block_slips", "bounce", "membrane_radius"}


def functions() -> dict[str, Callable[..., object]]:
    named = {name: getattr(gallery, name) for name in gallery.__all__}
    return {name: found for name, found in named.items() if inspect.isfunction(found) and name not in ANSWERS}


@pytest.mark.parametrize("name", functions())
def test_every_problem_of_the_gallery_is_a_statement(name: str) -> None:
    found = functions()[name](**NEEDED.get(name, {}))
    stated = ManufacturedProblem.of(found)
    assert isinstance(stated, ContactProblem | Evolution | DiscreteProblem)
    assert isinstance(found, ManufacturedProblem) or found is stated


@pytest.mark.parametrize("make", [weighted_block, gallery.manufactured_spring, gallery.softening_block])
def test_a_problem_with_a_known_solution_is_solved_as_it_is(make: Callable[..., KnownProblem]) -> None:
    known = make(n=4)
    found, expected = hv.solve(known), hv.solve(known.problem)
    np.testing.assert_array_equal(found.unknowns, expected.unknowns)
    assert hv.discretize(known).unknowns == expected.problem.unknowns
    assert hv.find_solutions(known).solutions
    assert hv.study(known, 1).levels


def test_a_membrane_and_an_evolution_are_taken_as_well() -> None:
    assert hv.solve(gallery.membrane_obstacle(8)).status is hv.Status.CONVERGED
    known = gallery.relaxing_block()
    history = hv.march(known, until=0.1, step=0.05)
    assert history.steps[-1].time == pytest.approx(0.1)
    with pytest.raises(ProblemError, match="what to discretize"):
        hv.discretize(known)  # an evolution is no problem at rest


def test_an_adaptive_solve_takes_a_known_problem_too() -> None:
    found = hv.bounds.solve_adaptive(gallery.manufactured_spring(n=4), rtol=0.5)
    assert found.levels[-1].distance.relative <= 0.5


def test_the_other_solutions_of_a_block_are_beside_the_first() -> None:
    known = gallery.softening_block(softening=20.0, top_displacement=0.14, n=2)
    assert known.solutions == (known, *known.others)
    depths = [-float(one.displacement(np.zeros((1, 2)))[0, 1]) for one in known.solutions]
    np.testing.assert_allclose(depths, [0.04, 0.1025, 0.14])  # by tests/verification/test_nonmonotone.py solutions all
