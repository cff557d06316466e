"""The load line of a body that is not linear, and the norms in which its errors are told."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.fem.error_norms import error_norms
from hemivar.fem.load_line import LoadLine
from hemivar.mechanics.gradient_energy import SaturatingFlux


@pytest.mark.parametrize("factor", [0.0, 0.4, -0.7, 1.5])
def test_it_is_the_problem_with_a_part_of_loads_and_displacements(factor: float) -> None:
    def stated(part: float) -> hv.ContactProblem:
        material = hv.Material.hencky(20 / 3, 4.0, 0.25, 0.05)
        held = {"top": hv.Fixed(x=0.02 * part, y=-0.1 * part)}
        foundation = {"bottom": hv.Contact(hv.Compliance(20.0), hv.Tresca(0.1), gap=0.01)}
        pull = {"right": (0.3 * part, 0.1 * part)}
        return hv.ContactProblem(hv.rectangle(cells=2), material, foundation, held, tractions=pull)

    found, expected = LoadLine.of(stated(1.0)).at(factor), hv.discretize(stated(factor))
    assert found.load == pytest.approx(expected.load, abs=1e-13)
    assert found.constant == pytest.approx(expected.constant, abs=1e-14)
    assert found.offset == pytest.approx(expected.offset, abs=1e-15)
    u = 0.05 * np.random.default_rng(2).normal(size=expected.unknowns)
    assert found.energy(u) == pytest.approx(expected.energy(u), rel=1e-12)
    assert found.out_of_balance(u) == pytest.approx(expected.out_of_balance(u), abs=1e-13)
    assert found.field is not None
    assert expected.field is not None
    assert found.field.full(u) == pytest.approx(expected.field.full(u), abs=1e-15)


def test_norms_of_errors_are_those_of_the_lower_tensor_where_it_is_known() -> None:
    def norm(material: hv.Material) -> float:
        stated = hv.ContactProblem(hv.rectangle(cells=2), material, {}, {"left": "clamped"})
        values = np.random.default_rng(3).normal(size=stated.mesh.points.shape)
        return error_norms(stated, values).energy

    low = hv.Material.lame(20 / 3 - 2 / 3, 1.0)
    assert norm(hv.Material.hencky(20 / 3, 4.0, 0.25, 0.05)) == pytest.approx(norm(low), rel=1e-12)
    without = hv.Material.ramberg_osgood(200.0, 0.3, 0.4, 8.0)
    assert norm(without) == pytest.approx(norm(hv.Material.young(200.0, 0.3)), rel=1e-9)
    flux = hv.ScalarProblem(hv.rectangle(cells=2), SaturatingFlux(3.0, 0.5, 1.0), supports={"top": 0.0})
    values = np.random.default_rng(3).normal(size=(9, 1))
    least = hv.ScalarProblem(flux.mesh, flux.material.coefficient.least, supports={"top": 0.0})
    assert error_norms(flux, values).energy == pytest.approx(error_norms(least, values).energy, rel=1e-12)
