"""Inexact Newton's equation of all unknowns: conjugate gradients with a multigrid cycle that leaves out kinks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from hemivar.basics.arrays import SOLVED
from hemivar.basics.types import Array
from hemivar.linear.krylov import conjugate_gradients, minimal_residuals
from hemivar.systems.body import Body, Truncation
from hemivar.systems.contact_moves import moving_curvature
from hemivar.systems.newton_equation import Accuracy, Correction, LinearisedPoint, NewtonEquation

__all__ = ["KrylovNewton"]

#: How large a residual, by the distance to the contact conditions, conjugate gradients leave when they end early; half
#: and twice that cost the same cycles to 3 % on small bodies.
_PATIENCE = 1.5
#: Most iterations of minimal residuals, which keep two vectors of each.
_VECTORS = 40


@dataclass(frozen=True, eq=False)
class KrylovNewton:
    """Newton's equation of all unknowns."""

    body: Body
    matrix: Truncation  # changed by :meth:`solve`

    @classmethod
    def of(cls, body: Body, known: NewtonEquation | None) -> Self:
        """The equation of a body, with the matrix of one that is known."""
        return cls(body, known.matrix if isinstance(known, KrylovNewton) else body.truncation())

    def solve(self, at: LinearisedPoint, accuracy: Accuracy) -> Correction:
        """The correction by conjugate gradients, ended early where the contact conditions are further off.

        Raises ProblemError: a direction without curvature shows that the stiffness is indefinite.
        """
        if at.pushed is not None:
            return self._generalised(at, at.pushed, accuracy)
        body, at_kink = self.body, ~at.moving[self.body.active]
        self.matrix.change(at.x, at_kink, moving_curvature(body, at.blocks, at.moving))
        right = at.force.copy()
        right[body.unknown] -= body.gather(body.weights[:, None] * at.multiplier)
        right[body.unknown[at_kink]] = 0.0
        scale = body.load_scale.of(float(body.vectors.norms(at.force[body.unknown])[0]))
        flexible, cycle = self.matrix.preconditioner()
        enough = None if accuracy.due is None else _Enough(body, at, accuracy.due, accuracy.share)
        descent = conjugate_gradients(
            self.matrix, self.matrix.diagonal, right, cycle, accuracy.absolute + accuracy.tolerance * scale,
            accuracy.iterations, enough, body.vectors, sparing=True, flexible=flexible,
        )  # fmt: skip
        bent = right - descent.residual  # laws and held unknowns act in the contact rows only
        bent[body.unknown] = body.pull(descent.solution)
        if descent.negative is not None:
            body.refuse_direction(descent.negative)
        return Correction(descent.solution, bent, descent.iterations, negative=descent.negative)

    def _generalised(self, at: LinearisedPoint, pushed: Array, accuracy: Accuracy) -> Correction:
        """The change by minimal residuals, with the cycle of the law whose bound is frozen, which is symmetric."""
        body, moving = self.body, at.moving
        weights, at_kink = self.body.weights[:, None], ~moving[self.body.active]
        curvature = moving_curvature(body, at.blocks, moving)
        symmetric = 0.5 * (curvature + np.swapaxes(curvature, 1, 2))
        symmetric[:, 1:, 0] = symmetric[:, 0, 1:] = curvature[:, 0, 1:]  # without what follows the normal part
        coupling = curvature - symmetric
        self.matrix.change(at.x, at_kink, symmetric)
        pushes = bool(body.vectors.largest(float(pushed.any()))[0])

        def product(v: Array) -> Array:
            out = np.array(self.matrix @ v)
            rows = np.einsum("mij,mj->mi", coupling, body.spread(v[body.unknown]))
            if pushes:
                rows -= pushed * body.spread(body.pull(v))[:, :1]
            out[body.unknown] += body.gather(rows)
            out[body.unknown[at_kink]] = 0.0
            return out

        rest = body.spread(at.force[body.unknown]) - weights * at.multiplier
        rest -= pushed * rest[:, :1]
        right = at.force.copy()
        right[body.unknown] = body.gather(rest)
        right[body.unknown[at_kink]] = 0.0
        scale = body.load_scale.of(float(body.vectors.norms(at.force[body.unknown])[0]))
        tolerance, limit = accuracy.absolute + accuracy.tolerance * scale, min(accuracy.iterations, _VECTORS)
        step, cycles = minimal_residuals(
            product, right, self.matrix.cycle, tolerance, limit, accuracy.due, body.vectors
        )
        return Correction(step, body.multiply(step), cycles)

    def negative_curvature(self, at: LinearisedPoint) -> Array | None:
        """It would cost an eigenvalue problem; directions that conjugate gradients meet are followed."""
        return None

    def release(self) -> None:
        """Give the levels back."""
        self.matrix.release()


@dataclass(frozen=True, eq=False)
class _Enough:
    """Forces by which the contact conditions fail: Newton's equation need not be solved much better than that."""

    body: Body
    at: LinearisedPoint
    due: Callable[[], float]
    share: float

    def __call__(self, iteration: int, step: Array) -> Array:
        at, body, weights = self.at, self.body, self.body.weights[:, None]
        pulled = body.pull(step)  # by all processes, whether they are late or not
        if self.due():
            return np.full(1, np.inf)
        increment = body.spread(step[body.unknown])
        aim = at.clamp(at.r + increment)
        beyond = np.where(at.moving, at.r + increment - aim, 0.0)
        lam = body.spread(at.force[body.unknown] - pulled) / weights
        off = np.where(body.active, lam - body.law.nearest_multiplier(at.r, lam), 0.0)
        bend = body.law.linearise(aim).gradient - at.multiplier - np.einsum("mij,mj->mi", at.blocks, increment)
        bend[np.abs(beyond) > SOLVED * np.abs(increment)] = 0.0  # at the end of its piece a law has no gradient
        missed = np.hypot(body.stiffness * beyond, weights * np.where(at.moving, bend, off))
        return np.asarray(_PATIENCE * self.share * missed).ravel()
