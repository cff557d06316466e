"""All solutions of small bodies that are not linear, against scipy from a grid of starts."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.optimize

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete.point_kind import PointKind
from hemivar.gallery import hencky_block
from tests.samples import slow

#: Spring, penetration of the largest pressure, rate at which it falls.
LAW = (40.0, 0.02, 25.0)


def two_corners(law: tuple[float, float, float] = LAW, pushed: float = 0.055) -> hv.ContactProblem:
    """Two unknowns: the depths of the two lower corners of a block between smooth walls."""
    return hencky_block(hv.Softening(*law), n=1, pushed=pushed).problem


def stationary_points(problem: hv.ContactProblem, law: tuple[float, float, float], pushed: float) -> tuple[Array, int]:
    """Depths (k, 2) of the corners at all stationary points that scipy finds from a fine grid; how many are minima."""
    k, limit, alpha = law
    corners = [np.flatnonzero((problem.mesh.points == (x, 0.0)).all(axis=1))[0] for x in (0.0, 1.0)]

    def pressure(s: Array) -> Array:
        return np.where(s < limit, k * s, np.maximum(k * limit - alpha * (s - limit), 0.0)) * (s > 0)

    def forces(s: Array) -> Array:
        y = np.where(problem.mesh.points[:, 1] > 0.5, -pushed, 0.0)
        y[corners] = -s
        total = np.zeros(len(y))
        for cell in problem.mesh.cells:
            edges = np.column_stack([np.ones(3), problem.mesh.points[cell]])
            slopes, area = np.linalg.inv(edges)[1:], 0.5 * abs(np.linalg.det(edges))
            strain, shear = slopes[1] @ y[cell], slopes[0] @ y[cell]
            square = 2.0 / 3.0 * strain**2 + 0.5 * shear**2
            secant = 8.0 * (0.25 + 0.75 / np.sqrt(1.0 + square / 0.05**2))
            total[cell] += area * (
                (20.0 / 3.0 + 2.0 / 3.0 * secant) * strain * slopes[1] + 0.5 * secant * shear * slopes[0]
            )
        return np.asarray(-total[corners] + 0.5 * pressure(s))

    found: list[Array] = []
    for start in np.array(np.meshgrid(*[np.linspace(0.0, 0.07, 15)] * 2)).reshape(2, -1).T:
        at = scipy.optimize.root(forces, start, tol=1e-14)
        if np.abs(forces(at.x)).max() < 1e-12 and not any(np.abs(at.x - one).max() < 1e-7 for one in found):
            found.append(at.x)
    minima = 0
    for s in found:
        hessian = [(forces(s + 1e-7 * e) - forces(s - 1e-7 * e)) / 2e-7 for e in np.eye(2)]
        minima += int(np.linalg.eigvalsh(0.5 * (np.array(hessian) + np.array(hessian).T))[0] > 0.0)
    return np.array(sorted(found, key=tuple)), minima


@pytest.mark.parametrize(
    ("law", "pushed", "known"), [(LAW, 0.055, 2), slow((30.0, 0.03, 12.0), 0.06, 1), slow((60.0, 0.01, 40.0), 0.045, 3)]
)
def test_solutions_of_two_unknowns_are_among_those_of_a_grid(
    law: tuple[float, float, float], pushed: float, known: int
) -> None:
    """Eight random starts find so many of the minima at least, and nothing that is no solution."""
    problem = two_corners(law, pushed)
    expected, minima = stationary_points(problem, law, pushed)
    found = hv.find_solutions(problem, starts=8, controls=hv.solvers.Controls(rtol=1e-10))
    assert not found.exhaustive
    assert "there may be more" in found.searched
    at = np.array(sorted((one.local[np.argsort(one.problem.contact.points[:, 0]), 0] for one in found), key=tuple))
    for one in at:
        assert np.abs(expected - one).max(axis=1).min() < 1e-8
    lowest = [one.kind for one in found].count(PointKind.LOCAL_MINIMISER)
    assert known <= lowest <= minima
    assert len(found) > lowest or minima == 1


def test_one_solution_is_called_so_by_the_margin_alone() -> None:
    problem = two_corners((40.0, 0.02, 1.0))
    found = hv.find_solutions(problem)
    assert found.exhaustive
    assert len(found) == 1
    assert "margin" in found.searched
    own = hv.Material.potential(
        lambda e: (e**2).sum(axis=1),
        lambda e: 2 * e,
        lambda e: np.broadcast_to(2 * np.eye(3), (len(e), 3, 3)),
        reach=0.2,
    )  # its bounds are sampled: they show nothing
    sampled = hv.find_solutions(dataclasses.replace(problem, material=own), starts=1)
    assert not sampled.exhaustive
