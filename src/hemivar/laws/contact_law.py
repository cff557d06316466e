"""The law of a contact point: a normal superpotential and a radial friction law in local components."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hemivar.basics.arguments import described
from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.errors import ProblemError
from hemivar.laws.consistency import check_own
from hemivar.laws.friction import Friction, NoFriction
from hemivar.laws.friction.bounds import StateBound, stack_bounds
from hemivar.laws.stacked import stack
from hemivar.laws.superpotential import Superpotential

__all__ = ["ContactLaw", "Linearisation", "spread"]


@dataclass(frozen=True)
class Linearisation:
    """First and second derivative of a contact law on the pieces where it is smooth.

    Attributes
    ----------
    smooth : bool array (m, 2)
        Whether the normal and the tangential part are differentiable at r.
    gradient : array (m, d)
        Derivative of the smooth parts, zero elsewhere.
    hessian : array (m, d, d)
        Second derivative of the smooth parts, zero elsewhere.
    """

    smooth: BoolArray
    gradient: Array
    hessian: Array


@dataclass(frozen=True, eq=False)
class ContactLaw(Portable):
    """j(r) = j_nu(r_nu) + h_tau j_tau(|r_tau|) at every contact point.

    The bound h_tau may depend on penetration or pressure (:class:`~hemivar.laws.StateBound`); then only the parts
    that do not need it answer, until :meth:`frozen` evaluates it.

    Local displacements ``r`` have shape ``(m, d)``: column 0 is the penetration r_nu, the others the slip r_tau.
    Multipliers have the same shape: pressure and friction of the foundation on the body.

    Parameters
    ----------
    normal : Superpotential
        Normal law j_nu.
    friction : Friction
        Friction law h_tau j_tau; none by default.
    """

    normal: Superpotential
    friction: Friction = field(default_factory=NoFriction)

    def __post_init__(self) -> None:
        if isinstance(self.normal, Friction) and isinstance(self.friction, Superpotential):
            raise ProblemError("the normal law and the friction law are swapped; give the normal law first")
        if not isinstance(self.normal, Superpotential):
            raise ProblemError(
                f"the normal law must be a superpotential such as SurveyLaw, not {described(self.normal)}"
            )
        if not isinstance(self.friction, Friction):
            raise ProblemError(
                f"the friction law must be a Friction such as Tresca(0.5), not {described(self.friction)}"
            )
        check_own(self.normal)

    def at(self, points: Array | None) -> ContactLaw:
        """The law with every parameter evaluated at ``points (m, d)``."""
        return ContactLaw(self.normal.at(points), self.friction.at(points))

    @cached_property
    def tangential(self) -> Superpotential:
        """The even scalar law h_tau j_tau."""
        return self.friction.radial

    def take(self, index: IntArray) -> ContactLaw:
        """The law at some of the contact points."""
        return ContactLaw(self.normal.take(index), self.friction.take(index))

    @property
    def state_dependent(self) -> bool:
        """Whether the friction bound depends on penetration or pressure, so that J(w, v) has two arguments."""
        return self.friction.state_dependent

    def frozen(self, r: Array, lam: Array) -> ContactLaw:
        """The ordinary law J(w, .) that holds in a state w; the law itself if it does not depend on the state.

        Parameters
        ----------
        r, lam : arrays (m, d)
            Local displacement and multiplier of the state; penetration and pressure are their first columns.
        """
        if not self.state_dependent:
            return self
        r, lam = np.asarray(r, dtype=float), np.asarray(lam, dtype=float)
        return ContactLaw(self.normal, self.friction.frozen(r[:, 0], lam[:, 0]))

    def frozen_at(self, r: Array) -> ContactLaw:
        """Like :meth:`frozen`, at the pressure of the normal law: the element of dj_nu(r_nu) nearest to zero."""
        if not self.state_dependent:
            return self
        lam = np.zeros(r.shape)
        bound = self.normal.domain
        interval = self.normal.subdifferential(np.clip(r[:, 0], bound.lower, bound.upper))
        lam[:, 0] = np.clip(0.0, interval.lower, interval.upper)
        return self.frozen(r, lam)

    @property
    def lipschitz(self) -> Array:
        """Lipschitz constant of the friction bound in the penetration, shape (m or 1,); 0 if it has none."""
        bound = self.friction.bound
        return bound.lipschitz if isinstance(bound, StateBound) else np.zeros(1)

    @property
    def lipschitz_sampled(self) -> bool:
        """Whether a constant of friction that depends on the penetration is sampled: that of the bound, or c0, c1."""
        bound = self.friction.bound
        if not isinstance(bound, StateBound) or not np.any((bound.lipschitz > 0.0) & (bound.lipschitz < np.inf)):
            return False
        return bound.lipschitz_sampled or self.friction.profile.growth_sampled

    @staticmethod
    def concatenate(laws: Sequence[tuple[ContactLaw, int]]) -> ContactLaw:
        """One law from laws for consecutive blocks of contact points, given as ``(law, number of points)``."""
        laws = [(law, count) for law, count in laws if count > 0]
        if len(laws) == 1:
            return laws[0][0]
        if not laws:
            raise ProblemError("no contact point is left to put a law on")
        bound: Array | StateBound
        if any(law.state_dependent for law, _ in laws):
            bound = stack_bounds(
                [
                    (law.friction.bound if isinstance(law.friction.bound, StateBound) else law.friction.bounds, count)
                    for law, count in laws
                ]
            )
        else:
            bound = np.concatenate([np.broadcast_to(law.friction.bounds, (count,)) for law, count in laws])
        profiles = [(law.friction.profile, count) for law, count in laws]
        same = all(profile is profiles[0][0] for profile, _ in profiles)
        return ContactLaw(
            stack([(law.normal, count) for law, count in laws]),
            Friction(bound, profiles[0][0] if same else stack(profiles)),
        )

    # ---- scalar questions, answered for the vector r ---------------------------------------------------

    def value(self, r: Array) -> Array:
        """j(r), shape (m,); +inf outside the domain."""
        value = self.normal.value(r[:, 0])
        return value + self.tangential.value(_norm(r[:, 1:])) if r.shape[1] > 1 else value

    def distance(self, r: Array, lam: Array) -> Array:
        """Distance of the multiplier to the Clarke subdifferential dj(r), shape (m,)."""
        normal = self.normal.distance(r[:, 0], lam[:, 0])
        if r.shape[1] == 1:
            return normal
        size, direction = _polar(r[:, 1:])
        along = np.einsum("mi,mi->m", direction, lam[:, 1:])
        across = _norm(lam[:, 1:] - along[:, None] * direction)
        moving = np.hypot(self.tangential.distance(size, along), across)
        resting = self.tangential.distance(size, _norm(lam[:, 1:]))
        return np.hypot(normal, np.where(size > 0.0, moving, resting))

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """Distance of ``(r, lam)`` to an exact pair of the law, in units of ``lam``; see the scalar law.

        Parameters
        ----------
        r, lam : arrays (m, d)
        tau : array (m, 2)
            Compliance (length per force per area) that weighs displacement against multiplier, for the normal and
            the tangential part.
        """
        normal = self.normal.graph_distance(r[:, 0], lam[:, 0], tau[:, 0])
        if r.shape[1] == 1:
            return normal
        size, direction = _polar(r[:, 1:])
        along = np.einsum("mi,mi->m", direction, lam[:, 1:])
        across = _norm(lam[:, 1:] - along[:, None] * direction)
        moving = np.hypot(self.tangential.graph_distance(size, along, tau[:, 1]), across)
        to_rest = self.tangential.distance(np.zeros_like(size), _norm(lam[:, 1:]))
        resting = np.hypot(size / tau[:, 1], to_rest)
        return np.hypot(normal, np.minimum(np.where(size > 0.0, moving, np.inf), resting))

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        """The element of dj(r) nearest to ``lam``, (m, d); outside its domain r counts as at the end of it."""
        out = np.empty_like(lam)
        ends = self.normal.domain
        interval = self.normal.subdifferential(np.clip(r[:, 0], ends.lower, ends.upper))
        out[:, 0] = np.clip(lam[:, 0], interval.lower, np.maximum(interval.lower, interval.upper))
        if r.shape[1] > 1:
            size, direction = _polar(r[:, 1:])
            interval = self.tangential.subdifferential(np.minimum(size, self.tangential.domain.upper))
            along = np.clip(np.einsum("mi,mi->m", direction, lam[:, 1:]), interval.lower, interval.upper)
            length, heading = _polar(lam[:, 1:])
            rest = np.minimum(length, np.maximum(interval.upper, 0.0))
            moving = (size > 0.0)[:, None]
            out[:, 1:] = np.where(moving, along[:, None] * direction, rest[:, None] * heading)
        return out

    def local_argmin(self, a: Array, b: Array) -> Array:
        """Minimiser of ``a_n/2 r_n^2 + a_t/2 |r_t|^2 - b.r + j(r)``; ``a (m, 2)``, ``b (m, d)`` -> ``(m, d)``."""
        r = np.empty(b.shape)
        r[:, 0] = self.normal.local_argmin(a[:, 0], b[:, 0])
        if b.shape[1] > 1:
            size, direction = _polar(b[:, 1:])
            length = np.abs(self.tangential.local_argmin(a[:, 1], size))
            r[:, 1:] = length[:, None] * np.where(size[:, None] > 0.0, direction, _first_axis(direction))
        return r

    def prox(self, x: Array, tau: Array) -> Array:
        """Proximal map of j with step ``tau (m, 2)`` for the normal and the tangential part."""
        return self.local_argmin(1.0 / tau, x / spread(tau, x.shape[1]))

    def prox_jacobian(self, x: Array, tau: Array) -> Array:
        """Generalised derivative of :meth:`prox`, one ``(d, d)`` block for each point."""
        m, d = x.shape
        jacobian = np.zeros((m, d, d))
        jacobian[:, 0, 0] = self.normal.prox_slope(x[:, 0], tau[:, 0])
        if d > 1:
            size, direction = _polar(x[:, 1:])
            length = self.tangential.prox(size, tau[:, 1])
            slope = self.tangential.prox_slope(size, tau[:, 1])
            ratio = np.where(size > 0.0, length / np.where(size > 0.0, size, 1.0), slope)
            outer = np.einsum("mi,mj->mij", direction, direction)
            jacobian[:, 1:, 1:] = ratio[:, None, None] * (np.eye(d - 1) - outer) + slope[:, None, None] * outer
        return jacobian

    def linearise(self, r: Array) -> Linearisation:
        """Derivatives of the parts that are smooth at ``r``."""
        m, d = r.shape
        smooth = np.zeros((m, 2), dtype=bool)
        gradient = np.zeros((m, d))
        hessian = np.zeros((m, d, d))
        smooth[:, 0] = ~self.normal.at_kink(r[:, 0])
        gradient[:, 0] = np.where(smooth[:, 0], self.normal.derivative(r[:, 0]), 0.0)
        hessian[:, 0, 0] = np.where(smooth[:, 0], self.normal.curvature(r[:, 0]), 0.0)
        if d > 1:
            size, direction = _polar(r[:, 1:])
            smooth[:, 1] = ~self.tangential.at_kink(size)
            slope = np.where(smooth[:, 1], self.tangential.derivative(size), 0.0)
            curvature = np.where(smooth[:, 1], self.tangential.curvature(size), 0.0)
            gradient[:, 1:] = slope[:, None] * direction
            outer = np.einsum("mi,mj->mij", direction, direction)
            across = np.where(size > 0.0, slope / np.where(size > 0.0, size, 1.0), curvature)
            hessian[:, 1:, 1:] = across[:, None, None] * (np.eye(d - 1) - outer) + curvature[:, None, None] * outer
        return Linearisation(smooth, gradient, hessian)

    def clamp(self, start: Array, end: Array) -> Array:
        """``end``, cut back to the smooth piece on which ``start`` lies."""
        out = end.copy()
        low, high = self.normal.piece_bounds(self.normal.piece_of(start[:, 0]))
        out[:, 0] = np.clip(end[:, 0], low, high)
        if end.shape[1] > 1:
            size, direction = _polar(start[:, 1:])
            low, high = self.tangential.piece_bounds(self.tangential.piece_of(size))
            backwards = (np.einsum("mi,mi->m", direction, end[:, 1:]) <= 0.0) & (low == 0.0)
            length, heading = _polar(end[:, 1:])
            out[:, 1:] = np.where(backwards, 0.0, np.clip(length, low, high))[:, None] * heading
        return out

    def admissible(self, r: Array) -> Array:
        """The local displacement nearest to ``r (m, d)`` in the domain of the laws."""
        out = np.array(r, dtype=float)
        domain = self.normal.domain
        out[:, 0] = np.clip(out[:, 0], domain.lower, domain.upper)
        if out.shape[1] > 1:
            limit = np.broadcast_to(self.friction.profile.domain.upper, (len(out),))
            size = _norm(out[:, 1:])
            outside = size > limit
            out[outside, 1:] *= (limit[outside] / size[outside])[:, None]
        return out

    def recession(self, direction: Array) -> Array:
        """Growth rate of j along each ``direction (m, d)``, shape (m,); may be +inf.

        Friction whose bound depends on the state counts nothing: it may vanish.
        """
        rate = self.normal.recession(direction[:, 0])
        if self.state_dependent:
            return rate
        return rate + self.tangential.recession(_norm(direction[:, 1:])) if direction.shape[1] > 1 else rate

    @property
    def weak_convexity(self) -> tuple[Array, Array]:
        """alpha of the normal and of the tangential part, each of shape (m or 1,)."""
        return self.normal.weak_convexity, self.tangential.weak_convexity


def _norm(x: Array) -> Array:
    return np.abs(x[:, 0]) if x.shape[1] == 1 else np.sqrt(np.einsum("mi,mi->m", x, x))


def _polar(x: Array) -> tuple[Array, Array]:
    """Length and direction of each row; the direction of a zero row is zero."""
    size = _norm(x)
    return size, x / np.where(size > 0.0, size, 1.0)[:, None]


def _first_axis(direction: Array) -> Array:
    axis = np.zeros_like(direction)
    axis[:, 0] = 1.0
    return axis


def spread(tau: Array, d: int) -> Array:
    """(m, 2) normal and tangential numbers as (m, d)."""
    return np.concatenate([tau[:, :1], np.repeat(tau[:, 1:2], d - 1, axis=1)], axis=1)
