"""Contact of bodies that are not linear: closed forms, other methods, and an energy that never rises."""

from __future__ import annotations

import dataclasses
import itertools
from itertools import pairwise

import numpy as np
import pytest
import scipy.integrate

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.fem import discretize
from hemivar.laws import Friction, Superpotential
from hemivar.mechanics.material import Material
from hemivar.mesh import Mesh
from hemivar.solvers import METHODS, ProximalNewton, Search, Solver, suited
from tests.samples import sampled

BULK, SHEAR, LEFT, SIZE = 20 / 3, 4.0, 0.25, 0.05
FRICTIONS = (hv.laws.NoFriction(), hv.Tresca(0.1), hv.Coulomb(0.3))
#: Laws of the block and the penetrations that belong to them, computed apart from one equation.
BLOCK = [(hv.laws.ThresholdCompliance(0.3, 2.0), 0.062733873583324), (hv.Compliance(20.0), 0.034941569056)]


def hencky(left: float = LEFT, scale: float = 1.0, plane: str = "strain") -> Material:
    return Material.hencky(scale * BULK, scale * SHEAR, left, SIZE, plane)


def block(law: Superpotential, cells: int = 4, order: int = 1, dim: int = 2) -> hv.ContactProblem:
    """A block of height 1 between smooth walls, pushed down by 0.1."""
    mesh = hv.rectangle((1.0, 1.0), cells) if dim == 2 else hv.box((1.0, 1.0, 1.0), cells)
    sides = ("left", "right") if dim == 2 else ("left", "right", "front", "back")
    down = hv.Fixed(y=-0.1) if dim == 2 else hv.Fixed(z=-0.1)
    supports = {"top": down, **dict.fromkeys(sides, hv.Roller())}
    return hv.ContactProblem(mesh, hencky(), supports=supports, contact={"bottom": hv.Contact(law)}, order=order)


@pytest.mark.parametrize(
    "method", [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()], ids=lambda m: m.name
)
@pytest.mark.parametrize(("dim", "cells", "order"), [(2, 4, 1), (2, 16, 1), (2, 4, 2), (3, 4, 1)])
@pytest.mark.parametrize(("law", "penetration"), BLOCK)
def test_the_block(law: Superpotential, penetration: float, dim: int, cells: int, order: int, method: Solver) -> None:
    solution = hv.solve(block(law, cells, order, dim), method, hv.Controls(rtol=1e-11)).raise_for_status()
    np.testing.assert_allclose(solution.local[:, 0], penetration, rtol=1e-9)


@pytest.mark.parametrize(
    "method", [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()], ids=lambda m: m.name
)
@pytest.mark.parametrize("cells", [2, 8])
def test_a_block_that_stiffens(cells: int, method: Solver) -> None:
    """Elastic with projection: the energy has no second derivative where the strain meets the set."""
    stated = dataclasses.replace(block(hv.Compliance(20.0), cells), material=Material.locking(BULK, SHEAR, 6.0, 0.03))
    solution = hv.solve(stated, method, rtol=1e-11).raise_for_status()
    np.testing.assert_allclose(solution.local[:, 0], 0.0403619615398, rtol=1e-9)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_serves_inside(name: str) -> None:
    law, penetration = BLOCK[1]
    solution = hv.solve(block(law, 2), METHODS[name], hv.Controls(rtol=1e-8)).raise_for_status()
    assert solution.method == f"proximal-newton({name})"
    np.testing.assert_allclose(solution.local[:, 0], penetration, rtol=1e-7)


def test_multigrid_starts_from_the_answer_on_the_next_coarser_mesh() -> None:
    """Which is that of the block on every mesh: what is left to do is to confirm it."""
    law, _ = BLOCK[0]
    direct, nested = (
        hv.solve(block(law, 16), method) for method in (hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid())
    )
    assert direct.history[0].residual > 0.1
    assert nested.history[0].residual < 1e-3
    assert nested.steps < direct.steps


# ---- the ring 1 < r < 2, whose outer side is pushed inwards by D -------------------------------------------------


def quarter_ring(cells: int) -> Mesh:
    """A quarter of it; ``bottom`` and ``top`` are the cuts, ``left`` is the inner side and ``right`` the outer one."""
    flat = hv.rectangle((1.0, 0.5 * np.pi), (cells, 2 * cells), origin=(1.0, 0.0))
    r, angle = flat.points.T
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    points[np.abs(points) < 1e-14] = 0.0
    return Mesh(points, flat.cells, boundaries=dict(flat.boundaries))


def ring(material: Material, law: Superpotential, pushed: float, cells: int) -> hv.ContactProblem:
    def inwards(points: Array) -> Array:
        return np.asarray(-pushed * points / np.linalg.norm(points, axis=1)[:, None])

    supports = {"bottom": hv.Roller(), "top": hv.Roller(), "right": hv.Prescribed(inwards)}
    return hv.ContactProblem(quarter_ring(cells), material, supports=supports, contact={"left": hv.Contact(law)})


