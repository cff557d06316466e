"""Three dimensions: patch tests, radial friction, a cone programme, rotations, units, all methods."""

from __future__ import annotations

import itertools
from dataclasses import replace

import clarabel
import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from hemivar.certificates import certify
from hemivar.discrete import DiscreteProblem
from hemivar.fem import discretize, interpolate
from hemivar.gallery import survey_cube, survey_cube_logarithmic
from hemivar.laws import Signorini, ThresholdCompliance, Tresca
from hemivar.mechanics import Contact, ContactProblem, Material, Prescribed
from hemivar.mesh import box
from hemivar.solvers import METHODS, Solution, Status, solve, solve_nested
from tests import bodies
from tests.samples import sampled


def energy_distance(a: Solution, b: Solution) -> float:
    difference, K = a.unknowns - b.unknowns, a.problem.stiffness
    return float(np.sqrt(difference @ (K @ difference) / (b.unknowns @ (K @ b.unknowns))))


def test_patch_with_zero_poisson_on_a_rigid_plane() -> None:
    """A block of E, nu = 0 pressed by D onto a plane: p = E D/height everywhere, the displacement linear."""
    young, down, height = 8.0, 0.03, 1.5
    problem = bodies.cube(
        Signorini(),
        (2, 3, 4),
        size=(1.0, 2.0, height),
        material=Material.young(young, 0.0),
        supports={"top": Prescribed((0.0, 0.0, -down))},
    )
    solution = solve(discretize(problem)).raise_for_status()
    exact = np.zeros_like(problem.mesh.points)
    exact[:, 2] = -down * problem.mesh.points[:, 2] / height
    np.testing.assert_allclose(solution.displacement, exact, atol=1e-14)
    np.testing.assert_allclose(solution.pressure, young * down / height, rtol=1e-12)
    assert solution.normal_force == pytest.approx(2.0 * young * down / height, rel=1e-12)


@pytest.mark.parametrize(
    ("method", "angle"),
    sampled(
        itertools.product(("newton", "active-set", "augmented-lagrangian-newton", "bundle"), (0.0, 0.3, 1.9, 3.5, 5.2)),
        3,
    ),
)
def test_friction_turns_with_the_load(method: str, angle: float) -> None:
    """The top is moved down by D and along a direction of the tangent plane by T: uniform pressure, uniform slip.

    With lam = 0 and height 1 the slip w and the penetration s solve mu (T - w) = h and 2 mu (D - s) = q + p s; the
    sides carry the tractions that belong to the constant shear stress h.
    """
    mu, bound, q, p, down, along = 4.0, 0.5, 0.3, 2.0, 0.1, 0.2
    direction = np.array([np.cos(angle), np.sin(angle), 0.0])
    slip, s = along - bound / mu, (2 * mu * down - q) / (2 * mu + p)
    mesh = box((1.0, 1.0, 1.0), 2)
    problem = ContactProblem(
        mesh=mesh,
        material=Material.lame(0.0, mu),
        supports={"top": Prescribed(tuple(along * direction - [0.0, 0.0, down]))},
        contact={"bottom": Contact(ThresholdCompliance(q, p), Tresca(bound))},
        tractions={
            "left": (0.0, 0.0, -bound * direction[0]),
            "right": (0.0, 0.0, bound * direction[0]),
            "front": (0.0, 0.0, -bound * direction[1]),
            "back": (0.0, 0.0, bound * direction[1]),
        },
    )
    solution = solve(discretize(problem), METHODS[method])
    assert solution.status is Status.CONVERGED
    z = mesh.points[:, 2:]
    exact = (slip + (along - slip) * z) * direction - (s + (down - s) * z) * np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(solution.displacement, exact, atol=1e-11 if method == "newton" else 1e-7)
    np.testing.assert_allclose(np.linalg.norm(solution.slip, axis=1), slip, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(solution.friction, axis=1), bound, rtol=1e-6)


def cone_programme(problem: DiscreteProblem, q: float, p: float, bound: float) -> np.ndarray:
    """The survey's law with Tresca friction in the tangent plane, solved by Clarabel's interior point method.

    Minimise 1/2 u'Ku - f'u + sum_j w_j (q s_j + p/2 s_j^2 + bound t_j) with s >= 0, s >= r_nu, |r_tau| <= t.
    """
    K, B, w, m = (
        problem.stiffness,
        sp.csr_array(problem.contact.trace),
        problem.contact.weights,
        problem.contact_points,
    )
    n = K.shape[0]
    one, normal = sp.eye_array(m), B[0::3]
    P = sp.csc_array(sp.block_diag([sp.triu(K), sp.diags_array(p * w), sp.csc_array((m, m))]))
    cost = np.concatenate([-problem.load, q * w, bound * w])
    lower = sp.hstack([sp.csc_array((m, n)), -one, sp.csc_array((m, m))])
    above = sp.hstack([normal, -one, sp.csc_array((m, m))])
    head = sp.hstack([sp.csc_array((m, n + m)), -one])
    tails = [sp.hstack([-B[k::3], sp.csc_array((m, 2 * m))]) for k in (1, 2)]
    cones = sp.vstack([head, *tails]).tocsr()[np.arange(3 * m).reshape(3, m).T.ravel()]
    A = sp.csc_array(sp.vstack([lower, above, cones]))
    kinds = [clarabel.NonnegativeConeT(2 * m), *[clarabel.SecondOrderConeT(3)] * m]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-11
    found = clarabel.DefaultSolver(
        sp.csc_matrix(P), cost, sp.csc_matrix(A), np.zeros(A.shape[0]), kinds, settings
    ).solve()
    return np.array(found.x[:n])


