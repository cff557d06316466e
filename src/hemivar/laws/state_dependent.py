"""A contact law whose friction bound depends on penetration and pressure, as Newton's equations ask for it.

With ``p = a r + lam`` the normal law sorts its points first, which gives penetration and pressure and with them the
bound h; then p sorts the tangential components onto the pieces of ``h j_tau``.  The friction of a point that slips is
``h xi`` with ``xi`` in dj_tau, so that its derivative has the part ``xi dh`` beside that of the profile: a matrix that
is not symmetric.  Where the normal component moves, dh follows from its displacement; where it is held (a rigid
obstacle), from the force on it.  In space the direction is that of p, so that friction of a constant profile is the
projection of p onto the ball of radius h.  Where h = 0, as where the contact pulls, nothing holds a point and dh = 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from hemivar.basics.types import Array
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.friction import Friction
from hemivar.laws.friction.bounds import StateBound
from hemivar.laws.separate import GraphPosition, RadialLaw, SeparateLaw

__all__ = ["DependentLaw"]


@dataclass(frozen=True, eq=False)
class DependentLaw:
    """The tables of a law whose bound depends on the state.

    Attributes
    ----------
    law : ContactLaw
    bound : StateBound
    normal : SeparateLaw
        Of the normal component alone.
    unit : SeparateLaw or RadialLaw
        Of all components, with the bound 1.
    factor : float
        The part of the bound that counts.
    """

    law: ContactLaw
    bound: StateBound
    normal: SeparateLaw
    unit: SeparateLaw | RadialLaw
    factor: float = 1.0

    @classmethod
    def of(cls, law: ContactLaw, stiffness: Array, components: int) -> Self | None:
        """The tables of a law, see :meth:`SeparateLaw.of`; None where its bound has no derivatives or it jumps down.

        Parameters
        ----------
        law : ContactLaw
            With resolved parameters.
        stiffness : array (m, 2)
        components : int
        """
        bound = law.friction.bound
        if not law.follows_state or not isinstance(bound, StateBound):
            return None
        one = ContactLaw(law.normal, Friction(1.0, law.friction.profile))
        normal = SeparateLaw.of(one, stiffness, 1)
        of = RadialLaw.of(one, stiffness) if components == 3 else SeparateLaw.of(one, stiffness, components)
        return None if normal is None or of is None else cls(law, bound, normal, of)

    def onto(self, p: Array, r: Array) -> GraphPosition:
        """As :meth:`SeparateLaw.onto`, at the very places of the graphs where laws are straight."""
        first = self.normal.onto(p[:, :1], r[:, :1], exact=True)
        penetration, pressure, held = first.place[:, 0], first.multiplier[:, 0], first.held[:, 0]
        bound = self._value(penetration, pressure)
        on = self.unit.times(bound).onto(p, r, exact=True)
        in_place, in_force = (self.factor * rate for rate in self.bound.slopes(penetration, pressure))
        moves = ~on.held[:, 1:] & (bound > 0.0)[:, None]
        part = np.where(moves, on.multiplier[:, 1:], 0.0) / np.where(bound > 0.0, bound, 1.0)[:, None]
        pushed = np.zeros(p.shape)
        pushed[:, 1:] = part * np.where(held, in_force, 0.0)[:, None]
        rate = np.where(held, 0.0, in_place + in_force * first.curvature[:, 0])
        curvature = on.curvature
        if rate.any():
            if curvature.ndim == 2:
                curvature = np.zeros((*p.shape, p.shape[1]))
                diagonal = np.arange(p.shape[1])
                curvature[:, diagonal, diagonal] = on.curvature
            curvature[:, 1:, 0] = part * rate[:, None]
        return GraphPosition(on.place, on.held, on.multiplier, curvature, on.moved, pushed)

    @property
    def domain(self) -> tuple[Array, Array]:
        """As of the unit tables."""
        return self.unit.domain

    def _value(self, penetration: Array, pressure: Array) -> Array:
        return self.factor * self.bound.value(penetration, pressure)

    def _at(self, penetration: Array, pressure: Array) -> SeparateLaw | RadialLaw:
        return self.unit.times(self._value(penetration, pressure))

    def graph_distance(self, r: Array, lam: Array, tau: Array) -> Array:
        """As :meth:`SeparateLaw.graph_distance`, the bound being that of the very pair."""
        return self._at(r[:, 0], lam[:, 0]).graph_distance(r, lam, tau)

    def least_multiplier(self, r: Array) -> Array:
        """As :meth:`SeparateLaw.least_multiplier`, the bound being that without a pressure."""
        return self._at(r[:, 0], np.zeros(len(r))).least_multiplier(r)
