"""The numerical parts of a certificate one by one, against dense matrices and by hand."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

import hemivar as hv
from hemivar.basics.types import Array
from hemivar.certificates import EnergyNorm, PointKind, certify, norms
from hemivar.certificates.bound import Point, equilibrium_multiplier, gram_solve, lift, symmetric_inverse
from hemivar.certificates.by_multigrid import SolveByCycles, Subspace
from hemivar.certificates.kind import study
from hemivar.discrete import DiscreteProblem
from hemivar.discrete.bulk import Quadratic
from hemivar.laws import ContactLaw, PiecewiseQuadratic, Signorini, Tresca, minimisers
from hemivar.linear.vectors import Vectors
from hemivar.solvers import Solution
from tests.certificates.problems import bar_problem, bar_unknowns, survey_softening, weakening
from tests.systems.test_contact_moves_in_parts import in_parts


def positive(n: int, seed: int) -> Array:
    root = np.random.default_rng(seed).standard_normal((n, n))
    return root @ root.T + 0.1 * np.eye(n)


@pytest.mark.parametrize("coupled", [False, True])
@pytest.mark.parametrize("units", [1e-9, 1.0, 1e9])
def test_the_inverse_of_the_trace(coupled: bool, units: float) -> None:
    """Rows that share unknowns, or do not; those that are not active stay at zero."""
    rng = np.random.default_rng(3)
    trace = np.zeros((5, 7))
    trace[range(5), [0, 2, 3, 5, 6]] = [1.0, -2.0, 1.0, 1.0, 0.5]
    if coupled:
        trace[[0, 1, 3], [2, 3, 6]] = [0.3, -0.4, 0.2]
    active = np.array([True, True, False, True, True])
    rhs = units * rng.standard_normal(5)
    rhs[3] = 0.0
    part = trace[active]
    expected = np.zeros(5)
    expected[active] = np.linalg.solve(part @ part.T, rhs[active])
    found = gram_solve(sp.csr_array(trace), rhs, active)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14 * units)
    moved = lift(sp.csr_array(trace), np.where(active, rhs, 0.0), active)
    np.testing.assert_allclose(part @ moved, rhs[active], atol=1e-14 * units)
    np.testing.assert_allclose(moved, np.linalg.pinv(part) @ rhs[active], atol=1e-14 * units)
    assert np.array_equal(gram_solve(sp.csr_array(trace), np.zeros(5), active), np.zeros(5))


def test_rows_that_depend_on_one_another_have_no_inverse() -> None:
    trace = sp.csr_array(np.array([[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 1.0]]))
    every = np.ones(3, dtype=bool)
    assert gram_solve(trace, np.array([1.0, -1.0, 0.0]), every) is None
    assert lift(trace, np.array([1.0, -1.0, 0.0]), every) is None


def test_the_inverse_of_a_small_matrix() -> None:
    matrix = positive(6, 1)
    skew = 1e-3 * np.triu(np.ones((6, 6)), 1)
    found = symmetric_inverse(matrix + skew - skew.T)
    np.testing.assert_allclose(found, np.linalg.inv(matrix), rtol=1e-9)
    assert symmetric_inverse(-matrix) is None


@pytest.mark.parametrize("n", [10, 60])
def test_the_energy_norm_against_dense_matrices(n: int) -> None:
    """Below and above the size up to which eigenproblems are dense ones."""
    K = positive(n, n)
    norm = EnergyNorm(sp.csr_array(K))
    b = np.random.default_rng(1).standard_normal(n)
    x = np.linalg.solve(K, b)
    assert norm.definite
    assert norm.norm(b) == pytest.approx(np.sqrt(b @ K @ b))
    assert norm.riesz(b)[1] == pytest.approx(np.sqrt(b @ x))
    assert norm.least_dual_norm(b) == pytest.approx(np.sqrt(b @ x))
    np.testing.assert_allclose(norm.riesz(b)[0], x, rtol=1e-8)
    root = np.sqrt(np.diag(K))
    least = np.linalg.eigvalsh(K / np.outer(root, root))[0]
    assert 0.8 * least <= norm.lowest <= least * (1.0 + 1e-9)
    assert norm.rounding_norm(3.0) == pytest.approx(3.0 / np.sqrt(norm.lowest))
    weight = np.abs(np.random.default_rng(2).standard_normal(n))
    weight[::3] = 0.0
    top = la.eigh(np.diag(weight), K, eigvals_only=True)[-1]
    found = norm.largest_eigenvalue(sp.csr_array(sp.eye_array(n)), weight)
    assert found.value == pytest.approx(top, rel=1e-6)
    assert top <= found.bound <= top * (1.0 + 1e-5)
    assert norm.largest_eigenvalue(sp.csr_array(sp.eye_array(n)), np.zeros(n)).bound == 0.0


def test_rows_without_weight_or_entries_do_not_count() -> None:
    trace = sp.csr_array(np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 3.0]]))
    norm = EnergyNorm(sp.csr_array(np.diag([2.0, 1.0])))
    assert norm.largest_eigenvalue(trace, np.array([4.0, 1.0, 0.0])).value == pytest.approx(2.0)
    assert norm.largest_eigenvalue(trace, np.array([0.0, 1.0, 0.0])).bound == 0.0


def test_a_norm_in_parts_answers_as_the_whole_one() -> None:
    """By a preconditioner, two threads with unequal parts against factors of the whole matrix."""
    n, cut = 60, 22
    K = positive(n, 4)
    rng = np.random.default_rng(8)
    b, weight = rng.standard_normal(n), np.abs(rng.standard_normal(n))
    weight[50:] = 0.0
    parts = (slice(0, cut), slice(cut, n))
    inverse = np.linalg.inv(K + 0.1 * np.diag(np.diag(K)))
    known, trace = EnergyNorm(sp.csr_array(K)), sp.csr_array(sp.eye_array(n))

    class Rows:
        """The rows of a matrix that one part has: it asks the others for their entries."""

        def __init__(self, matrix: Array, own: slice, vectors: Vectors) -> None:
            self.matrix, self.own, self.vectors = matrix, own, vectors

        def __matmul__(self, v: Array) -> Array:
            whole = np.zeros((n, *v.shape[1:]))
            whole[self.own] = v
            return self.matrix[self.own] @ self.vectors.total(*whole.ravel()).reshape(whole.shape)

    def answers(vectors: Vectors, number: int) -> list[float]:
        own = parts[number]
        cycle = Rows(inverse, own, vectors)
        norm = EnergyNorm(SolveByCycles(Rows(K, own, vectors), np.diag(K)[own], cycle.__matmul__, vectors))
        size = own.stop - own.start
        top = norm.largest_eigenvalue(sp.csr_array(sp.eye_array(size)), weight[own])
        x, dual = norm.riesz(b[own])
        again = norm.riesz(b[own], x)[1]
        least = norm.least_dual_norm(b[own])
        none = norm.largest_eigenvalue(sp.csr_array(sp.eye_array(size)), np.zeros(size)).bound
        return [norm.lowest, norm.norm(b[own]), dual, again, least, top.value, top.bound, none]

    one, other = in_parts(answers)
    np.testing.assert_array_equal(one, other)
    lowest, size, dual, again, least, value, bound, none = one
    exact, eigenvalue = known.riesz(b)[1], known.largest_eigenvalue(trace, weight).value
    smallest = float(np.linalg.eigvalsh(K / np.sqrt(np.outer(np.diag(K), np.diag(K))))[0])
    assert 0.3 * smallest < lowest <= smallest
    assert size == pytest.approx(known.norm(b))
    assert least <= exact * (1.0 + 1e-12) <= dual * (1.0 + 1e-12) <= 1.02 * exact
    assert exact <= again * (1.0 + 1e-12) <= 1.02 * exact
    assert value <= eigenvalue * (1.0 + 1e-8) <= bound * (1.0 + 1e-8) <= 1.002 * eigenvalue
    assert none == 0.0


def test_a_subspace_reaches_the_top_of_a_pencil_and_says_how_near_it_is() -> None:
    """C is near to K^-1."""
    n, rng = 40, np.random.default_rng(5)
    K = positive(n, 2)
    S = rng.standard_normal((15, n))
    sign = np.where(np.arange(15) % 3 == 0, -1.0, 1.0)
    values = la.eigh(S.T @ (sign[:, None] * S), K, eigvals_only=True)
    C = np.diag(np.sqrt(np.linspace(0.85, 1.0, n))) @ np.linalg.inv(K) @ np.diag(np.sqrt(np.linspace(0.85, 1.0, n)))
    quality = float(np.min(np.real(np.linalg.eigvals(C @ K))))
    assert quality > 0.1
    subspace = Subspace(sp.csr_array(K), lambda R: C @ R, sp.csr_array(S), sign, rng.standard_normal((n, 3)), 2)
    added = subspace.improve(quality, 100, 1e-8)
    assert subspace.values[0] == pytest.approx(values[-1], rel=1e-6)
    assert subspace.values[0] <= values[-1] * (1.0 + 1e-12)
    assert added <= 1e-8 * values[-1] + 1e-14
    assert subspace.gap(7.0) == pytest.approx(0.5 * (subspace.values[0] - subspace.values[1]))
    x = subspace.X[:, 0]
    assert x @ K @ x == pytest.approx(1.0)
    assert subspace.negative is None
    rough = Subspace(sp.csr_array(K), lambda R: C @ R, sp.csr_array(S), sign, rng.standard_normal((n, 3)), 2)
    short = rough.improve(quality, 30, 1e-4)
    rest = S.T @ (sign * (S @ rough.X[:, 0])) - rough.values[0] * (K @ rough.X[:, 0])
    square = float(rest @ np.linalg.solve(K, rest)) / quality
    assert short <= 1.1 * square / rough.gap(np.inf) < 0.1 * np.sqrt(square)  # the square counts where a gap is known
    coarse = Subspace(sp.csr_array(K), lambda R: C @ R, sp.csr_array(S), sign, rng.standard_normal((n, 3)))
    assert coarse.gap(7.0) == 7.0
    short = coarse.improve(quality, 2, 1e-8)
    assert coarse.values[0] <= values[-1] <= coarse.values[0] + short or short > 0.0
    K[:2, :2] = [[1.0, 2.0], [2.0, 1.0]]
    assert Subspace(sp.csr_array(K), lambda R: R, sp.csr_array(S), sign, np.eye(n)[:, :3]).negative is not None


@pytest.mark.parametrize(("less", "found"), [(1e-10, True), (0.0, False), (-1e-10, False)])
@pytest.mark.parametrize("units", [1e-9, 1.0, 1e9])
def test_a_direction_of_negative_energy_is_met_where_there_is_one(units: float, less: float, found: bool) -> None:
    """Along (1, -1) the energy is -2 less, in the unit of the matrix, beside 4 along (1, 1)."""
    K = units * np.array([[1.0, 1.0 + less], [1.0 + less, 1.0]])
    subspace = Subspace(sp.csr_array(K), lambda R: R, sp.csr_array(np.eye(2)), np.ones(2), np.eye(2))
    assert (subspace.negative is not None) == found
    if found:
        assert subspace.negative is not None
        assert subspace.negative @ K @ subspace.negative < 0.0


@pytest.mark.parametrize("top", [0.999, 1.001])
def test_a_value_is_told_apart_from_the_one_that_it_is_compared_with(top: float) -> None:
    """Just below one the bound must be below one as well; above it the usual accuracy will do."""
    n, rng = 30, np.random.default_rng(8)
    K = positive(n, 4)
    S = rng.standard_normal((12, n))
    S *= np.sqrt(top / la.eigh(S.T @ S, K, eigvals_only=True)[-1])
    scale = np.diag(np.sqrt(np.linspace(0.3, 1.0, n)))
    C = scale @ np.linalg.inv(K) @ scale
    quality = float(np.min(np.real(np.linalg.eigvals(C @ K))))
    for seed in range(5):
        start = np.random.default_rng(seed).standard_normal((n, 1))
        subspace = Subspace(sp.csr_array(K), lambda R: C @ R, sp.csr_array(S), np.ones(12), start)
        added = subspace.improve(quality, 300, 0.5, near=1.0)
        if top < 1.0:
            assert top <= subspace.values[0] + added * (1.0 + 1e-9) < 1.0
            assert added <= 0.1 * (1.0 - subspace.values[0])
        else:
            assert added <= 0.5 * subspace.values[0]


def test_a_point_at_rest_is_snapped_to_rest() -> None:
    law = ContactLaw(Signorini(), Tresca(1.0)).at(np.zeros((3, 2)))
    r = np.array([[1e-14, 0.0], [-0.5, 1e-14], [1e-14, 0.3]])
    lam = np.array([[2.0, 0.4], [0.0, 0.2], [1.0, 1.0]])
    np.testing.assert_array_equal(law.fitted(r, lam, np.full((3, 2), 0.1)), [[0.0, 0.0], [-0.5, 0.0], [0.0, 0.3]])


@pytest.mark.parametrize("pairs", [1, 2, 7, 50])
def test_the_best_knot_does_not_depend_on_how_many_are_looked_at_in_one_go(
    pairs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(4)
    knots = np.sort(rng.uniform(-1.0, 1.0, 40))
    law = PiecewiseQuadratic(knots, rng.normal(size=41), rng.normal(size=40))  # type: ignore[arg-type]
    one = ContactLaw(law)
    r, lam, tau = rng.uniform(-1.0, 1.0, (30, 1)), rng.normal(size=(30, 1)), np.full((30, 2), 0.3)
    whole = one.fitted(r, lam, tau)
    monkeypatch.setattr(minimisers, "CACHED", pairs)
    np.testing.assert_array_equal(one.fitted(r, lam, tau), whole)


def curvature_by_hand(solution: Solution) -> float | None:
    """Least eigenvalue of (K + B'W j'' B, K) on what the held components leave free; None beside a jump."""
    problem = solution.problem
    bulk, contact, law = problem.bulk, problem.contact, problem.law
    assert isinstance(bulk, Quadratic)
    K, B = bulk.stiffness.toarray(), contact.trace.toarray()
    held: list[int] = []
    bend = np.zeros(len(B))
    for c, part in enumerate(law.scalar_laws(contact.components)):
        r = solution.local[:, c]
        knots = np.broadcast_to(part.knots, (contact.count, part.knots.shape[-1]))
        left, right = (np.broadcast_to(s, knots.shape) for s in part.knot_slopes())
        curvature = np.broadcast_to(part.piece_curvature(part.piece_of(r), r), r.shape)
        for j in range(contact.count):
            near = int(np.argmin(np.abs(knots[j] - r[j])))
            if abs(knots[j, near] - r[j]) < 1e-9:
                lam = solution.multiplier[j, c]
                if right[j, near] <= left[j, near] or min(lam - left[j, near], right[j, near] - lam) < 1e-6:
                    return None
                held.append(j * contact.components + c)
            bend[j * contact.components + c] = contact.weights[j] * curvature[j]
    bend[held] = 0.0
    Z = la.null_space(B[held]) if held else np.eye(len(K))
    full = K + B.T @ (bend[:, None] * B)
    return float(la.eigh(Z.T @ full @ Z, Z.T @ K @ Z, eigvals_only=True)[0])


def test_curvature_of_a_point_that_slides_while_it_presses() -> None:
    """Friction weakens along the slip alone; the normal law is stiff and the body couples both."""
    law = ContactLaw(hv.Compliance(6.0), hv.laws.Friction(1.0, weakening(0.4, 2.0)))
    problem = DiscreteProblem.of_arrays([[4.0, 1.0], [1.0, 4.0]], [1.5, 1.3], np.eye(2), np.ones(1), np.zeros(1), law)  # type: ignore[arg-type]
    solution = hv.solve(problem)
    assert 0.01 < solution.slip[0, 0] < 0.19
    assert solution.pressure[0] > 0.1
    expected = curvature_by_hand(solution)
    assert expected is not None
    assert 0.0 < expected < 0.9
    found = study(
        Point(problem, EnergyNorm(problem.bulk.hessian(solution.unknowns)), solution.unknowns, solution.multiplier)
    )
    assert found.curvature == pytest.approx(expected, rel=1e-9)


def test_the_bound_of_a_rough_displacement_is_its_error() -> None:
    """The search ends at the exact solution, so that little is left but the distance to it."""
    rng = np.random.default_rng(2)
    problem = bar_problem(0.4, 2.0, 0.1, 0.5)
    exact = hv.solve(problem, controls=hv.Controls(rtol=1e-13)).unknowns
    K = problem.bulk.hessian(exact)
    for size in (1e-3, 0.1, 1.0, 10.0):
        u = exact + size * rng.standard_normal(8)
        error = float(np.sqrt((u - exact) @ (K @ (u - exact))))
        assert error <= certify(problem, u).error_bound * (1.0 + 1e-12)
        assert certify(problem, u).error_bound <= 1.001 * error


def test_components_that_a_support_holds_take_a_multiplier_of_the_law() -> None:
    """A point that is pressed into the foundation by its support: no force of the body says how much."""
    problem = DiscreteProblem.of_arrays(
        2.0 * np.eye(2), np.ones(2), [[0.0, 0.0], [0.0, 1.0]], np.ones(2), [-0.05, 0.0], ContactLaw(hv.Compliance(3.0))
    )  # type: ignore[arg-type]
    solution = hv.solve(problem)
    np.testing.assert_allclose(solution.pressure, [0.15, 0.6], rtol=1e-12)
    found = certify(problem, solution.unknowns)
    assert found.stationary
    assert found.inclusion_relative < 1e-8
    assert equilibrium_multiplier(problem, solution.unknowns)[0] == 0.0


def test_the_words_of_a_certificate_follow_its_numbers() -> None:
    sure = certify(bar_problem(0.4, 2.0, 0.1, 0.5), bar_unknowns(0.4, 0.3))
    text = "\n".join(sure.lines())
    assert "the only solution" in text
    assert "margin" not in text
    assert "at most" in text
    assert "to the exact discrete solution" in text
    whole = "\n".join(sure.lines(whole=True))
    for word in ("equilibrium", "inclusion", "residual", "energy", "margin            0.5 (c = 0.5)", "alpha"):
        assert word in whole
    assert "least curvature" not in whole
    unsure = "\n".join(certify(bar_problem(0.25, 2.0, 0.1, 2.0), bar_unknowns(0.25, 0.15)).lines())
    assert "maximum; there are other solutions" in unsure
    assert "least curvature   -1 (the body alone: 1)" in unsure
    assert "margin            -1 (c = 2)" in unsure
    assert "no bound, because the margin is not positive" in unsure
    late = "\n".join(certify(survey_softening(1.5), np.zeros(84), max_time=0.0).lines())
    assert "no bound, because the time limit was reached" in late
    assert "left out" in late


def test_a_problem_without_contact_has_constants_without_work() -> None:
    problem = DiscreteProblem.of_arrays(
        np.eye(2), np.ones(2), np.zeros((0, 2)), np.zeros(0), np.zeros(0), ContactLaw(Signorini())
    )  # fmt: skip
    found = certify(problem, np.ones(2))
    assert found.kind is PointKind.UNIQUE_MINIMISER
    assert (found.margin, found.smallness.constant, found.inclusion) == (1.0, 0.0, 0.0)
    assert certify(problem, np.ones(2), max_time=0.0).smallness.m_alpha == 0.0


@pytest.mark.parametrize("d", [1, 2, 3])
def test_the_point_at_which_a_law_fits_best_by_looking_at_every_knot(d: int) -> None:
    """r or a knot, part by part; a slip keeps its direction, and at rest friction may point anywhere."""
    rng = np.random.default_rng(d)
    knots = np.array([0.0, 0.1, 0.3])
    normal = PiecewiseQuadratic(knots, [0.0, 3.0, -1.0, 0.0], [0.2, 0.4, -0.3])  # type: ignore[arg-type]
    law = ContactLaw(normal, hv.laws.Friction(0.7, weakening(0.4, 2.0)))  # kinks at 0 and 0.2
    moved = {"normal": 0, "rest": 0, "kink": 0, "stays": 0}
    for _ in range(300):
        near = rng.choice([0.0, 1e-13, 0.02], 2)
        way = rng.normal(size=max(d - 1, 1))
        way /= np.linalg.norm(way)
        slip = abs(rng.choice([0.0, 0.2]) + near[1] * rng.normal())
        r = np.concatenate([[rng.choice(knots) + near[0] * rng.normal()], slip * way])[None, :d]
        other = rng.normal(size=max(d - 1, 1))
        force = rng.choice([0.3, 0.7, 0.5]) * (way if rng.random() < 0.6 else other / np.linalg.norm(other))
        lam = np.concatenate([[rng.normal()], force])[None, :d]
        tau = 10.0 ** rng.uniform(-2.0, 1.0, (1, 2))
        found = law.fitted(r, lam, tau)
        places = np.append(knots, r[0, 0])
        misses = [np.hypot((r[0, 0] - x) / tau[0, 0], normal.distance(np.array([x]), lam[:, 0])[0]) for x in places]
        at = int(np.argmin(np.round(misses, 12)))
        assert misses[int(np.argmin(np.abs(places - found[0, 0])))] <= misses[at] + 1e-12
        moved["normal" if found[0, 0] != r[0, 0] else "stays"] += 1
        if d == 1:
            continue
        size, total = float(np.linalg.norm(r[0, 1:])), float(np.linalg.norm(lam[0, 1:]))
        along = float(lam[0, 1:] @ r[0, 1:]) / size if size > 0.0 else total
        part = law.tangential

        def miss(length: float, force: float, size: float = size, tau: Array = tau) -> float:
            off = part.distance(np.array([length]), np.array([force]))[0]  # noqa: B023
            return float(np.hypot((size - length) / tau[0, 1], off))

        best = min(miss(size, along), miss(0.2, along), miss(0.0, along), miss(0.0, total))
        length = float(np.linalg.norm(found[0, 1:]))
        assert min(miss(length, along), miss(0.0, total) if length == 0.0 else np.inf) <= best + 1e-12
        if length > 0.0:
            np.testing.assert_allclose(found[0, 1:] / length, r[0, 1:] / size, atol=1e-12)
        moved["rest" if length == 0.0 and size > 0.0 else "kink" if length != size else "stays"] += 1
    assert min(moved.values() if d > 1 else (moved["normal"], moved["stays"])) > 5


@pytest.mark.parametrize(
    ("unknowns", "components", "expected"),
    [(8, 1, True), (8, 2, True), (9, 2, False), (9, 1, False), (6, 3, True), (7, 3, False)],
)
def test_how_large_a_stiffness_is_factorised(
    unknowns: int, components: int, expected: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In space a factorisation fills more, so that the limit is lower; arrays are told by their components."""
    monkeypatch.setattr(norms, "FACTORISED", (8, 6))
    trace = np.eye(unknowns)[:components]
    problem = DiscreteProblem.of_arrays(
        np.eye(unknowns), np.ones(unknowns), trace, np.ones(1), np.zeros(1), ContactLaw(Signorini())
    )
    assert norms.factorises(problem) is expected
