"""Contact of bodies that are not linear: closed forms, other methods, and an energy that never rises."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
import scipy.integrate

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.discrete.potential import Potential, Softened
from hemivar.fem import discretize
from hemivar.laws import Friction, Superpotential
from hemivar.mechanics.material import Material
from hemivar.mesh import Mesh
from hemivar.solvers import METHODS, ProximalNewton, Search, Solver
from hemivar.solvers.solve import suited
from tests.bodies import BULK, LEFT, SHEAR, SIZE, hencky
from tests.samples import sampled

FRICTIONS = (hv.laws.NoFriction(), hv.Tresca(0.1), hv.Coulomb(0.3))
#: Laws of the block and the penetrations that belong to them, computed apart from one equation.
BLOCK = [(hv.laws.ThresholdCompliance(0.3, 2.0), 0.062733873583324), (hv.Compliance(20.0), 0.034941569056)]


def lowered_block(law: Superpotential, cells: int = 4, order: int = 1, dim: int = 2) -> hv.ContactProblem:
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
    solution = hv.solve(lowered_block(law, cells, order, dim), method, hv.Controls(rtol=1e-11)).raise_for_status()
    np.testing.assert_allclose(solution.local[:, 0], penetration, rtol=1e-9)


@pytest.mark.parametrize(
    "method", [hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid()], ids=lambda m: m.name
)
@pytest.mark.parametrize("cells", [2, 8])
def test_a_block_that_stiffens(cells: int, method: Solver) -> None:
    """Elastic with projection: the energy has no second derivative where the strain meets the set."""
    stated = dataclasses.replace(
        lowered_block(hv.Compliance(20.0), cells), material=Material.locking(BULK, SHEAR, 6.0, 0.03)
    )
    solution = hv.solve(stated, method, rtol=1e-11).raise_for_status()
    np.testing.assert_allclose(solution.local[:, 0], 0.0403619615398, rtol=1e-9)


@pytest.mark.parametrize("name", METHODS)
def test_every_method_serves_inside(name: str) -> None:
    law, penetration = BLOCK[1]
    solution = hv.solve(lowered_block(law, 2), METHODS[name], hv.Controls(rtol=1e-7)).raise_for_status()
    assert solution.method == f"proximal-newton({name})"
    np.testing.assert_allclose(solution.local[:, 0], penetration, rtol=1e-7)


def test_multigrid_starts_from_the_answer_on_the_next_coarser_mesh() -> None:
    """Which is that of the block on every mesh: what is left to do is to confirm it."""
    law, _ = BLOCK[0]
    direct, nested = (
        hv.solve(lowered_block(law, 16), method)
        for method in (hv.solvers.NonsmoothNewton(), hv.solvers.NonsmoothMultigrid())
    )
    assert direct.history[0].residual > 0.1
    assert nested.history[0].residual < 1e-3
    assert nested.steps <= direct.steps


# ---- where a body begins whose supports move -----------------------------------------------------------------------


def softening_stress(e: float) -> float:
    return 60.0 * e + 16.0 / 3.0 * e - 160.0 / 9.0 * e**3


def stiffening(e: float) -> float:
    return 6.0 * e + 16.0 / 3.0 * e + 8.0e5 / 9.0 * e**3


def limited(e: float) -> float:
    return 6.0 * e + 2.0 / 3.0 * e / (0.04 - 2.0 / 3.0 * e**2)


#: Formulas of stored energies, how far they reach, and the pressure of one that is compressed along one axis.
FORMULAS = [
    ("30*tr^2 + 4*dev2 - 10*dev2^2", 0.2, softening_stress),
    ("3*tr^2 + 4*dev2 + 50000*dev2^2", 0.5, stiffening),
    ("3*tr^2 - 0.5*log(1 - dev2/0.04)", 0.19, limited),
]


@pytest.mark.parametrize(("formula", "reach", "pressure"), FORMULAS, ids=["softens", "stiffens", "ends"])
@pytest.mark.parametrize(("cells", "order"), [(1, 1), (8, 1), (32, 1), (8, 2)])
def test_supports_that_move_find_the_same_answer_on_every_mesh(
    formula: str, reach: float, pressure: Callable[[float], float], cells: int, order: int
) -> None:
    """To the tolerance; alone they would strain the cells beside them by ``0.1 / h``."""
    exact = scipy.optimize.brentq(lambda s: pressure(0.1 - s) - 20.0 * s, 0.0, 0.1, xtol=1e-16)
    stated = lowered_block(hv.Compliance(20.0), cells, order)
    solution = hv.solve(
        dataclasses.replace(stated, material=Material.potential(formula, reach=reach))
    ).raise_for_status()
    np.testing.assert_allclose(solution.penetration, exact, rtol=1e-9)
    force = 20.0 * exact / np.sqrt(cells)  # nodal forces of that pressure, as a vector
    assert 0.3 * force < solution.residual.scale < 30.0 * force


@pytest.mark.parametrize("cells", [4, 32])
@pytest.mark.parametrize("up", [0.01, 0.1])
def test_supports_tear_off_no_glue_that_holds(cells: int, up: float) -> None:
    """Pulled by less than what breaks it: bonded, though a free body would be far away; stiffness 12 along one axis."""
    glue = hv.Adhesive(stiffness=1e4, strength=1.3, softening=50.0)
    pulled = {"top": hv.Fixed(x=0.0, y=up), "left": hv.Roller(), "right": hv.Roller()}
    stated = hv.ContactProblem(hv.rectangle(cells=cells), hencky(1.0), {"bottom": hv.Contact(glue)}, pulled)
    solution = hv.solve(stated).raise_for_status()
    np.testing.assert_allclose(solution.local[:, 0], -12.0 * up / (1e4 + 12.0), rtol=1e-7)


def test_supports_that_move_a_body_as_it_is_leave_no_force() -> None:
    """Nothing but rounding is left that a residual could be held against."""
    for scale in (1.0, 1e9):
        lifted = {"top": hv.Prescribed((0.3, 0.1))}
        stated = hv.ContactProblem(
            hv.rectangle(cells=16), hencky(scale=scale), {"bottom": hv.Contact(hv.Signorini())}, lifted
        )
        solution = hv.solve(stated).raise_for_status()
        np.testing.assert_allclose(solution.displacement, [[0.3, 0.1]] * 289, atol=1e-9)


#: Softens between shear strains of about 0.3 and 0.6, and carries any load again beyond.
BAND = "tr^2 + 4*dev2 - 10*dev2^2 + 7*dev2^3"


def test_a_material_that_has_softened_at_rest_is_measured_by_the_one_above() -> None:
    """Sheared so far the block has a negative tangent; sizes need one that is not."""
    material = Material.potential(BAND, reach=0.2)
    supports = {"top": hv.Fixed(x=1.0, y=0.0), "bottom": hv.Fixed(x=0.0)}
    stated = hv.ContactProblem(
        hv.rectangle(cells=(4, 2)), material, {"bottom": hv.Contact(hv.Compliance(20.0))}, supports
    )
    problem = discretize(stated)
    assert isinstance(problem.bulk, Potential)
    with pytest.raises(Softened, match="is not convex at this displacement"):
        problem.bulk.tangent(np.zeros(problem.unknowns))
    assert problem.bulk.at_rest is problem.bulk.upper


def test_a_start_at_which_the_material_has_softened_is_left() -> None:
    stated = dataclasses.replace(lowered_block(hv.Compliance(20.0), 8), material=Material.potential(BAND, reach=0.2))
    problem = discretize(stated)
    assert isinstance(problem.bulk, Potential)
    far = 0.03 * np.random.default_rng(8).normal(size=problem.unknowns)
    with pytest.raises(Softened):
        problem.bulk.tangent(far)
    found, started = hv.solve(problem).raise_for_status(), hv.solve(problem, initial=far).raise_for_status()
    np.testing.assert_allclose(started.penetration, found.penetration, rtol=1e-7)


# ---- the ring 1 < r < 2, whose outer side is pushed inwards by D -------------------------------------------------


def quarter_ring(cells: int) -> Mesh:
    """A quarter of it; ``bottom`` and ``top`` are the cuts, ``left`` is the inner side and ``right`` the outer one."""
    flat = hv.rectangle((1.0, 0.5 * np.pi), (cells, 2 * cells), origin=(1.0, 0.0))
    r, angle = flat.points.T
    points = np.column_stack([r * np.cos(angle), r * np.sin(angle)])
    points[np.abs(points) < 1e-14] = 0.0
    return Mesh(points, flat.cells, boundaries=dict(flat.boundaries))


def shrunk_ring(material: Material, law: Superpotential, pushed: float, cells: int) -> hv.ContactProblem:
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
        solution = hv.solve(shrunk_ring(hencky(), hv.Compliance(2.0), 0.1, cells)).raise_for_status()
        mean = solution.local[:, 0] @ solution.contact.weights / solution.contact.weights.sum()
        off.append(abs(mean - 0.0949739517132))
    rates = np.log2(np.array(off[:-1]) / off[1:])
    assert rates[-1] == pytest.approx(2.0, abs=0.15), (off, rates)
    assert off[-1] < 3e-4


def test_the_linear_ring() -> None:
    """With q = 1 the table's number is 4/45."""
    solution = hv.solve(shrunk_ring(hencky(1.0), hv.Compliance(2.0), 0.1, 16)).raise_for_status()
    assert solution.local[:, 0].mean() == pytest.approx(4.0 / 45.0, rel=3e-3)


def test_three_solutions_of_a_ring_that_softens() -> None:
    """Started near each of the two that are minima, the method stays there."""
    law = hv.Softening(40.0, 0.02, 25.0)
    problem = discretize(shrunk_ring(hencky(), law, 0.055, 16))
    method = hv.solvers.NonsmoothNewton(search=Search.DOWNHILL)
    low = hv.solve(problem, method).raise_for_status()
    assert low.local[:, 0].mean() == pytest.approx(0.0153219650073, rel=2e-2)
    pressed = discretize(shrunk_ring(hencky(), hv.laws.NoContact(), 0.055, 16))
    start = problem.field.restrict(hv.solve(pressed).displacement)
    far = hv.solve(problem, method, initial=start).raise_for_status()
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
    largest = np.abs(linear.displacement).max()
    np.testing.assert_allclose(other.displacement, linear.displacement, atol=1e-9 * largest)
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
        stated = lowered_block(hv.laws.NoContact(), 4, 1, dim)
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
