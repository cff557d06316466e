"""Factorisations apart from some unknowns, against dense algebra."""

from __future__ import annotations

import pickle
import resource
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.fem.assembly import stiffness_matrix
from hemivar.kernels import kernels
from hemivar.linear import factorisation
from hemivar.linear.condensed_load import CondensedLoad
from hemivar.linear.factorisation import Factorisation, PanelSweeps, SuperLUFactorisation, factorise
from hemivar.linear.pardiso import PardisoFactorisation, pardiso_available
from hemivar.mechanics import Material
from hemivar.mesh import box, rectangle


def random_stiffness(n: int, seed: int) -> sp.csr_array:
    """A symmetric positive definite matrix of n^2 places with two components each, stiffer here and there."""
    random = np.random.default_rng(seed)
    one = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    plane = sp.kron(one, sp.eye_array(n)) + sp.kron(sp.eye_array(n), one)
    both = sp.kron(plane, np.array([[2.0, 0.7], [0.7, 1.0]]))
    size = sp.diags_array(10.0 ** random.uniform(-2.0, 2.0, 2 * n * n))
    return sp.csr_array(size @ both @ size)


def by_superlu(matrix: sp.csr_array, kept: IntArray, many: bool) -> Factorisation:
    """The factorisation by SuperLU, whatever is installed."""
    return SuperLUFactorisation(matrix, kept, many)


needs_pardiso = pytest.mark.skipif(not pardiso_available(), reason="pypardiso is not installed")


