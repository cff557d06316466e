"""Friction of a slip increment beside a law of opening and slip together."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from hemivar.laws import BilinearCohesion, Compliance, MixedMode, VectorLaw
from hemivar.laws.coupled.friction_beside import FrictionBeside
from hemivar.laws.testing import check_graph, check_vector_law
from tests.samples import slow


def compressible_glue(energy: float = 0.6) -> VectorLaw:
    return MixedMode(BilinearCohesion(stiffness=24.0, strength=2.4, energy=energy), 1.5, Compliance(100.0)).at(None)


def rubbed(base: VectorLaw, bound: float, start: float, c: int) -> FrictionBeside:
    return FrictionBeside(base, np.array([bound]), np.full((1, c - 1), start))


@pytest.mark.parametrize(
    ("bound", "start", "c"),
    [(0.7, 0.2, 2), slow(0.7, 0.05, 3), slow(0.7, 0.0, 2), slow(50.0, 0.2, 3), slow(0.0, 0.2, 3)],
)
def test_it_passes_the_kit(bound: float, start: float, c: int) -> None:
    """Glue that hardly softens by the whole kit, glue that softens in Minty's chart."""
    check_vector_law(rubbed(compressible_glue(100.0), bound, start, c), reach=0.6, components=c)
    check_graph(rubbed(compressible_glue(), bound, start, c), reach=0.6, components=c)


@pytest.mark.parametrize("count", [4, slow(40)])
def test_local_problems_in_space_by_scipy(count: int) -> None:
    """Slip, pull and the slip before in three directions."""
    random = np.random.default_rng(2)
    law = FrictionBeside(compressible_glue(), random.uniform(0.2, 1.5, count), random.uniform(-0.3, 0.3, (count, 2)))
    a, b = np.full((count, 2), 30.0), random.uniform(-6.0, 6.0, (count, 3))
    found = law.local_argmin(a, b)
    for i in range(count):
        one = law.take(np.array([i]))

        def energy(r: np.ndarray, i: int = i, one: FrictionBeside = one) -> float:  # type: ignore[type-arg]
            return float(15.0 * r @ r - b[i] @ r + one.value(r[None])[0])

        starts = (np.zeros(3), np.append(0.0, law.start[i]), b[i] / 30.0)
        best = min(
            minimize(energy, at, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-13, "maxiter": 4000}).fun
            for at in starts
        )
        assert energy(found[i]) <= best + 1e-10


def test_points_together_are_points_alone() -> None:
    law = FrictionBeside(compressible_glue(), np.array([0.0, 0.7, 50.0]), np.array([[0.1], [0.2], [-0.1]]))
    a, b = np.full((3, 2), 30.0), np.array([[1.0, 9.0], [-2.0, 8.0], [1.0, 2.0]])
    together = law.local_argmin(a, b)
    for i in range(3):
        alone = law.take(np.array([i])).local_argmin(a[i : i + 1], b[i : i + 1])
        np.testing.assert_allclose(alone[0], together[i], atol=1e-14)
    assert together[2, 1] == -0.1  # it sticks
    assert np.array_equal(
        law.take(np.array([0])).local_argmin(a[:1], b[:1]), compressible_glue().local_argmin(a[:1], b[:1])
    )
