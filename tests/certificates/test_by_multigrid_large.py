"""Certificates by multigrid against those by factorisation, on problems where both are quick."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import scipy.sparse.linalg as spla

import hemivar as hv
from hemivar import gallery
from hemivar.certificates import (
    EnergyNorm,
    PointKind,
    by_multigrid,
    certify,
    energy_norm,
    norms,
    smallness,
)
from hemivar.certificates.smallness import trace_constants
from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.laws import (
    Friction,
    NoFriction,
    PenetrationBound,
    PiecewiseQuadratic,
    Superpotential,
    ThresholdCompliance,
    Tresca,
)
from hemivar.mechanics import Contact, Material, Roller
from hemivar.mesh import rectangle
from hemivar.mesh.mesh import Mesh
from hemivar.systems import body_on_levels as systems
from tests import bodies
from tests.certificates.problems import softening, weakening
from tests.samples import sampled, slow

TIGHT = hv.Controls(rtol=1e-10)


def _multigrid(problem: DiscreteProblem) -> by_multigrid.SolveByMultigrid:
    return by_multigrid.SolveByMultigrid(problem, hv.systems.Workspace())


def discrete_body(
    mesh: Mesh, normal: Superpotential, friction: Friction, material: Material | None = None, **supports: object
) -> DiscreteProblem:
    force = (-0.8, -0.4, -0.8) if mesh.dim == 3 else (-0.8, -0.8)
    held: Any = supports or None
    return discretize(bodies.body(mesh, Contact(normal, friction), material=material, supports=held, body_force=force))


def weakening_square(alpha: float, rate: float = 10.0, n: int = 32) -> DiscreteProblem:
    return discrete_body(
        rectangle((1.0, 1.0), (n, n)), softening(3.0, 0.02, alpha), Friction(0.05, weakening(0.4, rate))
    )


def weakening_cube(alpha: float, rate: float = 10.0, n: int = 8) -> DiscreteProblem:
    mesh = hv.box((1.0, 1.0, 1.0), (n, n, n))
    return discrete_body(mesh, softening(3.0, 0.02, alpha), Friction(0.05, weakening(0.4, rate)))


def from_a_file(alpha: float, n: int = 24) -> DiscreteProblem:
    """An irregular mesh without a coarser one."""
    mesh = rectangle((1.0, 1.0), (n, n), "cross")
    points = mesh.points.copy()
    inside = np.all((points > 0) & (points < 1), axis=1)
    points[inside] += 0.15 / n * np.random.default_rng(3).uniform(-1, 1, (int(inside.sum()), 2))
    mesh = Mesh(points, mesh.cells, dict(mesh.boundaries))
    return discrete_body(mesh, softening(3.0, 0.02, alpha), Friction(0.05, weakening(0.4, 10.0)))


def cube_from_a_file(alpha: float) -> DiscreteProblem:
    mesh = hv.box((1.0, 1.0, 1.0), (9, 9, 9))
    mesh = Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))
    return discrete_body(mesh, softening(3.0, 0.02, alpha), Friction(0.05, weakening(0.4, 10.0)))


INSIDE: dict[str, Callable[[], DiscreteProblem]] = {
    "convex square": lambda: discretize(gallery.survey("5.1", 32, "right")),
    "convex cube": lambda: discretize(gallery.survey_cube("5.1", 8)),
    "square": lambda: weakening_square(1.5),
    "square near its margin": lambda: weakening_square(2.9),
    "weakening square": lambda: discretize(gallery.survey_logarithmic(0.3, 32, "right")),
    "cube": lambda: weakening_cube(1.0),
    "weakening cube": lambda: discretize(gallery.survey_cube_logarithmic(0.3, 8)),
    "mesh from a file": lambda: from_a_file(1.5),
    "mesh of tetrahedra from a file": lambda: cube_from_a_file(1.0),
    "two materials": lambda: discrete_body(
        rectangle((1.0, 1.0), (32, 32)),
        softening(3.0, 0.02, 0.03),
        Tresca(0.05),
        Material.lame(4.0, lambda x: np.where(x[:, 0] < 0.5, 0.04, 40.0)),
    ),
    "nearly incompressible": lambda: discrete_body(
        rectangle((1.0, 1.0), (32, 32)), softening(3.0, 0.02, 1.0), Tresca(0.05), Material.lame(400.0, 4.0)
    ),
    "bound that depends on the penetration": lambda: discrete_body(
        rectangle((1.0, 1.0), (32, 32)), softening(3.0, 0.02, 0.5), Friction(PenetrationBound("0.05 + 0.5*max(s, 0)"))
    ),
}


@pytest.mark.parametrize("name", sampled(INSIDE, 4))
def test_both_ways_agree(name: str) -> None:
    """A converged solution, and a rough one."""
    problem = INSIDE[name]()
    by_factor, by_multigrid = EnergyNorm(problem.stiffness), EnergyNorm.by_multigrid(problem)
    solution = hv.solve(problem, controls=TIGHT)
    rough = solution.unknowns + 1e-4 * np.abs(solution.unknowns).max() * by_factor.solve(problem.load)
    for u in (solution.unknowns, rough):
        exact = certify(problem, u, solution.multiplier, factor=by_factor, trace_constant=False)
        quick = certify(problem, u, solution.multiplier, factor=by_multigrid, trace_constant=False)
        assert exact.margin > 0.0
        assert exact.margin - 1e-3 <= quick.margin <= exact.margin + 1e-12
        assert quick.smallness.coupling == pytest.approx(exact.smallness.coupling, rel=2e-3)
        assert (quick.kind, quick.unique, quick.stationary) == (exact.kind, exact.unique, exact.stationary)
        assert exact.equilibrium * (1.0 - 1e-6) <= quick.equilibrium <= 1.02 * exact.equilibrium
        assert 0.98 * exact.equilibrium_relative <= quick.equilibrium_relative <= 1.5 * exact.equilibrium_relative
        if u is solution.unknowns:
            assert quick.error_bound <= 2.0 * exact.error_bound
        assert quick.method == "multigrid"
        assert exact.method == "factorisation"


@pytest.mark.parametrize(
    "name", ["square near its margin", *map(slow, ("weakening cube", "mesh from a file", "two materials"))]
)
def test_the_bound_holds(name: str) -> None:
    problem = INSIDE[name]()
    exact = hv.solve(problem, hv.solvers.NonsmoothNewton(), hv.Controls(rtol=1e-13))
    energy, norm = EnergyNorm.by_multigrid(problem), EnergyNorm(problem.stiffness)
    rng = np.random.default_rng(4)
    for size in (1e-8, 1e-4, 1e-1):
        for noise in (
            rng.standard_normal(problem.unknowns),
            norm.solve(rng.standard_normal(problem.unknowns)),
            norm.solve(problem.contact_force(rng.standard_normal(exact.multiplier.shape))),
        ):
            u = exact.unknowns + size * np.abs(exact.unknowns).max() * noise / np.abs(noise).max()
            for multiplier in (exact.multiplier, None):
                found = certify(problem, u, multiplier, factor=energy, trace_constant=False)
                error = norm.norm(u - exact.unknowns)
                assert error <= found.error_bound <= 10.0 / found.margin * error


@pytest.mark.parametrize(
    "name", ["square", *map(slow, ("cube", "mesh from a file", "two materials", "nearly incompressible"))]
)
def test_norms(name: str) -> None:
    """Dual norms are bounded from above, and hardly more; the smallest eigenvalue from below."""
    problem = INSIDE[name]()
    exact, quick = EnergyNorm(problem.stiffness), EnergyNorm.by_multigrid(problem)
    rng = np.random.default_rng(6)
    noise = rng.standard_normal(problem.unknowns)
    contact = problem.contact_force(rng.standard_normal((problem.contact_points, problem.contact.components)))
    for b in (noise, problem.load, contact, problem.stiffness @ noise):
        x, bound = quick.riesz(b)
        size = exact.riesz(b)[1]
        assert size * (1.0 - 1e-12) <= bound <= 1.02 * size
        near = b + 1e-3 * size * noise / exact.riesz(noise)[1]
        y, again = quick.riesz(near, x)
        assert exact.norm(x - exact.solve(b)) <= 0.15 * size  # a fiftieth of the square is left
        assert exact.norm(y - exact.solve(near)) <= 0.15 * size
        assert exact.riesz(near)[1] * (1.0 - 1e-12) <= again <= 1.02 * exact.riesz(near)[1]
    still, nothing = quick.riesz(np.zeros(problem.unknowns))
    assert (nothing, np.count_nonzero(still)) == (0.0, 0)
    assert 0.6 * size < quick.least_dual_norm(problem.load) / exact.riesz(problem.load)[1] * size <= size
    root = np.sqrt(problem.stiffness.diagonal())
    scaled = problem.stiffness.toarray() / np.outer(root, root)
    lowest = float(np.linalg.eigvalsh(scaled)[0])
    assert 0.2 * lowest < quick.lowest <= lowest


def test_curvature_of_a_linear_softening_foundation() -> None:
    """All points on one falling piece: the curvature is 1 - c, by a dense eigenproblem; a saddle once c > 1."""
    for alpha in (3.0, 30.0):
        falling = PiecewiseQuadratic([0.0], [-alpha, -alpha], [0.0])  # type: ignore[arg-type]
        problem = discrete_body(rectangle((1.0, 1.0), (24, 24)), falling, NoFriction())
        weight = np.zeros((problem.contact_points, 2))
        weight[:, 0] = alpha * problem.contact.weights
        soft = problem.contact.trace.T @ (weight.ravel()[:, None] * problem.contact.trace.toarray())
        top = float(spla.eigsh(soft, k=1, M=problem.stiffness, which="LA", return_eigenvectors=False)[0])
        u = np.linalg.solve(problem.stiffness.toarray() - soft, problem.load)
        found = certify(problem, u, factor=EnergyNorm.by_multigrid(problem), trace_constant=False)
        assert found.stationary
        assert 1.0 - top - 1e-3 * top <= found.margin <= 1.0 - top
        if top < 1.0:
            assert found.kind is PointKind.UNIQUE_MINIMISER
            continue
        assert found.kind is PointKind.SADDLE
        assert found.curvature == pytest.approx(1.0 - top, rel=2e-3)
        assert found.direction is not None
        lifted = problem.contact.trace.T @ found.direction.ravel()
        move = EnergyNorm(problem.stiffness).solve(problem.contact_force(found.direction))
        assert np.abs(lifted).max() == pytest.approx(1.0)
        change = problem.energy(u + 1e-4 * move) - problem.energy(u)
        assert change < 0.0


@pytest.mark.parametrize("value", [0.5, 0.999, 1.001, 2.0])
def test_an_eigenvalue_is_told_from_one_or_not_given(value: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scaled to a value by a dense eigenproblem: after steps enough on its side, without steps not on the wrong one."""
    problem = weakening_square(1.5, n=16)
    rows = problem.contact.trace
    free = np.zeros((problem.contact_points, 2), dtype=bool)
    ones = np.ones(rows.shape[0])
    dense = (rows.T @ rows).toarray()
    top = float(spla.eigsh(dense, k=1, M=problem.stiffness, which="LA", return_eigenvectors=False)[0])
    found = _multigrid(problem).constrained(rows, value / top * ones, free)
    assert found is not None
    assert value * (1.0 - 1e-3) <= found.value <= value * (1.0 + 1e-9) <= found.bound * (1.0 + 2e-9)
    assert (found.value > 1.0, found.bound > 1.0) == (value > 1.0, value > 1.0)
    monkeypatch.setattr(by_multigrid, "_EFFORT", by_multigrid._Effort(steps=0))
    rough = _multigrid(problem).constrained(rows, value / top * ones, free)
    assert rough is None or (rough.value > 1.0, rough.bound > 1.0) == (value > 1.0, value > 1.0)
    if value == 0.999:
        assert rough is None


