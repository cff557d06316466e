"""Load paths of membranes and of antiplane shear against closed forms of strips, and solutions at their ends."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import hemivar as hv
from hemivar.branches import follow_path
from hemivar.branches.path import PathEnd
from hemivar.fem import LoadLine
from hemivar.formula import Formula
from tests.samples import slow

L = hv.laws
SHEAR, HEIGHT, WIDTH = 2.0, 0.5, 1.0


def sheared_strip(law: object, unit: float, **given: object) -> hv.ScalarProblem:
    """A strip of this height, held at its top, on a law at its bottom."""
    stated: dict[str, object] = {"supports": {"top": 0.0}, "kind": "antiplane"} | given
    return hv.ScalarProblem(
        mesh=hv.rectangle((WIDTH * unit, HEIGHT * unit), (1, 2)),
        coefficient=stated.pop("coefficient", SHEAR),  # type: ignore[arg-type]
        contact={"bottom": hv.ScalarContact(law)},  # type: ignore[arg-type]
        **stated,  # type: ignore[arg-type]
    )


def corner_held(law: object, unit: float = 1.0, **given: object) -> tuple[hv.ScalarProblem, float, float, float]:
    """A square of which one corner is free, on a law at its bottom; stiffness, load and weight of that corner."""
    mesh = hv.rectangle((unit, unit), 1)
    stiffness = load = 0.0
    for cell in mesh.cells:
        edges = np.column_stack([np.ones(3), mesh.points[cell]])
        slopes, area = np.linalg.inv(edges)[1:].T, 0.5 * abs(np.linalg.det(edges))
        free = (mesh.points[cell] == (unit, 0.0)).all(axis=1)
        stiffness += SHEAR * area * float((slopes[free] ** 2).sum())
        load += area / 3.0 * int(free.sum())
    stated = hv.ScalarProblem(
        mesh=mesh,
        coefficient=SHEAR,
        contact={"bottom": hv.ScalarContact(law)},  # type: ignore[arg-type]
        supports={"top": 0.0, "left": 0.0},
        source=1.0,
        **given,  # type: ignore[arg-type]
    )
    return stated, stiffness, load, 0.5 * unit


@pytest.mark.parametrize("unit", [1.0, 1e3])
@pytest.mark.parametrize("curved", [False, True])
def test_a_corner_on_friction_that_falls_with_the_slip_turns_where_the_closed_form_does(
    curved: bool, unit: float
) -> None:
    """``k s + w tau(s) = t f``, tau falling on a line, or by ``exp(-8 s)``, faster than the corner is stiff."""
    if curved:
        law = L.SlipWeakening(6.0, static=1.0, kinetic=0.2, rate=8.0 / unit)
    else:
        law = L.SlipTable(6.0, [0.0, 0.1 * unit, 0.5 * unit], [1.0, 1.0, 0.2])

    def friction(s: np.ndarray) -> np.ndarray:
        return 1.2 + 4.8 * np.exp(-8.0 * s) if curved else 6.0 * np.interp(s, [0.0, 0.1, 0.5], [1.0, 1.0, 0.2])

    problem, k, f, w = corner_held(law, unit, kind="antiplane")
    path = follow_path(problem, (0.0, 60.0 / unit))
    assert path.reached_end
    s = path.local[:, -1, 1]
    slides = np.abs(s) > 1e-12 * unit
    loads = (k * np.abs(s) + w * friction(np.abs(s) / unit)) / f
    np.testing.assert_allclose(path.load_factor[slides], loads[slides], rtol=1e-9)
    turns = np.array([0.0, np.log(8.0 * 4.8 * w / unit / k) / 8.0]) if curved else np.array([0.1, 0.5])
    expected = (k * unit * turns + w * friction(turns)) / f
    np.testing.assert_allclose([fold.load_factor for fold in path.folds], expected, rtol=1e-8)
    assert path.first_instability == pytest.approx(expected[0], rel=1e-8)
    assert path.limit_load is None
    np.testing.assert_allclose(
        np.abs(path.friction_force[slides, 0]), (w * friction(np.abs(s) / unit))[slides], rtol=1e-9
    )


def test_a_corner_of_a_membrane_turns_where_the_closed_form_does() -> None:
    """On a foundation that falls from .8 at .02 on by 25: ``k s + w p(s) = t f``."""
    problem, k, f, w = corner_held(L.Softening(40.0, 0.02, 25.0))
    path = follow_path(problem, (0.0, 10.0))
    broken = 0.02 + 0.8 / 25.0
    turns = [(k * 0.02 + w * 0.8) / f, k * broken / f]
    np.testing.assert_allclose([fold.load_factor for fold in path.folds], turns, rtol=1e-9)
    np.testing.assert_allclose([path.local[fold.index, -1, 0] for fold in path.folds], [0.02, broken], rtol=1e-9)


def test_a_strip_whose_flux_is_not_linear_follows_the_closed_form() -> None:
    """The value at its top grows; ``flux(g) = 40 s`` and falling by 25 from s = .02 on: top = s + h g."""
    power = hv.mechanics.PowerLaw(3.0, smoothing=0.2, linear_from=4.0)
    law = L.Softening(40.0, 0.02, 25.0)

    def flux(g: float) -> float:
        return g * np.sqrt(0.04 + g**2)

    def pressure(s: float) -> float:
        return 40.0 * s if s < 0.02 else max(0.8 - 25.0 * (s - 0.02), 0.0)

    stated = sheared_strip(law, 1.0, coefficient=power, supports={"top": 0.8}, kind="membrane")
    line = LoadLine.of(stated)
    path = follow_path(line.loaded, unloaded=line.unloaded, largest_step=0.1)
    assert path.reached_end
    s = path.local[:, 0, 0]
    tops = [x + HEIGHT * brentq(lambda g, x=x: flux(g) - pressure(x), -5.0, 5.0, xtol=1e-15) for x in s]
    np.testing.assert_allclose(0.8 * path.load_factor, tops, atol=1e-9)
    assert len(path.folds) == 2


@pytest.mark.parametrize(
    "law", [L.Signorini(), L.Softening(200.0, 0.002, 60.0), slow(L.Adhesive(200.0, 0.4, 60.0, 200.0))], ids=str
)
def test_the_path_of_a_membrane_over_a_foundation_ends_at_the_solution(law: object) -> None:
    """Contact over the area: a membrane pulled down onto a paraboloid, and one that is pulled off."""
    stated = hv.ScalarProblem(
        mesh=hv.rectangle((2.0, 2.0), 8, origin=(-1.0, -1.0)),
        coefficient=2.0,
        area=hv.ScalarContact(law, level=Formula("0.05 - 0.4*(x^2 + y^2)"), side="below"),  # type: ignore[arg-type]
        supports=dict.fromkeys(("left", "right", "bottom", "top"), 0.0),
        source=-0.5,
    )
    path = follow_path(stated)
    assert path.load_factor[-1] == 1.0
    solved = hv.solve(stated, controls=hv.Controls(rtol=1e-11)).raise_for_status()
    np.testing.assert_allclose(path.at(1.0)[0][0], solved.local, atol=1e-8)


def test_the_path_of_a_corner_in_antiplane_shear_ends_where_its_slip_has_a_value() -> None:
    problem, k, f, w = corner_held(L.SlipTable(6.0, [0.0, 0.1, 0.5], [1.0, 1.0, 0.2]), kind="antiplane")
    path = follow_path(problem, (0.0, 60.0), until={"max-slip": 0.3})
    assert path.ended is PathEnd.UNTIL
    assert abs(path.local[-1, -1, 1]) == pytest.approx(0.3, rel=1e-10)
    assert path.load_factor[-1] == pytest.approx((0.3 * k + 0.6 * 6.0 * w) / f, rel=1e-9)
    assert len(path.folds) == 1