def ring_by_shooting(pushed: float, pressure: object, first: float, last: float) -> float:
    """Penetration at r = 1: the equation of the radius in plane strain, solved as an initial value problem."""

    def stress(slope: float, hoop: float) -> tuple[float, float]:
        p = slope + hoop
        s = (slope - p / 3.0) ** 2 + (hoop - p / 3.0) ** 2 + (p / 3.0) ** 2
        phi = 2.0 * SHEAR * (LEFT + (1.0 - LEFT) / np.sqrt(1.0 + s / SIZE**2))
        return BULK * p + phi * (slope - p / 3.0), BULK * p + phi * (hoop - p / 3.0)

    def slope_of(radial: float, hoop: float) -> float:
        return float(scipy.optimize.brentq(lambda slope: stress(slope, hoop)[0] - radial, -5.0, 5.0, xtol=1e-15))

    def missed(s: float) -> float:
        def rates(r: float, y: Array) -> list[float]:
            u, radial = y
            slope = slope_of(radial, u / r)
            return [slope, (stress(slope, u / r)[1] - radial) / r]

        start = [-s, -pressure(s)]  # type: ignore[operator]
        found = scipy.integrate.solve_ivp(rates, (1.0, 2.0), start, rtol=1e-11, atol=1e-13)
        return float(found.y[0, -1]) + pushed

    return float(scipy.optimize.brentq(missed, first, last, xtol=1e-14))


def test_the_ring_by_shooting_is_that_of_the_table() -> None:
    assert ring_by_shooting(0.1, lambda s: 2.0 * s, 0.05, 0.15) == pytest.approx(0.0949739517132, abs=1e-10)


def test_the_ring_converges_at_the_rate_of_linear_elements() -> None:
    """The mean penetration is off by a multiple of h^2."""
    off = []
    for cells in (4, 8, 16):
        solution = hv.solve(ring(hencky(), hv.Compliance(2.0), 0.1, cells)).raise_for_status()
        mean = solution.local[:, 0] @ solution.contact.weights / solution.contact.weights.sum()
        off.append(abs(mean - 0.0949739517132))
    rates = np.log2(np.array(off[:-1]) / off[1:])
    assert rates[-1] == pytest.approx(2.0, abs=0.15), (off, rates)
    assert off[-1] < 3e-4


def test_the_linear_ring() -> None:
    """With q = 1 the table's number is 4/45."""
    solution = hv.solve(ring(hencky(1.0), hv.Compliance(2.0), 0.1, 16)).raise_for_status()
    assert solution.local[:, 0].mean() == pytest.approx(4.0 / 45.0, rel=3e-3)


def test_three_solutions_of_a_ring_that_softens() -> None:
    """Started near each of the two that are minima, the method stays there."""
    law = hv.Softening(40.0, 0.02, 25.0)
    problem = discretize(ring(hencky(), law, 0.055, 16))
    method = hv.solvers.NonsmoothNewton(search=Search.DOWNHILL)
    low = hv.solve(problem, method).raise_for_status()
    assert low.local[:, 0].mean() == pytest.approx(0.0153219650073, rel=2e-2)
    pressed = discretize(ring(hencky(), hv.laws.NoContact(), 0.055, 16))
    far = hv.solve(problem, method, initial=hv.solve(pressed).unknowns).raise_for_status()
    assert far.local[:, 0].mean() == pytest.approx(0.0579090994297, rel=2e-2)


# ---- the same as a linear body, and invariances --------------------------------------------------------------------


def punch(material: Material, cells: int = 8, order: int = 1, friction: Friction = FRICTIONS[0]) -> hv.ContactProblem:
    """A body pushed askew onto a rigid foundation, which it leaves in part."""
    return hv.ContactProblem(
        hv.rectangle((1.0, 1.0), cells),
        material,
        supports={"top": hv.Prescribed((0.02, -0.03))},
        contact={"bottom": hv.Contact(hv.Signorini(), friction, gap=lambda x: 0.05 * x[:, 0])},
        order=order,
    )


@pytest.mark.parametrize(
    ("friction", "plane", "order", "method"),
    sampled(
        itertools.product(
            FRICTIONS, ("strain", "stress"), (1, 2), (hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid())
        ),
        5,
    ),
    ids=lambda value: getattr(value, "name", None),
)
def test_a_linear_material_as_a_potential_has_the_linear_answer(
    friction: Friction, plane: str, order: int, method: Solver
) -> None:
    controls = hv.Controls(rtol=1e-11)
    linear = hv.solve(punch(Material.lame(4.0, 4.0, plane), order=order, friction=friction), controls=controls)
    problem = discretize(punch(hencky(1.0, plane=plane), order=order, friction=friction))
    other = hv.solve(problem, suited(method, problem), controls).raise_for_status()
    np.testing.assert_allclose(other.unknowns, linear.unknowns, atol=1e-9 * np.abs(linear.unknowns).max())
    size = np.abs(linear.multiplier).max()
    np.testing.assert_allclose(other.multiplier, linear.multiplier, atol=1e-8 * size)


