"""Springs of supports: closed forms of bars and blocks, motions that they leave free, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.errors import ProblemError, SupportError
from hemivar.laws import Signorini
from hemivar.mechanics import Spring
from hemivar.solvers import NonsmoothMultigrid

YOUNG, STIFF, PULL = 10.0, 3.0, 0.01


def spring_bar(dim: int, order: int = 1, spring: Spring | None = None, unit: float = 1.0) -> hv.ContactProblem:
    """A bar without lateral strain, 2 long, pulled at its right end and held by springs at the left one."""
    mesh = hv.rectangle((2.0, 1.0), (4, 2)) if dim == 2 else hv.box((2.0, 1.0, 1.0), (2, 1, 1))
    spring = Spring(normal=STIFF) if spring is None else spring
    sides = ("bottom",) if dim == 2 else ("bottom", "front")
    pull = {"right": (PULL, *(0.0,) * (dim - 1))}
    supports = {"left": spring, **dict.fromkeys(sides, hv.Roller())}
    return hv.ContactProblem(mesh, hv.Material.young(YOUNG, 0.0), {}, supports, tractions=pull, order=order)


@pytest.mark.parametrize(("dim", "order"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_a_bar_with_an_end_spring_moves_as_two_springs_in_series(dim: int, order: int) -> None:
    solution = hv.solve(spring_bar(dim, order))
    x = solution.problem.field.nodes[:, 0]  # type: ignore[union-attr]
    assert solution.displacement[:, 0] == pytest.approx(PULL / STIFF + PULL * x / YOUNG, rel=1e-10)
    assert solution.reactions["left"] == pytest.approx([-PULL, *(0.0,) * (dim - 1)], abs=1e-13)
    assert solution.energy == pytest.approx(-0.5 * PULL * (PULL / STIFF + PULL * 2.0 / YOUNG), rel=1e-10)


def test_springs_along_a_stated_direction_resist_that_one() -> None:
    spring = Spring(normal=STIFF, tangential=0.0, direction=(-3.0, 0.0))
    assert hv.solve(spring_bar(2, spring=spring)).displacement == pytest.approx(
        hv.solve(spring_bar(2)).displacement, rel=1e-12
    )


def test_a_stiffness_that_varies_is_integrated() -> None:
    """A stiff block on springs of the stiffness 2 y: what they push with has the moment that tilts it."""
    stiff = replace(spring_bar(2, spring=Spring(normal="2*y")), material=hv.Material.young(1e9, 0.0))
    assert hv.solve(stiff).displacement[:, 0] == pytest.approx(PULL, rel=1e-5)


def test_units_do_not_matter() -> None:
    """In mm and MPa as in m and Pa: areas are 1e6 times as large, stiffness per area 1e-9."""
    metre, other = hv.solve(spring_bar(2)), spring_bar(2)
    scaled = hv.ContactProblem(
        other.mesh.scaled(1e3), hv.Material.young(YOUNG * 1e-6, 0.0), {},
        {"left": Spring(normal=STIFF * 1e-9), "bottom": hv.Roller()}, tractions={"right": (PULL * 1e-6, 0.0)},
    )  # fmt: skip
    assert hv.solve(scaled).displacement == pytest.approx(1e3 * metre.displacement, rel=1e-9)


def block_on_springs(
    supports: dict[str, object], dim: int = 2, force: tuple[float, ...] = (0.3, -0.5)
) -> hv.ContactProblem:
    mesh = hv.rectangle((2.0, 1.0), (4, 2)) if dim == 2 else hv.box((2.0, 1.0, 1.0), (2, 1, 1))
    return hv.ContactProblem(mesh, hv.Material.young(1e7, 0.3), {}, supports, tractions={"top": force})  # type: ignore[arg-type]


def test_a_stiff_block_on_springs_moves_as_a_rigid_body() -> None:
    """Down by F / (k A), along by T / (k_t A), turned by T h / (k I) with I = 2^3 / 12."""
    solution = hv.solve(block_on_springs({"bottom": Spring(STIFF, 2.0)}))
    x, y = solution.problem.field.nodes.T  # type: ignore[union-attr]
    turn = -0.3 * 2.0 / (STIFF * 8.0 / 12.0)
    assert solution.displacement[:, 0] == pytest.approx(0.3 / 2.0 - turn * y, abs=1e-5)
    assert solution.displacement[:, 1] == pytest.approx(-0.5 / STIFF + turn * (x - 1.0), abs=1e-5)
    assert solution.reactions["bottom"] == pytest.approx([-0.6, 1.0], rel=1e-7)


def test_springs_at_points_carry_what_a_lever_gives_them() -> None:
    """Two point springs under a stiff block, 2 apart: a load at its right quarter is shared 1 to 3."""
    supports: dict[str, object] = {
        "one": Spring(40.0, 40.0, at=(0.0, 0.0)),
        "other": Spring(40.0, direction=(0.0, 1.0), at=(2.0, 0.0)),
    }
    problem = replace(block_on_springs(supports), tractions={"top": (0.0, "-3*x^2")})  # force 8 at x = 1.5
    solution = hv.solve(problem)
    assert solution.reactions["one"] == pytest.approx([0.0, 2.0], abs=1e-4)
    assert solution.reactions["other"] == pytest.approx([0.0, 6.0], abs=1e-4)


def test_springs_of_a_body_of_revolution_count_the_whole_ring() -> None:
    """A stiff disc of radius 2 on springs k per area and one ring of them: F / (k pi R^2 + K)."""
    mesh, steel = hv.rectangle((2.0, 1.0), (4, 2)), hv.Material.young(1e8, 0.3, plane="axisymmetric")
    ring = Spring(7.0, 7.0, at=(2.0, 0.0))
    supports = {"bottom": Spring(STIFF), "ring": replace(ring, tangential=0.0, direction=(0.0, 1.0))}
    solution = hv.solve(hv.ContactProblem(mesh, steel, {}, supports, tractions={"top": (0.0, -0.5)}))
    area = np.pi * 4.0
    assert solution.displacement[:, 1] == pytest.approx(-0.5 * area / (STIFF * area + 7.0), rel=1e-4)


def test_what_springs_do_not_resist_stays_free() -> None:
    with pytest.raises(SupportError, match=r"free to move: .*translation \(1, 0\)"):
        hv.discretize(block_on_springs({"bottom": Spring(STIFF)}))
    free = hv.discretize(block_on_springs({"bottom": Spring(STIFF)}), check_coercivity=False).model.free_motions
    assert free.count == 1
    with pytest.raises(SupportError, match="free to move"):
        hv.discretize(block_on_springs({"pin": Spring(STIFF, STIFF, at=(0.0, 0.0))}))
    held = hv.discretize(
        block_on_springs(
            {
                "bottom": Spring(STIFF),
                "left": Spring(0.0, 2.0),
                "top": Spring(0.0, 1.0),
            }
        )
    )
    assert held.model.free_motions.count == 0


def test_multigrid_knows_springs() -> None:
    mesh = hv.rectangle((2.0, 1.0), (4, 2)).refined(3)
    contact = {"top": hv.Contact(Signorini(), gap=0.001)}
    problem = hv.ContactProblem(
        mesh,
        hv.Material.young(YOUNG, 0.3),
        contact,
        {"bottom": Spring(STIFF, STIFF)},
        body_force=(0.0, 0.02),
    )
    by_levels = hv.solve(problem, method=NonsmoothMultigrid())
    assert by_levels.displacement == pytest.approx(hv.solve(problem).displacement, abs=1e-9)
    assert by_levels.steps < 40


def test_a_nonlinear_body_stands_on_springs_as_a_linear_one_of_its_moduli() -> None:
    linear = spring_bar(2)
    hencky = hv.Material.hencky(bulk=YOUNG / 3.0, shear=YOUNG / 2.0, softened=1.0, strain=1.0)
    displacement = hv.solve(replace(linear, material=hencky)).displacement
    assert displacement == pytest.approx(hv.solve(linear).displacement, rel=1e-8)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Spring(), "no stiffness"),
        (lambda: Spring(-1.0), "that is not negative"),
        (lambda: Spring("t"), "depends on time"),
        (lambda: Spring(1.0, at=(0.0, 0.0)), "has no normal; give direction"),
        (lambda: Spring(1.0, direction=(0.0, 0.0)), "not zero"),
        (lambda: block_on_springs({"bottom": Spring(1.0, direction=(0.0, 0.0, 1.0))}), "needs 2"),
        (lambda: hv.discretize(block_on_springs({"bottom": Spring("x - 1", 1.0)})), "must not be negative"),
        (lambda: block_on_springs({"low": Spring(1.0, 1.0)}), "names boundary 'low'"),
    ],
)
def test_bad_springs_are_refused(make: object, says: str) -> None:
    with pytest.raises(ProblemError, match=says):
        make()  # type: ignore[operator]
