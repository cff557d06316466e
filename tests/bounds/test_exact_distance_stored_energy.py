"""The distance to the exact solution of bodies with a stored energy: never below the error, and not far above it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.bounds import solve_adaptive
from hemivar.bounds.exact_distance import ExactDistance, exact_distance
from hemivar.bounds.trace_bounds import body_constants
from hemivar.certificates.linear_bodies import largest_strain
from hemivar.errors import ProblemError
from hemivar.fem import discretize
from hemivar.fem.assembly import stiffness_matrix
from hemivar.fem.elements import barycentric_gradients
from hemivar.fem.quadrature import quadrature_rule
from hemivar.gallery import survey
from hemivar.laws import (
    Compliance,
    Friction,
    Logarithmic,
    Signorini,
    Softening,
    Superpotential,
    ThresholdCompliance,
    Tresca,
)
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Prescribed, Roller
from hemivar.mechanics.composed_material import lower_elasticity
from hemivar.mechanics.material_words import BoundsBy
from hemivar.mechanics.named_energies import Hencky
from hemivar.mesh import box, rectangle
from hemivar.report.tables import Table
from hemivar.solvers import Status, solve
from hemivar.systems import Workspace
from tests.samples import slow

BULK, SHEAR, SOFTENED, STRAIN = 20.0 / 3.0, 4.0, 0.25, 0.05
HENCKY = Material.hencky(BULK, SHEAR, SOFTENED, STRAIN)
LINEAR = Material.lame(BULK - 2.0 * SHEAR / 3.0, SHEAR)


def bound_of_converged(problem: ContactProblem) -> tuple[ExactDistance, Array]:
    solution = solve(problem)
    assert solution.status is Status.CONVERGED
    constants = body_constants(solution.problem, Workspace())
    return exact_distance(problem, solution.displacement, constants), solution.displacement


def error_in_norm(problem: ContactProblem, u: Array, below: Material, times: int = 2) -> float:
    """Distance to the solution on a refined mesh (nested), in the energy norm of a linear material."""
    mesh = problem.mesh
    for _ in range(times):
        u = np.vstack([u, 0.5 * (u[mesh.edges[:, 0]] + u[mesh.edges[:, 1]])])
        mesh = mesh.refined()
    off = (solve(replace(problem, mesh=mesh)).displacement - u).ravel()
    return float(np.sqrt(off @ (stiffness_matrix(mesh, below, 1) @ off)))


def below(bulk: float, shear: float, softened: float, plane: str = "strain") -> Material:
    """The linear material of C_low, in closed form."""
    return Material.lame(bulk - 2.0 * softened * shear / 3.0, softened * shear, plane)


# ---- linear materials written as potentials ---------------------------------------------------------------------


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_a_linear_material_written_as_a_potential_has_the_same_bound(plane: str) -> None:
    linear = replace(survey("5.1", 8), material=linear_in(plane))
    potential = replace(linear, material=Material.hencky(BULK, SHEAR, 1.0, STRAIN, plane))
    one, other = bound_of_converged(linear)[0], bound_of_converged(potential)[0]
    assert other.distance == pytest.approx(one.distance, rel=1e-9)
    assert other.relative == pytest.approx(one.relative, rel=1e-9)
    assert other.cells == pytest.approx(one.cells, rel=1e-7)
    assert other.guaranteed


def linear_in(plane: str) -> Material:
    return Material.lame(BULK - 2.0 * SHEAR / 3.0, SHEAR, plane)


@pytest.mark.parametrize("softening", [2.0, slow(0.0)])
def test_so_has_one_in_space_with_loads_that_vary_and_laws_that_soften(softening: float) -> None:
    law: Superpotential = Softening(4.0, 0.01, softening) if softening else Compliance(4.0)
    linear = ContactProblem(
        mesh=box((1.0, 1.0, 1.0), 2),
        material=LINEAR,
        contact={"bottom": Contact(law)},
        supports={"left": Clamped()},
        body_force=lambda x: np.column_stack([0.1 * x[:, 0], -0.2 * x[:, 1], -0.3 + 0.2 * x[:, 2] ** 2]),
    )
    one, other = (
        bound_of_converged(linear)[0],
        bound_of_converged(replace(linear, material=Material.hencky(BULK, SHEAR, 1.0, STRAIN)))[0],
    )
    assert one.constant > 0.0 or not softening
    assert other.constant == pytest.approx(one.constant, rel=1e-9)
    assert other.distance == pytest.approx(one.distance, rel=1e-9)


# ---- a closed form ------------------------------------------------------------------------------------------------


def force(e: float) -> float:
    """Stress of Hencky's material along an axis at a strain along it, no other strains."""
    root = np.sqrt(1.0 + 2.0 * e**2 / (3.0 * STRAIN**2))
    return (BULK + 4.0 * SHEAR * (SOFTENED + (1.0 - SOFTENED) / root) / 3.0) * e