@pytest.mark.parametrize(
    "make", [lambda: weakening_square(40.0), lambda: weakening_square(1.5, 400.0), lambda: weakening_cube(20.0)]
)
def test_outside_the_margin(make: Callable[[], DiscreteProblem]) -> None:
    """Some points stick, some slip: the curvature on what is left."""
    problem = make()
    solution = hv.solve(problem, controls=TIGHT)
    exact, quick = (
        certify(problem, solution.unknowns, solution.multiplier, factor=factor, trace_constant=False)
        for factor in (EnergyNorm(problem.stiffness), EnergyNorm.by_multigrid(problem))
    )
    assert exact.margin < 0.0
    assert quick.margin == pytest.approx(exact.margin, rel=2e-3)
    assert quick.margin <= exact.margin
    assert (quick.kind, quick.unique) == (exact.kind, exact.unique)
    assert exact.curvature is not None
    assert 0.0 < exact.curvature < 1.0
    assert exact.curvature - 2e-3 <= quick.curvature <= exact.curvature + 1e-9
    assert quick.error_bound == np.inf


@pytest.mark.parametrize("nested", [True, False])
@pytest.mark.parametrize("dim", [2, 3])
def test_body_that_only_contact_holds(nested: bool, dim: int) -> None:
    mesh = hv.box((1.0, 1.0, 1.0), (8, 8, 8)) if dim == 3 else rectangle((1.0, 1.0), (32, 32))
    if not nested:
        mesh = Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))
    problem = discrete_body(mesh, ThresholdCompliance(0.3, 20.0), Tresca(2.0), left=Roller())
    norm = EnergyNorm.by_multigrid(problem)
    assert not norm.definite
    solution = hv.solve(problem, controls=TIGHT)
    found = certify(problem, solution.unknowns, solution.multiplier, factor=norm, trace_constant=False)
    assert found.margin == -np.inf
    assert found.stationary
    assert found.kind is PointKind.UNIQUE_MINIMISER  # contact holds it at its solution
    assert found.error_bound == np.inf
    assert EnergyNorm.by_multigrid(discrete_body(mesh, ThresholdCompliance(0.3, 20.0), Tresca(2.0))).definite


