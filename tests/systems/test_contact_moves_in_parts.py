"""A body in parts decides as a whole one does: two threads that hold half of the contact points each, against one."""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

import hemivar as hv
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.vectors import WHOLE, Vectors
from hemivar.systems.contact_moves import best_component, diagonal_step, majorant, snap_to_kinks

PARTS = 2


class Part:
    """What one of several threads asks the others, as :class:`Vectors` has it."""

    alone = False

    def __init__(self, number: int, board: list[Any], barrier: threading.Barrier) -> None:
        self._number, self._board, self._barrier = number, board, barrier

    def _everywhere(self, own: object) -> list[Any]:
        self._board[self._number] = own
        self._barrier.wait(20)
        told = list(self._board)
        self._barrier.wait(20)
        return told

    def total(self, *values: float) -> Array:
        return np.sum(self._everywhere(values), axis=0, dtype=float)

    def largest(self, *values: float) -> Array:
        found = np.max(self._everywhere(values), axis=0)
        return np.where(np.isnan(found), np.inf, found)

    def norms(self, *vectors: Array) -> Array:
        return np.linalg.norm(self._everywhere([np.linalg.norm(vector) for vector in vectors]), axis=0)

    def lowest(self, value: float) -> tuple[float, bool]:
        told = self._everywhere(value)
        return min(told), told.index(min(told)) == self._number

    def before(self, count: int) -> int:
        return sum(self._everywhere(count)[: self._number])


def in_parts(work: Callable[[Vectors, int], Any]) -> list[Any]:
    """The answers of all threads."""
    board: list[Any] = [None] * PARTS
    barrier = threading.Barrier(PARTS)
    with ThreadPoolExecutor(PARTS) as pool:
        futures = [pool.submit(work, Part(number, board, barrier), number) for number in range(PARTS)]
        return [future.result(30) for future in futures]


@dataclass(frozen=True, eq=False)
class Points:
    """Contact points that only their neighbours in the same part couple to."""

    vectors: Vectors
    law: hv.laws.ContactLaw
    weights: Array
    matrix: Array
    active: BoolArray
    fixed: Array

    @property
    def diagonal(self) -> Array:
        diagonal = np.diagonal(self.matrix).reshape(self.active.shape).copy()
        diagonal[:, 1:] = diagonal[:, 1:].max(axis=1, keepdims=True)
        return diagonal

    @property
    def lambda_max(self) -> float:
        return majorant(self.vectors, self.active, self.diagonal, self.couple)

    @property
    def blocks(self) -> Array:
        m, d = self.active.shape
        return np.asarray(self.matrix.reshape(m, d, m, d)[np.arange(m), :, np.arange(m), :])

    def couple(self, step: Array) -> Array:
        return (self.matrix @ step.ravel()).reshape(step.shape)


