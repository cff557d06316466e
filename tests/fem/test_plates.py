"""Rigid plates: closed forms on springs and bars, an independent computation, time, paths, levels and refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError, SupportError
from hemivar.fem import LoadLine
from hemivar.laws import Signorini, Tie
from hemivar.mechanics import RigidPlate, Spring
from hemivar.mesh import Mesh
from hemivar.solvers import NonsmoothMultigrid

STEEL = hv.Material.young(10.0, 0.3)


def plated_column(dim: int, plate: RigidPlate, order: int = 1, young: float = 10.0) -> hv.ContactProblem:
    """A column of Poisson's ratio 0 on a smooth base, with a plate on it."""
    mesh = hv.rectangle((2.0, 1.0), (4, 2)) if dim == 2 else hv.box((2.0, 1.0, 1.0), (2, 2, 2))
    base = {"bottom": hv.Roller(), "left": hv.Roller()} if dim == 2 else {"bottom": hv.Roller()}
    return hv.ContactProblem(mesh, hv.Material.young(young, 0.0), {}, {**base, "top": plate}, order=order)


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_a_central_force_shortens_a_column(dim: int, order: int) -> None:
    force = (*(0.0,) * (dim - 1), -0.4)
    still = {} if dim == 2 else {"x": 0.0, "y": 0.0, "turn_z": 0.0}
    problem = plated_column(dim, RigidPlate(force=force, **still), order)
    solution = hv.solve(problem)
    nodes = problem.mesh.nodes(order)
    assert solution.displacement[:, -1] == pytest.approx(-0.02 * nodes[:, -1], abs=1e-12)
    assert solution.plates["top"]["xyz"[dim - 1]] == pytest.approx(-0.02, rel=1e-11)
    assert solution.reactions["top"] == pytest.approx(force, abs=1e-11)
    assert solution.reactions["bottom"] == pytest.approx(-np.array(force), abs=1e-11)
    assert solution.energy == pytest.approx(-0.5 * 0.4 * 0.02, rel=1e-10)


@pytest.mark.parametrize("dim", [2, 3])
def test_an_eccentric_punch_tilts_on_springs(dim: int) -> None:
    """A stiff block on springs k per area under a force at the eccentricity e: F / (k A), and F e / (k I)."""
    mesh = hv.rectangle((2.0, 1.0), (4, 2)) if dim == 2 else hv.box((2.0, 1.0, 1.0), (4, 2, 2))
    stiff, down, off = 50.0, -0.3, 0.25
    middle = (1.0, 1.0) if dim == 2 else (1.0, 0.5, 1.0)
    axis = "turn_z" if dim == 2 else "turn_y"
    inertia = 2.0**3 / 12.0
    moment = off * down if dim == 2 else (0.0, -off * down, 0.0)
    plates = {
        "by its moment": RigidPlate(force=(*(0.0,) * (dim - 1), down), moment=moment, about=middle),
        "by its place": RigidPlate(force=(*(0.0,) * (dim - 1), down), about=(1.0 + off, *middle[1:])),
    }
    for plate in plates.values():
        supports = {"bottom": Spring(stiff, stiff), "top": plate}
        problem = hv.ContactProblem(mesh, hv.Material.young(1e7, 0.0), {}, supports)
        motion = hv.solve(problem).plates["top"]
        turn = off * down / (stiff * inertia)
        assert motion[axis] == pytest.approx(turn if dim == 2 else -turn, rel=1e-5)
        # a free block is turned about the middle of its base
        sunk = down / (stiff * 2.0) + turn * (plate.about[0] - 1.0)  # type: ignore[index]
        assert motion["xyz"[dim - 1]] == pytest.approx(sunk, rel=1e-5)
        assert motion["x"] == pytest.approx(-turn * 1.0, rel=1e-5)


def test_a_plate_is_what_a_stiff_washer_tends_to() -> None:
    """Under a rigid plate as under ever stiffer bonded elastic layers, of which the error falls with the stiffness."""
    mesh = hv.rectangle((2.0, 1.0), (8, 4))
    base = {"bottom": hv.Clamped()}
    rigid = hv.solve(hv.ContactProblem(mesh, STEEL, {}, {**base, "top": RigidPlate(force=(0.4, -2.0))})).displacement
    layered = Mesh.assembled({"body": mesh, "washer": hv.rectangle((2.0, 0.5), (8, 2), origin=(0.0, 1.0))})
    errors = []
    for stiff in (1e5, 1e6):
        material = hv.Material.by_region({"body": STEEL, "washer": hv.Material.young(stiff, 0.0)})
        joint = {"body:top": hv.Contact(Tie(), against="washer:bottom", slave="body:top")}
        problem = hv.ContactProblem(
            layered, material, joint, {"body:bottom": hv.Clamped()}, tractions={"washer:bottom": (0.2, -1.0)}
        )
        moved = hv.solve(problem).displacement[: len(mesh.points)]
        errors.append(float(np.abs(moved - rigid).max() / np.abs(rigid).max()))
    assert errors[1] < 1e-4
    assert errors[1] / errors[0] == pytest.approx(0.1, rel=0.05)


