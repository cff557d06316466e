"""A posteriori bound of the time error of implicit Euler: guaranteed, where a proof covers the problem.

Both bounds compare with the problem that is discrete in space; loads are straight lines in every step.  Whether they
are is looked at in three points of each step: where they bend, what they are off counts by the rule of Gauss of these
points, and the bound becomes an estimate.  U is piecewise linear through the computed states, ``e = u - U``,
``l = (t_n - t)/tau``, and ``dU``, ``df`` are differences over tau.

* Laws of the rate (friction, damping), no mass, ``c = lmax(B'W diag(alpha) B, C) < 1``.  The computed rate fulfils the
  inclusion with the forces of the end of its step, so that the difference of both problems leaves the force
  ``(t_n - t) R``, ``R = K dU - df``; tested with ``e'`` it gives

      d/dt |e|_K^2 / 2 + (1 - c) |e'|_C^2 <= (t_n - t) |R|_{C^-1} |e'|_C.

  The largest right-hand side less left-hand side over ``|e'|_C`` bounds the displacement,

      |e(T)|_K^2 <= |e(0)|_K^2 + sum tau^3/6 |R|_{C^-1}^2 / (1 - c),

  and half of the dissipation kept, with tau^3/3, it bounds ``|e(T)|_K^2 + (1 - c) int |e'|_C^2``.  No error is ever
  forgotten, nor can it be: two bodies that differ and stick are both at rest for ever.

* Laws of the displacement, ``c = lmax(B'W diag(alpha) B, K) <= 1``: the flow is the gradient flow of an energy E in the
  norm of C, which is convex, and more so by ``s |.|_K^2 / 2``, ``s = 1 - c``.  With the energy E_n under the loads of
  the end of the step, ``D = E_n(U_{n-1}) - E_n(U_n) - tau |dU|_C^2`` (at least half of ``q = s tau^2 |dU|_K^2``), the
  inequality of Nochetto, Savare and Verdi (2000), in which nothing of the convexity is dropped, is

      d/dt |e|_C^2 / 2 + s (|e|_K^2 + |e - l tau dU|_K^2) / 2 <= l D - l (1 - l) q / 2 + l tau |df|_{C^-1} |e|_C.

  Of the square brackets a part beta of ``s |e|_K^2 >= s a |e|_C^2`` is kept, ``K >= a C``, which forgets errors at the
  rate ``rho = s beta a``; the rest takes ``e`` at its worst.  So a step leads from a bound y to

      sqrt(exp(-2 rho tau) y^2 + tau int_0^1 exp(-2 rho tau l) (l (2 D - q) + l^2 q / (2 (1 - beta))) dl)
          + tau^2 |df|_{C^-1} int_0^1 exp(-rho tau l) l dl

  for any beta of [0, 1); the one that is best for short steps is taken.  For beta = 0 and steady loads this is
  ``y^2 + tau (D - q/3)``, a third of the published ``y^2 + tau D`` where the energy is quadratic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu
from scipy.special import gammainc

from hemivar.basics.arrays import NULL, SOLVED
from hemivar.basics.rounding import rounded_up
from hemivar.basics.types import Array
from hemivar.certificates.smallness import smallness
from hemivar.discrete.bulk import Quadratic
from hemivar.evolution.discrete import DiscreteEvolution
from hemivar.evolution.schemes import Scheme
from hemivar.evolution.state import TimeState
from hemivar.evolution.stepper import StepResult, TimeStepper
from hemivar.fem.forms import FormProblem
from hemivar.fem.quadrature import at_quadrature_points
from hemivar.laws import Bilateral, NoContact
from hemivar.linear.definite import positive_pivots
from hemivar.mechanics.statement import ContactProblem
from hemivar.systems.workspace import Workspace

__all__ = ["TimeBound", "TimeError", "bound_in_time"]

_SAMPLED = "the weak convexity of a law is known from samples only"
#: Points of the rule of Gauss of degree 5 on a step, and their weights.
_RULE = ((0.5 - math.sqrt(0.15), 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + math.sqrt(0.15), 5.0 / 18.0))


@dataclass(frozen=True)
class TimeError:
    """A bound of the distance to the solution that is continuous in time, the same mesh."""

    #: ``"stiffness"``: ``sqrt(e'K e)``; ``"viscosity"``: ``sqrt(e'C e)``; ``""`` where there is none.
    norm: str
    #: At the time of the last step; guaranteed up to rounding and the solver's residual; nan where no theorem covers
    #: the problem.
    bound: float
    #: The theorem, or why none covers the problem.
    why: str
    #: False if loads bend within steps, so that the bound is an estimate, or there is none.
    guaranteed: bool = False

    @property
    def words(self) -> str:
        """The bound in words, and what it rests on."""
        size = f"{rounded_up(self.bound)} in the norm of the {self.norm}"
        if not self.norm:
            return f"not known: {self.why}"
        if self.guaranteed:
            return f"at most {size}: {self.why}"
        return f"about {size}, an estimate: loads are not linear in a step"


class TimeBound:
    """A bound of the error in time, step by step: its square, and whether loads were straight lines in every step."""

    def __init__(
        self,
        stepper: TimeStepper,
        norm: str,
        why: str,
        contraction: float = 0.0,
        fading: float = 0.0,
        viscosity: SuperLU | None = None,
    ) -> None:
        self.stepper = stepper
        self.norm = norm
        self.why = why
        self.square = 0.0 if norm else math.nan
        self.straight = True
        self._contraction = contraction
        self._fading = fading
        self._viscosity = viscosity

    @property
    def now(self) -> TimeError:
        """The bound so far."""
        return TimeError(self.norm, math.sqrt(self.square), self.why, bool(self.norm) and self.straight)

    def add(self, taken: StepResult) -> float:
        """Count a step; returns the square of the bound at its end."""
        if not self.norm:
            return self.square
        discrete, step = self.stepper.discrete, taken.step
        n = discrete.unknowns
        stepper = self.stepper
        begin = stepper.data.after(taken.before.time).load
        end = stepper.data.before(taken.state.time).load
        bent, bent_square = self._bent(taken, begin, end)
        moved = (taken.state.body.displacement - taken.before.body.displacement) / step
        if self.norm == "stiffness":
            rest = (discrete.stiffness.times(moved) - (end - begin) / step)[:n]
            force = math.sqrt(step**3 / 3.0 * self._dual(rest)) + math.sqrt(step * bent_square)
            self.square += 0.5 * force**2 / (1.0 - self._contraction)
            return self.square
        assert discrete.viscosity is not None
        energies = (discrete.viscosity.energy(moved), discrete.stiffness.energy(moved))
        viscous, elastic = discrete.vectors.total(*energies).tolist()
        convexity = 1.0 - self._contraction
        q = convexity * 2.0 * step**2 * elastic
        fell = self._energy(taken.before, end) - self._energy(taken.state, end)
        loads = 0.0 if begin is end else math.sqrt(self._dual((end - begin)[:n]))  # tau |df|
        # The best part for short steps: 1 - beta = tau |dU|_K / (sqrt(12 a) y).
        beta = 0.0
        if self._fading > 0.0 and self.square > 0.0:
            least = math.sqrt(step**2 * 2.0 * elastic / (12.0 * self._fading * self.square))
            beta = min(max(0.0, 1.0 - least), 1.0 - SOLVED)
        rho = convexity * beta * self._fading * step
        own = max(2.0 * (fell - step * 2.0 * viscous) - q, 0.0)
        source = own * _moment(1, 2.0 * rho) + 0.5 * q / (1.0 - beta) * _moment(2, 2.0 * rho)
        bound = math.sqrt(math.exp(-2.0 * rho) * self.square + step * source) + step * loads * _moment(1, rho)
        self.square = (bound + step * bent) ** 2
        return self.square

    def _bent(self, taken: StepResult, begin: Array, end: Array) -> tuple[float, float]:
        """Means over a step, with the loads at its ends, of what the load leaves the straight line between them by in
        the norm of C^-1, and of its square."""
        discrete, start = self.stepper.discrete, taken.before.time
        mean = square = 0.0
        for part, weight in () if begin is end else _RULE:
            load = self.stepper.data.at(start + part * (taken.state.time - start)).load
            gap = load - (1.0 - part) * begin - part * end
            sizes = (float(np.abs(one).max(initial=0.0)) for one in (gap, load, begin, end))
            off, *size = discrete.vectors.largest(*sizes).tolist()
            if off > SOLVED * max(size):
                self.straight = False
                dual = self._dual(gap[: discrete.unknowns])
                mean, square = mean + weight * math.sqrt(dual), square + weight * dual
        return mean, square

    def _dual(self, force: Array) -> float:
        """``|f|_{C^-1}^2`` of a force on the unknowns."""
        assert self._viscosity is not None
        (square,) = self.stepper.discrete.vectors.total(float(force @ self._viscosity.solve(force)))
        return max(float(square), 0.0)

    def _energy(self, state: TimeState, load: Array) -> float:
        """E of a state under a load."""
        ledger = state.ledger
        (work,) = self.stepper.discrete.vectors.total(float(load @ state.body.displacement))
        return float(ledger.elastic + ledger.contact - work)


def _moment(power: int, x: float) -> float:
    """``int_0^1 l^power exp(-x l) dl``."""
    if x < 1e-4:
        return 1.0 / (power + 1)  # not less, and nearer than 1e-4
    return float(gammainc(power + 1, x)) * math.factorial(power) / x ** (power + 1)


def bound_in_time(stepper: TimeStepper) -> TimeBound:
    """The bound that a theorem allows for an evolution, or why there is none."""
    discrete = stepper.discrete
    why = _uncovered(discrete, stepper.scheme)
    if why is not None:
        return TimeBound(stepper, "", why)
    assert discrete.viscosity is not None
    stated = discrete.evolution.problem
    law = discrete.problem.law
    if discrete.follows_slip.any():
        return TimeBound(stepper, "", "friction is a law of the slip")
    moving = not law.rubs.any()
    still = moving and all(contact.damping is None for contact in discrete.contacts.values())
    if stated.time_dependent - {"load"}:
        return TimeBound(stepper, "", "supports, gaps or laws change with time")
    straight = ", for loads that are linear in every step" if stated.time_dependent else ""
    factor = None if still and not stated.time_dependent else _definite(discrete.viscosity.inner)
    if factor is None and not (still and not stated.time_dependent):
        return TimeBound(stepper, "", "the viscosity does not resist every motion of the body")
    if still:
        known = smallness(discrete.problem, trace_constant=False, workspace=stepper.stages.workspace)
        if known.sampled:
            return TimeBound(stepper, "", _SAMPLED)
        if not known.margin >= 0.0:
            return TimeBound(stepper, "", "the energy is not convex: the law softens faster than the body is stiff")
        why = f"convex gradient flow (Nochetto, Savare, Verdi){straight}"
        return TimeBound(stepper, "viscosity", why, 1.0 - known.margin, _fading(stated), factor)
    points = discrete.problem.contact.points
    rates = [contact.damping.at(points) for contact in discrete.contacts.values() if contact.damping is not None]
    if any(rate.weak_convexity.any() or not rate.proof("alpha").sure for rate in rates):
        return TimeBound(stepper, "", "a law of the normal rate is not monotone, or not known to be")
    if not all(isinstance(contact.normal, Bilateral | NoContact) for contact in discrete.contacts.values()):
        return TimeBound(stepper, "", "a law of the penetration acts beside a law of the rate")
    viscous = discrete.problem.with_(
        bulk=Quadratic(discrete.viscosity.inner, assembled=True), load=np.zeros(discrete.unknowns)
    )
    known = smallness(viscous, trace_constant=False, workspace=Workspace(1))
    if known.sampled:
        return TimeBound(stepper, "", _SAMPLED)
    constant = known.constant
    if not constant < 1.0:
        return TimeBound(
            stepper, "", f"the law of the rate softens faster than the body is viscous (c = {constant:.3g})"
        )
    return TimeBound(stepper, "stiffness", f"law of the rate, c = {constant:.3g}{straight}", constant, viscosity=factor)


def _definite(C: sp.csr_array) -> SuperLU | None:
    """Factors of a viscosity that is positive definite by more than rounding; None where it is not."""
    diagonal = C.diagonal()
    if not (diagonal > 0.0).all():
        return None
    options = {"SymmetricMode": True, "Equil": False}
    try:
        factor = splu(C.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
    except RuntimeError:  # singular
        return None
    return factor if positive_pivots(factor) and (factor.U.diagonal()[factor.perm_c] > NULL * diagonal).all() else None


def _fading(stated: ContactProblem | FormProblem) -> float:
    """An a >= 0 with ``K >= a C``: the largest with ``A >= a V``, elasticity and viscosity, at every place of a body.

    What varies is looked at in the quadrature points of both matrices.  Of fields of one component none is looked for.
    """
    if not isinstance(stated, ContactProblem) or stated.kind:
        return 0.0
    mesh, material = stated.mesh, stated.material
    alike = material.homogeneous and material.homogeneous_in(True)
    elastic, viscous = (
        of(mesh.points[:1]) if alike else at_quadrature_points(mesh, 2 * stated.order, of)[0]
        for of in (material.stiffness_tensor, material.viscosity_tensor)
    )
    half = np.linalg.inv(np.linalg.cholesky(elastic))
    largest = float(np.linalg.eigvalsh(half @ viscous @ half.swapaxes(-1, -2))[..., -1].max())
    return 1.0 / largest if largest > 0.0 else 0.0


def _uncovered(discrete: DiscreteEvolution, scheme: Scheme) -> str | None:
    contact = discrete.contacts.values()
    if not scheme.supports_time_bound:
        return f"the bounds are proved for implicit Euler, not for {scheme.name}"
    if not discrete.linear:
        return "no bound is known for nonlinear materials"
    if discrete.heat is not None:
        return "no bound is known where heat is coupled with motion"
    if discrete.mass is not None:
        return "no bound is known with inertia"
    if discrete.viscosity is None:
        return "no bound is known without viscosity"
    if discrete.branches:
        return "no bound is known with branches of the material"
    if any(stated.remembers for stated in contact):
        return "no bound is known with internal variables of contact points"
    if discrete.problem.law.state_dependent:
        return "no bound is known where a friction bound depends on the solution"
    return None
