"""Evaluation of fields at other points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from hemivar.errors import ProblemError
from hemivar.fem import discretize, interpolate
from hemivar.fem.transfer import interpolation_matrix, locate
from hemivar.mesh import Mesh, rectangle
from tests import bodies

from ..mesh.meshes import cube, distorted


@pytest.mark.parametrize("make", [lambda: rectangle((1, 1), 4), lambda: rectangle((1, 1), 4, "cross"), cube])
def test_nested_meshes(make: Callable[[], Mesh]) -> None:
    coarse = make()
    fine = coarse.refined()
    values = np.random.default_rng(0).standard_normal((coarse.number_of_nodes, 2))
    found = interpolate(coarse, values, fine)
    expected = np.vstack([values, values[coarse.edges].mean(axis=1)])
    np.testing.assert_allclose(found, expected, atol=1e-14)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
def test_polynomials_are_reproduced(order: int, dim: int) -> None:
    mesh = distorted(rectangle((1, 1), 5, "left") if dim == 2 else cube(3))
    points = np.random.default_rng(1).uniform(0, 1, (500, dim))

    def field(x: np.ndarray) -> np.ndarray:
        return np.column_stack([1 + x[:, 0] - 2 * x[:, 1], x[:, 0] ** order * 3 + (x[:, 0] * x[:, 1]) ** (order - 1)])

    matrix = interpolation_matrix(mesh, order, points)
    np.testing.assert_allclose(matrix @ field(mesh.nodes(order)), field(points), atol=1e-12)
    np.testing.assert_allclose(np.asarray(matrix.sum(axis=1)).ravel(), 1.0)


def test_nodes_give_the_identity() -> None:
    mesh = distorted(rectangle((1, 1), 6, "cross"))
    for order in (1, 2):
        matrix = interpolation_matrix(mesh, order, mesh.nodes(order))
        assert abs(matrix - np.eye(matrix.shape[0])).max() < 1e-12


def test_shapes_and_targets() -> None:
    problem = bodies.square(cells=3, lame=(1, 1), order=2)
    field = discretize(problem).field
    values = field.nodes**2
    assert interpolate(field, values, field).shape == values.shape
    np.testing.assert_allclose(interpolate(field, values, field), values, atol=1e-14)
    np.testing.assert_allclose(interpolate(problem.mesh, values, problem.mesh), problem.mesh.points**2, atol=1e-14)
    np.testing.assert_allclose(interpolate(field, values[:, 0], np.array([[0.3, 0.7]])), [0.09])


def test_graded_mesh() -> None:
    """Cells of very different size: a large cell is found though many small centroids are nearer."""
    base = rectangle((1, 1), 2)
    plain = rectangle((1, 1), (64, 64))
    mesh = Mesh(plain.points**5, plain.cells)
    points = np.random.default_rng(2).uniform(0, 1, (2000, 2))
    cells, barycentric = locate(mesh, points)
    assert barycentric.min() > -1e-9
    back = np.einsum("kc,kcd->kd", barycentric, mesh.points[mesh.cells[cells]])
    np.testing.assert_allclose(back, points, atol=1e-12)
    assert base.number_of_cells == 8


def disc(cells: int) -> Mesh:
    plain = rectangle((2, 2), cells, "cross", origin=(-1, -1))
    x, y = plain.points.T
    return Mesh(np.column_stack([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2)]), plain.cells)


def test_points_just_outside_are_continued() -> None:
    coarse, fine = disc(6), disc(24)
    linear = coarse.points @ [[1.0], [2.0]]
    np.testing.assert_allclose(interpolate(coarse, linear, fine), fine.points @ [[1.0], [2.0]], atol=1e-12)


def test_errors() -> None:
    mesh = rectangle((1, 1), 4)
    with pytest.raises(ProblemError, match=r"1 points lie outside the mesh, the first at x = \[3.0, 0.5\]"):
        interpolate(mesh, mesh.points, np.array([[0.5, 0.5], [3.0, 0.5]]))
    with pytest.raises(ProblemError, match="rows"):
        interpolate(mesh, mesh.points[:3], mesh)
    with pytest.raises(ProblemError, match="shape"):
        interpolate(mesh, mesh.points, np.zeros((3, 3)))
    with pytest.raises(ProblemError, match="finite"):
        interpolate(mesh, mesh.points, np.full((1, 2), np.nan))


@pytest.mark.parametrize("nested", [True, False])
@pytest.mark.parametrize("order", [1, 2])
def test_sides_that_touch_keep_their_own_values(nested: bool, order: int) -> None:
    """Two blocks at one place, and a cut that ends inside of a block: nodes there are looked for on their own side."""
    below, above = rectangle((1.0, 0.5), 3), rectangle((1.0, 0.5), 4, origin=(0.0, 0.5))
    blocks = Mesh.assembled({"below": below, "above": above})
    cut = rectangle((1.0, 1.0), 4)
    middle = np.flatnonzero(np.abs(cut.points[:, 1] - 0.5) < 1e-9)
    middle = middle[np.argsort(cut.points[middle, 0])][:3]
    opened = cut.with_interfaces({"cut": np.column_stack([middle[:-1], middle[1:]])}).opened("cut")

    def field(mesh: Mesh, of: int) -> np.ndarray:
        """Linear below and above, and zero at the end of the cut, so that it may jump across it."""
        places, cells = mesh.nodes(of), mesh.cell_nodes(of)
        up = np.zeros(len(places), dtype=bool)
        up[cells[mesh.points[mesh.cells].mean(axis=1)[:, 1] > 0.5]] = True
        return np.where(up, 1.0 + places[:, 0], -2.0 * places[:, 0]) * np.minimum(places[:, 0] - 0.5, 0.0)

    def whole(mesh: Mesh) -> np.ndarray:
        return np.where(np.arange(mesh.number_of_nodes) < below.number_of_nodes, -1.0, 1.0)

    finer = Mesh.assembled({"below": below.refined(), "above": rectangle((1.0, 0.5), 7, origin=(0.0, 0.5))})
    target = blocks.refined() if nested else finer
    found = interpolate(blocks, whole(blocks), target)
    upper = np.zeros(target.number_of_nodes, dtype=bool)
    upper[target.cells[target.points[target.cells].mean(axis=1)[:, 1] > 0.5]] = True
    np.testing.assert_allclose(found, np.where(upper, 1.0, -1.0), atol=1e-12)
    if nested:
        values = field(opened, order)
        np.testing.assert_allclose(interpolate(opened, values, opened), values[: opened.number_of_nodes], atol=1e-12)
