"""Paths of a beam that peels from glue, and of bodies that lose stability between two points of a curved path."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.optimize
import scipy.sparse as sp

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.branches import follow_path
from hemivar.branches.follower import Follower
from hemivar.branches.path import Path, PathEnd

BENDING, WIDTH, ARM, BOND = 70000.0 * 25.0 * 3.0**3 / 12.0, 25.0, 50.0, 60.0


def beam(x: Array) -> Array:
    """Stiffness of a beam (Hermite elements, deflection and slope of each node), clamped at its last node."""
    K = np.zeros((2 * x.size, 2 * x.size))
    for e, a in enumerate(np.diff(x)):
        block = [[12, 6 * a, -12, 6 * a], [6 * a, 4 * a * a, -6 * a, 2 * a * a]]
        block += [[-12, -6 * a, 12, -6 * a], [6 * a, 2 * a * a, -6 * a, 4 * a * a]]
        K[2 * e : 2 * e + 4, 2 * e : 2 * e + 4] += BENDING / a**3 * np.array(block)
    return K[:-2, :-2]


def peel(points: int) -> hv.DiscreteProblem:
    """A cantilever in mm and MPa, glued over its last 60 mm at so many points and pulled off at its free end."""
    side = BOND / points
    free = max(8, round(ARM / side))
    x = np.concatenate([np.linspace(-ARM, 0.0, free + 1), np.linspace(0.0, BOND, points + 1)[1:]])
    load = np.zeros(2 * x.size - 2)
    load[0] = 1.0
    trace = sp.csr_array(
        (-np.ones(points), (np.arange(points), 2 * np.arange(free, free + points))), (points, load.size)
    )
    weights = np.full(points, side * WIDTH)
    weights[0] /= 2.0
    law = hv.laws.ContactLaw(hv.Adhesive(2e4, 10.0, 20.0 / (0.1 - 1e-3), 2e4)).at(None)
    return hv.DiscreteProblem.of_arrays(
        stiffness=sp.csr_array(beam(x)), load=load, trace=trace, weights=weights, gap=np.zeros(points), law=law
    )


@pytest.fixture(scope="module")
def peeled() -> Path:
    return follow_path(peel(120), (0.0, 245.0))


def pulled_back(r: Array) -> Array:
    """Pressure of the glue: slope 2e4 up to 10 MPa, then down to nothing at an opening of 0.05 mm."""
    opening = -r
    falling = np.maximum(10.0 - 20.0 / (0.1 - 1e-3) * (opening - 5e-4), 0.0)
    return np.where(opening < 5e-4, 2e4 * r, -falling)


def test_a_stiff_beam_is_peeled_to_its_end(peeled: Path) -> None:
    """The corners carry the rounding of a condition of 3e8; in the end it is nearly a cantilever of all its length."""
    assert peeled.ended is PathEnd.UPPER_END
    assert peeled.limit_load is None
    problem = peeled.problem
    K = problem.stiffness.toarray()
    for t, r in zip(peeled.load_factor, peeled.local, strict=True):
        u = np.linalg.solve(K, t * problem.load - problem.contact_force(pulled_back(r)))
        np.testing.assert_allclose(problem.local(u), r, atol=1e-6)
    free_end = 245.0 / (6.0 * BENDING) * BOND**2 * (2.0 * (ARM + BOND) + ARM)
    assert -peeled.local[-1, 0, 0] == pytest.approx(free_end, rel=2e-3)


def test_the_teeth_of_a_peel_are_not_its_main_folds(peeled: Path) -> None:
    """The load turns where the glue begins to let go, and where the front comes to the end; the rest is the mesh."""
    for path in (peeled, follow_path(peel(60), (0.0, 245.0))):
        assert len(path.folds) > 15
        loads = [fold.load_factor for fold in path.main_folds]
        assert len(path.main_jumps) == len(loads) <= 3
        assert max(loads) == max(fold.load_factor for fold in path.folds)
        assert min(loads) == min(fold.load_factor for fold in path.folds)


def test_a_path_that_is_not_corrected_claims_no_limit_load(monkeypatch: pytest.MonkeyPatch) -> None:
    newton, calls = Follower.newton, iter(range(30))
    monkeypatch.setattr(Follower, "newton", lambda *given, **more: newton(*given, **more) if any(calls) else None)
    path = follow_path(peel(30), (0.0, 245.0))
    assert path.ended is PathEnd.NOT_CORRECTED
    assert not path.reached_end
    assert path.limit_load is None
    assert "limit load not known" in path.failure


@pytest.mark.parametrize("largest_step", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_the_first_instability_on_a_curved_path_is_that_of_the_closed_form(largest_step: float, unit: float) -> None:
    """Two alike points: the antisymmetric mode loses stability where ``j'' + a - b = 0``, before any fold."""
    a, b = 10.0, 8.5

    def lost(r: float) -> float:
        return float(10.0 * (1.0 - 20.0 * r * r) * np.exp(-10.0 * r * r)) + a - b

    at = scipy.optimize.brentq(lost, 0.2, 0.3, xtol=1e-15)
    load = (a + b) * at + 10.0 * at * np.exp(-10.0 * at * at)
    problem = hv.DiscreteProblem.of_arrays(
        stiffness=sp.csr_array([[a, b], [b, a]]),
        load=np.full(2, unit),
        trace=sp.csr_array(-np.eye(2)),
        weights=np.ones(2),
        gap=np.zeros(2),
        law=hv.laws.ContactLaw(hv.FormulaLaw(f"{0.5 * unit**2!r} * (1 - exp(-10 * (r / {unit!r})^2))")).at(None),
    )
    path = follow_path(problem, (0.0, 8.0), largest_step=largest_step)
    assert path.first_instability == pytest.approx(load, rel=1e-8)
    assert path.folds == ()
