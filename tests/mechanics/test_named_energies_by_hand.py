"""Locking materials, that of Ramberg and Osgood, and energies of one's own: stresses by hand, bounds, descriptions."""

from __future__ import annotations

import itertools
import pickle
from functools import cache, partial

import numpy as np
import pytest
import scipy.integrate
import scipy.optimize

from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.mechanics import Material, check_material
from hemivar.mechanics.composed_material import lower_elasticity
from hemivar.mechanics.material_registry import MATERIAL_LAWS, named_material
from hemivar.mechanics.material_words import BoundsBy

BULK, SHEAR = 20 / 3, 4.0
HENCKY = "10/3*tr^2 + 4*(0.25*dev2 + 2*0.75*0.05^2*(sqrt(1 + dev2/0.05^2) - 1))"
STEEL = {"E": 200e3, "nu": 0.3, "yield_stress": 400.0, "exponent": 5.0, "offset": 0.4}

#: One of each kind, with the dimensions in which it answers.
EVERY = {
    "lame": lambda: Material.lame(4.0, 4.0),
    "hencky": lambda: Material.hencky(BULK, SHEAR, 0.25, 0.05),
    "hencky in plane stress": lambda: Material.hencky(BULK, SHEAR, 0.25, 0.05, "stress"),
    "ramberg-osgood": lambda: Material.ramberg_osgood(**STEEL, linear_from=0.02),
    "ramberg-osgood in plane stress": lambda: Material.ramberg_osgood(**STEEL, linear_from=0.02, plane="stress"),
    "ramberg-osgood without bound": lambda: Material.ramberg_osgood(**STEEL),
    "ramberg-osgood, linear": lambda: Material.ramberg_osgood(200e3, 0.3, 400.0, 1.0),
    "locking": lambda: Material.locking(BULK, SHEAR, 6.0, 0.03),
    "locking in plane stress": lambda: Material.locking(BULK, SHEAR, 600.0, 0.03, plane="stress"),
    "locking, whole strain": lambda: Material.locking(BULK, SHEAR, 600.0, 0.03, "strain"),
    "formula": lambda: Material.potential(HENCKY, reach=0.5),
    "formula in plane stress": lambda: Material.potential(HENCKY, reach=0.5, plane="stress"),
    "formula that couples": lambda: Material.potential("10/3*tr^2 + 4*dev2 + tr^2*dev2 + 0.1*tr^4", reach=0.5),
    "components": lambda: Material.potential(
        "2*exx^2 + 3*eyy^2 + exx*eyy + 4*exy^2 + sqrt(1 + exx^2 + exy^2) - 1", reach=0.5
    ),
    "components of space": lambda: Material.potential(
        "2*exx^2 + 3*eyy^2 + 2*ezz^2 + exx*eyy + 4*exy^2 + 3*eyz^2 + 3*exz^2 + 5*exx^4", reach=0.3
    ),
}
EVERY |= {
    name: partial(named_material, name, **(entry.example or {}))
    for name, entry in MATERIAL_LAWS.items()
    if not any(made.startswith(name) for made in EVERY) and entry.example is not None
}


@cache
def every(name: str) -> Material:
    """One of these, made where it is first asked for: its bounds are sought then."""
    return EVERY[name]()


@pytest.mark.parametrize("name", EVERY)
def test_it_is_consistent_with_itself(name: str) -> None:
    check_material(every(name))


@pytest.mark.parametrize("name", EVERY)
def test_it_travels(name: str) -> None:
    material = every(name)
    points, strain = np.zeros((3, 2)), np.array([[0.01, 0.0, 0.02], [-0.1, 0.03, 0.0], [0.0, 0.0, 0.0]])
    again = pickle.loads(pickle.dumps(material))
    np.testing.assert_array_equal(again.stress(points, strain), material.stress(points, strain))
    assert str(again.describe()) == str(material.describe())


def uniaxial_stress(material: Material, strain: float) -> float:
    """The pressure of a block between rollers that is shortened."""
    return -float(material.stress(np.zeros((1, 2)), np.array([[0.0, -strain, 0.0]]))[0, 1])


