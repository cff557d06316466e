"""Certificates, marches, paths and bodies that are not linear know a pair as any contact: by multigrid as condensed."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.certificates import EnergyNorm, certify
from hemivar.evolution import Evolution, march
from hemivar.solvers import Controls
from tests.solvers.test_multigrid_of_pairs import SOFT, pressed, unit_blocks

TIGHT = Controls(rtol=1e-11)
HENCKY = {"viscosity": (0.4, 0.4), "density": 1.0}


def sliding_blocks(material: hv.Material) -> hv.ContactProblem:
    """The upper block is pressed on the lower one, then goes to and fro."""

    def way(x: Array, t: float) -> Array:
        return np.broadcast_to([0.03 * np.sin(3.0 * t), -0.05 * t], x.shape)

    contact = {"u:bottom": hv.Contact(hv.Compliance(200.0), hv.Tresca(0.05), against="l:top")}
    held = {"u:top": hv.Prescribed(way), "l:bottom": hv.Clamped()}
    return hv.ContactProblem(unit_blocks(16, 12), material, contact, held)


@pytest.mark.parametrize(
    ("material", "inertia"),
    [
        (SOFT, False),
        (hv.Material.lame(4.0, 4.0, **HENCKY), False),
        (hv.Material.lame(4.0, 4.0, **HENCKY), True),
        (hv.Material.hencky(20.0 / 3.0, 4.0, 0.25, 0.05, **HENCKY), True),
    ],
    ids=["elastic", "viscous", "inert", "not linear"],
)
def test_multigrid_goes_the_same_way_in_time(material: hv.Material, inertia: bool) -> None:
    found = [
        march(Evolution(sliding_blocks(material), inertia=inertia), 1.0, step=0.25, method=method, controls=TIGHT)
        for method in ("newton", "multigrid")
    ]
    for name in ("elastic", "friction", "normal_force"):
        assert found[0][name] == pytest.approx(found[1][name], rel=1e-8, abs=1e-12), name


@pytest.mark.parametrize(
    ("contact", "push"),
    [
        (hv.Contact(hv.Softening(3.0, 0.02, 0.5), hv.Tresca(0.02), against="l:top"), -0.02),
        (hv.Contact(hv.Signorini(), hv.laws.SlipWeakening(0.02, 1.0, 0.5, 20.0), against="l:top"), -0.02),
        (hv.Contact(hv.laws.BilinearCohesion(0.1, 0.02, 4.0), against="l:top"), 0.02),
    ],
    ids=["softening", "weakening", "cohesion"],
)
def test_the_certificate_by_multigrid_is_that_by_factors(contact: hv.Contact, push: float) -> None:
    problem = hv.discretize(pressed(unit_blocks(24, 16, shift=0.25), contact, push=(0.01, push)))
    solution = hv.solve(problem, method="multigrid", controls=TIGHT)
    by_factor, by_multigrid = EnergyNorm(problem.stiffness), EnergyNorm.by_multigrid(problem)
    exact, quick = (
        certify(problem, solution.unknowns, solution.multiplier, factor=one, trace_constant=False)
        for one in (by_factor, by_multigrid)
    )
    assert exact.margin > 0.0
    assert exact.margin - 1e-3 <= quick.margin <= exact.margin + 1e-12
    assert (quick.kind, quick.unique, quick.stationary) == (exact.kind, exact.unique, exact.stationary)
    assert exact.equilibrium * (1.0 - 1e-6) <= quick.equilibrium <= 1.02 * exact.equilibrium
    assert quick.error_bound <= 2.0 * exact.error_bound


@pytest.mark.parametrize("cells", [(16, 12), (48, 32)])
def test_bodies_that_are_not_linear(cells: tuple[int, int]) -> None:
    material = hv.Material.hencky(20.0 / 3.0, 4.0, 0.25, 0.05)
    contact = hv.Contact(hv.Signorini(), hv.Coulomb(0.3), against="l:top")
    problem = pressed(unit_blocks(*cells), contact, material, (0.02, -0.05))
    found = [hv.solve(problem, method=method, controls=TIGHT) for method in ("newton", "multigrid")]
    assert all(one.status is hv.Status.CONVERGED for one in found)
    np.testing.assert_allclose(found[0].displacement, found[1].displacement, atol=1e-9)