def test_arrays() -> None:
    """Without a mesh the levels know nothing of rigid motions."""
    made = weakening_square(1.5)
    parts = (made.load, made.contact.trace, made.contact.weights, made.gap, made.law)
    problem = DiscreteProblem.of_arrays(made.stiffness, *parts)  # type: ignore[arg-type]
    exact, quick = (
        smallness(problem, factor=EnergyNorm(made.stiffness)),
        smallness(problem, factor=EnergyNorm.by_multigrid(problem)),
    )
    assert exact.margin - 1e-3 <= quick.margin <= exact.margin
    root = np.sqrt(made.stiffness.diagonal())
    lowest = np.linalg.eigvalsh(made.stiffness.toarray() / np.outer(root, root))[0]
    assert EnergyNorm.by_multigrid(problem).lowest <= lowest
    held = discrete_body(rectangle((1.0, 1.0), (32, 32)), ThresholdCompliance(0.3, 20.0), Tresca(2.0), left=Roller())
    floating = DiscreteProblem.of_arrays(
        held.stiffness, held.load, held.contact.trace, held.contact.weights, held.gap, held.law
    )
    assert not EnergyNorm.by_multigrid(floating).definite


def test_units_do_not_matter() -> None:
    found = []
    for length, force in ((1.0, 1.0), (1e3, 1e6)):
        pressure = force / length**2
        problem = discretize(
            bodies.square(
                Contact(
                    softening(3.0 * pressure / length, 0.02 * length, 1.5 * pressure / length),
                    Tresca(0.05 * pressure),
                ),
                32,
                side=length,
                lame=(4.0 * pressure, 4.0 * pressure),
                body_force=(-0.8 * force / length**3, -0.8 * force / length**3),
            )
        )
        u = hv.solve(problem, controls=TIGHT).unknowns
        u = u + 1e-3 * np.abs(u).max() * np.random.default_rng(8).standard_normal(u.size)
        found.append(certify(problem, u, factor=EnergyNorm.by_multigrid(problem), trace_constant=False))
    first, second = found
    assert second.margin == pytest.approx(first.margin, rel=1e-6)
    assert second.error_bound_relative == pytest.approx(first.error_bound_relative, rel=1e-5)
    assert second.equilibrium_relative == pytest.approx(first.equilibrium_relative, rel=1e-5)


