"""Bodies of Hencky's material in the gallery: numbers computed apart, and finite elements that approach them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.errors import ProblemError
from hemivar.gallery import hencky_block, hencky_ring
from hemivar.gallery.known import KnownProblem
from hemivar.gallery.nonlinear_bodies import HenckyConstants
from hemivar.mechanics import Material


def penetrations(known: KnownProblem) -> list[float]:
    """Of all solutions, at the inner side of the ring or the foot of the block."""
    place = np.array([[1.0, 0.0]]) if "ring" in known.problem.title else np.zeros((1, 2))
    return [-float(one.displacement(place).sum()) for one in known.solutions]


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        (lambda: hencky_block(), [0.034941569056]),
        (lambda: hencky_block(hv.laws.ThresholdCompliance(0.3, 2.0)), [0.062733873583324]),
        (lambda: hencky_ring(), [0.0949739517132]),
        (lambda: hencky_ring(constants=HenckyConstants(softened=1.0)), [4.0 / 45.0]),
        (
            lambda: hencky_ring(hv.Softening(40.0, 0.02, 25.0), pushed=0.055),
            [0.0153219650073, 0.0451501545808, 0.0579090994297],
        ),
    ],
)
def test_solutions_are_those_computed_apart(known: object, expected: list[float]) -> None:
    assert penetrations(known()) == pytest.approx(expected, rel=1e-10)  # type: ignore[operator]


@pytest.mark.parametrize("order", [1, 2])
def test_the_block_is_solved_exactly(order: int) -> None:
    known = hencky_block(n=2, order=order)
    solution = hv.solve(known, controls=hv.Controls(rtol=1e-12)).raise_for_status()
    assert solution.penetration == pytest.approx(penetrations(known)[0], rel=1e-10)
    assert solution.pressure == pytest.approx(known.pressure(np.zeros((1, 2)))[0], rel=1e-9)


def test_the_ring_is_approached_with_order_two() -> None:
    """In the mean over the contact points, on polygons with linear elements."""
    errors = []
    for n in (4, 8, 16):
        known = hencky_ring(n=n)
        solution = hv.solve(known).raise_for_status()
        errors.append(float(np.abs(solution.penetration - penetrations(known)[0]).mean()))
    assert errors[-1] < 2e-3 * penetrations(known)[0]
    assert np.log2(np.divide(errors[:-1], errors[1:])).min() > 1.85


def test_the_displacement_solves_the_equation_between() -> None:
    known = hencky_ring(n=16)
    r = np.linspace(1.0, 2.0, 9)
    u = known.displacement(np.column_stack([np.zeros(9), r]))
    assert np.abs(u[:, 0]).max() == 0.0
    assert u[-1, 1] == pytest.approx(-0.1, rel=1e-11)
    solution = hv.solve(known).raise_for_status()
    mesh = known.problem.mesh
    at = known.displacement(mesh.points)
    assert np.abs(solution.displacement.reshape(at.shape) - at).max() < 0.01 * np.abs(at).max()


def test_what_is_not_pushed_is_refused() -> None:
    for make in (hencky_block, hencky_ring):
        with pytest.raises(ProblemError, match="give a positive number"):
            make(pushed=-0.1)


def _quartic(strain: Array) -> Array:
    return np.asarray(4.0 * (strain**2).sum(axis=1) + 100.0 * (strain**4).sum(axis=1))


def _stress(strain: Array) -> Array:
    return np.asarray(8.0 * strain + 400.0 * strain**3)


def _tangent(strain: Array) -> Array:
    return np.asarray((8.0 + 1200.0 * strain**2)[:, :, None] * np.eye(strain.shape[1]))


@pytest.mark.parametrize(
    ("material", "penetration"),
    [
        (Material.locking(20.0 / 3.0, 4.0, 6.0, 0.03), 0.0403619615398),
        (Material.locking(20.0 / 3.0, 4.0, 1e4, 0.03), None),
        (Material.ramberg_osgood(10.0, 0.25, 0.2, 8.0, linear_from=0.05), None),
        (Material.ramberg_osgood(10.0, 0.25, 0.2, 8.0, linear_from=0.05, plane="stress"), None),
        (Material.potential("10/3*tr^2 + 4*dev2 + 50*tr^4", reach=0.3), None),
        (Material.potential("6*exx^2 + 6*eyy^2 + 4*exx*eyy + 8*exy^2 + 200*eyy^4", reach=0.3), None),
        (Material.potential(_quartic, _stress, _tangent, reach=0.3), None),
    ],
    ids=lambda value: getattr(value, "kind", None),
)
def test_a_block_of_every_material(material: Material, penetration: float | None) -> None:
    """Between smooth walls there is one strain, and one equation: the stress of the block is that of the springs."""
    problem = replace(hencky_block(n=2).problem, material=material)
    solution = hv.solve(problem, controls=hv.Controls(rtol=1e-11)).raise_for_status()

    def excess(s: float) -> float:
        stress = material.stress(np.zeros((1, 2)), np.array([[0.0, s - 0.1, 0.0]]))[0, 1]
        return float(-stress - 20.0 * s)

    expected = brentq(excess, 0.0, 0.1, xtol=1e-16) if penetration is None else penetration
    assert solution.penetration == pytest.approx(expected, rel=1e-8)
