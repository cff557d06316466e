"""Problems between the unloaded body and the loaded one are those of the scaled data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import LoadLine, discretize
from hemivar.laws import Compliance, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Prescribed
from hemivar.solvers import solve
from tests import bodies


def in_proportion(factor: float) -> ContactProblem:
    """A square on a compliant foundation, its top moved and its sides loaded in proportion to a factor."""
    return bodies.square(
        Contact(Compliance(5.0), Tresca(0.05), gap=0.01),
        4,
        lame=(3.0, 2.0),
        supports={"top": Prescribed((0.03 * factor, -0.1 * factor))},
        tractions={"left": (0.2 * factor, 0.0)},
    )


@pytest.mark.parametrize("factor", [0.0, 0.25, 0.5, 1.0, 1.5])
def test_the_energy_of_prescribed_displacements_is_quadratic_in_them(factor: float) -> None:
    line, own = LoadLine.of(in_proportion(1.0)), discretize(in_proportion(factor), check_coercivity=False)
    there = line.at(factor)
    u = np.random.default_rng(3).normal(size=own.unknowns)
    np.testing.assert_allclose(there.out_of_balance(u), own.out_of_balance(u), atol=1e-13)
    np.testing.assert_allclose(there.offset, own.offset, atol=1e-15)
    assert there.energy(u) == pytest.approx(own.energy(u), rel=1e-13)
    assert there.energy(np.zeros(own.unknowns)) == pytest.approx(own.energy(np.zeros(own.unknowns)), rel=1e-13)


@pytest.mark.parametrize("constant", [["body"], ["body", "left"], ["left"]])
@pytest.mark.parametrize("factor", [0.0, 0.4, -0.7, 1.5])
@pytest.mark.parametrize("linear", [True, False])
def test_constant_loads_have_their_size_for_every_factor(constant: list[str], factor: float, linear: bool) -> None:
    def stated(part: float) -> ContactProblem:
        weight, pull = (1.0 if name in constant else part for name in ("body", "left"))
        material = Material.lame(3.0, 2.0) if linear else Material.hencky(20 / 3, 4.0, 0.25, 0.05)
        return replace(
            in_proportion(part),
            material=material,
            body_force=(0.1 * weight, -0.3 * weight),
            tractions={"left": (0.2 * pull, 0.0)},
        )

    own = discretize(stated(factor), check_coercivity=False)
    there = LoadLine.to(discretize(stated(1.0)), constant).at(factor)
    u = 0.05 * np.random.default_rng(3).normal(size=own.unknowns)
    np.testing.assert_allclose(there.out_of_balance(u), own.out_of_balance(u), atol=1e-13)
    assert there.energy(u) == pytest.approx(own.energy(u), rel=1e-12)


def test_work_done_on_the_way_is_the_energy_at_its_end() -> None:
    """Without contact the energy E(t) grows as t^2: at half the load it is a quarter."""
    whole = bodies.square(cells=4, lame=(3.0, 2.0), supports={"top": Prescribed((0.1, 0.0)), "bottom": Clamped()})
    line = LoadLine.of(whole)
    full = solve(line.at(1.0)).energy
    assert full > 1e-3
    assert solve(line.at(0.5)).energy == pytest.approx(0.25 * full, rel=1e-12)


@pytest.mark.parametrize("factor", [np.nan, np.inf, -np.inf])
def test_load_factors_are_finite(factor: float) -> None:
    for line in (LoadLine.of(in_proportion(1.0)), LoadLine(discretize(in_proportion(1.0)))):
        with pytest.raises(ProblemError, match="the load factor is"):
            line.at(factor)
