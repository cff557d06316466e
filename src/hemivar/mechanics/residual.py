"""The one residual: how far a pair (u, lambda) is from solving the discrete problem."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hemivar._typing import Array
from hemivar.arguments import expect
from hemivar.arrays import real_array
from hemivar.errors import ProblemError
from hemivar.mechanics.discrete import DiscreteProblem

__all__ = ["Residual", "contact_compliance", "residual"]


@dataclass(frozen=True)
class Residual:
    """Residual of ``K u + B'W lambda = f``, ``lambda in dj(r)``, in units of force.

    Attributes
    ----------
    equilibrium : float
        ``|f - K u - B'W lambda|_2``.
    inclusion : float
        ``|W e|_2`` with ``e`` the distance of (r, lambda) to the graph of the law at every contact point.
    scale : float
        The larger of ``|f|_2`` and ``|B'W lambda|_2`` (a body may be loaded by its foundation alone).
    rounding : float
        What the arithmetic alone can leave in ``equilibrium``, but at most 1e-6 of ``scale``: a runaway iterate
        must not excuse its own residual.
    """

    equilibrium: float
    inclusion: float
    scale: float
    rounding: float

    @staticmethod
    def of(out_of_balance: Array, inclusion: Array, load: float, contact_force: Array, moved: Array) -> Residual:
        """From the vectors of both parts, ``|f|``, the contact force, and the size of what cancels, entry by entry."""
        scale = max(load, float(np.linalg.norm(contact_force)))
        rounding = float(8.0 * np.finfo(float).eps * np.linalg.norm(moved))
        return Residual(
            equilibrium=float(np.linalg.norm(out_of_balance)),
            inclusion=float(np.linalg.norm(inclusion)),
            scale=scale,
            rounding=min(rounding, 1e-6 * scale),
        )

    @property
    def total(self) -> float:
        """Both parts together."""
        return float(np.hypot(self.equilibrium, self.inclusion))

    @property
    def relative(self) -> float:
        """Both parts together over ``scale``; the number reported by every solver."""
        return self.total / self.scale if self.scale > 0.0 else self.total

    def below(self, atol: float, rtol: float) -> bool:
        """Whether the pair solves the problem to ``atol + rtol * scale``, up to rounding."""
        return bool(self.total <= atol + rtol * self.scale + self.rounding)


def contact_compliance(problem: DiscreteProblem) -> Array:
    """Displacement for a unit pressure at each contact point when all else is held, shape (m, 2).

    It makes displacement and multiplier comparable; the columns are for the normal and the tangential part.
    """
    flexibility = problem.trace.power(2) @ (1.0 / problem.diagonal)
    flexibility = flexibility.reshape(problem.contact_points, problem.dim)
    normal = flexibility[:, 0]
    tangential = flexibility[:, 1:].max(axis=1) if problem.dim > 1 else normal
    pair = np.stack([normal, tangential], axis=1)
    largest = pair.max(initial=0.0)
    return problem.weights[:, None] * np.where(pair > 0.0, pair, largest if largest > 0.0 else 1.0)


def residual(problem: DiscreteProblem, displacement: Array, multiplier: Array) -> Residual:
    """Residual at a displacement and a multiplier, whoever computed them.

    Parameters
    ----------
    problem : DiscreteProblem
    displacement : array (n,)
        Unknowns u.
    multiplier : array (m, d)
        Pressure and friction at the contact points. A friction bound that depends on the state is taken at
        this very displacement and pressure.

    Raises
    ------
    ProblemError
        Wrong shapes, or arrays that are not of real numbers.
    """
    expect(problem, DiscreteProblem, "the problem of the residual", "discretise it first, hemivar.discretize(problem)")
    K, f = problem.stiffness, problem.load
    displacement = real_array(displacement, "the displacement", finite=False)
    multiplier = real_array(multiplier, "the multiplier", finite=False)
    if displacement.shape != f.shape:
        raise ProblemError(f"the displacement has shape {displacement.shape}; the unknowns have shape {f.shape}")
    force = problem.contact_force(multiplier)
    inclusion = np.zeros(0)
    if problem.contact_points:
        r = problem.local(displacement)
        law = problem.law.frozen(r, multiplier)
        inclusion = problem.weights * law.graph_distance(r, multiplier, contact_compliance(problem))
    return Residual.of(
        out_of_balance=f - K @ displacement - force,
        inclusion=inclusion,
        load=float(np.linalg.norm(f)),
        contact_force=force,
        moved=problem.row_sums * np.abs(displacement) + np.abs(f),
    )
