"""Density, viscosity and branches of materials."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.mechanics import Branch, Material
from hemivar.mechanics.per_volume import at_place, checked_quantity

POINTS = np.array([[0.0, 0.0], [1.0, 0.5], [0.2, 0.9]])
POINTS_3D = np.column_stack([POINTS, [0.0, 1.0, 2.0]])
MASKS = {"soft": np.array([True, False, False]), "hard": np.array([False, True, True])}


def isotropic(lam: float, mu: float, dim: int) -> np.ndarray:
    """Column by column: the stress of unit strains, shear strains being engineering ones."""
    pairs = [(i, i) for i in range(dim)] + ([(0, 1)] if dim == 2 else [(1, 2), (0, 2), (0, 1)])
    columns = []
    for i, j in pairs:
        eps = np.zeros((dim, dim))
        eps[i, j] += 0.5
        eps[j, i] += 0.5
        sigma = lam * np.trace(eps) * np.eye(dim) + 2 * mu * eps
        columns.append([sigma[p] for p in pairs])
    return np.array(columns).T


@pytest.mark.parametrize("points", [POINTS, POINTS_3D], ids=["2d", "3d"])
def test_viscosity_and_branches_are_what_elasticity_is(points: np.ndarray) -> None:
    dim = points.shape[1]
    material = Material.young(
        10.0,
        0.25,
        viscosity=(3.0, 2.0),
        branches=[Branch(lame=(1.0, 0.5), time=2.0), Branch(young=5.0, poisson=0.25, time=0.5)],
    )
    np.testing.assert_allclose(material.viscosity_tensor(points)[1], isotropic(3.0, 2.0, dim))
    assert material.relaxation_times == (0.5, 2.0)
    np.testing.assert_allclose(material.branch_tensor(0, points)[2], isotropic(2.0, 2.0, dim))
    np.testing.assert_allclose(material.branch_tensor(1, points)[2], isotropic(1.0, 0.5, dim))
    assert material.viscous
    assert not material.inert
    assert material.density_at(points) is None
    np.testing.assert_allclose(material.stiffness_tensor(points)[0], isotropic(4.0, 4.0, dim))
    assert material.homogeneous_in(True, (0, 1))


def test_plane_stress_of_proportional_viscosity_is_that_of_the_body() -> None:
    """With V = A / 10 no stress leaves the plane at any rate, so that both reduce alike."""
    material = Material.lame(3.0, 2.0, "stress", viscosity=(0.3, 0.2), branches=[Branch(lame=(6.0, 4.0), time=1.0)])
    elastic = Material.lame(3.0, 2.0, "stress").stiffness_tensor(POINTS)
    np.testing.assert_allclose(material.viscosity_tensor(POINTS), 0.1 * elastic)
    np.testing.assert_allclose(material.branch_tensor(0, POINTS), 2.0 * elastic)


def test_branches_of_one_time_are_one() -> None:
    material = Material.lame(1.0, 1.0, branches=[Branch(lame=(1, 2), time=1.0), Branch(tensor=np.eye(3), time=1.0)])
    assert material.relaxation_times == (1.0,)
    np.testing.assert_allclose(material.branch_tensor(0, POINTS)[0], isotropic(1.0, 2.0, 2) + np.eye(3))


def test_a_branch_may_relax_shear_only() -> None:
    spring = Branch(lame=(-2.0 / 3.0 * 0.7, 0.7), time=1.0)
    tensor = Material.lame(1.0, 1.0, branches=[spring]).branch_tensor(0, POINTS_3D)[0]
    assert abs(tensor[:3, :3].sum()) < 1e-15
    np.testing.assert_allclose(np.diag(tensor)[3:], 0.7)


def test_constants_that_vary() -> None:
    material = Material.lame(
        1.0,
        lambda x: 1 + x[:, 0],
        density=lambda x: 2 + x[:, 1],
        viscosity=(0.0, lambda x: x[:, 0]),
        branches=[Branch(lame=(lambda x: x[:, 1], 1.0), time=1.0)],
    )
    np.testing.assert_allclose(material.density_at(POINTS), 2 + POINTS[:, 1])
    for k, x in enumerate(POINTS):
        np.testing.assert_allclose(material.viscosity_tensor(POINTS)[k], isotropic(0.0, x[0], 2), atol=1e-15)
        np.testing.assert_allclose(material.branch_tensor(0, POINTS)[k], isotropic(x[1], 1.0, 2))
        np.testing.assert_allclose(material.stiffness_tensor(POINTS)[k], isotropic(1.0, 1 + x[0], 2))
    assert not material.homogeneous_in(True)
    assert not material.homogeneous_in(False, (0,))
    constant, varying = Branch(lame=(1, 1), time=1.0), Branch(lame=(lambda x: x[:, 0], 1.0), time=1.0)
    viscous = Material.lame(1.0, 1.0, viscosity=(0.0, lambda x: x[:, 0]), branches=[constant])
    assert (viscous.homogeneous_in(True), viscous.homogeneous_in(False, (0,))) == (False, True)
    relaxing = Material.lame(lambda x: 1 + x[:, 0], 1.0, viscosity=(1.0, 1.0), branches=[varying])
    assert (relaxing.homogeneous_in(True), relaxing.homogeneous_in(True, (0,))) == (True, False)


def test_by_region() -> None:
    material = Material.by_region(
        {
            "soft": Material.lame(1.0, 1.0, density=2.0, branches=[Branch(lame=(1, 1), time=3.0)]),
            "hard": Material.lame(
                4.0,
                4.0,
                density=3.0,
                viscosity=(5, 6),
                branches=[Branch(lame=(2, 2), time=0.1), Branch(lame=(3, 3), time=3.0)],
            ),
        }
    )
    assert material.inert
    assert material.viscous
    assert material.relaxation_times == (0.1, 3.0)
    np.testing.assert_allclose(material.density_at(POINTS, MASKS), [2.0, 3.0, 3.0])
    V = material.viscosity_tensor(POINTS, MASKS)
    assert not V[0].any()
    np.testing.assert_allclose(V[2], isotropic(5, 6, 2))
    short, long = (material.branch_tensor(i, POINTS, MASKS) for i in range(2))
    assert not short[0].any()
    np.testing.assert_allclose(short[1], isotropic(2, 2, 2))
    np.testing.assert_allclose(long, [isotropic(1, 1, 2), isotropic(3, 3, 2), isotropic(3, 3, 2)])
    np.testing.assert_allclose(V[1], isotropic(5, 6, 2))


def test_statics_knows_nothing_of_it() -> None:
    plain, full = Material.lame(3.0, 2.0), Material.lame(3.0, 2.0, density=1.0, viscosity=(1.0, 1.0))
    np.testing.assert_array_equal(plain.stiffness_tensor(POINTS), full.stiffness_tensor(POINTS))
    assert not plain.viscosity_tensor(POINTS).any()


def test_pickling() -> None:
    material = Material.lame(3.0, 2.0, density=1.0, viscosity=np.eye(3), branches=[Branch(lame=(1, 1), time=2.0)])
    again = pickle.loads(pickle.dumps(material))
    np.testing.assert_array_equal(again.viscosity_tensor(POINTS), material.viscosity_tensor(POINTS))
    np.testing.assert_array_equal(again.branch_tensor(0, POINTS), material.branch_tensor(0, POINTS))


BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "density zero": (lambda: Material.lame(1, 1, density=0.0), "density = 0; it must be positive"),
    "density negative": (lambda: Material.tensor(np.eye(3), density=-2), "density = -2; it must be positive"),
    "density huge": (lambda: Material.lame(1, 1, density=1e200), "density = 1e\\+200; it must lie between"),
    "density nan": (lambda: Material.lame(1, 1, density=math.nan), "density.*not finite"),
    "density vector": (
        lambda: Material.lame(1, 1, density=(1.0, 2.0)),
        "density takes one number or a callable, not shape",
    ),
    "density callable": (
        lambda: Material.lame(1, 1, density=lambda x: x[:, 0]).density_at(POINTS),
        r"density = 0 at x = \[0.0, 0.0\]",
    ),
    "viscosity negative": (lambda: Material.lame(1, 1, viscosity=(0, -1)), "viscosity: mu = -1; it must not be neg"),
    "viscosity indefinite": (lambda: Material.lame(1, 1, viscosity=(-2, 1)), "viscosity: lam = -2; it must be at lea"),
    "viscosity indefinite in space": (
        lambda: Material.lame(1, 1, viscosity=(-0.9, 1)).viscosity_tensor(POINTS_3D),
        "must be at least -2 mu / 3",
    ),
    "viscosity indefinite in plane stress": (
        lambda: Material.lame(1, 1, "stress", viscosity=(-0.9, 1)).viscosity_tensor(POINTS),
        "must be at least -2 mu / 3",
    ),
    "viscosity one number": (lambda: Material.lame(1, 1, viscosity=0.4), r"viscosity = 0.4; give two constants"),
    "viscosity matrix": (
        lambda: Material.tensor(np.eye(3), viscosity=np.diag([1.0, 1.0, -1.0])),
        "viscosity matrix is not positive semidefinite",
    ),
    "viscosity unsymmetric": (
        lambda: Material.tensor(np.eye(3), viscosity=np.triu(np.ones((3, 3)))),
        "viscosity matrix is not symmetric",
    ),
    "viscosity shape": (lambda: Material.tensor(np.eye(3), viscosity=np.eye(2)), r"shape \(2, 2\)"),
    "viscosity of a plane body": (
        lambda: Material.lame(1, 1, viscosity=np.eye(3)).viscosity_tensor(POINTS_3D),
        r"3D mesh needs \(6, 6\)",
    ),
    "time zero": (
        lambda: Branch(lame=(1, 1), time=0.0),
        "relaxation time of a branch is 0.0; it must be a positive number",
    ),
    "time too long": (lambda: Branch(lame=(1, 1), time=1e300), r"is 1e\+300; it must lie between 1e-100 and 1e\+100"),
    "time negative": (lambda: Branch(lame=(1, 1), time=-1), "must be a positive number"),
    "time infinite": (lambda: Branch(lame=(1, 1), time=math.inf), "must be a positive number"),
    "branch of nothing": (lambda: Branch(time=1.0), "a branch is given by nothing"),
    "branch of two": (lambda: Branch(lame=(1, 1), tensor=np.eye(3), time=1.0), "given by lame and tensor"),
    "branch without poisson": (lambda: Branch(young=1.0, time=1.0), "give lame, or young and poisson"),
    "branch with poisson alone": (lambda: Branch(lame=(1, 1), poisson=0.3, time=1.0), "given by lame and poisson"),
    "branch incompressible": (lambda: Branch(young=1.0, poisson=0.5, time=1.0), "poisson = 0.5; it must lie"),
    "branch indefinite": (lambda: Branch(lame=(0, -1), time=1.0), "branch: mu = -1"),
    "branch one number": (lambda: Branch(lame=1.0, time=1.0), "give two constants"),  # type: ignore[arg-type]
    "no branch": (lambda: Material.lame(1, 1, branches=[3.0]), "give a list of Branch"),  # type: ignore[list-item]
    "density of one region": (
        lambda: Material.by_region({"a": Material.lame(1, 1, density=1), "b": Material.lame(1, 1)}),
        "region 'b' has no density",
    ),
    "bedding negative": (lambda: checked_quantity(-1.0, "bedding"), "bedding = -1; it must not be negative"),
    "bedding callable": (
        lambda: at_place(lambda x: -x[:, 0], "bedding", POINTS),
        r"bedding = -1 at x = \[1.0, 0.5\]",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_refused_in_words(name: str) -> None:
    make, message = BAD[name]
    with pytest.raises(ProblemError, match=message):
        make()


def test_a_misspelt_part_is_named() -> None:
    with pytest.raises(ProblemError, match="has no argument 'densty'; did you mean 'density'"):
        Material.lame(1.0, 1.0, densty=1.0)  # type: ignore[call-arg]
