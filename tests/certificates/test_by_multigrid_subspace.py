"""The best vectors in a span, whatever the vectors that span it."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp

from hemivar.certificates.by_multigrid import Subspace


@pytest.mark.parametrize("seed", range(8))
def test_vectors_that_depend_on_one_another_add_nothing(seed: int) -> None:
    """Ritz values of a span by dense linear algebra, whether a vector is given once, twice or is a sum of others."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(8, 8))
    K, S, sign = root @ root.T + np.eye(8), rng.normal(size=(5, 8)), np.array([1.0, 1.0, -1.0, 1.0, 1.0])
    X = rng.normal(size=(8, 3))
    expected = la.eigh(X.T @ S.T @ (sign[:, None] * S) @ X, X.T @ K @ X, eigvals_only=True)[::-1]
    for given in (X, np.hstack([X, X]), np.hstack([X, X @ [[1.0], [2.0], [-1.0]]]), 1e6 * X):
        found = Subspace(sp.csr_array(K), lambda R: la.solve(K, R), sp.csr_array(S), sign, given, count=2)
        assert found.values == pytest.approx(expected[:2], rel=1e-9)
        assert found.negative is None
        np.testing.assert_allclose(found.X.T @ K @ found.X, np.eye(2), atol=1e-9)


def test_a_vector_along_which_the_matrix_is_negative_is_told() -> None:
    K = np.diag([1.0, 2.0, -0.5])
    found = Subspace(sp.csr_array(K), lambda R: R, sp.csr_array(np.eye(3)), np.ones(3), np.eye(3))
    assert found.negative is not None
    assert found.negative @ K @ found.negative < 0.0


@pytest.mark.parametrize("part", [0.02, 0.1, 0.3])
def test_what_the_largest_value_is_short_of_is_not_more_than_is_told(part: float) -> None:
    """The eigenvalue 0.8 is not in the span, 0.75 is taken for the second: half the gap is less than the true one."""
    eigenvalues, one = np.array([1.0, 0.8, 0.75, 0.0]), np.eye(4)
    X = np.column_stack([one[0] + part * one[1], one[2]])
    found = Subspace(
        sp.csr_array(one), lambda R: R, sp.csr_array(np.diag(np.sqrt(eigenvalues))), np.ones(4), X, count=2
    )
    told = found.improve(1.0, 0, 1e-3)
    assert found.values == pytest.approx([(1.0 + 0.8 * part**2) / (1.0 + part**2), 0.75])
    assert found.values[0] + told >= 1.0
