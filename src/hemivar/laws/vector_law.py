"""What the law of a contact point must answer, for the vector r of its local displacement."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from hemivar.basics.portable import Portable
from hemivar.basics.types import Array, BoolArray, IntArray

__all__ = ["Linearisation", "Near", "VectorLaw", "spread"]


@dataclass(frozen=True, eq=False)
class Linearisation:
    """First and second derivative of a contact law on the pieces where it is smooth.

    Attributes
    ----------
    smooth : bool array (m, 2)
        Whether the normal and the tangential part are differentiable at r.
    gradient : array (m, c)
        Derivative of the smooth parts, zero elsewhere.
    hessian : array (m, c, c)
        Second derivative of the smooth parts, zero elsewhere.
    """

    smooth: BoolArray
    gradient: Array
    hessian: Array


class Near(Protocol):
    """A law on the pieces on which some local displacements r lie."""

    def clamp(self, end: Array) -> Array:
        """``end (m, c)``, cut back to the pieces."""
        ...

    def gradient(self, place: Array) -> Array:
        """Derivatives (m, c) of the parts that are smooth at ``place (m, c)`` on the pieces, zero at kinks."""
        ...

    def nearest_multiplier(self, lam: Array) -> Array:
        """The element of dj(r) nearest to ``lam``, (m, c); outside its domain r counts as at the end of it."""
        ...


class VectorLaw(Portable, ABC):
    """A law j(r) at every contact point; what solvers and certificates ask of it.

    Local displacements ``r`` have shape ``(m, c)``: column 0 is the penetration r_nu, the others, if there are any, the
    slip r_tau.  Multipliers have the same shape: force per area of the body on the foundation, which is the pressure
    (column 0) and minus the friction.  Numbers for the normal and the tangential part, such as a compliance, have shape
    ``(m, 2)``; where c = 1 the second one is not looked at.
    """

    @abstractmethod
    def at(self, points: Array | None) -> VectorLaw:
        """The law with every parameter evaluated at ``points (m, d)``."""

    @abstractmethod
    def take(self, index: IntArray) -> VectorLaw:
        """The law at some of the contact points."""

    @property
    @abstractmethod
    def state_dependent(self) -> bool:
        """Whether the friction bound depends on penetration or pressure, so that J(w, v) has two arguments."""

    @abstractmethod
    def frozen(self, r: Array, lam: Array) -> VectorLaw:
        """The ordinary law J(w, .) that holds in a state w; the law itself if it does not depend on the state.

        Parameters
        ----------
        r, lam : arrays (m, c)
            Local displacement and multiplier of the state; penetration and pressure are their first columns.
        """

    @abstractmethod
    def frozen_at(self, r: Array) -> VectorLaw:
        """Like :meth:`frozen`, at the pressure of the normal law: the element of dj_nu(r_nu) nearest to zero."""

    @property
    @abstractmethod
    def lipschitz(self) -> Array:
        """Lipschitz constant of the friction bound in the penetration, shape (m or 1,); 0 if it has none."""

    @property
    @abstractmethod
    def lipschitz_sampled(self) -> bool:
        """Whether a constant of friction that depends on the penetration is sampled: that of the bound, or c0, c1."""

    @abstractmethod
    def value(self, r: Array) -> Array:
        """j(r), shape (m,); +inf outside the domain."""

    @abstractmethod
    def distance(self, r: Array, lam: Array) -> Array:
        """Distance of the multiplier to the Clarke subdifferential dj(r), shape (m,)."""

    @abstractmethod
    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """Distance of ``(r, lam)`` to an exact pair of the law, in units of ``lam``; see the scalar law.

        Parameters
        ----------
        r, lam : arrays (m, c)
        tau : array (m, 2)
            Compliance (length per force per area) that weighs displacement against multiplier, for the normal and
            the tangential part.
        """

    @abstractmethod
    def near(self, r: Array) -> Near:
        """The law on the pieces on which ``r (m, c)`` lies."""

    def nearest_multiplier(self, r: Array, lam: Array) -> Array:
        """The element of dj(r) nearest to ``lam``, (m, c); outside its domain r counts as at the end of it."""
        return self.near(r).nearest_multiplier(lam)

    @abstractmethod
    def local_argmin(self, a: Array, b: Array) -> Array:
        """Minimiser of ``a_n/2 r_n^2 + a_t/2 |r_t|^2 - b.r + j(r)``; ``a (m, 2)``, ``b (m, c)`` -> ``(m, c)``."""

    @abstractmethod
    def prox_jacobian(self, x: Array, tau: Array) -> Array:
        """Generalised derivative of :meth:`prox`, one ``(c, c)`` block for each point."""

    @abstractmethod
    def linearise(self, r: Array) -> Linearisation:
        """Derivatives of the parts that are smooth at ``r``."""

    def clamp(self, start: Array, end: Array) -> Array:
        """``end``, cut back to the smooth piece on which ``start`` lies."""
        return self.near(start).clamp(end)

    @abstractmethod
    def admissible(self, r: Array) -> Array:
        """The local displacement nearest to ``r (m, c)`` in the domain of the laws."""

    @abstractmethod
    def recession(self, direction: Array) -> Array:
        """Growth rate of j along each ``direction (m, c)``, shape (m,); may be +inf.

        Friction whose bound depends on the state counts nothing: it may vanish.
        """

    @property
    @abstractmethod
    def weak_convexity(self) -> tuple[Array, Array]:
        """alpha of the normal and of the tangential part, each of shape (m or 1,)."""

    def prox(self, x: Array, tau: Array) -> Array:
        """Proximal map of j with step ``tau (m, 2)`` for the normal and the tangential part."""
        return self.local_argmin(1.0 / tau, x / spread(tau, x.shape[1]))


def spread(tau: Array, c: int) -> Array:
    """(m, 2) normal and tangential numbers as (m, c)."""
    return np.concatenate([tau[:, :1], np.repeat(tau[:, 1:2], c - 1, axis=1)], axis=1)
