"""Limit loads and first instabilities of paths, against closed forms and bodies with a few unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

import hemivar as hv
from hemivar.branches import follow_path
from hemivar.branches.path import PathEnd
from hemivar.formula import Formula
from hemivar.laws import PiecewiseQuadratic
from tests import bodies
from tests.samples import slow

from ..problems import bar
from ..solvers.test_solve_glued_bodies import lever, pulled
from .test_solutions import softening


def rigid_limit(cells: int) -> float:
    """The largest load of a rigid :func:`lever`, over the opening at its loaded end."""
    x = np.linspace(-0.5, 0.5, cells + 1)
    w = np.full(cells + 1, 1.0 / cells)
    w[[0, -1]] *= 0.5

    def load_at(end: float) -> float:
        """The load with which the end opens so far."""

        def out_of_balance(q: np.ndarray) -> np.ndarray:
            opening, slip, load = q[1] + q[2] * x, q[0] + 0.5 * q[2], q[3]
            pull = np.where(opening < 0.0, 72.0, 24.0) * opening
            pull = np.where(opening > 1.0 / 12.0, np.maximum(2.0 - 6.0 * (opening - 1.0 / 12.0), 0.0), pull)
            drag = np.sign(slip) * (10.0 * abs(slip) if abs(slip) < 0.1 else max(1.0 - 2.0 * (abs(slip) - 0.1), 0.0))
            balance = [0.3 * load - drag, load - w @ pull, 0.5 * load - w @ (pull * x) - 0.5 * drag]
            return np.array([*balance, opening[-1] - end])

        return float(scipy.optimize.root(out_of_balance, [0.0, 0.5 * end, end, 0.5], tol=1e-10).x[3])

    ends = np.linspace(0.05, 0.4, 200)
    loads = [load_at(end) for end in ends]
    best = int(np.argmax(loads))
    peak = scipy.optimize.minimize_scalar(
        lambda end: -load_at(end), bounds=(ends[best - 1], ends[best + 1]), method="bounded", options={"xatol": 1e-10}
    )
    return -float(peak.fun)


def test_a_block_on_glue_bears_strength_times_area() -> None:
    path = follow_path(pulled(1.0), (0.0, 5.0))
    assert path.limit_load == pytest.approx(2.0, rel=1e-12)
    assert path.first_instability == pytest.approx(2.0, rel=1e-12)
    assert path.failure == "limit load factor 2"
    short = follow_path(pulled(1.0), (0.0, 1.0))
    assert short.limit_load is None
    assert short.first_instability is None
    assert short.failure == "limit load factor not reached"
    cut = follow_path(pulled(1.0), (0.0, 5.0), max_points=3)
    assert cut.limit_load is None
    assert "not followed to its end" in cut.failure


@pytest.mark.parametrize("cells", [4, 8])
def test_the_limit_load_of_a_stiff_lever_is_that_of_a_rigid_one(cells: int) -> None:
    path = follow_path(lever(stiff=1e5, cells=cells), (0.0, 5.0))
    assert path.limit_load == pytest.approx(rigid_limit(cells), rel=1e-4)


def test_a_spring_with_glue_first_lets_go_and_then_bears_more() -> None:
    """The spring bears any load, so that there is no limit; it lets go where softening begins."""
    path = follow_path(bar(0.5, softening()), (0.0, 2.0))
    assert path.first_instability == pytest.approx(1.2, rel=1e-12)
    assert path.limit_load is None
    assert path.failure == "limit load factor not reached (first instability 1.2)"


def test_the_limit_load_may_lie_above_the_first_instability() -> None:
    """A weak edge lets go, and a strong one holds on."""
    tough = hv.Adhesive(24.0, 2.0, 2.0, 72.0)
    brittle = hv.Adhesive(24.0, 0.3, 400.0, 72.0)
    block = bodies.square(
        {"left": hv.Contact(brittle), "bottom": hv.Contact(tough)},
        4,
        lame=(400.0, 400.0),
        supports={"bottom": hv.Fixed(x=0.0)},
        tractions={"top": (0.0, 1.0), "right": (0.0, 0.0)},
    )
    path = follow_path(replace(block, tractions={"top": (0.2, 1.0)}), (0.0, 5.0))
    assert path.limit_load is not None
    assert path.first_instability is not None
    assert path.first_instability <= path.limit_load
    stable = path.stable
    assert path.limit_load == np.maximum(path.load_factor[:-1], path.load_factor[1:])[stable].max()


def test_single_points_let_go_on_coarse_meshes_only() -> None:
    """alpha w against the stiffness of the body at a point, all others held."""
    glue = hv.Contact(hv.Adhesive(24.0, 2.0, 20.0, 72.0), hv.laws.SlipTable(1.0, [0.0, 0.1, 0.6], [0.0, 1.0, 0.0]))
    counts = {}
    for cells in (2, 16):
        path = follow_path(replace(lever(cells=cells), contact={"bottom": glue}), (0.0, 5.0))
        counts[cells] = sum(fold.snaps for fold in path.folds)
        if counts[cells]:
            assert path.snap_size is not None
            assert 1.0 / 16 < path.snap_size < 1.0 / 2
            assert path.snapping is not None
            assert "depend on the mesh; with cells of at most about" in path.snapping
        else:
            assert path.snap_size is None
            assert path.snapping is None
            assert path.main_folds == path.folds[:1]  # the load at which the whole foot lets go
            assert path.ended is PathEnd.UNBOUNDED  # the glue is gone, and the load with it
            assert path.limit_load == pytest.approx(path.first_instability, rel=1e-9)
    assert counts[2] > 0
    assert counts[16] == 0


def test_a_law_that_falls_at_once_lets_go_at_single_points_on_every_mesh() -> None:
    law = PiecewiseQuadratic([0.0, 0.1], [0.0, 20.0, 0.0], [0.0, -2.0])
    path = follow_path(bar(2.0, law), (0.0, 3.0))
    assert path.snap_size == 0.0
    assert path.snapping is not None
    assert "however fine" in path.snapping
    assert all(fold.snaps for fold in path.folds)


@pytest.mark.parametrize("unit", [1.0, 1e-3])
@pytest.mark.parametrize(("cells", "side"), [(4, "right"), (8, "right"), (8, "top")])
def test_a_body_torn_off_that_slides_along_its_roller_bears_no_load(cells: int, side: str, unit: float) -> None:
    """No stiffness is left but rounding: the load stands still, also where it acts at few points."""
    area, strength = unit**2, Formula(f"2 + 8 * max(0, min(1, 10 * (20 - x / {unit!r})))")
    glue = hv.Adhesive(
        stiffness=1000.0 / area / unit,
        strength=strength if unit == 1.0 else Formula(f"({strength.text}) / {area!r}"),
        softening=400.0 / area / unit,
        compression=1e4 / area / unit,
    )
    torn = hv.ContactProblem(
        mesh=hv.rectangle((40.0 * unit, 10.0 * unit), (4 * cells, cells)),
        material=hv.Material.young(70e3 / area, 0.33, plane="stress"),
        contact={"bottom": hv.Contact(glue)},
        supports={"left": "roller"},
        tractions={side: (0.0, 5.0 / area)},
    )
    path = follow_path(torn, (0.0, 5.0))
    assert path.ended in (PathEnd.UNBOUNDED, PathEnd.LOWER_END)
    assert path.load_factor[-1] == pytest.approx(0.0, abs=1e-9)
    assert path.limit_load is not None


@pytest.mark.parametrize(
    ("space", "length", "stress", "friction", "height"),
    [
        (False, 1.0, 1.0, 0.4, 1.0),
        (False, 1e3, 1e-6, 0.8, 2.0),
        slow(False, 1.0, 1.0, 0.8, 2.0),
        slow(False, 1e3, 1e-6, 0.4, 1.0),
        slow(True, 1e3, 1e-6, 0.4, 1.0),
        slow(True, 1e3, 1e-6, 0.8, 2.0),
    ],
)
def test_a_block_that_its_weight_holds_slides_or_topples_under_a_push(
    space: bool, length: float, stress: float, friction: float, height: float
) -> None:
    """The weight stays while the push grows: it slides at friction times the weight, or turns about its edge."""
    size = (length, 0.5 * length, height * length) if space else (length, height * length)
    mesh = hv.box(size, (3, 1, 3)) if space else hv.rectangle(size, (3, 3))
    down, along = np.eye(mesh.dim)[-1], np.eye(mesh.dim)[0]
    block = hv.ContactProblem(
        mesh=mesh,
        material=hv.Material.young(30e9 * stress, 0.2),
        contact={"bottom": hv.Contact(hv.Signorini(), hv.Coulomb(friction))},
        body_force=-24e3 * stress / length * down,
        tractions={"left": 10e3 * stress * along},
    )
    sliding, toppling = friction * 2.4 * 1.0, 2.4 * 1.0 / height
    limit = min(sliding, toppling)
    path = follow_path(block, (0.0, 5.0), constant=["body"])
    assert path.limit_load == pytest.approx(limit, rel=1e-8)
    assert path.ended is PathEnd.UNBOUNDED
    found = hv.branches.load_bracket(block, constant=["body"])
    assert found.carried <= limit * (1.0 + 1e-8)
    assert found.not_carried == pytest.approx(limit, rel=0.011)
    assert found.solution.normal_force == pytest.approx(24e3 * stress / length * np.prod(size), rel=1e-8)