def strain(stress: float) -> float:
    return brentq(lambda e: force(e) - stress, -5.0, 5.0, xtol=1e-15)


@dataclass(frozen=True)
class Column:
    """A block between rollers, its top held at ``-down``, under its weight: strains depend on the height alone."""

    law: Superpotential
    pressure: Callable[[float], float]
    down: float
    weight: float

    def problem(self, n: int) -> ContactProblem:
        return ContactProblem(
            mesh=rectangle((1.0, 1.0), n, pattern="cross"),
            material=HENCKY,
            contact={"bottom": Contact(self.law)},
            supports={"left": Roller(), "right": Roller(), "top": Prescribed((0.0, -self.down))},
            body_force=(0.0, -self.weight),
        )

    @property
    def penetration(self) -> float:
        def off(s: float) -> float:
            return self.down - s + quad(lambda y: strain(self.weight * y - self.pressure(s)), 0.0, 1.0, epsrel=1e-11)[0]

        return brentq(off, 0.0, 1.0, xtol=1e-14)

    def error(self, problem: ContactProblem, u: Array) -> float:
        """In the energy norm of C_low, by a rule of degree 6 on cells."""
        mesh = problem.mesh
        gradient = np.einsum("mai,maj->mij", u[mesh.cells], barycentric_gradients(mesh))
        off = np.stack([gradient[:, 0, 0], gradient[:, 1, 1], gradient[:, 0, 1] + gradient[:, 1, 0]], axis=1)
        barycentric, weights = quadrature_rule(2, 6)
        height = np.einsum("qa,ma->mq", barycentric, mesh.points[mesh.cells][:, :, 1])
        start, at = self.pressure(self.penetration), np.unique(height.round(12))
        known = dict(zip(at.tolist(), [strain(self.weight * y - start) for y in at], strict=True))
        exact = np.vectorize(known.__getitem__)(height.round(12))
        rest = np.repeat(off[:, None], len(weights), axis=1)
        rest[:, :, 1] -= exact
        lam, mu = BULK - 2.0 * SOFTENED * SHEAR / 3.0, SOFTENED * SHEAR
        density = lam * (rest[:, :, 0] + rest[:, :, 1]) ** 2
        density += 2.0 * mu * (rest[:, :, 0] ** 2 + rest[:, :, 1] ** 2 + 0.5 * rest[:, :, 2] ** 2)
        return float(np.sqrt(np.einsum("m,mq,q->", mesh.volumes, density, weights)))


def softened_pressure(s: float) -> float:
    return 20.0 * s if s <= 0.02 else max(0.4 - (s - 0.02), 0.0)


