"""What must not change: units, rotation, quadratic programmes that say the same, other minimisers."""

from __future__ import annotations

import itertools

import clarabel
import numpy as np
import pytest
import scipy.optimize as opt
import scipy.sparse as sp

from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize
from hemivar.laws import ContactLaw, Friction, ThresholdCompliance, Tresca
from hemivar.mechanics import Clamped, Contact, ContactProblem, Material, Roller
from hemivar.mesh import rectangle
from hemivar.solvers import METHODS, Solution, solve
from tests.samples import sampled

from ..problems import OTHER_DATA, SURVEY_DATA, discrete_square, relative_difference, square

EXACT = ["newton", "active-set", "augmented-lagrangian-newton", "direct-lbfgs", "bundle"]


def in_other_units(data: str, n: int, length: float, stress: float) -> DiscreteProblem:
    """The square with every length multiplied by ``length`` and every stress by ``stress``."""
    force, normal, friction = SURVEY_DATA[data]
    assert isinstance(normal, ThresholdCompliance)
    return discretize(
        ContactProblem(
            mesh=rectangle((length, length), (n, n), "cross"),
            material=Material.lame(4.0 * stress, 4.0 * stress),
            supports={"left": Clamped()},
            contact={
                "bottom": Contact(
                    ThresholdCompliance(normal.q_max * stress, normal.p_const * stress / length),  # type: ignore[operator]
                    Tresca(friction.bound * stress),  # type: ignore[operator]
                )
            },
            body_force=tuple(c * stress / length for c in force),
        )
    )


UNITS = tuple(
    (method, data, *units)
    for method, data, units in itertools.product(METHODS, SURVEY_DATA, ((1e3, 1e-6), (1e-3, 1e9)))
)


@pytest.mark.parametrize(
    ("method", "data", "length", "stress"),
    sampled(UNITS, [one for one in UNITS[::3] if one[0] != "bundle" or one[1] == "data (5.1)"]),
)
def test_units_do_not_matter(method: str, data: str, length: float, stress: float) -> None:
    """Metres and pascals, millimetres and megapascals, micrometres and so on."""
    if method == "direct-powell" and data != "data (5.1)":
        pytest.skip("one data set is enough for the slowest method")
    here = solve(discrete_square(data, 8), METHODS[method])
    there = solve(in_other_units(data, 8, length, stress), METHODS[method])
    assert there.status is here.status
    # Powell's and SciPy's routines take decisions by rounding, and end elsewhere within their own accuracy.
    tolerance = {"direct-powell": 2e-2, "augmented-lagrangian": 1e-7, "active-set-krylov": 1e-7}.get(method, 1e-9)
    if method in ("direct-lbfgs", "bundle"):
        tolerance = 1e-8
    size = np.abs(here.displacement).max()
    np.testing.assert_allclose(there.displacement / length, here.displacement, atol=tolerance * size)
    assert there.energy == pytest.approx(here.energy * stress * length**2, rel=max(tolerance, 1e-9))
    if method in ("newton", "active-set"):
        scale = np.abs(here.multiplier).max()
        np.testing.assert_allclose(there.multiplier / stress, here.multiplier, atol=1e-9 * scale)
        np.testing.assert_array_equal(there.states.numbers, here.states.numbers)


def rotated(problem: ContactProblem, angle: float) -> ContactProblem:
    c, s = np.cos(angle), np.sin(angle)
    force = np.asarray(problem.body_force)
    return ContactProblem(
        mesh=problem.mesh.rotated(angle),
        material=problem.material,
        supports=problem.supports,
        contact=problem.contact,
        body_force=(c * force[0] - s * force[1], s * force[0] + c * force[1]),
        quadrature=problem.quadrature,
    )


@pytest.mark.parametrize("data", [*SURVEY_DATA, *OTHER_DATA])
@pytest.mark.parametrize("supports", ["clamped", "rollers"])
def test_rotation_of_the_whole_body_changes_nothing(data: str, supports: str) -> None:
    problem = square(data, 8)
    if supports == "rollers":
        import dataclasses

        problem = dataclasses.replace(problem, supports={"left": Roller(), "top": Roller()})
    angle = np.pi / 6
    here, there = solve(discretize(problem)), solve(discretize(rotated(problem, angle)))
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    size = np.abs(here.displacement).max()
    np.testing.assert_allclose(there.displacement, here.displacement @ turn.T, atol=1e-9 * size)
    np.testing.assert_allclose(there.multiplier, here.multiplier, atol=1e-9 * max(1.0, np.abs(here.multiplier).max()))
    np.testing.assert_array_equal(there.states.numbers, here.states.numbers)
    assert there.energy == pytest.approx(here.energy, rel=1e-9)