def test_prescribed_motions_have_the_reaction_that_makes_them() -> None:
    """What a plate moves by under loads, prescribed, takes these loads."""
    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    free = hv.ContactProblem(
        mesh,
        STEEL,
        {},
        {"bottom": hv.Clamped(), "top": RigidPlate(force=(0.3, -0.5), moment=0.2)},
        body_force=(0.1, 0.0),
    )
    solution = hv.solve(free)
    motion = solution.plates["top"]
    given = {name: motion[name] for name in ("x", "y", "turn_z")}
    held = hv.solve(replace(free, supports={**free.supports, "top": RigidPlate(**given)}))
    assert held.displacement == pytest.approx(solution.displacement, abs=1e-12)
    taken = held.plates["top"]
    assert [taken["force_x"], taken["force_y"], taken["moment_z"]] == pytest.approx([0.3, -0.5, 0.2], rel=1e-9)
    assert held.reactions["top"] == pytest.approx([0.3, -0.5], rel=1e-9)
    balance = held.reactions["top"] + held.reactions["bottom"] + np.array([0.2, 0.0])
    assert balance == pytest.approx([0.0, 0.0], abs=1e-12)
    some = RigidPlate(y=motion["y"], turn_z=motion["turn_z"], force=(0.3, 7.0))  # the force along y is held as well
    partly = hv.solve(replace(free, supports={**free.supports, "top": some}))
    assert partly.displacement == pytest.approx(solution.displacement, abs=1e-12)
    assert partly.reactions["top"] == pytest.approx([0.3, -0.5], rel=1e-9)


def test_a_support_at_the_end_of_a_plate_holds_it() -> None:
    """Half of a symmetric block: the roller keeps the plate from sliding and turning, as the other half would."""
    plate = RigidPlate(force=(0.0, -1.0), about=(1.0, 1.0))
    whole = hv.ContactProblem(
        hv.rectangle((2.0, 1.0), (8, 4), pattern="cross"), STEEL, {}, {"bottom": hv.Clamped(), "top": plate}
    )
    half_mesh = hv.rectangle((1.0, 1.0), (4, 4), origin=(1.0, 0.0), pattern="cross")
    half = RigidPlate(force=(0.0, -0.5), about=(1.0, 1.0), turn_z=0.0)
    sides = {"bottom": hv.Clamped(), "left": hv.Roller(), "top": half}
    one, other = hv.solve(whole), hv.solve(hv.ContactProblem(half_mesh, STEEL, {}, sides))
    assert other.plates["top"]["y"] == pytest.approx(one.plates["top"]["y"], rel=1e-11)
    assert other.energy == pytest.approx(0.5 * one.energy, rel=1e-11)
    total = sum(other.reactions.values())
    assert total == pytest.approx([0.0, 0.0], abs=1e-12)


def test_units_do_not_matter() -> None:
    plate = RigidPlate(force=(0.1, -0.5), moment=0.2)
    metre = hv.solve(hv.ContactProblem(hv.rectangle((2.0, 1.0), 3), STEEL, {}, {"bottom": hv.Clamped(), "top": plate}))
    mesh = hv.rectangle((2.0, 1.0), 3).scaled(1e3)
    soft = hv.Material.young(10.0e-6, 0.3)
    force = RigidPlate(force=(0.1e-3, -0.5e-3), moment=0.2)  # per mm of width
    other = hv.solve(hv.ContactProblem(mesh, soft, {}, {"bottom": hv.Clamped(), "top": force}))
    assert other.displacement == pytest.approx(1e3 * metre.displacement, rel=1e-9)
    assert other.plates["top"]["turn_z"] == pytest.approx(metre.plates["top"]["turn_z"], rel=1e-9)


def test_a_ring_moves_along_its_axis() -> None:
    mesh = hv.rectangle((1.0, 2.0), (2, 4), origin=(1.0, 0.0))
    steel = hv.Material.young(10.0, 0.0, plane="axisymmetric")
    supports = {"bottom": hv.Roller(), "top": RigidPlate(force=(0.0, -6.0))}
    solution = hv.solve(hv.ContactProblem(mesh, steel, {}, supports))
    area = np.pi * (4.0 - 1.0)
    assert solution.plates["top"]["y"] == pytest.approx(-6.0 * 2.0 / (10.0 * area), rel=1e-10)
    assert solution.displacement[:, 0] == pytest.approx(np.zeros(len(mesh.points)), abs=1e-12)
    with pytest.raises(ProblemError, match="turn_z, which such a body does not have"):
        hv.ContactProblem(mesh, steel, {}, {"top": RigidPlate(turn_z=0.0)})


