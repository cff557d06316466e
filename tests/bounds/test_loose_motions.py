"""By which rigid motions the solutions of a convex problem may differ: of bodies that contact alone holds."""

from __future__ import annotations

import re

import numpy as np
import pytest

import hemivar as hv
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.loose_motions import _tells
from hemivar.bounds.trace_bounds import TraceBounds
from hemivar.laws import Bilateral, FinitePenetration, NoContact, Signorini, Superpotential, ThresholdCompliance
from tests.bounds.test_joined_bodies import contact, opened, two

UNKNOWN = TraceBounds(0.0, 0.0, 0.0, 0.0, False, "not known")
SPRINGS = hv.Compliance(100.0)


def evenly_pressed(
    touching: dict[str, hv.Contact], loads: dict[str, tuple[float, ...]], *, length: float = 1.0, dim: int = 2
) -> ExactDistance:
    """A block without supports, with the even strain that an even pressure makes of it."""
    mesh = hv.rectangle((length, length), 3) if dim == 2 else hv.box((length,) * 3, 2)
    problem = hv.ContactProblem(mesh, hv.Material.young(1e3, 0.0), touching, {}, tractions=loads)
    u = -1e-3 * mesh.points - 1e-3 * length
    return exact_distance(problem, u, UNKNOWN)


BOTTOM = {"bottom": hv.Contact(SPRINGS)}
CORNER = {"bottom": hv.Contact(SPRINGS), "left": hv.Contact(Signorini())}
RUBBED = {"bottom": hv.Contact(SPRINGS, hv.Tresca(0.3))}


@pytest.mark.parametrize(
    ("touching", "loads", "loose"),
    [
        (BOTTOM, {"top": (0.0, -1.0)}, "translation (1, 0)"),
        (RUBBED, {"top": (0.2, -1.0)}, "translation (1, 0)"),
        (CORNER, {"top": (0.0, -1.0), "right": (-1.0, 0.0)}, ""),
        (CORNER, {"top": (0.0, -1.0)}, "translation (1, 0)"),
        (CORNER, {"right": (-1.0, 0.0)}, "translation (0, 1)"),
        # nothing needs to press
        (BOTTOM, {"left": (-1.0, 0.0), "right": (1.0, 0.0)}, "translation (1, 0), translation (0, 1), rotation"),
        # a law that does not tell the penetration by the pressure
        (
            {"bottom": hv.Contact(ThresholdCompliance(2.0, 0.0))},
            {"top": (0.0, -1.0)},
            "translation (1, 0), translation (0, 1), rotation",
        ),
    ],
)
def test_what_presses_bars_motions(
    touching: dict[str, hv.Contact], loads: dict[str, tuple[float, ...]], loose: str
) -> None:
    for length in (1.0, 1e3):
        found = evenly_pressed(touching, loads, length=length)
        assert found.guaranteed, found.reasons
        assert found.unseen == "translation (1, 0), translation (0, 1), rotation"
        assert found.loose == loose
        assert found.unique == (not loose)


@pytest.mark.parametrize("guided", [False, True])
def test_a_turned_body_slides_along_its_plane(guided: bool) -> None:
    """No axis of the mesh is along the plane or across it, so that motions along it have normal parts of rounding."""
    turn = np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    mesh = hv.rectangle((1.0, 1.0), 3)
    turned = hv.Mesh(mesh.points @ turn, mesh.cells, dict(mesh.boundaries))
    load = {"left": (0.1, 0.0)} if guided else {"top": (0.3, -1.0)}
    held = {"top": hv.Roller()} if guided else {}
    loads = {name: tuple(np.array(one) @ turn) for name, one in load.items()}
    rubbed = {"bottom": hv.Contact(SPRINGS, hv.Tresca(20.0))}
    problem = hv.ContactProblem(turned, hv.Material.young(1e3, 0.0), rubbed, held, tractions=loads)  # type: ignore[arg-type]
    y = mesh.points[:, 1]
    moved = np.column_stack([0.0 * y, 1e-4 * (y - 1.0)]) if guided else -1e-3 * mesh.points - 1e-3
    found = exact_distance(problem, moved @ turn, UNKNOWN)
    assert found.guaranteed, found.reasons
    assert re.fullmatch(r"translation \((-?0\.764.*, -?0\.644.*|1, 0\.842.*)\)", found.loose)
    assert guided == (found.loose == found.unseen)


