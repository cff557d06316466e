"""The coarser problem below a discrete problem."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from hemivar.basics.types import Array
from hemivar.fem import discretize
from hemivar.fem.hierarchy import coarser
from hemivar.fem.near_kernel import rigid_motions
from hemivar.laws import ThresholdCompliance, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material
from hemivar.mechanics.conditions import Support
from hemivar.mesh import Mesh, box, rectangle

from ..mesh.meshes import cube

MESHES = {
    "rectangle": lambda: rectangle((2, 1), (8, 4)),
    "cross": lambda: rectangle((2, 1), (8, 4), "cross").rotated(0.4),
    "box": lambda: box(cells=4),
    "refined": lambda: cube(2).refined(),
}


def _pressure(x: Array) -> Array:
    return np.asarray(0.3 + np.abs(x[:, 0]))


def problem_on(mesh: Mesh, **changes: Any) -> ContactProblem:
    parts = {
        "material": Material.lame(3.0, 2.0),
        "contact": {"bottom": Contact(ThresholdCompliance(_pressure, 2.0), Tresca(0.1), gap=lambda x: 1.0 + x[:, 0])},
        "supports": {"left": Clamped()},
        "body_force": (0.2, -0.4, -0.3)[: mesh.dim],
    }
    return ContactProblem(mesh=mesh, **parts | changes)


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("support", [Clamped(), Fixed(x=0.1), Fixed(y=0.0)], ids=["clamped", "x", "y"])
def test_coarser_matrices_are_galerkin_products(name: str, support: Support) -> None:
    """On nested meshes the coarse elements are among the fine ones."""
    statement = problem_on(MESHES[name](), supports={"left": support})
    fine = discretize(statement, check_coercivity=False)
    step = coarser(fine)
    assert step is not None
    P, K = step.prolongation, step.problem.stiffness
    assert abs(P.T @ fine.stiffness @ P - K).max() < 1e-13 * abs(K).max()
    np.testing.assert_array_equal(step.problem.load, P.T @ fine.load)
    alone = discretize(replace(statement, mesh=statement.mesh.parent.mesh), check_coercivity=False)
    np.testing.assert_allclose(step.problem.gap, alone.gap, rtol=1e-12)
    first, second = np.random.default_rng(1).standard_normal((2, step.problem.unknowns))
    np.testing.assert_allclose(step.interpolate(first) - step.interpolate(second), P @ (first - second), atol=1e-12)


def test_changed_load_gap_and_law_count() -> None:
    fine = discretize(problem_on(rectangle((2, 1), (8, 4))))
    law = fine.law.take(np.arange(fine.contact_points)[::-1])
    changed = fine.with_(load=2.0 * fine.load, offset=fine.offset + np.array([1.0, 0.0]), law=law)
    before, after = coarser(fine), coarser(changed)
    np.testing.assert_allclose(after.problem.load, 2.0 * before.problem.load)
    np.testing.assert_allclose(after.problem.gap, before.problem.gap + 1.0)
    r = np.random.default_rng(1).random((after.problem.contact_points, 2))
    shared = np.searchsorted(fine.contact.points[:, 0], after.problem.contact.points[:, 0])
    np.testing.assert_array_equal(after.problem.law.value(r), law.take(shared).value(r))


def test_no_coarser_mesh() -> None:
    for case in (problem_on(rectangle(cells=3)), problem_on(rectangle(cells=4), order=2)):
        assert coarser(discretize(case)) is None


@pytest.mark.parametrize("name", ["cross", "box"])
def test_rigid_motions_carry_no_energy(name: str) -> None:
    fine = discretize(problem_on(MESHES[name](), supports={}), check_coercivity=False)
    motions = rigid_motions(fine.field)
    assert motions.shape == (fine.unknowns, 3 if fine.contact.components == 2 else 6)
    assert np.abs(fine.stiffness @ motions).max() < 1e-12 * abs(fine.stiffness).max()