def test_plates_in_time_and_on_paths() -> None:
    problem = plated_column(2, RigidPlate(force=(0.0, "-0.4*t")))
    history = hv.march(hv.Evolution(problem), until=1.0, step=0.5)
    y = problem.mesh.points[:, 1]
    assert history.frames[-1].displacement[:, 1] == pytest.approx(-0.02 * y, abs=1e-12)
    moved = plated_column(2, RigidPlate(y="-0.02*t", turn_z=0.0))
    history = hv.march(hv.Evolution(moved), until=1.0, step=0.5)
    assert history.frames[-1].displacement[:, 1] == pytest.approx(-0.02 * y, abs=1e-12)
    for plate in (RigidPlate(force=(0.0, -0.4)), RigidPlate(y=-0.02, turn_z=0.0)):
        half = LoadLine.of(plated_column(2, plate)).at(0.5)
        assert hv.solve(half).displacement[:, 1] == pytest.approx(-0.01 * y, abs=1e-12)
    loaded = replace(plated_column(2, RigidPlate(force=(0.0, -0.4))), body_force=(0.0, -0.2))
    other = replace(loaded, supports={**loaded.supports, "top": RigidPlate()})
    alone = {"top": hv.solve(replace(loaded, body_force=0.0)).displacement, "body": hv.solve(other).displacement}
    for constant, grows in (("top", "body"), ("body", "top")):
        half = hv.solve(LoadLine.to(hv.discretize(loaded), [constant]).at(0.5)).displacement
        assert half == pytest.approx(alone[constant] + 0.5 * alone[grows], abs=1e-12)


def test_a_plate_is_a_body_with_inertia_of_what_it_moves() -> None:
    """A column between two plates that nothing holds: pushed at both ends, it moves as one."""
    mesh = hv.rectangle((2.0, 1.0), (4, 2))
    steel = hv.Material.lame(5.0, 2.5, density=3.0)
    supports = {"top": RigidPlate(force=(0.0, 1.0)), "bottom": RigidPlate(force=(0.0, 1.0))}
    problem = hv.ContactProblem(mesh, steel, {}, supports)
    history = hv.march(hv.Evolution(problem, inertia=True), until=0.5, step=0.01)
    mean = history.frames[-1].displacement[:, 1].mean()
    assert mean == pytest.approx(0.5 * 2.0 / 6.0 * 0.5**2, rel=0.05)


def test_levels_of_multigrid_know_plates() -> None:
    mesh = hv.rectangle((2.0, 1.0), (2, 1)).refined(4)
    contact = {"bottom": hv.Contact(Signorini(), hv.Tresca(0.1))}
    supports = {"left": hv.Roller(), "top": RigidPlate(force=(0.0, -0.5), moment=0.05)}
    problem = hv.ContactProblem(mesh, STEEL, contact, supports)
    by_levels = hv.solve(problem, method=NonsmoothMultigrid())
    direct = hv.solve(problem)
    assert by_levels.displacement == pytest.approx(direct.displacement, abs=1e-8)
    assert by_levels.steps < 40
    assert direct.certify().unique


@pytest.mark.parametrize("slave", ["upper:bottom", "lower:top"])
def test_a_plate_that_ends_at_a_tie(slave: str) -> None:
    """Its nodes follow it, and the tie as well: what is joined moves as one, and the forces balance."""
    upper, lower = hv.rectangle((1.0, 1.0), (3, 3), origin=(0.0, 1.0)), hv.rectangle((1.0, 1.0), (2, 2))
    joint = {"upper:bottom": hv.Contact(Tie(), against="lower:top", slave=slave)}
    mesh = Mesh.assembled({"upper": upper, "lower": lower})
    supports = {"lower:left": hv.Clamped(), "upper:right": RigidPlate(force=(0.2, -0.1), moment=0.05)}
    solution = hv.solve(hv.ContactProblem(mesh, STEEL, joint, supports))
    assert sum(solution.reactions.values()) == pytest.approx([0.0, 0.0], abs=1e-12)
    free = {"lower:left": RigidPlate(force=(-0.2, 0.1)), "upper:right": RigidPlate(force=(0.2, -0.1), moment=0.05)}
    loose = hv.discretize(hv.ContactProblem(mesh, STEEL, joint, free), check_coercivity=False)
    assert loose.model.free_motions.count == 3