@pytest.mark.parametrize("nu", [0.3, 0.5 - 1e-8])
def test_dual_norm_of_a_load_where_cycles_in_single_precision_see_the_body_and_where_not(nu: float) -> None:
    mesh, friction = rectangle((1.0, 1.0), (32, 32)), Friction(0.05, weakening(0.4, 10.0))
    problem = discrete_body(mesh, softening(3.0, 0.02, 0.1), friction, Material.young(1.0, nu))
    exact = EnergyNorm(problem.stiffness).riesz(problem.load)[1]
    assert 0.99 * exact <= EnergyNorm.by_multigrid(problem).riesz(problem.load)[1] <= 1.03 * exact


@pytest.mark.parametrize("excess", [1e-1, 1e-2, 1e-3, 1e-4])
def test_dual_norm_of_a_rough_force_on_a_body_that_hardly_changes_its_volume(excess: float) -> None:
    """Few motions are hardly changed by a cycle: what is left in them must not be taken for what others would leave."""
    mesh, friction = rectangle((1.0, 1.0), (64, 64)), Friction(0.05, weakening(0.4, 10.0))
    problem = discrete_body(mesh, softening(3.0, 0.02, 0.1), friction, Material.young(1.0, 0.5 - excess))
    exact, by_multigrid = EnergyNorm(problem.stiffness), EnergyNorm.by_multigrid(problem)
    for seed in range(3):
        force = np.random.default_rng(seed).standard_normal(problem.unknowns)
        assert (1.0 - 1e-6) <= by_multigrid.riesz(force)[1] / exact.riesz(force)[1] <= 1.1


