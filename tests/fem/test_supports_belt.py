"""A body dragged by a belt: closed forms at rest and in time, files, and bad input."""

from __future__ import annotations

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.laws import Compliance, Coulomb, Friction, Tresca

YOUNG, FOUNDATION, PUSH, FRICTION = 200.0, 50.0, 0.01, 0.3
SHEAR, DEPTH = 0.5 * YOUNG, YOUNG * PUSH / (YOUNG + FOUNDATION)
PRESSURE = FOUNDATION * DEPTH
LIMIT = FRICTION * PRESSURE / SHEAR  # the slip of the block at which its friction is used up


def cube_on_a_belt(belt: object, friction: Friction, dim: int = 2) -> hv.ContactProblem:
    """A cube pushed down by its top, whose sides let it shear uniformly: it has Poisson's ratio 0."""

    def down(x: Array) -> Array:
        return -(DEPTH + (PUSH - DEPTH) * x[:, -1])

    side = hv.Fixed(y=down) if dim == 2 else hv.Fixed(z=down)
    names = ("left", "right") if dim == 2 else ("left", "right", "front", "back")
    mesh = hv.rectangle((1.0, 1.0), (2, 2)) if dim == 2 else hv.box((1.0, 1.0, 1.0), (2, 2, 2))
    return hv.ContactProblem(
        mesh,
        hv.Material.young(YOUNG, 0.0),
        {"bottom": hv.Contact(Compliance(FOUNDATION), friction, belt=belt)},  # type: ignore[arg-type]
        {"top": hv.Prescribed((0.0, -PUSH) if dim == 2 else (0.0, 0.0, -PUSH))} | dict.fromkeys(names, side),
    )


@pytest.mark.parametrize("friction", [Tresca(FRICTION * PRESSURE), Coulomb(FRICTION)], ids=["tresca", "coulomb"])
@pytest.mark.parametrize("part", [0.5, 2.0, -3.0])
def test_a_belt_drags_a_block_as_far_as_friction_lets_it(part: float, friction: Friction) -> None:
    solution = hv.solve(cube_on_a_belt((part * LIMIT, 0.3), friction))  # the part along the normal does not count
    bottom = solution.displacement[np.isclose(hv.rectangle((1.0, 1.0), (2, 2)).points[:, 1], 0.0)]
    assert bottom[:, 0] == pytest.approx(np.clip(part, -1.0, 1.0) * LIMIT, rel=1e-9)
    assert bottom[:, 1] == pytest.approx(-DEPTH, rel=1e-9)
    names = set(solution.states.names[1])
    assert names == {"stick" if abs(part) < 1.0 else "slip"}


def test_a_belt_may_run_along_any_way_in_space() -> None:
    way = np.array([0.6, -0.8, 0.0])
    for part in (0.5, 2.0):
        solution = hv.solve(cube_on_a_belt(tuple(part * LIMIT * way), Tresca(FRICTION * PRESSURE), 3))
        bottom = solution.displacement[np.isclose(hv.box((1.0, 1.0, 1.0), (2, 2, 2)).points[:, 2], 0.0)]
        assert bottom[:, :2] == pytest.approx(np.tile(min(part, 1.0) * LIMIT * way[:2], (len(bottom), 1)), rel=1e-8)


@pytest.mark.parametrize("friction", [Tresca(FRICTION * PRESSURE), Coulomb(FRICTION)], ids=["tresca", "coulomb"])
def test_a_belt_that_runs_is_held_until_its_friction_is_used_up(friction: Friction) -> None:
    """It sticks up to t = 0.5, slips from then on, and loses the friction times the way."""
    speed = 2.0 * LIMIT
    evolution = hv.Evolution(cube_on_a_belt(lambda x, t: np.tile([speed * t, 0.0], (len(x), 1)), friction))
    found = hv.march(evolution, 2.0, step=0.1, save=hv.evolution.Save(every=0.1))
    for frame in found.frames:
        bottom = frame.displacement[np.isclose(evolution.problem.mesh.points[:, 1], 0.0)]
        assert bottom[:, 0] == pytest.approx(min(speed * frame.time, LIMIT), abs=1e-6 * LIMIT)
    assert abs(found.ledger["gap"]) <= 1e-8 * found.ledger["friction"]
    assert found.ledger["friction"] == pytest.approx(FRICTION * PRESSURE * speed * 1.5, rel=1e-6)


@pytest.mark.parametrize(
    ("belt", "words"),
    [
        (0.1, "has no direction; give a vector"),
        ((0.1, np.nan), "belt: .* is not finite"),
        ("fast", "belt"),
        ((0.1, 0.0, 0.0), r"belt of contact 'bottom' has shape \(3,\); on this mesh it needs 2 components"),
        (lambda x: x[:, 0], "belt of contact 'bottom': the callable returned shape"),
        (lambda x: np.full(x.shape, np.inf), "belt of contact 'bottom': the callable returned"),
        ((1e200, 0.0), "beyond the range of numbers"),
    ],
)
def test_bad_belts_are_named(belt: object, words: str) -> None:
    with pytest.raises(hv.HemivarError, match=words):
        hv.discretize(cube_on_a_belt(belt, Tresca(1.0)))
