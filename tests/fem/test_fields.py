"""Strains, stresses, averages and norms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize, nodal_average, strain, stress, v_norm, von_mises
from hemivar.mechanics import Clamped, ContactProblem, Material
from hemivar.mesh import rectangle

from ..mesh.meshes import cube

GRADIENT = np.array([[0.1, 0.3], [-0.2, 0.4]])
STRAIN = 0.5 * (GRADIENT + GRADIENT.T)


def loaded_rectangle(order: int = 1, **options: Any) -> ContactProblem:
    mesh = rectangle((2, 1), (4, 3), "cross")
    return ContactProblem(mesh, options.pop("material", Material.lame(3.0, 2.0)), order=order, **options)


@pytest.mark.parametrize("order", [1, 2])
def test_linear_field(order: int) -> None:
    source = loaded_rectangle(order)
    u = source.mesh.nodes(order) @ GRADIENT.T
    np.testing.assert_allclose(strain(source, u), np.broadcast_to(STRAIN, (48, 2, 2)), atol=1e-14)
    sigma = 3.0 * np.trace(STRAIN) * np.eye(2) + 4.0 * STRAIN
    np.testing.assert_allclose(stress(source, u), np.broadcast_to(sigma, (48, 2, 2)), atol=1e-14)
    norm = math.sqrt(2.0 * (STRAIN**2).sum())
    assert math.isclose(v_norm(source, u), norm)
    assert math.isclose(v_norm(source.mesh, u), norm)
    zz = 3.0 * np.trace(STRAIN)
    full = np.diag([0.0, 0.0, zz])
    full[:2, :2] = sigma
    deviator = full - np.trace(full) / 3 * np.eye(3)
    np.testing.assert_allclose(von_mises(source, u), math.sqrt(1.5 * (deviator**2).sum()))


def test_plane_stress_von_mises() -> None:
    source = loaded_rectangle(material=Material.young(5.0, 0.3, "stress"))
    # uniaxial tension: eps_yy = -nu eps_xx, von Mises equals E eps_xx
    u = source.mesh.points * [0.01, -0.003]
    np.testing.assert_allclose(von_mises(source, u), 0.05)


def test_three_dimensions() -> None:
    mesh = cube()
    source = ContactProblem(mesh, Material.young(5.0, 0.3))
    u = mesh.points * [0.01, -0.003, -0.003]
    np.testing.assert_allclose(von_mises(source, u), 0.05)
    np.testing.assert_allclose(stress(source, u)[:, 0, 0], 0.05)
    assert math.isclose(v_norm(mesh, u), math.sqrt(0.01**2 + 2 * 0.003**2))


def test_v_norm_of_a_quadratic_field() -> None:
    mesh = rectangle((1, 1), 3)
    nodes = mesh.nodes(2)
    u = np.column_stack([nodes[:, 0] ** 2, nodes[:, 0] * nodes[:, 1]])
    # eps = (2x, x, y/2): int 4x^2 + x^2 + y^2/2 = 5/3 + 1/6
    assert math.isclose(v_norm(mesh, u), math.sqrt(5 / 3 + 1 / 6))


def test_by_region_stress_uses_each_material() -> None:
    plain = rectangle((2, 1), (4, 2))
    left = plain.points[plain.cells].mean(axis=1)[:, 0] < 1
    from hemivar.mesh import Mesh

    mesh = Mesh(plain.points, plain.cells, {}, {"a": np.flatnonzero(left), "b": np.flatnonzero(~left)})
    material = Material.by_region({"a": Material.lame(0.0, 1.0), "b": Material.lame(0.0, 2.0)})
    sigma = stress(ContactProblem(mesh, material), mesh.points * [0.1, 0.0])
    np.testing.assert_allclose(sigma[:, 0, 0], np.where(left, 0.2, 0.4))


@pytest.mark.parametrize("order", [1, 2])
def test_nodal_average(order: int) -> None:
    source = loaded_rectangle(order)
    constant = nodal_average(source, np.full((48, 2, 2), 3.0))
    assert constant.shape == (len(source.mesh.nodes(order)), 2, 2)
    np.testing.assert_allclose(constant, 3.0)
    scalar = nodal_average(source.mesh, np.arange(48.0))
    assert scalar.shape == (source.mesh.number_of_nodes,)
    assert scalar.min() >= 0


def test_errors() -> None:
    source = loaded_rectangle()
    with pytest.raises(ProblemError, match="order 1 on this mesh has shape"):
        strain(source, np.zeros((3, 2)))
    with pytest.raises(ProblemError, match="one entry per cell"):
        nodal_average(source, np.zeros(3))
    discrete = discretize(loaded_rectangle(supports={"left": Clamped()}))
    with pytest.raises(ProblemError, match="needs the material"):
        stress(discrete.field, np.zeros((9, 2)))
