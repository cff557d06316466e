"""Matrices in directions of nodes: what they answer to few unknowns."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp

from hemivar.fem.directed_matrix import directed_matrix


@pytest.mark.parametrize("units", [1e-6, 1.0, 1e9])
@pytest.mark.parametrize("seen", [1, 4, 12])
def test_answers_are_those_of_the_inverse(seen: int, units: float) -> None:
    """A chain of blocks of which some directions are held, seen at a few nodes or at all of them."""
    rng = np.random.default_rng(seen)
    nodes = np.column_stack([np.arange(11), np.arange(1, 12)])
    roots = rng.normal(size=(11, 6, 6))
    held = np.zeros((12, 3, 3))
    held[0] = np.eye(3)
    direction = np.array([0.6, 0.0, 0.8])
    held[5] = np.outer(direction, direction)
    system = directed_matrix(units * (roots @ roots.transpose(0, 2, 1) + np.eye(6)), nodes, held)
    at = rng.permutation(12)[:seen, None]
    rows = system.rows(at, rng.normal(size=(seen, 2, 1, 3)))
    expected = rows @ np.linalg.inv(system.matrix.toarray()) @ rows.T
    np.testing.assert_allclose(system.answers(rows), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_rows_without_unknowns_answer_nothing() -> None:
    held = np.zeros((2, 2, 2))
    held[0] = np.eye(2)
    system = directed_matrix(np.eye(4)[None], np.array([[0, 1]]), held)
    rows = system.rows(np.array([[0]]), np.ones((1, 1, 1, 2)))
    assert sp.issparse(rows)
    assert system.answers(rows).tolist() == [[0.0]]
