"""A brittle bond with plastic slip beside it: energetic mode mixity.

Stored per area, with the opening w, the slip s, the bond beta (1 or 0) and the plastic slip pi:
``beta [k_n <w>^2 + k_t |s - pi|^2]/2 + kappa |pi|^2/2``; lost: ``a0`` for a bond that breaks and ``sigma_y |d pi|``.
Opening breaks the bond at the energy a0.  In shear the plastic slip takes more (Roubicek, Mantic and Panagiotopoulos
2013), ``G_II = a0 + (t_c^2 - sigma_y^2)/(2 kappa)`` with the traction at the break ``t_c = sqrt(2 k_t a0) > sigma_y``.

A step is solved in two parts that alternate: with the bonds of the step before, displacement and plastic slip minimise
the energy; then the bonds whose energy has reached a0 break.  With pi minimised at each point the first part is a law:
with ``c = (1 + kappa/k) pi_n``, ``k = beta k_t`` and ``y = |s - c|``

    j_tau(s) = k y^2/2 - <k y - sigma_y>^2 / (2 (k + kappa)) + kappa pi_n.(s - c),

which is convex, so that the part has one solution in a body that is held.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from hemivar.basics.arguments import described, number
from hemivar.basics.portable import PickleMixin
from hemivar.basics.types import Array, BoolArray
from hemivar.errors import ProblemError
from hemivar.laws.contact_law import ContactLaw
from hemivar.laws.coupled.shifted import ShiftedLaw
from hemivar.laws.friction import Friction
from hemivar.laws.neighbourhood import lengths
from hemivar.laws.normal import Signorini
from hemivar.laws.piecewise import PiecewiseQuadratic
from hemivar.laws.superpotential import Superpotential
from hemivar.laws.transformed import plus

__all__ = ["BondState", "PlasticBond"]

_POSITIVE = ("stiffness", "shear_stiffness", "energy", "yield_traction", "hardening")


@dataclass(frozen=True, eq=False)
class BondState(PickleMixin):
    """What the contact points remember.

    Attributes
    ----------
    bonded : bool array (m or 1,)
    plastic : array (m or 1, c - 1 or 1)
        Plastic slip pi.
    """

    bonded: BoolArray
    plastic: Array


@dataclass(frozen=True, eq=False)
class PlasticBond(PickleMixin):
    """A bond that breaks, with plastic slip that hardens.

    Parameters
    ----------
    stiffness, shear_stiffness : float
        k_n and k_t, > 0 (force per area and length).
    energy : float
        a0, what a bond costs, and the fracture energy in opening, > 0 (force per length).
    yield_traction : float
        sigma_y, > 0 (force per area).
    hardening : float
        kappa, > 0 (force per area and length).
    compression : Superpotential
        Normal law in penetration: :class:`Signorini` (default) or :class:`Compliance`.

    Raises
    ------
    ProblemError
        A parameter is not positive, or no law.
    """

    stiffness: float
    shear_stiffness: float
    energy: float
    yield_traction: float
    hardening: float
    compression: Superpotential = field(default_factory=Signorini)

    def __post_init__(self) -> None:
        for what in _POSITIVE:
            value = number(getattr(self, what), f"{what} of the plastic bond", "give a number")
            if not 0.0 < value < np.inf:
                raise ProblemError(f"{what} of the plastic bond is {value:g}; it must be positive")
        if not isinstance(self.compression, Superpotential):
            raise ProblemError(
                f"the compression of the plastic bond is {described(self.compression)}; give Signorini() or "
                "Compliance(stiffness)"
            )

    @classmethod
    def of_energies(
        cls,
        stiffness: float,
        shear_stiffness: float,
        energy: float,
        shear_energy: float,
        yield_traction: float,
        compression: Superpotential | None = None,
    ) -> PlasticBond:
        """The bond with the hardening that makes ``shear_energy`` the fracture energy in shear.

        Raises
        ------
        ProblemError
            The yield traction is not reached before the break, or shear costs no more than opening.
        """
        checked = cls(stiffness, shear_stiffness, energy, yield_traction, 1.0)
        strength = checked.shear_strength
        if yield_traction >= strength:
            raise ProblemError(
                f"yield_traction = {yield_traction:g} of the plastic bond is not reached before the break at "
                f"{strength:g}; take a lower one"
            )
        if not shear_energy > energy:
            raise ProblemError(
                f"shear_energy = {shear_energy:g} of the plastic bond must exceed the energy of opening, {energy:g}: "
                "plastic slip takes the rest"
            )
        hardening = 0.5 * (strength**2 - yield_traction**2) / (shear_energy - energy)
        shut = Signorini() if compression is None else compression
        return cls(stiffness, shear_stiffness, energy, yield_traction, hardening, shut)

    @property
    def shear_strength(self) -> float:
        """Shear traction t_c at which the bond breaks without opening."""
        return float(np.sqrt(2.0 * self.shear_stiffness * self.energy))

    @property
    def shear_energy(self) -> float:
        """Fracture energy in shear, plastic and hardening parts included; that of opening without plastic slip."""
        more = max(self.shear_strength**2 - self.yield_traction**2, 0.0)
        return self.energy + 0.5 * more / self.hardening

    def start(self) -> BondState:
        """Bonded everywhere, without plastic slip."""
        return BondState(np.ones(1, dtype=bool), np.zeros((1, 1)))

    def step_law(self, state: BondState) -> ShiftedLaw:
        """The law of displacements with the bonds of a state, plastic slip minimised; convex."""
        m = max(len(state.bonded), len(state.plastic))
        bonded = np.broadcast_to(state.bonded, (m,))
        shear = np.where(bonded, self.shear_stiffness, 0.0)
        opening = np.where(bonded, self.stiffness, 0.0)
        zero = np.zeros((m, 1))
        springs = PiecewiseQuadratic(zero, np.stack([opening, 0.0 * opening], axis=1), zero, name="bond")
        normal = plus(self.compression.at(None), springs)
        first = self.yield_traction / self.shear_stiffness
        later = shear * self.hardening / (shear + self.hardening)
        knots = np.tile([[-first, 0.0, first]], (m, 1))
        slopes = np.stack([later, shear, shear, later], axis=1)
        profile = PiecewiseQuadratic(knots, slopes, np.zeros((m, 3)), -shear * first, name="plastic slip")
        ratio = np.where(bonded, 1.0 + self.hardening / self.shear_stiffness, 0.0)
        pull = np.where(bonded, self.hardening, 0.0)
        plastic = state.plastic
        return ShiftedLaw(
            ContactLaw(normal, Friction(1.0, profile)).at(None), ratio[:, None] * plastic, pull[:, None] * plastic
        )

    def advance(self, state: BondState, r: Array) -> BondState:
        """The state after a step that ends at local displacements ``r (m, c)``; bonds never heal."""
        slip, plastic = r[:, 1:], np.broadcast_to(state.plastic, r[:, 1:].shape)
        bonded = np.broadcast_to(state.bonded, (len(r),))
        shear = np.where(bonded, self.shear_stiffness, 0.0)
        drive = shear[:, None] * (slip - plastic) - self.hardening * plastic
        size = lengths(drive) if drive.shape[1] else np.zeros(len(r))
        flow = np.maximum(size - self.yield_traction, 0.0) / (shear + self.hardening)
        plastic = plastic + (flow / np.where(size > 0.0, size, 1.0))[:, None] * drive
        return BondState(bonded & (self.bond_energy(plastic, r) < self.energy), plastic)

    def bond_energy(self, plastic: Array, r: Array) -> Array:
        """Energy per area of an intact bond at ``r (m, c)``, (m,)."""
        elastic = r[:, 1:] - plastic
        opening = np.maximum(-r[:, 0], 0.0)
        return np.asarray(0.5 * (self.stiffness * opening**2 + self.shear_stiffness * (elastic**2).sum(axis=1)))

    def stored(self, state: BondState, r: Array) -> Array:
        """Energy per area in bonds, hardening and compression at the end of a step, (m,)."""
        plastic = np.broadcast_to(state.plastic, r[:, 1:].shape)
        kept = np.where(state.bonded, self.bond_energy(plastic, r), 0.0)
        pushed = self.compression.at(None).value(np.maximum(r[:, 0], 0.0))
        return np.asarray(kept + 0.5 * self.hardening * (plastic**2).sum(axis=1) + pushed)

    def dissipated(self, old: BondState, new: BondState) -> Array:
        """Energy per area lost between two states, (m,): for bonds that broke, and for plastic slip."""
        broke = old.bonded & ~new.bonded
        flow = new.plastic - old.plastic
        return np.asarray(np.where(broke, self.energy, 0.0) + self.yield_traction * np.linalg.norm(flow, axis=1))

    def describe(self) -> str:
        """Energies and tractions, in words."""
        strength = self.shear_strength
        plastic = max(strength - self.yield_traction, 0.0) / self.hardening
        return "\n".join(
            (
                f"plastic bond; in penetration {self.compression.name}",
                f"opening           breaks at the traction {np.sqrt(2.0 * self.stiffness * self.energy):.6g}, costs "
                f"{self.energy:.6g}",
                f"shear             yields at {self.yield_traction:.6g}, breaks at {strength:.6g}, costs "
                f"{self.shear_energy:.6g}",
                f"hardening         {self.hardening:.6g}",
                f"at the break      plastic slip {plastic:.8g}, slip {plastic + strength / self.shear_stiffness:.8g} "
                "(shear alone)",
            )
        )

    @property
    def stated(self) -> Mapping[str, object]:
        """Parameters by name."""
        return MappingProxyType({what: getattr(self, what) for what in _POSITIVE})
