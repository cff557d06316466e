"""Largest strain and rotation, and what is said where they are not small."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.evolution import march
from hemivar.fem import deformation
from hemivar.fem.small_strain import SMALL
from hemivar.mesh.mesh import Mesh
from tests import bodies


def field(mesh: Mesh, order: int, gradient: Array) -> Array:
    return np.asarray(mesh.nodes(order) @ gradient.T + 0.3)


def meshes(dim: int) -> Mesh:
    return hv.rectangle((2.0, 1.0), (4, 3)) if dim == 2 else hv.box((2.0, 1.0, 1.0), (2, 2, 1))


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_of_uniform_gradients(dim: int, order: int) -> None:
    rng = np.random.default_rng(dim + order)
    for size in (1e-6, 0.02, 0.2):
        gradient = size * rng.standard_normal((dim, dim))
        found = deformation(meshes(dim), field(meshes(dim), order, gradient))
        assert found.strain == pytest.approx(np.abs(np.linalg.eigvalsh(0.5 * (gradient + gradient.T))).max())
        skew = 0.5 * (gradient - gradient.T)
        assert found.rotation == pytest.approx(np.abs(np.linalg.eigvals(skew)).max())
        assert found.whole == pytest.approx(2.0)
        assert found.volume == pytest.approx(2.0 if found.large else 0.0)


def test_a_small_turn_is_an_angle() -> None:
    for angle in (1e-3, 0.099, 0.101):
        mesh = meshes(3)
        axis = np.array([1.0, -2.0, 2.0]) / 3.0
        turn = np.cross(np.eye(3), axis) * angle
        np.testing.assert_allclose(turn, Rotation.from_rotvec(angle * axis).as_matrix() - np.eye(3), atol=angle**2)
        found = deformation(mesh, field(mesh, 1, turn))
        assert found.rotation == pytest.approx(angle)
        assert found.strain < 1e-12
        assert found.large == (angle > SMALL)


def test_quadratic_elements_have_their_largest_strain_at_a_corner() -> None:
    """u_x = a x^2/2 on (0, 2): strain a x, 2 a at most, and SMALL beyond x = SMALL/a."""
    mesh = hv.rectangle((2.0, 1.0), (20, 4))
    x = mesh.nodes(2)[:, 0]
    found = deformation(mesh, np.column_stack([0.5 * 0.06 * x**2, 0.0 * x]))
    assert found.strain == pytest.approx(0.12)
    assert found.volume == pytest.approx(2.0 - 1.6, abs=0.11)  # cells that begin before x = 5/3 and end beyond it
    assert found.large


def test_the_part_beyond_is_the_same_whichever_corner_comes_first() -> None:
    mesh = hv.rectangle((2.0, 1.0), (5, 2))
    found = []
    for first in range(3):
        turned = Mesh(mesh.points, np.roll(mesh.cells, first, axis=1))
        x = turned.nodes(2)[:, 0]
        found.append(deformation(turned, np.column_stack([0.5 * 0.06 * x**2, 0.0 * x])).volume)
    assert found == pytest.approx([0.4] * 3)  # the last cells, which end beyond x = 5/3


def test_the_largest_of_many_in_space() -> None:
    """Brute force over all cells of a rough field."""
    mesh = hv.box((1.0, 1.0, 1.0), 4)
    for size in (1e-4, 0.01, 0.03):
        u = size * np.random.default_rng(3).standard_normal(mesh.points.shape)
        gradients = []
        for cell in mesh.cells:
            edges = mesh.points[cell[1:]] - mesh.points[cell[0]]
            gradients.append(np.linalg.solve(edges, u[cell[1:]] - u[cell[0]]).T)
        strains = [np.abs(np.linalg.eigvalsh(0.5 * (g + g.T))).max() for g in gradients]
        turns = [np.abs(np.linalg.eigvals(0.5 * (g - g.T))).max() for g in gradients]
        found = deformation(mesh, u)
        assert found.strain == pytest.approx(max(strains))
        assert found.rotation == pytest.approx(max(turns))
        beyond = (np.array(strains) >= SMALL) | (np.array(turns) >= SMALL)
        assert found.volume == pytest.approx(mesh.volumes[beyond].sum())


def test_a_march_names_the_time() -> None:
    """The top moves by t on height 1, so that the strain is t; 10 % is exceeded at the step after t = 0.09."""
    problem = bodies.square(
        cells=2,
        lame=(0.0, 1.0),
        supports={"top": hv.Fixed(y=lambda x, t: np.full(len(x), t)), "left": hv.Roller(), "bottom": hv.Roller()},
    )
    history = march(hv.Evolution(problem, inertia=False), until=0.3, step=0.03)
    (message,) = history.messages
    assert message.startswith("beyond small strains from t = 0.12 on: largest strain 12 %, rotation ")
    assert "strain 30 %" in message
    assert "at t = 0.3;" in message
    assert not march(hv.Evolution(problem, inertia=False), until=0.09, step=0.03).messages


def test_what_has_no_strain() -> None:
    membrane = hv.ScalarProblem(hv.rectangle((1.0, 1.0), 4), 1.0, supports={"left": 0.0}, source=5.0)
    assert hv.solve(membrane).deformation is None
    assert not hv.solve(membrane).warnings