@pytest.mark.parametrize(
    ("material", "law", "penetration"),
    [
        (Material.hencky(BULK, SHEAR, 0.25, 0.05), lambda s: 0.3 + 2.0 * s, 0.062733873583324),
        (Material.hencky(BULK, SHEAR, 0.25, 0.05), lambda s: 20.0 * s, 0.034941569056),
        (Material.locking(BULK, SHEAR, 6.0, 0.03), lambda s: 20.0 * s, 0.0403619615398),
    ],
)
def test_a_block_between_rollers(material: Material, law: object, penetration: float) -> None:
    """Numbers computed apart: the top is pressed down by 0.1, and the bottom stands on a law."""
    found = scipy.optimize.brentq(lambda s: uniaxial_stress(material, 0.1 - s) - law(s), 0.0, 0.1, xtol=1e-15)  # type: ignore[operator]
    assert found == pytest.approx(penetration, rel=1e-11)


# ---- Ramberg and Osgood ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("stress", [1e-3, 100.0, 400.0, 900.0])
@pytest.mark.parametrize("exponent", [2.5, 5.0, 20.0])
def test_a_bar_stretches_as_ramberg_and_osgood_say(stress: float, exponent: float) -> None:
    material = Material.ramberg_osgood(200e3, 0.3, 400.0, exponent, 0.4)
    elastic = stress / 200e3
    plastic = 0.4 * elastic * (stress / 400.0) ** (exponent - 1.0)
    strain = np.zeros((1, 6))
    strain[0, :3] = elastic + plastic, *(2 * [-0.3 * elastic - 0.5 * plastic])
    found = material.stress(np.zeros((1, 3)), strain)[0]
    np.testing.assert_allclose(found, [stress, 0.0, 0.0, 0.0, 0.0, 0.0], rtol=1e-11, atol=1e-10 * stress)
    across = Material.ramberg_osgood(200e3, 0.3, 400.0, exponent, 0.4, plane="stress")
    plane = across.stress(np.zeros((1, 2)), np.array([[strain[0, 0], strain[0, 1], 0.0]]))[0]
    np.testing.assert_allclose(plane, [stress, 0.0, 0.0], rtol=1e-9, atol=1e-9 * stress)


def shear_stress(material: Material, angle: Array) -> Array:
    strain = np.zeros((len(angle), 6))
    strain[:, 5] = angle
    return np.asarray(material.stress(np.zeros((len(angle), 3)), strain)[:, 5])


def test_from_a_strain_on_it_is_linear() -> None:
    """|dev eps| = gamma / sqrt(2): the slope of the shear stress stays, and no corner comes in."""
    bent, straight = Material.ramberg_osgood(**STEEL), Material.ramberg_osgood(**STEEL, linear_from=0.02)
    limit = 0.02 * np.sqrt(2.0)
    before, after = np.linspace(0.0, limit, 50), np.linspace(limit, 10.0 * limit, 50)
    np.testing.assert_allclose(shear_stress(straight, before), shear_stress(bent, before), rtol=1e-13)
    rates = np.diff(shear_stress(straight, after)) / np.diff(after)
    step = np.array([limit - 1e-7, limit])
    rate = float((np.diff(shear_stress(bent, step)) / 1e-7)[0])
    np.testing.assert_allclose(rates, rate, rtol=1e-5)
    lower = straight.lower_tensor(np.zeros((1, 3)))[0, 5, 5]
    assert lower == pytest.approx(rates[0], rel=1e-10)


def test_the_energy_of_ramberg_and_osgood_is_the_integral_of_the_stress() -> None:
    material = Material.ramberg_osgood(**STEEL, linear_from=0.01)
    for angle in (1e-4, 5e-3, 0.1):
        ends = [0.0, min(angle, 0.01 * np.sqrt(2.0)), angle]
        parts = [
            scipy.integrate.quad(lambda g: shear_stress(material, np.array([g]))[0], a, b, epsabs=0.0, epsrel=1e-12)[0]
            for a, b in itertools.pairwise(ends)
            if b > a
        ]
        found = material.energy(np.zeros((1, 3)), np.array([[0.0, 0.0, 0.0, 0.0, 0.0, angle]]))[0]
        assert found == pytest.approx(sum(parts), rel=1e-10)