@pytest.mark.parametrize(
    ("column", "highest"),
    [
        (Column(Compliance(20.0), lambda s: 20.0 * max(s, 0.0), 0.1, 0.5), 1.6),
        (Column(Softening(20.0, 0.02, 1.0), softened_pressure, 0.1, 0.5), 2.5),
    ],
)
def test_a_column_has_a_closed_form(column: Column, highest: float) -> None:
    """The bound over the error, where the law softens too, and both fall as the mesh becomes finer."""
    errors = []
    for n in (4, 8, 16):
        problem = column.problem(n)
        found, u = bound_of_converged(problem)
        error = column.error(problem, u)
        assert found.guaranteed
        assert 1.0 < found.distance / error < highest
        errors.append(error)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(1.0, abs=0.1)


# ---- manufactured solutions -----------------------------------------------------------------------------------------


def bubble(x: Array) -> tuple[Array, Array]:
    """A displacement (k, d) that vanishes on the boundary of the unit square or cube, and its gradient (k, d, d)."""
    dim = x.shape[1]
    factors = np.sin(np.pi * x)
    slopes = np.stack(
        [np.pi * np.cos(np.pi * x[:, j]) * np.delete(factors, j, axis=1).prod(axis=1) for j in range(dim)], axis=1
    )
    size = 0.05 * np.array([1.0, -0.6, 0.8])[:dim]
    return size * factors.prod(axis=1)[:, None], size[:, None] * slopes[:, None]


def engineering(gradient: Array) -> Array:
    """Strains (k, v) of gradients (k, d, d), in the order of the matrices."""
    g, pairs = gradient, ((0, 1),) if gradient.shape[1] == 2 else ((1, 2), (0, 2), (0, 1))
    axial = [g[:, i, i] for i in range(g.shape[1])]
    return np.stack([*axial, *(g[:, i, j] + g[:, j, i] for i, j in pairs)], axis=1)


def balancing(x: Array, material: Material, step: float = 1e-4) -> Array:
    """``-div W'(eps(u))`` of the bubble by central differences of fourth order, (k, d)."""
    dim = x.shape[1]
    rows = np.array([[0, 2], [2, 1]] if dim == 2 else [[0, 5, 4], [5, 1, 3], [4, 3, 2]])
    force = np.zeros(x.shape)
    for j in range(dim):
        for times, weight in ((1, 8.0), (-1, -8.0), (2, -1.0), (-2, 1.0)):
            at = x + step * times * np.eye(dim)[j]
            force -= weight / (12.0 * step) * material.stress(at, engineering(bubble(at)[1]))[:, rows[:, j]]
    return force


@pytest.mark.parametrize(
    ("dim", "sizes", "plane"), [(2, (4, 8), "strain"), (2, (4, 8), "stress"), (3, (2, 4), "strain")]
)
def test_manufactured_solutions(dim: int, sizes: tuple[int, ...], plane: str) -> None:
    """The load is a function, which makes an estimate of the bound; it is above the error, and falls faster.

    On coarse meshes what the load does inside of cells is most of it.
    """
    material, found = Material.hencky(BULK, SHEAR, SOFTENED, STRAIN, plane), []
    metric = below(BULK, SHEAR, SOFTENED, plane)
    for n in sizes:
        mesh = rectangle((1.0, 1.0), n, pattern="cross") if dim == 2 else box((1.0, 1.0, 1.0), n)
        names = list(mesh.boundaries)
        problem = ContactProblem(
            mesh=mesh,
            material=material,
            contact={},
            supports={name: Clamped() for name in names},
            body_force=lambda x: balancing(x, material),
        )
        distance, u = bound_of_converged(problem)
        barycentric, weights = quadrature_rule(dim, 6)
        places = np.einsum("qa,mad->mqd", barycentric, mesh.points[mesh.cells])
        gradient = np.einsum("mai,maj->mij", u[mesh.cells], barycentric_gradients(mesh))
        off = np.repeat(gradient[:, None], len(weights), axis=1).reshape(-1, dim, dim)
        off = engineering(off - bubble(places.reshape(-1, dim))[1])
        density = metric.energy(np.zeros((1, dim)), off).reshape(places.shape[:2])
        error = float(np.sqrt(2.0 * np.einsum("m,mq,q->", mesh.volumes, density, weights)))
        assert not distance.guaranteed
        assert error < distance.distance
        assert 0.9 < distance.parts.misfit / error < 2.5
        found.append((error, distance.distance))
    rates = np.log2(np.array(found[0]) / np.array(found[1]))
    assert rates[0] == pytest.approx(1.0, abs=0.3)
    assert rates[1] > 0.9


