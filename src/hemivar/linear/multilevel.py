"""A multigrid hierarchy of matrices and transfers: a solver, and a preconditioner for anybody's Krylov iteration."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import real_matrix
from hemivar.basics.first_use import IMPORTS
from hemivar.basics.types import Array, IntArray
from hemivar.errors import ProblemError
from hemivar.linear.algebraic import NodeSlots, algebraic_levels
from hemivar.linear.krylov import conjugate_gradients
from hemivar.linear.levels import COARSEST, LevelMatrix, Levels, Transfer
from hemivar.linear.threads import one_thread

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

__all__ = ["GridLevel", "Hierarchy"]

#: Part of the load that a coarser level leaves of its solution, which is a start on the next one.
_NESTED = 1e-3


def _regular(n: int, near: Array | None) -> NodeSlots:
    """The nodes of an algebraic level: as many unknowns each as there are motions that the matrix hardly resists."""
    size = 1 if near is None else near.shape[1]
    return NodeSlots(np.arange(n), size, n // size)


@dataclass(frozen=True, eq=False)
class GridLevel:
    """One level of a hierarchy; the coarsest has no transfers."""

    A: sp.csr_array  # (n, n)
    P: sp.csr_array | None = None  # (n, n_coarse): prolongation from the next coarser level
    R: sp.csr_array | None = None  # (n_coarse, n): restriction, its transpose


@dataclass(frozen=True, eq=False)
class Hierarchy:
    """Symmetric positive definite matrices from a fine to a coarse one, and a symmetric V-cycle on them.

    Nothing in it changes: many threads may solve with it at the same time.

    Attributes
    ----------
    stack : Levels
        From the coarsest, which is 0, to the finest: what nonsmooth methods hold unknowns on.
    """

    stack: Levels

    @staticmethod
    def of(
        matrices: sp.csr_array | Sequence[sp.csr_array],
        prolongations: Sequence[sp.csr_array] = (),
        *,
        near: Array | None = None,
        slots: Sequence[NodeSlots | None] = (),
        contacts: Sequence[IntArray] = (),
        points: Sequence[IntArray] = (),
    ) -> Hierarchy:
        """A hierarchy of a matrix, and of coarser ones where prolongations to it are known.

        Below the coarsest of these, where it is large, follow levels of smoothed aggregation.

        Parameters
        ----------
        matrices : sparse array, or sequence of these
            Symmetric positive definite, finest first; those that are not given are ``P'AP``.
        prolongations : sequence of sparse arrays
            ``prolongations[k]``, shape (n_k, n_(k+1)), leads from level k + 1 to level k.
        near : array, shape (n, q), optional
            What the coarsest given matrix hardly resists, such as rigid motions; constants by default.
        slots : sequence of NodeSlots or None, optional
            Where the unknowns of the given matrices stand by nodes; by default each by itself.
        contacts, points : sequences of int arrays, optional
            Of each level the unknowns that may be held and the point that each belongs to; see :class:`Levels`.
        """
        every: Sequence[sp.csr_array] = matrices if isinstance(matrices, list | tuple) else [matrices]  # type: ignore[list-item]
        given = [one if sp.issparse(one) else real_matrix(one, "a matrix of a hierarchy") for one in every]
        if not given or any(one.shape[0] != one.shape[1] for one in given):
            raise ProblemError("a hierarchy needs square matrices; give one, or a list from the finest on")
        lists = {"prolongations": prolongations, "slots": slots, "contacts": contacts, "points": points}
        for name, one in lists.items():
            expect(one, list | tuple, name, "give a list, one entry for each level")
            if len(one) > max(len(given), len(prolongations) + 1):
                raise ProblemError(f"{name} of a hierarchy has {len(one)} entries; give one for each level")
        if len(given) > len(prolongations) + 1 or len(contacts) != len(points):
            raise ProblemError("a hierarchy needs a prolongation between two matrices, and points for all contacts")
        prolongations = [one if sp.issparse(one) else real_matrix(one, "a prolongation") for one in prolongations]
        for P in prolongations[len(given) - 1 :]:
            given.append(sp.csr_array(P.T @ given[-1] @ P))
        nodes = [*slots, *[None] * (len(given) - len(slots))]
        below = algebraic_levels(given[-1], near, nodes[-1]) if given[-1].shape[0] > COARSEST else []
        nothing: list[IntArray] = [np.zeros(0, dtype=np.int64)]
        none = nothing * (len(below) + (0 if contacts else len(given)))
        transfers = [transfer for _, transfer in below] + [Transfer.of(P) for P in reversed(prolongations)]
        stack = Levels(
            [matrix for matrix, _ in below] + given[::-1],
            transfers,
            none + list(reversed(contacts)),
            none + list(reversed(points)),
            len(below),
            slots=[_regular(matrix.shape[0], near) for matrix, _ in below]
            + [NodeSlots.single(A.shape[0]) if one is None else one for A, one in zip(given, nodes, strict=True)][::-1],
        )
        return Hierarchy(stack)

    @property
    def levels(self) -> list[GridLevel]:
        """The levels, finest first."""
        transfers = self.stack.transfers
        parts = [(one.prolongation, one.restriction) for one in reversed(transfers)] + [(None, None)]
        count = len(parts)
        return [GridLevel(self.stack.matrix(count - 1 - k), P, R) for k, (P, R) in enumerate(parts)]

    def aspreconditioner(self) -> LinearOperator:
        """One V-cycle from zero, about the inverse of the finest matrix, for iterations of SciPy such as ``cg``.

        It is symmetric positive definite.
        """
        with IMPORTS:
            from scipy.sparse.linalg import LinearOperator

        top = len(self.stack.sizes) - 1

        def cycle(right: Array) -> Array:
            with one_thread():
                return self.stack.cycle(top, np.ravel(right))

        return LinearOperator((self.stack.sizes[top],) * 2, matvec=cycle, rmatvec=cycle, dtype=float)

    def solve(self, load: Array, tolerance: float = 1e-10, nested: bool = True) -> tuple[Array, int]:
        """``A^-1 load`` by conjugate gradients with the cycle.

        Parameters
        ----------
        load : array (n,)
        tolerance : float
            Of the residual, relative to the 2-norm of the load.
        nested : bool
            Start from the solution on the next coarser level that is not algebraic.

        Returns
        -------
        solution : array (n,)
        cycles : int
            On the finest level.
        """
        with one_thread():
            return self._solve(len(self.stack.sizes) - 1, load, tolerance, nested)

    def _solve(self, top: int, load: Array, tolerance: float, nested: bool) -> tuple[Array, int]:
        stack, x = self.stack, np.zeros_like(load)
        nested = nested and top > stack.algebraic
        if nested:
            prolongation = stack.transfers[top - 1].prolongation
            x = prolongation @ self._solve(top - 1, prolongation.T @ load, _NESTED, nested)[0]
        A = LevelMatrix(stack, top)
        rest = load - A @ x if nested else load
        size = tolerance * float(np.linalg.norm(load))
        if float(np.linalg.norm(rest)) <= size:
            return x, 0
        diagonal = stack.diagonal(top)
        cycle = stack.preconditioner(top)
        descent = conjugate_gradients(A, diagonal, rest, cycle, size, 100, flexible=cycle.flexible)
        return x + descent.solution, descent.iterations
