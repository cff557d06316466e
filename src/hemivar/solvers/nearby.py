"""The solution of a condensed problem near a state that all but solves it: a few of Newton's equations and no search.

In an evolution one problem follows another that hardly differs.  With ``p = r + c lam`` the law says ``r = prox_c(p)``,
which sorts the contact points onto the pieces of their laws and onto kinks; Newton's equation on these pieces gives the
next pair.  If pieces do not change any more the pair solves the problem, and its residual, that of the full problem,
proves it.  Where there is one solution it is the one that any other method finds.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.linalg as la

from hemivar.basics.types import Array, IntArray
from hemivar.solvers.controls import Controls
from hemivar.solvers.newton import NonsmoothNewton, newton_matrix
from hemivar.solvers.solution import Solution
from hemivar.solvers.status import Status
from hemivar.systems.condensed import CondensedProblem
from hemivar.systems.contact_moves import smooth_components

__all__ = ["Pieces", "nearby_solution"]

#: Newton's equations that are solved before a search is thought better.
_ROUNDS = 6
#: Part of the tolerance by which the multiplier may miss the law before the other unknowns are looked for.
_PART = 0.5


@dataclass(eq=False)
class Pieces:
    """The factor of Newton's equation that was solved last; it serves as long as the contact points keep their pieces.

    Nothing in it changes an answer.
    """

    _known: tuple[bytes, Any] = field(default=(b"", None), repr=False)

    def solve(self, system: CondensedProblem, index: IntArray, hessian: Array, right: Array) -> Array | None:
        """``H^-1 right`` (k,) on the components ``index``, with second derivatives ``hessian (m, d, d)`` of the laws.

        None where H is not positive definite.
        """
        key = index.tobytes() + hessian.tobytes()
        known, factor = self._known
        if known != key:
            try:
                factor = la.cho_factor(newton_matrix(system, index, hessian), check_finite=False)
            except la.LinAlgError:
                return None
            self._known = key, factor
        return np.asarray(la.cho_solve(factor, right, check_finite=False))


def nearby_solution(
    system: CondensedProblem, r: Array, lam: Array, controls: Controls, pieces: Pieces
) -> Solution | None:
    """The solution that Newton's equations lead to from a pair, or None where they do not settle at once.

    Parameters
    ----------
    system : CondensedProblem
        Its law depends on no state.
    r, lam : arrays (m, d)
        Local displacements and multiplier of a state nearby.
    controls : Controls
    pieces : Pieces
        Of the same body.
    """
    began = time.perf_counter()
    law, active, weights = system.law, system.active, system.weights[:, None]
    stiff, pair = system.body.diagonal, system.body.pointwise
    r = np.where(active, r, system.fixed)
    for number in range(1, _ROUNDS + 1):
        at = np.where(active, law.place_on_piece(pair, stiff * r / weights + lam, r), system.fixed)
        if not np.isfinite(at).all():
            return None
        line = law.linearise(at)
        moving = smooth_components(line, active)
        index = np.flatnonzero(moving.ravel())
        r = at
        if index.size:
            right = (system.out_of_balance(at) - weights * line.gradient).ravel()[index]
            step = pieces.solve(system, index, line.hessian, right)
            if step is None:
                return None
            r = at.copy()
            r.ravel()[index] += step
        lam = system.multiplier(r)
        of_law = np.where(active, law.nearest_multiplier(r, lam), lam)
        missed = float(np.linalg.norm(weights * (of_law - lam)))
        scale = system.load_scale.of(float(np.linalg.norm(weights * of_law)))
        if missed > _PART * (controls.atol + controls.rtol * scale):
            continue
        iterated = time.perf_counter()
        unknowns, residual = system.recovered(r, of_law)
        if residual.below(controls.atol, controls.rtol):
            return Solution(
                problem=system.problem,
                unknowns=unknowns,
                multiplier=of_law,
                status=Status.CONVERGED,
                residual=residual,
                method=NonsmoothNewton.name,
                steps=number,
                evaluations=number,
                timings={
                    "condense": system.seconds,
                    "iterate": iterated - began,
                    "recover": time.perf_counter() - iterated,
                },
            )
    return None
