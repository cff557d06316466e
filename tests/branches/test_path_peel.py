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
from hemivar.systems.chain import chain_of
from hemivar.systems.workspace import Workspace

BENDING, WIDTH, ARM, BOND = 70000.0 * 25.0 * 3.0**3 / 12.0, 25.0, 50.0, 60.0


def beam_stiffness(x: Array) -> Array:
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
        stiffness=sp.csr_array(beam_stiffness(x)),
        load=load,
        trace=trace,
        weights=weights,
        gap=np.zeros(points),
        law=law,
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
    assert "limit load factor not known" in path.failure


def test_a_stiff_beam_is_corrected_where_rounding_is_large(peeled: Path) -> None:
    chain = chain_of(Workspace().condensed(peeled.problem))
    middle = len(peeled) - 30
    theta, segment = chain.nearest(peeled.local[middle], peeled.multiplier[middle])
    found = chain.correct(theta, segment, peeled.load_factor[middle] * chain.force)
    assert found is not None
    np.testing.assert_allclose(found, theta, atol=1e-6)


def bending(r: float) -> float:
    """Curvature of the law ``1/2 - 1/2 exp(-10 r^2)``."""
    return float(10.0 * (1.0 - 20.0 * r * r) * np.exp(-10.0 * r * r))


def pair(a: float, b: float, unit: float = 1.0) -> hv.DiscreteProblem:
    """Two alike points on this law: along the symmetric path the load is ``(a + b) r + j'(r)``."""
    return hv.DiscreteProblem.of_arrays(
        stiffness=sp.csr_array([[a, b], [b, a]]),
        load=np.full(2, unit),
        trace=sp.csr_array(-np.eye(2)),
        weights=np.ones(2),
        gap=np.zeros(2),
        law=hv.laws.ContactLaw(hv.FormulaLaw(f"{0.5 * unit**2!r} * (1 - exp(-10 * (r / {unit!r})^2))")).at(None),
    )


def load_where(curvature: float, total: float, *, again: bool = False) -> float:
    """The load of the symmetric path where the law first has this curvature, or has it again."""
    ends = (np.sqrt(0.15), 2.0) if again else (0.0, np.sqrt(0.15))
    at = scipy.optimize.brentq(lambda r: bending(r) - curvature, *ends, xtol=1e-15)
    return float(total * at + 10.0 * at * np.exp(-10.0 * at * at))


@pytest.mark.parametrize("largest_step", [0.02, 0.1, 0.5])
@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_the_first_instability_on_a_curved_path_is_that_of_the_closed_form(largest_step: float, unit: float) -> None:
    """The antisymmetric mode loses stability where ``j'' + a - b = 0``, and there is no fold."""
    path = follow_path(pair(10.0, 8.5, unit), (0.0, 8.0), largest_step=largest_step)
    assert path.first_instability == pytest.approx(load_where(-1.5, 18.5), rel=1e-8)
    assert path.folds == ()


@pytest.mark.parametrize("largest_step", [0.02, 0.5])
def test_stability_may_be_lost_before_the_load_turns(largest_step: float) -> None:
    """The load turns where ``j'' + a + b = 0``; both may lie in one step."""
    path = follow_path(pair(2.2, 2.1), (0.0, 8.0), largest_step=largest_step)
    assert path.first_instability == pytest.approx(load_where(-0.1, 4.3), rel=1e-8)
    assert path.folds[0].load_factor == pytest.approx(load_where(-4.3, 4.3), rel=1e-10)
    assert (np.diff(path.load_factor[: path.folds[0].index + 1]) > 0.0).all()
    assert not path.stable[path.folds[0].index - 1]


@pytest.mark.parametrize("largest_step", [0.02, 0.125])
def test_the_order_on_the_way_back_is_the_other_one(largest_step: float) -> None:
    """Both modes lose stability within a step, the antisymmetric one first, and win it back in the other order."""
    path = follow_path(pair(2.0, 0.02), (0.0, 4.0), largest_step=largest_step)
    lost, won = np.flatnonzero(path.stable[:-1] != path.stable[1:]) + 1
    assert path.load_factor[lost] == pytest.approx(load_where(-1.98, 2.02), rel=1e-8)
    assert path.load_factor[won] == pytest.approx(load_where(-1.98, 2.02, again=True), rel=1e-8)
    first, second = path.folds
    assert second.load_factor == pytest.approx(load_where(-2.02, 2.02, again=True), rel=1e-10)
    assert lost < first.index < second.index < won


def test_a_stretch_on_which_the_change_was_not_found_is_not_called_stable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Follower, "change", lambda *given: None)
    path = follow_path(pair(10.0, 8.5), (0.0, 20.0), largest_step=0.1)
    assert path.stable[0]
    assert path.stable[-1]
    assert not path.stable.all()
    ends = np.array([bending(-r[0, 0]) + 1.5 for r in path.local])
    assert ((ends[:-1] > 0.0) & (ends[1:] > 0.0))[path.stable].all()
