"""Factorisations apart from some unknowns, against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.basics.types import Array, IntArray
from hemivar.fem.assembly import stiffness_matrix
from hemivar.linear import factorisation
from hemivar.linear.factorisation import Factorisation, SuperLUFactorisation, factorise
from hemivar.mechanics import Material
from hemivar.mesh import box, rectangle


def body(n: int, seed: int) -> sp.csr_array:
    """A symmetric positive definite matrix of n^2 places with two components each, stiffer here and there."""
    random = np.random.default_rng(seed)
    one = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    plane = sp.kron(one, sp.eye_array(n)) + sp.kron(sp.eye_array(n), one)
    both = sp.kron(plane, np.array([[2.0, 0.7], [0.7, 1.0]]))
    size = sp.diags_array(10.0 ** random.uniform(-2.0, 2.0, 2 * n * n))
    return sp.csr_array(size @ both @ size)


def made(matrix: sp.csr_array, kept: IntArray, many: bool) -> Factorisation:
    """The factorisation by SuperLU, whatever is installed."""
    return SuperLUFactorisation(matrix, kept, many)


@pytest.mark.parametrize("many", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_loads_go_to_the_kept_unknowns_and_back_as_in_dense_algebra(seed: int, many: bool) -> None:
    K, random = body(7, seed), np.random.default_rng(seed + 10)
    n = K.shape[0]
    kept = np.sort(random.choice(n, 12, replace=False)).astype(np.int64)
    others = np.setdiff1d(np.arange(n), kept)
    dense = K.toarray()
    inner, across = dense[np.ix_(others, others)], dense[np.ix_(others, kept)]
    size = np.sqrt(np.diagonal(dense))  # of what a force on it moves
    load, y = random.normal(size=n) * size, random.normal(size=kept.size) / size[kept]
    factor = made(K, kept, many)

    schur = dense[np.ix_(kept, kept)] - across.T @ np.linalg.solve(inner, across)
    scale = np.outer(size[kept], size[kept])
    np.testing.assert_allclose(factor.schur / scale, schur / scale, atol=1e-12)
    assert factor.interior_positive

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


def test_sweeps_leave_the_load_as_it_was() -> None:
    K = body(5, 0)
    kept = np.arange(0, 50, 7)
    load, y = np.ones(K.shape[0]), np.ones(kept.size)
    factor = made(K, kept, True)
    first = factor.reduce(load)
    inner = np.array(first.inner)
    answers: list[Array] = [factor.extend(first, y) for _ in range(2)]
    np.testing.assert_array_equal(answers[0], answers[1])
    np.testing.assert_array_equal(first.inner, inner)
    np.testing.assert_array_equal(load, 1.0)
    np.testing.assert_array_equal(y, 1.0)


def test_an_indefinite_interior_is_noticed() -> None:
    K = body(5, 1)
    kept = np.arange(3)
    K[20, 20] = -K[20, 20]
    assert not made(sp.csr_array(K), kept, True).interior_positive


def test_a_body_without_kept_unknowns_is_solved_by_both_sweeps() -> None:
    K = body(6, 2)
    load = np.sqrt(K.diagonal())
    factor = factorise(K, np.zeros(0, dtype=np.int64), many=True)
    np.testing.assert_allclose(K @ factor.solve_interior(load) / load, 1.0, atol=1e-10)


@pytest.mark.parametrize(("dim", "order", "swept"), [(2, 1, True), (2, 2, True), (3, 1, False)])
def test_many_loads_in_the_plane_go_by_halves_whatever_is_installed(
    dim: int, order: int, swept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those of SuperLU, where MUMPS is there: its whole solve takes longer."""
    mesh = rectangle((1.0, 1.0), 12) if dim == 2 else box((1.0, 1.0, 1.0), 7)
    K = stiffness_matrix(mesh, Material.lame(4.0, 4.0), order)
    K = sp.csr_array(K + 1e-3 * sp.eye_array(K.shape[0]))
    monkeypatch.setattr(factorisation, "mumps_available", lambda: True)
    monkeypatch.setattr(factorisation, "MumpsFactorisation", lambda matrix, kept: "whole")
    none = np.zeros(0, dtype=np.int64)
    assert factorise(K, none) == "whole"
    assert isinstance(factorise(K, none, many=True), SuperLUFactorisation) is swept