def test_without_a_linear_branch_it_says_that_nothing_is_bounded() -> None:
    told = Material.ramberg_osgood(**STEEL).describe()
    assert told.ratio == 0.0
    assert "falls to zero" in str(told)
    assert "uniqueness and error bounds cannot be shown" in str(told)
    elastic, plastic = (
        1.3 / 200e3,
        1.5 * 0.4 / 200e3 * (np.sqrt(1.5) / 400.0) ** 4,
    )  # of |dev sigma|, its 5th power
    size = scipy.optimize.brentq(lambda q: elastic * q + plastic * q**5 - 0.02, 0.0, 0.02 / elastic)
    slope = 1.0 / (elastic + 5.0 * plastic * size**4)
    bounded = Material.ramberg_osgood(**STEEL, linear_from=0.02)
    assert bounded.describe().ratio == pytest.approx(slope * elastic, rel=1e-10)


# ---- locking --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("measure", ["deviator", "strain"])
def test_the_stress_of_a_locking_material_is_that_of_a_projection(measure: str) -> None:
    material = Material.locking(BULK, SHEAR, 50.0, 0.03, measure)
    random = np.random.default_rng(4)
    for _ in range(40):
        strain = random.normal(size=(3, 3)) * 10.0 ** random.uniform(-3.0, 0.0)
        strain = 0.5 * (strain + strain.T)
        volume = np.trace(strain) / 3.0 * np.eye(3) if measure == "deviator" else np.zeros((3, 3))
        rest = strain - volume
        projected = volume + rest * min(1.0, 0.03 / np.linalg.norm(rest))
        deviator = strain - np.trace(strain) / 3.0 * np.eye(3)
        expected = BULK * np.trace(strain) * np.eye(3) + 2.0 * SHEAR * deviator + 50.0 * (strain - projected)
        voigt = strain[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]] * np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
        found = material.stress(np.zeros((1, 3)), voigt[None])[0]
        np.testing.assert_allclose(found, expected[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], rtol=1e-12, atol=1e-12)


def test_bounds_of_a_locking_material_are_c_and_c_plus_beta() -> None:
    points = np.zeros((1, 3))
    linear = Material.lame(BULK - 2 * SHEAR / 3, SHEAR).stiffness_tensor(points)
    material = Material.locking(BULK, SHEAR, 6.0, 0.03, "strain")
    np.testing.assert_allclose(material.lower_tensor(points), linear, atol=1e-14)
    identity = np.diag([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])  # sigma = eps, of engineering shear
    np.testing.assert_allclose(material.upper_tensor(points)[0] - linear[0], 6.0 * identity, atol=1e-13)
    far = np.zeros((1, 6))
    far[0, 5] = 1e9
    np.testing.assert_allclose(material.tangent(points, far)[0, 0, 0] - linear[0, 0, 0], 6.0, rtol=1e-9)


# ---- formulas and functions -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_formula_gives_what_the_named_material_gives(plane: str) -> None:
    formula, named = Material.potential(HENCKY, reach=0.5, plane=plane), Material.hencky(BULK, SHEAR, 0.25, 0.05, plane)
    random = np.random.default_rng(5)
    points, strain = np.zeros((50, 2)), 0.1 * random.normal(size=(50, 3))
    for answer in ("energy", "stress", "tangent"):
        found, expected = getattr(formula, answer)(points, strain), getattr(named, answer)(points, strain)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11)
    voigt = 0.5 * np.array([[2.0 * strain[:, 0], strain[:, 2]], [strain[:, 2], 2.0 * strain[:, 1]]]).transpose(2, 0, 1)
    np.testing.assert_allclose(
        formula.out_of_plane_stress(points, voigt), named.out_of_plane_stress(points, voigt), atol=1e-12
    )