@pytest.mark.parametrize("friction", FRICTIONS, ids=["none", "tresca", "coulomb"])
def test_condensed_and_multigrid_agree(friction: Friction) -> None:
    problem, found = discretize(punch(hencky(), 16, friction=friction)), []
    for method in (hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()):
        chosen = suited(method, problem)
        found.append(hv.solve(problem, chosen, hv.Controls(rtol=1e-11)).raise_for_status())
    np.testing.assert_allclose(found[0].unknowns, found[1].unknowns, atol=1e-8 * np.abs(found[0].unknowns).max())
    assert found[0].states.counts == found[1].states.counts


def test_units_do_not_matter() -> None:
    """The same body in millimetres and pascals."""
    small, length, force = punch(hencky(), 8), 1e3, 1e7
    mesh = small.mesh.moved(length * np.eye(2))
    big = dataclasses.replace(
        small,
        mesh=mesh,
        material=hencky(scale=force),
        supports={"top": hv.Prescribed((0.02 * length, -0.03 * length))},
        contact={"bottom": hv.Contact(hv.Signorini(), gap=lambda x: 0.05 * x[:, 0])},
    )
    one, other = hv.solve(small).raise_for_status(), hv.solve(big).raise_for_status()
    assert one.steps == other.steps
    np.testing.assert_allclose(other.unknowns, length * one.unknowns, atol=1e-9 * length)
    np.testing.assert_allclose(other.multiplier, force * one.multiplier, atol=1e-7 * force)


@pytest.mark.parametrize("size", [0.3, 1.0, 3.0])
def test_the_energy_never_rises(size: float) -> None:
    """Also far from small strains, where the material has softened to a hundredth, and contact softens as well."""
    material = Material.hencky(BULK, SHEAR, 0.01, 1e-3)
    problem = hv.ContactProblem(
        hv.rectangle((1.0, 1.0), 8),
        material,
        supports={"top": hv.Prescribed((0.1 * size, -0.1 * size))},
        contact={"bottom": hv.Contact(hv.Softening(20.0, 0.01, 2.0), hv.Tresca(0.05))},
    )
    solution = hv.solve(problem).raise_for_status()
    energies = [progress.energy for progress in solution.history]
    assert all(after <= before for before, after in pairwise(energies)), energies


@pytest.mark.parametrize(
    "method", [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()], ids=lambda m: m.name
)
def test_steps_that_go_too_far_are_halved(method: Solver) -> None:
    """A power law is soft where the gradient is small: from rest, the linear body leads far beyond the answer."""
    problem = discretize(
        hv.ScalarProblem(
            hv.rectangle((1.0, 1.0), 8),
            hv.mechanics.PowerLaw(8.0, 0.1, 100.0),
            supports={"top": 0.0},
            contact={"bottom": hv.ScalarContact(hv.Signorini(), level=0.3)},
            source=lambda x: 5.0 + x[:, 0],
        )
    )
    solution = hv.solve(problem, method, initial=np.zeros(problem.unknowns)).raise_for_status()
    energies = [progress.energy for progress in solution.history]
    assert energies[0] > energies[-1]
    assert all(after <= before for before, after in pairwise(energies)), energies


def test_reactions_balance_the_foundation() -> None:
    solution = hv.solve(punch(hencky())).raise_for_status()
    forces = -solution.contact.weights[:, None] * solution.contact.global_vectors(solution.multiplier)
    size = np.abs(forces).sum()
    np.testing.assert_allclose(solution.reactions["top"] + forces.sum(axis=0), 0.0, atol=1e-9 * size)


def test_a_state_without_contact_points() -> None:
    """A nonlinear body alone, in the plane and in space: displacement u_y = -0.1 y of the block."""
    for dim in (2, 3):
        stated = block(hv.laws.NoContact(), 4, 1, dim)
        stated = dataclasses.replace(stated, contact={}, supports={**stated.supports, "bottom": hv.Roller()})
        solution = hv.solve(stated).raise_for_status()
        np.testing.assert_allclose(solution.displacement[:, -1], -0.1 * stated.mesh.points[:, -1], atol=1e-12)


@pytest.mark.parametrize("limit", [hv.Controls(max_steps=1), hv.Controls(callback=lambda progress: progress.step == 1)])
def test_it_stops_when_it_is_told(limit: hv.Controls) -> None:
    solution = hv.solve(punch(hencky()), hv.solvers.NonsmoothNewton(), limit)
    assert solution.steps == 1
    assert solution.status in (hv.Status.MAX_STEPS, hv.Status.INTERRUPTED)


def test_what_it_refuses() -> None:
    with pytest.raises(hv.errors.ProblemError, match="must be in"):
        ProximalNewton(forcing=1.0)
    with pytest.raises(hv.errors.ProblemError, match="put it outside"):
        ProximalNewton(hv.solvers.FixedPoint())
