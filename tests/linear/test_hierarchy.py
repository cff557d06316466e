"""Hierarchies of matrices that come from anywhere, as preconditioners of SciPy's iterations."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
import scipy.sparse.linalg as spla

import hemivar as hv
from hemivar import gallery
from hemivar.fem.near_kernel import near_kernel, node_slots
from hemivar.linear import Hierarchy
from hemivar.systems.body_on_levels import ElasticMultigrid


def laplacian(n: int) -> sp.csr_array:
    """The five-point matrix on n times n interior points, which is positive definite."""
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=(-1, 0, 1), shape=(n, n))
    return sp.csr_array(sp.kron(line, sp.eye_array(n)) + sp.kron(sp.eye_array(n), line))


def interpolation(n: int) -> sp.csr_array:
    """From (n - 1) / 2 to n interior points along each side, linear along each."""
    line = sp.lil_array((n, (n - 1) // 2))
    for k in range(line.shape[1]):
        line[2 * k : 2 * k + 3, k] = [[0.5], [1.0], [0.5]]
    return sp.csr_array(sp.kron(line, line))


def iterations(A: sp.csr_array, b: np.ndarray, hierarchy: Hierarchy | None) -> tuple[np.ndarray, int]:
    """The solution of ``A x = b`` by SciPy's conjugate gradients, and how many steps they took."""
    steps = 0

    def count(_: np.ndarray) -> None:
        nonlocal steps
        steps += 1

    M = None if hierarchy is None else hierarchy.aspreconditioner()
    x, failed = spla.cg(A, b, rtol=1e-10, M=M, maxiter=2000, callback=count)
    assert not failed
    return x, steps


@pytest.mark.parametrize("geometric", [False, True], ids=["algebraic", "given transfers"])
def test_conjugate_gradients_of_scipy_converge_with_the_preconditioner(geometric: bool) -> None:
    """The answer is a sum of two eigenvectors, whose eigenvalues are known."""
    n = 63
    A = laplacian(n)
    transfers = [interpolation(n), interpolation(31)] if geometric else []
    hierarchy = Hierarchy.of(A, transfers)
    t = np.pi * np.arange(1, n + 1) / (n + 1)

    def wave(j: int, k: int) -> np.ndarray:
        return np.kron(np.sin(j * t), np.sin(k * t))

    def eigenvalue(j: int, k: int) -> float:
        return float(4.0 - 2.0 * np.cos(j * t[0]) - 2.0 * np.cos(k * t[0]))

    exact = wave(1, 2) + 0.3 * wave(17, 40) + 1e-3 * wave(60, 3)
    b = eigenvalue(1, 2) * wave(1, 2) + 0.3 * eigenvalue(17, 40) * wave(17, 40) + 1e-3 * eigenvalue(60, 3) * wave(60, 3)
    b += A @ np.cos(np.arange(n * n))  # so that the space of the iteration is no small one
    exact += np.cos(np.arange(n * n))
    x, steps = iterations(A, b, hierarchy)
    assert steps <= 20
    assert steps < iterations(A, b, None)[1] / 4
    np.testing.assert_allclose(x, exact, atol=1e-7 * np.abs(exact).max())


def test_levels_are_galerkin_products_of_the_given_transfers() -> None:
    A = laplacian(31)
    hierarchy = Hierarchy.of(A, [interpolation(31)])
    fine, coarse = hierarchy.levels
    assert coarse.P is None
    assert coarse.R is None
    P = interpolation(31).toarray()
    assert fine.P is not None
    assert fine.R is not None
    np.testing.assert_array_equal(fine.A.toarray(), A.toarray())
    np.testing.assert_array_equal(fine.P.toarray(), P)
    np.testing.assert_array_equal(fine.R.toarray(), P.T)
    np.testing.assert_allclose(coarse.A.toarray(), P.T @ A.toarray() @ P, atol=1e-14)


def test_the_preconditioner_is_symmetric_and_positive() -> None:
    M = Hierarchy.of(laplacian(31)).aspreconditioner()
    v, w = np.random.default_rng(0).standard_normal((2, 31 * 31))
    assert v @ (M @ w) == pytest.approx(w @ (M @ v), rel=1e-10)
    assert v @ (M @ v) > 0.0
    np.testing.assert_array_equal(M.rmatvec(v), M.matvec(v))


def test_a_body_of_a_mesh_and_its_matrix_alone() -> None:
    """Elasticity by its meshes, and by the matrix with its rigid motions: both precondition."""
    problem = hv.discretize(gallery.survey("5.1", 32, "right"))
    by_meshes = ElasticMultigrid.of(problem)
    alone = Hierarchy.of(
        problem.stiffness, near=near_kernel(problem.field), slots=[node_slots(problem.field, problem.stiffness)]
    )
    sizes = [level.A.shape[0] for level in by_meshes.hierarchy.levels]
    assert sizes[0] == problem.unknowns
    assert sizes == sorted(sizes, reverse=True)
    expected = spla.spsolve(sp.csc_array(problem.stiffness), problem.load)
    for hierarchy in (by_meshes.hierarchy, alone):
        x, steps = iterations(problem.stiffness, problem.load, hierarchy)
        assert steps <= 35
        np.testing.assert_allclose(x, expected, atol=1e-8 * np.abs(expected).max())
