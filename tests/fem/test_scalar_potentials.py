"""Scalar problems whose flux is not linear in the gradient: derivatives, bounds, closed forms."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.optimize

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.fem import gradient
from hemivar.mechanics import PowerLaw, SaturatingFlux
from hemivar.mechanics.gradient_energy import GradientEnergy

ENERGIES = [PowerLaw(4.0, 0.3, 1.5), PowerLaw(1.5, 0.1, 2.0, 3.0), SaturatingFlux(2.0, 0.25, 0.5)]
FLAT = PowerLaw(2.0, 0.1, 1.0, 3.0)


def strip_on_springs(coefficient: object, cells: int = 4, order: int = 1, top: float = 0.8) -> hv.ContactProblem:
    """A strip held at its top that meets springs at its bottom."""
    return hv.ScalarProblem(
        hv.rectangle((1.0, 1.0), cells),
        coefficient,  # type: ignore[arg-type]
        supports={"top": top},
        contact={"bottom": hv.ScalarContact(hv.Compliance(5.0), level=-0.1)},
        order=order,
    )


@pytest.mark.parametrize("energy", [*ENERGIES, FLAT], ids=repr)
def test_energy_flux_and_derivative_by_differences(energy: GradientEnergy) -> None:
    """Across the gradient from which the flux is linear as well."""
    random = np.random.default_rng(0)
    g, v, h = 2.0 * random.normal(size=(200, 2)), random.normal(size=(200, 2)), 1e-5
    points = np.zeros((200, 2))
    slope = (energy.energy(points, g + h * v) - energy.energy(points, g - h * v)) / (2.0 * h)
    np.testing.assert_allclose(np.einsum("ki,ki->k", energy.stress(points, g), v), slope, rtol=1e-6, atol=1e-8)
    bent = (energy.stress(points, g + h * v) - energy.stress(points, g - h * v)) / (2.0 * h)
    np.testing.assert_allclose(np.einsum("kij,kj->ki", energy.tangent(points, g), v), bent, rtol=1e-4, atol=1e-4)
    values = np.linalg.eigvalsh(energy.tangent(points, g))
    assert energy.least * (1.0 - 1e-12) <= values.min()
    assert values.max() <= energy.most * (1.0 + 1e-12)
    np.testing.assert_array_equal(energy.energy(points, 0.0 * g), 0.0)


@pytest.mark.parametrize(
    "method", [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()], ids=lambda m: m.name
)
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("energy", ENERGIES, ids=repr)
def test_a_strip_without_load(energy: GradientEnergy, order: int, method: hv.solvers.Solver) -> None:
    """The gradient is the same everywhere: u = b at the bottom with F'(0.8 - b) = 5 (b + 0.1)."""

    def off(b: float) -> float:
        size = np.array([abs(0.8 - b)])
        return float(energy.profile(size).secant[0] * (0.8 - b)) - 5.0 * (b + 0.1)

    bottom = scipy.optimize.brentq(off, -0.1, 0.8, xtol=1e-15)
    problem = strip_on_springs(energy, 4, order)
    solution = hv.solve(problem, method, hv.Controls(rtol=1e-11)).raise_for_status()
    np.testing.assert_allclose(solution.local[:, 0], bottom + 0.1, rtol=1e-9)
    slope, flux = gradient(problem, solution.displacement)
    np.testing.assert_allclose(slope[:, 1], 0.8 - bottom, rtol=1e-9)
    np.testing.assert_allclose(flux[:, 1], 5.0 * (bottom + 0.1), rtol=1e-9)
    np.testing.assert_allclose(solution.reactions["top"], 5.0 * (bottom + 0.1), rtol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_a_linear_flux_as_an_energy(order: int) -> None:
    """p = 2 is the linear problem with A = 3; beside a linear region too."""
    linear = hv.solve(strip_on_springs(3.0, order=order), rtol=1e-12)
    other = hv.solve(strip_on_springs(FLAT, order=order), rtol=1e-12)
    np.testing.assert_allclose(other.displacement, linear.displacement, atol=1e-10)
    mesh = linear.problem.origin.mesh  # type: ignore[union-attr]
    high = mesh.points[mesh.cells].mean(axis=1)[:, 1] > 0.5
    mesh = dataclasses.replace(mesh, regions={"high": np.flatnonzero(high), "low": np.flatnonzero(~high)})
    mixed = dataclasses.replace(
        strip_on_springs(1.0, order=order), mesh=mesh, material=hv.Material.gradient({"high": 3.0, "low": FLAT})
    )
    np.testing.assert_allclose(hv.solve(mixed, rtol=1e-12).displacement, linear.displacement, atol=1e-10)


def slope_of(flux: Array) -> Array:
    """Sizes t with ``(1/4 + t^2) t`` = flux, one by one."""
    return np.array([scipy.optimize.brentq(lambda t, q=q: (0.25 + t**2) * t - q, 0.0, 2.0, xtol=1e-15) for q in flux])


def test_the_p_laplacian_under_a_load_converges_with_the_square_of_the_mesh_size() -> None:
    """Of a strip whose top is held the flux at height y is y; u is the integral of the slope from y to 1."""
    off = []
    nodes, weights = np.polynomial.legendre.leggauss(30)
    for cells in (8, 16, 32):
        mesh = hv.rectangle((0.25, 1.0), (cells // 4, cells), "cross")
        problem = hv.ScalarProblem(mesh, PowerLaw(4.0, 0.5, 10.0), supports={"top": 0.0}, source=1.0)
        solution, y = hv.solve(problem).raise_for_status(), mesh.points[:, 1]
        exact = np.array([0.5 * (1 - z) * weights @ slope_of(0.5 * (1 + z) + 0.5 * (1 - z) * nodes) for z in y])
        off.append(np.sqrt(np.mean((solution.displacement[:, 0] - exact) ** 2)))
    rates = np.log2(np.array(off[:-1]) / off[1:])
    assert rates[-1] == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize(
    "make",
    [
        lambda: PowerLaw(1.0, 0.1, 1.0),
        lambda: PowerLaw(3.0, 0.0, 1.0),
        lambda: PowerLaw(3.0, 0.1, np.inf),
        lambda: PowerLaw(np.nan, 0.1, 1.0),
        lambda: PowerLaw(3.0, 0.1, 1.0, -1.0),
        lambda: SaturatingFlux(1.0, 0.0, 1.0),
        lambda: SaturatingFlux(1.0, 1.5, 1.0),
        lambda: SaturatingFlux("a", 0.5, 1.0),
    ],
)
def test_numbers_that_it_cannot_have(make: object) -> None:
    with pytest.raises(ProblemError):
        make()  # type: ignore[operator]
