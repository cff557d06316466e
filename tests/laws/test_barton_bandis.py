"""The closure of a rock joint under a pressure, by hand; minimisers against a scan of the energy."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.laws import BartonBandis


@pytest.mark.parametrize("unit", [1.0, 1e-3], ids=["mm", "m"])
@pytest.mark.parametrize("pressure", [0.01, 2.0, 500.0])
@pytest.mark.parametrize("method", ["newton", "multigrid"])
def test_a_block_pressed_on_a_joint_closes_it_as_by_hand(unit: float, pressure: float, method: str) -> None:
    stiffness, closure, stress = 10.0 / unit, 0.2 * unit, pressure
    problem = hv.ContactProblem(
        hv.mesh.rectangle((20.0 * unit, 10.0 * unit), (4, 2)),
        hv.Material.young(2e4, 0.2),
        contact={"bottom": hv.Contact(BartonBandis(stiffness, closure))},
        supports={"left": "roller", "right": "roller"},
        tractions={"top": (0.0, -stress)},
    )
    solution = hv.solve(problem, method=method)
    assert solution.status is hv.Status.CONVERGED
    closed = stress * closure / (stiffness * closure + stress)
    np.testing.assert_allclose(solution.penetration, closed, rtol=1e-8)
    np.testing.assert_allclose(solution.multiplier[:, 0], stress, rtol=1e-7)


def test_minimisers_lie_where_a_scan_of_the_energy_is_lowest() -> None:
    law, r = BartonBandis([3.0, 1e-3, 1e6], [0.2, 5.0, 1e-4]), np.random.default_rng(0)
    for _ in range(20):
        a, b = 10.0 ** r.uniform(-3, 3, 3), r.normal(size=3) * 10.0 ** r.uniform(-3, 5, 3)
        lowest = law.local_argmin(a, b)
        least = np.minimum(b / a, 0.0) - 1.0
        for i in range(3):
            places = np.linspace(least[i], float(law.closure[i]), 20_001)[:-1]  # type: ignore[index]
            one = law.take(np.array([i]))
            energies = 0.5 * a[i] * places**2 - b[i] * places + one.value(places)
            at = lowest[i : i + 1]
            own = (0.5 * a[i] * at**2 - b[i] * at + one.value(at)).item()
            assert own <= energies.min() + 1e-12 * np.abs(energies).max()


def test_its_potential_is_the_integral_of_its_pressure() -> None:
    law = BartonBandis(7.0, 0.3)
    for end in (1e-9, 1e-5, 2.9e-4, 3.1e-4, 0.1, 0.299):
        nodes, weights = np.polynomial.legendre.leggauss(200)
        integral = 0.5 * end * weights @ law.derivative(0.5 * end * (nodes + 1.0))
        assert law.value(np.array([end])).item() == pytest.approx(integral, rel=1e-9)


def test_nothing_closes_it_further_than_its_closure() -> None:
    law = BartonBandis(1.0, 0.5)
    assert np.isposinf(law.value(np.array([0.5, 0.6]))).all()
    assert law.local_argmin(np.array([1.0]), np.array([1e30])).item() < 0.5