@pytest.mark.parametrize("make", [lambda: weakening_square(1.5), lambda: from_a_file(1.5), lambda: weakening_cube(1.0)])
def test_the_quality_of_a_cycle_is_estimated_from_below(make: Callable[[], DiscreteProblem]) -> None:
    """The largest factor by which cycles reduce an error, after many of them on the finest level."""
    problem = make()
    norm, K = EnergyNorm.by_multigrid(problem), problem.stiffness
    levels = systems.levels_of(problem, hv.systems.Workspace()).levels
    x, factor = np.random.default_rng(0).standard_normal(problem.unknowns), 0.0
    for _ in range(40):
        x = x - levels.cycle(len(levels.sizes) - 1, K @ x)
        factor = norm.norm(x)
        x = x / factor
    assert 0.4 * (1.0 - factor) <= _multigrid(problem).quality <= 1.0 - factor


def norms_of(problem: DiscreteProblem, force: float = 1.0) -> list[float]:
    """What a norm answers, in units of force."""
    norm, rng = EnergyNorm.by_multigrid(problem), np.random.default_rng(9)
    u, b = rng.standard_normal((2, problem.unknowns))
    trace, weight = problem.contact.trace, np.repeat(problem.contact.weights, problem.contact.components)
    assert norm.definite
    return [
        norm.lowest,
        _multigrid(problem).quality,
        norm.norm(u) / np.sqrt(force),
        norm.riesz(force * b)[1] / np.sqrt(force),
        norm.least_dual_norm(force * b) / np.sqrt(force),
        norm.rounding_norm(1.0),
        norm.largest_eigenvalue(trace, force * weight).bound,
        norm.largest_eigenvalue(trace, force * weight).value,
    ]