M, D = 24, 3
HALVES = [np.arange(M // 3), np.arange(M // 3, M)]


def whole(normal: hv.laws.Superpotential) -> tuple[Points, Array, Array]:
    """Points, local displacements and forces; the second part is the stiffer one, and has more of them."""
    rng = np.random.default_rng(6)
    blocks = []
    for number, own in enumerate(HALVES):
        root = rng.standard_normal((own.size * D, own.size * D))
        blocks.append((1.0 + 30.0 * number) * (root @ root.T / own.size + np.eye(own.size * D)))
    law = hv.laws.ContactLaw(normal, hv.Tresca(rng.uniform(0.1, 0.5, M)))
    matrix = sp.block_diag(blocks).toarray()
    body = Points(WHOLE, law, rng.uniform(0.5, 2.0, M), matrix, np.ones((M, D), dtype=bool), np.zeros((M, D)))
    return body, 0.1 * rng.standard_normal((M, D)), rng.standard_normal((M, D))


def part(body: Points, own: IntArray, vectors: Vectors) -> Points:
    rows = (own[:, None] * D + np.arange(D)).ravel()
    matrix = body.matrix[np.ix_(rows, rows)]
    return Points(vectors, body.law.take(own), body.weights[own], matrix, body.active[own], body.fixed[own])


@pytest.mark.parametrize("normal", [hv.Compliance(5.0), hv.Softening(40.0, 0.02, 20.0)], ids=["convex", "softening"])
def test_contact_moves(normal: hv.laws.Superpotential) -> None:
    body, r, force = whole(normal)
    stiff = body.lambda_max
    move, (best, gained) = diagonal_step(body, r, force, 0.1), best_component(body, r, force)
    assert move.tries > 1
    near = snap_to_kinks(body, np.where(np.arange(M)[:, None] == M - 1, 1e5, 1e-8) * r)

    def work(vectors: Vectors, number: int) -> tuple[Any, ...]:
        own = HALVES[number]
        mine = part(body, own, vectors)
        moved, (point, least) = diagonal_step(mine, r[own], force[own], 0.1), best_component(mine, r[own], force[own])
        scale = np.where(own[:, None] == M - 1, 1e5, 1e-8)
        return mine.lambda_max, moved, point, least, snap_to_kinks(mine, scale * r[own])

    for own, (found, moved, point, least, close) in zip(HALVES, in_parts(work), strict=True):
        assert found == pytest.approx(stiff, rel=1e-9)
        assert (moved.tries, moved.factor) == (move.tries, move.factor)
        assert moved.energy_change == pytest.approx(move.energy_change, rel=1e-12)
        np.testing.assert_allclose(moved.r, move.r[own], rtol=1e-12)
        assert least == gained
        np.testing.assert_array_equal(point, best[own])
        np.testing.assert_array_equal(close, near[own])


def test_a_target_that_is_not_finite_in_one_part_is_unbounded_in_all() -> None:
    body, r, force = whole(hv.Compliance(5.0))
    force[-1, 0] = np.inf

    def work(vectors: Vectors, number: int) -> bool:
        own = HALVES[number]
        return diagonal_step(part(body, own, vectors), r[own], force[own], 1.0).unbounded

    assert in_parts(work) == [True, True]


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["definite", "indefinite in one part"])
def test_conjugate_gradients(sign: float) -> None:
    body, _, force = whole(hv.Compliance(5.0))
    matrix = body.matrix.copy()
    matrix[-1, -1] *= sign
    diagonal, right = np.abs(np.diagonal(matrix)), force.ravel()
    expected = conjugate_gradients(sp.csr_array(matrix), diagonal, right, lambda v: v / diagonal, 1e-9, 200)

    def work(vectors: Vectors, number: int) -> Any:
        rows = (HALVES[number][:, None] * D + np.arange(D)).ravel()
        own, scale = sp.csr_array(matrix[np.ix_(rows, rows)]), diagonal[rows]
        return conjugate_gradients(own, scale, right[rows], lambda v: v / scale, 1e-9, 200, vectors=vectors)

    one, other = in_parts(work)
    assert one.iterations == other.iterations == pytest.approx(expected.iterations, abs=2)
    assert (one.negative is None) == (other.negative is None) == (expected.negative is None) == (sign > 0.0)
    if sign > 0.0:
        found = np.concatenate([one.solution, other.solution])
        np.testing.assert_allclose(found, expected.solution, atol=1e-9)


def test_whole_vectors() -> None:
    np.testing.assert_array_equal(WHOLE.largest(1.0, np.nan), [1.0, np.inf])
    np.testing.assert_allclose(WHOLE.norms(np.full(4, 1e200), np.zeros(0)), [2e200, 0.0])
    assert WHOLE.lowest(3.0) == (3.0, True)
    assert WHOLE.before(7) == 0


def test_all_tangential_components_of_a_point_move_together() -> None:
    """The lowest energy of the slip of one point, a vector, by hand.

    With stiffness k, force f and friction h it slips by ``(|f| - h w) / k`` along f: ``(|f| - h w)^2 / (2 k)`` less.
    """
    k, w, h = 8.0, 0.5, 0.6
    force = np.array([[0.0, 0.3, 0.4], [0.0, -0.9, 1.2]])
    law = hv.laws.ContactLaw(hv.Signorini(), hv.Tresca(np.full(2, h)))
    free = np.ones((2, 3), dtype=bool)
    body = Points(WHOLE, law, np.full(2, w), k * np.eye(6), free, np.zeros((2, 3)))
    moved, gained = best_component(body, np.zeros((2, 3)), force)
    np.testing.assert_allclose(moved, [[0.0, 0.0, 0.0], [0.0, -0.6 * 1.2 / k, 0.8 * 1.2 / k]], rtol=1e-12)
    assert gained == pytest.approx(-(1.2**2) / (2.0 * k), rel=1e-12)