@pytest.mark.parametrize("joined", [True, False], ids=["tied", "one piece"])
def test_levels_without_coarser_meshes_know_plates_and_ties(joined: bool) -> None:
    parts = {
        "upper": hv.rectangle((2.0, 1.0), (33, 16), origin=(0.0, 1.0)),
        "lower": hv.rectangle((2.0, 1.0), (24, 12)),
    }
    mesh = Mesh.assembled(parts if joined else {"upper": parts["upper"]})
    contact = {"upper:right": hv.Contact(Signorini(), gap=0.01)}
    ties = {"upper:bottom": hv.Contact(Tie(), against="lower:top")} if joined else {}
    supports = {"lower:bottom" if joined else "upper:bottom": hv.Clamped(), "upper:top": RigidPlate(force=(0.2, -0.5))}
    problem = hv.ContactProblem(mesh, STEEL, {**contact, **ties}, supports)
    by_levels, direct = hv.solve(problem, method=NonsmoothMultigrid()), hv.solve(problem)
    assert by_levels.displacement == pytest.approx(direct.displacement, abs=1e-7)
    assert by_levels.steps < 60


def test_contact_at_the_end_of_a_plate_goes_to_the_next_point() -> None:
    contact = {"right": hv.Contact(Signorini())}
    supports = {"left": hv.Roller(), "bottom": hv.Roller(), "top": RigidPlate(force=(0.0, -0.5))}
    solution = hv.solve(hv.ContactProblem(hv.rectangle((1.0, 1.0), 4), STEEL, contact, supports))
    assert solution.reactions["left"][0] + solution.contact_forces["right"][0] == pytest.approx(0.0, abs=1e-12)
    assert solution.contact_forces["right"][0] < 0.0


def test_a_nonlinear_body_under_a_plate() -> None:
    hencky = hv.Material.hencky(bulk=20.0, shear=10.0, softened=0.25, strain=0.01)
    walls = {"left": hv.Roller(), "right": hv.Roller(), "bottom": hv.Roller()}
    mesh = hv.rectangle((1.0, 1.0), 2)
    pressed = hv.solve(hv.ContactProblem(mesh, hencky, {}, walls, tractions={"top": (0.0, -0.3)}))
    plate = hv.solve(hv.ContactProblem(mesh, hencky, {}, {**walls, "top": RigidPlate(force=(0.0, -0.3))}))
    assert plate.displacement == pytest.approx(pressed.displacement, abs=1e-9)
    down = RigidPlate(y=float(pressed.displacement[:, 1].min()), turn_z=0.0)
    moved = hv.solve(hv.ContactProblem(mesh, hencky, {}, {**walls, "top": down}))
    assert moved.displacement == pytest.approx(pressed.displacement, abs=1e-9)
    assert moved.reactions["top"] == pytest.approx([0.0, -0.3], abs=1e-8)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: plated_column(2, RigidPlate(z=0.0)), "z, which such a body does not have; give x, y, turn_z"),
        (lambda: plated_column(2, RigidPlate(force=(0.0, 0.0, 1.0))), r"force has shape \(3,\); it needs 2 components"),
        (lambda: plated_column(3, RigidPlate(moment=1.0)), "it needs 3 components"),
        (lambda: plated_column(2, RigidPlate(about=(0.0, 0.0, 0.0))), "about has 3 coordinates, the mesh has 2"),
        (lambda: hv.ContactProblem(hv.rectangle((1.0, 1.0), 2), STEEL, {"top": hv.Contact(Signorini())},
                                   {"top": RigidPlate()}), "is a rigid plate"),
        (lambda: hv.discretize(hv.ContactProblem(hv.rectangle((1.0, 1.0), 2), STEEL, {},
                                                 {"top": RigidPlate(), "right": RigidPlate()})), "share nodes"),
        (lambda: hv.discretize(hv.ContactProblem(hv.rectangle((1.0, 1.0), 2), STEEL, {},
                                                 {"top": RigidPlate(turn_z=0.1), "left": hv.Fixed(y=0.0),
                                                  "right": hv.Fixed(y=0.0)})), "cannot move as supports"),
    ],
)  # fmt: skip
def test_bad_plates_are_refused(make: object, says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        make()  # type: ignore[operator]


def test_a_plate_alone_holds_nothing() -> None:
    with pytest.raises(SupportError, match="free to move"):
        hv.discretize(hv.ContactProblem(hv.rectangle((1.0, 1.0), 2), STEEL, {}, {"top": RigidPlate(force=(0.0, 1.0))}))
