"""The graph of a law whose friction bound depends on the state, penetration or pressure, in two dimensions.

The friction is ``h(r_nu, lam_nu) xi`` with ``xi in dj_tau(r_tau)``: the curve of each tangential component is that of
the profile alone, ``(r_tau, xi)``, and the bound is a factor that couples it with the normal component of its point,

    F(theta) = A r(theta) + W lambda(theta) - g,   lambda_tau = h(r_nu(theta_nu), lam_nu(theta_nu)) xi(theta_tau).

Nothing is frozen, so that the zeros of F are the solutions, and its Jacobian is that of the whole operator.
"""

from __future__ import annotations

import numpy as np

from hemivar.basics.first_use import cached_property
from hemivar.basics.types import Array, BoolArray, IntArray
from hemivar.laws import ContactLaw, Friction, StateBound, separable
from hemivar.systems.chain import Chain, chain_of
from hemivar.systems.condensed import CondensedProblem

__all__ = ["StateChain", "state_chain_of"]

#: Step of the central differences of a bound, relative to a typical size: their error is 1e-12 by curvature and 1e-10
#: by rounding, and Newton's method needs neither. 1e-5 and 1e-7 give the same solutions in tests/branches.
_STEP = 1e-6


class StateChain(Chain):
    """The curves of the normal law and of the friction profile, with the bound between them."""

    @staticmethod
    def graph_law(system: CondensedProblem) -> ContactLaw:
        """The normal law, and the friction profile with the bound 1."""
        stated = separable(system.law, "a bound that depends on the state")
        return ContactLaw(stated.normal, Friction(1.0, stated.friction.profile))

    @staticmethod
    def lengths(system: CondensedProblem, point: IntArray, column: IntArray) -> Array:
        """Lengths that stand for a unit of the multiplier, or of the profile's derivative, (n,)."""
        plain = Chain.lengths(system, point, column)
        return np.where(column > 0, system.length_scale, plain)

    @cached_property
    def tangential(self) -> BoolArray:
        """Which components are tangential, (n,)."""
        return np.asarray(self.column > 0)

    @cached_property
    def partner(self) -> IntArray:
        """The normal component of the point of each component, -1 where it is held, (n,)."""
        out = np.full(self.system.shape[0], -1, dtype=np.int64)
        normal = np.flatnonzero(~self.tangential)
        out[self.point[normal]] = normal
        return out[self.point]

    @cached_property
    def _bound(self) -> StateBound:
        bound = separable(self.system.law, "a bound that depends on the state").friction.bound
        assert isinstance(bound, StateBound)
        return bound

    def _state(self, r: Array, lam: Array) -> tuple[Array, Array]:
        """Penetration and pressure of all contact points, ``(m,)`` or ``(k, m)`` each."""
        shape, normal = (*r.shape[:-1], self.system.shape[0]), ~self.tangential
        full_r, full_lam = np.array(np.broadcast_to(self.system.fixed[:, 0], shape)), np.zeros(shape)
        full_r[..., self.point[normal]], full_lam[..., self.point[normal]] = r[..., normal], lam[..., normal]
        return full_r, full_lam

    def _value(self, penetration: Array, pressure: Array) -> Array:
        """The bound of all contact points, ``(m,)`` or ``(k, m)``."""
        bound = self._bound if penetration.ndim == 1 else self._bound.take(self.copied(len(penetration)))
        return bound.value(penetration.ravel(), pressure.ravel()).reshape(penetration.shape)

    def _rates(self, r: Array, lam: Array) -> tuple[Array, Array]:
        """Derivatives of h in penetration and pressure at the point of each component, of the shape of ``r``."""
        full_r, full_lam = self._state(r, lam)
        length, pressure = _STEP * self.system.length_scale, _STEP * self.system.pressure_scale
        value = self._value
        in_r = (value(full_r + length, full_lam) - value(full_r - length, full_lam)) / (2.0 * length)
        in_lam = np.zeros_like(in_r)
        if np.isinf(self._bound.lipschitz).any():
            in_lam = (value(full_r, full_lam + pressure) - value(full_r, full_lam - pressure)) / (2.0 * pressure)
        return in_r[..., self.point], in_lam[..., self.point]

    def balance(self, theta: Array, segment: IntArray, force: Array) -> tuple[Array, Array]:
        """F and dF/dtheta on the given segments."""
        r, lam, dr, dlam = self.evaluate(theta, segment)
        factor, (in_r, in_lam) = self.factors(r, lam), self._rates(r, lam)
        jacobian = self.matrix * dr[..., None, :]
        jacobian[..., self._rows, self._rows] += self.weights * factor * dlam
        coupled = np.flatnonzero(self.tangential & (self.partner >= 0))
        partner = self.partner[coupled]
        rate = in_r[..., coupled] * dr[..., partner] + in_lam[..., coupled] * dlam[..., partner]
        jacobian[..., coupled, partner] += self.weights[coupled] * lam[..., coupled] * rate
        return r @ self.matrix.T + self.weights * factor * lam - force, jacobian

    def factors(self, r: Array, lam: Array) -> Array:
        """The bound of each tangential component, 1 for a normal one."""
        return np.where(self.tangential, self._value(*self._state(r, lam))[..., self.point], 1.0)

    def nearest(self, r: Array, lam: Array) -> tuple[Array, IntArray]:
        """theta and segment of the point of each curve nearest to ``(r, lam)``, both (m, d)."""
        value = self._bound.value(r[:, 0], lam[:, 0])
        scaled = np.array(lam)
        scaled[:, 1] = np.where(value > 0.0, lam[:, 1] / np.where(value > 0.0, value, 1.0), 0.0)
        return super().nearest(r, scaled)


def state_chain_of(system: CondensedProblem) -> StateChain:
    """The curves of a condensed problem in two dimensions whose friction bound depends on the solution."""
    return chain_of(system, StateChain)