@pytest.mark.parametrize("force", [1e-14, 1e14])
def test_norms_in_another_unit_of_force(force: float) -> None:
    plain = norms_of(from_a_file(1.5))
    mesh = from_a_file(1.5).field.mesh  # type: ignore[union-attr]
    law, friction = softening(3.0 * force, 0.02, 1.5 * force), Tresca(0.05 * force)
    scaled = norms_of(discrete_body(mesh, law, friction, Material.lame(4.0 * force, 4.0 * force)), force)
    np.testing.assert_allclose(scaled, plain, rtol=1e-6)


@pytest.mark.parametrize("make", [lambda: weakening_square(1.5), lambda: from_a_file(1.5)])
def test_the_coarsest_level_by_a_dense_matrix_or_by_lanczos_steps(
    make: Callable[[], DiscreteProblem], monkeypatch: pytest.MonkeyPatch
) -> None:
    problem = make()
    dense = norms_of(problem)
    monkeypatch.setattr(by_multigrid, "DENSE", 3)
    np.testing.assert_allclose(norms_of(problem), dense, rtol=3e-3)
    exact = EnergyNorm(problem.stiffness)
    weight = np.repeat(problem.contact.weights, problem.contact.components)
    top = exact.largest_eigenvalue(problem.contact.trace, weight).value
    found = EnergyNorm.by_multigrid(problem).largest_eigenvalue(problem.contact.trace, weight)
    assert found.value <= top * (1.0 + 1e-9)
    assert top * (1.0 - 1e-9) <= found.bound <= 1.002 * top


def test_large_problems_are_left_to_multigrid(monkeypatch: pytest.MonkeyPatch) -> None:
    """Above a size: the method, the constants that are left out, and the trace constant."""
    problem = weakening_square(1.5)
    assert energy_norm(problem).factorised
    exact, constants = certify(problem, np.zeros(problem.unknowns)).smallness, trace_constants(problem)
    monkeypatch.setattr(norms, "FACTORISED", (1000, 1000))
    assert not energy_norm(problem).factorised
    certificate = certify(problem, np.zeros(problem.unknowns))
    quick = certificate.smallness
    assert quick.constant_normal is None
    assert quick.constant_tangential is None
    assert certificate.record()["constant_normal"] is None
    assert quick.survey_condition == exact.survey_condition
    assert exact.trace_constant is not None
    assert exact.trace_constant <= quick.trace_constant <= 1.001 * exact.trace_constant
    estimated = trace_constants(problem)
    for name in ("both", "normal", "tangential"):
        value = getattr(constants, name)
        assert value <= getattr(estimated, name) <= 1.001 * value


def test_after_a_solve_by_multigrid() -> None:
    """The solver leaves contact unknowns held and stiff; the certificate does not depend on what was solved before."""
    problem = discretize(gallery.survey_cube("5.1", 16))
    fresh = discretize(gallery.survey_cube("5.1", 16))
    solution = hv.solve(problem, hv.solvers.NonsmoothMultigrid(tolerance=5e-11), TIGHT)
    after = certify(problem, solution.unknowns, solution.multiplier, factor=EnergyNorm.by_multigrid(problem))
    before = certify(fresh, solution.unknowns, solution.multiplier, factor=EnergyNorm.by_multigrid(fresh))
    assert after.equilibrium == pytest.approx(before.equilibrium, rel=1e-9, abs=0.0)
    assert after.error_bound == pytest.approx(before.error_bound, rel=1e-9, abs=0.0)
    assert after.margin == before.margin