@pytest.fixture(params=["one load", "without kernels", "halves"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Whole solves, also where the kernels are not there for many loads, and the sweeps of these."""
    if request.param == "halves" and kernels() is None:
        pytest.skip("the kernels are not compiled here")
    monkeypatch.setenv("HEMIVAR_KERNELS", "auto" if request.param == "halves" else "none")
    kernels.cache_clear()
    yield request.param
    monkeypatch.undo()
    kernels.cache_clear()


@pytest.mark.parametrize("seed", range(3))
def test_loads_go_to_the_kept_unknowns_and_back_as_in_dense_algebra(seed: int, way: str) -> None:
    check_loads(seed, lambda matrix, kept: by_superlu(matrix, kept, way != "one load"), random_stiffness(7, seed))


@needs_pardiso
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("definite", [True, False])
def test_pardiso_takes_loads_there_and_back_too(seed: int, definite: bool) -> None:
    """Also where the matrix has negative eigenvalues."""
    K = random_stiffness(7, seed)
    if not definite:
        K = sp.csr_array(K - 0.3 * sp.diags_array(K.diagonal()))
    check_loads(seed, PardisoFactorisation, K, definite)


@needs_pardiso
def test_pardiso_refuses_vectors_of_another_size() -> None:
    factor = PardisoFactorisation(random_stiffness(6, 1), np.array([3, 8, 20]))
    with pytest.raises(ValueError, match="numbers is needed"):
        factor.reduce(np.ones(5))


@needs_pardiso
def test_what_a_load_leaves_has_one_form_in_both_factorisations() -> None:
    """The way back of kept values alone begins with zeros for all other unknowns, whoever factorises."""
    K, kept = random_stiffness(6, 1), np.array([3, 8, 20])
    n = K.shape[0]
    nothing = CondensedLoad(np.zeros(n), np.zeros(kept.size), 0.0, np.zeros(n - kept.size))
    values = np.array([1.0, -2.0, 0.5])
    ways = [factor.extend(nothing, values) for factor in (PardisoFactorisation(K, kept), by_superlu(K, kept, True))]
    np.testing.assert_allclose(*ways, atol=1e-12)


@needs_pardiso
@pytest.mark.parametrize("definite", [True, False])
def test_pardiso_solves_without_kept_unknowns(definite: bool) -> None:
    K = random_stiffness(6, 2)
    K = K if definite else sp.csr_array(K - 0.3 * sp.diags_array(K.diagonal()))
    load = np.sqrt(K.diagonal())
    factor = PardisoFactorisation(K, np.zeros(0, dtype=np.int64))
    assert factor.interior_positive is definite
    np.testing.assert_allclose(K @ factor.solve_interior(load) / load, 1.0, atol=1e-9)


@needs_pardiso
def test_pardiso_keeps_everything_where_all_is_asked_for() -> None:
    K = random_stiffness(2, 0)
    factor = PardisoFactorisation(K, np.arange(8))
    np.testing.assert_array_equal(factor.schur, K.toarray())
    np.testing.assert_array_equal(factor.extend(factor.reduce(np.ones(8)), np.arange(8.0)), np.arange(8.0))


@needs_pardiso
def test_pardiso_refuses_a_body_that_moves_freely() -> None:
    one = sp.diags_array([-np.ones(39), np.r_[1.0, np.full(38, 2.0), 1.0], -np.ones(39)], offsets=[-1, 0, 1])
    both = sp.csr_array(sp.block_diag([one, random_stiffness(3, 0)]))
    with pytest.raises(ProblemError, match="can move freely"):
        PardisoFactorisation(both, np.arange(40, 44))


def check_loads(
    seed: int, factorisation: Callable[[sp.csr_array, IntArray], Factorisation], K: sp.csr_array, definite: bool = True
) -> None:
    random = np.random.default_rng(seed + 10)
    n = K.shape[0]
    kept = np.sort(random.choice(n, 12, replace=False)).astype(np.int64)
    others = np.setdiff1d(np.arange(n), kept)
    dense = K.toarray()
    inner, across = dense[np.ix_(others, others)], dense[np.ix_(others, kept)]
    size = np.sqrt(np.diagonal(dense))  # of what a force on it moves
    load, y = random.normal(size=n) * size, random.normal(size=kept.size) / size[kept]
    factor = factorisation(K, kept)

    schur = dense[np.ix_(kept, kept)] - across.T @ np.linalg.solve(inner, across)
    scale = np.outer(size[kept], size[kept])
    np.testing.assert_allclose(factor.schur / scale, schur / scale, atol=1e-12)
    assert factor.interior_positive is definite

    reduced = factor.reduce(load)
    moved = np.linalg.solve(inner, load[others])
    np.testing.assert_allclose(reduced.force / size[kept], (load[kept] - across.T @ moved) / size[kept], atol=1e-11)
    assert reduced.work == pytest.approx(load[others] @ moved, rel=1e-11)

    for _ in range(2):  # nothing of a load is left behind
        x = factor.extend(reduced, y)
        np.testing.assert_array_equal(x[kept], y)
        np.testing.assert_allclose((x * size)[others], np.linalg.solve(inner, load[others] - across @ y) * size[others],
                                   atol=1e-11)  # fmt: skip
        np.testing.assert_allclose((factor.solve_interior(load) * size)[others], moved * size[others], atol=1e-11)
        assert not factor.solve_interior(load)[kept].any()


def test_solves_leave_the_load_as_it_was(way: str) -> None:
    K = random_stiffness(5, 0)
    kept = np.arange(0, 50, 7)
    load, y = np.ones(K.shape[0]), np.ones(kept.size)
    factor = by_superlu(K, kept, way != "one load")
    assert isinstance(factor, SuperLUFactorisation)
    assert (factor._halves is not None) is (way == "halves")
    first = factor.reduce(load)
    inner = np.array(first.inner)
    answers: list[Array] = [factor.extend(first, y) for _ in range(2)]
    np.testing.assert_array_equal(answers[0], answers[1])
    np.testing.assert_array_equal(first.inner, inner)
    np.testing.assert_array_equal(load, 1.0)
    np.testing.assert_array_equal(y, 1.0)


def test_an_indefinite_interior_is_noticed() -> None:
    K = random_stiffness(5, 1)
    kept = np.arange(3)
    K[20, 20] = -K[20, 20]
    assert not by_superlu(sp.csr_array(K), kept, True).interior_positive


def test_a_body_without_kept_unknowns_is_solved_by_both_sweeps() -> None:
    K = random_stiffness(6, 2)
    load = np.sqrt(K.diagonal())
    factor = factorise(K, np.zeros(0, dtype=np.int64), many=True)
    np.testing.assert_allclose(K @ factor.solve_interior(load) / load, 1.0, atol=1e-10)


@pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")
@pytest.mark.parametrize(("dim", "order", "swept"), [(2, 1, True), (2, 2, True), (3, 1, False)])
def test_many_loads_in_the_plane_go_by_halves_whatever_is_installed(
    dim: int, order: int, swept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of SuperLU, where PARDISO is there: its sweeps take longer."""
    mesh = rectangle((1.0, 1.0), 12) if dim == 2 else box((1.0, 1.0, 1.0), 7)
    K = stiffness_matrix(mesh, Material.lame(4.0, 4.0), order)
    K = sp.csr_array(K + 1e-3 * sp.eye_array(K.shape[0]))
    monkeypatch.setattr(factorisation, "pardiso_available", lambda: True)
    monkeypatch.setattr(factorisation, "PardisoFactorisation", lambda matrix, kept: "whole")
    none = np.zeros(0, dtype=np.int64)
    assert factorise(K, none) == "whole"
    assert isinstance(factorise(K, none, many=True), SuperLUFactorisation) is swept


def triangle(seed: int) -> sp.csc_array:
    """The first columns of a unit lower triangle: runs of columns that share their rows, and others."""
    random = np.random.default_rng(seed)
    n, count = 90, 70
    L, j = np.eye(n), 0
    while j < count:
        width = min(int(random.integers(1, 14)), count - j)
        below = np.flatnonzero(random.uniform(size=n) < 0.2)
        for k in range(j, j + width):
            L[k + 1 : j + width, k] = random.normal(size=j + width - k - 1)
            rows = below[below >= j + width]
            L[rows, k] = random.normal(size=rows.size)
        j += width
    found = sp.csc_array(L[:, :count])
    found.indices, found.indptr = found.indices.astype(np.int32), found.indptr.astype(np.int32)
    return found


@pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")
@pytest.mark.parametrize("seed", range(4))
def test_sweeps_by_panels_solve_with_the_triangle_and_its_transpose(seed: int) -> None:
    columns = triangle(seed)
    n, count = columns.shape
    L = np.eye(n)
    L[:, :count] = columns.toarray()
    b, compiled = np.random.default_rng(seed).normal(size=n), kernels()
    assert compiled is not None
    sweeps = PanelSweeps(compiled, columns)
    for solve, matrix in ((sweeps.forward, L), (sweeps.backward, L.T)):
        x = b.copy()
        solve(x)
        np.testing.assert_allclose(matrix @ x, b, atol=1e-12 * np.abs(x).max())


@pytest.mark.skipif(kernels() is None, reason="the kernels are not compiled here")
def test_wrong_triangles_are_refused_at_the_door() -> None:
    compiled = kernels()
    assert compiled is not None
    for change in (
        "L.indptr = L.indptr.astype(np.int64)",
        "L.indices = L.indices.astype(np.int64)",
        "L.data = L.data.astype(np.float32)",
        "L.data = L.data[:-1]",
        "L.data = np.repeat(L.data, 2)[::2]",
        "L.indices[0] = 1",
        "L.indices[-1] = 90",
        "L.indices[-1] = -1",
        "L.indices[1:3] = L.indices[1:3][::-1]",
        "L.indptr[-1] += 1",
        "L.indptr[0] = 1",
        "L.indptr[4] = L.indptr[3]",
        "L.indptr = L.indptr[:-1]",
        "L.indptr[2] = 10**6",
    ):
        L = triangle(0)
        assert L.indptr[1] > 2
        exec(change, {"L": L, "np": np})
        with pytest.raises(ValueError, match="triangle"):
            PanelSweeps(compiled, L)
    sweeps = PanelSweeps(compiled, triangle(0))
    for wrong in (np.zeros(89), np.zeros(90, dtype=np.float32), np.zeros(180)[::2], np.zeros((90, 1))):
        with pytest.raises(ValueError, match="vector of 90"):
            sweeps.forward(wrong)
        with pytest.raises(ValueError, match="vector of 90"):
            sweeps.backward(wrong)
    with pytest.raises(TypeError, match="this process"):
        pickle.dumps(sweeps)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux's count of pages")
def test_memory_of_factors_is_given_back() -> None:
    """SciPy gives it back in the thread that made them only, and large ones are made beside the main thread."""

    def used() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()

    matrix = sp.csr_array(sp.kronsum(sp.kronsum(line(20), line(20)), line(20)))
    kept = np.arange(40)
    factors = SuperLUFactorisation(matrix, kept)
    size = 12 * (factors._factor.triangles()[0].nnz * 2)  # type: ignore[union-attr]
    del factors
    began = used()
    for _ in range(5):
        SuperLUFactorisation(matrix, kept)
    time.sleep(0.1)
    assert size > 20e6
    assert used() - began < 1.5 * size


def line(count: int) -> sp.csr_array:
    """Second differences, and one more on the diagonal."""
    return sp.csr_array(sp.diags_array([-1.0, 3.0, -1.0], offsets=[-1, 0, 1], shape=(count, count)))
