"""Elastic materials."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.mechanics import Material
from hemivar.mechanics.material_words import PlaneState

POINTS = np.array([[0.0, 0.0], [1.0, 0.5], [0.2, 0.9]])
POINTS_3D = np.column_stack([POINTS, [0.0, 1.0, 2.0]])


def test_lame_in_the_plane() -> None:
    C = Material.lame(3.0, 2.0).stiffness_tensor(POINTS)
    assert C.shape == (3, 3, 3)
    np.testing.assert_allclose(C[1], [[7, 3, 0], [3, 7, 0], [0, 0, 2]])


def test_young_equals_lame() -> None:
    E, nu = 210.0, 0.3
    lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    for points in (POINTS, POINTS_3D):
        np.testing.assert_allclose(
            Material.young(E, nu).stiffness_tensor(points), Material.lame(lam, mu).stiffness_tensor(points)
        )


def test_plane_stress() -> None:
    E, nu = 5.0, 0.25
    expected = E / (1 - nu**2) * np.array([[1, nu, 0], [nu, 1, 0], [0, 0, (1 - nu) / 2]])
    C = Material.young(E, nu, plane="stress").stiffness_tensor(POINTS)
    np.testing.assert_allclose(C[0], expected)
    lam, mu = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    np.testing.assert_allclose(Material.lame(lam, mu, PlaneState.STRESS).stiffness_tensor(POINTS)[0], expected)


def test_three_dimensions() -> None:
    C = Material.lame(1.0, 2.0).stiffness_tensor(POINTS_3D)[0]
    np.testing.assert_allclose(C[:3, :3], np.full((3, 3), 1.0) + 4 * np.eye(3))
    np.testing.assert_allclose(C[3:, 3:], 2 * np.eye(3))


def test_callable_parameters() -> None:
    varying = Material.lame(lambda x: 1 + x[:, 0], lambda x: 2 + x[:, 1])
    C = varying.stiffness_tensor(POINTS)
    for k, x in enumerate(POINTS):
        np.testing.assert_allclose(C[k], Material.lame(1 + x[0], 2 + x[1]).stiffness_tensor(x[None])[0])
    tensor = Material.tensor(lambda x: (1 + x[:, 0])[:, None, None] * np.eye(3))
    np.testing.assert_allclose(tensor.stiffness_tensor(POINTS)[1], 2 * np.eye(3))


def test_out_of_plane_stress() -> None:
    strain = np.zeros((3, 2, 2))
    strain[:, 0, 0], strain[:, 1, 1], strain[:, 0, 1] = 0.1, 0.2, 0.05
    np.testing.assert_allclose(Material.lame(3.0, 2.0).out_of_plane_stress(POINTS, strain), 0.9)
    assert not Material.lame(3.0, 2.0, "stress").out_of_plane_stress(POINTS, strain).any()
    assert not Material.tensor(np.eye(3)).out_of_plane_stress(POINTS, strain).any()
    general = Material.tensor(np.eye(3), out_of_plane=(1.0, 2.0, 3.0))
    np.testing.assert_allclose(general.out_of_plane_stress(POINTS, strain), 0.1 + 0.4 + 0.3)


def test_by_region() -> None:
    material = Material.by_region({"a": Material.lame(1.0, 1.0), "b": Material.lame(2.0, 2.0, "stress")})
    masks = {"a": np.array([True, False, False]), "b": np.array([False, True, True]), "c": np.ones(3, bool)}
    C = material.stiffness_tensor(POINTS, masks)
    assert C[0, 2, 2] == 1.0
    assert C[2, 2, 2] == 2.0
    strain = np.broadcast_to(np.eye(2), (3, 2, 2))
    np.testing.assert_allclose(material.out_of_plane_stress(POINTS, strain, masks), [2.0, 0.0, 0.0])
    with pytest.raises(ProblemError, match=r"region 'a'.*it has: b"):
        material.stiffness_tensor(POINTS, {"b": np.ones(3, bool)})
    with pytest.raises(ProblemError, match="more than one region"):
        material.stiffness_tensor(POINTS, {"a": np.ones(3, bool), "b": np.ones(3, bool)})
    with pytest.raises(ProblemError, match=r"\[1.0, 0.5\] lies in no region"):
        material.stiffness_tensor(POINTS, {"a": masks["a"], "b": np.array([False, False, True])})
    with pytest.raises(ProblemError, match="at least one region"):
        Material.by_region({})
    with pytest.raises(ProblemError, match="not a Material"):
        Material.by_region({"a": 3.0})  # type: ignore[dict-item]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Material.lame(1.0, 0.0), "mu = 0; it must be positive"),
        (lambda: Material.lame(-2.0, 1.0), "lam = -2.*exceed -mu"),
        (lambda: Material.lame(math.nan, 1.0), "lam"),
        (lambda: Material.lame("hard", 1.0), "lam"),
        (lambda: Material.young(-1.0, 0.3), "E = -1"),
        (lambda: Material.young(1.0, 0.5), "nu = 0.5.*between -1 and 0.5"),
        (lambda: Material.young(1.0, -1.0), "nu = -1"),
        (lambda: Material.young(1.0, 0.2, plane="sheet"), "plane = 'sheet'"),
        (lambda: Material.tensor(np.eye(4)), "shape"),
        (lambda: Material.tensor(np.diag([1.0, 1.0, -1.0])), "positive definite"),
        (lambda: Material.tensor([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]]), "symmetric"),
        (lambda: Material.tensor(np.full((3, 3), math.inf)), "finite"),
        (lambda: Material.tensor(np.eye(3), out_of_plane=(1, 2)), "out_of_plane"),
    ],
)
def test_bad_constants_are_refused_at_once(make: Callable[[], object], words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        make()


@pytest.mark.parametrize(
    ("material", "points", "words"),
    [
        (Material.lame(-0.9, 1.0), POINTS_3D, "exceed -2 mu / 3"),
        (Material.lame(-0.9, 1.0, "stress"), POINTS, "exceed -2 mu / 3"),
        (Material.lame(1.0, 1.0, "stress"), POINTS_3D, "plane stress"),
        (Material.lame(1.0, lambda x: 0.5 - x[:, 0]), POINTS, r"mu = -0.5 at x = \[1.0, 0.5\]"),
        (Material.lame(lambda x: x[:2, 0], 1.0), POINTS, "shape"),
        (Material.young(lambda x: x[:, 0] * np.nan, 0.3), POINTS, "returned nan at x"),
        (Material.tensor(np.eye(6)), POINTS, r"needs \(3, 3\)"),
        (
            Material.tensor(lambda x: np.eye(3)[None] * (0.5 - x[:, :1, None])),
            POINTS,
            "definite at x = .1.0, 0.5",
        ),
        (Material.tensor(lambda x: -np.eye(3)), POINTS, "definite"),
    ],
)
def test_bad_constants_are_refused_where_they_are(material: Material, points: np.ndarray, words: str) -> None:
    with pytest.raises(ProblemError, match=words):
        material.stiffness_tensor(points)


def test_negative_lam_is_fine_in_plane_strain() -> None:
    C = Material.lame(-0.9, 1.0).stiffness_tensor(POINTS)
    assert np.linalg.eigvalsh(C[0])[0] > 0