def test_a_cube_may_slide_and_turn_on_a_plane() -> None:
    found = evenly_pressed(BOTTOM, {"top": (0.0, 0.0, -1.0)}, dim=3)
    assert found.unseen.count("translation") == 3
    assert found.loose == "translation (1, 0, 0), translation (0, 1, 0), rotation about the z axis"


def test_friction_decides_between_two_planes() -> None:
    """Pulled down along a wall and onto the floor: friction of the wall may bear all of it, or none."""
    for bound, loose in ((0.3, ""), (2.0, "translation (0, 1)")):
        wall = {"left": hv.Contact(Signorini(), hv.Tresca(bound)), "bottom": hv.Contact(SPRINGS)}
        found = evenly_pressed(wall, {"top": (0.0, -1.0), "right": (-1.0, 0.0)})
        assert found.loose == loose


def stacked(count: int) -> hv.Mesh:
    """Blocks one above the other without a common node; the names of their sides end in their numbers."""
    points, cells, boundaries = [], [], {}
    for k in range(count):
        mesh = hv.rectangle((1.0, 1.0), 2, origin=(0.0, 2.0 * k))
        boundaries |= {f"{name}{k}": facets + 9 * k for name, facets in mesh.boundaries.items()}
        points.append(mesh.points)
        cells.append(mesh.cells + 9 * k)
    return hv.Mesh(np.concatenate(points), np.concatenate(cells), boundaries)


@pytest.mark.parametrize("law", [Signorini(), hv.Compliance(50.0)])
@pytest.mark.parametrize("ways", [("left", ""), ("", "right"), ("left", "left"), ("left", "right")])
def test_a_wall_holds_the_part_that_is_pushed_against_it(law: Superpotential, ways: tuple[str, str]) -> None:
    """Two blocks have the same walls at their sides: a block that has play may stand anywhere between them."""
    force = {"left": -0.5, "right": 0.5, "": 0.0}
    touching, loads = {}, {}
    for k, way in enumerate(ways):
        touching |= {f"bottom{k}": hv.Contact(law)}
        touching |= {f"{side}{k}": hv.Contact(law, gap=0.0 if side == way else 0.1) for side in ("left", "right")}
        loads[f"top{k}"] = (force[way], -1.0)
    solution = hv.solve(hv.ContactProblem(stacked(2), hv.Material.young(10.0, 0.3), touching, {}, tractions=loads))
    exact = solution.certify(exact=True).exact
    assert exact is not None
    assert exact.guaranteed, exact.why
    assert exact.unique == all(ways)
    assert exact.loose == ("" if all(ways) else "translation (1, 0)")


@pytest.mark.parametrize("friction", [hv.laws.NoFriction(), hv.Tresca(0.02)])
def test_a_body_on_another_one(friction: hv.laws.Friction) -> None:
    mesh = opened(hv.rectangle((1.0, 1.0), (4, 4)), 0.5)
    pairs = contact(0, hv.Compliance(10.0), friction)
    problem = two(mesh, (1.0, 3.0), pairs, supports={"bottom": hv.Clamped()}, tractions={"top": (0.0, -0.03)})
    y = mesh.points[:, 1]
    upper = np.isin(np.arange(mesh.number_of_nodes), mesh.cells[mesh.regions["part0"]])
    u = np.column_stack([0.0 * y, np.where(upper, -0.008 - 0.03 * y, -0.01 * y)])
    found = exact_distance(problem, u, UNKNOWN)
    assert found.guaranteed, found.reasons
    assert found.loose == "translation (1, 0)"


@pytest.mark.parametrize(
    ("law", "tells"),
    [
        (Signorini(), True),
        (Bilateral(), True),
        (NoContact(), True),
        (hv.Compliance(10.0), True),
        (hv.Compliance(10.0, 2.0), True),
        (hv.Compliance(10.0, 1.5), True),
        (FinitePenetration(20.0, 0.05), True),
        (ThresholdCompliance(0.3, 2.0), True),
        (ThresholdCompliance(0.3, 0.0), False),
        (hv.table_law([0.0, 0.02, 0.1], [0.0, 0.4, 0.5]), False),  # constant beyond its last row
        (hv.FormulaLaw("10 * max(r, 0)^2 + max(r, 0)^3", reach=1.0), True),
    ],
)
def test_a_pressure_leaves_one_penetration_where_the_law_rises(law: Superpotential, tells: bool) -> None:
    assert _tells(law.at(np.zeros((1, 2)))) == tells
