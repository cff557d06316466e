"""Bolts: tightened in one step, held in the next; what a working load then adds is their share of the stiffness."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.laws import Bilateral, Bolt
from hemivar.mechanics import Step

PRELOAD, WORK, RATIO = 1000.0, 400.0, 0.4
#: So much stiffer a head is that is as good as rigid.
RIGID = 1e8


def legs(dim: int = 2, unit: float = 1.0, power: float = 1.0) -> hv.Mesh:
    """Half of a bolt and of the plates around it, side by side, joined by a head above and cut below."""
    mesh = hv.rectangle((1.0, 1.2), (10, 6)) if dim == 2 else hv.box((1.0, 0.5, 1.2), (5, 2, 6))
    centre = mesh.points[mesh.cells].mean(axis=1)
    low, inside = centre[:, -1] < 1.0, centre[:, 0] < RATIO
    regions = {"bolt": low & inside, "plates": low & ~inside, "head": ~low}
    sides = {name: mesh.points[facets].mean(axis=1) for name, facets in mesh.boundaries.items()}
    boundaries = dict(mesh.boundaries)
    ground, inner = boundaries.pop("bottom"), sides["bottom"][:, 0] < RATIO
    boundaries |= {"cut": ground[inner], "foot": ground[~inner]}
    boundaries |= {name: boundaries[name][sides[name][:, -1] > 1.0] for name in ("left", "right")}
    mesh = mesh.named(boundaries, {name: np.flatnonzero(cells) for name, cells in regions.items()})
    mesh = mesh.opened("slit", ("bolt", "plates")).scaled(unit)
    points = mesh.points.copy()
    points[:, 0] = unit * (points[:, 0] / unit) ** power
    return replace(mesh, points=points)


def joint(dim: int = 2, unit: float = 1.0, head: float = RIGID, poisson: float = 0.0, **more: Any) -> hv.ContactProblem:
    young = 2e5 / unit**2
    parts = {"bolt": young, "plates": young, "head": head * young}
    top = unit if dim == 2 else 0.5 * unit**2
    given: dict[str, Any] = {
        "mesh": legs(dim, unit),
        "material": hv.Material.by_region({name: hv.Material.young(E, poisson) for name, E in parts.items()}),
        "contact": {"cut": hv.Contact(Bolt()), "foot": hv.Contact(hv.Signorini())},
        "supports": {"left": "roller", "right": "roller"} | ({} if dim == 2 else {"front": "roller"}),
        "steps": [
            Step("tighten", bolts={"cut": PRELOAD}),
            Step("work", tractions={"top": (0.0,) * (dim - 1) + (WORK / top,)}),
        ],
    }
    return hv.ContactProblem(**given | more)


def tensions(problem: hv.ContactProblem, cut: str = "cut", foot: str = "foot", **options: Any) -> tuple[Any, Any]:
    """The tension of the bolt and the force between the plates at the end of each step."""
    history = hv.march(hv.Evolution(problem), **options)
    assert history.finished
    assert history.messages == ()
    largest = max(abs(value) for value in history.ledger.values())
    assert np.abs(history["gap"]).max() <= 1e-6 * largest
    return -history[f"{cut}.normal_force"], history[f"{foot}.normal_force"]


@pytest.mark.parametrize(("dim", "unit"), [(2, 1.0), (2, 1e-3), (3, 1.0), (3, 1e-3)])
def test_two_plates_and_a_bolt(dim: int, unit: float) -> None:
    """In closed form: the bolt bears the preload and its share of the load, the plates lose the rest."""
    bolt, plates = tensions(joint(dim, unit))
    assert bolt == pytest.approx([1000.0, 1160.0], rel=1e-6)
    assert plates == pytest.approx([1000.0, 760.0], rel=1e-6)


def test_a_round_bolt_in_a_round_plate() -> None:
    """Of a body of revolution the area is that of the whole ring; so is the force."""
    ring = {"plane": "axisymmetric"}
    young = {"bolt": 2e5, "plates": 2e5, "head": 2e5 * RIGID}
    problem = joint(
        mesh=legs(power=0.5),
        material=hv.Material.by_region({name: hv.Material.young(E, 0.0, **ring) for name, E in young.items()}),  # type: ignore[arg-type]
        supports={"right": "roller"},
        steps=[Step("tighten", bolts={"cut": PRELOAD}), Step("work", tractions={"top": (0.0, WORK / np.pi)})],
    )
    bolt, plates = tensions(problem)
    assert bolt == pytest.approx([1000.0, 1160.0], rel=1e-6)
    assert plates == pytest.approx([1000.0, 760.0], rel=1e-6)


@pytest.mark.parametrize("order", [1, 2])
def test_the_share_of_a_bolt_is_that_of_a_solve_of_its_own(order: int) -> None:
    """While the plates touch everywhere all is linear: one solve without steps tells the share of the bolt."""
    problem = joint(head=100.0, poisson=0.3, order=order)
    held = {name: hv.Contact(Bilateral()) for name in ("cut", "foot")}
    alone = hv.solve(replace(problem, steps=(), contact=held, tractions={"top": (0.0, WORK)}))
    share = -alone.on("cut").force[-1] / WORK
    bolt, plates = tensions(problem)
    assert 0.35 < share < 0.45
    assert bolt[-1] == pytest.approx(PRELOAD + share * WORK, rel=1e-9)
    assert plates[-1] == pytest.approx(PRELOAD - (1.0 - share) * WORK, rel=1e-9)
    increments, _ = tensions(problem, step=0.25)
    assert increments[-1] == pytest.approx(bolt[-1], rel=1e-9)


def test_a_bolt_is_tightened_further_and_let_go() -> None:
    steps = [
        Step("half", bolts={"cut": 500.0}),
        Step("whole", bolts={"cut": PRELOAD}),
        Step("work", tractions={"top": (0.0, WORK)}),
        Step("rest", tractions={"top": (0.0, 0.0)}),
    ]
    bolt, plates = tensions(joint(steps=steps))
    assert bolt == pytest.approx([500.0, 1000.0, 1160.0, 1000.0], rel=1e-6)
    assert plates == pytest.approx([500.0, 1000.0, 760.0, 1000.0], rel=1e-6)


def test_a_bolt_that_is_held_keeps_its_shortening() -> None:
    history = hv.march(hv.Evolution(joint(head=10.0, poisson=0.3)))
    tightened, loaded = (frame.local[history.discrete.problem.contact.on("cut"), 0] for frame in history.frames)
    assert np.abs(tightened).min() > 0.0
    assert loaded == pytest.approx(tightened, rel=1e-12)
    assert history.frames[-1].memory["0.shortening"][history.discrete.problem.contact.on("cut")] == pytest.approx(
        loaded
    )


def test_a_bolt_in_time() -> None:
    problem = joint(
        steps=(),
        contact={
            "cut": hv.Contact(Bolt(f"{PRELOAD / RATIO} * min(t, 1)", "max(0, t - 1)")),
            "foot": hv.Contact(hv.Signorini()),
        },
        tractions={"top": ("0", f"{WORK} * max(0, t - 1)")},
    )
    history = hv.march(hv.Evolution(problem), until=2.0, step=0.5)
    assert -history["cut.normal_force"] == pytest.approx([0.0, 500.0, 1000.0, 1080.0, 1160.0], rel=1e-6)
    assert history["foot.normal_force"] == pytest.approx([0.0, 500.0, 1000.0, 880.0, 760.0], rel=1e-6, abs=1e-6)


def test_a_bolt_that_is_cut_in_the_middle_of_its_shank() -> None:
    """The sides of an opened interface; the upper half rests on nothing but the plates."""
    mesh = hv.rectangle((1.0, 2.4), (10, 12))
    x, y = mesh.points[mesh.cells].mean(axis=1).T
    shank, upper, inside = np.abs(y - 1.2) < 1.0, y > 1.2, x < RATIO
    regions = {
        "bolt above": shank & upper & inside, "bolt below": shank & ~upper & inside,
        "plate above": shank & upper & ~inside, "plate below": shank & ~upper & ~inside,
        "head": ~shank & upper, "nut": ~shank & ~upper,
    }  # fmt: skip
    boundaries = dict(mesh.boundaries)
    for side in ("left", "right"):
        height = mesh.points[boundaries[side]].mean(axis=1)[:, 1]
        boundaries[side] = boundaries[side][np.abs(height - 1.2) > 1.0]
    mesh = mesh.named(boundaries, {name: np.flatnonzero(cells) for name, cells in regions.items()})
    for name in ("bolt", "plate"):
        mesh = mesh.opened(name, (f"{name} above", f"{name} below"))
    for name in ("above", "below"):
        mesh = mesh.opened(name, (f"bolt {name}", f"plate {name}"))
    stiff = {name: hv.Material.young(2e9 if name in ("head", "nut") else 2e5, 0.0) for name in regions}
    contact = {
        "bolt:bolt above": hv.Contact(Bolt(), against="bolt:bolt below"),
        "plate:plate above": hv.Contact(hv.Signorini(), hv.Coulomb(0.2), against="plate:plate below"),
    }
    problem = joint(
        mesh=mesh, material=hv.Material.by_region(stiff), contact=contact,
        supports={"left": "roller", "right": "roller", "bottom": "roller"},
        steps=[Step("tighten", bolts={"bolt:bolt above": PRELOAD}), Step("work", tractions={"top": (0.0, WORK)})],
    )  # fmt: skip
    bolt, plates = tensions(problem, "bolt:bolt above", "plate:plate above")
    assert bolt == pytest.approx([1000.0, 1160.0], rel=1e-6)
    assert plates == pytest.approx([1000.0, 760.0], rel=1e-6)


def test_a_membrane_is_pulled_and_then_held() -> None:
    """A strip under a pull at its end, then held there; under a load of its own the end bears half of it."""
    problem = hv.ScalarProblem(
        hv.rectangle((1.0, 0.25), (8, 2)), 1.0, source="4 * max(0, t - 1)",
        contact={"right": hv.ScalarContact(Bolt("-min(t, 1)", "max(0, t - 1)"))}, supports={"left": 0.0},
        kind="membrane",
    )  # fmt: skip
    history = hv.march(hv.Evolution(problem), until=2.0, step=0.5)
    end = [frame.displacement[-1, 0] for frame in history.frames]
    assert end == pytest.approx([0.0, -0.5, -1.0, -1.0, -1.0], abs=1e-9)
    # the slope at the end is -1 of the pull and -2 of the load
    assert abs(history["normal_force"][-1]) == pytest.approx(0.25 * abs(1.0 + 2.0), rel=1e-8)


def test_bolts_that_are_none_are_refused() -> None:
    with pytest.raises(ProblemError, match="a bolt remembers by how much it was shortened"):
        hv.Contact(Bolt(), memory=())
    with pytest.raises(ProblemError, match="step 'tighten': it tightens a bolt at 'foot', where there is none"):
        joint(steps=[Step("tighten", bolts={"foot": 1.0}), Step("work")])
    with pytest.raises(ProblemError, match=r"bolts\['cut'\]"):
        Step("tighten", bolts={"cut": "hard"})  # type: ignore[dict-item]
