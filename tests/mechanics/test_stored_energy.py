"""Materials by a stored energy: derivatives, bounds of the tangent, and what a plane model assumes."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import scipy.optimize

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics.material import Material
from tests.bodies import BULK, LEFT, SHEAR, SIZE, hencky

PLANES = [(2, "strain"), (2, "stress"), (3, "strain")]


def strains(dim: int, count: int = 40, seed: int = 0) -> tuple[Array, Array]:
    """Points and strains of sizes from a hundredth to a hundred times that at which the material softens."""
    random = np.random.default_rng(seed)
    size = SIZE * 10.0 ** random.uniform(-2.0, 2.0, (count, 1))
    return random.uniform(0.0, 1.0, (count, dim)), size * random.uniform(-1.0, 1.0, (count, dim * (dim + 1) // 2))


def richardson(function: object, strain: Array) -> Array:
    """Central differences with an extrapolation, the last axis by components of the strain."""
    columns = []
    for i in range(strain.shape[1]):
        rates = []
        for h in (1e-3, 5e-4):
            step = np.zeros_like(strain)
            step[:, i] = h * np.abs(strain).max(axis=1)
            width = 2.0 * step[:, i]
            rise = function(strain + step) - function(strain - step)  # type: ignore[operator]
            rates.append((rise.T / width).T)
        columns.append((4.0 * rates[1] - rates[0]) / 3.0)
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize(("dim", "plane"), PLANES)
def test_the_stress_and_the_tangent_are_derivatives(dim: int, plane: str) -> None:
    material, (points, strain) = hencky(plane=plane), strains(dim)
    stress, tangent = material.stress(points, strain), material.tangent(points, strain)
    found = richardson(lambda e: material.energy(points, e), strain)
    np.testing.assert_allclose(found, stress, rtol=1e-7, atol=1e-8 * np.abs(stress).max())
    second = richardson(lambda e: material.stress(points, e), strain)
    np.testing.assert_allclose(second, tangent, atol=1e-7 * np.abs(tangent).max())
    np.testing.assert_allclose(tangent, tangent.transpose(0, 2, 1), rtol=0.0, atol=1e-13 * np.abs(tangent).max())


@pytest.mark.parametrize(("dim", "plane"), PLANES)
def test_the_tangent_lies_between_its_bounds(dim: int, plane: str) -> None:
    material, (points, strain) = hencky(plane=plane), strains(dim, 400)
    tangent = material.tangent(points, strain)
    low, up = material.lower_tensor(points), material.upper_tensor(points)
    assert np.linalg.eigvalsh(tangent - low).min() > -1e-12
    assert np.linalg.eigvalsh(up - tangent).min() > -1e-12
    assert np.linalg.eigvalsh(low).min() > 0.0
    assert material.bounds_by == "closed form"
    np.testing.assert_allclose(material.stiffness_tensor(points), up, atol=1e-14)


def test_the_bounds_are_met() -> None:
    """The slope of the shear stress runs from the whole modulus at zero strain to the part that is left."""
    points, strain = np.zeros((2, 3)), np.zeros((2, 6))
    strain[1, 3] = 1e6
    tangent = hencky().tangent(points, strain)
    np.testing.assert_allclose(tangent[:, 3, 3], [SHEAR, LEFT * SHEAR], rtol=1e-12)


def test_slopes_of_the_shear_stress() -> None:
    t = np.concatenate([[0.0], np.geomspace(1e-6, 1e3, 2000)])
    strain = np.zeros((t.size, 6))
    strain[:, 5] = np.sqrt(2.0) * t
    stress = hencky().stress(np.zeros((t.size, 3)), strain)[:, 5] * np.sqrt(2.0)
    slope = np.diff(stress) / np.diff(t)
    assert slope.min() >= 2.0 * LEFT * SHEAR * (1.0 - 1e-9)
    assert slope.max() <= 2.0 * SHEAR * (1.0 + 1e-9)
    np.testing.assert_allclose(stress, 2 * SHEAR * (LEFT + (1 - LEFT) / np.sqrt(1 + t**2 / SIZE**2)) * t, rtol=1e-13)


def test_plane_strain_is_the_law_of_space_with_no_strain_across() -> None:
    points, strain = strains(2)
    space = np.zeros((len(points), 6))
    space[:, [0, 1, 5]] = strain
    high = np.column_stack([points, np.zeros(len(points))])
    plane, whole = hencky(), hencky()
    np.testing.assert_allclose(plane.energy(points, strain), whole.energy(high, space), rtol=1e-13)
    stress = whole.stress(high, space)
    np.testing.assert_allclose(plane.stress(points, strain), stress[:, [0, 1, 5]], rtol=1e-12, atol=1e-12)
    tangent = whole.tangent(high, space)[:, [0, 1, 5]][:, :, [0, 1, 5]]
    np.testing.assert_allclose(plane.tangent(points, strain), tangent, atol=1e-12)
    matrices = np.array([[strain[:, 0], strain[:, 2] / 2], [strain[:, 2] / 2, strain[:, 1]]]).transpose(2, 0, 1)
    np.testing.assert_allclose(plane.out_of_plane_stress(points, matrices), stress[:, 2], rtol=1e-12, atol=1e-12)


def test_plane_stress_leaves_no_stress_across() -> None:
    """The strain across is found here by another method, and the energy is the least over it."""
    points, strain = strains(2, 12)
    plane, whole = hencky(plane="stress"), hencky()
    energy, stress = plane.energy(points, strain), plane.stress(points, strain)
    place = np.zeros((1, 3))
    for k in range(len(points)):
        at = np.zeros(6)
        at[[0, 1, 5]] = strain[k]

        def across(value: float, at: Array = at) -> float:
            at[2] = value
            return float(whole.stress(place, at[None])[0, 2])

        reach = 10.0 * np.abs(strain[k]).max()
        across(scipy.optimize.brentq(across, -reach, reach, xtol=1e-16, rtol=1e-14))
        assert whole.energy(place, at[None])[0] == pytest.approx(energy[k], rel=1e-11)
        np.testing.assert_allclose(whole.stress(place, at[None])[0, [0, 1, 5]], stress[k], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("dim", "plane"), PLANES)
def test_what_does_not_soften_is_linear(dim: int, plane: str) -> None:
    points, strain = strains(dim)
    one = Material.hencky(BULK, SHEAR, 1.0, SIZE, plane)
    other = Material.lame(BULK - 2 * SHEAR / 3, SHEAR, plane)
    for answer in ("energy", "stress", "tangent"):
        found, expected = getattr(one, answer)(points, strain), getattr(other, answer)(points, strain)
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12 * np.abs(expected).max())
    for bound in ("lower_tensor", "upper_tensor", "stiffness_tensor"):
        expected = other.stiffness_tensor(points)
        np.testing.assert_allclose(getattr(one, bound)(points), expected, atol=1e-13 * expected.max())
    assert other.linear
    assert not one.linear


def test_regions_mix_linear_and_other_materials() -> None:
    points, strain = strains(2)
    left = points[:, 0] < 0.5
    regions = {"soft": left, "stiff": ~left}
    soft, stiff = hencky(), Material.young(210.0, 0.3)
    mixed = Material.by_region({"soft": soft, "stiff": stiff})
    assert not mixed.linear
    assert Material.by_region({"stiff": stiff}).linear
    assert mixed.bounds_by == "closed form"
    for answer in ("energy", "stress", "tangent"):
        found = getattr(mixed, answer)(points, strain, regions)
        for part, here in ((soft, left), (stiff, ~left)):
            np.testing.assert_array_equal(found[here], getattr(part, answer)(points[here], strain[here]))
    for bound in ("lower_tensor", "upper_tensor"):
        found = getattr(mixed, bound)(points, regions)
        for part, here in ((soft, left), (stiff, ~left)):
            np.testing.assert_array_equal(found[here], getattr(part, bound)(points[here]))


def test_a_viscosity_leaves_the_energy_alone() -> None:
    plain = Material.hencky(BULK, SHEAR, LEFT, SIZE)
    material = Material.hencky(BULK, SHEAR, LEFT, SIZE, density=2.0, viscosity=(0.0, 3.0))
    points, strain = strains(2)
    np.testing.assert_array_equal(material.energy(points, strain), plain.energy(points, strain))
    np.testing.assert_allclose(material.viscosity_tensor(points)[0], np.diag([6.0, 6.0, 3.0]))


def test_constants_that_vary() -> None:
    varying = Material.hencky(lambda x: BULK + x[:, 0], SHEAR, LEFT, lambda x: SIZE * (1.0 + x[:, 1]))
    points, strain = strains(2, 5)
    assert not varying.homogeneous
    for k, (x, y) in enumerate(points):
        one = Material.hencky(BULK + x, SHEAR, LEFT, SIZE * (1.0 + y))
        np.testing.assert_allclose(
            varying.stress(points, strain)[k], one.stress(points[k : k + 1], strain[k : k + 1])[0]
        )
        np.testing.assert_allclose(varying.lower_tensor(points)[k], one.lower_tensor(points[k : k + 1])[0])


def test_it_travels() -> None:
    again = pickle.loads(pickle.dumps(hencky()))
    points, strain = strains(2)
    np.testing.assert_array_equal(again.stress(points, strain), hencky().stress(points, strain))


def test_what_asks_for_a_linear_body_says_so() -> None:
    mesh, contact = hv.rectangle(cells=2), {"top": hv.Contact(hv.Compliance(1.0))}
    problem = hv.ContactProblem(mesh, hencky(), supports={"bottom": hv.Clamped()}, contact=contact)
    with pytest.raises(ProblemError, match="needs a linear body, and the material of this one is not linear"):
        hv.systems.condense(problem)


@pytest.mark.parametrize("sign", ["+", "-"])
def test_a_formula_is_bounded_for_traces_of_both_signs(sign: str) -> None:
    """``W_pp = 2 +- 0.6 tr`` is least at an end, ``|tr| = sqrt(3) reach``, and C_low has that bulk modulus."""
    bounds = hv.Material.potential(f"tr^2 {sign} 0.1*tr^3 + dev2", reach=0.5).bounds(np.zeros((1, 3)))
    least, largest = (2.0 - part * 0.6 * np.sqrt(3.0) * 0.5 for part in (1.0, -1.0))
    assert bounds.bulk[0] == pytest.approx(least, rel=1e-4)
    assert bounds.largest_bulk[0] == pytest.approx(largest, rel=1e-4)
    assert bounds.bulk[0] <= least
