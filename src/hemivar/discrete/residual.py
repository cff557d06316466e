"""The one residual: how far a pair (u, lambda) is from solving the discrete problem."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from hemivar.basics.arguments import expect
from hemivar.basics.arrays import COUNTS, norm, real_array
from hemivar.basics.defined_above import above
from hemivar.basics.types import Array
from hemivar.discrete.bulk import Sized
from hemivar.discrete.contact_energy import law_forces
from hemivar.discrete.potential import Potential
from hemivar.discrete.problem import DiscreteProblem
from hemivar.errors import ProblemError
from hemivar.laws import VectorLaw

__all__ = [
    "LoadScale",
    "Residual",
    "balanced",
    "contact_compliance",
    "load_scale",
    "residual",
    "residuals",
    "resting_multiplier",
]

#: What rounding leaves of numbers that are added up, and the part of a scale that it may excuse.
_ULPS = 8.0 * float(np.finfo(float).eps)


@dataclass(frozen=True)
class LoadScale:
    """What a residual is held against: sizes of forces that the data of a problem set, whatever the iterate."""

    load: float  # ``|f|_2``
    rest: float

    def of(self, contact_force: float) -> float:
        """The scale where the foundation exerts a force of the given size.

        A body may be loaded by its foundation alone (a negative gap, glue under tension), but a force that only the
        iterate makes is no load: a runaway one would excuse its own residual.  Where the data set no scale at all, the
        force of the foundation is what is left.
        """
        scale = max(self.load, min(contact_force, self.rest))
        return scale if scale > 0.0 else contact_force


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
        ``|f|_2``, or more where the foundation loads the body by itself: :class:`LoadScale`.
    noise : float
        What the arithmetic alone can leave in ``equilibrium``.
    """

    equilibrium: float
    inclusion: float
    scale: float
    noise: float

    @staticmethod
    def of(out_of_balance: float, inclusion: float, load: LoadScale, contact_force: float, moved: float) -> Residual:
        """From the norms of both parts, what they are held against, and the size of what cancels, entry by entry."""
        return Residual(out_of_balance, inclusion, load.of(contact_force), _ULPS * moved)

    @property
    def rounding(self) -> float:
        """``noise``, but at most 1e-6 of ``scale``: a runaway iterate must not excuse its own residual."""
        return min(self.noise, COUNTS * self.scale)

    @property
    def total(self) -> float:
        """Both parts together."""
        return math.hypot(self.equilibrium, self.inclusion)

    @property
    def relative(self) -> float:
        """Both parts together over ``scale``; the number reported by every solver.

        At least what the arithmetic may leave where that is more than a thousandth of ``scale``.
        """
        size = self.total if self._telling else max(self.total, self.noise)
        return size / self.scale if self.scale > 0.0 else size

    @property
    def _telling(self) -> bool:
        """Whether a small residual shows anything: the arithmetic alone leaves less."""
        return self.noise <= 1e-3 * self.scale

    def excused(self, atol: float, rtol: float) -> bool:
        """Whether it is :meth:`below` what was asked for only because of rounding."""
        return self.below(atol, rtol) and self.total > atol + rtol * self.scale

    def below(self, atol: float, rtol: float) -> bool:
        """Whether the pair solves the problem to ``atol + rtol * scale``, up to rounding.

        Never where a number is not finite, or the arithmetic alone may leave more than a thousandth of ``scale``:
        however small the residual is then, it shows nothing.
        """
        finite = all(math.isfinite(number) for number in (self.total, self.scale, self.noise))
        return finite and self._telling and self.total <= atol + rtol * self.scale + self.rounding


def load_scale(problem: DiscreteProblem, compliance: Array, rest: float | None = None) -> LoadScale:
    """What the residuals of a problem are held against; ``compliance`` is :func:`contact_compliance` of it.

    ``rest`` is that of another load, where it is known.
    """
    vectors = problem.vectors
    load = problem.loading.load_size if vectors.alone else float(vectors.norms(problem.load)[0])
    load = max(load, _known_force(problem))
    if not problem.contact_points and vectors.alone:
        return LoadScale(load, 0.0)
    if rest is not None:
        return LoadScale(load, rest)
    with np.errstate(all="ignore"):
        resting = problem.contact_force(resting_multiplier(problem.law, problem.offset, compliance))
        rest = float(vectors.norms(resting)[0])
    return LoadScale(load, rest if math.isfinite(rest) else math.inf)


def _known_force(problem: DiscreteProblem) -> float:
    """What forces can be held against however small they are: the displacement at unknowns zero leaves its rounding."""
    bulk = problem.bulk
    return _ULPS / COUNTS * norm(bulk.initial_sizes) if isinstance(bulk, Potential) else 0.0