# ---- random statements ----------------------------------------------------------------------------------------------


def random_hencky(seed: int) -> tuple[ContactProblem, Material]:
    """A body of Hencky's material on a foundation that rises, softens, ends or jumps in its slope."""
    rng = np.random.default_rng(seed)
    plane = str(rng.choice(["strain", "stress"]))
    constants = rng.uniform(3.0, 12.0), rng.uniform(2.0, 6.0), rng.uniform(0.15, 1.0)
    load = 10.0 ** rng.uniform(-1.5, 0.3)
    law: Superpotential = rng.choice(
        np.array(
            [
                Compliance(rng.uniform(1.0, 20.0)),
                Softening(rng.uniform(2.0, 10.0), 0.03, rng.uniform(0.1, 1.0)),
                ThresholdCompliance(0.1, 10.0),
                Signorini(),
            ],
            dtype=object,
        )
    )
    weakening = replace(Logarithmic(0.5), bound=0.1 * load)
    frictions: list[Friction | None] = [None, Tresca(rng.uniform(0.01, 0.2)), weakening]
    friction = frictions[rng.integers(0, 3)]
    contact = Contact(law) if friction is None else Contact(law, friction)
    problem = ContactProblem(
        mesh=rectangle((1.0, rng.uniform(0.5, 1.5)), int(rng.integers(2, 5)), pattern="cross"),
        material=Material.hencky(*constants, 10.0 ** rng.uniform(-2.0, -0.5), plane),
        contact={"bottom": contact},
        supports={"left": Clamped()} if rng.random() < 0.7 else {"left": Roller(), "right": Clamped()},
        tractions={"top": (rng.uniform(-0.3, 0.3) * load, -load)},
        body_force=(0.2 * load, -0.5 * load * rng.random()),
    )
    return problem, below(*constants, plane)


def bound_over_error(seed: int) -> float:
    """The bound over the error; inf where there is no bound."""
    problem, metric = random_hencky(seed)
    found, u = bound_of_converged(problem)
    ratio = found.distance / error_in_norm(problem, u, metric)
    assert ratio >= 1.0, seed
    return ratio


@pytest.mark.parametrize("seed", range(4))
def test_no_bound_is_below_the_error(seed: int) -> None:
    assert bound_over_error(seed) < 6.0


@pytest.mark.slow
def test_none_of_two_hundred_is() -> None:
    ratios = np.array([bound_over_error(seed) for seed in range(1000, 1200)])
    assert np.isfinite(ratios).mean() > 0.8
    assert np.median(ratios) < 2.0


# ---- what is not proved, refused, and refined ----------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Doubtful(Hencky):
    """Its bounds are said to come from samples."""

    @property
    def bounds_by(self) -> BoundsBy:
        return BoundsBy.SAMPLED


def test_a_sampled_lower_bound_makes_an_estimate_of_it() -> None:
    problem = replace(survey("figure1", 4), material=Doubtful(BULK, SHEAR, SOFTENED, STRAIN))
    found = solve(problem).certify(exact=True).exact
    assert found is not None
    assert np.isfinite(found.bound)
    assert not found.guaranteed
    assert "the lower bound of the stiffness of the material is sampled" in found.why
    assert "an estimate, not a bound" in "\n".join(found.lines())