def test_against_a_cone_programme() -> None:
    solution = solve(discretize(survey_cube("5.1", 4))).raise_for_status()
    u, K = cone_programme(solution.problem, 0.3, 2.0, 0.5), solution.problem.stiffness
    difference = u - solution.unknowns
    assert difference @ (K @ difference) <= 1e-10 * (u @ (K @ u))
    assert len(np.unique(solution.states.numbers)) == 2  # some stick, some slip


def test_friction_opposes_slip_and_keeps_its_bound() -> None:
    solution = solve(discretize(survey_cube("5.1", 6))).raise_for_status()
    size, length = np.linalg.norm(solution.friction, axis=1), np.linalg.norm(solution.slip, axis=1)
    assert (size <= 0.5 * (1 + 1e-9)).all()
    sliding = length > 1e-8
    assert sliding.any()
    work = np.einsum("md,md->m", solution.friction, solution.slip)
    np.testing.assert_allclose(work[sliding], -0.5 * length[sliding], rtol=1e-6)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("problem", [survey_cube("5.1", 4), survey_cube_logarithmic(n=4)], ids=["tresca", "weakening"])
def test_turning_the_whole_body_changes_nothing(problem: ContactProblem, seed: int) -> None:
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    force = np.asarray(problem.body_force)
    here = solve(discretize(problem)).raise_for_status()
    there = solve(discretize(replace(problem, mesh=problem.mesh.moved(turn), body_force=tuple(turn @ force))))
    size = np.abs(here.displacement).max()
    np.testing.assert_allclose(there.displacement @ turn, here.displacement, atol=1e-9 * size)
    np.testing.assert_allclose(there.pressure, here.pressure, atol=1e-8)
    np.testing.assert_array_equal(there.states.numbers, here.states.numbers)
    assert there.energy == pytest.approx(here.energy, rel=1e-9)


@pytest.mark.parametrize(("length", "stress"), [(1e3, 1e-6), (1e-3, 1e9)])
def test_units_do_not_matter(length: float, stress: float) -> None:
    here = solve(discretize(survey_cube("5.1", 4))).raise_for_status()
    problem = survey_cube("5.1", 4)
    there = solve(
        discretize(
            replace(
                problem,
                mesh=problem.mesh.scaled(length),
                material=Material.lame(4.0 * stress, 4.0 * stress),
                contact={
                    "bottom": Contact(ThresholdCompliance(0.3 * stress, 2.0 * stress / length), Tresca(0.5 * stress))
                },
                body_force=tuple(c * stress / length for c in problem.body_force),
            )
        )
    ).raise_for_status()
    size = np.abs(here.displacement).max()
    np.testing.assert_allclose(there.displacement / length, here.displacement, atol=1e-9 * size)
    np.testing.assert_allclose(there.multiplier / stress, here.multiplier, atol=1e-8)
    np.testing.assert_array_equal(there.states.numbers, here.states.numbers)
    assert there.energy == pytest.approx(here.energy * stress * length**3, rel=1e-9)


CUBES = {"tresca": survey_cube("5.1", 3), "weakening": survey_cube_logarithmic(n=3)}


@pytest.mark.parametrize(
    ("method", "cube"), sampled(itertools.product(sorted({*METHODS} - {"newton", "direct-powell"}), CUBES), 3)
)
def test_methods_agree(method: str, cube: str) -> None:
    problem = CUBES[cube]
    discrete = discretize(problem)
    if METHODS[method].refuse(discrete) is not None:
        pytest.skip("the method is not for laws that are not convex")
    known, other = solve(discrete).raise_for_status(), solve(discrete, METHODS[method])
    assert other.status is Status.CONVERGED
    assert energy_distance(other, known) < 1e-6


def test_warm_start_over_nested_boxes_and_values_at_points() -> None:
    problems = [discretize(survey_cube("5.1", n)) for n in (2, 4, 8)]
    coarse, _, fine = solve_nested(problems)
    cold = solve(problems[-1]).raise_for_status()
    assert energy_distance(fine, cold) < 1e-9
    assert fine.steps <= cold.steps
    mesh = coarse.problem.field.mesh
    np.testing.assert_allclose(interpolate(mesh, coarse.displacement, mesh.points), coarse.displacement, atol=1e-14)


def test_weakening_friction_within_the_margin_is_certified_unique() -> None:
    solution = solve(discretize(survey_cube_logarithmic(n=4))).raise_for_status()
    certificate = certify(solution.problem, solution.unknowns, solution.multiplier)
    assert 0.0 < certificate.margin < 1.0
    assert certificate.unique


def test_clamped_box_without_contact_bends_as_a_beam() -> None:
    """Euler and Bernoulli: end deflection f L^4/(8 E I) under a uniform load, nu = 0; P1 is stiffer, O(h^2)."""
    length, young, force = 8.0, 100.0, 1e-3
    known = force * length**4 / (8.0 * young / 12.0)
    errors = []
    for n in (2, 4):
        problem = bodies.cube(
            cells=(8 * n, n, n),
            size=(length, 1.0, 1.0),
            material=Material.young(young, 0.0),
            body_force=(0.0, 0.0, -force),
        )
        end = np.isclose(problem.mesh.points[:, 0], length)
        errors.append(1.0 + solve(discretize(problem)).displacement[end, 2].mean() / known)
    assert 0.0 < errors[1] < 0.4 * errors[0]