def resting_multiplier(law: VectorLaw, offset: Array, compliance: Array) -> Array:
    """What presses on a body that has not moved, (m, d), as far as a body of this ``compliance (m, 2)`` can bear it.

    ``offset (m, d)`` is the gap and the offset of the tangential components.
    """
    domain, start = law.penetrations, -offset
    inside = start.copy()
    inside[:, 0] = np.clip(start[:, 0], domain.lower, domain.upper)
    with np.errstate(all="ignore"):
        zero = np.zeros_like(inside)
        lam = law.frozen(inside, zero).nearest_multiplier(inside, zero)
        lam[:, 0] += (start - inside)[:, 0] / compliance[:, 0]
    return lam


def contact_compliance(problem: DiscreteProblem) -> Array:
    """Displacement for a unit pressure at each contact point when all else is held, shape (m, 2).

    It makes displacement and multiplier comparable; the columns are for the normal and the tangential part.
    """
    bulk = problem.bulk
    stiff = bulk.diagonal if isinstance(bulk, Sized) else bulk.hessian(np.zeros(bulk.unknowns)).diagonal()
    flexibility = problem.contact.trace.power(2) @ (1.0 / stiff)
    flexibility = flexibility.reshape(problem.contact_points, problem.contact.components)
    normal = flexibility[:, 0]
    tangential = flexibility[:, 1:].max(axis=1) if problem.contact.components > 1 else normal
    pair = np.stack([normal, tangential], axis=1)
    largest = float(problem.vectors.largest(float(pair.max(initial=0.0)))[0])
    return problem.contact.weights[:, None] * np.where(pair > 0.0, pair, largest if largest > 0.0 else 1.0)


def residual(problem: DiscreteProblem, displacement: Array, multiplier: Array) -> Residual:
    """Residual at a displacement and a multiplier, whoever computed them.

    Parameters
    ----------
    problem : DiscreteProblem
    displacement : array (n,)
        Unknowns u.
    multiplier : array (m, d)
        Force per area of the body on the foundation at the contact points: pressure (column 0), and minus the friction.
        A friction bound that depends on the state is taken at this very displacement and pressure, and so is the
        stress that stiffens the body.

    Returns
    -------
    Residual

    Raises
    ------
    ProblemError
        Wrong shapes, or arrays that are not of real numbers.
    """
    expect(problem, DiscreteProblem, "the problem of the residual", "discretise it first, hemivar.discretize(problem)")
    displacement = real_array(displacement, "the displacement", finite=False)
    multiplier = real_array(multiplier, "the multiplier", finite=False)
    if displacement.shape != (problem.unknowns,):
        raise ProblemError(f"the displacement has shape {displacement.shape}; the unknowns have {(problem.unknowns,)}")
    if problem.origin is not None and problem.origin.stiffening:
        problem = above("residual.residual")(problem, displacement)
    compliance = contact_compliance(problem)
    return residuals(problem, displacement, [multiplier], compliance, load_scale(problem, compliance))[0]


def residuals(
    problem: DiscreteProblem, u: Array, multipliers: Sequence[Array], compliance: Array, scale: LoadScale
) -> list[Residual]:
    """Residuals at unknowns (n,) for each of some multipliers (m, d).

    ``compliance (m, 2)`` and ``scale`` are :func:`contact_compliance` and :func:`load_scale` of the problem.
    """
    r, (balance, moved) = problem.contact.trace_of(u) - problem.offset, balanced(problem, u)
    every = []
    for lam in multipliers:
        force = problem.contact_force(lam)
        off = law_forces(problem.law, problem.contact.weights, r, lam, compliance)
        left, missed, pressed = problem.vectors.norms(balance - force, off, force).tolist()
        every.append(Residual.of(left, missed, scale, pressed, moved))
    return every


def balanced(problem: DiscreteProblem, u: Array, stiffness: sp.csr_array | None = None) -> tuple[Array, float]:
    """What the body leaves of its load (n,) at unknowns (n,), and the size of what is added up in it.

    The size is that of the answer that is sought: rigid motions of what supports do not hold are none of it.
    ``stiffness`` multiplies as that of a linear body does, and faster.
    """
    strained, sizes = problem.strained(u)
    bulk = problem.bulk
    force = np.asarray(problem.load - (bulk.gradient(strained) if stiffness is None else stiffness @ strained))
    if isinstance(bulk, Sized):
        return force, bulk.rounding_scale(sizes, problem.load)
    sums = np.asarray(abs(bulk.hessian(u)).sum(axis=1))
    return force, norm(sums * sizes + np.abs(problem.load))
