"""Ties: bodies joined for good, patch tests on meshes that do not match, and joints that are no joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError, SupportError
from hemivar.laws import Signorini, Tie
from hemivar.mechanics import minimal_support
from hemivar.mesh import Mesh
from hemivar.solvers import NonsmoothMultigrid

STEEL = hv.Material.young(10.0, 0.3)
JOINT = {"upper:bottom": hv.Contact(Tie(), against="lower:top")}


def tied_halves(dim: int, fine: int = 3, coarse: int = 2) -> Mesh:
    """A cube of two parts, one on the other."""
    if dim == 2:
        upper, lower = hv.rectangle((1.0, 0.5), (fine, 2), origin=(0.0, 0.5)), hv.rectangle((1.0, 0.5), (coarse, 1))
    else:
        upper = hv.box((1.0, 1.0, 0.5), (fine, fine, 1), origin=(0.0, 0.0, 0.5))
        lower = hv.box((1.0, 1.0, 0.5), (coarse, coarse, 1))
    return Mesh.assembled({"upper": upper, "lower": lower})


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_a_linear_displacement_passes_a_tie(dim: int, order: int) -> None:
    """Prescribed at the outer ends alone, with traction on the sides of the same constant stress."""
    mesh = tied_halves(dim)
    gradient = 0.01 * np.arange(1.0, dim * dim + 1.0).reshape(dim, dim)

    def move(x: np.ndarray) -> np.ndarray:
        return np.asarray(x @ gradient.T)

    strain = 0.5 * (gradient + gradient.T)
    lam, mu = 10.0 * 0.3 / (1.3 * 0.4), 10.0 / 2.6
    stress = lam * np.trace(strain) * np.eye(dim) + 2.0 * mu * strain
    sides = ("left", "right") if dim == 2 else ("left", "right", "front", "back")
    normals = dict(zip(sides, np.concatenate([[-np.eye(dim)[k], np.eye(dim)[k]] for k in range(dim - 1)]), strict=True))
    tractions = {f"{part}:{side}": stress @ normals[side] for part in ("upper", "lower") for side in sides}
    ends = {"upper:top": hv.Prescribed(move), "lower:bottom": hv.Prescribed(move)}
    problem = hv.ContactProblem(mesh, STEEL, JOINT, ends, tractions=tractions, order=order)
    solution = hv.solve(problem)
    assert solution.displacement == pytest.approx(move(mesh.nodes(order)), abs=1e-12)
    total = sum(solution.reactions.values())
    assert total == pytest.approx(np.zeros(dim), abs=1e-12)


@pytest.mark.parametrize("dim", [2, 3])
def test_a_joined_body_is_that_of_one_piece(dim: int) -> None:
    mesh = tied_halves(dim, 2, 2)
    if dim == 2:
        mesh = Mesh.assembled({
            "upper": hv.rectangle((1.0, 0.5), (2, 1), origin=(0.0, 0.5)), "lower": hv.rectangle((1.0, 0.5), (2, 1)),
        })  # fmt: skip
    whole = hv.rectangle((1.0, 1.0), 2) if dim == 2 else hv.box(cells=2)
    load = (0.3, -0.2) if dim == 2 else (0.3, 0.1, -0.2)
    joined = hv.ContactProblem(
        mesh, STEEL, JOINT, {"lower:left": hv.Clamped(), "upper:left": hv.Clamped()}, tractions={"upper:top": load}
    )
    plain = hv.ContactProblem(whole, STEEL, {}, {"left": hv.Clamped()}, tractions={"top": load})
    one, other = hv.solve(joined), hv.solve(plain)
    assert one.energy == pytest.approx(other.energy, rel=1e-12)
    rounded = [tuple(x) for x in np.round(whole.points, 9).tolist()]
    at = [rounded.index(tuple(x)) for x in np.round(mesh.points, 9).tolist()]
    assert one.displacement == pytest.approx(other.displacement[at], abs=1e-13)
    forces = one.reactions["lower:left"] + one.reactions["upper:left"]
    assert forces == pytest.approx(other.reactions["left"], abs=1e-12)


def test_a_tie_is_a_bilateral_joint_that_cannot_slip() -> None:
    """Against a stiff independent law: what glue of ever greater stiffness tends to."""
    mesh, load = tied_halves(2), {"upper:right": (0.3, -0.2)}
    supports = {"lower:bottom": hv.Clamped()}
    tied = hv.solve(hv.ContactProblem(mesh, STEEL, JOINT, supports, tractions=load)).displacement
    slips = []
    for stiff in (1e5, 1e6):
        glue = hv.laws.CoupledFormulaLaw(f"{stiff}*r^2/2 + {stiff}*s^2/2", reach=1.0)
        near = {"upper:bottom": hv.Contact(glue, against="lower:top")}
        slips.append(
            np.abs(hv.solve(hv.ContactProblem(mesh, STEEL, near, supports, tractions=load)).displacement - tied).max()
        )
    assert slips[1] < 1e-5
    assert slips[1] / slips[0] == pytest.approx(0.1, rel=0.01)


def test_tied_bodies_that_nothing_holds_move_as_one() -> None:
    mesh = tied_halves(2)
    loads = {"upper:top": (0.0, 1.0), "lower:bottom": (0.0, -1.0)}
    free = hv.ContactProblem(mesh, STEEL, JOINT, tractions=loads)
    assert hv.discretize(free, check_coercivity=False).model.free_motions.count == 3
    with pytest.raises(SupportError, match="free to move"):
        hv.discretize(free)
    held = replace(free, supports=minimal_support(hv.rectangle((1.0, 0.5), (2, 1))))
    stress = hv.solve(held).stress()
    assert stress == pytest.approx(np.broadcast_to([[0.0, 0.0], [0.0, 1.0]], stress.shape), abs=1e-12)
    pin = replace(free, supports={"pin": hv.Clamped(at=(0.0, 1.0)), "slide": hv.Fixed(x=0.0, at=(0.0, 0.0))})
    assert hv.solve(pin).stress() == pytest.approx(stress, abs=1e-11)


def test_prescribed_sides_are_followed() -> None:
    """The master is turned by its support: the other body, held nowhere else, turns with it."""
    mesh = tied_halves(2)
    turned = hv.Prescribed(lambda x: 0.01 * np.column_stack([-x[:, 1], x[:, 0]]))
    joint = {"upper:bottom": replace(JOINT["upper:bottom"], slave="upper:bottom")}
    ends = {"lower:top": turned, "lower:bottom": turned}
    problem = hv.ContactProblem(mesh, STEEL, joint, ends)
    x, y = mesh.points.T
    assert hv.solve(problem).displacement == pytest.approx(0.01 * np.column_stack([-y, x]), abs=1e-12)
    loaded = hv.solve(replace(problem, tractions={"upper:top": (0.3, -0.2)}))
    assert sum(loaded.reactions.values()) == pytest.approx([-0.3, 0.2], abs=1e-12)  # through the joint


@pytest.mark.parametrize("slave", ["upper:bottom", "lower:top"])
def test_contact_beside_a_tie(slave: str) -> None:
    """The nodes at the end of the tie may touch a wall; whichever side follows, the forces balance."""
    joint = {"upper:bottom": replace(JOINT["upper:bottom"], slave=slave)}
    walls = {name: hv.Contact(Signorini(), hv.Tresca(0.05)) for name in ("upper:right", "lower:right")}
    problem = hv.ContactProblem(
        tied_halves(2), STEEL, joint | walls, {"lower:bottom": hv.Clamped()}, tractions={"upper:left": (0.5, 0.0)}
    )
    solution = hv.solve(problem)
    assert solution.status.value == "converged"
    pushed = 0.25 + solution.reactions["lower:bottom"][0] + sum(f[0] for f in solution.contact_forces.values())
    assert pushed == pytest.approx(0.0, abs=1e-9)
    assert solution.certify().unique


def test_levels_of_multigrid_are_tied() -> None:
    upper, lower = hv.rectangle((1.0, 0.5), (3, 2), origin=(0.0, 0.5)), hv.rectangle((1.0, 0.5), (2, 1))
    mesh = Mesh.assembled({"upper": upper.refined(3), "lower": lower.refined(3)})
    contact = {**JOINT, "upper:top": hv.Contact(Signorini(), gap=0.001)}
    problem = hv.ContactProblem(mesh, STEEL, contact, {"lower:bottom": hv.Clamped()}, body_force=(0.05, 0.1))
    by_levels = hv.solve(problem, method=NonsmoothMultigrid())
    assert by_levels.displacement == pytest.approx(hv.solve(problem).displacement, abs=1e-9)
    assert by_levels.steps < 40


def test_a_tie_in_time_and_of_bodies_of_revolution() -> None:
    """A tied disc pressed uniformly, its lower side moved by its support: a shear-free column of Poisson's ratio 0."""
    mesh = tied_halves(2)
    steel = hv.Material.young(10.0, 0.0, plane="axisymmetric")
    moved = {"lower:bottom": hv.Fixed(y="0.01*t")}
    problem = hv.ContactProblem(mesh, steel, JOINT, moved, tractions={"upper:top": (0.0, "-0.1*t")})
    history = hv.march(hv.Evolution(problem), until=1.0, step=0.5)
    assert history.frames[-1].displacement[:, 1] == pytest.approx(0.01 - 0.01 * mesh.points[:, 1], abs=1e-12)