def quadratic_programme(problem: DiscreteProblem, q: float, p: float, rigid: bool, bound: float) -> np.ndarray:
    """The discrete problem as a quadratic programme in (u, s, t), s >= r_nu, s >= 0, t >= |r_tau|, by an
    interior-point code that shares nothing with hemivar."""
    n, m = problem.unknowns, problem.contact_points
    B = problem.contact.trace.tocsr()
    normal, tangential = B[0::2], B[1::2]
    w = problem.contact.weights
    P = sp.block_diag([problem.stiffness, sp.diags_array(w * p), sp.csr_array((m, m))], format="csc")
    c = np.concatenate([-problem.load, w * q, w * bound])
    eye, none = sp.eye_array(m), sp.csr_array((m, m))
    A = sp.block_array(
        [
            [normal, -eye, none],
            [sp.csr_array((m, n)), -eye, none],
            [tangential, none, -eye],
            [-tangential, none, -eye],
        ]
    )
    b = np.concatenate([problem.gap, np.zeros(3 * m)])
    if rigid:
        A = sp.block_array([[A], [sp.hstack([normal, none, none])]])
        b = np.concatenate([b, problem.gap])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-13
    answer = clarabel.DefaultSolver(
        sp.triu(P, format="csc"), c, sp.csc_array(A), b, [clarabel.NonnegativeConeT(A.shape[0])], settings
    ).solve()
    return np.asarray(answer.x)[:n]


@pytest.mark.parametrize("data", [name for name in {**SURVEY_DATA, **OTHER_DATA} if name != "power"])
def test_energy_is_that_of_a_quadratic_programme(data: str) -> None:
    problem = discrete_square(data, 8)
    _, normal, friction = {**SURVEY_DATA, **OTHER_DATA}[data]
    rigid = not isinstance(normal, ThresholdCompliance)
    q, p = (0.0, 0.0) if rigid else (float(normal.q_max), float(normal.p_const))  # type: ignore[union-attr,arg-type]
    u = quadratic_programme(problem, q, p, rigid, float(friction.bound))  # type: ignore[arg-type]
    found = solve(problem)
    v = found.unknowns - u
    K = problem.stiffness
    assert np.sqrt(v @ (K @ v)) < 1e-6 * np.sqrt(u @ (K @ u))
    if not rigid:
        assert found.energy <= problem.energy(u) + 1e-12 * abs(found.energy)
        assert found.energy == pytest.approx(problem.energy(u), rel=1e-10)


def brute_force(problem: DiscreteProblem, starts: int = 12) -> float:
    """Lowest energy of a two-point problem by a dense grid, then by simplex searches from the best grid points."""
    from hemivar.systems import condense

    condensed = condense(problem)
    axis = np.linspace(-0.5, 0.5, 21)
    grid = np.stack(np.meshgrid(*[axis] * condensed.free.size, indexing="ij"), axis=-1).reshape(-1, condensed.free.size)
    A, g = condensed.matrix, condensed.load
    energies = 0.5 * np.einsum("ki,ij,kj->k", grid, A, grid) - grid @ g
    for j in range(problem.contact_points):
        r = grid[:, 2 * j : 2 * j + 2]
        one = problem.law.take(np.array([j]))
        energies += problem.contact.weights[j] * ContactLaw(one.normal, one.friction).value(r)
    best = np.argsort(energies)[:starts]

    def energy(x: np.ndarray) -> float:
        return condensed.energy(x.reshape(condensed.shape))

    options = {"xatol": 1e-12, "fatol": 1e-16, "maxiter": 20000, "maxfev": 20000}
    return min(float(opt.minimize(energy, grid[k], method="Nelder-Mead", options=options).fun) for k in best)


@pytest.mark.parametrize("data", sampled(SURVEY_DATA, 3))
def test_energy_is_that_of_brute_force(data: str) -> None:
    problem = discrete_square(data, 2)
    assert problem.contact_points == 2
    found = solve(problem)
    lowest = brute_force(problem)
    assert found.energy <= lowest + 1e-13
    assert found.energy == pytest.approx(lowest, rel=1e-6)


def test_parameters_that_vary_along_the_boundary() -> None:
    """A law with q_max(x), h(x) equals, point by point, the table of the same numbers."""
    problem = square(n=8)
    varying = {
        "bottom": Contact(ThresholdCompliance(lambda x: 0.1 + x[:, 0], 2.0), Tresca(lambda x: 0.2 * (2.0 - x[:, 0])))
    }
    import dataclasses

    discrete = discretize(dataclasses.replace(problem, contact=varying))
    x = discrete.contact.points[:, 0]  # type: ignore[index]
    numbers = discrete.with_(law=ContactLaw(ThresholdCompliance(0.1 + x, 2.0), Friction(0.2 * (2.0 - x))))
    assert relative_difference(solve(numbers), solve(discrete)) < 1e-13
    uniform = solve(discretize(problem))
    assert relative_difference(solve(discrete), uniform) > 1e-2


def test_gap_moves_the_foundation_away() -> None:
    import dataclasses

    problem = square("rigid", 8)
    law = problem.contact["bottom"]
    open_ = solve(discretize(dataclasses.replace(problem, contact={"bottom": dataclasses.replace(law, gap=10.0)})))
    assert (open_.pressure == 0.0).all()
    wavy = dataclasses.replace(law, gap=lambda x: 0.01 * x[:, 0] ** 2)
    found: Solution = solve(discretize(dataclasses.replace(problem, contact={"bottom": wavy})))
    u = found.problem.contact.trace @ found.unknowns
    x = found.problem.contact.points[:, 0]  # type: ignore[index]
    np.testing.assert_allclose(found.penetration, u[0::2] - 0.01 * x**2, atol=1e-15)
    assert found.penetration.max() <= 1e-15
