"""Cells that are translates of each other, and rings of one kind."""

from __future__ import annotations

import numpy as np
import pytest

from hemivar.basics.types import IntArray
from hemivar.bounds.body_data import BodyData, body_data
from hemivar.bounds.cell_kinds import congruent_cells
from hemivar.bounds.split_element import pulled_back
from hemivar.gallery.survey_problems import survey_cube
from hemivar.kernels import kernels
from hemivar.kernels.mesh_sums import alike_rows
from hemivar.mechanics import ContactProblem, Material
from hemivar.mesh import box, rectangle
from hemivar.mesh.keys import equal_rows
from hemivar.mesh.mesh import Mesh

from .bodies import shaken

#: All but one corner of a cube of 6 x 6 x 6 blocks of six cells.
CUBE = survey_cube("5.1", 6).mesh
CORNER = np.flatnonzero((CUBE.points[CUBE.cells].mean(axis=1) < 1.0 / 6.0).all(axis=1))


def data_on(mesh: Mesh, material: Material | None = None) -> BodyData:
    problem = ContactProblem(mesh, material or Material.lame(4.0, 3.0))
    return body_data(problem, np.zeros(mesh.points.shape))


def numbers_of(data: BodyData) -> IntArray:
    return congruent_cells(data.table, data.compliance)


def kinds_of(mesh: Mesh) -> int:
    return len(np.unique(numbers_of(data_on(mesh))))


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e6])
@pytest.mark.parametrize("place", [0.0, 1.0 / 3.0, 1e3 / 3.0])
def test_rounding_does_not_part_cells(size: float, place: float) -> None:
    """Whose edges are powers of two, or none, and whose coordinates are rounded far off."""
    for count in (7, 8):
        mesh = rectangle((size, size), count, pattern="right").moved(np.eye(2), size * place)
        assert kinds_of(mesh) == 2
    assert kinds_of(box((size, size, size), 3).moved(np.eye(3), size * place)) == 6


def test_cells_of_other_size_shape_or_material_are_others() -> None:
    assert len(CORNER) == 6
    assert kinds_of(CUBE) == 6
    assert kinds_of(shaken(CUBE)) > 0.5 * len(CUBE.cells)
    plane = rectangle((1.0, 1.0), 4, pattern="right")
    larger = Mesh.oriented(
        np.vstack([plane.points, 2.0 * plane.points + 3.0]), np.vstack([plane.cells, plane.cells + len(plane.points)])
    )
    assert kinds_of(larger) == 4
    named = CUBE.named({}, {"hard": CORNER, "soft": np.setdiff1d(np.arange(len(CUBE.cells)), CORNER)})
    material = Material.by_region({"hard": Material.lame(40.0, 3.0), "soft": Material.lame(4.0, 3.0)})
    alike = numbers_of(data_on(named, material))
    assert len(np.unique(alike)) == 12
    assert not np.isin(alike[CORNER], np.delete(alike, CORNER)).any()


@pytest.mark.parametrize("mesh", [CUBE, shaken(CUBE), rectangle((3.0, 1.0), 5)], ids=["cube", "shaken", "plane"])
def test_the_compliance_of_its_kind_is_that_of_each_cell(mesh: Mesh) -> None:
    data = data_on(mesh)
    kinds, (rows, columns) = data.kinds, np.triu_indices(data.compliance.shape[-1])
    whole = pulled_back(data.compliance, data.table.jacobian, data.table.sizes)[:, rows, columns]
    assert np.abs(kinds.of_cells - whole).max() <= 1e-13 * np.abs(whole).max()
    assert len(kinds.compliance) == kinds_of(mesh)


def test_equal_rows_have_equal_numbers() -> None:
    rows = np.random.default_rng(1).integers(-2, 3, size=(3000, 4))
    number = equal_rows(rows)
    _, expected = np.unique(rows, axis=0, return_inverse=True)
    assert _same_parts(number, expected.ravel())
    assert len(equal_rows(np.empty((0, 3), dtype=np.int64))) == 0


def test_rows_that_sum_to_the_same_are_told_apart() -> None:
    """Their sums with the factors that are taken are equal, by which they are sorted."""
    a, b = np.random.default_rng(0).integers(1 << 63, size=2, dtype=np.uint64).view(np.int64).tolist()
    rows = np.array([[0, 0], [b, -a], [0, 0], [b, -a], [1, 0]])
    number = equal_rows(rows)
    assert number[0] == number[2] != number[4]
    assert len({number[0], number[1], number[4]}) == 3  # two rows of such a sum need not be found to be equal
    assert number[1] not in (number[0], number[4])


@pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")
def test_kernels_find_the_parts_that_numpy_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of meshes with few kinds and with one for each cell, of materials that vary; rows of zeros, and none."""
    varying = Material.lame(lambda x: 4.0 + np.floor(3.0 * x[:, 0]), 3.0)
    bodies = [data_on(mesh, material) for mesh in (CUBE, shaken(CUBE)) for material in (None, varying)]
    bodies.append(data_on(rectangle((1.0, 1.0), 40)))
    found = [numbers_of(data) for data in bodies]
    monkeypatch.setattr("hemivar.bounds.cell_kinds.alike_rows", lambda *_: None)
    for mine, data in zip(found, bodies, strict=True):
        assert _same_parts(mine, numbers_of(data))
    rows = np.array([[0.0, 0.0], [1.0, 2.0], [0.0, 0.0], [2.0, 4.0], [1.0, 2.0 + 1e-12], [1.0, 2.0 + 1e-6]])
    other = np.array([[1.0], [1.0], [1.0], [1.0], [1.0], [1.0]])
    assert alike_rows(rows, other, 1e-9) == pytest.approx([0, 1, 0, 2, 1, 3])
    assert alike_rows(rows, other * np.arange(6.0)[:, None], 1e-9) == pytest.approx(np.arange(6))
    empty = alike_rows(np.zeros((0, 4)), None, 1e-9)
    assert empty is not None
    assert len(empty) == 0
    for wrong, tolerance in ((rows.T, 1e-9), (rows[0], 1e-9), (rows.astype(int), 1e-9), (rows, 0.0)):
        with pytest.raises(ValueError, match="must"):
            alike_rows(wrong, None, tolerance)


def _same_parts(first: IntArray, second: IntArray) -> bool:
    pairs = np.unique(np.column_stack([first, second]), axis=0)
    return len(pairs) == len(np.unique(first)) == len(np.unique(second))