def test_a_moved_master_is_followed_in_time() -> None:
    mesh = tied_halves(2)
    turned = hv.Prescribed(lambda x, t: 0.01 * t * np.column_stack([-x[:, 1], x[:, 0]]))
    joint = {"upper:bottom": replace(JOINT["upper:bottom"], slave="upper:bottom")}
    problem = hv.ContactProblem(mesh, STEEL, joint, {"lower:top": turned, "lower:bottom": turned})
    history = hv.march(hv.Evolution(problem), until=1.0, step=0.5)
    assert history.frames[-1].displacement == pytest.approx(0.01 * mesh.points @ [[0.0, 1.0], [-1.0, 0.0]], abs=1e-12)


def test_a_nonlinear_body_passes_the_patch_test() -> None:
    mesh = tied_halves(2)
    hencky = hv.Material.hencky(bulk=20.0, shear=10.0, softened=0.25, strain=0.01)
    walls = {f"{part}:{side}": hv.Roller() for part in ("upper", "lower") for side in ("left", "right")}
    ends = {"lower:bottom": hv.Roller(), "upper:top": hv.Fixed(y=-0.01)}
    solution = hv.solve(hv.ContactProblem(mesh, hencky, JOINT, {**walls, **ends}))
    assert solution.displacement[:, 1] == pytest.approx(-0.01 * mesh.points[:, 1], abs=1e-10)


