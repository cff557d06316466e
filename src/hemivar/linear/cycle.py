"""The levels of a discrete problem, and linear elastic solves on them."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.discrete.problem import DiscreteProblem
from hemivar.fem.hierarchy import Coarser, coarser
from hemivar.linear.algebraic import algebraic_levels
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import COARSEST, Levels, Transfer
from hemivar.linear.threads import one_thread

__all__ = ["ElasticMultigrid", "contact_unknowns", "selects"]

_NESTED = 1e-3
_ITERATIONS = 100


@dataclass(frozen=True, eq=False)
class ElasticMultigrid:
    """A hierarchy of discrete problems with the matrices of all its levels; nothing in it changes.

    Attributes
    ----------
    steps : tuple of Coarser
        From coarse to fine: ``steps[k]`` holds the problem on mesh k and leads to mesh k + 1.
    levels : Levels
        The matrices, with algebraic ones below that of the coarsest mesh where that is large.
    first : int
        Level of the coarsest mesh.
    seconds : float
        Spent on setting up.
    """

    steps: tuple[Coarser, ...]
    levels: Levels
    first: int
    seconds: float

    @staticmethod
    def of(problem: DiscreteProblem) -> ElasticMultigrid:
        """The hierarchy of a problem; it serves every other load, gap and law of the same body as well."""
        began = time.perf_counter()
        chain: list[Coarser] = []
        coarsest = problem
        while coarsest.unknowns > COARSEST:
            step = coarser(coarsest)
            if step is None:
                break
            chain.insert(0, step)
            coarsest = step.problem
        problems = [step.problem for step in chain] + [problem]
        below = algebraic_levels(coarsest) if coarsest.unknowns > COARSEST else []
        nothing = np.zeros(0, dtype=np.int64)
        parts = [contact_unknowns(p) if selects(p.contact.trace) else (nothing,) * 4 for p in problems]
        levels = Levels(
            [matrix for matrix, _ in below] + [p.stiffness for p in problems],
            [transfer for _, transfer in below] + [Transfer.of(step.prolongation) for step in chain],
            [nothing] * len(below) + [part[0] for part in parts],
            [nothing] * len(below) + [part[3] for part in parts],
            len(below),
        )
        return ElasticMultigrid(tuple(chain), levels, len(below), time.perf_counter() - began)

    def solve(self, load: Array, tolerance: float = 1e-10, nested: bool = True) -> tuple[Array, int]:
        """``K^-1 load`` by conjugate gradients with a multigrid cycle, none of the contact laws acting.

        Parameters
        ----------
        load : array (n,)
        tolerance : float
            Of the residual, relative to the 2-norm of the load.
        nested : bool
            Start from the solution on the next coarser mesh.

        Returns
        -------
        solution : array (n,)
        cycles : int
            On the finest mesh.
        """
        with one_thread():
            return self._solve(len(self.steps), load, tolerance, nested)

    def _solve(self, k: int, load: Array, tolerance: float, nested: bool) -> tuple[Array, int]:
        top = self.first + k
        x = np.zeros_like(load)
        if nested and k:
            prolongation = self.levels.transfers[top - 1].prolongation
            x = prolongation @ self._solve(k - 1, prolongation.T @ load, _NESTED, nested)[0]
        A = self.levels.matrix(top)
        rest = load - A @ x if k and nested else load
        size = tolerance * float(np.linalg.norm(load))
        if float(np.linalg.norm(rest)) <= size:
            return x, 0
        diagonal = self.levels.diagonal(top)
        found = conjugate_gradients(A, diagonal, rest, lambda v: self.levels.cycle(top, v), size, _ITERATIONS)
        return x + found.solution, found.iterations


def selects(trace: sp.csr_array) -> bool:
    """Whether every row of a trace is one unknown or its opposite, no unknown in two rows."""
    if (np.diff(trace.indptr) > 1).any() or np.bincount(trace.indices).max(initial=0) > 1:
        return False
    return bool(np.allclose(np.abs(trace.data), 1.0, rtol=1e-12, atol=0.0))


def contact_unknowns(problem: DiscreteProblem) -> tuple[IntArray, Array, BoolArray, IntArray]:
    """The unknown and the sign of each active component (k,), which are active (m, d), and the points of those (k,)."""
    active = (np.diff(problem.contact.trace.indptr) > 0).reshape(problem.contact_points, problem.contact.components)
    point = np.repeat(np.arange(problem.contact_points), active.sum(axis=1))
    return problem.contact.trace.indices.astype(np.int64), np.sign(problem.contact.trace.data), active, point