def test_intervals_bound_what_is_known_in_closed_form() -> None:
    """On |eps| <= reach the slope falls to its value at the reach, a little above the bound at every strain."""
    told = Material.potential(HENCKY, reach=0.5).describe()
    assert told.bounds_by is BoundsBy.INTERVALS
    assert told.reach == 0.5
    assert told.lower is not None
    assert told.upper is not None
    at_reach = SHEAR * (0.25 + 0.75 / (1.0 + 0.5**2 / 0.05**2) ** 1.5)
    assert 0.94 * at_reach < told.lower[5, 5] <= at_reach
    assert SHEAR <= told.upper[5, 5] < 1.01 * SHEAR
    assert "proved by intervals" in str(told)
    assert "for |eps| <= 0.5" in str(told)


@pytest.mark.parametrize("name", ["formula that couples", "components", "components of space"])
def test_bounds_hold_on_a_dense_grid(name: str) -> None:
    """Eigenvalues of the tangent at 20 000 random strains, by themselves and at the edge of the reach."""
    material = every(name)
    assert material.bounds_by is BoundsBy.INTERVALS
    dim = 2 if name == "components" else 3
    size = dim * (dim + 1) // 2
    random = np.random.default_rng(6)
    way = random.normal(size=(20_000, size))
    way *= material.reach * np.where(np.arange(20_000) % 2, random.uniform(size=20_000), 1.0)[:, None]
    once = np.diag([1.0] * dim + [np.sqrt(2.0)] * (size - dim))
    strain = way / np.linalg.norm(way, axis=1)[:, None] * random.uniform(0.0, material.reach, 20_000)[:, None]
    points = np.zeros((20_000, dim))
    tangent = material.tangent(points, strain @ once)
    low, up = material.lower_tensor(points[:1])[0], material.upper_tensor(points[:1])[0]
    below = np.linalg.eigvalsh(once @ (tangent - low) @ once)[:, 0].min()
    above = np.linalg.eigvalsh(once @ (up - tangent) @ once)[:, 0].min()
    assert below >= -1e-12
    assert above >= -1e-12
    assert np.linalg.eigvalsh(once @ low @ once)[0] > 0.0


def test_a_quadratic_formula_of_components_is_the_tensor() -> None:
    """W of the matrix of engineering strains: its bounds are itself."""
    matrix = np.array([[12.0, 4.0, 1.0], [4.0, 9.0, 0.5], [1.0, 0.5, 3.0]])
    formula = "6*exx^2 + 4*exx*eyy + 2*exx*exy + 4.5*eyy^2 + eyy*exy + 6*exy^2"
    one, other = Material.potential(formula, reach=1.0), Material.tensor(matrix)
    random = np.random.default_rng(7)
    points, strain = np.zeros((9, 2)), random.normal(size=(9, 3))
    for answer in ("energy", "stress", "tangent"):
        np.testing.assert_allclose(
            getattr(one, answer)(points, strain), getattr(other, answer)(points, strain), rtol=1e-12
        )
    for bound in ("lower_tensor", "upper_tensor"):
        np.testing.assert_allclose(getattr(one, bound)(points), getattr(other, bound)(points), rtol=1e-2)


def test_a_formula_with_kinks_is_sampled_and_says_so() -> None:
    material = Material.potential("10/3*tr^2 + 4*dev2 + 3*max(sqrt(dev2) - 0.03, 0)^2", reach=0.5)
    named = Material.locking(BULK, SHEAR, 6.0, 0.03)
    assert material.bounds_by is BoundsBy.SAMPLED
    assert "sampled, not proved" in str(material.describe())
    strain = np.random.default_rng(8).normal(size=(20, 3)) * 0.05
    points = np.zeros((20, 2))
    np.testing.assert_allclose(material.stress(points, strain), named.stress(points, strain), rtol=1e-12, atol=1e-13)


def _quartic(strain: Array) -> Array:
    return np.asarray(2.0 * (strain**2).sum(axis=1) + 0.25 * (strain**4).sum(axis=1))