def test_three_bodies_hang_together() -> None:
    parts = {
        name: hv.rectangle((1.0, 1.0), (cells, 2), origin=(0.0, float(k)))
        for k, (name, cells) in enumerate({"a": 2, "b": 3, "c": 5}.items())
    }
    joints = {"b:bottom": hv.Contact(Tie(), against="a:top"), "c:bottom": hv.Contact(Tie(), against="b:top")}
    problem = hv.ContactProblem(
        Mesh.assembled(parts), hv.Material.young(10.0, 0.0), joints, {"a:bottom": hv.Roller(), "a:left": hv.Roller()},
        tractions={"c:top": (0.0, 1.0)},
    )  # fmt: skip
    solution = hv.solve(problem)
    assert solution.displacement[:, 1] == pytest.approx(0.1 * problem.mesh.points[:, 1], abs=1e-12)


def test_heat_that_would_not_pass_a_tie_is_refused() -> None:
    warm = hv.mechanics.Heat(conductivity=1.0, capacity=1.0)
    with pytest.raises(ProblemError, match="no heat passes it"):
        hv.Evolution(hv.ContactProblem(tied_halves(2), STEEL, JOINT, {"lower:bottom": hv.Clamped()}), heat=warm)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: hv.Contact(Tie()), "a tie takes against"),
        (lambda: hv.Contact(Tie(), hv.Tresca(1.0), against="a"), "a tie takes no friction"),
        (lambda: hv.Contact(Tie(), against="a", gap=0.1), "a tie takes no gap"),
        (
            lambda: hv.ContactProblem(tied_halves(2), STEEL, {"upper:bottom": hv.Contact(Tie(), against="top")}),
            "names boundary",
        ),
    ],
)
def test_bad_ties_are_refused(make: object, says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        make()  # type: ignore[operator]
