"""Sensitivities against central differences of whole solves: laws of every family, pairs, rings, nonlinear bodies."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError
from hemivar.identification import sensitivity
from hemivar.identification.adjoint import _Equations, _parameters, _quantity
from tests.samples import slow

TIGHT = hv.Controls(rtol=1e-13)


def dragged_strip(normal: object, friction: object = None, **more: object) -> hv.ContactProblem:
    given = {
        "mesh": hv.rectangle((2.0, 1.0), (6, 3)), "material": hv.Material.young(20.0, 0.3),
        "contact": {"bottom": hv.Contact(normal, friction or hv.laws.NoFriction(), gap=0.01)},  # type: ignore[arg-type]
        "supports": {"left": "clamped"}, "tractions": {"top": (0.3, -1.0)}, **more,
    }  # fmt: skip
    return hv.ContactProblem(**given)  # type: ignore[arg-type]


def dragged_pair() -> hv.ContactProblem:
    upper, lower = hv.rectangle((1.0, 1.0), (5, 4), origin=(0.5, 1.0)), hv.rectangle((2.0, 1.0), (8, 4))
    return hv.ContactProblem(
        hv.Mesh.assembled({"upper": upper, "lower": lower}),
        hv.Material.young(20.0, 0.3),
        contact={"upper:bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.2), against="lower:top")},
        supports={"lower:bottom": "clamped", "upper:left": "roller"},
        tractions={"upper:top": (0.05, -1.0)},
    )


def pressed_ring() -> hv.ContactProblem:
    return hv.ContactProblem(
        hv.rectangle((1.0, 2.0), (4, 6), origin=(1.0, 0.0)),
        hv.Material.young(20.0, 0.3, plane="axisymmetric"),
        contact={"right": hv.Contact(hv.Compliance(30.0), gap=0.001)},
        supports={"bottom": "roller"},
        tractions={"left": hv.Pressure(2.0)},
    )


def dragged_cube() -> hv.ContactProblem:
    return dragged_strip(
        hv.Compliance(30.0), hv.Coulomb(0.2), mesh=hv.box((2.0, 1.0, 1.0), (4, 2, 2)),
        tractions={"top": (0.3, 0.1, -1.0)},
    )  # fmt: skip


def plated_block() -> hv.ContactProblem:
    """Under a rigid plate, between rollers that hold the ends of its contact along the foundation."""
    plate = hv.mechanics.RigidPlate(force=(0.0, -1.0), moment=0.1)
    return dragged_strip(hv.Compliance(30.0), hv.Tresca(0.1), supports={"left": "roller", "top": plate}, tractions={})


def tied_blocks() -> hv.ContactProblem:
    upper, lower = hv.rectangle((2.0, 1.0), (5, 4), origin=(0.0, 1.0)), hv.rectangle((2.0, 1.0), (8, 4))
    return hv.ContactProblem(
        hv.Mesh.assembled({"upper": upper, "lower": lower}),
        hv.Material.young(20.0, 0.3),
        contact={
            "upper:bottom": hv.Contact(hv.laws.Tie(), against="lower:top"),
            "lower:bottom": hv.Contact(hv.Signorini(), hv.Coulomb(0.3)),
        },
        supports={"upper:left": "roller"},
        tractions={"upper:top": (0.05, -1.0)},
    )


GAP, E, FORCE = "contact.bottom.gap", "material.E", "tractions.top.1"
FORCES = ["normal-force", "max-pressure", "max-penetration", "support.left.force.y", "displacement.5.x"]
CASES: dict[str, tuple[Callable[[], hv.ContactProblem], list[str], list[str]]] = {
    "springs": (
        lambda: dragged_strip(hv.Compliance(30.0)),
        [E, "material.nu", "contact.bottom.normal.stiffness", GAP, FORCE],
        [*FORCES, "energy"],
    ),
    "power": (
        lambda: dragged_strip(hv.Compliance(300.0, 2.0)),
        ["contact.bottom.normal.exponent", GAP],
        [*FORCES, "energy"],
    ),
    "rigid": (lambda: dragged_strip(hv.Signorini()), [E, GAP, FORCE], [*FORCES, "energy"]),
    "tresca": (
        lambda: dragged_strip(hv.Signorini(), hv.Tresca(0.1)),
        [GAP, "contact.bottom.friction.bound"],
        [*FORCES, "energy"],
    ),
    "coulomb": (
        lambda: dragged_strip(hv.Signorini(), hv.Coulomb(0.3)),
        [E, GAP, "contact.bottom.friction.bound.coefficient"],
        [*FORCES, "contact.bottom.force.x"],
    ),
    "weakening": (
        lambda: dragged_strip(hv.Compliance(30.0), hv.SlipWeakening(0.2, 1.0, 0.5, 5.0)),
        ["contact.bottom.friction.profile.rate", "contact.bottom.friction.bound", E],
        [*FORCES, "energy"],
    ),
    "glue": (
        lambda: dragged_strip(
            hv.laws.Adhesive(30.0, 0.8, softening=5.0, compression=100.0), tractions={"top": (0.3, 0.4)}
        ),
        ["contact.bottom.normal.strength", "contact.bottom.normal.stiffness", GAP],
        [*FORCES, "energy"],
    ),
    "joint": (
        lambda: dragged_strip(hv.laws.BartonBandis(10.0, 0.05)),
        [E, "contact.bottom.normal.closure"],
        [*FORCES, "energy"],
    ),
    "moved": (
        lambda: dragged_strip(
            hv.Compliance(30.0), hv.Tresca(0.05), supports={"left": "clamped", "right": hv.Fixed(y=-0.05)}
        ),
        ["supports.right.y", E],
        ["normal-force", "support.right.force.y", "energy"],
    ),
    "quadratic": (lambda: dragged_strip(hv.Compliance(30.0), hv.Coulomb(0.2), order=2), [E, GAP], FORCES),
    "space": (dragged_cube, [E, "contact.bottom.friction.bound.coefficient", "tractions.top.0"], FORCES),
    "pair": (
        dragged_pair,
        [E, "contact.upper:bottom.gap", "contact.upper:bottom.friction.bound.coefficient", "tractions.upper:top.1"],
        ["max-pressure", "contact.upper:bottom.force.x", "contact.lower:top.force.x", "support.upper:left.force.x"],
    ),
    "ring": (
        pressed_ring,
        ["material.nu", "contact.right.gap", "tractions.left.value"],
        ["normal-force", "max-pressure", "energy", "contact.right.force.x"],
    ),
    "nonlinear": (
        lambda: dragged_strip(
            hv.Compliance(30.0), hv.Tresca(0.05), material=hv.gallery.hencky_block().problem.material
        ),
        [GAP, "contact.bottom.friction.bound", FORCE],
        ["normal-force", "max-pressure", "energy", "support.left.force.y"],
    ),
    "plate": (
        plated_block,
        [E, "contact.bottom.normal.stiffness", "supports.top.force.1"],
        ["max-pressure", "energy", "displacement.20.y"],
    ),
    "tie": (
        tied_blocks,
        [E, "contact.lower:bottom.friction.bound.coefficient"],
        ["max-pressure", "contact.lower:bottom.force.x"],
    ),
    "sprung": (
        lambda: dragged_strip(hv.Compliance(30.0), supports={"left": hv.mechanics.Spring(50.0, 20.0)}),
        ["supports.left.normal", GAP],
        ["normal-force", "displacement.20.x", "energy"],
    ),
    "strained": (
        lambda: dragged_strip(hv.Signorini(), hv.Tresca(0.1), initial_strain=0.01),
        ["initial_strain", E],
        ["normal-force", "max-pressure", "energy"],
    ),
}
QUICK = ("rigid", "coulomb", "glue", "ring", "plate")


def number_of(problem: hv.ContactProblem, quantity: str) -> float:
    solution = hv.solve(problem, controls=TIGHT)
    assert solution.status is hv.Status.CONVERGED
    return _quantity(_Equations.of(solution), quantity).value


@pytest.mark.parametrize("name", [name if name in QUICK else slow(name) for name in CASES])
def test_derivatives_are_those_of_differences_of_solves(name: str) -> None:
    make, parameters, quantities = CASES[name]
    problem = make()
    solution = hv.solve(problem, controls=TIGHT)
    for quantity in quantities:
        derivatives = sensitivity(solution, quantity, parameters)
        assert not derivatives.kinks.size
        assert derivatives.value == pytest.approx(number_of(problem, quantity), abs=1e-12)
        for key, (at, made) in _parameters(problem, parameters).items():
            step = 1e-5 * (abs(at) or 1.0)
            expected = (number_of(made(at + step), quantity) - number_of(made(at - step), quantity)) / (2.0 * step)
            assert derivatives[key] == pytest.approx(expected, rel=1e-6, abs=1e-8), (quantity, key)


def test_the_shape_of_a_body_is_a_parameter() -> None:
    problem = dragged_strip(hv.Signorini(), hv.Coulomb(0.3))
    mesh = problem.mesh

    def leaning(slope: float) -> hv.ContactProblem:
        points = mesh.points.copy()
        points[:, 1] += slope * points[:, 0] * (1.0 - points[:, 1])
        return replace(problem, mesh=hv.Mesh(points, mesh.cells, mesh.boundaries))

    solution = hv.solve(leaning(0.05), controls=TIGHT)
    for quantity in ("normal-force", "support.left.force.y"):
        slope = sensitivity(solution, quantity, {"slope": (0.05, leaning)})["slope"]
        ends = [number_of(leaning(0.05 + step), quantity) for step in (1e-5, -1e-5)]
        assert slope == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-6)


def test_gaps_and_forces_at_every_point_come_along() -> None:
    problem = dragged_strip(hv.Signorini(), hv.Tresca(0.1))
    solution = hv.solve(problem, controls=TIGHT)
    derivatives = sensitivity(solution, "support.left.force.y", [GAP, FORCE])
    assert derivatives.gap.sum() == pytest.approx(derivatives[GAP], rel=1e-8)
    discrete = solution.problem
    assert discrete.field is not None
    for node in (9, 20):
        load = discrete.load + 1e-4 * discrete.field.basis[[2 * node + 1]].todense().ravel()
        moved = hv.solve(discrete.with_(load=load), controls=TIGHT)
        pressed = (moved.normal_force - solution.normal_force) / 1e-4
        found = sensitivity(solution, "normal-force").load[node, 1]
        assert found == pytest.approx(pressed, rel=1e-6)


def moved_block(top: float, law: object, gap: float = 0.0) -> hv.ContactProblem:
    """A block of stiffness ten between rollers, moved at its top."""
    return hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 1),
        hv.Material.young(10.0, 0.0),
        contact={"bottom": hv.Contact(law, gap=gap)},  # type: ignore[arg-type]
        supports={"left": "roller", "right": "roller", "top": hv.Fixed(y=top)},
    )


def test_at_a_kink_both_sides_are_told_and_a_direction_takes_the_right_one() -> None:
    problem, key = moved_block(-0.1, hv.Signorini(), gap=0.1), "supports.top.y"  # just touching
    solution = hv.solve(problem)
    both = sensitivity(solution, "normal-force", [key])
    assert both.kinks.tolist() == [0, 1]
    assert both.sides[key] == pytest.approx((-10.0, 0.0), abs=1e-9)  # down it is pressed, up it comes off
    for by, expected in ((1.0, 0.0), (-1.0, 10.0)):
        slope = sensitivity(solution, "normal-force", [key], direction={key: by})["direction"]
        ends = hv.solve(moved_block(-0.1 + 1e-4 * by, hv.Signorini(), gap=0.1)).normal_force / 1e-4
        assert slope == pytest.approx(expected, abs=1e-9) == pytest.approx(ends, abs=1e-6)


def test_a_gap_at_a_kink_has_both_sides_too() -> None:
    """A gap moves the local displacement itself: closing it presses, opening it does nothing."""
    solution, key = hv.solve(moved_block(-0.1, hv.Signorini(), gap=0.1)), "contact.bottom.gap"
    assert sensitivity(solution, "normal-force", [key]).sides[key] == pytest.approx((-10.0, 0.0), abs=1e-9)
    for by, expected in ((1.0, 0.0), (-1.0, 10.0)):
        slope = sensitivity(solution, "normal-force", [key], direction={key: by})["direction"]
        assert slope == pytest.approx(expected, abs=1e-9)


def test_a_law_that_moves_its_own_kink_is_refused() -> None:
    solution = hv.solve(moved_block(-0.1, hv.laws.FinitePenetration(0.0, 0.05), gap=0.05))
    with pytest.raises(ProblemError, match="at a kink"):
        sensitivity(solution, "normal-force", ["contact.bottom.normal.limit"])


def test_a_fold_is_told() -> None:
    """Where glue softens as fast as the body unloads, equilibria lie next to one another."""
    solution = hv.solve(moved_block(0.05, hv.laws.Adhesive(30.0, 0.3, softening=10.0, compression=50.0)))
    r = np.full((2, 1), -0.02)
    between = replace(
        solution,
        problem=solution.problem.with_(offset=solution.problem.contact.trace_of(solution.unknowns) - r * [[1.0, 0.0]]),
        multiplier=np.array([[-0.2, 0.0]] * 2),
    )
    with pytest.raises(ProblemError, match="not isolated"):
        sensitivity(between, "normal-force", ["supports.top.y"])


@pytest.mark.parametrize(
    ("quantity", "parameters", "match"),
    [
        ("normal-farce", [E], "is not known"),
        ("energy", ["material.youngs"], "has no 'youngs'"),
        ("energy", ["contact.bottom.normal"], "name a number"),
        ("energy", E, "give a list"),
    ],
)
def test_what_makes_no_sense_is_refused(quantity: str, parameters: list[str], match: str) -> None:
    with pytest.raises(ProblemError, match=match):
        sensitivity(hv.solve(dragged_strip(hv.Compliance(30.0))), quantity, parameters)


def test_the_force_of_a_support_beside_a_tie_is_refused() -> None:
    with pytest.raises(ProblemError, match="beside ties and plates"):
        sensitivity(hv.solve(tied_blocks()), "support.upper:left.force.x", [E])


def test_energy_under_coulombs_law_is_refused() -> None:
    with pytest.raises(ProblemError, match="depends on a friction bound"):
        sensitivity(hv.solve(dragged_strip(hv.Compliance(30.0), hv.Coulomb(0.2))), "energy", [E])
