"""The bound of the distance to the exact solution: never below the error, and not far above it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.patches import PatchKind
from hemivar.bounds.trace_bounds import TraceBounds, discrete_trace_bounds, guaranteed_trace_bounds
from hemivar.errors import ProblemError
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.discretize import discretize
from hemivar.gallery import manufactured_softening, survey, survey_cube
from hemivar.gallery.known import KnownProblem, weighted_block
from hemivar.laws import (
    Capped,
    CoulombBound,
    Friction,
    Logarithmic,
    Signorini,
    Softening,
    Superpotential,
    ThresholdCompliance,
    Tresca,
)
from hemivar.laws.friction import ABSOLUTE_VALUE
from hemivar.mechanics import Clamped, Contact, ContactProblem, Fixed, Material, Prescribed, Sphere
from hemivar.mesh import rectangle
from hemivar.solvers import solve
from tests import bodies

F, E, V = PatchKind.FACET, PatchKind.EDGE, PatchKind.VERTEX


def finer(problem: ContactProblem, u: Array, times: int, order: int) -> tuple[ContactProblem, Array]:
    """The problem on a refined mesh, and nodal values (nodes, d) there of linear elements."""
    mesh = problem.mesh
    for _ in range(times + (order == 2)):
        u = np.vstack([u, 0.5 * (u[mesh.edges[:, 0]] + u[mesh.edges[:, 1]])])
        mesh = mesh.refined()
    return replace(problem, mesh=problem.mesh.refined(times), order=order), u


def energy_of(problem: ContactProblem, v: Array) -> float:
    stiffness = stiffness_matrix(problem.mesh, problem.material, problem.order)
    return float(np.sqrt(v.ravel() @ (stiffness @ v.ravel())))


def error_of(problem: ContactProblem, u: Array, times: int = 2) -> float:
    """Distance to the solution with quadratic elements on a refined mesh (nested)."""
    fine, prolonged = finer(problem, u, times, 2)
    return energy_of(fine, solve(fine).displacement - prolonged)


def error_of_known(known: KnownProblem, u: Array, times: int) -> float:
    fine, prolonged = finer(known.problem, u, times, 2)
    return energy_of(fine, known.displacement(fine.mesh.nodes(2)) - prolonged)


def judged(problem: ContactProblem, *sweeps: PatchKind) -> tuple[ExactDistance, Array]:
    solution = solve(problem)
    constants = discrete_trace_bounds(solution.problem)
    return exact_distance(problem, solution.displacement, constants, sweeps=sweeps or None), solution.displacement


@pytest.mark.parametrize("data", ["figure1", "figure2", "figure3", "figure4", "5.1"])
def test_effectivity_on_the_survey(data: str) -> None:
    """bound/error after step 2 alone, two sweeps over facets, one and two over vertices: figures of a prototype."""
    problem = survey(data, 6)
    solution = solve(problem)
    error = error_of(problem, solution.displacement)
    constants = discrete_trace_bounds(solution.problem)
    for sweeps, low, high in (((), 2.6, 3.6), ((F, F), 1.2, 1.7), ((V,), 1.1, 1.4), ((V, V), 1.0, 1.3)):
        found = exact_distance(problem, solution.displacement, constants, sweeps=sweeps)
        assert low < found.distance / error < high, sweeps
        assert found.constant == 0.0  # monotone laws
        assert found.relative == pytest.approx(found.distance / energy_of(problem, solution.displacement))


@pytest.mark.parametrize("n", [2, 4, 8])
def test_block_under_its_weight(n: int) -> None:
    known = weighted_block(n=n)
    found, u = judged(known.problem)
    error = error_of_known(known, u, 0)  # the solution is quadratic
    assert error <= found.distance < 1.4 * error
    assert found.parts.oscillation == 0.0
    assert found.parts.algebraic < 1e-10 * error
    assert found.cells.sum() == pytest.approx(found.parts.misfit**2)


def test_a_displacement_reproduced_exactly_is_told_so() -> None:
    known = weighted_block(n=4, top_displacement=0.2)
    found, u = judged(known.problem)
    assert error_of_known(known, u, 0) < 1e-12
    assert found.distance < 1e-7 * found.energy_norm


@pytest.mark.parametrize("pattern", ["right", "cross"])
def test_manufactured_softening(pattern: str) -> None:
    """Laws that soften, loads that vary: c is below 0.6, and the parts add up."""
    known = manufactured_softening(6, pattern=pattern)  # type: ignore[arg-type]
    found, u = judged(known.problem)
    error = error_of_known(known, u, 2)
    assert error < found.distance < 4.0 * error
    assert 0.1 < found.constant < 0.65
    parts = found.parts
    assert parts.oscillation > 0.0
    whole = parts.misfit + parts.oscillation + parts.algebraic + parts.contact
    expected = whole + np.sqrt(whole**2 + 4.0 * (1.0 - found.constant) * parts.gap)
    assert found.distance == pytest.approx(expected / (2.0 * (1.0 - found.constant)))


def random_square(seed: int) -> ContactProblem:
    rng = np.random.default_rng(seed)
    mesh = rectangle((1.0 + rng.uniform(), 1.0), 4, pattern=("cross", "left", "right")[seed % 3])
    if seed % 2:
        material = Material.lame(*rng.uniform(2.0, 8.0, 2))
    else:
        root = rng.normal(size=(3, 3))
        material = Material.tensor(6.0 * np.eye(3) + root @ root.T)
    laws: list[Superpotential] = [ThresholdCompliance(0.3, 2.0), Softening(4.0, 0.05, 0.5), Signorini()]
    frictions: list[Friction] = [Tresca(0.2), Logarithmic(0.3)]
    return ContactProblem(
        mesh=mesh,
        material=material,
        contact={"bottom": Contact(laws[seed % 3], frictions[(seed // 3) % 2], gap=0.02 * (seed % 4))},
        supports={"left": Clamped()} if seed % 5 else {"left": Fixed(x=0.0), "top": Fixed(y=-0.05)},
        tractions={"right": tuple(rng.uniform(-0.3, 0.3, 2))},
        body_force=tuple(rng.uniform(-1.0, 0.2, 2)),
    )


@pytest.mark.parametrize("seed", range(12))
def test_bound_is_not_below_the_error_of_random_problems(seed: int) -> None:
    problem = random_square(seed)
    found, u = judged(problem)
    error = error_of(problem, u, 2)
    assert error <= found.distance
    assert found.distance * (1.0 - found.constant) < 2.0 * error


def test_friction_pays_a_gap_on_a_foundation_that_breaks() -> None:
    """Its law jumps down, so that the normal part keeps to it; the friction sticks at one end of a facet and slips."""
    contact = Contact(Capped(1.0, 0.3, 0.05), Tresca(0.06))
    problem = bodies.strip(
        contact, (2, 6), "cross", size=(1.0, 3.0), supports={"top": Clamped()}, body_force=(0.05, -0.1)
    )
    found, u = judged(problem)
    error = error_of(problem, u)
    assert found.theorem == 1
    assert found.parts.gap > 0.0
    assert 0.0 < found.constant < 0.05
    assert error < found.distance < 1.28 * error  # 1.31 where all of a facet does the same


def test_bound_of_a_displacement_that_is_no_solution() -> None:
    """What the nodes lack for equilibrium is added, as the algebraic part and as a worse misfit: a bound stays one."""
    problem = survey("5.1", 4)
    solution = solve(problem)
    constants = guaranteed_trace_bounds(solution.problem)
    best = exact_distance(problem, solution.displacement, constants)
    direction = np.random.default_rng(0).normal(size=solution.displacement.shape)
    direction[problem.mesh.points[:, 0] == 0.0] = 0.0
    for size in (1e-9, 1e-6, 1e-3, 0.02):  # a solve by multigrid leaves the second of these
        u = solution.displacement + size * direction
        found = exact_distance(problem, u, constants)
        assert found.guaranteed, found.reasons
        assert error_of(problem, u) <= found.distance
        assert found.parts.algebraic > 0.01 * size
        assert found.distance < 1.2 * best.distance or size > 1e-6


def test_bound_in_space() -> None:
    problem = survey_cube("5.1", 2)
    found, u = judged(problem)
    fine = replace(problem, mesh=problem.mesh.refined(2))
    for mesh in (problem.mesh, problem.mesh.refined()):
        u = np.vstack([u, 0.5 * (u[mesh.edges[:, 0]] + u[mesh.edges[:, 1]])])
    error = energy_of(fine, solve(fine).displacement - u)
    assert error < found.distance < 2.2 * error


def test_units_and_rotation_change_nothing() -> None:
    problem = survey("5.1", 4)
    found, _ = judged(problem)
    turned = replace(problem, mesh=problem.mesh.rotated(0.7))
    c, s = np.cos(0.7), np.sin(0.7)
    turned = replace(turned, body_force=tuple(np.array([[c, -s], [s, c]]) @ np.array([-0.8, -0.8])))
    assert judged(turned)[0].distance == pytest.approx(found.distance, rel=1e-9)
    length, force = 1e3, 1e6
    other = replace(
        problem,
        mesh=problem.mesh.scaled(length),
        material=Material.lame(4.0 * force, 4.0 * force),
        body_force=(-0.8 * force / length, -0.8 * force / length),
        contact={"bottom": Contact(ThresholdCompliance(0.3 * force, 2.0 * force / length), Tresca(0.5 * force))},
    )
    assert judged(other)[0].distance == pytest.approx(found.distance * np.sqrt(force) * length, rel=1e-7)


@pytest.mark.parametrize("turn", [0.0, 0.7])
@pytest.mark.parametrize("touching", [True, False])
def test_a_displacement_that_misses_a_support_is_moved_there_and_the_move_counts(turn: float, touching: bool) -> None:
    """A body that is shifted, and should be stretched by a little as well.

    The stress of an even stretch, with what it works along the supports, shows how much energy the solution has at
    least: that of plane strain without tractions at the sides.
    """
    miss, modulus, ratio = 9e-9, 10.0, 0.3
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    square = rectangle((1.0, 1.0), (2, 2))
    mesh = hv.Mesh(square.points @ axes.T, square.cells, dict(square.boundaries))
    supports = {"left": Prescribed(tuple(axes[:, 0])), "right": Prescribed(tuple(axes[:, 0] * (1.0 + miss)))}
    contact = {"bottom": Contact(hv.Compliance(1.0), gap=2.0)} if touching else {}
    problem = ContactProblem(mesh, Material.young(modulus, ratio), contact, supports)
    known = replace(problem, contact={"bottom": Contact(hv.Compliance(1.0), gap=2.0)})
    shift = np.tile(axes[:, 0], (9, 1))
    found = exact_distance(problem, shift, guaranteed_trace_bounds(discretize(known)))
    assert found.guaranteed, found.reasons
    least = miss * np.sqrt(modulus / (1.0 - ratio**2))
    assert least <= found.distance <= 4.0 * least
    assert found.parts.correction >= least
    farther = {"right": Prescribed(tuple(axes[:, 0] * (1.0 + 1e2 * miss)))}
    with pytest.raises(ProblemError, match="differs from the prescribed one by"):
        exact_distance(replace(problem, supports=farther), shift, guaranteed_trace_bounds(discretize(known)))


def test_estimates_and_missing_bounds_say_so() -> None:
    problem = survey("5.1", 3)
    mild = replace(problem, contact={"bottom": Contact(Softening(4.0, 0.5, 0.1))})
    found, _ = judged(mild)
    assert not found.guaranteed
    assert "no bounds of the continuous one" in found.reasons[0]
    u = solve(problem).displacement
    proved = TraceBounds(2.5, 2.5, 2.5, 2.0, True, "for this test")
    assert exact_distance(problem, u, proved).guaranteed

    none = TraceBounds(0.0, 0.0, 0.0, 0.0, True, "nothing holds the body")
    missing = exact_distance(mild, u, none)
    assert missing.distance == np.inf
    assert not missing.guaranteed
    assert any("there is no bound" in reason for reason in missing.reasons)

    soft = replace(problem, contact={"bottom": Contact(Softening(4.0, 0.05, 50.0))})
    pressed = u - 0.1 * problem.mesh.points[:, :1] * [0.0, 1.0]
    assert exact_distance(soft, pressed, proved).distance == np.inf
    coulomb = replace(
        problem, contact={"bottom": Contact(ThresholdCompliance(0.3, 2.0), Friction(CoulombBound(0.3), ABSOLUTE_VALUE))}
    )
    refused = exact_distance(coulomb, u, proved)
    assert refused.distance == np.inf
    assert any("depends on the pressure" in reason for reason in refused.reasons)
    with pytest.raises(ProblemError, match="the trace bound 'both' is -1"):
        TraceBounds(-1.0, 1.0, 1.0, 1.0, True, "")


@pytest.mark.parametrize("data", ["5.1", "figure4"])
def test_a_guaranteed_bound(data: str) -> None:
    """With constants from below it is a bound, and hardly larger: those of the body weigh the contact part alone."""
    problem = survey(data, 8)
    solution = solve(problem)
    constants = guaranteed_trace_bounds(solution.problem)
    found = exact_distance(problem, solution.displacement, constants)
    assert found.guaranteed, found.reasons
    discrete = discrete_trace_bounds(solution.problem)
    assert constants.both < discrete.both
    assert constants.both == pytest.approx(2.928, rel=0.02)
    estimate = exact_distance(problem, solution.displacement, discrete)
    error = error_of(problem, solution.displacement)
    assert error < found.distance
    assert found.distance == pytest.approx(estimate.distance, rel=0.02)


def test_trace_bounds_of_the_square() -> None:
    """Of the survey's square, 2.928 in the limit; those of single components are larger, and weights scale."""
    found = discrete_trace_bounds(discretize(survey("5.1", 32)))
    assert found.both == pytest.approx(2.928, rel=0.01)
    assert found.normal > found.both
    assert found.tangential > found.both
    mesh = survey("5.1", 32).mesh
    facets = mesh.points[mesh.boundaries["bottom"]]
    ones = np.ones(len(facets))
    assert found.softening(facets, 0.5 * ones, 0.5 * ones) == pytest.approx(0.5 / found.both, rel=1e-6)
    part = np.where(np.arange(len(facets)) < 16, 0.5, 0.0)
    assert found.softening(facets, part, part) < 0.5 / found.both


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (
            {"supports": {"left": Prescribed(lambda x: 0.01 * x[:, 1:] ** 2 * [1.0, 0.0])}},
            "which the mesh interpolates",
        ),
        ({"supports": {"left": Fixed(x=lambda x: 0.01 * x[:, 1] ** 2, y=0.0)}}, "which the mesh interpolates"),
        ({"material": Material.lame(lambda x: 4.0 + x[:, 0], 4.0)}, "the material varies within cells"),
        # a crack that no point of a rule lies in
        (
            {"material": Material.young(lambda x: np.where(np.abs(x[:, 0] - 0.3) < 1e-4, 0.01, 9.0), 0.0)},
            "the material is a function of the place",
        ),
        (
            {"contact": {"bottom": Contact(ThresholdCompliance(0.3, 2.0), gap=lambda x: 0.01 * x[:, 0] ** 2)}},
            "gap of contact",
        ),
        (
            {"contact": {"bottom": Contact(ThresholdCompliance(0.3, 2.0), obstacle=Sphere((0.5, -9.0), 9.0))}},
            "gap of contact",
        ),
    ],
)
def test_what_the_mesh_does_not_represent_makes_it_an_estimate(changes: dict[str, object], reason: str) -> None:
    """Whatever is proved of the constants."""
    problem = survey("5.1", 4)
    proved = guaranteed_trace_bounds(discretize(problem))
    changed = replace(problem, **changes)  # type: ignore[arg-type]
    found = exact_distance(changed, solve(changed).displacement, proved)
    assert not found.guaranteed
    assert any(reason in why for why in found.reasons), found.reasons