def test_one_that_is_proved_for_some_strains_makes_a_condition() -> None:
    material = Material.potential("3*tr^2 + 2*dev2 + dev2^2", reach=2.0)
    problem = replace(survey("figure1", 4), material=material)
    found = solve(problem).certify(exact=True).exact
    assert found is not None
    assert not found.guaranteed
    assert (
        found.conditions == ("strains of the exact solution are within the reach 2 of the material",) == found.reasons
    )
    assert "conditional, no guarantee" in "\n".join(found.lines())
    study = hv.study(problem, 1, exact=True)
    assert study.kind_of_bound == "conditional bound"
    assert study.levels[0].conditions == found.conditions
    assert study.levels[0].bound == pytest.approx(found.bound, rel=1e-6)
    assert study.levels[0].bound > study.levels[0].energy
    assert any(str(column) == "conditional bound" for column in Table.of(study.rows()).columns)
    assert "conditional bound: if strains of the exact solution" in repr(study)


def test_what_the_curvature_saves_is_that_within_the_reach() -> None:
    """With a reach just above the strains there are no others to look at: the bound is that of the lower tensor."""
    text = "3*tr^2 + 2*dev2 + 40*dev2^2"
    wide = replace(survey("figure1", 4), material=Material.potential(text, reach=2.0))
    found, u = bound_of_converged(wide)
    largest = largest_strain(discretize(wide), discretize(wide).field.restrict(u))  # type: ignore[union-attr]
    near = replace(wide, material=Material.potential(text, reach=1.0001 * largest))
    narrow = exact_distance(near, u, body_constants(discretize(near), Workspace()))
    assert narrow.conditions
    assert narrow.cells.sum() > 1.01 * found.cells.sum()


def test_strains_beyond_the_reach_have_no_condition() -> None:
    problem = replace(survey("figure1", 4), material=Material.potential("3*tr^2 + 2*dev2 + dev2^2", reach=1e-3))
    found = bound_of_converged(problem)[0]
    assert not found.conditions
    assert any("may lie outside of the reach 0.001 of the material" in one for one in found.reasons)


@pytest.mark.parametrize(
    "material",
    [
        Material.locking(BULK, SHEAR, 6.0, 0.03),
        Material.locking(BULK, SHEAR, 6.0, 0.03, plane="stress"),
        Material.ramberg_osgood(20.0, 0.3, 0.5, 5.0, linear_from=0.05),
    ],
)
def test_other_materials_have_bounds_too(material: Material) -> None:
    """That stiffen, that yield: above the error, and less than four times it."""
    problem = replace(survey("figure1", 6), material=material)
    found, u = bound_of_converged(problem)
    assert found.guaranteed
    assert 1.0 < found.distance / error_in_norm(problem, u, lower_elasticity(material)) < 4.0


def test_a_certificate_bounds_it() -> None:
    found = solve(replace(survey("figure1", 6), material=HENCKY)).certify(exact=True).exact
    assert found is not None
    assert found.guaranteed
    assert 0.1 < found.relative < 0.5


def test_an_adaptive_solve_reaches_what_was_asked_for() -> None:
    problem = replace(survey("5.1", 4), material=HENCKY)
    found = solve_adaptive(problem, rtol=0.12)
    assert found.reached
    bounds = [level.distance.relative for level in found.levels]
    assert (np.diff(bounds) < 0.0).all()
    assert found.rate == pytest.approx(0.5, abs=0.12)
    last = found.levels[-1]
    error = error_in_norm(last.problem.origin, last.solution.displacement, below(BULK, SHEAR, SOFTENED), 1)  # type: ignore[arg-type]
    assert 1.0 < last.distance.distance / error < 3.0


def test_goals_are_refused_in_words() -> None:
    problem = replace(survey("5.1", 4), material=HENCKY)
    with pytest.raises(ProblemError, match="linear materials only; leave the goal out"):
        solve_adaptive(problem, goal="contact.bottom.force")
