"""Levels with held contact unknowns, and conjugate gradients, against dense linear algebra."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import hemivar as hv
from hemivar import gallery
from hemivar.discrete.contact import contact_unknowns
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import Truncated
from hemivar.mesh.mesh import Mesh
from hemivar.systems.body_on_levels import ElasticMultigrid


def survey_square(n: int = 16) -> hv.DiscreteProblem:
    return hv.discretize(gallery.survey("5.1", n, "right"))


def survey_cube(n: int = 8) -> hv.DiscreteProblem:
    return hv.discretize(gallery.survey_cube("5.1", n))


def without_meshes(statement: hv.ContactProblem) -> hv.DiscreteProblem:
    mesh = statement.mesh
    return hv.discretize(replace(statement, mesh=Mesh(mesh.points, mesh.cells, dict(mesh.boundaries))))


def large_square_without_meshes() -> hv.DiscreteProblem:
    return without_meshes(gallery.survey("5.1", 20, "right"))


def cube_without_meshes() -> hv.DiscreteProblem:
    return without_meshes(gallery.survey_cube("5.1", 8))


Make = Callable[[], hv.DiscreteProblem]
PROBLEMS = [survey_square, survey_cube, large_square_without_meshes, cube_without_meshes]


def held_somewhere(problem: hv.DiscreteProblem, seed: int = 4) -> tuple[np.ndarray, sp.csr_array]:
    """Some contact unknowns held, in runs and singly, and a stiffness at the points of the others."""
    unknown, _, active, point = contact_unknowns(problem.contact)
    rng = np.random.default_rng(seed)
    held = (rng.uniform(size=unknown.size) < 0.2) | (np.arange(unknown.size) < unknown.size // 3)
    blocks = rng.standard_normal((len(active), 3, 3))
    blocks = np.einsum("mij,mkj->mik", blocks, blocks) * problem.stiffness.diagonal().mean()
    place = np.zeros(unknown.size, dtype=int)
    for p in np.unique(point):
        own = np.flatnonzero(point == p)
        place[own] = np.arange(own.size)
    same = point[:, None] == point[None, :]
    dense = np.where(same, blocks[point[:, None], place[:, None], place[None, :]], 0.0)
    dense[held] = 0.0
    dense[:, held] = 0.0
    return held, sp.csr_array(dense)


def dense_truncated(problem: hv.DiscreteProblem, held: np.ndarray, added: sp.csr_array) -> np.ndarray:
    """The matrix that holding and adding stand for, with ones on the diagonal where held."""
    unknown = contact_unknowns(problem.contact)[0]
    matrix = problem.stiffness.toarray()
    matrix[np.ix_(unknown, unknown)] += added.toarray()
    out = unknown[held]
    matrix[out] = 0.0
    matrix[:, out] = 0.0
    matrix[out, out] = 1.0
    return matrix


@pytest.mark.parametrize("make", PROBLEMS)
def test_cycle_is_symmetric_positive_definite_and_leaves_held_unknowns_alone(
    make: Make,
) -> None:
    problem = make()
    hierarchy = ElasticMultigrid.of(problem)
    top = hierarchy.first + len(hierarchy.steps)
    held, added = held_somewhere(problem)
    truncated = Truncated(hierarchy.levels, top)
    truncated.change(held, added)
    unknown = contact_unknowns(problem.contact)[0]
    free = np.ones(problem.unknowns)
    free[unknown[held]] = 0.0
    rng = np.random.default_rng(0)
    vectors = [free * rng.standard_normal(problem.unknowns) for _ in range(4)]
    images = [truncated.cycle(top, v) for v in vectors]
    for v, image in zip(vectors, images, strict=True):
        assert not image[unknown[held]].any()
        assert v @ image > 0.0
        for w, other in zip(vectors, images, strict=True):
            assert v @ other == pytest.approx(w @ image, rel=1e-10, abs=1e-12 * abs(v @ image))


@pytest.mark.parametrize("make", PROBLEMS)
def test_conjugate_gradients_with_the_cycle_solve_the_truncated_equation(
    make: Make,
) -> None:
    problem = make()
    hierarchy = ElasticMultigrid.of(problem)
    top = hierarchy.first + len(hierarchy.steps)
    levels = Truncated(hierarchy.levels, top)
    held, added = held_somewhere(problem)
    levels.change(held, added)
    right = problem.load.copy()
    right[contact_unknowns(problem.contact)[0][held]] = 0.0
    found = conjugate_gradients(
        levels.matrix(top), levels.diagonal(top), right, lambda v: levels.cycle(top, v), 1e-11, 100
    )
    expected = np.linalg.solve(dense_truncated(problem, held, added), right)
    assert found.iterations <= 45
    np.testing.assert_allclose(found.solution, expected, atol=1e-8 * np.abs(expected).max())


def test_where_the_held_unknowns_end_costs_conjugate_gradients_next_to_nothing() -> None:
    """Coarse functions of all levels are kept there; without them it takes four iterations more than with none held."""
    problem = survey_square(64)
    hierarchy = ElasticMultigrid.of(problem)
    top = hierarchy.first + len(hierarchy.steps)
    unknown = contact_unknowns(problem.contact)[0]
    right = np.random.default_rng(2).standard_normal(problem.unknowns)

    def iterations(part: float, vanishing: bool = False) -> int:
        held = problem.contact.points.repeat(2, axis=0)[:, 0] <= part
        levels = Truncated(hierarchy.levels, top, vanishing)
        levels.change(held, sp.csr_array((held.size, held.size)))
        b = right.copy()
        b[unknown[held]] = 0.0
        found = conjugate_gradients(
            levels.matrix(top),
            levels.diagonal(top),
            b,
            lambda v: levels.cycle(top, v),
            1e-9 * float(np.linalg.norm(b)),
            60,
        )
        return found.iterations

    free = iterations(-1.0)
    ends = (0.3, 0.42, 0.5, 0.58, 0.7)
    assert max(iterations(end) for end in ends) <= free + 1
    assert max(iterations(end, vanishing=True) for end in ends) > free + 1


@pytest.mark.parametrize("make", [survey_square, survey_cube])
def test_what_is_added_acts_on_the_coarser_meshes_as_well(make: Make) -> None:
    problem = make()
    hierarchy = ElasticMultigrid.of(problem)
    top = hierarchy.first + len(hierarchy.steps)
    held, added = held_somewhere(problem)
    held[:] = False
    added = sp.csr_array(1e-3 * added)
    unknown = contact_unknowns(problem.contact)[0]
    levels = Truncated(hierarchy.levels, top)
    levels.change(held, added)
    change = np.zeros((problem.unknowns,) * 2)
    change[np.ix_(unknown, unknown)] = added.toarray()
    for k in range(top - 1, hierarchy.first - 1, -1):
        P = hierarchy.levels.transfers[k].prolongation.toarray()
        change = P.T @ change @ P
        found = (levels.matrix(k) - hierarchy.levels.matrix(k)).toarray()
        np.testing.assert_allclose(found, change, atol=1e-12 * np.abs(levels.matrix(k)).max())


def bits(matrix: sp.csr_array) -> bytes:
    return matrix.data.tobytes() + matrix.indices.tobytes() + matrix.indptr.tobytes()


@pytest.mark.parametrize("make", PROBLEMS)
def test_holding_unknowns_changes_no_matrix_of_the_hierarchy(make: Make) -> None:
    problem = make()
    levels = ElasticMultigrid.of(problem).levels
    top = len(levels.sizes) - 1
    vector = np.random.default_rng(1).standard_normal(problem.unknowns)
    before, cycled = [bits(levels.matrix(k)) for k in range(top + 1)], levels.cycle(top, vector)
    assert abs(levels.matrix(top) - problem.stiffness).max() == 0.0
    truncated = Truncated(levels, top)
    truncated.change(*held_somewhere(problem))
    assert np.abs(truncated.cycle(top, vector) - cycled).max() > 1e-6 * np.abs(cycled).max()
    assert [bits(levels.matrix(k)) for k in range(top + 1)] == before
    np.testing.assert_array_equal(levels.cycle(top, vector), cycled)
    # held once more, and then nothing: what it was held for before leaves no trace
    nothing = np.zeros(contact_unknowns(problem.contact)[0].size, dtype=bool)
    truncated.change(nothing, sp.csr_array((nothing.size, nothing.size)))
    size = np.abs(cycled).max()
    np.testing.assert_allclose(truncated.cycle(top, vector), cycled, rtol=1e-9, atol=1e-12 * size)


@pytest.mark.parametrize("make", [survey_square, survey_cube])
def test_the_coarsest_level_is_solved_alike_whatever_was_held_before(make: Make) -> None:
    problem = make()
    levels = ElasticMultigrid.of(problem).levels
    once, again = (Truncated(levels, len(levels.sizes) - 1) for _ in range(2))
    unknown = contact_unknowns(problem.contact)[0]
    for seed in (3, None, 5):
        held, added = held_somewhere(problem, seed or 4)
        if seed is None:  # all are free, and the root has the most columns
            held, added = np.zeros(unknown.size, dtype=bool), sp.csr_array((unknown.size, unknown.size))
        again.change(held, added)
        again.prepare()
    once.change(held, added)
    matrix = once.matrix(0)
    free = np.diff(matrix.indptr) > 0
    free[levels.levels[0].contact] = False
    vector = np.where(free, np.random.default_rng(2).standard_normal(free.size), 0.0)
    found = again.cycle(0, vector)
    np.testing.assert_array_equal(found, once.cycle(0, vector))
    np.testing.assert_allclose(matrix @ found, vector, atol=1e-9 * np.abs(vector).max())


@pytest.mark.parametrize("make", [survey_square, survey_cube])
def test_what_is_left_of_a_coarse_space_needs_no_new_matrix(make: Make) -> None:
    """Coarse functions that reach no held unknown have the Galerkin products of the coarse mesh."""
    problem = make()
    step = ElasticMultigrid.of(problem).steps[-1]
    held, _ = held_somewhere(problem)
    none = sp.csr_array((held.size, held.size))
    truncated = dense_truncated(problem, held, none)
    out = contact_unknowns(problem.contact)[0][held]
    P = step.prolongation.toarray()
    kept = ~np.any(P[out] != 0.0, axis=0)
    galerkin = (P.T @ truncated @ P)[np.ix_(kept, kept)]
    coarse = step.problem.stiffness.toarray()[np.ix_(kept, kept)]
    assert 0 < kept.sum() < kept.size
    np.testing.assert_allclose(galerkin, coarse, atol=1e-12 * np.abs(coarse).max())


@pytest.mark.parametrize("make", [large_square_without_meshes, cube_without_meshes])
def test_algebraic_levels_follow_the_galerkin_product(make: Make) -> None:
    problem = make()
    hierarchy = ElasticMultigrid.of(problem)
    assert hierarchy.first > 0
    assert not hierarchy.steps
    held, added = held_somewhere(problem)
    levels = Truncated(hierarchy.levels, hierarchy.first)
    levels.change(held, added)
    truncated = dense_truncated(problem, held, added)
    out = contact_unknowns(problem.contact)[0][held]
    P = hierarchy.levels.transfers[-1].prolongation.toarray()
    P[out] = 0.0
    expected = P.T @ truncated @ P
    found = levels.matrix(hierarchy.first - 1).toarray()
    reached = np.diagonal(expected) > 1e-12 * np.diagonal(expected).max()
    np.testing.assert_allclose(
        found[np.ix_(reached, reached)], expected[np.ix_(reached, reached)], atol=1e-10 * np.abs(expected).max()
    )


@pytest.mark.parametrize("make", PROBLEMS)
def test_linear_solve(make: Make) -> None:
    problem = make()
    found, cycles = ElasticMultigrid.of(problem).solve(problem.load, 1e-11)
    expected = spla.spsolve(sp.csc_array(problem.stiffness), problem.load)
    assert cycles <= 40
    np.testing.assert_allclose(found, expected, atol=1e-8 * np.abs(expected).max())


def test_hierarchy_serves_other_loads_and_laws() -> None:
    problem = survey_square()
    hierarchy = ElasticMultigrid.of(problem)
    other = problem.with_(
        law=hv.laws.ContactLaw(hv.Compliance(3.0).at(problem.contact.points), hv.Tresca(0.1).at(problem.contact.points))
    )
    step = hierarchy.steps[-1]
    below = step.on_coarse_mesh(other)
    assert below.stiffness is step.problem.stiffness
    np.testing.assert_allclose(below.law.normal.derivative(np.full(below.contact_points, 0.5)), 1.5)


# ---- conjugate gradients -----------------------------------------------------------------------------------


def test_negative_curvature_is_returned_as_a_way_down() -> None:
    matrix = sp.csr_array(np.diag([2.0, 1.0, -0.5]))
    b = np.array([1.0, 1.0, 0.3])
    found = conjugate_gradients(matrix, np.ones(3), b, lambda v: v.copy(), 1e-12, 10)
    assert found.negative is not None
    p = found.negative
    assert p @ (matrix @ p) < 0.0
    assert b @ p >= 0.0


def test_direction_without_curvature_is_found_out() -> None:
    matrix = sp.csr_array(np.array([[1.0, -1.0], [-1.0, 1.0]]))
    found = conjugate_gradients(matrix, np.ones(2), np.array([1.0, 1.0]), lambda v: v.copy(), 1e-12, 10)
    assert found.negative is not None
    np.testing.assert_allclose(found.negative / found.negative[0], [1.0, 1.0])


def test_early_end() -> None:
    rng = np.random.default_rng(2)
    root = rng.standard_normal((30, 30))
    matrix = sp.csr_array(root @ root.T + np.eye(30))
    b = rng.standard_normal(30)
    seen: list[int] = []

    def enough(iteration: int, x: np.ndarray) -> np.ndarray:
        seen.append(iteration)
        rest = b - matrix @ x
        return (0.999 if iteration < 4 else 1.001) * rest

    found = conjugate_gradients(matrix, matrix.diagonal(), b, lambda v: v.copy(), 1e-12, 100, enough)
    np.testing.assert_allclose(found.residual, b - matrix @ found.solution, atol=1e-9)
    assert found.iterations == 4
    assert seen == [1, 2, 3, 4]
    assert 0.5 * found.solution @ (matrix @ found.solution) - b @ found.solution < 0.0


def test_the_way_down_never_leads_against_the_load() -> None:
    """Whatever the preconditioner makes of it: after a step to (10, 0) its direction is (-2, 1), and b is (1, 1)."""
    answers = iter([np.array([1.0, 0.0]), np.array([-3.0, 1.0])])
    A, b = sp.csr_array(np.diag([0.1, -1.0])), np.array([1.0, 1.0])
    found = conjugate_gradients(A, np.abs(A.diagonal()), b, lambda _: next(answers), 1e-12, 5)
    assert found.negative is not None
    np.testing.assert_allclose(found.negative, [2.0, -1.0], rtol=1e-12)


def test_what_the_coarser_mesh_gives_is_held_against_the_load() -> None:
    """Where it meets the tolerance no cycle is left to do on the finest mesh."""
    problem = survey_square(32)
    levels, load = ElasticMultigrid.of(problem), problem.load
    first, cycles = levels.solve(load, 1e3)
    assert cycles == 0
    left = np.linalg.norm(load - problem.stiffness @ first) / np.linalg.norm(load)
    assert levels.solve(load, 1.001 * left)[1] == 0
    better, cycles = levels.solve(load, 0.999 * left)
    assert cycles > 0
    assert np.linalg.norm(load - problem.stiffness @ better) <= 0.999 * left * np.linalg.norm(load)


@pytest.mark.parametrize("make", [survey_square, survey_cube])
@pytest.mark.parametrize("factor", [0.0, 1e-2, -1e3])
def test_the_coarsest_level_is_inverted_as_it_is_after_the_change(
    make: Make, factor: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By what its contact unknowns change alone; where that is not positive definite, anew."""
    problem = make()
    hierarchy = ElasticMultigrid.of(problem)
    held, added = held_somewhere(problem)
    truncated, anew = Truncated(hierarchy.levels, hierarchy.first + len(hierarchy.steps)), []
    dense = Truncated._dense_root
    monkeypatch.setattr(Truncated, "_dense_root", lambda self: anew.append(self) or dense(self))
    truncated.change(held, sp.csr_array(factor * added))
    truncated.prepare()
    changed, root = truncated._changed[0], truncated._coarse
    out = changed.level.contact[changed.held]
    assert out.size
    assert bool(anew) == (factor < 0.0)
    assert changed.added.any() == (factor != 0.0)
    matrix = changed.matrix.toarray()
    matrix[:, out] = 0.0
    matrix[out, out] = 1.0
    assert root is not None
    if factor < 0.0:
        assert np.linalg.eigvalsh(matrix)[0] < 0.0
        assert np.linalg.matrix_rank(root) == len(matrix)
    else:
        np.testing.assert_allclose(root @ root.T @ matrix, np.eye(len(matrix)), atol=1e-9)
