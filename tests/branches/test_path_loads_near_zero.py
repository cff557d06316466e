"""Loads that are zero but for rounding: on paths, in time, and for bodies that are not linear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.branches.nonlinear_follower import tangent_body
from hemivar.errors import ProblemError
from hemivar.evolution import Evolution, march
from hemivar.fem import LoadLine

#: The square of such a load underflows.
NOTHING = 1e-150
LINEAR = hv.Material.young(100.0, 0.3)
SOFTENING = hv.Material.hencky(bulk=20.0, shear=4.0, softened=0.25, strain=0.05)


def held_or_moved(material: hv.Material, law: hv.Superpotential, moved: float = 0.0) -> hv.ContactProblem:
    """A block under a load, held at its left side or moved there."""
    return hv.ContactProblem(
        mesh=hv.rectangle((1.0, 1.0), 3),
        material=material,
        contact={"bottom": hv.Contact(law)},
        supports={"left": hv.Prescribed((moved, 0.0)) if moved else hv.Roller()},
        tractions={"top": (0.0, -1.0)},
    )


@pytest.mark.parametrize("moved", [0.0, 0.01])
@pytest.mark.parametrize("law", [hv.Signorini(), hv.laws.Softening(40.0, 0.02, 25.0)], ids=str)
@pytest.mark.parametrize("material", [LINEAR, SOFTENING], ids=["linear", "not linear"])
def test_a_part_of_a_load_whose_square_underflows_is_carried(
    material: hv.Material, law: hv.Superpotential, moved: float
) -> None:
    """All is linear there: the answer is that of a small load, as much smaller as the load is."""
    line = LoadLine.of(held_or_moved(material, law, moved))
    small, nothing = (hv.solve(line.at(factor)).raise_for_status() for factor in (1e-9, NOTHING))
    np.testing.assert_allclose(nothing.unknowns / NOTHING, small.unknowns / 1e-9, rtol=1e-5, atol=1e-8)


def test_the_linear_body_in_place_of_one_at_rest_has_no_load_to_speak_of() -> None:
    line = LoadLine.of(held_or_moved(SOFTENING, hv.Signorini()))
    rest = line.at(NOTHING)
    body = tangent_body(rest, NOTHING * np.ones(rest.unknowns))
    assert 0.0 < np.abs(body.load).max() < 1e-145


def test_a_stated_load_of_that_size_is_refused_and_one_that_overflows_always() -> None:
    problem = hv.discretize(held_or_moved(LINEAR, hv.Signorini()))
    with pytest.raises(ProblemError, match="underflow"):
        problem.with_(load=NOTHING * problem.load)
    with pytest.raises(ProblemError, match="underflow"):
        hv.discretize(replace(held_or_moved(LINEAR, hv.Signorini()), tractions={"top": (0.0, -NOTHING)}))
    assert problem.under(NOTHING * problem.load).load.any()
    for door in (lambda load: problem.with_(load=load), problem.under):
        with pytest.raises(ProblemError, match="overflow"):
            door(problem.load / NOTHING)


@pytest.mark.parametrize("material", [LINEAR, SOFTENING], ids=["linear", "not linear"])
def test_a_load_that_passes_near_zero_in_time_is_marched_through(material: hv.Material) -> None:
    """Steps of one second; in the second one nothing but rounding of the load is left, and the body is at rest."""
    stated = replace(
        held_or_moved(material, hv.laws.Compliance(40.0)),
        tractions={"top": lambda x, t: np.outer(np.full(len(x), [0.0, 0.1, NOTHING, 0.1][round(t)]), (0.0, -1.0))},
    )
    history = march(Evolution(stated), 3.0, step=1.0)
    sizes = [float(np.abs(frame.displacement).max()) for frame in history.frames]
    assert sizes[2] < 1e-14 * sizes[1]
    assert sizes[3] == pytest.approx(sizes[1], rel=1e-8)