def _stress(strain: Array) -> Array:
    return np.asarray(4.0 * strain + strain**3)


def _tangent(strain: Array) -> Array:
    return np.asarray((4.0 + 3.0 * strain**2)[:, :, None] * np.eye(strain.shape[1]))


def test_functions_are_sampled_and_say_so() -> None:
    material = Material.potential(_quartic, _stress, _tangent, reach=1.0)
    check_material(material)
    assert material.bounds_by is BoundsBy.SAMPLED
    assert "by the function _quartic" in str(material.describe())
    factors = (
        material.lower_tensor(np.zeros((1, 3)))[0, 0, 0] / 4.0,
        material.upper_tensor(np.zeros((1, 3)))[0, 0, 0] / 4.0,
    )
    assert factors[0] == pytest.approx(1.0, rel=1e-6)
    assert factors[1] == pytest.approx(1.0 + 3.0 * 2.0 / 4.0, rel=0.05)  # of a shear strain sqrt(2)


def test_regions_mix_all_kinds() -> None:
    mixed = Material.by_region({"a": every("formula"), "b": Material.young(1.0, 0.3), "c": every("locking")})
    assert mixed.bounds_by is BoundsBy.INTERVALS
    assert mixed.reach == 0.5
    assert len(check_material(mixed).checks) == 54
    told = str(mixed.describe())
    assert "region 'a': potential" in told
    assert "region 'c':     C_low" in told.replace("region 'c':         ", "region 'c':     ")


def test_constants_that_vary_are_described_at_a_point() -> None:
    material = Material.hencky(lambda x: 1.0 + x[:, 0], SHEAR, 0.25, 0.05)
    assert "bulk = varies" in str(material.describe())
    assert "describe(point=(x, y))" in str(material.describe())
    told = material.describe((2.0, 0.0, 0.0))
    assert "bulk modulus 3, shear modulus 1" in str(told)


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_answers_do_not_depend_on_the_unit_of_stress(factor: float) -> None:
    random = np.random.default_rng(9)
    points, strain = np.zeros((30, 2)), 0.05 * random.normal(size=(30, 3))
    steel = {**STEEL, "E": STEEL["E"] * factor, "yield_stress": STEEL["yield_stress"] * factor}
    pairs = [
        (Material.ramberg_osgood(**steel, linear_from=0.02), every("ramberg-osgood")),
        (Material.locking(BULK * factor, SHEAR * factor, 6.0 * factor, 0.03), every("locking")),
        (Material.potential(f"{factor!r}*({HENCKY})", reach=0.5), every("formula")),
    ]
    for one, other in pairs:
        np.testing.assert_allclose(
            one.stress(points, strain), factor * other.stress(points, strain), rtol=1e-9, atol=1e-15
        )
        np.testing.assert_allclose(one.lower_tensor(points), factor * other.lower_tensor(points), rtol=1e-9)


def test_no_linear_material_lies_below_one_without_a_bound() -> None:
    lower = lower_elasticity(every("ramberg-osgood without bound"))
    with pytest.raises(ProblemError, match=r"no known lower bound at x = \[0.0, 0.0\]"):
        lower.stiffness_tensor(np.zeros((2, 2)))
    bounded = lower_elasticity(every("formula"))
    assert bounded.reach == 0.5
    assert bounded.stiffness_tensor(np.zeros((1, 2)))[0, 2, 2] < SHEAR


def test_a_kink_hides_no_concave_part() -> None:
    """Nothing is shown near the kink at |dev eps| = 0.03, but what is looked at reaches as far as the rest."""
    with pytest.raises(ProblemError, match="is not convex: at tr = "):
        Material.potential("10/3*tr^2 + 4*dev2 + 3*max(sqrt(dev2) - 0.03, 0)^2 - 6*dev2^2", reach=0.5)
    Material.potential("10/3*tr^2 + 4*dev2 + 3*max(sqrt(dev2) - 0.03, 0)^2 - 6*dev2^2", reach=0.3)
